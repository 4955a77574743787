"""Exported files show the decoded mesh at the time of each frame, and motion between frames."""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.coding.mesh import encode_intra
from meshreel.container.writer import ReelWriter
from meshreel.edit.edits import tag, transform
from meshreel.encoder.sequence import encode
from meshreel.errors import FormatError, InputError
from meshreel.export.animated_file import ExportOptions
from meshreel.export.animated_file import export as export_file
from meshreel.export.shapes import Animation
from meshreel.geometry.topology import vertex_normals
from meshreel.io.sequence import open_sequence
from meshreel.types import Mesh, MeshList
from tests.gltf_validator import find_validator, validate
from tests.golden import GOLDEN
from tests.metrics.shapes import sphere
from tests.play_glb import PlayedGlb
from tests.small_options import quick

FILES = sorted(GOLDEN.glob("*.reel"))
EXTENSIONS = ("glb", "usdc", "usda", "usdz", "usd")
AWAY = 1e-6  # of the diagonal: what float32 may cost


def names(path: Path) -> str:
    return path.stem


def play(path: Path):
    if path.suffix == ".glb":
        return PlayedGlb(path)
    pytest.importorskip("pxr")
    from tests.play_usd import PlayedUsd

    return PlayedUsd(path)


def export(video: meshreel.Video, target: Path, frames: range | None = None, options: ExportOptions = ExportOptions()):
    return export_file(video.reader, target, frames, options)


def times(video: meshreel.Video) -> list[float]:
    return [time - video.timestamps[0] for time in video.timestamps]


def parts_of(video: meshreel.Video, frame: int) -> dict[str, Mesh]:
    """What there is to see in a frame, by the names in exported files."""
    return {name.replace(" ", "_"): mesh for name, mesh in video.parts(frame).items() if not mesh.is_empty}


def seen(shown: dict[str, list[tuple[Mesh, np.ndarray]]]) -> dict[str, tuple[Mesh, np.ndarray]]:
    """The one shape of each part that is shown."""
    assert all(len(shapes) <= 1 for shapes in shown.values())
    return {name: shapes[0] for name, shapes in shown.items() if shapes}


def assert_shows(found: dict[str, tuple[Mesh, np.ndarray]], wanted: dict[str, Mesh], diagonal: float) -> None:
    assert found.keys() == wanted.keys()
    for name, (mesh, normals) in found.items():
        assert np.array_equal(mesh.faces, wanted[name].faces)
        assert np.abs(mesh.vertices - wanted[name].vertices).max() <= AWAY * diagonal
        true = vertex_normals(wanted[name])
        assert np.abs(normals - true)[true.any(axis=1)].max() < 1e-5
        assert np.abs(np.linalg.norm(normals, axis=1) - 1).max() < 1e-5


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("path", FILES, ids=names)
def test_every_frame_is_shown_at_its_time_as_the_decoder_has_it(tmp_path, path, extension):
    target = tmp_path / f"out.{extension}"
    video = meshreel.open(path)
    export(video, target)
    played = play(target)
    for frame, time in enumerate(times(video)):
        assert_shows(seen(played.shown(time)), parts_of(video, frame), video[frame].diagonal)
    assert [found.name for found in tmp_path.iterdir()] == [target.name]


@pytest.mark.parametrize("path", FILES, ids=names)
def test_a_compressed_file_is_smaller_and_valid(tmp_path, path):
    pytest.importorskip("meshoptimizer")
    plain, packed = tmp_path / "a.glb", tmp_path / "b.glb"
    for target in (plain, packed):
        export(meshreel.open(path), target, options=ExportOptions(compressed=target is packed))
    if PlayedGlb(plain).binary:
        assert packed.stat().st_size < plain.stat().st_size
    (issues,) = validate(packed)
    found = {message["code"] for message in issues["messages"]} - {"UNUSED_OBJECT"}
    assert found <= {"UNSUPPORTED_EXTENSION", "BUFFER_MISSING_GLB_DATA", "UNRESOLVED_REFERENCE"}


def test_only_glb_is_compressed_and_the_error_names_the_extra(tmp_path, monkeypatch):
    options, video = ExportOptions(compressed=True), meshreel.open(GOLDEN / "layers.reel")
    with pytest.raises(InputError, match=r"a\.usdc: only \.glb is compressed"):
        export(video, tmp_path / "a.usdc", options=options)
    monkeypatch.setitem(sys.modules, "meshoptimizer", None)
    with pytest.raises(InputError, match=r"pip install 'meshreel\[glb\]'"):
        export(video, tmp_path / "a.glb", options=options)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("layers", [0, 1, 2])
