"""Pinhole cameras: rays and images undo each other, the eye is where rays start, and records come back."""

import json
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel.errors import InputError
from meshreel.geometry.cameras import Camera, CameraPose, Rays, pack_cameras, unpack_cameras
from meshreel.types import Mesh
from tests.metrics.shapes import sphere

angle, length = st.floats(-3, 3), st.floats(-1e3, 1e3)


@st.composite
def cameras(draw: st.DrawFn) -> Camera:
    a, b = draw(angle), draw(angle)
    about_x = np.array([[1, 0, 0], [0, np.cos(a), -np.sin(a)], [0, np.sin(a), np.cos(a)]])
    about_y = np.array([[np.cos(b), 0, np.sin(b)], [0, 1, 0], [-np.sin(b), 0, np.cos(b)]])
    extrinsic = np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = about_x @ about_y, [draw(length), draw(length), draw(length)]
    intrinsic = np.array([[draw(st.floats(50, 500)), 0, 31], [0, draw(st.floats(50, 500)), 25], [0, 0, 1.0]])
    return Camera.of(64, 48, intrinsic, extrinsic)


def test_points_behind_a_camera_have_no_place_in_its_picture():
    camera = Camera(64, 48, (50.0, 50.0), (32.0, 24.0))
    behind = np.array([[0, 0, -1.0], [0, 0, 0]])
    assert np.isnan(camera.project(behind)).all() and np.isnan(replace(camera, distortion=(0.1,)).project(behind)).all()


@given(cameras())
def test_what_pixels_see_ahead_projects_to_their_middles_also_in_other_sizes(camera):
    for one in (camera, camera.resized(10, 30)):
        rows, columns = np.mgrid[: one.height, : one.width]
        middles = np.stack([columns, rows], axis=2).reshape(-1, 2) + 0.5
        assert np.allclose(one.project(one.ahead.reshape(-1, 3)), middles)


@given(cameras())
def test_a_pose_keeps_the_bits_of_the_matrix_that_was_given(camera):
    matrix = camera.extrinsic
    given, other = CameraPose.of_camera(matrix), CameraPose.of_world(matrix)
    assert np.array_equal(given.to_world, matrix) and np.array_equal(other.from_world, matrix)
    assert np.allclose(given.from_world @ matrix, np.eye(4), atol=1e-9)


@given(cameras())
def test_the_eye_is_the_origin_of_the_cameras_frame(camera):
    assert np.allclose(camera.extrinsic @ [*camera.eye, 1], [0, 0, 0, 1], atol=1e-9)


@given(st.lists(cameras(), min_size=1, max_size=3))
def test_packed_cameras_come_back(given_cameras):
    again = unpack_cameras(pack_cameras(given_cameras), "these")
    for ours, other in zip(given_cameras, again, strict=True):
        assert np.array_equal(ours.intrinsic, other.intrinsic) and np.array_equal(ours.extrinsic, other.extrinsic)
        assert (ours.width, ours.height) == (other.width, other.height)


@pytest.mark.parametrize(
    "data",
    [b"", b"\xff", b"\0", b"{", b"{}", b"[]", b"[1]", b'{"parameters": 3}', b'{"parameters": [1]}', b"[" * 100_000],
)
def test_other_bytes_are_input_errors_that_name_their_source(data):
    with pytest.raises(InputError, match="these"):
        unpack_cameras(data, "these")


def put(place: str, number: int, value: float):
    """Changes a number of the second camera."""

    def change(record: dict) -> None:
        matrix = record["extrinsic"] if place == "extrinsic" else record["intrinsic"]["intrinsic_matrix"]
        matrix[number] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (put("extrinsic", 0, 7.0), "no rotation"),
        (put("extrinsic", 0, -1.0), "no rotation"),  # a mirror
        (put("extrinsic", 3, 0.5), r"last row is \[0\.5, 0\.0, 0\.0, 1\.0\] and not 0 0 0 1"),
        (put("extrinsic", 12, 1e12), r"over 1e\+09"),
        (put("extrinsic", 12, float("nan")), "not finite"),
        (put("intrinsic", 8, 2.0), r"last row is \[0\.0, 0\.0, 2\.0\] and not 0 0 1"),
        (lambda record: record["intrinsic"].update(width=0), "size 0 x 48"),
        (lambda record: record["intrinsic"].update(height=10**6), "size 64 x 1000000"),
        (put("intrinsic", 3, 0.5), "the skew 0.5, not 0"),
        (put("intrinsic", 0, -1.0), "focal lengths -1 and 1, not above 0"),
        (put("intrinsic", 4, 0.0), "focal lengths 1 and 0"),
        (put("intrinsic", 0, 1e300), r"over 1e\+09"),
    ],
)
def test_an_impossible_camera_is_refused_with_its_number(change, words):
    record = json.loads(pack_cameras([Camera.of(64, 48, np.eye(3), np.eye(4))] * 2))
    change(record["parameters"][1])
    with pytest.raises(InputError, match=f"these: .*camera number 1: .*{words}.*mend it"):
        unpack_cameras(json.dumps(record).encode(), "these")


def test_a_hit_is_the_point_of_its_face_at_its_distance():
    random = np.random.default_rng(0)
    origins = random.normal(0, 5, (500, 3))
    directions = random.normal(0, 1, (500, 3)) - origins
    body = sphere(levels=4)
    hit = Rays(body).cast(origins, directions)
    met = hit.faces >= 0
    assert 20 < met.sum() < 480 and np.isinf(hit.distances[~met]).all()
    along = origins[met] + hit.distances[met, None] * directions[met]
    corners = body.vertices[body.faces[hit.faces[met]]]
    assert np.allclose(np.einsum("nk,nkd->nd", hit.barycentric[met], corners), along, atol=1e-5)
    assert np.allclose(np.linalg.norm(along, axis=1), 1, atol=0.01)


def test_no_ray_slips_between_faces():
    random = np.random.default_rng(0)
    body = sphere(levels=4)
    edges = body.vertices[body.faces[:, [0, 1]]]
    share = random.random((len(edges), 1))
    targets = np.concatenate([body.vertices, share * edges[:, 0] + (1 - share) * edges[:, 1]])
    origins = random.normal(0, 0.2, targets.shape)
    assert (Rays(body).cast(origins, targets - origins).faces >= 0).all()


@pytest.mark.parametrize("mesh", [Mesh.empty(), Mesh.of([[0, 0, 0], [1, 1, 1]], [])])
def test_no_ray_meets_an_empty_mesh(mesh):
    hit = Rays(mesh).cast(np.zeros((2, 3)), np.ones((2, 3)))
    assert (hit.faces == -1).all() and np.isinf(hit.distances).all()
