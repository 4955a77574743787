"""NeCGS without its network: surfaces cut out of grids, grids filled from meshes, and the bytes of a coded set."""

import numpy as np
import pytest
from meshreel_bench.codecs.necgs.stream import Coded, Shape, decode_stream, dequantize, encode_stream, quantize
from meshreel_bench.codecs.necgs.volumes import (
    MARGIN,
    Placement,
    box_of,
    cut,
    extract,
    place_grids,
    truncated_distances,
)

from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.errors import FormatError, InputError
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import border_edges, concatenate, face_normals, unique_edges
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh
from tests.scenes import moved, plane, sphere
from tests.spheres import deforming_sphere

SHAPE = Shape(resolution=16, features=2, channels=4, bits=8)


def volume_of(mesh: Mesh, resolution: int) -> tuple[np.ndarray, Placement, bool]:
    """A TSDF-Def volume without deformation, its placement, and whether it has sheets."""
    placement = place_grids([box_of(mesh)], resolution)
    distances, sheets = truncated_distances(placement.inverse(mesh, 0, resolution), resolution)
    zeros = np.zeros((*distances.shape, 3), np.float32)
    return np.concatenate([distances[..., None], zeros], axis=-1), placement, sheets


def enclosed(mesh: Mesh) -> float:
    """The volume that faces enclose; positive where they look outwards."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return float(np.einsum("nd,nd->", a, np.cross(b, c)) / 6)


def coded(frames: int = 3, seed: int = 0) -> Coded:
    """A set of random numbers; the middle frame is empty."""
    random = np.random.default_rng(seed)
    full = np.arange(frames) != 1
    placement = Placement(0.01, (1.0, 2.0, 3.0), random.integers(-50, 50, (frames, 3)).astype(np.int32) * full[:, None])
    features = random.integers(-128, 129, (int(full.sum()), SHAPE.feature_size)).astype(np.int32)
    parameters = [random.integers(-9, 10, int(np.prod(size))).astype(np.int32) for size in SHAPE.tensors]
    return Coded(SHAPE, False, full, placement, features, parameters)


def test_the_surface_of_any_signs_is_closed_and_each_edge_is_walked_both_ways_alike():
    distances = np.ones((10, 10, 10), np.float32)
    distances[1:-1, 1:-1, 1:-1] = np.random.default_rng(1).normal(size=(8, 8, 8))
    found = cut(distances[None])
    _, face_edges = unique_edges(found.faces)
    assert len(found.faces) > 1000
    assert set(np.bincount(face_edges.reshape(-1)) % 2) == {0}
    ways = np.concatenate([found.faces[:, [0, 1]], found.faces[:, [1, 2]], found.faces[:, [2, 0]]])
    balance = np.zeros((len(found.low),) * 2, np.int64)
    np.add.at(balance, (ways[:, 0], ways[:, 1]), 1)
    assert (balance == balance.T).all()


def test_a_ball_comes_back_from_its_distances_closed_and_with_its_volume():
    axes = np.indices((24, 24, 24)) - 11.3
    volume = np.zeros((24, 24, 24, 4), np.float32)
    volume[..., 0] = np.clip((np.sqrt((axes**2).sum(axis=0)) - 8) / 2, -1, 1)
    ball = extract(volume, trimmed=False)
    assert len(border_edges(ball)) == 0
    assert enclosed(ball) == pytest.approx(4 / 3 * np.pi * 8**3, rel=0.02)
    assert np.abs(np.linalg.norm(ball.vertices - 11.3, axis=1) - 8).max() < 0.1


def test_a_deformation_moves_the_surface_by_half_a_cell_at_most():
    volume, _, _ = volume_of(deforming_sphere(1)[0], 16)
    moved = volume.copy()
    moved[..., 2] = 1.0
    still, shifted = extract(volume, trimmed=False), extract(moved, trimmed=False)
    assert np.allclose(shifted.vertices - still.vertices, [0, 0.5, 0])


def test_grids_hold_every_frame_and_shift_by_whole_cells():
    frames = list(soft_bodies(SoftBodiesOptions(frames=3, spacing=0.05, people=1)))
    placement = place_grids([box_of(mesh) for mesh in (frames[0], Mesh.empty(), *frames[1:])], 32)
    assert placement.shifts.shape == (4, 3)
    for number, mesh in ((0, frames[0]), (2, frames[1]), (3, frames[2])):
        cells = placement.inverse(mesh, number, 32)
        assert cells.vertices.min() > MARGIN - 1 and cells.vertices.max() < 31 - (MARGIN - 1)
        assert np.allclose(placement.forward(cells, number, 32).vertices, mesh.vertices)


def test_frames_too_far_apart_for_their_cells_are_refused():
    here = (np.zeros(3), np.full(3, 1e-9))
    with pytest.raises(InputError, match="apart in cells"):
        place_grids([here, (np.full(3, 1e6), np.full(3, 1e6 + 1e-9))], 16)


@pytest.mark.parametrize("inside_out", [False, True])
def test_finer_grids_of_a_closed_body_are_nearer_to_it(inside_out):
    mesh = deforming_sphere(1)[0]
    turned = Mesh.of(mesh.vertices, mesh.faces[:, ::-1]) if inside_out else mesh
    quality = []
    for resolution in (16, 32, 64):
        volume, placement, sheets = volume_of(turned, resolution)
        found = placement.forward(extract(volume, sheets), 0, resolution)
        assert not sheets and enclosed(found) > 4
        quality.append(surface_errors(mesh, found).symmetric_psnr)
    assert quality[0] > 40 and quality[1] > quality[0] + 5 and quality[2] > quality[1] + 3


def test_blocks_that_are_decided_at_once_have_the_distances_of_their_points():
    volume, placement, _ = volume_of(deforming_sphere(1, levels=5)[0], 32)
    points = np.indices((32, 32, 32)).reshape(3, -1).T.astype(np.float64)
    world = placement.forward(Mesh(points, np.zeros((0, 3), np.int32)), 0, 32).vertices
    exact = np.clip((np.linalg.norm(world, axis=1) - 1) / placement.cell / 2, -1, 1)
    assert np.abs(volume[..., 0].reshape(-1) - exact).max() < 0.01


def test_an_open_sheet_is_trimmed_where_it_ends():
    sheet = Mesh.of([[0, 0, 0], [1, 0, 0], [0, 1, 0.2], [1, 1, 0.2]], [[0, 1, 2], [1, 3, 2]])
    volume, placement, sheets = volume_of(sheet, 32)
    assert sheets
    found = placement.forward(extract(volume, trimmed=True), 0, 32)
    over = 2 * placement.cell
    assert (found.vertices.min(axis=0) > -over).all() and (found.vertices.max(axis=0) < [1 + over] * 3).all()
    assert surface_errors(sheet, found).symmetric_psnr > 25
    assert len(found.faces) < len(extract(volume, trimmed=False).faces)


def test_a_room_that_is_seen_from_within_is_not_taken_for_a_body():
    side = plane(4.0, 4)
    turned = Mesh.of(side.vertices * [1, 1, 0] + [0, 0, 4], side.faces[:, ::-1])  # a ceiling: looks down
    around = [Mesh.of(mesh.vertices[:, axes], mesh.faces) for mesh in (side, turned) for axes in ([2, 0, 1], [1, 2, 0])]
    ball = moved(sphere(0.6, 3), (2.0, 2.0, 1.5))
    scene = concatenate([side, *around, ball])  # open above: from within the winding number is about -0.8
    volume, placement, sheets = volume_of(scene, 64)
    found = placement.forward(extract(volume, sheets), 0, 64)
    middles, (normals, areas) = found.vertices[found.faces].mean(axis=1), face_normals(found)
    hits = Surface(scene).closest(middles)
    agree = np.einsum("nd,nd->n", normals, face_normals(scene)[0][hits.faces])
    assert sheets and (areas * agree).sum() > 0.95 * areas.sum()
    assert np.linalg.norm(hits.points - middles, axis=1).max() < placement.cell


def test_a_loose_face_of_a_body_makes_nothing_inside_behind_it():
    ball = deforming_sphere(1)[0]
    corner = np.array([[1.1, 0, 0.1], [1.1, 0.1, 0], [1.1, 0, 0]])
    loose = Mesh.of(np.concatenate([ball.vertices, corner]), [*ball.faces, len(ball.vertices) + np.arange(3)])
    volume, placement, sheets = volume_of(loose, 32)
    found = placement.forward(extract(volume, sheets), 0, 32)
    assert not sheets
    assert np.abs(np.linalg.norm(found.vertices, axis=1) - 1).max() < placement.cell


def test_an_open_body_whose_faces_look_inwards_keeps_its_surface():
    ball = deforming_sphere(1)[0]
    turned = Mesh.of(ball.vertices, ball.faces[1:, ::-1])
    volume, placement, sheets = volume_of(turned, 32)
    found = placement.forward(extract(volume, sheets), 0, 32)
    assert sheets and enclosed(found) < -3.5
    assert np.abs(np.linalg.norm(found.vertices, axis=1) - 1).max() < placement.cell


def test_a_mesh_without_area_has_no_surface():
    line = Mesh.of([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    volume, _, _ = volume_of(line, 16)
    assert extract(volume, trimmed=False).is_empty


def test_numbers_are_rounded_to_levels_that_have_zero_and_both_ends_and_the_network_is_the_authors():
    values = np.array([-3.0, -1.0, -0.004, 0.0, 0.3, 1.0, 7.0])
    assert quantize(values, 8).tolist() == [-128, -128, -1, 0, 38, 128, 128]
    symbols = np.arange(-128, 129).astype(np.int32)
    assert (quantize(dequantize(symbols, 8), 8) == symbols).all()
    pairs = Shape(128, 16, 64, 8).layers
    assert pairs == ((16, 512), (64, 384), (48, 256), (32, 192), (24, 128), (16, 4))


def test_a_coded_set_comes_back_from_its_bytes():
    before = coded()
    after = decode_stream(encode_stream(before))
    assert (after.shape, after.trimmed) == (before.shape, before.trimmed)
    assert (after.full == before.full).all() and (after.features == before.features).all()
    assert (after.placement.shifts == before.placement.shifts).all()
    assert (after.placement.cell, after.placement.anchor) == (before.placement.cell, before.placement.anchor)
    assert all((a == b).all() for a, b in zip(after.parameters, before.parameters, strict=True))


def test_every_truncation_and_every_byte_that_is_wrong_is_refused():
    data = encode_stream(coded())
    for end in (*range(120), *range(120, len(data), 97), len(data) - 1):
        with pytest.raises(FormatError):
            decode_stream(data[:end])
    for at in (*range(120), *range(120, len(data), 97)):
        with pytest.raises(FormatError):
            decode_stream(data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :])
    with pytest.raises(FormatError):
        decode_stream(data + b"\0")
    with pytest.raises(FormatError, match="NeCGS"):
        decode_stream(data[:8] + b"\x02" + data[9:])