def test_fewer_layers_are_exported_as_they_decode(tmp_path, layers):
    video = meshreel.open(GOLDEN / "layers_patched.reel").at(layers)
    export(video, tmp_path / "a.glb", options=ExportOptions(layers=layers))
    for frame, time in enumerate(times(video)):
        shown = seen(PlayedGlb(tmp_path / "a.glb").shown(time))
        assert_shows(shown, parts_of(video, frame), video[frame].diagonal)


def test_what_points_up_is_what_the_file_shows(tmp_path):
    path = tmp_path / "a.reel"
    encode(MeshList((sphere(),), up="-z"), path, options=quick("best"))
    video = meshreel.open(path)
    export(video, tmp_path / "told.glb")
    export(video, tmp_path / "given.glb", options=ExportOptions(up="-z"))
    export(video, tmp_path / "other.glb", options=ExportOptions(up="y"))
    told, given, other = ((tmp_path / f"{name}.glb").read_bytes() for name in ("told", "given", "other"))
    assert told == given != other


def test_khronos_finds_nothing_wrong(tmp_path):
    find_validator()
    targets = [tmp_path / f"{path.stem}.glb" for path in FILES]
    for path, target in zip(FILES, targets, strict=True):
        export(meshreel.open(path), target, options=ExportOptions(up="-z"))
    for issues, target in zip(validate(*targets), targets, strict=True):
        assert (target.name, issues["messages"]) == (target.name, [])
        assert issues["numErrors"] == issues["numWarnings"] == 0


def test_khronos_would_find_something_wrong(tmp_path):
    export(meshreel.open(GOLDEN / "layers.reel"), tmp_path / "a.glb")
    data = (tmp_path / "a.glb").read_bytes()
    (tmp_path / "b.glb").write_bytes(data.replace(b'"VEC3"', b'"VEC2"', 1))
    (issues,) = validate(tmp_path / "b.glb")
    assert issues["numErrors"] > 0


@pytest.mark.parametrize("extension", ["usdc", "usda", "usdz"])
def test_usd_has_nothing_against_it(tmp_path, extension):
    pytest.importorskip("pxr")
    from tests.play_usd import complaints

    for path in FILES:
        export(meshreel.open(path), tmp_path / f"a.{extension}")
        assert complaints(tmp_path / f"a.{extension}") == []


def test_usd_says_how_it_is_to_be_played(tmp_path):
    UsdGeom = pytest.importorskip("pxr.UsdGeom")
    export(meshreel.open(GOLDEN / "mixed.reel"), tmp_path / "a.usda")
    stage = play(tmp_path / "a.usda").stage
    assert (stage.GetTimeCodesPerSecond(), stage.GetFramesPerSecond(), stage.GetStartTimeCode()) == (25, 25, 0)
    assert stage.GetEndTimeCode() == pytest.approx(25 * times(meshreel.open(GOLDEN / "mixed.reel"))[-1], abs=1e-4)
    assert (UsdGeom.GetStageUpAxis(stage), UsdGeom.GetStageMetersPerUnit(stage)) == ("Y", 1)


@pytest.mark.parametrize("extension", ["glb", "usdc"])
@pytest.mark.parametrize("name", ["laplacian", "layers", "layers_open"])
def test_between_two_frames_of_a_group_motion_is_half_way(tmp_path, name, extension):
    video = meshreel.open(GOLDEN / f"{name}.reel")
    export(video, tmp_path / f"a.{extension}")
    played, groups = play(tmp_path / f"a.{extension}"), video.reader.groups
    inside = [group.first_frame + t for group in groups for t in range(group.frame_count - 1)]
    moving = [frame for frame in inside if not video[frame].is_empty]
    assert moving
    for frame in moving:
        time = (times(video)[frame] + times(video)[frame + 1]) / 2
        middle = (video[frame].vertices + video[frame + 1].vertices) / 2
        (mesh, _) = seen(played.shown(time))["track_0"]
        assert np.abs(mesh.vertices - middle).max() <= 2 * AWAY * video[frame].diagonal


def test_motion_goes_on_into_a_group_that_is_predicted(tmp_path):
    video = meshreel.open(GOLDEN / "layers.reel")
    assert [group.first_frame for group in video.reader.groups] == [0, 1, 11]
    export(video, tmp_path / "a.glb")
    (mesh, _) = seen(PlayedGlb(tmp_path / "a.glb").shown(10.5 / 25))["track_0"]
    middle = (video[10].vertices + video[11].vertices) / 2
    assert np.abs(video[10].vertices - middle).max() > 100 * AWAY * video[10].diagonal
    assert np.abs(mesh.vertices - middle).max() <= 2 * AWAY * video[10].diagonal


