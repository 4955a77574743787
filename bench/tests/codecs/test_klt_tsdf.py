"""KLT of TSDF blocks: what comes back, what it costs, and bytes that are no stream."""

from dataclasses import replace

import numpy as np
import pytest
from jaxtyping import TypeCheckError
from meshreel_bench.codecs import make_codec
from meshreel_bench.codecs.klt_tsdf import (
    KltTsdfCodec,
    Video,
    decode_bits,
    decode_places,
    encode_bits,
    encode_places,
)
from meshreel_bench.codecs.klt_tsdf.components import (
    MOST,
    ONE,
    Field,
    cells_at,
    crossed,
    decode_basis,
    encode_basis,
    learned,
    model_of,
    polygonize,
)
from meshreel_bench.codecs.klt_tsdf.grid import VOLUME, prepared, sample, voxel_index

from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.errors import FormatError, InputError
from meshreel.geometry.topology import border_edges, components, part_of
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList
from tests.spheres import deforming_sphere, sliding_sphere

SMALL = KltTsdfCodec(cells=80, basis=24, step=0.05)


@pytest.fixture(scope="module")
def body():
    """Two frames of a person."""
    return MeshList(tuple(soft_bodies(SoftBodiesOptions(frames=2, people=1, spacing=0.03, begin=1.1, seed=5))))


@pytest.fixture(scope="module")
def stream(body):
    """They, coded."""
    return SMALL.encode(body)


def outcome(data: bytes) -> str:
    """Decode every frame and return the outcome; other errors than FormatError are raised."""
    try:
        video = SMALL.decode(data)
        frames = [video[number] for number in range(len(video))]
    except FormatError:
        return "refused"
    except TypeCheckError as error:  # the checker of annotations looks at a frame of what is returned
        assert isinstance(error.__cause__, FormatError)
        return "refused"
    assert all(np.isfinite(mesh.vertices).all() for mesh in frames)
    return "decoded"


def mean_psnr(sequence, frames) -> float:
    return float(np.mean([surface_errors(a, b).symmetric_psnr for a, b in zip(sequence, frames, strict=True)]))


def open_sheet(count: int = 24) -> Mesh:
    """A wavy sheet with a border."""
    x, y = np.meshgrid(np.linspace(0, 1, count), np.linspace(0, 1.3, count), indexing="ij")
    number = np.arange(count * count).reshape(count, count)
    a, b, c, d = number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    return Mesh.of(np.stack([x, y, 0.08 * np.sin(5 * x) * np.cos(4 * y)], -1).reshape(-1, 3), faces)


def test_a_body_comes_back_to_a_fraction_of_a_voxel(body, stream):
    for original, decoded in zip(body, SMALL.decode(stream), strict=True):
        voxel = original.diagonal / SMALL.cells
        assert surface_errors(original, decoded).symmetric_rms < 0.25 * voxel
        assert len(border_edges(decoded)) == 0
        a, b, c = (decoded.vertices[decoded.faces[:, k]] for k in range(3))
        assert np.einsum("nd,nd->", a, np.cross(b, c)) > 0  # faces look outwards
    assert len(stream) < 3500


@pytest.mark.slow
def test_quality_rises_with_the_rate(body):
    points = [(56, 16, 0.08), (80, 24, 0.05), (112, 32, 0.03)]
    coded = [KltTsdfCodec(cells=cells, basis=basis, step=step) for cells, basis, step in points]
    streams = [each.encode(body) for each in coded]
    sizes = [len(data) for data in streams]
    quality = [mean_psnr(body, each.decode(data)) for each, data in zip(coded, streams, strict=True)]
    assert sizes == sorted(sizes)
    assert quality == sorted(quality)
    assert quality[2] > quality[0] + 6


@pytest.mark.slow
def test_each_option_alone_buys_quality(body):
    def measured(**changes):
        data = replace(SMALL, **changes).encode(MeshList(body.meshes[:1]))
        return len(data), mean_psnr(body.meshes[:1], SMALL.decode(data))

    size, quality = measured()
    for changes in ({"basis": 48}, {"step": 0.02}):
        larger, better = measured(**changes)
        assert larger > size
        assert better > quality


@pytest.mark.slow
def test_spheres_that_move_and_stretch_stay_closed_in_one_piece():
    coarse = replace(SMALL, cells=48)
    for sequence in (sliding_sphere(3, step=0.3), deforming_sphere(3)):
        for original, decoded in zip(sequence, coarse.decode(coarse.encode(sequence)), strict=True):
            assert len(border_edges(decoded)) == 0
            assert components(decoded.faces, len(decoded.vertices)).max() == 0
            assert surface_errors(original, decoded).symmetric_psnr > 50


def test_the_same_input_gives_the_same_bytes_and_frames(body, stream):
    assert SMALL.encode(body) == stream
    once, again = SMALL.decode(stream), SMALL.decode(stream)
    for number in (1, 0, 1):
        assert np.array_equal(once[number].vertices, again[number].vertices)
        assert np.array_equal(once[number].faces, again[number].faces)


def test_frames_may_be_empty_and_differ_in_everything(body):
    ball = sliding_sphere(1, levels=2)[0]
    frames = MeshList((Mesh.empty(), body[0], Mesh.empty(), Mesh(0.3 * ball.vertices + [0, 1, 0], ball.faces)))
    decoded = replace(SMALL, group=3).encode(frames)
    video = SMALL.decode(decoded)
    assert [mesh.is_empty for mesh in video] == [True, False, True, False]
    assert surface_errors(frames[1], video[1]).symmetric_psnr > 40
    nothing = SMALL.decode(SMALL.encode(MeshList((Mesh.empty(),) * 3)))
    assert [mesh.is_empty for mesh in nothing] == [True] * 3
    with pytest.raises(InputError, match="no frames"):
        SMALL.encode(MeshList(()))


