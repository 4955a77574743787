"""Tests of the guess of the first view: its side, its distance, and what stands in between."""

import math

import numpy as np
import pytest

import meshreel
from meshreel.analysis.front import Body
from meshreel.analysis.survey import Survey
from meshreel.encoder.file.first_view import FREE, Surroundings, guessed_view
from meshreel.geometry.cameras import Camera, CameraPose, looking_at
from meshreel.types import UPRIGHT, Mesh, MeshList
from tests.metrics.shapes import sphere
from tests.small_options import quick

SURVEY = Survey(np.zeros(3), np.zeros(3), (), scale=1.0)  # of coordinates that are normalised
FAR = 3.0


def body(front: float | None, x: float = 0.0, z: float = 0.0) -> Body:
    """A person 1.7 m high, who faces a direction (rad; 0: +z), or something that faces none."""
    votes = np.zeros((0, 2)) if front is None else 0.04 * np.array([[math.sin(front), math.cos(front)]])
    low, high = np.array([x - 0.3, 0.0, z - 0.3]), np.array([x + 0.3, 1.7, z + 0.3])
    return Body(low, high, np.array([x, z]), votes)


def camera(x: float, y: float, z: float, to: tuple[float, float, float] = (0.0, 0.9, 0.0)) -> Camera:
    pose = CameraPose.of_camera(looking_at(np.array([x, y, z]), np.array(to)))
    return Camera(640, 480, (400.0, 400.0), (320.0, 240.0), pose)


def guess(bodies: list[Body], cameras: tuple[Camera, ...] = (), room: Mesh | None = None, up: str = "y"):
    frames = {number: [one] for number, one in enumerate(bodies)}
    view = guessed_view(frames, 30.0, Surroundings(up, cameras, room or Mesh.empty()), SURVEY)
    assert view is not None
    return view, np.array(view.position) - view.target


def degrees(way: np.ndarray) -> float:
    return math.degrees(math.atan2(way[0], way[2]))


@pytest.mark.parametrize("front", [0.0, 1.0, 3.0, -2.0])
def test_a_body_is_seen_from_in_front_at_the_height_of_its_eyes(front):
    view, way = guess([body(front)])
    assert degrees(way) == pytest.approx(math.degrees(front), abs=0.1)
    assert 1.4 < view.position[1] < 1.8 and view.target == pytest.approx((0, 0.85, 0), abs=1e-3)


def test_what_has_no_front_is_seen_from_aside():
    _, way = guess([body(None)])
    assert 30 < degrees(way) < 45


def test_all_bodies_fit_a_square_picture_in_all_frames():
    bodies = [body(0.5, x, z) for x, z in ((-2.0, 0.0), (0.0, 1.0), (3.0, -1.0))]
    view, way = guess(bodies)
    pose = CameraPose.of_camera(looking_at(np.array(view.position), np.array(view.target)))
    focal = 50 / math.tan(math.radians(view.fov / 2))
    picture = Camera(100, 100, (focal, focal), (50.0, 50.0), pose)
    corners = np.array([[x, y, z] for one in bodies for x, y, z in (one.low, one.high)])
    assert len(picture.seen(corners)[1]) == len(corners)
    assert 2 * np.linalg.norm(way) < 3 * 6.6 / math.tan(math.radians(22.5))  # and not from much farther away


def test_cameras_on_one_side_go_before_the_front():
    """A person who turns their back to both is seen from behind: nothing else of them is known."""
    _, way = guess([body(math.pi)], (camera(-1.0, 1.5, FAR), camera(1.0, 1.5, FAR)))
    assert degrees(way) == pytest.approx(0, abs=0.1) and way[1] / np.linalg.norm(way) == pytest.approx(0.21, abs=0.02)


def test_cameras_that_do_not_see_the_bodies_do_not_count():
    _, way = guess([body(math.pi)], (camera(0.0, 1.5, FAR), camera(FAR, 1.5, 0.0, to=(6.0, 0.9, 0.0))))
    assert degrees(way) == pytest.approx(0, abs=0.1)


def test_among_cameras_around_the_bodies_their_front_decides():
    corners = tuple(camera(x, 2.2, z) for x in (-FAR, FAR) for z in (-FAR, FAR))
    _, way = guess([body(2.0)], corners)
    assert degrees(way) == pytest.approx(math.degrees(2.0), abs=0.1)


def test_a_camera_in_the_ceiling_is_followed_as_far_as_a_player_goes():
    """None looks straight down, where nothing tells what is up in the picture."""
    _, way = guess([body(2.0)], (camera(0.0, 4.0, 0.01, to=(0.0, 0.0, 0.0)),))
    assert math.asin(way[1] / np.linalg.norm(way)) == pytest.approx(math.radians(60), abs=0.02)


def test_no_wall_is_between():
    """From before it the picture is wider; what hides a body from there is gone around."""
    far, way = guess([body(0.0)])

    def wall(z: float) -> Mesh:
        return Mesh.of([[-9, -9, z], [9, -9, z], [9, 9, z], [-9, 9, z]], [[0, 1, 2], [0, 2, 3]])

    near, before = guess([body(0.0)], room=wall(0.8 * way[2]))
    assert before[2] == pytest.approx(FREE * 0.8 * way[2], rel=0.02) and near.fov > far.fov == 45
    pillar = Mesh.of([[-0.2, 0, 1], [0.2, 0, 1], [0.2, 9, 1], [-0.2, 9, 1]], [[0, 1, 2], [0, 2, 3]])
    assert abs(degrees(guess([body(0.0)], room=pillar)[1])) == pytest.approx(15, abs=0.1)


def test_no_wall_fills_a_part_of_the_picture():
    """The end of a side wall, before the picture and beside the body, is turned away from."""
    x, z = 0.15, 1.1  # nearer than half of the distance: no picture is taken from before it
    side = Mesh.of([[x, -9, z], [9, -9, z], [9, 9, z], [x, 9, z]], [[0, 1, 2], [0, 2, 3]])
    angle = degrees(guess([body(0.0)], room=side)[1])
    assert angle < degrees(guess([body(0.0)])[1]) - 10


@pytest.mark.parametrize("up", ["z", "-y", "-z"])
def test_another_axis_may_point_up(up):
    """A body is stood up already; the view is in the coordinates of the file."""
    _, upright = guess([body(1.0)])
    _, way = guess([body(1.0)], up=up)
    np.testing.assert_allclose(np.array(UPRIGHT[up]) @ way, upright, atol=2e-4)


def test_nothing_has_no_view():
    assert guessed_view({0: [], 1: []}, 30.0, Surroundings("y"), SURVEY) is None


def test_an_encode_has_a_view_of_its_body(tmp_path):
    """In metres it is where the body is, though the file's own coordinates are others."""
    ball = sphere(2)
    frames = tuple(ball.at(ball.vertices + [100.0 + 0.2 * number, 5.0, 0.0]) for number in range(3))
    meshreel.encode(MeshList(frames), tmp_path / "a.reel", options=quick())
    video = meshreel.open(tmp_path / "a.reel")
    assert video.view is not None and set(video.metadata["view"]) == {"position", "target", "fov"}
    np.testing.assert_allclose(video.view.target, np.mean(video.box, axis=0), atol=0.02 * frames[0].diagonal)
