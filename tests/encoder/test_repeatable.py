"""Equal input and options give equal bytes: on any number of threads, with workers, elsewhere, on older processors."""

import hashlib
import json
import os
import platform
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from threadpoolctl import threadpool_info

import meshreel
from meshreel.encoder.group.digests import line_of, listener, note, noted
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.settings import Settings
from meshreel.format.layout import ChunkKind
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh, MeshList, Texture
from tests.small_bodies import body
from tests.small_options import quick, with_method
from tests.small_scene import scene

ROOT = Path(__file__).resolve().parents[2]
TWO = [concatenate([mesh, Mesh(4 - 0.75 * mesh.vertices, mesh.faces[:, ::-1])]) for mesh in body(1, 2)]
FLAT = TWO[0].vertices[:, :2] / 8 + 0.5
CHECKS = Texture.of(((np.indices((64, 64)) // 8).sum(axis=0) % 2 * 200).astype(np.uint8)[..., None].repeat(3, axis=2))
COLORED = [replace(mesh, colors=(128 + 40 * np.sin(3 * mesh.vertices)).astype(np.uint8)) for mesh in body(2, 2)]
SEQUENCES = {
    "body": (body(1, 5), "best"),
    "noisy body with colours": (COLORED, "best"),
    "two bodies": (TWO, "best"),
    "textured": ([replace(mesh, uv=FLAT[mesh.faces].astype(np.float32), texture=CHECKS) for mesh in TWO], "best"),
    "paper": (body(3, 3), "paper"),
}
PROGRAM = """
import sys
from tests.encoder.test_repeatable import encode_all
sys.stdout.write(encode_all(int(sys.argv[1])))
"""


def encode_all(jobs: int) -> str:
    """Digests of the files and of all stages, a line each."""
    from meshreel.cli.encode import workers

    found = list[str]()
    with workers(jobs) as executor:
        for name, (frames, preset) in SEQUENCES.items():
            options = with_method(quick(preset, key_interval=0.4 if preset == "best" else None), group_size=2)
            options = replace(options, appearance=Settings(texture=128, compatible=True).resolved().appearance)
            path = Path(f"repeatable {os.getpid()}.reel")
            Encoder(MeshList(tuple(frames), 10.0), executor, digests=found.append).encode(path, options)
            with meshreel.open(path) as video:
                count = sum(chunk.kind in (ChunkKind.PICTURES, ChunkKind.COMPATIBLE) for chunk in video.reader.chunks)
            found.append(f"{name} {hashlib.sha256(path.read_bytes()).hexdigest()} {count} videos\n")
            path.unlink()
    return "".join(found)


def encoded(folder: Path, jobs: int = 1, **environment: str) -> str:
    """What `encode_all` returns in a process of its own, in which such variables are set before anything is loaded."""
    folder.mkdir(parents=True, exist_ok=True)
    variables = os.environ | {"PYTHONPATH": str(ROOT)} | environment
    program = folder / "program.py"
    program.write_text(f"if __name__ == '__main__':\n{''.join('    ' + line for line in PROGRAM.splitlines(True))}")
    command = [sys.executable, "program.py", str(jobs)]
    done = subprocess.run(command, cwd=folder, env=variables, capture_output=True, text=True, timeout=600)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def alone(tmp_path_factory: pytest.TempPathFactory) -> str:
    """What one thread of one process makes."""
    return encoded(tmp_path_factory.mktemp("alone"), OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1")


def test_threads_workers_locale_hash_seed_and_folder_do_not_matter(alone: str, tmp_path: Path):
    assert alone.count("payload") >= 4  # stages are compared, too
    assert re.search(r"^textured \w+ 4 videos$", alone, re.MULTILINE)
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "IGL_NUM_THREADS"), "2")
    other = {"LC_ALL": "tr_TR.UTF-8", "PYTHONHASHSEED": "7"}
    assert encoded(tmp_path / "else where", jobs=2, **threads, **other) == alone


@pytest.mark.parametrize("name", SEQUENCES)
def test_threads_that_take_turns_all_the_time_give_the_same_bytes(name: str, tmp_path: Path):
    frames, preset = SEQUENCES[name]
    options = replace(quick(preset), appearance=Settings(texture=128).resolved().appearance)
    for jobs in (1, 3):
        before = sys.getswitchinterval()
        sys.setswitchinterval(before if jobs == 1 else 1e-5)
        try:
            encoder = Encoder(MeshList(tuple(frames), 10.0), jobs=jobs)
            encoder.encode(tmp_path / f"{jobs}.reel", options)
        finally:
            sys.setswitchinterval(before)
    assert (tmp_path / "1.reel").read_bytes() == (tmp_path / "3.reel").read_bytes()


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="names instructions of x86")
@pytest.mark.slow
def test_instructions_of_an_older_processor_give_the_same_bytes(alone: str, tmp_path: Path):
    from numpy._core import _multiarray_umath as core

    without = [name for name in core.__cpu_dispatch__ if core.__cpu_features__.get(name)]
    plain = {"NPY_DISABLE_CPU_FEATURES": " ".join(without), "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-AVX,-FMA"}
    assert encoded(tmp_path, OPENBLAS_CORETYPE="Prescott", **plain) == alone


def test_the_encoder_and_its_callers_have_threads_of_their_own(tmp_path: Path):
    def threads() -> list[int]:
        return [pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas"]

    before, during = threads(), list[int]()
    encoder = Encoder(MeshList(tuple(body(0, 1)), 10.0), progress=lambda *_: during.extend(threads()))
    encoder.encode(tmp_path / "a.reel", quick())
    assert set(during) == {1}
    assert threads() == before


def test_lines_of_digests_name_each_stage_in_the_order_of_the_file(tmp_path: Path):
    lines, options = list[str](), quick(key_interval=0.2)
    encoder = Encoder(MeshList(tuple(body(1, 3)), 10.0), digests=lines.append)
    encoder.encode(tmp_path / "a.reel", options)
    rows = [json.loads(line) for line in "".join(lines).splitlines()]
    assert [row.get("frame") for row in rows if row["stage"] == "payload"] == [0, 1]
    stages = [row["stage"] for row in rows if row.get("frame") == 1]
    wanted = {"frames", "template, coded", "first fit", "plans", "fit", "fields and symbols"}
    wanted |= {"patches", "fidelity", "payload"}
    assert set(stages) == wanted
    assert (stages[0], stages[-1]) == ("frames", "payload")
    assert rows[0]["stage"] == "survey"
    again = list[str]()
    with ThreadPoolExecutor(2) as executor:
        Encoder(MeshList(tuple(body(1, 3)), 10.0), executor, digests=again.append).encode(tmp_path / "b.reel", options)
    assert again == lines


def test_scenes_have_lines_of_their_background(tmp_path: Path):
    lines = list[str]()
    Encoder(scene(4), digests=lines.append).encode(tmp_path / "a.reel", quick())
    stages = [json.loads(line)["stage"] for line in "".join(lines).splitlines()]
    assert stages[0] == "survey"
    assert stages.index("background and noise") < stages.index("background, coded") < stages.index("payload")


def test_a_digest_tells_values_shapes_and_types_apart():
    zeros = np.zeros((2, 3))
    kinds = [zeros, zeros.T, zeros.astype(np.float32), zeros + 1, b"\0" * 48, 0.0, None, "0.0"]
    assert len({line_of("stage", kind) for kind in kinds}) == len(kinds)


def test_stages_tell_who_listens_in_this_context_and_no_other_one():
    outer, inner = list[str](), list[str]()
    note("nobody listens", 1)
    with noted(outer.append):
        with noted(inner.append, track=1, frame=20), ThreadPoolExecutor(1) as executor:
            note("stage", 2)
            assert executor.submit(listener).result() is None
        with noted(None):
            note("nobody listens", 3)
        note("later", 4)
    rows = [[json.loads(line) for line in lines] for lines in (outer, inner)]
    assert [[(row["stage"], row.get("frame")) for row in some] for some in rows] == [[("later", None)], [("stage", 20)]]
    assert listener() is None
