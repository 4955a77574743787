"""People of the package `anny`: whole bodies that move smoothly, sit, hug and jump, the same each time; its truth."""

import sys
from functools import partial
from importlib.util import find_spec

import numpy as np
import pytest
from meshreel_bench.datasets import NAMES, Store
from meshreel_bench.datasets import people as module
from meshreel_bench.datasets.people import CAST, FRAMES, bodies, record_people

from meshreel.capture.rig.rig import read_rig
from meshreel.capture.simulated.simulated_rig import TRUTH, read_truth
from meshreel.errors import InputError
from meshreel.geometry.closest_points import distances

anny_only = pytest.mark.skipif(find_spec("anny") is None, reason="the extra people is not installed: ./bench[people]")
SITTER, WOMAN, MAN, DANCER, CHILD, TODDLER = range(len(CAST))


@pytest.fixture(scope="module")
def moments():
    """Bodies of some frames: apart, seated, in arms, and the one after."""
    return {number: bodies(number) for number in (0, 75, 90, 91)}


@anny_only
def test_bodies_are_finite_and_stand_on_the_floor(moments):
    for number, people in moments.items():
        assert len(people) == len(CAST) == 6
        for which, body in enumerate(people):
            assert np.isfinite(body.vertices).all() and 0 <= body.faces.min() <= body.faces.max() < len(body.vertices)
            assert np.array_equal(body.faces, moments[0][which].faces)
            assert body.vertices[:, 1].min() == pytest.approx(CAST[which].motion(number / 30).lift, abs=1e-9)
    steps = [np.abs(a.vertices - b.vertices).max() for a, b in zip(moments[90], moments[91], strict=True)]
    assert min(steps) > 0 and max(steps) < 0.15  # m a frame


@anny_only
def test_there_are_children_and_large_people_who_sit_and_hug(moments):
    high = [body.vertices[:, 1].max() for body in moments[0]]
    assert high[TODDLER] < 1.0 < high[CHILD] < 1.45 < min(high[WOMAN], high[DANCER]) and max(high) < 2.0
    assert moments[90][SITTER].vertices[:, 1].max() < high[SITTER] - 0.3
    gaps = [distances(people[WOMAN].vertices, people[MAN]).min() for people in (moments[0], moments[75])]
    assert gaps[0] > 0.2 and gaps[1] < 0.01


@anny_only
def test_the_same_frame_has_equal_bits(moments):
    again = bodies(75)
    assert all(np.array_equal(a.vertices, b.vertices) for a, b in zip(moments[75], again, strict=True))


@anny_only
def test_a_rig_has_people_as_what_moves_in_its_truth(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "corner_cameras", partial(module.corner_cameras, width=96, count=1))
    record_people(tmp_path, 1)
    truth, people = read_truth(tmp_path / TRUTH), bodies(0)
    assert len(read_rig(tmp_path).frames) == len(truth) == 1
    assert truth[0].dynamic.sum() == sum(len(body.faces) for body in people)
    moving = truth[0].mesh.faces[truth[0].dynamic]
    assert np.allclose(truth[0].mesh.vertices[moving[-1]], people[-1].vertices[people[-1].faces[-1]], atol=1e-5)


def test_without_the_package_the_extra_is_named(tmp_path, monkeypatch):
    assert "people" in NAMES and FRAMES >= 200
    monkeypatch.setitem(sys.modules, "anny", None)
    module._model.cache_clear()
    with pytest.raises(InputError, match=r"meshreel-bench\[people\]"):
        Store(tmp_path, tmp_path).open("people", 1)
