"""Surface through points: where it is, to which side it faces, how fine it is, and what it refuses."""

import numpy as np
import pytest
from jaxtyping import Float64

from meshreel.errors import InputError
from meshreel.geometry import points as module
from meshreel.geometry.points import Cloud, bare_share, normals_of, surface_of, surface_through, voxel_for
from meshreel.geometry.topology import border_edges, components, face_normals
from meshreel.types import Mesh

Points = Float64[np.ndarray, "N 3"]


def ball(count: int, noise: float = 0.0, seed: int = 0) -> Points:
    """Points on the unit sphere, about as far from each other everywhere."""
    number, turn = np.arange(count) + 0.5, np.pi * (1 + 5**0.5)
    z = 1 - 2 * number / count
    around = np.stack([np.cos(turn * number), np.sin(turn * number)], axis=1) * np.sqrt(1 - z * z)[:, None]
    return np.column_stack([around, z]) + noise * np.random.default_rng(seed).standard_normal((count, 3))


def sheet(width: float, height: float, step: float) -> Points:
    """Points on a rectangle in the plane z = 0, on a grid that is turned a little."""
    x, y = np.meshgrid(np.arange(0, width, step), np.arange(0, height, step))
    return np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])


def outwards(mesh: Mesh) -> float:
    """Share of faces that face away from the middle."""
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    return float(((face_normals(mesh)[0] * (middles - mesh.middle)).sum(axis=1) > 0).mean())


@pytest.mark.parametrize(("noise", "off"), [(0.0, 0.003), (0.01, 0.006), (0.04, 0.025)])
def test_a_ball_is_closed_faces_outside_and_is_as_near_as_its_noise_allows(noise: float, off: float) -> None:
    cloud = Cloud(ball(20_000, noise))
    mesh = surface_of(cloud, voxel_for(cloud))
    label = components(mesh.faces, len(mesh.vertices))
    largest = label == np.bincount(label).argmax()
    errors = np.linalg.norm(mesh.vertices[largest], axis=1) - 1
    assert np.sqrt((errors**2).mean()) < off and abs(errors.mean()) < 0.9 * off
    assert outwards(mesh) > 0.995
    assert len(border_edges(mesh)) == 0 or noise > 0


def test_voxels_grow_with_the_distance_of_points_and_with_their_noise() -> None:
    dense, sparse, noisy = (voxel_for(Cloud(points)) for points in (ball(20_000), ball(5000), ball(20_000, 0.03)))
    assert sparse == pytest.approx(2 * dense, rel=0.05)
    assert noisy > 1.4 * dense
    assert voxel_for(Cloud(100 * ball(5000))) == pytest.approx(100 * sparse)  # whatever the unit
    assert voxel_for(Cloud(ball(module.AROUND))) == 0
    assert voxel_for(Cloud(np.zeros((50, 3)))) == 0  # all in one place


def test_a_sheet_ends_where_its_points_do_and_faces_its_eye() -> None:
    points, voxel = sheet(0.9, 0.6, 0.01), 0.015
    for side in (1.0, -1.0):
        mesh = surface_of(Cloud(points, eye=np.array([0.4, 0.3, 2.0 * side])), voxel)
        assert np.abs(mesh.vertices[:, 2]).max() < 1e-6
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        assert (np.abs(low[:2]) < 1.5 * voxel).all() and (np.abs(high[:2] - [0.9, 0.6]) < 1.5 * voxel).all()
        assert (np.sign(face_normals(mesh)[0][:, 2]) == side).all()
        assert face_normals(mesh)[1].sum() == pytest.approx(0.9 * 0.6, rel=0.06)


def test_a_room_faces_into_itself_and_a_crate_out_of_itself() -> None:
    step = 0.04
    floor, wall = sheet(3.0, 3.0, step), sheet(3.0, 2.4, step)
    walls = [wall[:, [0, 1, 2]], wall[:, [0, 1, 2]] + [0, 0, 3.0], wall[:, [2, 1, 0]]]
    room = np.concatenate([floor[:, [0, 2, 1]], *walls])
    assert outwards(surface_of(Cloud(room), 1.5 * step)) < 0.02
    crate = 0.2 * np.concatenate([room, floor[:, [0, 2, 1]] + [0, 2.4, 0]])
    assert outwards(surface_of(Cloud(crate), 0.3 * step)) > 0.98


