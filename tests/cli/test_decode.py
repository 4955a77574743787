"""`meshreel decode`: a file becomes meshes, whole or as far as it can be read."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.cli.decode import CONTENTS, UNKNOWN, unwritten
from meshreel.edit import tag
from meshreel.format.layout import ChunkKind
from meshreel.io.sequence import open_sequence
from tests.cli.conftest import FILE, SCENE, failed
from tests.colored_body import BODY, textured, written
from tests.golden import GOLDEN


@pytest.mark.parametrize("kind", ["ply", "obj", "glb"])
def test_every_format_gives_the_frames_back(run, tmp_path, kind):
    said = run("decode", FILE, "-o", tmp_path / "new" / "out", "--format", kind, "--json")
    assert said.row == {
        "output": str(tmp_path / "new" / "out"),
        "frames": 10,
        "format": kind,
        "frame_rate": 25.0,
        "files": 10,
    }
    names = sorted(path.name for path in (tmp_path / "new" / "out").iterdir())
    assert names == [f"frame_{i:05}.{kind}" for i in range(10)]
    for found, wanted in zip(open_sequence(tmp_path / "new" / "out"), meshreel.open(FILE), strict=True):
        assert len(found.faces) == len(wanted.faces)
        if not wanted.is_empty:
            assert np.abs(found.vertices[found.faces] - wanted.vertices[wanted.faces]).max() < 1e-5


def test_ply_is_the_default_and_the_answer_is_one_line(run, tmp_path):
    said = run("decode", SCENE, "-o", tmp_path)
    assert (said.code, said.out, said.err) == (0, f"{tmp_path}: 14 ply files\n", "")


def test_quiet_is_silent(run, tmp_path):
    assert (run("decode", FILE, "-o", tmp_path, "--quiet").out, len(list(tmp_path.iterdir()))) == ("", 10)


def test_fewer_layers_give_another_shape(run, tmp_path):
    run("decode", FILE, "-o", tmp_path / "whole")
    run("decode", FILE, "-o", tmp_path / "coarse", "--layers", "1")
    whole, coarse = ((tmp_path / name / "frame_00003.ply").read_bytes() for name in ("whole", "coarse"))
    assert len(whole) == len(coarse) and whole != coarse
    assert failed(run("decode", FILE, "-o", tmp_path, "--layers", "-1"), "layers", "-1")


def test_frames_of_another_video_in_the_folder_are_pointed_out(run, tmp_path):
    (tmp_path / "frame_00010.ply").write_bytes(b"")
    assert "frame_00010.ply" in run("decode", FILE, "-o", tmp_path).err


def test_a_damaged_group_costs_only_its_frames_and_the_exit_code(run, tmp_path):
    data = bytearray(FILE.read_bytes())
    group = meshreel.open(FILE).reader.groups[1]
    data[group.offset + 60] ^= 4
    (tmp_path / "a.reel").write_bytes(data)
    said = run("decode", tmp_path / "a.reel", "-o", tmp_path / "out", "--quiet")
    assert failed(said, "frames 2 to 5", "4 of 10 frames are lost")
    assert len(list((tmp_path / "out").iterdir())) == 6


def test_a_file_of_which_nothing_decodes_leaves_no_folder_but_one_that_was_there(run, tmp_path):
    data = bytearray(FILE.read_bytes())
    for group in meshreel.open(FILE).reader.groups:
        data[group.offset + 60 if group.size > 60 else group.offset] ^= 4
    (tmp_path / "a.reel").write_bytes(data)
    (tmp_path / "old").mkdir()
    for name in ("new", "old"):
        said = run("decode", tmp_path / "a.reel", "-o", tmp_path / name, "--quiet")
        assert failed(said, "all frames are lost")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.reel", "old"]


@pytest.mark.parametrize("only", ["all", "background", "moving"])
def test_decode_writes_a_whole_scene_or_only_its_background_or_its_bodies(run, tmp_path, only):
    arguments = [] if only == "all" else ["--only", only]
    row = run("decode", SCENE, "-o", tmp_path, *arguments, "--json").row
    frames = [0, 4] if only == "background" else range(14)
    assert (row["frames"], row["files"]) == (14, len(frames))
    assert {path.name for path in tmp_path.iterdir()} == {f"frame_{frame:05}.ply" for frame in frames}
    video = meshreel.open(SCENE)
    look = {"all": video.__getitem__, "background": video.background, "moving": video.moving}[only]
    for frame, mesh in zip(frames, open_sequence(tmp_path), strict=True):
        wanted = look(frame)
        assert len(mesh.faces) == len(wanted.faces) > 0
        assert np.abs(mesh.vertices[mesh.faces] - wanted.vertices[wanted.faces]).max() < 1e-5


def test_a_part_that_a_file_does_not_have_is_reported_before_anything_is_written(run, tmp_path):
    folder = tmp_path / "out"
    assert failed(run("decode", FILE, "-o", folder, "--only", "background"), "mixed.reel", "no background")
    empty = GOLDEN / "empty.reel"
    assert failed(run("decode", empty, "-o", folder, "--only", "moving"), "empty.reel", "nothing that moves")
    assert failed(run("decode", SCENE, "-o", folder, "--only", "people"), "people")
    assert not folder.exists()
    assert run("decode", FILE, "-o", folder, "--only", "moving").code == 0


def test_damage_of_a_body_leaves_the_frames_without_it_and_the_background(run, tmp_path):
    data, chunk = bytearray(SCENE.read_bytes()), meshreel.open(SCENE).reader.chunks[4]
    data[chunk.offset + 60] ^= 4
    (tmp_path / "a.reel").write_bytes(data)
    said = run("decode", tmp_path / "a.reel", "-o", tmp_path / "out")
    assert failed(said, "chunk 4 (track 1, frames 4 to 6)", "5 of 14 frames are lost")  # the next group needs it
    assert len(list((tmp_path / "out").iterdir())) == 9
    assert run("decode", tmp_path / "a.reel", "-o", tmp_path / "still", "--only", "background").code == 0
    data[meshreel.open(SCENE).reader.chunks[3].offset + 9] ^= 4
    (tmp_path / "a.reel").write_bytes(data)
    said = run("decode", tmp_path / "a.reel", "-o", tmp_path / "still", "--only", "background", "--force")
    assert failed(said, "background of frame 4: chunk 3 (static)", "1 of 2 frames are lost")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda data: data[:60], ("truncated",)),
        (lambda data: data[:-1], ("truncated", "1 of 10 frames")),
        (lambda data: data[:8] + b"\x02" + data[9:], ("version 2", "update meshreel")),
        (lambda data: data[:10] + b"\xff\xff\xff\xff" + data[14:], ("4294967295",)),
        (lambda data: data[:30] + b"~" + data[31:], ("checksum",)),
        (lambda _: b"", ("not a .reel",)),
    ],
)
def test_a_file_that_is_no_whole_reel_is_reported(run, tmp_path, spoil, words):
    (tmp_path / "a.reel").write_bytes(spoil(FILE.read_bytes()))
    assert failed(run("decode", tmp_path / "a.reel", "-o", tmp_path / "out", "--quiet"), *words)


def test_a_missing_file_and_a_folder_that_cannot_be_are_reported(run, tmp_path):
    assert failed(run("decode", tmp_path / "none.reel", "-o", tmp_path), "none.reel")
    assert failed(run("decode", tmp_path, "-o", tmp_path / "out"), str(tmp_path))
    (tmp_path / "taken").write_text("")
    assert failed(run("decode", SCENE, "-o", tmp_path / "taken"), "taken", "choose another")
    assert failed(run("decode", FILE, "-o", tmp_path, "--format", "fbx"), "fbx")


@pytest.fixture
def colored():
    """A file whose frames have textures."""
    for name in ("av", "xatlas"):
        pytest.importorskip(name)
    return written([textured(mesh) for mesh in BODY[:2]])


def test_textures_are_kept_or_named_in_one_line(run, tmp_path, monkeypatch, colored):
    said = run("decode", colored, "-o", tmp_path / "ply")
    assert said.code == 0 and said.err.count("\n") == 1 and "PLY has no textures" in said.err
    assert open_sequence(tmp_path / "ply")[0].colors is not None
    wanted = meshreel.open(colored)[1].texture.pixels
    for kind in ("obj", "glb"):
        assert run("decode", colored, "-o", tmp_path / kind, "--format", kind).err == ""
        np.testing.assert_array_equal(open_sequence(tmp_path / kind)[1].texture.pixels, wanted)
    assert run("decode", colored, "-o", tmp_path / "npz", "--format", "npz").err == ""
    np.testing.assert_array_equal(open_sequence(tmp_path / "npz" / "frame_00001.npz")[0].texture.pixels, wanted)
    monkeypatch.setattr("meshreel.cli.decode.find_spec", {}.get)
    said = run("decode", colored, "-o", tmp_path / "bare", "--format", "obj")
    assert said.code == 0 and said.err.count("\n") == 1 and "meshreel[color]" in said.err
    assert (
        open_sequence(tmp_path / "bare")[0].texture is None and open_sequence(tmp_path / "bare")[0].colors is not None
    )


@pytest.mark.parametrize("kind", [ChunkKind.COLORS, ChunkKind.ATLAS, ChunkKind.PICTURES])
def test_damaged_colors_cost_colors_and_the_exit_code(run, tmp_path, colored, kind):
    data = bytearray(colored.read_bytes())
    with meshreel.open(bytes(data)) as video:
        chunk = next(chunk for chunk in video.reader.chunks if chunk.kind == kind)
        payload = video.reader.read_chunk(chunk.number)
    data[bytes(data).index(payload) + len(payload) // 2] ^= 255
    (tmp_path / "bad.reel").write_bytes(data)
    said = run("decode", tmp_path / "bad.reel", "-o", tmp_path / "out", "--format", "obj")
    assert failed(said, "written without their colours", "copy the file again")
    found, wanted = open_sequence(tmp_path / "out"), meshreel.open(colored)
    assert len(found) == len(wanted)
    assert found[0].texture is None and len(found[0].faces) == len(wanted[0].faces)


@pytest.mark.parametrize("name", ["splats", "audio"])
@pytest.mark.parametrize("to", ["ply", "obj", "glb", "npz", "a.glb", "a.usda", "a.usdc", "a.usdz"])
def test_what_an_output_lacks_is_named_in_one_line_with_the_remedy(run, tmp_path, name, to):
    if "usd" in to:
        pytest.importorskip("pxr")
    tag(GOLDEN / name / f"{name}.reel", file := tmp_path / "a.reel", {"title": "Walk"})
    how = ("export", "-o", tmp_path / to) if to[1] == "." else ("decode", "-o", tmp_path / "out", "--format", to)
    said = run(how[0], file, *how[1:])
    assert said.code == 0 and said.err.count("\n") == 1
    assert f"not written: {name} (meshreel decode --{name}" in said.err and "tags (meshreel info" in said.err
    assert ("uneven times" in said.err) == (name == "audio" and to[1] != ".")


@pytest.mark.parametrize("kind", [*ChunkKind, 200])
def test_each_kind_of_chunk_is_in_an_output_or_named(kind):
    reader = meshreel.open(GOLDEN / "draco.reel").reader
    reader.chunks = (replace(reader.chunks[0], kind=kind),)
    said = unwritten(Path("a.reel"), reader, (), "--texture writes them")
    name = UNKNOWN if kind == 200 else CONTENTS[kind]
    assert said == [] if name == "" else name in said[0]
    assert (name == "") == (kind in (ChunkKind.GROUP, ChunkKind.COLORS))


def test_splats_of_a_scene_are_written_with_a_word_about_the_rest(run, tmp_path):
    tag(GOLDEN / "splats/splats.reel", tmp_path / "a.reel", {"title": "Walk"})
    said = run("decode", tmp_path / "a.reel", "-o", tmp_path / "out", "--splats")
    assert said.code == 0 and "not written: tags" in said.err and "splats (" not in said.err
