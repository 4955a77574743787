"""Remeshed bodies: the same surface, other connectivity in every frame, and the same each time."""

from __future__ import annotations

import numpy as np
import pytest
from meshreel_bench.datasets import Store
from meshreel_bench.datasets.remesh import RemeshedSequence, RemeshOptions, remesh

from meshreel.errors import InputError
from meshreel.geometry.topology import components, unique_edges
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


def test_a_seed_gives_the_same_mesh_again_and_another_seed_another():
    assert equal(remesh(BALL, 3, SMALL), remesh(BALL, 3, SMALL))
    a, b = remesh(BALL, 3, SMALL), remesh(BALL, 4, SMALL)
    assert len(a.faces) != len(b.faces) or not np.array_equal(a.faces, b.faces)


def test_no_frame_is_like_another_though_the_body_stands_still():
    frames = RemeshedSequence(MeshList((BALL, BALL)), None, SMALL)
    assert not equal(frames[0], frames[1]) and frames.frame_rate == 30 and len(list(frames)) == 2


def test_the_cache_is_a_cache(tmp_path, monkeypatch):
    source = MeshList((BALL, Mesh.empty()))
    plain, kept = RemeshedSequence(source, None, SMALL), RemeshedSequence(source, tmp_path / "new", SMALL)
    made = [kept[0], kept[1]]
    assert len(list((tmp_path / "new").iterdir())) == 2
    monkeypatch.setattr("meshreel_bench.datasets.remesh.remesh", lambda *_: pytest.fail("made again"))
    assert all(equal(kept[i], made[i]) for i in range(2))
    monkeypatch.undo()
    assert all(equal(plain[i], made[i]) for i in range(2))


def test_a_frame_that_is_not_there_is_an_index_error():
    frames = RemeshedSequence(MeshList((BALL,)), None, SMALL)
    assert equal(frames[-1], frames[0])
    with pytest.raises(IndexError):
        frames[1]


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
