"""Exported files show the colours and textures of the decoder; single frames keep those that their format has."""

import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.errors import FormatError
from meshreel.export.animated_file import ExportOptions, export
from meshreel.export.animated_glb import animated_glb
from meshreel.export.animated_usd import animated_usd
from meshreel.export.frames import write_frames
from meshreel.export.shapes import Animation, Shape
from meshreel.format.layout import ChunkKind
from meshreel.geometry.color_views import Painted
from meshreel.geometry.topology import concatenate
from meshreel.io.sequence import open_sequence
from meshreel.types import GREY, Mesh, Texture
from tests.colored_body import BODY, CHECKS, COLORED, textured, written
from tests.export.test_animated_file import play, seen, times
from tests.gltf_validator import validate
from tests.metrics.shapes import sphere

for name in ("av", "xatlas"):
    pytest.importorskip(name)

EXTENSIONS = ("glb", "usdc", "usda", "usdz")
BRIGHTER = [replace(mesh, colors=np.minimum(mesh.colors + np.uint8(6 * t), 255)) for t, mesh in enumerate(COLORED)]
BALL = sphere(levels=1)


@pytest.fixture(scope="module")
def files() -> dict[str, Path]:
    textures = written([textured(mesh) for mesh in BODY], group_size=3)
    return {"vertices": written(BRIGHTER, group_size=6), "texture": textures}


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_colors_of_vertices_are_shown_and_change_in_time(tmp_path, files, extension) -> None:
    video = meshreel.open(files["vertices"])
    export(video.reader, tmp_path / f"a.{extension}")
    played = play(tmp_path / f"a.{extension}")
    for frame, time in enumerate(times(video)):
        (mesh, _) = seen(played.shown(time))["track_0"]
        assert np.abs(mesh.colors.astype(int) - video[frame].colors).max() <= 1 and mesh.texture is None
    assert not np.array_equal(video[0].colors, video[5].colors)


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_textures_are_shown_where_they_are_asked_for(tmp_path, files, extension) -> None:
    video = meshreel.open(files["texture"])
    export(video.reader, tmp_path / f"my a.{extension}", options=ExportOptions(texture=True))
    played, starts = play(tmp_path / f"my a.{extension}"), [group.first_frame for group in video.reader.groups]
    starts += [k for k in range(1, len(video)) if not np.array_equal(video[k].faces, video[k - 1].faces)]  # some hidden
    for frame, time in enumerate(times(video)):
        (mesh, _) = seen(played.shown(time))["track_0"]
        shown = frame if extension != "glb" else max(start for start in starts if start <= frame)
        np.testing.assert_array_equal(mesh.texture.pixels, video[shown].texture.pixels)
        np.testing.assert_allclose(mesh.uv, video[frame].uv, atol=1e-6)
        np.testing.assert_allclose(mesh.vertices[mesh.faces], video[frame].vertices[video[frame].faces], atol=1e-5)
    beside = {"my a_textures"} if extension in ("usdc", "usda") else set()
    assert {path.name for path in tmp_path.iterdir()} == {f"my a.{extension}"} | beside


def test_validators_have_nothing_against_colors_and_textures(tmp_path, files) -> None:
    from tests.play_usd import complaints

    for name, path in files.items():
        for extension in EXTENSIONS:
            target = tmp_path / f"{name}.{extension}"
            export(meshreel.open(path).reader, target, options=ExportOptions(texture=True))
            found = validate(target)[0]["messages"] if extension == "glb" else complaints(target)
            assert (target.name, found) == (target.name, [])


