"""Splats in files: a set for each chain, which all its frames have; what has no colours, or no one mesh, has none."""

import gzip
import io
import json
import struct
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from itertools import accumulate

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from meshreel.analysis.appearance.splat_fit import fit_splats
from meshreel.cli.compare import compare_splats
from meshreel.cli.decode import decode
from meshreel.coding.mesh import encode_intra
from meshreel.container.reader import Chunk, ReelReader
from meshreel.container.sources import BytesSource
from meshreel.container.writer import Companion, ReelWriter
from meshreel.decoder.video import Video
from meshreel.decoder.video import open as open_video
from meshreel.encoder.sequence import encode
from meshreel.encoder.settings.options import EncoderOptions
from meshreel.encoder.settings.settings import Settings
from meshreel.errors import FormatError, InputError
from meshreel.export.frames import write_splats
from meshreel.format.layout import ChunkKind
from meshreel.types import Mesh, MeshList
from tests.golden import GOLDEN
from tests.spheres import deforming_sphere

FRAMES = 6


def ball(frames: int = FRAMES) -> MeshList:
    """Return a ball that stretches, in colours that move with it."""
    [shape] = deforming_sphere(1, levels=3)
    colors = np.clip(128 + 100 * np.sin(4 * shape.vertices / np.abs(shape.vertices).max()), 0, 255).astype(np.uint8)
    grown = (shape.vertices * [1.0, 1 + 0.03 * number, 1.0] for number in range(frames))
    return MeshList(tuple(Mesh(vertices, shape.faces, colors) for vertices in grown))


def options(preset: str = "best", group_size: int = 3) -> EncoderOptions:
    centers = 60 if preset == "paper" else None
    basis = 2 if preset == "paper" else None
    found = Settings(
        preset, basis_size=basis, group_size=group_size, centers=centers, color="vertices", splats=200
    ).resolved()
    return replace(found, scene=None)


@pytest.fixture(scope="module", autouse=True)
def small_splats() -> Iterator[None]:
    """Few pictures, and small ones."""
    module = "meshreel.encoder.appearance.colors"
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (("FRAMES", 3), ("VIEWS", 4), ("SIZE", 64)):
            patch.setattr(f"{module}.{name}", value)
        patch.setattr(f"{module}.fit_splats", partial(fit_splats, steps=60))
        yield


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Video:
    pytest.importorskip("torch")
    path = tmp_path_factory.mktemp("splats") / "ball.reel"
    encode(ball(), path, options=options())
    return open_video(path.read_bytes())


def test_a_chain_has_one_set_that_all_its_frames_have(video: Video) -> None:
    reader = video.reader
    first = [chunk for chunk in reader.groups if reader.group_before(chunk) is None]
    sets = [chunk for chunk in reader.chunks if chunk.kind == ChunkKind.SPLATS]
    assert [chunk.depends_on for chunk in sets] == [(chunk.number,) for chunk in first]
    assert len(reader.groups) > len(first)
    for frame in range(FRAMES):
        bound, mesh = video.splats(frame), video[frame]
        assert bound is not None and 150 < len(bound.means) <= 200
        assert (np.abs(bound.means - mesh.middle) <= 0.6 * mesh.diagonal).all()


def test_splats_look_like_the_frames(video: Video) -> None:
    row = compare_splats(ball(), video, lambda *_: None)
    assert row["splats_psnr"] > 18 and row["splats_ssim"] > 0.6 and row["splats_views"] == 4 * FRAMES


def test_fewer_layers_have_fewer_and_larger_splats(video: Video) -> None:
    few, all_of_them = video.at(0).splats(2), video.splats(2)
    assert few is not None and all_of_them is not None
    assert len(few.means) == round(len(all_of_them.means) / 8)
    assert np.median(few.scales) > 1.3 * np.median(all_of_them.scales)


def test_each_group_of_preset_paper_has_a_set(tmp_path) -> None:
    pytest.importorskip("torch")
    encode(ball(), tmp_path / "x.reel", options=options("paper"))
    with open_video(tmp_path / "x.reel") as video:
        sets = [chunk for chunk in video.reader.chunks if chunk.kind == ChunkKind.SPLATS]
        assert len(sets) == len(video.reader.groups) and {group.form_name for group in video.reader.groups} == {
            "laplacian"
        }
        assert video.splats(FRAMES - 1) is not None