def test_two_sheets_face_away_from_each_other() -> None:
    """Neighbours agree along a surface, not through it: the back of a thin body faces back."""
    around = np.array([[np.cos(a), np.sin(a)] for a in np.linspace(0, 2 * np.pi, 800, endpoint=False)])
    rim = around * [0.5, 0.05]  # a flat cylinder: 10 cm thick, 1 m wide
    body = np.concatenate([np.column_stack([rim, np.full(len(rim), z)]) for z in np.arange(0, 1.0, 0.01)])
    mesh = surface_of(Cloud(body), 0.015)
    normals, middles = face_normals(mesh)[0], mesh.vertices[mesh.faces].mean(axis=1)
    assert (np.sign(normals[:, 1]) == np.sign(middles[:, 1]))[np.abs(middles[:, 0]) < 0.4].mean() > 0.99


def test_normals_of_points_are_taken_as_they_are() -> None:
    points = ball(5000)
    inside = surface_of(Cloud(points, -3 * points), voxel_for(Cloud(points)))  # of any length
    assert outwards(inside) == 0
    unknown = np.where(points[:, :1] > 0, points, 0)  # half of them have none
    half = surface_of(Cloud(points, unknown), voxel_for(Cloud(points)))
    assert half.vertices[:, 0].min() > -0.1 and len(border_edges(half))


def test_surface_has_the_colours_of_its_points() -> None:
    points = ball(5000)
    colors = np.where(points[:, :1] > 0, [[200, 30, 0]], [[0, 90, 255]]).astype(np.uint8)
    mesh = surface_of(Cloud(points, colors=colors), voxel_for(Cloud(points)))
    assert mesh.colors is not None
    assert (mesh.colors[mesh.vertices[:, 0] > 0.2] == [200, 30, 0]).all()
    assert (mesh.colors[mesh.vertices[:, 0] < -0.2] == [0, 90, 255]).all()


def test_far_from_the_origin_it_is_the_same_surface() -> None:
    """As in a map, whose places are 500 km from its origin; cells lie elsewhere there."""
    points = ball(5000)
    voxel = voxel_for(Cloud(points))
    here, there = surface_of(Cloud(points), voxel), surface_of(Cloud(points + [5e5, 5e6, 100.0]), voxel)
    assert abs(len(there.faces) / len(here.faces) - 1) < 0.05
    errors = np.linalg.norm(there.vertices - [5e5, 5e6, 100.0], axis=1) - 1
    assert np.abs(errors).max() < 0.02 and outwards(there) == 1


@pytest.mark.parametrize("place", [0, -1])
def test_a_point_that_flies_is_left_out_wherever_it_stands(place: int) -> None:
    points = ball(5000)
    voxel = voxel_for(Cloud(points))
    with_one = np.insert(points, len(points) if place else 0, [1e6, 0, 0], axis=0)
    assert voxel_for(Cloud(with_one)) == pytest.approx(voxel, rel=0.01)
    mesh = surface_of(Cloud(with_one), voxel)
    assert np.abs(np.linalg.norm(mesh.vertices, axis=1) - 1).max() < 0.03 and len(border_edges(mesh)) == 0
    assert bare_share(Cloud(with_one), mesh, voxel) == pytest.approx(1 / 5001)


def test_points_that_are_there_twice_are_one() -> None:
    points = ball(5000)
    assert voxel_for(Cloud(np.repeat(points, 2, axis=0))) == pytest.approx(voxel_for(Cloud(points)), rel=1e-3)
    shaken = points + 1e-5 * np.random.default_rng(0).standard_normal(points.shape)
    assert voxel_for(Cloud(np.concatenate([points, shaken]))) == pytest.approx(voxel_for(Cloud(points)), rel=0.02)


def test_the_same_points_in_another_order_give_the_same_surface() -> None:
    points = ball(3000, 0.005)
    voxel = voxel_for(Cloud(points))
    one, other = (surface_of(Cloud(some), voxel) for some in (points, points[::-1]))
    assert len(one.faces) == len(other.faces)
    assert np.abs(np.sort(one.vertices, axis=0) - np.sort(other.vertices, axis=0)).max() < 1e-3 * voxel


def test_few_points_have_no_surface_and_too_many_voxels_are_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    assert surface_of(Cloud(ball(10)), 0.1).is_empty and surface_of(Cloud(np.zeros((0, 3))), 0.1).is_empty
    assert (normals_of(ball(10), 0.1) == 0).all()
    assert surface_through(ball(100), np.zeros((100, 3)), 0.1).is_empty
    monkeypatch.setattr(module, "MOST_BLOCKS", 1000)
    with pytest.raises(InputError, match=r"surface in \d+ blocks of 0.08 m, over 1000; is the unit right"):
        surface_of(Cloud(ball(50_000)), 0.01)
