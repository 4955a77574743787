"""Which form a group takes: Draco per frame only where it is the better bargain."""

from dataclasses import replace

import pytest

from meshreel.encoder.group import forms
from meshreel.encoder.group.forms import EncodedGroup, Fidelity, IntraOptions, cheaper, cheapest_intra
from meshreel.format.layout import Form
from tests.spheres import sliding_sphere

BALLS = list(sliding_sphere(2, levels=1))
OPTIONS = IntraOptions(fractions=(1.0,), steps=(0.7,))
ASKED = Fidelity(distance=0.002, angle=30.0, worst=0.004)


@pytest.mark.parametrize(
    ("size", "distance", "form"),
    [
        (501, 0.002, Form.DRACO),  # as good and smaller
        (501, 0.0009, Form.LAYERS),  # smaller and worse
        (499, 0.0021, Form.DRACO),  # less than half the distance for a byte more
        (499, 0.0019, Form.LAYERS),  # a little more than half
        (251, 0.0021, Form.DRACO),  # for not quite twice the bytes
        (250, 0.0021, Form.LAYERS),  # for twice the bytes
    ],
)
def test_draco_is_taken_where_it_is_the_better_bargain(monkeypatch, size, distance, form):
    found = EncodedGroup(Form.DRACO, 2, bytes(500), (), Fidelity(distance=0.001, angle=1.0, worst=0.001))

    def searched(_frames, target, most_bytes, _options):
        return found if found.fidelity.reaches(target) and len(found.payload) < most_bytes else None

    monkeypatch.setattr(forms, "cheapest_intra", searched)
    group = EncodedGroup(Form.LAYERS, 2, bytes(size), (), Fidelity(distance, 2.0, distance))
    assert cheaper(BALLS, group, OPTIONS).form == form


def test_a_body_of_few_faces_is_left_to_draco():
    found = cheapest_intra(BALLS, ASKED, 1e6, OPTIONS)
    assert found is not None
    group = EncodedGroup(Form.LAYERS, 2, bytes(len(found.payload) * 2 // 3), (), ASKED)
    chosen = cheaper(BALLS, group, OPTIONS)
    assert chosen.form == Form.DRACO and (chosen.payload, chosen.fidelity) == (found.payload, found.fidelity)
    assert chosen.frame_count == 2 and found.fidelity.distance < ASKED.distance / 2


def test_finer_steps_are_tried_where_another_frame_needs_them_and_only_where_asked():
    fine, middle = (next(iter(sliding_sphere(1, levels=levels))) for levels in (4, 1))  # small faces tilt more
    asked, options = Fidelity(distance=0.01, angle=0.6, worst=0.1), replace(OPTIONS, steps=(2.0, 1.0))
    assert cheapest_intra([middle], asked, 1e6, options) is not None
    assert cheapest_intra([fine, middle], asked, 1e6, options) is None
    found = cheapest_intra([fine, middle], asked, 1e6, replace(options, finer=True))
    assert found is not None and found.fidelity.reaches(asked)
