"""Remeshed bodies, whose connectivity is new in every frame; closed shapes that move rigidly; gears whose teeth fit."""

import numpy as np
import pytest
from meshreel_bench.datasets import SHAPES, Store
from meshreel_bench.datasets.remesh import MODULE, TEETH, RemeshOptions, gears, prism, remesh, remeshed

from meshreel.analysis.survey import bodies_of, pieces_of
from meshreel.errors import InputError
from meshreel.geometry.closest_points import distances
from meshreel.geometry.inside import winding_inside
from meshreel.geometry.topology import border_edges, components, face_normals, unique_edges
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList
from tests.spheres import sliding_sphere

BALL = sliding_sphere(1, levels=4)[0]
SMALL = RemeshOptions(vertices=1500)


def equal(a, b):
    return np.array_equal(a.vertices, b.vertices) and np.array_equal(a.faces, b.faces)


def test_the_surface_stays_and_the_vertices_do_not():
    other = remesh(BALL, 3, SMALL)
    errors = surface_errors(BALL, other)
    assert errors.symmetric_psnr > 60 and errors.angle < 5  # faces keep their orientation
    assert abs(len(other.vertices) - 1500) <= 30
    edges, face_edges = unique_edges(other.faces)
    assert np.bincount(face_edges.reshape(-1), minlength=len(edges)).tolist() == [2] * len(edges)
    assert components(other.faces, len(other.vertices)).max() == 0


def test_a_seed_gives_the_same_mesh_again_and_every_frame_has_a_seed_of_its_own():
    assert equal(remesh(BALL, 3, SMALL), remesh(BALL, 3, SMALL))
    a, b = remesh(BALL, 3, SMALL), remesh(BALL, 4, SMALL)
    assert len(a.faces) != len(b.faces) or not np.array_equal(a.faces, b.faces)
    frames = remeshed(MeshList((BALL, BALL)), None, SMALL)
    assert not equal(frames[0], frames[1]) and frames.frame_rate == 30 and len(list(frames)) == 2
    with pytest.raises(IndexError):
        frames[2]


def test_the_cache_is_a_cache(tmp_path, monkeypatch):
    source = MeshList((BALL, Mesh.empty()))
    plain, kept = remeshed(source, None, SMALL), remeshed(source, tmp_path / "new", SMALL)
    made = [kept[0], kept[1]]
    assert len(list((tmp_path / "new").iterdir())) == 2
    monkeypatch.setattr("meshreel_bench.datasets.remesh.remesh", lambda *_: pytest.fail("made again"))
    assert all(equal(kept[i], made[i]) for i in range(2))
    monkeypatch.undo()
    assert all(equal(plain[i], made[i]) for i in range(2))


def test_the_data_set_is_made_of_the_body_and_has_sixty_frames_at_most(tmp_path):
    np.savez(tmp_path / "crane.npz", vertices=np.stack([BALL.vertices] * 70), faces=BALL.faces)
    assert len(Store(tmp_path).open("crane60").sequence) == 60 and len(Store(tmp_path).open("crane60", 3).sequence) == 3
    Store(tmp_path, tmp_path / "cache").open("crane60", 3).sequence[2]
    assert [path.parent.name for path in (tmp_path / "cache").rglob("*.ply")] == ["crane60"]
    with pytest.raises(InputError, match="samba"):
        Store(tmp_path).open("samba60")


def test_two_pass_each_other_and_share_no_connectivity(tmp_path):
    for body in ("crane", "samba"):
        np.savez(tmp_path / f"{body}.npz", vertices=np.stack([0.2 * BALL.vertices] * 150), faces=BALL.faces)
    long = Store(tmp_path, tmp_path / "cache").open("synthetic2x150").sequence
    shown = {number: long[number] for number in (0, 74, 149)}
    widths = [float(np.ptp(mesh.vertices[:, 0])) for mesh in shown.values()]
    assert len(long) == 150 and np.allclose(widths, [2.6, 0.9, 2.6], atol=0.02)
    assert components(shown[74].faces, len(shown[74].vertices)).max() == 1 and not equal(shown[0], shown[149])
    assert len(Store(tmp_path).open("synthetic2x150", 3).sequence) == 3


def pieces(mesh):
    """The pieces of a mesh, each alone."""
    label = components(mesh.faces, len(mesh.vertices))
    starts = np.cumsum(np.bincount(label)) - np.bincount(label)
    return [
        Mesh.of(mesh.vertices[label == k], mesh.faces[label[mesh.faces[:, 0]] == k] - s) for k, s in enumerate(starts)
    ]


def volume(mesh):
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces], 1, 0)
    return np.einsum("nd,nd->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize(("make", "count"), [(gears, 2), (prism, 1)])
def test_pieces_are_closed_and_move_rigidly_on_one_connectivity(make, count):
    first, *others = map(pieces, make(3))
    assert len(first) == count
    for piece in first:
        assert not len(border_edges(piece)) and volume(piece) > 0 and face_normals(piece)[1].min() > 0
    for before, after in ((a, b) for other in others for a, b in zip(first, other, strict=True)):
        assert np.array_equal(before.faces, after.faces) and not np.allclose(before.vertices, after.vertices)
        some = np.arange(0, len(before.vertices), 7)
        apart = [np.linalg.norm(m.vertices[some] - m.vertices[some[0]], axis=1) for m in (before, after)]
        assert np.allclose(*apart, atol=1e-12)


@pytest.mark.parametrize("frame", range(5))  # a pitch of teeth
def test_gears_touch_at_every_angle_and_never_cut_each_other(frame):
    one, other = pieces(gears(frame + 1)[frame])
    assert distances(one.vertices, other).min() < 0.01 * MODULE
    assert not winding_inside(other, one.vertices).any() and not winding_inside(one, other.vertices).any()
    assert sum(len(piece.vertices) for piece in (one, other)) == sum(TEETH) * 512


def test_each_gear_is_a_body_that_is_coded_apart():
    found = bodies_of([pieces_of(mesh) for mesh in gears(3)])
    assert found is not None and [body.tolist() for body in found] == [[0, 1]] * 3


def test_shapes_are_sequences_by_name_without_data(tmp_path):
    store = Store(tmp_path / "none")
    assert [len(store.open(name).sequence) for name in SHAPES] == [24, 24, 1800]
    assert len(store.open("prism", 3).sequence[0].vertices) == 10 and store.digest("gears") is None
