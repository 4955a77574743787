"""A procedural person sits down, leans, and opens crossed arms."""

import numpy as np
import pytest

from meshreel.capture.simulated.figure import Pose, figure
from meshreel.capture.simulated.implicit import field, polygonize
from meshreel.capture.simulated.procedural import grid_of_frame
from meshreel.geometry.topology import border_edges, components
from meshreel.types import Mesh
from tests.crossed_arms import TOUCH, UNMATCHED, arms, arms_body, carried, stray_share

COARSE = 0.03


def person(**pose) -> Mesh:
    return polygonize((figure(Pose(np.zeros(3), 0.0, **pose), 0.7 * COARSE),), TOUCH, grid_of_frame(0, COARSE, 0))


def test_who_sits_has_the_feet_where_they_were_and_the_head_lower_and_behind():
    stands, sits = person(), person(hips=(-0.4, -0.36))
    for mesh in (stands, sits):
        assert not len(border_edges(mesh)) and components(mesh.faces, len(mesh.vertices)).max() == 0
        assert abs(mesh.vertices[:, 1].min()) < 0.01
    tops = [mesh.vertices[mesh.vertices[:, 1].argmax()] for mesh in (stands, sits)]
    assert tops[1] - tops[0] == pytest.approx([0, -0.4, -0.36], abs=0.03)


def test_who_leans_has_the_head_ahead_and_the_hips_where_they_were():
    upright, bent = (person(lean=lean).vertices for lean in (0.0, 0.5))
    assert bent[:, 1].max() < upright[:, 1].max() - 0.05
    assert bent[bent[:, 1].argmax(), 2] > upright[upright[:, 1].argmax(), 2] + 0.3
    assert bent[bent[:, 1] < 0.8].min() == pytest.approx(upright[upright[:, 1] < 0.8].min(), abs=0.01)


def test_crossed_arms_are_one_surface_with_the_chest_which_opens():
    """As of depth cameras: no face tells what is arm and what is chest."""
    closed, opened = arms(0, COARSE), arms(35, COARSE)
    assert not len(border_edges(closed)) and components(closed.faces, len(closed.vertices)).max() == 0
    wide = np.ptp(opened.vertices[:, 0]) - np.ptp(closed.vertices[:, 0])
    assert wide > 0.5 and not np.array_equal(closed.faces, opened.faces)
    apart = carried(opened.vertices, arms_body(35, COARSE), arms_body(0, COARSE))
    away = np.abs(field((arms_body(0, COARSE),), TOUCH, apart))
    assert np.quantile(away, 0.8) < 0.01 and away.max() > 0.03  # what touches now has a surface then
    assert stray_share(opened, opened) == 0.0 and stray_share(closed, opened) > 0.1
    assert stray_share(opened, Mesh.of(opened.vertices, opened.faces[:, ::-1])) == 1.0
    off = Mesh.of(opened.vertices + (0, 1.5 * UNMATCHED, 0), opened.faces)
    assert 0.1 < stray_share(opened, off) < 0.9
