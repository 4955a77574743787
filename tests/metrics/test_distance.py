import math

import numpy as np
import pytest

from meshreel.metrics.distance import PSNR_CEILING, surface_errors
from meshreel.types import Mesh

from ..shared_data import performer
from .shapes import brute_force_distances, moved, noisy, plane, sphere


def test_vertex_errors_agree_with_brute_force_over_all_triangles():
    a, b = noisy(sphere(levels=3), 0.03, 1), noisy(sphere(1.1, levels=2), 0.05, 2)
    errors = surface_errors(a, b)
    there, back = brute_force_distances(a.vertices, b), brute_force_distances(b.vertices, a)
    assert errors.forward.point_mse == pytest.approx((there**2).mean(), rel=1e-5)
    assert errors.backward.point_mse == pytest.approx((back**2).mean(), rel=1e-5)
    p = np.linalg.norm(np.ptp(a.vertices, axis=0))
    assert errors.d2_psnr_paper == pytest.approx(10 * np.log10(p**2 / (there**2).mean()), abs=1e-4)
    worse = max((there**2).mean(), (back**2).mean())
    assert errors.d1_psnr == pytest.approx(10 * np.log10(3 * p**2 / worse), abs=1e-4)


def test_area_errors_agree_with_brute_force_over_random_surface_points():
    a, b = noisy(sphere(levels=2), 0.08, 1), noisy(sphere(levels=2), 0.08, 2)
    errors = surface_errors(a, b)
    distances = brute_force_distances(_random_points(a, 20_000), b)
    assert errors.forward.rms == pytest.approx(np.sqrt((distances**2).mean()), rel=0.02)
    assert errors.forward.hausdorff95 == pytest.approx(np.quantile(distances, 0.95), rel=0.03)


def test_a_shifted_plane_has_the_psnr_of_its_shift():
    errors = surface_errors(plane(), moved(plane(), (0, 0, 0.01)))
    expected = 10 * math.log10(2 / 0.01**2)  # p^2 = 1 + 1
    assert errors.d2_psnr_paper == pytest.approx(expected, abs=1e-4)
    assert errors.symmetric_psnr == pytest.approx(expected, abs=1e-4)
    assert errors.d1_psnr == pytest.approx(expected + 10 * math.log10(3), abs=1e-4)
    assert errors.d2_psnr == pytest.approx(errors.d1_psnr, abs=1e-6)
    assert errors.hausdorff95 == pytest.approx(0.01, rel=1e-5)
    assert errors.percent(errors.hausdorff95) == pytest.approx(1 / math.sqrt(2), rel=1e-5)
    assert errors.angle == pytest.approx(0, abs=1e-4)


def test_sliding_in_the_plane_costs_d1_and_not_d2():
    errors = surface_errors(plane(), moved(plane(), (0.25, 0, 0)))
    assert errors.d1_psnr < 40
    assert errors.d2_psnr == math.inf


def test_concentric_spheres_are_apart_by_the_difference_of_their_radii():
    errors = surface_errors(sphere(1.0, 5), sphere(1.02, 5))
    for one_way in (errors.forward, errors.backward):
        assert one_way.rms == pytest.approx(0.02, rel=0.02)
        assert one_way.hausdorff95 == pytest.approx(0.02, rel=0.05)
        assert one_way.angle < 0.5
    assert errors.d2_psnr_paper == pytest.approx(10 * math.log10(12 / 0.02**2), abs=0.2)


def test_surface_that_is_left_over_is_invisible_one_way_and_visible_both_ways():
    body = sphere()
    extra = Mesh.of(
        np.concatenate([body.vertices, moved(body, (3, 0, 0)).vertices]),
        np.concatenate([body.faces, body.faces + len(body.vertices)]),
    )
    errors = surface_errors(body, extra)
    assert errors.d2_psnr_paper == math.inf
    assert errors.symmetric_rms > 0.5
    assert errors.d1_psnr < 20
    assert errors.forward.covered == 1 and errors.backward.covered == pytest.approx(0.5)


def test_a_few_huge_invented_triangles_count_by_their_area():
    body = sphere(levels=5)
    corners = np.array([[1, 0, 0], [0, 3, 0], [0, 0, 3]], dtype=float)  # a bridge that few vertices carry
    bridged = Mesh.of(
        np.concatenate([body.vertices, corners]),
        np.concatenate([body.faces, len(body.vertices) + np.array([[0, 1, 2]])]),
    )
    assert surface_errors(body, bridged).symmetric_rms > 0.4
    assert surface_errors(body, bridged).d1_psnr > 40  # the vertex-based form hardly notices


def test_errors_swap_direction_with_their_meshes():
    a, b = noisy(sphere(), 0.01, 1), noisy(sphere(1.1), 0.02, 2)
    there, back = surface_errors(a, b), surface_errors(b, a)
    assert there.forward.rms == pytest.approx(back.backward.rms, rel=1e-4)
    assert there.symmetric_rms == pytest.approx(back.symmetric_rms, rel=1e-4)
    assert there.angle == pytest.approx(back.angle, rel=1e-3)


