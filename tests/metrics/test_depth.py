"""Decoded frames beside depth pictures of a wall with a box before it: what is covered, invented, lost and flickers."""

import numpy as np
import pytest

from meshreel.geometry.cameras import Camera
from meshreel.geometry.depth import DepthPicture
from meshreel.metrics.depth import DepthJudge, clear_pixels, judge
from meshreel.types import Mesh

SIZE, FOCAL, WALL, BOX = 80, 80.0, 2.0, 1.5  # pixels, pixels, m, m
CAMERA = Camera.of(SIZE, SIZE, np.array([[FOCAL, 0, SIZE / 2], [0, FOCAL, SIZE / 2], [0, 0, 1]]), np.eye(4))
UP = (0.0, -1.0, 0.0)
PIXEL = (WALL / FOCAL) ** 2  # m^2, of one on the wall
BODY = (slice(20, 80), slice(30, 50))  # rows and columns of the box, which stands on the picture's lower end


def picture(depth):
    return DepthPicture(CAMERA, np.rint(1000 * np.broadcast_to(depth, (SIZE, SIZE))).astype(np.uint16), 0.001, 10.0)


def scene(body=None):
    """Depths of the wall, m, and of a box before it."""
    depth = np.full((SIZE, SIZE), WALL)
    if body is not None:
        depth[body] = BOX
    return depth


def surface(depth):
    """A mesh that shows these depths: a square for each pixel, none where the depth is 0."""
    rows, columns = np.nonzero(depth)
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1)])
    flat = np.stack([columns, rows], axis=1)[:, None] + corners - SIZE / 2
    ahead = depth[rows, columns]
    points = np.concatenate([flat * ahead[:, None, None] / FOCAL, np.repeat(ahead, 4).reshape(-1, 4, 1)], axis=2)
    first = 4 * np.arange(len(rows))[:, None]
    return Mesh.of(points.reshape(-1, 3), np.concatenate([first + (0, 2, 1), first + (0, 3, 2)]))


# One frame of three shows the box.
MEASURED = [scene(), scene(BODY), scene()]


def judged(decoded, measured=MEASURED, **options):
    frames = [[picture(depth)] for depth in measured]
    return judge(DepthJudge(frames, len(frames), UP), [surface(d) for d in decoded], range(len(frames)), **options)


def test_frames_that_show_what_was_measured_cover_all_and_invent_nothing():
    found = judged(MEASURED)
    for part in ("all", "still", "body"):
        assert (found[f"{part}_covered"], found[f"{part}_invented"], found[f"{part}_lost_runs"]) == (1, 0, 0)
    assert (found["limbs_shown"], found["limbs_lost"], found["still_flicker_m"]) == (1, 0, 0)
    assert found["frames_judged"] == 3 and [row["frame"] for row in found["per_frame"]] == [0, 1, 2]
    assert found["per_frame"][0]["body_covered"] is None


def test_a_hole_of_known_size_is_not_covered_and_is_a_lost_run():
    holed = scene()
    holed[10:30, 40:50] = 0
    found = judged([holed, MEASURED[1], MEASURED[2]])
    clear = [clear_pixels(picture(depth)).sum() for depth in MEASURED]
    assert found["all_covered"] == pytest.approx(1 - 200 / sum(clear))
    assert found["still_lost_runs"] == 1 / 3 and found["body_covered"] == 1
    assert found["still_largest_lost_m2"] == pytest.approx(200 * PIXEL, rel=0.01)
    holed[:] = scene()
    holed[10:13, 40:43] = 0  # 56 cm^2
    assert judged([holed, MEASURED[1], MEASURED[2]])["still_lost_runs"] == 0


def test_a_slit_beside_a_step_is_a_crack_though_no_clear_pixel_tells_of_it():
    slit = MEASURED[1].copy()
    slit[20:80, 29] = 0  # beside the box, where partly nothing is measured
    holed = scene(BODY)
    holed[20:30, 29] = 0
    found = judged([MEASURED[0], slit, MEASURED[2]], [MEASURED[0], holed, MEASURED[2]])
    assert found["all_covered"] == 1
    assert found["cracks"] == pytest.approx((60 - 10 - 2) / (3 * SIZE**2 - 10))  # open at the picture's edge


def test_a_ghost_is_invented_and_hides_what_it_stands_before():
    found = judged([scene(BODY), *MEASURED[1:]])
    ghost = found["per_frame"][0]
    assert ghost["still_invented"] == pytest.approx(60 * 20 / SIZE**2, rel=0.01)
    assert ghost["still_covered"] == pytest.approx(1 - ghost["still_invented"])
    assert found["per_frame"][1]["still_invented"] == 0


def test_a_body_without_its_lower_third_has_lost_a_limb_and_one_without_its_head_has_not():
    legless, headless = scene((slice(20, 60), BODY[1])), scene((slice(40, 80), BODY[1]))
    found = judged([MEASURED[0], legless, MEASURED[2]])
    assert (found["limbs_shown"], found["limbs_lost"]) == (1, 1) and found["body_covered"] < 0.7
    assert found["body_covered_worst"] == found["body_covered"] and found["body_least_covered_frame"] == 1
    found = judged([MEASURED[0], headless, MEASURED[2]])
    assert (found["limbs_shown"], found["limbs_lost"]) == (1, 0)


def test_a_wall_that_jumps_flickers_by_its_step_but_where_the_background_is_refreshed():
    near = [np.full((SIZE, SIZE), WALL + jump) for jump in (0, 0.01, 0)]
    walls = [scene()] * 3
    assert judged(near, walls)["still_flicker_m"] == pytest.approx(0.01, rel=1e-3)
    assert judged(near, walls, refreshes={1})["still_flicker_m"] == pytest.approx(0.01, rel=1e-3)
    assert judged(near, walls, refreshes={1, 2})["still_flicker_m"] is None


def test_pixels_beside_a_step_or_a_hole_do_not_count():
    depth = scene()
    depth[:, 40:] = 3.0
    depth[10, 10] = 0
    clear = clear_pixels(picture(depth))
    assert (
        not clear[9:12, 9:12].any() and not clear[8, 10] and not clear[:, 38:42].any() and clear[5, 5] and clear[40, 37]
    )


def test_what_comes_and_goes_where_nothing_is_behind_is_a_body():
    """A box comes nearer from frame to frame, before what is too far to be measured."""
    distances = (0, 0, 3.0, 2.6, 2.2, 1.8, 1.4, 0)
    walls = [np.where(scene(BODY) == BOX, ahead, WALL * (ahead > 0)) for ahead in distances]
    found = judged(walls, walls)
    assert [row["body_covered"] for row in found["per_frame"]] == [None, None, 1, 1, 1, 1, 1, None]


def test_nothing_measured_or_nothing_decoded_is_no_error():
    frames = [[None, picture(depth), picture(0.0)] for depth in MEASURED]
    found = judge(DepthJudge(frames, 3, UP), [Mesh.empty()] * 3, range(3))
    assert (found["all_covered"], found["limbs_lost"], found["body_flicker_deg"]) == (0, 1, None)
    assert found["still_largest_lost_m2"] > 3 and found["still_flicker_m"] is None
    blind = [[None, picture(0.0)]] * 3
    found = judge(DepthJudge(blind, 3, UP), [surface(scene())] * 3, range(3))
    assert found["all_covered"] is None and found["limbs_shown"] == 0
    assert judge(DepthJudge(blind, 3, UP), [], ()) == {"frames_judged": 0, "per_frame": []}
