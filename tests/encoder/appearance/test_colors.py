"""Colours through encoder, file and decoder: all forms, chains, textures, parts, journals, damage."""

from dataclasses import replace
from io import BytesIO
from itertools import accumulate
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.container.writer import Companion, ReelWriter
from meshreel.edit.edits import concat
from meshreel.encoder.run.surveying import Excerpt, read_survey
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import as_installed
from meshreel.encoder.settings.settings import Settings
from meshreel.errors import FormatError, InputError
from meshreel.format import budget
from meshreel.format.layout import ChunkKind
from meshreel.geometry.derived_sequences import welded
from meshreel.io.sequence import open_sequence
from meshreel.io.write import write_mesh
from meshreel.metrics.color import color_errors
from meshreel.types import Mesh, MeshList, Texture
from tests.colored_body import BODY, CHECKS, COLORED, FRAMES, painted, textured, written
from tests.small_bodies import body
from tests.small_options import quick
from tests.small_scene import scene


def kinds(data: bytes) -> list[ChunkKind]:
    return [ChunkKind(chunk.kind) for chunk in ReelReader(BytesSource(data)).chunks]


@pytest.fixture(scope="module")
def files() -> dict[str, bytes]:
    return {
        "plain": written(BODY).read_bytes(),
        "vertices": written(COLORED, group_size=3).read_bytes(),
        "none": written(COLORED, "none").read_bytes(),
        "texture": written([textured(mesh) for mesh in BODY], group_size=3).read_bytes(),
    }


def test_colors_change_no_byte_of_the_surface(files: dict[str, bytes]) -> None:
    assert files["none"] == files["plain"]
    reader, plain = (ReelReader(BytesSource(files[name])) for name in ("vertices", "none"))
    assert ChunkKind.COLORS not in kinds(files["plain"]) and len(plain.groups) > 0
    assert all(reader.companion_of(group, ChunkKind.COLORS) for group in reader.groups)


def test_colors_of_vertices_are_near_those_of_the_frames(files: dict[str, bytes]) -> None:
    video = meshreel.open(files["vertices"])
    for mesh, shown in zip(COLORED, video, strict=True):
        assert shown.colors is not None and shown.texture is None and shown.colors.flags.writeable
        assert color_errors(mesh, shown)["y_psnr"] > 28
    bare = video.at(colors=False)[0]
    assert bare.colors is None
    np.testing.assert_array_equal(bare.vertices, video[0].vertices)


def test_textures_may_have_another_size_in_each_frame() -> None:
    """What is painted is the same: a ramp over the frame, of 16 x 16 texels or of 96 x 40."""
    meshes = []
    for number, mesh in enumerate(textured(mesh) for mesh in BODY):
        rows, columns = (16, 16) if number % 2 else (40, 96)
        ramp = np.linspace(20, 220, columns)[None, :, None] * np.ones((rows, 1, 3))
        meshes.append(replace(mesh, texture=Texture.of(ramp.astype(np.uint8))))
    video = meshreel.open(written(meshes))
    for mesh, shown in zip(meshes, video, strict=True):
        assert shown.texture is not None and shown.texture.pixels.shape == video[0].texture.pixels.shape
        assert color_errors(mesh, shown)["y_psnr"] > 28


