"""Fingers that move by the distance between them: shape alone takes each for its neighbour, colour does not."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.analysis.fit.frame import FrameSurface
from meshreel.analysis.follow.embedded import ColoredPlaces, Tracker
from meshreel.geometry.color_views import Painted
from meshreel.types import Mesh
from tests.analysis.follow.test_embedded import SMALL, tube

APART, COUNT = 0.12, 5
COLORS = np.array([[200, 30, 30], [30, 200, 30], [30, 30, 200], [200, 200, 30], [200, 30, 200]], np.uint8)


def fingers(shift: float) -> Mesh:
    """Parallel tubes in a row, each with a colour of its own, shifted along the row."""
    one = tube(np.linspace([-0.2, 0, 0], [0.2, 0, 0], 60))
    places = [one.vertices + [0, APART * k + shift, 0] for k in range(COUNT)]
    faces = [one.faces + len(one.vertices) * k for k in range(COUNT)]
    colors = np.repeat(COLORS, len(one.vertices), axis=0)
    return replace(Mesh.of(np.concatenate(places), np.concatenate(faces)), colors=colors)


def found(colored: bool) -> float:
    """Return the RMS error of the fingers' places after they moved by the distance between them."""
    key, frame = fingers(0.0), fingers(APART)
    paints = [(lambda mesh=mesh: Painted(mesh)) if colored else None for mesh in (key, frame)]
    tracker = Tracker(key, 0, SMALL, paint=paints[0])
    tracker.step(1, FrameSurface(frame), paints[1])
    moved = tracker.placed(1, key.vertices, tracker.bound(key))
    return float(np.sqrt(((moved - frame.vertices) ** 2).sum(axis=1).mean()))


def test_what_moves_by_the_distance_between_its_parts_is_followed_by_its_colours() -> None:
    assert found(colored=False) > 0.1
    assert found(colored=True) < 0.015


@pytest.mark.parametrize("unknown", [0, 1])
def test_too_few_known_colours_tell_nothing(unknown: int) -> None:
    class Blind(Painted):
        def at(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            return super().at(points, normals)[0], np.zeros(len(points), bool)

    key, frame = fingers(0.0), fingers(APART)
    paints = [(Blind if k == unknown else Painted)(mesh) for k, mesh in enumerate((key, frame))]
    samples = FrameSurface(key).samples(1000)
    places = ColoredPlaces(key, samples, paints[0])
    points = key.vertices[samples]
    assert places.offsets(points[:10], points, FrameSurface(frame), 1000, paints[1]) is None


def test_offsets_lead_to_the_nearest_side_of_the_same_colour() -> None:
    key, frame = fingers(0.0), fingers(APART)
    samples = FrameSurface(key).samples(1000)
    points = key.vertices[samples]
    offsets = ColoredPlaces(key, samples, Painted(key)).offsets(
        points, points, FrameSurface(frame), 1000, Painted(frame)
    )
    assert offsets is not None
    np.testing.assert_allclose(offsets, np.tile([0, APART, 0], (len(points), 1)), atol=0.05)  # their diameter is .06
