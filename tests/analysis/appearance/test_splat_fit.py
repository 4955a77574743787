"""Splats fitted to pictures: gradients are right, pictures of other cameras and frames come out, bad input is told."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.appearance.splat_fit import SplatFrame, SplatView, fit_splats, rendered, ring, taken
from meshreel.analysis.appearance.splat_raster import Drawing, Flat, draw, project
from meshreel.errors import InputError
from meshreel.geometry.cameras import CameraPose
from meshreel.geometry.color_views import ColorPicture
from meshreel.geometry.splats import Bound, Carrier, bind
from meshreel.geometry.topology import subdivide_midpoint
from meshreel.types import UP_AXES, UPS, Mesh
from tests.metrics.shapes import sphere
from tests.splats import some_splats

BALL = sphere(levels=2)
FINE = subdivide_midpoint(BALL, 2)
COLORS = np.clip(128 + 100 * np.sin(3 * FINE.vertices / np.abs(FINE.vertices).max()), 0, 255).astype(np.uint8)
PAINTED = Mesh(FINE.vertices / FINE.diagonal, FINE.faces, COLORS)
SIZE = (24, 20)


def stretched(by: float) -> Mesh:
    return PAINTED.at(PAINTED.vertices * [1.0, 1 + by, 1.0])


def frame(by: float, cameras: int = 4, turn: float = 0.0) -> SplatFrame:
    mesh = stretched(by)
    return SplatFrame(Carrier(mesh.vertices, mesh.faces, 2), rendered(mesh, ring(mesh, cameras, 48, turn)))


def shown(bound: Bound, view: SplatView) -> float:
    """Return the PSNR of a picture of splats, dB."""
    picture = draw(bound, view.camera)
    return -10 * float(np.log10(np.square(picture - view.pixels).mean()))


@pytest.fixture
def flat() -> tuple[Flat, np.ndarray, np.ndarray]:
    camera = ring(PAINTED, 1, 24, 0.1)[0]
    bound = bind(some_splats(40, len(BALL.faces)), Carrier(BALL.vertices / FINE.diagonal, BALL.faces, 0, unit=6.0))
    flat = project(np, bound.means, bound.axes, bound.scales, (camera.extrinsic[:3], camera.intrinsic))
    return flat, 0.9 * bound.opacities, bound.colors


def test_gradients_are_those_of_differences(flat: tuple[Flat, np.ndarray, np.ndarray]) -> None:
    given = np.random.default_rng(0).normal(size=(*SIZE, 3))
    arrays = [flat[0].centers, flat[0].conics, flat[1], flat[2]]
    found = Drawing(*flat, SIZE).gradients(given)
    checked = 0
    for values, gradient in zip(arrays, found, strict=True):
        assert values.shape == gradient.shape
        for place in np.ndindex(values.shape):
            kept, sums = values[place], list[float]()
            for step in (1e-4, -1e-4):
                values[place] = kept + step
                sums.append(float((Drawing(*flat, SIZE).picture * given).sum()))
            values[place] = kept
            told = (sums[0] - sums[1]) / 2e-4
            checked += abs(told) > 1e-3
            # pixels come and go at the least opacity: a step there is none of the gradient's
            assert abs(told - gradient[place]) < 2e-2 * max(1.0, abs(told)) or abs(told) > 30, (place, told)
    assert checked > 100


def test_light_is_shared_out(flat: tuple[Flat, np.ndarray, np.ndarray]) -> None:
    white = Drawing(flat[0], flat[1], np.ones_like(flat[2]), SIZE)
    np.testing.assert_allclose(white.picture, 1)
    assert white.shares().sum() <= SIZE[0] * SIZE[1]


def test_what_is_near_hides_what_is_far() -> None:
    near = Flat(np.full((2, 2), 8.0), np.tile([0.01, 0, 0.01], (2, 1)), np.full((2, 2), 100.0), np.array([2.0, 1.0]))
    red_green = np.array([[1.0, 0, 0], [0, 1.0, 0]])
    picture = Drawing(near, np.ones(2), red_green, (16, 16)).picture
    assert picture[8, 8, 1] > 0.95 > 0.05 > picture[8, 8, 0]


def test_a_fit_shows_other_views_and_other_frames() -> None:
    pytest.importorskip("torch")
    splats, importance = fit_splats([frame(0.0), frame(0.4)], 400, 120)
    assert len(splats) == len(importance) <= 400
    for by in (0.0, 0.2, 0.4):
        unseen = frame(by, 2, 0.13)
        assert min(shown(bind(splats, unseen.carrier), view) for view in unseen.views) > 21


def test_equal_input_gives_equal_splats() -> None:
    torch = pytest.importorskip("torch")
    threads, found = torch.get_num_threads(), list[np.ndarray]()
    for some in (1, 2):
        torch.set_num_threads(some)
        found.append(fit_splats([frame(0.0)], 100, 20)[0].colors)
        assert torch.get_num_threads() == some
    torch.set_num_threads(threads)
    np.testing.assert_array_equal(*found)


def test_splats_that_nobody_sees_move_to_where_errors_are(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("torch")
    whole = frame(0.0)
    lacking = np.arange(len(FINE.faces)) < len(FINE.faces) // 2  # transparent there
    half = replace(whole, carrier=replace(whole.carrier, lacking=lacking))
    found = []
    for moves in (0, 2):
        monkeypatch.setattr("meshreel.analysis.appearance.splat_fit.MOVES", moves)
        found.append(fit_splats([half], 300, 40)[0])
    still, moved = found
    assert len(moved) == 300 > 1.5 * len(still)  # what adds nothing is left out
    assert moved.faces.min() >= len(BALL.faces) // 2


def test_pictures_that_show_nothing_are_refused() -> None:
    blank = replace(frame(0.0), views=tuple(replace(v, pixels=np.ones_like(v.pixels)) for v in frame(0.0).views))
    for empty in (blank, replace(blank, views=())):
        with pytest.raises(InputError, match=r"none of \d pictures shows the surface; check the cameras"):
            fit_splats([empty], 10, 1)


def test_without_torch_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "torch", None)
    with pytest.raises(InputError, match=r"meshreel\[splats\]"):
        fit_splats([frame(0.0)], 10, 1)


def test_a_picture_fills_its_longer_side() -> None:
    for view in frame(0.4).views:
        assert max(view.camera.width, view.camera.height) == 48
        covered = (view.pixels < 1).any(axis=2)
        assert covered.any(axis=1).sum() > 38 and not covered[0].any()


def test_a_camera_that_sees_nothing_gives_no_view() -> None:
    camera = ring(PAINTED, 1, 48, 0.0)[0]
    behind = replace(camera, pose=CameraPose.of_world(np.diag([-1.0, 1, -1, 1]) @ camera.extrinsic))
    pixels = np.full((camera.height, camera.width, 3), 90, np.uint8)
    assert taken([ColorPicture(behind, pixels)], PAINTED, PAINTED, 48) == ()


def test_what_hides_a_body_is_unknown_in_its_picture() -> None:
    camera = ring(PAINTED, 1, 48, 0.0)[0]
    picture = ColorPicture(camera, np.full((camera.height, camera.width, 3), 90, np.uint8))
    [free] = taken([picture], PAINTED, PAINTED, 48)
    middle = tuple(side // 2 for side in free.pixels.shape[:2])
    np.testing.assert_allclose(free.pixels[middle], 90 / 255, atol=1e-3)
    eye = camera.eye
    nearer = PAINTED.at(eye + 0.5 * (PAINTED.vertices - eye))  # hides all of it
    [hidden] = taken([picture], PAINTED, nearer, 48)
    assert np.isnan(hidden.pixels[middle]).all()


@pytest.mark.parametrize("up", UPS)
def test_cameras_around_a_body_look_at_it_from_above_the_horizon(up):
    above = np.array(UP_AXES[up])
    eyes = np.array([camera.eye for camera in ring(PAINTED, 6, 48, 0.3, up)])
    heights = (eyes - PAINTED.middle) @ above
    assert len(eyes) == 6 and (heights > 0).all()
    across = np.linalg.norm(eyes - PAINTED.middle - heights[:, None] * above, axis=1)
    assert (across > 2 * heights).all()