@pytest.mark.slow
def test_an_open_surface_stays_open_and_ends_where_it_did():
    sheet = open_sheet()
    for mesh in (sheet, Mesh.of(sheet.vertices, sheet.faces[:, ::-1])):
        decoded = SMALL.decode(SMALL.encode(MeshList((mesh,))))[0]
        errors = surface_errors(mesh, decoded)
        assert errors.hausdorff95 < 0.6 * mesh.diagonal / SMALL.cells
        assert len(border_edges(decoded)) > 50
        assert decoded.vertices[:, :2].min() > -1.2 * mesh.diagonal / SMALL.cells


@pytest.mark.slow
def test_a_body_with_a_hole_has_its_inside_where_it_was(body):
    mesh = body[0]
    top = mesh.vertices[mesh.faces].mean(axis=1)[:, 1]
    opened = part_of(mesh, top < np.quantile(top, 0.995))
    decoded = SMALL.decode(SMALL.encode(MeshList((opened,))))[0]
    assert surface_errors(opened, decoded).hausdorff95 < 0.5 * mesh.diagonal / SMALL.cells


def test_a_closed_box_is_signed_by_its_pseudonormals():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float) * [9.3, 7.1, 12.2] + 3.4
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    box = prepared(Mesh.of(corners, [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]))
    found = sample(box)
    keys, index = voxel_index(found.places)
    voxels = np.zeros((len(keys), 3))
    voxels[index.reshape(-1)] = (8 * found.places[:, None] + np.indices((9, 9, 9)).reshape(3, -1).T).reshape(-1, 3)
    inside = ((voxels > corners.min(axis=0)) & (voxels < corners.max(axis=0))).all(axis=1)
    assert np.array_equal(found.values < 0, inside[index])


@pytest.mark.slow
def test_places_and_metres_do_not_matter(body):
    mesh = body[0]
    far = Mesh.of(1000 * mesh.vertices + [5e4, -2e5, 3e4], mesh.faces)
    near = SMALL.decode(SMALL.encode(MeshList((mesh,))))[0]
    moved = SMALL.decode(SMALL.encode(MeshList((far,))))[0]
    quality = surface_errors(far, moved).symmetric_psnr
    assert surface_errors(mesh, near).symmetric_psnr == pytest.approx(quality, abs=0.2)


def test_the_basis_is_in_the_stream_orthonormal_to_its_rounding_and_survives_coding(stream):
    table = encode_basis(learned(SMALL.basis)[0])
    assert table in stream and 0 < len(table) < 30 * SMALL.basis
    symbols, energies = learned(MOST)
    basis = model_of(symbols, 1)
    gram = basis.vectors.T @ basis.vectors / ONE**2 / VOLUME
    assert np.abs(gram - np.eye(MOST)).max() < 0.02
    assert (np.diff(energies) <= 0).all()
    again = decode_basis(encode_basis(symbols), MOST)
    assert np.array_equal(model_of(again, 1).vectors, basis.vectors)
    assert (basis.vectors == np.rint(basis.vectors)).all()


def test_crossed_cells_are_those_that_have_faces(body):
    mesh = body[0]
    found = sample(prepared(Mesh((mesh.vertices - mesh.vertices.min(axis=0)) * 32 / mesh.diagonal, mesh.faces)))
    index = voxel_index(found.places)[1].astype(np.int32).reshape(-1, 9, 9, 9)
    values = np.rint(found.values * 2**24).astype(np.int32).reshape(index.shape)
    field = Field(found.places, np.where(values == 0, 1, values), index)
    cells = crossed(field, np.ones(len(found.places), bool))
    decoded, numbers = polygonize(field)
    having = np.floor(decoded.vertices[decoded.faces].mean(axis=1)).astype(int)
    assert np.array_equal(cells_at(numbers, field), having) and len(border_edges(decoded)) == 0
    assert np.array_equal(np.sort(cells), np.unique(numbers))


def test_places_and_bits_come_back():
    generator = np.random.default_rng(3)
    frames = [np.unique(generator.integers(-9, 9, (n, 3)), axis=0) for n in (40, 1, 200)]
    frames.insert(1, np.zeros((0, 3), np.int64))
    for a, b in zip(frames, decode_places(encode_places(frames), 4), strict=True):
        assert np.array_equal(a, b)
    for share in (0.0, 0.3, 1.0):
        bits = generator.random(len(frames[3])) < share
        assert np.array_equal(decode_bits(encode_bits(bits, frames[3]), frames[3]), bits)


@pytest.mark.parametrize("wrong", ["cells 4", "cells nan", "basis 0", "basis 65", "step 0", "group 0", "qp 8"])
def test_options_that_cannot_be_are_refused(wrong):
    name, number = wrong.split()
    with pytest.raises(InputError, match="'qp'" if name == "qp" else wrong):
        make_codec("klt_tsdf", {name: int(number) if number.isdigit() else float(number)})


def test_every_truncation_every_extra_byte_and_a_byte_that_is_wrong_is_refused(stream):
    for size in [*range(60), *range(60, len(stream), 37)]:
        assert outcome(stream[:size]) == "refused"
    assert outcome(stream + b"\0") == "refused"
    for place in range(0, len(stream), 37):
        assert outcome(stream[:place] + bytes([stream[place] ^ 1]) + stream[place + 1 :]) == "refused"
    with pytest.raises(FormatError, match="no stream of klt_tsdf"):
        Video(b"MREL" + bytes(40))


def test_a_box_of_more_blocks_than_memory_is_for_is_refused():
    with pytest.raises(InputError, match="give fewer cells"):
        encode_places([np.array([[0, 0, 0], [500, 500, 500]])])
