"""Intervals, and all else that is asked for frames by number: none has a frame for a number outside its range."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.scene.standing import LocalNoise
from meshreel.analysis.survey import survey_sequence
from meshreel.encoder.group.forms import target_of
from meshreel.encoder.group.interval import BodyFrames, Interval, NormalisedFrames, Views
from meshreel.encoder.layers.candidates import Ahead
from meshreel.format.edit import Edit
from meshreel.geometry.cameras import Camera
from meshreel.geometry.depth import WORLD, DepthPicture
from meshreel.geometry.derived_sequences import ChosenPictures, DerivedSequence, picked, unchanging
from meshreel.types import Placement
from tests.colored_body import painted
from tests.small_options import quick
from tests.spheres import sliding_sphere

FRAMES = sliding_sphere(6, levels=1)
MESHES = [painted(mesh, FRAMES[0]) for mesh in FRAMES]
SURVEY, NUMBERS = survey_sequence(FRAMES), range(2, 5)
VIEW = Camera.of(4, 4, np.diag([4.0, 4.0, 1.0]), np.eye(4))
PICTURES = ChosenPictures(lambda _: [DepthPicture(VIEW, np.ones((4, 4), np.uint16), 1.0, 9.0)], tuple(range(6)))
VIEWS = Views(ChosenPictures(lambda _: [], tuple(range(6))), FRAMES, WORLD)
INTERVAL = Interval(MESHES[2:5], first_frame=2, views=VIEWS, depth=PICTURES, place=WORLD)
AHEAD = Ahead(2, [FrameSurface(mesh) for mesh in MESHES[2:5]], 0.0, target_of(MESHES, quick().method.target, 0.0))
WHOLE, BODIES = DerivedSequence(FRAMES), ((0,),) * 3
LOOKUPS: dict[str, tuple[Callable[[int], Any], range]] = {
    "frames ahead": (AHEAD.at, NUMBERS),
    "colours ahead": (AHEAD.painter, NUMBERS),
    "colours of an interval": (lambda number: INTERVAL.paint(number, MESHES[0]), range(3)),
    "free space of an interval": (INTERVAL.free, range(3)),
    "frames of an interval": (NormalisedFrames(WHOLE, SURVEY, NUMBERS).__getitem__, range(3)),
    "a body of an interval": (BodyFrames(WHOLE, SURVEY, NUMBERS, 0, BODIES).__getitem__, range(3)),
    "a derived sequence": (WHOLE.__getitem__, range(6)),
    "names of frames": (WHOLE.name, range(6)),
    "a remembered sequence": (unchanging(FRAMES).__getitem__, range(6)),
    "chosen frames": (picked(FRAMES, (5, 0)).__getitem__, range(2)),
    "pictures": (PICTURES.__getitem__, range(6)),
    "a survey": (SURVEY.is_bare, range(6)),
    "an edit": (Edit((range(1, 3), range(4, 5))).coded, range(3)),
}


@pytest.mark.parametrize("name", LOOKUPS)
def test_a_frame_is_found_by_its_number_and_by_no_other(name: str):
    lookup, numbers = LOOKUPS[name]
    for number in numbers:
        lookup(number)
    for number in (numbers.start - 1, numbers.stop, -1, -len(numbers)):
        with pytest.raises(IndexError, match=f"frame {number}: there are frames {numbers.start} to {numbers.stop - 1}"):
            lookup(number)


def test_the_noise_of_a_place_is_in_units_of_that_of_the_body():
    local = LocalNoise(np.array([[2.0, 0, 0]]), *np.full((2, 1), 0.006))
    interval = Interval(MESHES[2:5], 0.001, place=Placement(4.0, (0.0, 0.0, 0.0)), local=local)
    points = np.array([[0.5, 0, 0], [0.6, 0.0, 0]])
    assert interval.unevenness(points) == pytest.approx(1.5)
    assert replace(interval, noise=1e-6).unevenness(points) == pytest.approx(4.0)  # at most
    assert replace(interval, noise=0.0).unevenness(points) is None and INTERVAL.unevenness(points) is None
