"""The wheel, as a user gets it: built, installed into a new environment with the extra `play`, and played from."""

import hashlib
import json
import os
import re
import subprocess
import sys
import tarfile
import urllib.request
import venv
import zipfile
from pathlib import Path

import pytest

from tests.golden import GOLDEN

ROOT = Path(__file__).resolve().parents[1]
FILE = GOLDEN / "scene.reel"
PAGES = ("CHANGELOG.md", "CONTRIBUTING.md", "FORMAT.md", "README.md")
PIP = ("-m", "pip", "--quiet", "--disable-pip-version-check")


def fetch(address: str) -> bytes:
    with urllib.request.urlopen(address, timeout=60) as answer:
        return answer.read()


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel of `meshreel`, built from this checkout."""
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run([sys.executable, *PIP, "wheel", str(ROOT), "--no-deps", "-w", str(folder)], check=True)
    [found] = folder.glob("meshreel-*.whl")
    return found


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory):
    """The folder of an sdist of this checkout, unpacked where nothing else is."""
    folder = tmp_path_factory.mktemp("a folder of another name")
    subprocess.run(
        [sys.executable, "-m", "build", "--sdist", "--outdir", folder, ROOT], check=True, capture_output=True
    )
    [found] = folder.glob("meshreel-*.tar.gz")
    with tarfile.open(found) as archive:
        archive.extractall(folder, filter="data")
    return folder / found.name.removesuffix(".tar.gz")


@pytest.fixture(scope="module")
def python(wheel):
    """The interpreter of a new environment that has the wheel and nothing of this checkout."""
    folder = wheel.parent / "venv"
    venv.create(folder, with_pip=True)
    found = folder / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    subprocess.run([found, *PIP, "install", f"{wheel}[play]"], check=True)
    return found


@pytest.mark.slow
def test_the_wheel_contains_the_product_and_nothing_else(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.split("/")[0].split("-")[0] for name in names} == {"meshreel"}
    assert not [name for name in names if "bench" in name]
    assert [name for name in names if name.startswith("meshreel/_core")]


@pytest.mark.slow
def test_the_sdist_contains_what_the_wheel_is_built_from_and_nothing_else(unpacked):
    names = {path.name for path in unpacked.iterdir()}
    assert names == {"CMakeLists.txt", "LICENSE", "NOTICE", "PKG-INFO", "core", "pyproject.toml", "src", *PAGES}
    assert {path.name for path in (unpacked / "core").iterdir()} == {
        "decoder",
        "include",
        "python",
        "src",
        "strict_arithmetic.cmake",
    }
    assert [path for path in unpacked.rglob("*") if path.suffix in (".so", ".pyd", ".pyc")] == []


@pytest.mark.slow
def test_the_wheel_of_the_sdist_alone_has_the_same_bytes(wheel, unpacked, tmp_path):
    """Built again, in another folder, without git, from a fresh build folder."""
    subprocess.run([sys.executable, *PIP, "wheel", str(unpacked), "--no-deps", "-w", str(tmp_path)], check=True)
    again = tmp_path / wheel.name
    assert hashlib.sha256(again.read_bytes()).digest() == hashlib.sha256(wheel.read_bytes()).digest()


@pytest.mark.slow
def test_the_wheel_without_the_bench_names_its_distribution(python, tmp_path):
    command = [python, "-m", "meshreel", "bench", "run", "figure6"]
    answer = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert answer.returncode == 2 and "pip install meshreel-bench" in answer.stderr


@pytest.mark.slow
def test_an_installed_wheel_plays_a_file_with_the_player_that_it_brings(python, tmp_path):
    """`--no-browser`, then what a browser would fetch: page, scripts, wasm, licences, file."""
    process = subprocess.Popen(
        [python, "-m", "meshreel", "play", str(FILE), "--no-browser", "--json"],
        stdout=subprocess.PIPE,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONUNBUFFERED": "1"},
    )
    try:
        address = json.loads(process.stdout.readline())["addresses"][0]
        page = fetch(address).decode()
        assert '<meshreel-player src="/files/scene.reel"' in page
        [scripts] = re.findall(r'src="/(player/[^/"]+)/page.js"', page)
        names = {path.name for path in (ROOT / "src/meshreel/player").iterdir()}
        assert {
            "meshreel-player.js",
            "three.js",
            "three.js.br",
            "worker.js",
            "order.js",
            "core.wasm",
            "core.wasm.gz",
            "load.js",
            "page.js",
        } <= names
        assert "LICENSES.txt" in names
        for name in (name for name in names if not name.endswith(".br")):  # those are sent in the place of others
            assert fetch(f"{address}{scripts}/{name}") == (ROOT / "src/meshreel/player" / name).read_bytes()
        assert fetch(f"{address}files/scene.reel") == FILE.read_bytes()
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
def test_what_the_extra_play_leaves_out_is_told(python, tmp_path):
    command = [python, "-m", "meshreel", "encode", str(tmp_path), "-o", str(tmp_path / "out.reel")]
    said = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert said.returncode == 2 and "Traceback" not in said.stderr and said.stderr.count("\n") == 1
