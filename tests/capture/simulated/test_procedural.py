"""The demo's people are closed, touch and part, and have new connectivity in every frame."""

import numpy as np
import pytest

from meshreel.capture.simulated.implicit import field
from meshreel.capture.simulated.procedural import SoftBodiesOptions, cast, soft_bodies
from meshreel.errors import InputError
from meshreel.geometry.topology import components, face_normals, unique_edges
from tests.capture.simulated.test_demo_room import volume

COARSE = SoftBodiesOptions(frames=90, spacing=0.06)


@pytest.mark.parametrize("number", [0, 12, 42, 75])
def test_every_frame_is_a_closed_surface_that_looks_outwards(number: int) -> None:
    mesh = soft_bodies(COARSE)[number]
    edges, per_face = unique_edges(mesh.faces)
    assert (np.bincount(per_face.reshape(-1), minlength=len(edges)) % 2 == 0).all()
    assert volume(mesh) > 0.1  # m^3: two people
    assert face_normals(mesh)[1].min() > 0


def test_people_are_apart_then_touch_then_are_apart_again() -> None:
    sequence = soft_bodies(SoftBodiesOptions(frames=30, begin=0.95, spacing=0.05))
    shown = [sequence[k] for k in (0, 7, 14, 29)]  # 7: hands alone; 14: a hand on the shoulder, too
    assert [int(components(m.faces, len(m.vertices)).max()) + 1 for m in shown] == [2, 1, 1, 2]


def test_vertices_lie_on_the_surface_that_they_sample() -> None:
    options = SoftBodiesOptions(frames=3, spacing=0.03, people=1)
    mesh = soft_bodies(options)[1]
    off = np.abs(field(cast(1 / 90, options), 0.02, mesh.vertices))
    assert np.quantile(off, 0.99) < 1e-3  # m


def test_a_third_person_and_a_frame_rate_can_be_chosen() -> None:
    sequence = soft_bodies(SoftBodiesOptions(frames=2, frame_rate=15.0, people=3, spacing=0.06))
    assert (len(list(sequence)), sequence.frame_rate) == (2, 15.0)
    assert components(sequence[0].faces, len(sequence[0].vertices)).max() == 2


@pytest.mark.parametrize("options", [{"frames": 0}, {"people": 4}, {"spacing": 1.0}, {"begin": -1.0}])
def test_impossible_options_are_refused(options: dict) -> None:
    with pytest.raises(InputError, match=rf"{next(iter(options))} .* (ask|choose|suits|give)"):
        SoftBodiesOptions(**options)