def test_a_sequence_without_colours_is_refused(tmp_path) -> None:
    pytest.importorskip("torch")
    plain = MeshList(tuple(Mesh(mesh.vertices, mesh.faces) for mesh in ball()))
    with pytest.raises(InputError, match="splats need colours, and no frame has any: give colour cameras"):
        encode(plain, tmp_path / "x.reel", options=options())
    assert not list(tmp_path.glob("*.reel"))
    with pytest.raises(InputError, match="splats are fitted to colours"):
        Settings(color="none", splats=100).resolved()


def test_frames_with_meshes_of_their_own_have_no_splats(video: Video) -> None:
    reader, out = video.reader, io.BytesIO()
    group = reader.groups[0]
    of = reader.companion_of(group, ChunkKind.SPLATS)
    assert of is not None
    with ReelWriter(out, reader.header) as writer:
        writer.add_group(0, group.frame_count, reader.read_chunk(group.number), ends(group))
        writer.add_companion(Companion(ChunkKind.SPLATS, reader.read_chunk(of.number), ends(of)), [0])
        writer.add_group(group.frame_count, 1, encode_intra([ball(1)[0]], 0.01, 0), depends_on=[0])
    some = open_video(out.getvalue())
    assert some.splats(0) is not None and some.splats(group.frame_count) is None


def ends(chunk: Chunk) -> tuple[int, ...]:
    return tuple(accumulate(layer.size for layer in chunk.layers))


def test_damaged_splats_cost_no_frame(video: Video) -> None:
    reader = video.reader
    data = bytearray(reader.source.get_bytes(0, reader.size))
    of = next(chunk for chunk in reader.chunks if chunk.kind == ChunkKind.SPLATS)
    data[of.offset + 5] ^= 1
    damaged = Video(ReelReader(BytesSource(bytes(data))))
    assert len(damaged[0].faces) == len(video[0].faces)
    with pytest.raises(FormatError, match="splats, frames 0 to"):
        damaged.splats(0)


def test_a_file_without_splats_has_none_in_any_frame() -> None:
    with open_video(GOLDEN / "mixed.reel") as video:
        assert not video.reader.has_splats and video.splats(2) is None


