"""The demo's room: people are closed and move, the room stands still, and cameras see both."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.capture.simulated.demo_room import FURNITURE, SIZE, RoomOptions, furnished_room, room_cameras
from meshreel.errors import InputError
from meshreel.geometry.drawing import draw
from meshreel.geometry.topology import components, face_normals, unique_edges
from meshreel.types import Mesh

COARSE = RoomOptions(frames=20, spacing=0.06)


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.einsum("fd,fd->", np.cross(a, b), c) / 6)


def borders(mesh: Mesh) -> int:
    """Edges that only one face has."""
    edges, face_edges = unique_edges(mesh.faces)
    return int((np.bincount(face_edges.reshape(-1), minlength=len(edges)) % 2).sum())


def part(mesh: Mesh, faces: np.ndarray) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces[faces])


@pytest.mark.parametrize("number", [0, 7, 19])
def test_two_people_move_and_both_are_closed(number: int) -> None:
    frame = furnished_room(COARSE)[number]
    people = part(frame.mesh, frame.dynamic)
    label = components(people.faces, len(people.vertices))[people.faces[:, 0]]
    bodies = [part(people, label == one) for one in np.flatnonzero(np.bincount(label))]
    assert len(bodies) == 2
    assert [borders(body) for body in bodies] == [0, 0]
    assert all(volume(body) > 0.015 for body in bodies)  # m^3; they look outwards


def test_still_surface_is_the_same_in_every_frame_and_open() -> None:
    room = furnished_room(COARSE)
    first, last = room[0], room[-1]
    still = part(first.mesh, ~first.dynamic)
    count = len(room.still.vertices)
    assert np.array_equal(still.faces, last.mesh.faces[~last.dynamic])
    assert np.array_equal(first.mesh.vertices[:count], last.mesh.vertices[:count])
    assert np.array_equal(still.faces, room.still.faces)
    assert borders(still) > 0
    assert face_normals(still)[1].min() > 0


def test_the_furniture_is_closed_and_stands_in_the_room() -> None:
    still = furnished_room(COARSE).still
    label = components(still.faces, len(still.vertices))[still.faces[:, 0]]
    pieces = [part(still, label == one) for one in np.flatnonzero(np.bincount(label))]
    closed = [piece for piece in pieces if borders(piece) == 0]
    assert len(closed) == len(FURNITURE) and len(pieces) == len(FURNITURE) + 1
    expected = [np.prod(np.subtract(high, low)) for low, high in FURNITURE]
    assert sorted(map(volume, closed)) == pytest.approx(sorted(expected))
    for low, high in FURNITURE:
        assert abs(low[0]) < SIZE[0] / 2 and abs(high[0]) < SIZE[0] / 2 and low[1] >= 0 and abs(low[2]) < SIZE[2] / 2


def test_the_people_keep_away_from_each_other_and_from_the_furniture() -> None:
    room = furnished_room(RoomOptions(frames=48, frame_rate=7.0))  # once around
    boxes = np.array(FURNITURE)
    for number in range(0, 48, 4):
        walker, child = room.people(number)
        gaps = np.linalg.norm(walker.vertices[:, None, ::2] - child.vertices[None, :, ::2], axis=2)
        assert gaps.min() > 0.05  # m, seen from above
        for person in (walker, child):
            outside = np.maximum(boxes[:, 0] - person.vertices[:, None], person.vertices[:, None] - boxes[:, 1])
            assert np.linalg.norm(np.maximum(outside, 0), axis=2).min() > 0.02  # m
            assert (np.abs(person.vertices[:, [0, 2]]) < (SIZE[0] / 2, SIZE[2] / 2)).all()
            assert person.vertices[:, 1].min() > -0.005


def test_every_camera_sees_both_people_and_the_room() -> None:
    room = furnished_room(COARSE)
    walker = len(room.people(0)[0].faces)
    frame = room[0]
    for camera in room_cameras(128):
        assert (camera.view.width, camera.view.height) == (128, 115)
        faces = draw(frame.mesh, camera.view).faces
        seen = faces[faces >= 0]
        dynamic = seen[frame.dynamic[seen]] - len(room.still.faces)
        assert min((dynamic < walker).sum(), (dynamic >= walker).sum()) > 30  # pixels
        assert (~frame.dynamic[seen]).mean() > 0.4


def test_larger_pixels_keep_the_field_of_view() -> None:
    small, large = room_cameras(64)[1].view, room_cameras(640)[1].view
    assert small.center[0] == pytest.approx(large.center[0] / 10)
    assert small.width / small.focal[0] == pytest.approx(large.width / large.focal[0])
    assert small.height / small.focal[1] == pytest.approx(large.height / large.focal[1])


def test_a_frame_is_the_same_whenever_it_is_made_and_another_seed_has_other_faces() -> None:
    one, two = furnished_room(COARSE), furnished_room(COARSE)
    assert np.array_equal(one[4].mesh.vertices, two[-16].mesh.vertices)
    assert np.array_equal(one[4].mesh.faces, two[4].mesh.faces)
    other = furnished_room(replace(COARSE, seed=1))
    assert len(other[4].mesh.faces) != len(one[4].mesh.faces)
    with pytest.raises(IndexError):
        one[20]


@pytest.mark.parametrize("options", [{"frames": 0}, {"spacing": 1.0}, {"frame_rate": 0.0}, {"frame_rate": np.nan}])
def test_impossible_options_are_refused(options: dict) -> None:
    name = next(iter(options)).replace("_", " ")
    with pytest.raises(InputError, match=rf"{name} .* (ask|suits|give)"):
        RoomOptions(**options)
