"""Closeness: distances of samples of both surfaces, and templates that are wrong though they are near."""

import numpy as np
import pytest

from meshreel.analysis.fit.frame import Closeness, FrameSurface
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh
from tests.spheres import sliding_sphere

BALL = Mesh.of(sliding_sphere(1)[0].vertices / 12**0.5, sliding_sphere(1)[0].faces)  # diagonal 1
RADIUS = float(np.linalg.norm(BALL.vertices[0]))


def closeness(template: Mesh, frame: Mesh, noise: float = 0.0) -> float:
    """Of a template that lies well on another frame before."""
    measure = Closeness(template, 5e-4, noise)
    assert measure.of(template.vertices, FrameSurface(template)) < 1e-6
    return measure.of(template.vertices, FrameSurface(frame))


def test_the_distance_is_that_of_parallel_surfaces():
    larger = Mesh.of(BALL.vertices * (1 + 0.001 / RADIUS), BALL.faces)
    assert closeness(BALL, larger) == pytest.approx(0.001, rel=0.02)
    assert closeness(larger, BALL) == pytest.approx(0.001, rel=0.02)


def test_where_a_frame_is_noisier_its_distance_counts_for_as_much_less():
    """A sphere whose upper half is off by 3 mm, where it has three times the noise of the lower half, off by 1 mm."""
    upper = BALL.vertices[:, 2] > 0
    frame = Mesh(BALL.vertices * (1 + np.where(upper, 0.003, 0.001) / RADIUS)[:, None], BALL.faces)
    for uneven, wanted in ((None, 5**0.5), (np.where(upper, 3.0, 1.0), 1.0)):
        measured = Closeness(BALL, 5e-4, 0.001).of(BALL.vertices, FrameSurface(frame, uneven=uneven))
        assert measured == pytest.approx(0.001 * wanted, rel=0.1)


def test_a_template_that_lacks_surface_is_wrong_and_so_is_one_with_more():
    speck = Mesh.of(0.25 * BALL.vertices + [0.5, 0, 0], BALL.faces)  # a sixteenth of the area
    assert closeness(BALL, concatenate([BALL, speck])) == np.inf
    assert closeness(concatenate([BALL, speck]), BALL) == np.inf


def test_a_template_turned_inside_out_is_wrong_though_it_is_near():
    thin = BALL.vertices * [1, 1, 0.004]  # a disc, 2 mm thick for a diagonal of 1 m
    swapped = thin * [1, 1, -1]  # its upper side below
    disc = Mesh.of(thin, BALL.faces)
    measure = Closeness(Mesh(thin, BALL.faces), 5e-4)
    assert measure.of(thin, FrameSurface(disc)) < 1e-6
    assert np.abs(swapped - thin).max() < 0.003 and measure.of(swapped, FrameSurface(disc)) == np.inf


def test_surfaces_that_face_each_other_in_every_frame_are_not_wrong():
    inner = Mesh.of(0.999 * BALL.vertices, BALL.faces[:, ::-1])  # a shell: each side is nearest to the other
    shell = concatenate([BALL, inner])
    moved = concatenate([BALL, Mesh.of(0.9985 * BALL.vertices, BALL.faces[:, ::-1])])
    measure = Closeness(Mesh(moved.vertices, shell.faces), 5e-4)
    first = measure.of(moved.vertices, FrameSurface(shell))
    assert first < 0.001 and measure.of(moved.vertices * 1.0001, FrameSurface(shell)) < 0.001


def test_holes_and_strays_of_noisy_frames_do_not_count():
    half = Mesh.of(BALL.vertices, BALL.faces[: len(BALL.faces) // 2])
    assert closeness(BALL, half, noise=0.001) < 1e-3 < 0.05 < np.sqrt(np.mean(np.square(gaps(BALL, half))))


def test_what_a_coarse_target_allows_is_not_wrong():
    wavy = Mesh.of(BALL.vertices * (1 + 0.03 * np.sin(9 * BALL.vertices[:, :1] / RADIUS)), BALL.faces)
    for target, is_wrong in ((5e-4, True), (3e-3, False)):
        measure = Closeness(BALL, target)
        measure.of(BALL.vertices, FrameSurface(BALL))
        assert (measure.of(BALL.vertices, FrameSurface(wavy)) == np.inf) == is_wrong


def gaps(mesh: Mesh, other: Mesh) -> np.ndarray:
    surface = FrameSurface(other).surface
    return np.linalg.norm(surface.closest(mesh.vertices).points - mesh.vertices, axis=1)


def test_noisy_surfaces_are_compared_where_both_have_something():
    noise, far = 0.003, Mesh.of(0.25 * BALL.vertices + [0.6, 0, 0], BALL.faces)
    assert (
        closeness(BALL, concatenate([BALL, far]), noise) < noise
        and closeness(concatenate([BALL, far]), BALL, noise) < noise
    )
    assert closeness(BALL, Mesh.of(BALL.vertices + [3.0, 0, 0], BALL.faces), noise) == np.inf
