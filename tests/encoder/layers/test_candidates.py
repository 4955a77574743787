"""Candidates: templates that are followed outward from their key until lost, with nothing done twice."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.fit.slide import Slide
from meshreel.encoder.group import interval
from meshreel.encoder.group.forms import target_of
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.layers import candidates
from meshreel.encoder.layers.candidates import Ahead, Candidate
from meshreel.encoder.layers.recipe import LayersRecipe
from meshreel.geometry.color_views import Painted
from meshreel.geometry.work import since, so_far
from meshreel.types import Mesh
from tests.colored_body import painted
from tests.small_options import quick
from tests.spheres import sliding_sphere

OPTIONS = quick(group_size=8).method
BALL = Mesh.of(sliding_sphere(1, levels=2)[0].vertices * [0.28, 0.2, 0.15], sliding_sphere(1, levels=2)[0].faces)
FINE = Mesh.of(sliding_sphere(1)[0].vertices / 12**0.5, sliding_sphere(1)[0].faces)
OTHER = Mesh.of(BALL.vertices[:, [1, 2, 0]] * 1.7 + [0, 0.3, 0], BALL.faces)


def sliding(count: int, body: Mesh = BALL) -> list[Mesh]:
    return [Mesh.of(body.vertices + [0.01 * t, 0, 0], body.faces) for t in range(count)]


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
    frames, before = ahead(sliding(3, FINE)), so_far()
    one = Candidate.of_key(frames, 1, quick(quality=0, effort="thorough").method)
    one.follow(frames)
    tracked = since(before)["frames tracked"]
    counts = [len(other.reference.mesh.vertices) for other in (*one.others(frames), one)]
    assert counts[0] > counts[2] > counts[1]
    assert since(before)["frames tracked"] == tracked == 2


class Shown(Painted):
    """The colours of a mesh, which is known."""

    def __init__(self, mesh: Mesh) -> None:
        super().__init__(mesh)
        self.mesh = mesh


@pytest.fixture
def starts(monkeypatch: pytest.MonkeyPatch) -> list[Mesh]:
    """The frames with whose colours slides begin, in order; a template begins where that frame is."""
    found = list[Mesh]()

    def slide(faces: np.ndarray, key: np.ndarray, paint: Shown) -> Slide:
        found.append(paint.mesh)
        assert np.abs(Mesh(key, faces).middle - paint.mesh.middle).max() < 0.003
        return Slide(faces, key, paint)

    monkeypatch.setattr(candidates, "Slide", slide)
    monkeypatch.setattr(interval, "Painted", Shown)
    return found


def test_a_template_whose_key_had_no_colours_slides_from_the_first_frame_that_has_some(starts: list[Mesh]):
    frames = sliding(6, FINE)
    meshes = [*frames[:4], *(painted(mesh, FINE) for mesh in frames[4:])]
    groups = list(LayersRecipe(replace(OPTIONS, group_size=3)).encode(Interval(meshes)))
    assert [(group.frame_count, group.predicted) for group in groups] == [(3, False), (3, True)]
    assert [mesh is meshes[4] for mesh in starts] == [True]


def test_a_template_that_moved_rigidly_slides_from_its_last_frame_when_it_bends(starts: list[Mesh]):
    bent = [
        Mesh.of(mesh.vertices * [1, 1 + 0.06 * t, 1 - 0.04 * t], FINE.faces) for t, mesh in enumerate(sliding(4, FINE))
    ]
    meshes = [painted(mesh, FINE) for mesh in [*sliding(3, FINE), *bent[1:]]]
    groups = list(LayersRecipe(replace(OPTIONS, group_size=3)).encode(Interval(meshes, 0.001)))
    assert [(group.frame_count, group.predicted) for group in groups] == [(3, False), (3, True)]
    assert [mesh is meshes[2] for mesh in starts] == [True]


def test_a_template_that_goes_on_takes_the_colours_of_its_own_key(starts: list[Mesh]):
    meshes = [painted(mesh, BALL) for mesh in sliding(6)]
    whole, rest = (replace(ahead(meshes[first:], first), paint=lambda _, mesh: Shown(mesh)) for first in (0, 3))
    one = Candidate.of_key(whole, 1, quick(effort="thorough").method)
    one.follow(whole)
    one.fit(rest, range(3, 6))
    assert [mesh is meshes[1] for mesh in starts] == [True]
    assert len(one.others(whole)) == 2 and one.others(rest) == []  # whose frames do not have the key
