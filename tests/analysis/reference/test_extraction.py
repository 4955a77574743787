"""The reference mesh: fusion in one pose, and the choice of the pose."""

import numpy as np
import pytest

from meshreel.analysis.reference import extraction
from meshreel.analysis.reference.extraction import MDS, Reference, ReferenceOptions, Trial, extract_reference, predict
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import border_edges, components, face_normals, subdivide_midpoint
from meshreel.types import Centers, Mesh

from .test_deform import ball, inside, rotation

QUICK = ReferenceOptions(vertices=500)
RADIUS = 0.1


def parts(mesh: Mesh) -> int:
    return int(components(mesh.faces, len(mesh.vertices)).max()) + 1


def rms_gap(a: Mesh, b: Mesh) -> float:
    gaps = [Surface(x).closest(y.vertices).points - y.vertices for x, y in ((a, b), (b, a))]
    return max(float(np.sqrt(np.mean(np.sum(g**2, axis=1)))) for g in gaps)


def merged_balls(distance: float, n: int = 48) -> Mesh:
    """Two balls as one implicit surface: a capture fuses what touches, as a dumbbell with a neck."""
    from skimage.measure import marching_cubes

    x, y, z = np.meshgrid(*(np.linspace(-0.35, 0.35, n),) * 3, indexing="ij")
    left, right = (np.sqrt((x - s * distance / 2) ** 2 + y**2 + z**2) - RADIUS for s in (-1, 1))
    blend = 0.03
    h = np.maximum(blend - np.abs(left - right), 0) / blend
    vertices, faces, _, _ = marching_cubes(np.minimum(left, right) - h**2 * blend / 4, 0.0)
    return Mesh.of(vertices * (0.7 / (n - 1)) - 0.35, faces[:, ::-1])


def two_balls(distances: tuple[float, ...]) -> tuple[list[Mesh], Centers]:
    one, two = inside((0, 0, 0)), inside((0, 0, 0), seed=1)
    shift = np.array([0.5, 0, 0])
    positions = np.stack([np.concatenate([one - d * shift, two + d * shift]) for d in distances])
    return [merged_balls(d) for d in distances], Centers(positions, np.zeros(positions.shape[1], np.int32))


@pytest.fixture
def trials(monkeypatch: pytest.MonkeyPatch) -> list[Trial]:
    """Trials of the extractions of a test, which number the frames that have a surface."""
    trials, trial = list[Trial](), extraction._trial
    monkeypatch.setattr(extraction, "_trial", lambda *values: trials.append(trial(*values)) or trials[-1])
    return trials


def test_two_balls_that_touch_in_some_frames_are_separate_and_whole_in_the_reference() -> None:
    frames, centers = two_balls((0.2, 0.2, 0.25, 0.32))
    assert [parts(frame) for frame in frames] == [1, 1, 2, 2]
    reference = extract_reference(frames, centers, QUICK)
    assert parts(reference.mesh) == 2
    assert not len(border_edges(reference.mesh))


def test_the_pose_of_mds_is_taken_where_it_is_asked_for(trials: list[Trial]) -> None:
    frames, centers = two_balls((0.2, 0.2, 0.25, 0.32))
    reference = extract_reference(frames, centers, QUICK, "mds")
    assert reference.frame == MDS and {trial.frame for trial in trials} == {MDS}
    assert parts(reference.mesh) == 2


def test_no_triangle_bridges_the_parts_in_any_frame_even_where_the_pose_has_them_touch() -> None:
    frames, centers = two_balls((0.2, 0.26, 0.32))
    reference = extract_reference(frames, centers, QUICK)
    moved = predict(reference, reference.mesh, centers)
    for vertices in moved:
        edges = np.linalg.norm(vertices[reference.mesh.faces] - vertices[np.roll(reference.mesh.faces, 1, 1)], axis=2)
        assert edges.max() < 0.08


def test_the_reference_sent_back_lies_on_each_frame() -> None:
    frames = [ball((0.1, 0, 0)), ball((0.1, 0, 0))]
    turn = rotation(0.8)
    frames[1] = Mesh(frames[1].vertices @ turn.T, frames[1].faces)
    first = inside((0.1, 0, 0))
    centers = Centers(np.stack([first, first @ turn.T]), np.zeros(len(first), np.int32))
    reference = extract_reference(frames, centers, QUICK)
    for frame, vertices in zip(frames, predict(reference, reference.mesh, centers), strict=True):
        assert rms_gap(frame, Mesh(vertices, reference.mesh.faces)) < 0.003
    outward, _ = face_normals(reference.mesh)
    middle = reference.mesh.vertices[reference.mesh.faces].mean(axis=1) - reference.mesh.vertices.mean(axis=0)
    assert (np.sum(outward * middle, axis=1) > 0).mean() > 0.99


def test_surface_that_the_key_frame_lacks_comes_from_other_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = ball((0, 0, 0))
    hole = whole.faces[whole.vertices[whole.faces].mean(axis=1)[:, 2] < 0.06]
    frames = [whole, Mesh(whole.vertices, hole), whole]
    first = inside((0, 0, 0))
    centers = Centers(np.stack([first] * 3), np.zeros(len(first), np.int32))
    monkeypatch.setattr("meshreel.analysis.reference.extraction.KEYS", 1)
    reference = extract_reference(frames, centers, QUICK)
    assert reference.key == 1
    assert reference.mesh.vertices[:, 2].max() > 0.095
    assert rms_gap(whole, reference.mesh) < 0.004


def test_no_surface_is_made_where_no_frame_has_any() -> None:
    whole = ball((0, 0, 0))
    cap = Mesh(whole.vertices, whole.faces[whole.vertices[whole.faces].mean(axis=1)[:, 2] < 0.05])
    first = inside((0, 0, 0))
    centers = Centers(np.stack([first] * 2), np.zeros(len(first), np.int32))
    reference = extract_reference([cap, cap], centers, QUICK)
    gaps = Surface(cap).closest(reference.mesh.vertices).points - reference.mesh.vertices
    assert np.linalg.norm(gaps, axis=1).max() < 0.02


def test_a_group_of_one_frame_takes_that_frames_pose() -> None:
    frame, first = ball((0, 0, 0)), inside((0, 0, 0))
    reference = extract_reference([frame], Centers(first[None], np.zeros(len(first), np.int32)), QUICK)
    assert (reference.frame, reference.key) == (0, 0)
    assert rms_gap(frame, reference.mesh) < 0.003


def test_any_mesh_in_the_reference_pose_can_be_sent_back() -> None:
    frames, centers = two_balls((0.2, 0.3))
    reference: Reference = extract_reference(frames, centers, QUICK)
    dense = subdivide_midpoint(reference.mesh, 1)
    few, many = (predict(reference, mesh, centers) for mesh in (reference.mesh, dense))
    assert many.shape == (2, len(dense.vertices), 3)
    assert np.abs(many[:, : few.shape[1]] - few).mean() < 1e-3
