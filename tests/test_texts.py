"""Texts of other people's files, hostile ones at each door that reads them; and what the project itself pins."""

import json
import re
import time
from pathlib import Path

import pytest

from meshreel.capture.calibration.poses import read_poses
from meshreel.cli import main
from meshreel.encoder.run.surveying import read_survey
from meshreel.errors import FormatError, InputError
from meshreel.format.checks import parse_metadata
from meshreel.geometry.cameras import unpack_cameras
from meshreel.io.files import read_json
from meshreel.io.sequence import capture_record
from meshreel.texts import MOST_TOML, MOST_YAML, json_of, yaml_of
from tests.golden import GOLDEN

ROOT = Path(__file__).resolve().parents[1]
DEEP = "[" * 100_000
OBJECTS = '{"a":' * 100_000
LONG = '{"a": ' + "1" * 100_000 + "}"
HALF = '{"a": "\\ud800"}'
HOSTILE = [DEEP, DEEP + "]" * 100_000, OBJECTS, LONG, HALF, '{"a": "\\udc00\\ud800"}', "\0", "{", ""]


@pytest.mark.parametrize("text", HOSTILE)
def test_json_that_cannot_be_kept_is_a_value_error(text):
    for data in (text, text.encode()):
        with pytest.raises(ValueError):
            json_of(data)


def test_honest_json_is_read_in_any_encoding():
    for value in ({"a": [1, 2.5, "ä😀"], "b": None}, [[[[]]]], "x"):
        text = json.dumps(value)
        assert json_of(text) == json_of(text.encode("utf-8-sig")) == json_of(text.encode("utf-16")) == value


def opened(act):
    """Return what an act raises of ours, None if it takes the text."""
    begin = time.process_time()
    try:
        act()
    except (InputError, FormatError) as error:
        assert len(str(error)) < 600 and "\n" not in str(error)
        return error
    finally:
        assert time.process_time() - begin < 20
    return None


@pytest.mark.parametrize("text", HOSTILE)
def test_each_door_for_json_refuses_it_in_one_line(tmp_path, text, capsys):
    path = tmp_path / "a.json"
    path.write_text(text)
    (tmp_path / "capture.json").write_text(text)
    assert opened(lambda: parse_metadata(text))
    assert opened(lambda: unpack_cameras(text.encode(), "rig"))
    for read in (read_poses, read_survey, lambda path: read_json(path, "mend it")):
        assert str(opened(lambda read=read: read(path))).startswith(str(path))
    assert capture_record(tmp_path) == {}
    length = len(text) + -len(text) % 4
    glb = b"glTF" + b"".join(n.to_bytes(4, "little") for n in (2, 20 + length, length, 0x4E4F534A))
    (tmp_path / "a.glb").write_bytes(glb + text.ljust(length).encode())
    assert main(["encode", str(tmp_path / "a.glb"), "-o", str(tmp_path / "a.reel")]) == 2
    assert "Traceback" not in capsys.readouterr().err and not (tmp_path / "a.reel").exists()


@pytest.mark.parametrize("text", [*HOSTILE, "NaN", "[NaN]", "-Infinity", "1e999", '{"a": [1e999]}'])
def test_tag_keeps_such_values_as_text_or_refuses_them_in_one_line(tmp_path, text, capsys):
    if "\0" in text:
        pytest.skip("no argument of a command has it")
    out = tmp_path / "a.reel"
    code = main(["tag", str(GOLDEN / "layers.reel"), f"x={text[:60_000]}", "-o", str(out)])
    said = capsys.readouterr().err
    assert code in (0, 2) and "Traceback" not in said and said.count("\n") <= 1
    assert out.exists() == (code == 0)
    if code == 0:
        assert main(["info", str(out), "--json"]) == 0
        json.loads(capsys.readouterr().out, parse_constant=pytest.fail)


LAUGHS = "a0: &a0 [1, 1]\n" + "".join(f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]\n" for k in range(1, 12))
MERGED = "a0: &a0 {x: 1}\n" + "".join(f"a{k}: &a{k}\n  <<: [*a{k - 1}, *a{k - 1}, *a{k - 1}]\n" for k in range(1, 30))
YAMLS = [LAUGHS + "T_left: {data: *a11}\nR_left: {data: *a11}\n", MERGED, "a: &a [*a]\n", DEEP, "{a: " * 9000]
YAMLS += [f"a: {':'.join('1' * 100_000)}", "a: !!int ''", "a: !!bool x", "a: !!timestamp x"]
YAMLS += ["a: !!python/object/apply:os.system [exit]", "x" * (MOST_YAML + 1), "\0", "a: '\\ud800'"]


@pytest.mark.parametrize("text", YAMLS, ids=range(len(YAMLS)))
def test_yaml_costs_no_more_than_its_bytes(tmp_path, text):
    pytest.importorskip("yaml")
    (tmp_path / "a.yaml").write_text(text)
    assert str(opened(lambda: read_poses(tmp_path / "a.yaml"))).startswith(str(tmp_path / "a.yaml"))


def test_an_alias_is_named_with_a_remedy():
    pytest.importorskip("yaml")
    with pytest.raises(ValueError, match=r"has the alias \*a0; write the value in its place"):
        yaml_of(LAUGHS.encode())
    assert yaml_of(b"%YAML:1.0\n---\na: [1, 2]\n---\nb: &named 3\n") == [{"a": ["1", "2"]}, {"b": "3"}]


@pytest.mark.parametrize("text", ["x=" + DEEP, "a." * 8000 + "b=1", "x" * (MOST_TOML + 1), "[a\n", "\0"])
def test_toml_costs_no_more_than_its_bytes(tmp_path, text):
    (tmp_path / "a.toml").write_text(text)
    assert str(opened(lambda: read_poses(tmp_path / "a.toml"))).startswith(str(tmp_path / "a.toml"))


def test_texts_of_files_are_read_by_one_module_alone():
    readers = re.compile(r"json\.loads?\(|yaml\.(load|safe|compose)|tomllib\.load|ElementTree|minidom|\bxml\.")
    found = []
    for path in sorted((ROOT / "src/meshreel").rglob("*.py")):
        lines = path.read_text(encoding="utf-8").splitlines()
        found += [(path.name, line.strip()) for line in lines if readers.search(line)]
    readers = ("texts.py", "heads.py", "checks.py")  # the last: heads of .reel files, which have laws of their own
    own = [line for name, line in found if name not in readers]
    assert all("json.loads(json.dumps(" in line for line in own), own  # values of our own, as JSON keeps them


def test_workflows_use_actions_by_their_commits_and_name_their_versions():
    uses = [line for path in (ROOT / ".github/workflows").glob("*.yml") for line in path.read_text().splitlines()]
    uses = [line.strip(" -") for line in uses if "uses:" in line]
    assert len(uses) > 10
    for line in uses:
        assert re.fullmatch(r"uses: [\w.-]+/[\w./-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", line), line
    commits = {}
    for line in uses:
        name, commit = line.split()[1].split("@")
        assert commits.setdefault(name, commit) == commit, f"{name} has two commits"