@pytest.mark.parametrize("name", ["draco", "layers_patched"])
@pytest.mark.parametrize("extension", ["glb", "usdc"])
def test_frames_of_other_faces_stay_until_the_next(tmp_path, name, extension):
    video = meshreel.open(GOLDEN / f"{name}.reel")
    export(video, tmp_path / f"a.{extension}")
    played = play(tmp_path / f"a.{extension}")
    for frame, time in enumerate(times(video)):
        assert_shows(seen(played.shown(time + 0.039)), parts_of(video, frame), video[frame].diagonal)


def test_frames_coded_one_by_one_do_not_become_each_other_though_their_faces_are_equal(tmp_path):
    header = meshreel.open(GOLDEN / "draco.reel").reader.header
    ball = sphere(0.25, levels=1)
    payload = encode_intra([ball, Mesh(ball.vertices + [0.25, 0, 0], ball.faces)], 2**-10, 0)
    with ReelWriter(tmp_path / "a.reel", header) as writer:
        writer.add_group(0, 2, payload)
    video = meshreel.open(tmp_path / "a.reel")
    assert np.array_equal(video[0].faces, video[1].faces)
    assert export(video, tmp_path / "a.glb") == 2
    assert_shows(seen(PlayedGlb(tmp_path / "a.glb").shown(0.039)), parts_of(video, 0), video[0].diagonal)


def test_a_long_group_is_several_meshes_and_moves_on_all_the_same(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.export.animated_file.MOST_FRAMES", 3)
    video = meshreel.open(GOLDEN / "layers.reel")
    assert export(video, tmp_path / "a.glb") == 6
    played = PlayedGlb(tmp_path / "a.glb")
    assert max(len(mesh["primitives"][0].get("targets", [])) for mesh in played.tree["meshes"]) == 3
    for frame, time in enumerate(times(video)):
        assert_shows(seen(played.shown(time)), parts_of(video, frame), video[frame].diagonal)
    for frame in range(1, 13):
        middle = (video[frame].vertices + video[frame + 1].vertices) / 2
        (mesh, _) = seen(played.shown((frame + 0.5) / 25))["track_0"]
        assert np.abs(mesh.vertices - middle).max() <= 2 * AWAY * video[frame].diagonal


@pytest.mark.parametrize("extension", ["glb", "usdc"])
@pytest.mark.parametrize("frames", [range(3, 9), range(6, 7), range(8, 14)], ids=str)
def test_some_frames_begin_at_time_0(tmp_path, frames, extension):
    video = meshreel.open(GOLDEN / "scene.reel")
    export(video, tmp_path / f"a.{extension}", frames)
    played = play(tmp_path / f"a.{extension}")
    for frame in frames:
        shown = seen(played.shown(times(video)[frame] - times(video)[frames.start]))
        assert_shows(shown, parts_of(video, frame), video[frame].diagonal)
    assert len(frames) == 1 or not isinstance(played, PlayedGlb) or played.key_times[0] == 0


def test_keys_are_timestamps_and_the_last_frame_lasts(tmp_path):
    video = meshreel.open(GOLDEN / "mixed.reel")
    assert len(set(np.diff(video.timestamps).round(6))) > 1
    export(video, tmp_path / "a.glb")
    keys = PlayedGlb(tmp_path / "a.glb").key_times
    known = np.array([*times(video), times(video)[-1] + 1 / video.frame_rate])
    assert all(np.abs(known - key).min() < 1e-6 for key in keys)
    assert keys[-1] == pytest.approx(known[-1])


@pytest.mark.parametrize("only", ["all", "background", "moving"])
def test_export_writes_a_whole_scene_or_only_its_background_or_its_bodies(tmp_path, only):
    video = meshreel.open(GOLDEN / "scene.reel")
    export(video, tmp_path / "a.glb", options=ExportOptions(only=only))
    for frame, time in enumerate(times(video)):
        wanted = parts_of(video, frame)
        chosen = {name for name in wanted if only == "all" or (name == "background") == (only == "background")}
        shown = seen(PlayedGlb(tmp_path / "a.glb").shown(time))
        assert_shows(shown, {name: wanted[name] for name in chosen}, video[frame].diagonal)


@pytest.mark.parametrize(("up", "axis"), [("y", 1), ("z", 2), ("-y", 1), ("-z", 2)])
@pytest.mark.parametrize("extension", ["glb", "usdc"])
def test_the_axis_that_points_up_does_so_in_the_file(tmp_path, up, axis, extension):
    video = meshreel.open(GOLDEN / "laplacian.reel")
    export(video, tmp_path / f"a.{extension}", options=ExportOptions(up=up))
    (mesh, normals) = seen(play(tmp_path / f"a.{extension}").shown(0))["track_0"]
    height = video[0].vertices[:, axis] * (-1 if up[0] == "-" else 1)
    assert np.abs(mesh.vertices[:, 1] - height).max() <= AWAY * video[0].diagonal
    volumes = [np.linalg.det(each.vertices[each.faces] - each.vertices[0]).sum() for each in (mesh, video[0])]
    assert volumes[0] == pytest.approx(volumes[1], rel=1e-4)  # turned, not mirrored
    assert np.abs(normals - vertex_normals(mesh)).max() < 1e-4


@pytest.mark.parametrize("name", ["laplacian", "scene", "mixed"])
def test_viewers_that_do_not_animate_show_the_first_frame(tmp_path, name):
    video = meshreel.open(GOLDEN / f"{name}.reel")
    export(video, tmp_path / "a.glb")
    assert_shows(seen(PlayedGlb(tmp_path / "a.glb").shown(None)), parts_of(video, 0), video[0].diagonal)
    again = open_sequence(tmp_path / "a.glb")[0]
    assert len(again.faces) == len(video[0].faces) and len(again.vertices) == len(video[0].vertices)
    if not video[0].is_empty:
        apart = np.linalg.norm(again.vertices[:, None] - video[0].vertices[None], axis=2)  # parts in any order
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) <= 2 * AWAY * video[0].diagonal


