"""The fit against surfaces with known answers."""

import numpy as np

from meshreel.analysis.fit.frame import border_sides
from meshreel.analysis.fit.surface_fit import FitOptions, fit_frames, snap_to_vertices, strongest_components
from meshreel.geometry.topology import drop_unreferenced, face_normals
from meshreel.types import Mesh
from tests.metrics.shapes import moved, plane, sphere

AXES = np.array([0.24, 0.2, 0.22])
QUICK = FitOptions(components=0)


def ball(levels: int, radius: float = 0.22) -> Mesh:
    return sphere(radius, levels)


def stretched(mesh: Mesh) -> Mesh:
    return Mesh(mesh.vertices / 0.22 * AXES, mesh.faces)


def sheet(n: int, height: float = 0.0, up: bool = True) -> Mesh:
    mesh = moved(plane(0.6, n - 1, height), (-0.3, -0.3, 0))
    return mesh if up else Mesh(mesh.vertices, mesh.faces[:, ::-1])


def flipped(mesh: Mesh, positions: np.ndarray) -> int:
    before, area = face_normals(mesh)
    after, left = face_normals(Mesh(positions, mesh.faces))
    return int(((before * after).sum(axis=1) <= 0).sum() + (left < 0.05 * area).sum())


def test_a_sphere_becomes_the_ellipsoid() -> None:
    template, frame = ball(4), stretched(ball(5))
    fit = fit_frames(template.faces, template.vertices[None], [frame], QUICK)
    off = np.abs(np.linalg.norm(fit.positions[0] / AXES, axis=1) - 1) * AXES.min()
    assert np.sqrt(np.mean(off**2)) < 0.0006  # the template's own chords are that far from a sphere
    assert fit.residuals[0] < 0.0006
    assert flipped(template, fit.positions[0]) == 0


def test_a_prediction_on_its_target_stays() -> None:
    template = stretched(ball(4))
    fit = fit_frames(template.faces, template.vertices[None], [template], QUICK)
    assert np.abs(fit.positions[0] - template.vertices).max() < 1e-6
    assert fit.residuals[0] < 1e-6


def test_over_a_hole_the_template_follows_its_prediction() -> None:
    template, frame = ball(4), ball(5)
    hole = frame.vertices[frame.faces].mean(axis=1)[:, 2] > 0.2
    open_frame = drop_unreferenced(Mesh(frame.vertices, frame.faces[~hole]))
    prediction = template.vertices + np.array([0.0, 0.0, 0.004])
    fit = fit_frames(template.faces, prediction[None], [open_frame], QUICK)
    above = template.vertices[:, 2] > 0.212
    assert above.sum() > 10
    step = fit.positions[0][above] - prediction[above]
    assert np.abs(step).max() < 0.008
    assert np.ptp(step[:, 2]) < 0.002  # smoothly
    assert flipped(template, fit.positions[0]) == 0


def test_noise_does_not_fold_the_template() -> None:
    template, frame = ball(4), ball(5)
    noise = np.random.default_rng(3).normal(0, 0.002, frame.vertices.shape)
    fit = fit_frames(template.faces, template.vertices[None], [Mesh(frame.vertices + noise, frame.faces)], QUICK)
    assert flipped(template, fit.positions[0]) == 0


def test_a_near_sheet_that_faces_away_does_not_attract() -> None:
    template = sheet(20)
    fit = fit_frames(template.faces, template.vertices[None], [sheet(40, 0.01, up=False)], QUICK)
    assert np.allclose(fit.positions[0], template.vertices, atol=1e-9)


def test_a_far_sheet_does_not_attract() -> None:
    template = sheet(20)
    fit = fit_frames(template.faces, template.vertices[None], [sheet(40, 0.1)], QUICK)
    assert np.allclose(fit.positions[0], template.vertices, atol=1e-9)


def test_an_open_border_is_laid_on_the_frame_s_border() -> None:
    template, frame = sheet(20), sheet(40)
    small = template.vertices * 0.98  # 0.006 short on each side: point-to-plane rows do not see it
    fit = fit_frames(template.faces, small[None], [frame], QUICK)
    rim = np.abs(template.vertices[:, :2]).max(axis=1) > 0.299
    assert np.abs(np.abs(fit.positions[0][rim, :2]).max(axis=1) - 0.3).max() < 0.001
    assert len(border_sides(template.faces)[0]) == 4 * 19


def test_the_second_fit_is_nearer_to_few_components() -> None:
    template, rng = ball(3), np.random.default_rng(0)
    frames = [stretched(ball(4)) for _ in range(4)]
    predictions = template.vertices + np.repeat(rng.normal(0, 0.002, (4, 1, 3)), len(template.vertices), axis=1)
    predictions = predictions + rng.normal(0, 0.0005, predictions.shape)

    def tail(components: int) -> float:
        options = FitOptions(components=components, pull=0.3)
        positions = fit_frames(template.faces, predictions, frames, options, key=0).positions
        return float(np.linalg.norm(positions - strongest_components(positions, 0, 2)))

    assert tail(2) < 0.7 * tail(0)


def test_vertices_that_no_face_uses_keep_their_prediction() -> None:
    template = ball(2)
    loose = np.concatenate([template.vertices, [[0.4, 0.4, 0.4]]])
    fit = fit_frames(template.faces, loose[None], [ball(3)], QUICK)
    assert np.allclose(fit.positions[0][-1], 0.4)


def test_snapped_vertices_are_those_of_the_frame() -> None:
    template, frame = ball(2), stretched(ball(3))
    fit = snap_to_vertices(template.faces, template.vertices[None], [frame])
    there = {tuple(vertex) for vertex in frame.vertices}
    assert all(tuple(vertex) in there for vertex in fit.positions[0])
    assert 0 < fit.residuals[0] < 0.02
