"""Audio from the command line: in, seen, and out again, byte for byte."""

import pytest

import meshreel
from tests.cli.conftest import FILE, SCENE, failed
from tests.edit.test_audio import OPUS


@pytest.fixture
def talk(tmp_path):
    """An audio file."""
    (tmp_path / "talk.opus").write_bytes(OPUS)
    return tmp_path / "talk.opus"


@pytest.mark.usefixtures("quick_presets")
def test_audio_is_encoded_told_and_decoded(run, balls, talk, tmp_path):
    out = ("-o", tmp_path / "a.reel")
    said = run("encode", balls, *out, "--frames", ":1", "--audio", talk, "--audio-start", "-0.5", "--json")
    assert said.row["audio_bytes"] == len(OPUS) + 10 and said.row["bytes"] == (tmp_path / "a.reel").stat().st_size
    row = run("info", tmp_path / "a.reel", "--json").row
    content = {"audio": len(OPUS) + 10}
    assert row["audio"] == {"bytes": len(OPUS) + 10, "bytes_by_content": content, "type": "audio/ogg", "start_s": -0.5}
    assert sum(row["bytes_by_content"].values()) == row["bytes"]
    assert f"audio: audio/ogg, {len(OPUS) + 10} bytes, from -0.5 s" in run("info", tmp_path / "a.reel").out
    assert run("decode", tmp_path / "a.reel", "--audio", "-o", tmp_path / "back.opus", "--json").row["start_s"] == -0.5
    assert (tmp_path / "back.opus").read_bytes() == OPUS
    assert failed(run("encode", balls, *out, "--audio-start", "1"), "needs --audio")


def test_tag_adds_moves_and_takes_away(run, talk, tmp_path):
    names = [tmp_path / f"{k}.reel" for k in range(4)]
    assert run("tag", SCENE, "--audio", talk, "-o", names[0]).code == 0
    assert run("tag", names[0], "title=Walk", "--audio-start", "0.25", "-o", names[1]).code == 0
    moved = meshreel.open(names[1])
    assert moved.audio is not None and moved.audio.start == 0.25 and moved.metadata["title"] == "Walk"
    assert run("tag", names[0], "--no-audio", "-o", names[2]).code == 0
    assert names[2].read_bytes() == SCENE.read_bytes()
    said = run("retime", names[0], "--speed", "2", "-o", names[3])
    assert said.code == 0 and "its audio is left out" in said.err and meshreel.open(names[3]).audio is None


def test_wrong_words_are_said(run, talk, tmp_path):
    out = ("-o", tmp_path / "a.reel")
    assert failed(run("tag", SCENE, "--no-audio", "--audio", talk, *out), "give one of them")
    assert failed(run("tag", SCENE, "--audio", FILE, *out), "mixed.reel: a file that begins with 52 45 45 4c")
    assert failed(run("decode", SCENE, "--audio", "-o", tmp_path / "a.opus"), "has no audio; meshreel tag --audio adds")
    assert failed(run("tag", SCENE, "--audio", tmp_path / "no.opus", *out), "cannot be read")


def test_damaged_audio_is_told_by_info(run, talk, tmp_path):
    run("tag", SCENE, "--audio", talk, "-o", tmp_path / "a.reel")
    data = bytearray((tmp_path / "a.reel").read_bytes())
    data[data.index(b"OpusHead")] ^= 1
    (tmp_path / "b.reel").write_bytes(data)
    said = run("info", tmp_path / "b.reel")
    assert "audio: damaged" in said.out and "layer 0 is damaged" in said.err