@pytest.mark.parametrize("power", [-60, -25, -9, 7, 12])
def test_meshes_of_any_size_are_measured_as_those_of_a_metre(power):
    a, b, scale = sphere(levels=2), noisy(sphere(1.01, levels=2), 0.02), 10.0**power
    there, here = surface_errors(moved(a, scale=scale), moved(b, scale=scale)), surface_errors(a, b)
    assert there.d2_psnr_paper == pytest.approx(here.d2_psnr_paper, abs=1e-4)
    assert there.d2_psnr == pytest.approx(here.d2_psnr, abs=1e-4)
    assert there.angle == pytest.approx(here.angle, abs=1e-3)
    for name in ("rms", "hausdorff95"):
        assert getattr(there.backward, name) == pytest.approx(getattr(here.backward, name) * scale, rel=1e-4)
    assert surface_errors(moved(a, scale=scale), moved(a, scale=scale)).d1_psnr == math.inf
    assert surface_errors(a, moved(b, scale=scale)).d2_psnr < 20  # no query is lost where sizes are far apart


def test_coordinates_around_a_million_keep_their_millimetres():
    a, b = noisy(sphere(), 1e-3, 1), noisy(sphere(), 1e-3, 2)
    near, far = surface_errors(a, b), surface_errors(moved(a, (1e6, -2e6, 5e5)), moved(b, (1e6, -2e6, 5e5)))
    assert far.d2_psnr_paper == pytest.approx(near.d2_psnr_paper, abs=0.01)
    assert far.angle == pytest.approx(near.angle, abs=0.01)


def test_identical_meshes_are_perfect():
    mesh = noisy(sphere(), 0.02)
    errors = surface_errors(mesh, mesh)
    assert errors.d2_psnr_paper == errors.d1_psnr == errors.d2_psnr == errors.symmetric_psnr == math.inf
    assert errors.symmetric_rms == errors.hausdorff95 == errors.percent(errors.hausdorff95) == 0
    assert errors.angle < 0.01


@pytest.mark.parametrize("shift", [1e-7, 1e-6, 3e-6])
def test_finite_psnrs_stay_under_the_ceiling(shift: float):
    errors = surface_errors(sphere(), moved(sphere(), (shift, 0, 0)))
    for value in (errors.d2_psnr_paper, errors.d1_psnr, errors.d2_psnr):
        assert value == math.inf or value <= PSNR_CEILING


def test_two_empty_frames_are_equal():
    errors = surface_errors(Mesh.empty(), Mesh.empty())
    assert errors.d2_psnr_paper == errors.d1_psnr == errors.d2_psnr == math.inf
    assert errors.symmetric_rms == errors.angle == errors.percent(errors.symmetric_rms) == 0


@pytest.mark.parametrize("flip", [False, True])
def test_one_empty_frame_is_the_worst_case(flip: bool):
    pair = (sphere(), Mesh.empty())
    errors = surface_errors(*(pair[::-1] if flip else pair))
    assert errors.d2_psnr_paper == errors.d1_psnr == errors.d2_psnr == errors.symmetric_psnr == 0
    assert errors.symmetric_rms == errors.hausdorff95 == math.inf
    assert errors.angle == 180


def test_points_without_faces_and_faces_without_area_are_no_surface():
    body = sphere()
    n = len(body.vertices)
    dirty = Mesh.of(
        np.concatenate([body.vertices, [[9, 9, 9], [8, 8, 8]]]),
        np.concatenate([body.faces, [[n, n, n + 1], [0, 0, 1]]]),
    )
    for pair in ((body, dirty), (dirty, body)):
        errors = surface_errors(*pair)
        assert errors.d1_psnr == math.inf
        assert errors.diagonal == pytest.approx(math.sqrt(12))
    specks = Mesh.of([[0, 0, 0], [1, 0, 0]], [[0, 0, 1]])
    assert surface_errors(specks, body).d1_psnr == 0


def test_draco_on_the_dancer_gives_the_published_anchor():
    DracoPy = pytest.importorskip("DracoPy")
    path = sorted(performer("dancer").glob("*.obj"))[0]
    lines = path.read_text().splitlines()
    vertices = [line.split()[1:4] for line in lines if line.startswith("v ")]
    faces = [[int(t.split("/")[0]) - 1 for t in line.split()[1:]] for line in lines if line.startswith("f ")]
    mesh = Mesh.of(np.array(vertices, dtype=float), faces)
    data = DracoPy.encode(mesh.vertices, mesh.faces, quantization_bits=8, compression_level=7)
    decoded = DracoPy.decode(data)
    errors = surface_errors(mesh, Mesh.of(decoded.points, decoded.faces))
    assert errors.d2_psnr_paper == pytest.approx(63.3, abs=0.2)
    assert 5 < errors.angle < 7
    assert 9 < errors.vertex_angle < 12


def _random_points(mesh: Mesh, count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    corners = mesh.vertices[mesh.faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    chosen = rng.choice(len(areas), count, p=areas / areas.sum())
    weights = rng.dirichlet([1, 1, 1], count)
    return np.einsum("nk,nkd->nd", weights, corners[chosen])
