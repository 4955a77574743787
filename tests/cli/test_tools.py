"""What helps with meshreel itself: examples in the help, completion, the player's files, and the doctor."""

import shlex
import subprocess
import sys
from importlib.resources import files
from shutil import which

import pytest

import meshreel
from meshreel.cli import COMMANDS, EXAMPLES, make_app
from tests.cli.conftest import failed


def test_every_command_has_two_examples():
    assert EXAMPLES.keys() == COMMANDS.keys()
    assert all(len(set(examples)) == 2 for examples in EXAMPLES.values())


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_are_understood_and_stand_below_the_help(run, name):
    said = run(name, "--help")
    app = make_app()
    for example in EXAMPLES[name]:
        words = shlex.split(example.partition(" >")[0])
        app.parse_args([name, *words], exit_on_error=False, print_error=False)
        assert f"meshreel {name} {example}".strip() in " ".join(said.out.split())


@pytest.mark.parametrize("shell", ["bash", "zsh"])
def test_a_script_completes_commands_and_flags(run, shell, tmp_path):
    said = run("completion", shell)
    assert said.code == 0 and all(name in said.out for name in COMMANDS) and "target-mbps" in said.out
    if which(shell):
        (tmp_path / "script").write_text(said.out)
        assert subprocess.run([shell, "-n", tmp_path / "script"], check=False).returncode == 0


def test_the_player_is_copied_whole_and_its_folder_is_told(run, tmp_path):
    folder = files("meshreel") / "player"
    assert run("player").out.strip() == str(folder)
    said = run("player", "--copy-to", tmp_path / "site" / "player")
    assert said.code == 0 and 'src="player/load.js"' in said.out
    copied = {path.name: path.read_bytes() for path in (tmp_path / "site" / "player").iterdir()}
    assert copied == {path.name: path.read_bytes() for path in folder.iterdir()} and "core.wasm" in copied


def test_the_player_cannot_be_copied_onto_a_file(run, tmp_path):
    (tmp_path / "a").write_text("")
    assert failed(run("player", "--copy-to", tmp_path / "a"), str(tmp_path / "a"))


def test_the_doctor_tells_what_is_there_and_what_is_missing(run, monkeypatch):
    row = run("doctor", "--json").row
    assert row["meshreel"] == meshreel.__version__ and row["player"]
    assert row["extras"]["(none)"]["numpy"] and {"encode", "color", "play"} <= row["extras"].keys()
    assert "meshreel" not in {name for packages in row["extras"].values() for name in packages}
    monkeypatch.setitem(sys.modules, "av", None)
    monkeypatch.setenv("PATH", "")
    bare = run("doctor")
    assert bare.code == 0 and "codecs: none" in bare.out and f"meshreel {meshreel.__version__}" in bare.out
    assert "cyclopts" in bare.out and "missing" in bare.out


def test_the_doctor_knows_the_codecs_that_textures_need(run):
    pytest.importorskip("av", reason="textures need the extra color")
    assert run("doctor", "--json").row["codecs"]["AV1 decoded"] is True