@pytest.mark.parametrize("extension", ["glb", "usdc", "usdz"])
@pytest.mark.parametrize("path", FILES, ids=names)
def test_damage_is_reported_with_its_chunk_and_leaves_what_was_there(tmp_path, path, extension):
    target = tmp_path / f"a.{extension}"
    for chunk, damaged in _damaged(path):
        target.write_bytes(b"of a run before")
        with pytest.raises(FormatError, match=f"chunk {chunk} "):
            export(meshreel.open(damaged), target)
        assert target.read_bytes() == b"of a run before" and list(tmp_path.iterdir()) == [target]


def _damaged(path: Path) -> Iterator[tuple[int, bytes]]:
    """The file with one chunk after the other damaged, and without its last byte; and the chunk that is told.

    A group that is hidden, and that none is predicted from, is not read.
    """
    data, chunks = path.read_bytes(), meshreel.open(path).reader.chunks
    named = {number for chunk in chunks for number in chunk.depends_on}
    hidden = {chunk.number for chunk in chunks if chunk.frame_count and chunk.first_frame + chunk.frame_count <= 0}
    for chunk in (chunk for chunk in chunks if chunk.number not in hidden - named):
        spoiled = bytearray(data)
        spoiled[chunk.offset + chunk.size // 2] ^= 4
        yield chunk.number, bytes(spoiled)
    yield chunks[-1].number, data[:-1]


def test_an_impossible_target_is_an_error_at_once(tmp_path):
    video = meshreel.open(GOLDEN / "mixed.reel")
    for target, words in (
        (tmp_path / "a.fbx", ".fbx extension"),
        (tmp_path / "a", "no extension"),
        (tmp_path / "none" / "a.glb", "no folder"),
        (tmp_path, "is a folder"),
    ):
        with pytest.raises(InputError, match=words):
            export(video, target)
    with pytest.raises(InputError, match="-1"):
        ExportOptions(layers=-1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(("up", "eye", "target"), [("y", (0.5, 2, 3), (0.5, 2, 0)), ("z", (0.5, -3, 2), (0.5, 0, 2))])
def test_a_glb_file_has_a_camera_of_the_first_view(tmp_path, up, eye, target):
    """In the file y is up, and a camera looks along its -z."""
    transform(GOLDEN / "scene.reel", tmp_path / "up.reel", up=up)
    tag(tmp_path / "up.reel", tmp_path / "a.reel", view=[*eye, *target, 30])
    export(meshreel.open(tmp_path / "a.reel"), tmp_path / "out.glb")
    data = (tmp_path / "out.glb").read_bytes()
    tree = json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])
    [node] = [node for node in tree["nodes"] if "camera" in node]
    matrix = np.array(node["matrix"]).reshape(4, 4).T
    np.testing.assert_allclose(matrix[:3, 3], [0.5, 2.0, 3.0], atol=1e-9)
    np.testing.assert_allclose(matrix[:3, :3], np.eye(3), atol=1e-9)
    assert tree["cameras"][0]["perspective"]["yfov"] == pytest.approx(np.radians(30))
    assert tree["nodes"].index(node) in tree["scenes"][0]["nodes"]


def test_a_view_straight_down_is_a_camera_too(tmp_path):
    tag(GOLDEN / "scene.reel", tmp_path / "a.reel", view=[0, 9, 0, 0, 1, 0])
    camera = Animation(np.zeros(1), 1.0, view=meshreel.open(tmp_path / "a.reel").view).camera
    assert camera is not None and np.isfinite(camera).all() and camera[1, 2] == pytest.approx(1)
