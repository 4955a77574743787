"""Seams with known gap and overlap: a box on a floor, cut with a slit or so that the parts overlap."""

from __future__ import annotations

import numpy as np
import pytest
from meshreel_bench.measure.seams import SeamOptions, measure_seam, seam_row

from meshreel.errors import InputError
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh
from tests.metrics.shapes import moved, noisy, sphere

CELL = 0.02  # m
SIDE, HALF, HIGH = 1.0, 0.2, 0.3  # m: of the floor, of half the box, of the box
FRAME = SeamOptions(cell=CELL)
TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
TURN *= np.sign(np.linalg.det(TURN))


def patch(x, y, z=0.0):
    """A level rectangle of cells, facing up."""
    a, b = (np.linspace(*ends, max(round((ends[1] - ends[0]) / CELL), 1) + 1) for ends in (x, y))
    grid = np.stack(np.meshgrid(a, b), axis=-1).reshape(-1, 2)
    i = (np.arange(len(b) - 1)[:, None] * len(a) + np.arange(len(a) - 1)).ravel()
    j = i + len(a)
    faces = np.concatenate([np.stack([i, i + 1, j + 1], 1), np.stack([i, j + 1, j], 1)])
    return Mesh.of(np.column_stack([grid, np.full(len(grid), z)]), faces)


def floor(hole=HALF):
    """A floor with a square hole, in which the box stands; the whole of it for a hole of 0."""
    far = SIDE / 2
    strips = [((-far, far), (hole, far)), ((-far, far), (-far, -hole))]
    strips += [((hole, far), (-hole, hole)), ((-far, -hole), (-hole, hole))] if hole else []
    return concatenate([patch(*strip) for strip in strips])


def box(bottom=0.0, half=HALF):
    """Four walls and a lid."""
    wall = patch((-half, half), (bottom, HIGH))
    x, y, _ = wall.vertices.T
    walls = [(x, -half, y), (half, x, y), (-x, half, y), (-half, -x, y)]
    made = [Mesh.of(np.column_stack(np.broadcast_arrays(*at)), wall.faces) for at in walls]
    return concatenate([*made, patch((-half, half), (-half, half), HIGH)])


def ring(width):
    """Floor around the box, as wide."""
    outer, inner = HALF + width, HALF
    strips = [((-outer, outer), (inner, outer)), ((-outer, outer), (-outer, -inner))]
    strips += [((inner, outer), (-inner, inner)), ((-outer, -inner), (-inner, inner))]
    return concatenate([patch(*strip) for strip in strips])


def scene(still=None, moving=None):
    """A mesh of both and which faces are of the box; corners of the walls are not welded, so faces only touch."""
    still, moving = floor() if still is None else still, box() if moving is None else moving
    mesh = concatenate([still, moving])
    return mesh, np.arange(len(mesh.faces)) >= len(still.faces)


def lowest(seam):
    """Without the upright edges of the walls, which are borders only here."""
    return seam.points[:, 2] < 1e-9


def seam_of(still, moving, options=FRAME):
    return measure_seam(*scene(), still, moving, options)


def test_parts_that_meet_have_neither_gap_nor_overlap():
    seam = seam_of(floor(), box())
    assert seam.gaps[lowest(seam)].max() < 1e-6 and seam.overlaps.max() < 1e-6 and seam.uncovered == 0
    assert seam.lengths[lowest(seam)].sum() == pytest.approx(8 * HALF)


@pytest.mark.parametrize("gap", [0.005, 0.013, 0.03])
def test_the_gap_of_a_slit_under_the_box_is_its_height(gap):
    seam = seam_of(floor(), box(bottom=gap))
    assert seam.gap() == pytest.approx(gap, abs=1e-6) and seam.gap(0.95) == pytest.approx(gap, abs=1e-3)
    assert seam.overlap(0.95) < 1e-6


@pytest.mark.parametrize("gap", [0.007, 0.025])
def test_the_gap_of_a_slit_in_the_floor_or_in_both_parts_is_its_width(gap):
    seam = seam_of(floor(HALF + gap), box())
    assert seam.gap() == pytest.approx(gap, abs=1e-6)
    both = seam_of(floor(HALF + gap), box(bottom=0.01))
    assert both.gap() == pytest.approx(np.hypot(gap, 0.01), abs=1e-6)


def test_over_a_floor_without_a_hole_the_gap_is_the_height_of_the_slit():
    assert seam_of(floor(0), box(bottom=0.015)).gap() == pytest.approx(0.015, abs=1e-6)
    crossing = seam_of(floor(0), box(bottom=-0.01))
    assert crossing.gap() < 1e-6 and crossing.overlap(0.95) == 0  # walls are upright: no double skin


