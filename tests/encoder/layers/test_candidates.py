"""Candidates: templates that are followed outward from their key until lost, with nothing done twice."""

import numpy as np

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.encoder.group.forms import target_of
from meshreel.encoder.layers.candidates import Ahead, Candidate
from meshreel.geometry.work import since, so_far
from meshreel.types import Mesh
from tests.small_options import quick
from tests.spheres import sliding_sphere

OPTIONS = quick(group_size=8).method
BALL = Mesh.of(sliding_sphere(1, levels=2)[0].vertices * [0.28, 0.2, 0.15], sliding_sphere(1, levels=2)[0].faces)
OTHER = Mesh.of(BALL.vertices[:, [1, 2, 0]] * 1.7 + [0, 0.3, 0], BALL.faces)


def sliding(count: int) -> list[Mesh]:
    return [Mesh.of(BALL.vertices + [0.01 * t, 0, 0], BALL.faces) for t in range(count)]


def ahead(meshes: list[Mesh], first: int = 0) -> Ahead:
    return Ahead(first, [FrameSurface(mesh) for mesh in meshes], 0.0, target_of(meshes, OPTIONS.target, 0.0))


def test_a_key_is_followed_up_to_the_first_frame_that_is_lost_and_no_farther():
    frames = ahead([OTHER, OTHER, *sliding(3), OTHER, *sliding(2)])
    one, before = Candidate.of_key(frames, 3, OPTIONS), so_far()
    one.follow(frames)
    assert np.isfinite(one.residuals(frames)).tolist() == [False, False, True, True, True, False, False, False]
    work = since(before)
    assert work["frames tracked"] == 4 and work["frames fitted"] <= 4  # the two beside the lost ones are not touched


def test_a_key_of_which_nothing_is_left_is_lost():
    speck = Mesh.of(1e-5 * np.eye(3), [[0, 1, 2]])
    frames = ahead([speck, BALL])
    one = Candidate.of_key(frames, 0, OPTIONS)
    one.follow(frames)
    assert np.isinf(one.residuals(frames)[1])


def test_other_templates_of_a_key_are_finer_or_coarser_and_track_nothing_again():
    fine = sliding_sphere(1)[0]
    frames, before = (
        ahead([Mesh.of(fine.vertices / 12**0.5 + [0.01 * t, 0, 0], fine.faces) for t in range(3)]),
        so_far(),
    )
    one = Candidate.of_key(frames, 1, quick(quality=0, effort="thorough").method)
    one.follow(frames)
    tracked = since(before)["frames tracked"]
    counts = [len(other.reference.mesh.vertices) for other in (*one.others(frames), one)]
    assert counts[0] > counts[2] > counts[1]
    assert since(before)["frames tracked"] == tracked == 2