def test_a_viewer_of_splats_reads_what_is_written(video: Video, tmp_path) -> None:
    bound = video.splats(1)
    assert bound is not None
    hidden = replace(bound, opacities=np.where(np.arange(len(bound.means)) == 0, 0, bound.opacities))
    write_splats(hidden, tmp_path / "frame.ply")
    head, _, body = (tmp_path / "frame.ply").read_bytes().partition(b"end_header\n")
    names = [line.split()[-1] for line in head.decode().splitlines() if line.startswith("property")]
    rows = np.load(io.BytesIO(_npy(body, len(names))))
    assert len(rows) == len(bound.means) - 1 and np.isfinite(rows).all()
    column = dict(zip(names, rows.T, strict=True))
    np.testing.assert_allclose(column["y"], bound.means[1:, 1], rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(np.exp(column["scale_0"]), bound.scales[1:, 0], rtol=1e-4)
    np.testing.assert_allclose(0.5 + 0.28209479 * column["f_dc_2"], bound.colors[1:, 2], atol=1e-5)
    write_splats(None, tmp_path / "empty.ply")
    assert b"element vertex 0\n" in (tmp_path / "empty.ply").read_bytes()


def test_glb_has_the_same_splats_as_attributes_of_points(video: Video, tmp_path) -> None:
    bound = video.splats(1)
    assert bound is not None
    write_splats(bound, tmp_path / "frame.glb")
    data = (tmp_path / "frame.glb").read_bytes()
    size = int.from_bytes(data[12:16], "little")
    tree, body = json.loads(data[20 : 20 + size]), data[28 + size :]
    [primitive] = tree["meshes"][0]["primitives"]
    assert tree["extensionsUsed"] == ["KHR_gaussian_splatting"] and primitive["mode"] == 0
    about = {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}
    assert primitive["extensions"] == {"KHR_gaussian_splatting": about}

    def values(name: str) -> np.ndarray:
        accessor = tree["accessors"][primitive["attributes"][name]]
        begin = tree["bufferViews"][accessor["bufferView"]]["byteOffset"]
        width = {"SCALAR": 1, "VEC3": 3, "VEC4": 4}[accessor["type"]]
        return np.frombuffer(body, "<f4", accessor["count"] * width, begin).reshape(-1, width)

    own = "KHR_gaussian_splatting:"
    np.testing.assert_allclose(values("POSITION"), bound.means, atol=1e-6)
    np.testing.assert_allclose(np.exp(values(f"{own}SCALE")), bound.scales, rtol=1e-4)
    np.testing.assert_allclose(values(f"{own}OPACITY")[:, 0], bound.opacities, atol=2e-3)
    np.testing.assert_allclose(0.5 + 0.28209479 * values(f"{own}SH_DEGREE_0_COEF_0"), bound.colors, atol=1e-5)
    x, y, z, w = values(f"{own}ROTATION").T
    np.testing.assert_allclose(x * x + y * y + z * z + w * w, 1, atol=1e-5)
    np.testing.assert_allclose(1 - 2 * (y * y + z * z), np.swapaxes(bound.axes, 1, 2)[:, 0, 0], atol=1e-4)
    assert values("COLOR_0").shape == (len(bound.means), 4)
    write_splats(None, tmp_path / "empty.glb")
    assert b'"scenes":[{}]' in (tmp_path / "empty.glb").read_bytes()


def test_spz_has_the_same_splats_within_its_steps(video: Video, tmp_path) -> None:
    bound = video.splats(1)
    assert bound is not None
    write_splats(bound, tmp_path / "frame.spz")
    data = gzip.decompress((tmp_path / "frame.spz").read_bytes())
    magic, version, count, degree, fraction, _, _ = struct.unpack("<4sIIBBBB", data[:16])
    assert (magic, version, count, degree) == (b"NGSP", 3, len(bound.means), 0) and len(data) == 16 + 20 * count
    values = np.frombuffer(data, np.uint8, offset=16)
    places, rest = np.split(values, [9 * count])
    parts = np.pad(places.reshape(-1, 3), ((0, 0), (1, 0))).copy().view("<i4").reshape(-1, 3)
    np.testing.assert_allclose(parts / 2.0 ** (8 + fraction), bound.means, atol=2.0**-fraction)
    opacities, colors, scales, turns = np.split(rest.astype(np.float64), np.cumsum([count, 3 * count, 3 * count]))
    np.testing.assert_allclose(opacities / 255, bound.opacities, atol=0.003)
    harmonics = (colors.reshape(-1, 3) / 255 - 0.5) / 0.15
    np.testing.assert_allclose(0.5 + 0.28209479 * harmonics, bound.colors, atol=0.005)
    np.testing.assert_allclose(scales.reshape(-1, 3) / 16 - 10, np.log(bound.scales), atol=0.032)
    axes = Rotation.from_quat([_quaternion(int(bits)) for bits in turns.astype(np.uint8).view("<u4")])
    assert np.einsum("nck,nkc->nk", axes.as_matrix(), bound.axes).min() > 0.9999


def _quaternion(bits: int) -> list[float]:
    """Return x y z w of the largest part's number and three others, the last of which are the lowest bits."""
    largest, found = bits >> 30, [0.0] * 4
    for part in (part for part in (3, 2, 1, 0) if part != largest):
        found[part] = (bits & 511) / 511 / 2**0.5 * (-1 if bits & 512 else 1)
        bits >>= 10
    found[largest] = max(1 - sum(own * own for own in found), 0) ** 0.5
    return found


def test_an_spz_file_of_meshes_is_refused(tmp_path) -> None:
    file = GOLDEN / "splats" / "splats.reel"
    with pytest.raises(InputError, match="add --splats"):
        decode(file, output=tmp_path / "out", format="spz")
    decode(file, output=tmp_path / "out", format="spz", splats=True)
    assert {path.suffix for path in (tmp_path / "out").iterdir()} == {".spz"}


def _npy(body: bytes, columns: int) -> bytes:
    file = io.BytesIO()
    np.save(file, np.frombuffer(body, "<f4").reshape(-1, columns))
    return file.getvalue()