@pytest.mark.parametrize(("extension", "writer"), [("glb", animated_glb), ("usdc", animated_usd)])
@pytest.mark.parametrize("colored", [True, False])
def test_faces_without_a_place_in_the_texture_have_the_colors_of_their_vertices(
    tmp_path, extension, writer, colored
) -> None:
    colors = np.random.default_rng(0).integers(0, 256, BALL.vertices.shape).astype(np.uint8) if colored else None
    uv = np.random.default_rng(1).random((len(BALL.faces), 3, 2)).astype(np.float32)
    uv[:7] = np.nan
    frames = [Mesh(BALL.vertices + t, BALL.faces, colors, uv, Texture.of(CHECKS)) for t in range(2)]
    with writer(tmp_path / f"a.{extension}", Animation(np.arange(2) / 10, 10.0)) as file:
        file.add(Shape("part", "name", BALL.faces, 0, frames, ((0, 2),), uv))
    [(mesh, _)] = play(tmp_path / f"a.{extension}").shown(0.1)["part"]
    order = [*range(7, len(uv)), *range(7)] if extension == "glb" else range(len(uv))
    np.testing.assert_allclose(mesh.uv, uv[order], atol=1e-6)
    np.testing.assert_array_equal(mesh.texture.pixels, CHECKS)
    if colored:
        assert np.abs(mesh.colors[mesh.faces].astype(int) - colors[BALL.faces[order]]).max() <= 1
    else:
        assert mesh.colors is None
    if extension == "glb":
        assert validate(tmp_path / "a.glb")[0]["messages"] == []
    else:
        from tests.play_usd import complaints

        assert complaints(tmp_path / "a.usdc") == []


@pytest.mark.parametrize("extension", ["obj", "glb", "npz"])
def test_single_frames_have_their_textures(tmp_path, files, extension) -> None:
    video = meshreel.open(files["texture"])
    assert write_frames(video.__getitem__, [tmp_path / f"frame_{t}.{extension}" for t in range(len(video))]) == []
    for frame in (0, 5):
        again = open_sequence(tmp_path / f"frame_{frame}.{extension}")[0]
        np.testing.assert_array_equal(again.texture.pixels, video[frame].texture.pixels)
        np.testing.assert_allclose(again.uv, video[frame].uv, atol=1e-6)
        np.testing.assert_array_equal(again.colors[again.faces], video[frame].colors[video[frame].faces])


def test_a_frame_whose_texture_is_damaged_is_lost(tmp_path, files) -> None:
    data = bytearray(files["texture"].read_bytes())
    pictures = [chunk for chunk in meshreel.open(bytes(data)).reader.chunks if chunk.kind == ChunkKind.PICTURES]
    data[pictures[-1].offset + pictures[-1].size // 2] ^= 4
    paths = [tmp_path / f"{t}.glb" for t in range(6)]
    failed = write_frames(meshreel.open(bytes(data)).__getitem__, paths)
    assert len(failed) == 3 and all(isinstance(error, FormatError) for error in failed)
    assert sorted(tmp_path.iterdir()) == paths[:3]


def test_parts_with_textures_of_their_own_keep_them_side_by_side() -> None:
    places = np.random.default_rng(2).random((2, len(BALL.faces), 3, 2)).astype(np.float32) * 0.8 + 0.1
    large, small = (
        replace(BALL, uv=uv, texture=Texture.of(np.repeat(picture[..., None], 3, axis=2).astype(np.uint8)))
        for uv, picture in zip(
            places, (np.add.outer(range(64), range(96)), np.add.outer(range(16), range(32)) + 150), strict=True
        )
    )
    bare, weights = sphere(levels=0), np.full((1, 3), 1 / 3)
    whole = concatenate([large, bare, small])
    assert whole.texture.shape == whole.texture.pixels.shape[:2] == (64, 128)
    assert pickle.loads(pickle.dumps(whole)).texture.shape == (64, 128)  # it is sent to other processes
    painted, first = Painted(whole), len(BALL.faces) + len(bare.faces)
    for face in range(0, len(BALL.faces), 7):
        for mesh, start in ((large, 0), (small, first)):
            numbers = np.array([face], np.int32)
            wanted = Painted(mesh).on(numbers, weights)
            np.testing.assert_allclose(painted.on(numbers + np.int32(start), weights), wanted, atol=0.01)
    assert painted.on(np.array([len(BALL.faces)], np.int32), weights).tolist() == [[GREY] * 3]
    assert concatenate([large, bare]).texture is large.texture and concatenate([Mesh.empty()]).is_empty