@pytest.mark.parametrize("width", [0.01, 0.03, 0.06])
def test_the_overlap_of_a_body_with_a_ring_of_floor_is_the_width_of_the_ring(width):
    seam = seam_of(floor(), concatenate([box(), ring(width)]))
    assert seam.overlap() == pytest.approx(width, abs=CELL / 8) and seam.gap() < 1e-6
    assert seam_of(floor(HALF + width), concatenate([box(), ring(width)])).overlap(0.95) < 1e-6


def test_the_overlap_of_a_floor_that_continues_under_the_body_is_its_width():
    mesh = concatenate([patch((-0.5, 0), (-0.5, 0.5)), patch((0, 0.5), (-0.5, 0.5))])
    moves = np.arange(len(mesh.faces)) >= len(mesh.faces) // 2
    still, moving = patch((-0.5, 0.03), (-0.5, 0.5)), patch((-0.02, 0.5), (-0.5, 0.5), 0.004)
    seam = measure_seam(mesh, moves, still, moving, FRAME)
    assert seam.overlap() == pytest.approx(0.05, abs=CELL / 4)  # both sides together
    assert seam.gap() == pytest.approx(0.004, abs=1e-6)
    upside_down = Mesh.of(moving.vertices, moving.faces[:, ::-1])
    assert measure_seam(mesh, moves, still, upside_down, FRAME).overlap(0.95) == 0


def test_surface_in_neither_part_is_uncovered():
    seam = seam_of(floor(HALF + 3 * CELL), box())
    assert seam.uncovered == pytest.approx(1 / 8, rel=0.2)  # one of four cells of floor, four of wall
    assert seam_of(floor(HALF + CELL), box()).uncovered == 0


@pytest.mark.parametrize(("scale", "offset"), [(1000.0, (0, 0, 0)), (1.0, (1e5, -2e5, 3e4)), (0.01, (2, 0, 0))])
def test_a_seam_does_not_depend_on_scale_rotation_or_place(scale, offset):
    def placed(mesh):
        return moved(Mesh.of(mesh.vertices @ TURN.T, mesh.faces), offset, scale)

    mesh, moves = scene()
    still, moving = floor(), concatenate([box(bottom=0.012), ring(0.03)])
    seam = measure_seam(mesh, moves, still, moving)
    same = measure_seam(placed(mesh), moves, placed(still), placed(moving))
    assert same.gap() == pytest.approx(scale * seam.gap(), abs=1e-4 * scale)
    assert same.overlap() == pytest.approx(scale * seam.overlap(), abs=3e-3 * scale)
    assert same.uncovered == pytest.approx(seam.uncovered, abs=1e-3)


def test_noise_of_the_frame_and_of_the_parts_hardly_matters():
    mesh, moves = scene()
    seam = measure_seam(noisy(mesh, 0.002), moves, noisy(floor(), 0.0005), noisy(box(bottom=0.02), 0.0005, 1), FRAME)
    assert seam.gap() == pytest.approx(0.02, abs=0.002) and seam.overlap() == 0


def test_a_frame_without_a_border_between_moving_and_still_faces_has_no_seam():
    far = moved(box(), (0, 0, 1.0))
    assert measure_seam(*scene(floor(0), far), floor(0), far) is None
    mesh, moves = scene()
    for all_or_none in (np.ones_like(moves), np.zeros_like(moves)):
        assert measure_seam(mesh, all_or_none, floor(), box()) is None
    ball = moved(sphere(HALF), (0, 0, HALF))  # closed: it has no border
    assert measure_seam(*scene(floor(0), ball), floor(0), ball) is None
    point = Mesh.of(np.zeros((6, 3)), [[0, 1, 2], [3, 4, 5]])
    assert measure_seam(point, np.array([True, False]), floor(), box()) is None
    assert measure_seam(Mesh.empty(), np.zeros(0, bool), floor(), box()) is None
    assert set(seam_row(None).values()) == {None}


def test_a_lost_part_leaves_an_infinite_gap():
    for still, moving in ((Mesh.empty(), box()), (floor(), Mesh.empty())):
        seam = seam_of(still, moving)
        assert np.isinf(seam.gap()) and seam.overlap() == 0 and 0 < seam.uncovered < 1


def test_a_row_is_in_millimetres():
    row = seam_row(seam_of(floor(), box(bottom=0.012)))
    assert row["seam_gap_mm_median"] == pytest.approx(12.0, abs=1e-3) and row["seam_overlap_mm_95"] == 0
    assert set(row) == {
        *("seam_gap_mm_median", "seam_gap_mm_95", "seam_overlap_mm_median", "seam_overlap_mm_95"),
        *("seam_uncovered", "seam_mm"),
    }


def test_impossible_options_and_labels_are_refused():
    mesh, moves = scene()
    with pytest.raises(InputError, match="give one a face"):
        measure_seam(mesh, moves[1:], floor(), box())
    for wrong in ({"cell": 0.0}, {"reach": -1.0}):
        with pytest.raises(InputError, match="give above 0"):
            SeamOptions(**wrong)