@pytest.mark.parametrize("colored", [True, False])
def test_faces_without_places_are_encoded_beside_faces_with(colored: bool) -> None:
    """The places of some are NaN, those of others are outside of 0 to 1, where the texture is repeated."""
    meshes = []
    for mesh, painted_mesh in zip(BODY[:2], COLORED, strict=False):
        uv = textured(mesh).uv + np.float32([2, -3])
        uv[: len(uv) // 3] = np.nan
        flat = Texture.of(np.full((8, 8, 3), 90, np.uint8))
        meshes.append(replace(painted_mesh if colored else mesh, uv=uv, texture=flat))
    for mesh, shown in zip(meshes, meshreel.open(written(meshes)), strict=True):
        assert shown.texture is not None and color_errors(mesh, shown)["y_psnr"] > 25


def test_a_texture_that_cannot_be_read_ends_the_encoding_with_its_name(tmp_path: Path) -> None:
    for number, mesh in enumerate(BODY[:2]):
        write_mesh(textured(mesh), tmp_path / f"frame_{number}.obj")
    whole = (tmp_path / "frame_1.png").read_bytes()
    (tmp_path / "frame_1.png").write_bytes(whole[: len(whole) // 2])
    options = replace(quick(), appearance=Settings().resolved().appearance)
    with pytest.raises(InputError, match=r"frame_1.png: cannot be read .*write it again, or encode with --color none"):
        Encoder(open_sequence(tmp_path)).encode(tmp_path / "a.reel", replace(options, scene=None))
    assert not (tmp_path / "a.reel").exists()


def test_every_way_to_a_frame_gives_the_same_colors(files: dict[str, bytes]) -> None:
    in_order = [mesh.colors for mesh in meshreel.open(files["vertices"])]
    for order in ([5, 2, 4, 0], [FRAMES - 1], [3, 3, 1]):
        video = meshreel.open(files["vertices"])
        video.vertices(0, 3)
        for number in order:
            np.testing.assert_array_equal(video[number].colors, in_order[number])


def test_fewer_layers_have_the_colors_of_their_vertices(files: dict[str, bytes]) -> None:
    whole = meshreel.open(files["vertices"])[1]
    for layers in (0, 1, 2):
        mesh = meshreel.open(files["vertices"]).at(layers)[1]
        np.testing.assert_array_equal(mesh.colors, whole.colors[: len(mesh.vertices)])


@pytest.mark.parametrize("preset", ["best", "paper"])
def test_all_forms_have_colors(preset: str) -> None:
    unlike = [painted(mesh, mesh) for mesh in (body(0, 1)[0], body(3, 1)[0], body(5, 1)[0], Mesh.empty())]
    path = written([*COLORED[:2], *unlike], preset=preset)
    video = meshreel.open(path)
    assert len({group.form for group in video.reader.groups}) > 1
    for number, mesh in enumerate([*COLORED[:2], *unlike[:3]]):
        assert color_errors(mesh, video[number])["y_psnr"] > 22, number
    assert video[5].is_empty


def test_a_chain_has_one_atlas_and_pictures_of_each_frame(files: dict[str, bytes]) -> None:
    video, found = meshreel.open(files["texture"]), kinds(files["texture"])
    assert found.count(ChunkKind.ATLAS) == 1 < found.count(ChunkKind.PICTURES) == found.count(ChunkKind.GROUP)
    for number in (4, 0, 5, 1):
        shown, wanted = video[number], textured(BODY[number])
        assert shown.texture is not None and shown.uv.shape == (len(shown.faces), 3, 2)
        bare = replace(shown, texture=None, uv=None)
        assert color_errors(wanted, shown)["y_psnr"] > color_errors(wanted, bare)["y_psnr"] + 2
    np.testing.assert_array_equal(meshreel.open(files["texture"])[4].texture.pixels, video[4].texture.pixels)
    coarse = video.at(0)[2]
    assert len(coarse.uv) == len(coarse.faces)


def test_beneath_pictures_colors_of_vertices_do_not_change_and_take_little(files: dict[str, bytes]) -> None:
    video = meshreel.open(files["texture"])
    count = min(len(mesh.vertices) for mesh in video)  # the template's, at least; patches differ
    shown = [mesh.colors[:count] for mesh in video]
    assert all(np.array_equal(colors, shown[0]) for colors in shown) and np.ptp(shown[0], axis=0).max() > 30
    reader = video.reader
    first, second = (len(reader.read_chunk(c.number)) for c in reader.chunks if c.kind == ChunkKind.COLORS)
    assert second < first / 20  # nothing but that nothing changes


def test_beneath_pictures_colors_of_vertices_follow_the_light() -> None:
    """Half of the light goes out between the two groups of a chain, a tenth within each."""
    lights = [1.0, 0.95, 0.9, 0.5, 0.47, 0.45]
    meshes = [textured(mesh) for mesh in BODY]
    lit = [
        replace(mesh, texture=Texture.of((light * (55 + CHECKS * 0.8)).astype(np.uint8)))
        for mesh, light in zip(meshes, lights, strict=True)
    ]
    video = meshreel.open(written(lit, group_size=3))
    assert [group.depends_on != () for group in video.reader.groups] == [False, True]  # one chain
    count = min(len(mesh.vertices) for mesh in video)
    means = [float(mesh.colors[:count].mean()) for mesh in video]
    assert np.ptp(means[:3]) == np.ptp(means[3:]) == 0
    assert means[3] / means[0] == pytest.approx(np.mean(lights[3:]) / np.mean(lights[:3]), abs=0.1)


def without(data: bytes, kind: ChunkKind) -> bytes:
    """The file without the chunks of a kind."""
    reader, output, numbers = ReelReader(BytesSource(data)), BytesIO(), dict[int, int]()
    with ReelWriter(output, reader.header) as writer:
        for chunk in reader.chunks:
            if chunk.kind == kind:
                continue
            payload, depends_on = reader.read_chunk(chunk.number), [numbers[n] for n in chunk.depends_on]
            ends = tuple(accumulate(layer.size for layer in chunk.layers))
            if chunk.kind == ChunkKind.GROUP:
                frames = chunk.first_frame, chunk.frame_count
                numbers[chunk.number] = writer.add_group(*frames, payload, ends, depends_on, chunk.track)
            else:
                numbers[chunk.number] = writer.add_companion(
                    Companion(ChunkKind(chunk.kind), payload, ends), depends_on
                )
    return output.getvalue()


def test_a_compatible_file_is_shown_with_either_video(files: dict[str, bytes]) -> None:
    meshes = [textured(mesh) for mesh in BODY]
    both = written(meshes, compatible=True, group_size=3).read_bytes()
    found = kinds(both)
    assert found.count(ChunkKind.COMPATIBLE) == found.count(ChunkKind.PICTURES) > 1
    assert without(both, ChunkKind.COMPATIBLE) == files["texture"]
    video, other = meshreel.open(both), meshreel.open(without(both, ChunkKind.PICTURES))
    for number in (4, 0, 5):
        one, two = video[number].texture.pixels, other[number].texture.pixels
        assert 0 < np.abs(one.astype(int) - two).mean() < 10


def damaged(data: bytes, kind: ChunkKind) -> bytes:
    chunk = next(chunk for chunk in ReelReader(BytesSource(data)).chunks if chunk.kind == kind)
    at = chunk.offset + chunk.size // 2
    return data[:at] + bytes([data[at] ^ 255]) + data[at + 1 :]


def test_damaged_colors_cost_colors_only(files: dict[str, bytes]) -> None:
    video = meshreel.open(damaged(files["vertices"], ChunkKind.COLORS))
    with pytest.raises(FormatError, match=r"chunk 1 \(colors, frames 0"):
        _ = video[0]
    assert len(video.at(colors=False)[0].vertices) > 0
    video = meshreel.open(damaged(files["texture"], ChunkKind.PICTURES))
    with pytest.raises(FormatError, match="pictures"):
        _ = video[FRAMES - 1].texture.pixels
    assert video[0].colors is not None


def test_a_scene_has_colors_of_its_room_and_its_bodies(tmp_path: Path) -> None:
    frames = scene(6, moving=True)
    colors = [replace(mesh, colors=(120 + 100 * np.tanh(mesh.vertices)).astype(np.uint8)) for mesh in frames]
    Encoder(welded(MeshList(tuple(colors), 10.0))).encode(tmp_path / "scene.reel", quick())
    with meshreel.open(tmp_path / "scene.reel") as video:
        assert video.reader.has_background
        for number in (0, 5):
            assert color_errors(colors[number], video[number])["y_psnr"] > 20
        assert video.background(0).colors is not None


def test_colors_that_readers_would_refuse_are_left_out_and_the_summary_tells_of_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(budget, "LIMITS", replace(budget.LIMITS, colors=0, per_byte=1))
    body, room = COLORED[:2], [replace(mesh, colors=np.full(mesh.vertices.shape, 9, np.uint8)) for mesh in scene(4)]
    for meshes, lost in ((body, "2 frames"), (room, "8 frames and of the background")):
        summary = Encoder(welded(MeshList(tuple(meshes), 10.0))).encode(tmp_path / "bare.reel", quick())
        [text] = summary.warnings
        assert text == f"no colours of {lost}: they would cost a reader too much"
        assert ChunkKind.COLORS not in kinds((tmp_path / "bare.reel").read_bytes())
    assert not Encoder(welded(MeshList(tuple(BODY[:2]), 10.0))).encode(tmp_path / "plain.reel", quick()).warnings


def lit(mesh: Mesh, light: float) -> Mesh:
    return replace(mesh, colors=(light * (120 + 100 * np.tanh(mesh.vertices))).astype(np.uint8))


@pytest.mark.slow
def test_light_that_moves_over_a_room_is_in_its_slow_video(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshreel.encoder.appearance.videos.LAYER_PICTURES", 2)
    monkeypatch.setattr("meshreel.decoder.pictures.LAYER_PICTURES", 2)
    lights = np.linspace(0.6, 1, 10)
    frames = [lit(mesh, light) for mesh, light in zip(scene(10, moving=True), lights, strict=True)]
    options = replace(quick(), appearance=Settings(color="texture", texture=128).resolved().appearance)
    Encoder(welded(MeshList(tuple(frames), 16.0))).encode(tmp_path / "scene.reel", options)
    with meshreel.open(tmp_path / "scene.reel") as video:
        [pictures] = [c for c in video.reader.chunks if c.kind == ChunkKind.PICTURES and c.frame_count == 0]
        assert len(pictures.layers) == 3  # of 5 pictures, one for two frames
        shown = [video.background(number) for number in range(10)]
        assert shown[0] is not shown[2] and shown[0].vertices is shown[2].vertices
        means = [np.nanmean(mesh.texture.pixels) for mesh in shown]
        assert means[0] == means[1] and all(np.diff(means[::2]) > 3)
        again = [np.nanmean(video.background(number).texture.pixels) for number in (9, 1, 5)]
        assert again == [means[9], means[1], means[5]]


@pytest.mark.slow
def test_parts_of_a_sequence_are_joined_with_their_colors(tmp_path: Path) -> None:
    for number, mesh in enumerate(COLORED):
        write_mesh(mesh, tmp_path / f"frame_{number}.ply")
    options = replace(quick(key_interval=0.1), appearance=Settings().resolved().appearance, scene=None)
    encoder = Encoder(welded(open_sequence(tmp_path)))
    encoder.encode(tmp_path / "whole.reel", options)
    encoder.survey(tmp_path / "survey.json")
    whole = read_survey(tmp_path / "survey.json")
    parts = [tmp_path / "a.reel", tmp_path / "b.reel"]
    for path, frames in zip(parts, (range(3), range(3, FRAMES)), strict=True):
        Encoder(welded(open_sequence(tmp_path)), excerpt=Excerpt(whole, frames)).encode(path, options)
    concat(parts, tmp_path / "joined.reel")
    with meshreel.open(tmp_path / "joined.reel") as joined, meshreel.open(tmp_path / "whole.reel") as whole:
        for one, other in zip(joined, whole, strict=True):
            np.testing.assert_array_equal(one.colors, other.colors)


def test_missing_packages_leave_colors_of_vertices(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshreel.encoder.settings.options.find_spec", lambda name: None if name == "av" else name)
    options, warnings = as_installed(Settings().resolved())
    assert options.appearance.texture is None and "meshreel[color]" in warnings[0]
    with pytest.raises(InputError, match=r"av missing; pip install"):
        as_installed(Settings(color="texture").resolved())
    assert as_installed(Settings(color="none").resolved())[1] == ()


def test_ways_of_colors_out_of_range_are_refused() -> None:
    none = {"color": "none", "texture": 512}, {"color": "none", "compatible": True}
    for wrong in ({"color": "red"}, {"color_quality": 101.0}, {"texture": 300}, *none):
        with pytest.raises(InputError):
            Settings(**wrong).resolved()  # type: ignore[arg-type]
    assert Settings(color="none").resolved().appearance is None
    assert Settings(color="vertices").resolved().appearance.texture is None
