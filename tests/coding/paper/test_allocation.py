import numpy as np
import pytest

from meshreel.coding import entropy, klt
from meshreel.coding.paper import laplacian
from meshreel.coding.paper.allocation import WORTH, DisplacementOptions, allocate
from meshreel.coding.paper.displacements import decode_displacements, encode_displacements
from meshreel.coding.steps import step_of

from .test_displacements import BASE, FIELD, moving, rms
from .test_laplacian import icosahedron


def test_the_steps_follow_the_option() -> None:
    for step in (1e-2, 1e-3, 1e-4):
        system = laplacian.System(BASE, np.array([0, 5], np.int32))
        _, rungs = allocate(
            FIELD, system, entropy.causal_neighbours(BASE.faces, len(FIELD)), DisplacementOptions(step=step)
        )
        assert rungs.size > 0
        assert all(0.65 < step_of(rung) / step < 1.55 for rung in rungs.tolist())  # half an octave around it


def test_components_below_the_step_are_dropped() -> None:
    noise = 1e-5 * np.random.default_rng(0).normal(size=FIELD.shape)
    options = DisplacementOptions(step=1e-3)
    system = laplacian.System(BASE, np.array([0, 5], np.int32))
    _, rungs = allocate(noise, system, entropy.causal_neighbours(BASE.faces, len(FIELD)), options)
    assert len(rungs) == 0


def test_components_are_as_many_as_the_motion_has() -> None:
    field = moving(BASE, 8)
    basis = klt.fit(field)
    strong = int((basis.energies > 1e-3**2).sum())
    system = laplacian.System(BASE, np.array([0, 5], np.int32))
    _, rungs = allocate(
        field, system, entropy.causal_neighbours(BASE.faces, len(field)), DisplacementOptions(step=1e-3)
    )
    assert 1 <= len(rungs) <= strong + 2


def test_the_chosen_number_of_components_is_no_worse_than_any_fixed_one() -> None:
    def cost(size: int | None) -> float:
        options = DisplacementOptions(step=1e-3, basis_size=size)
        data = encode_displacements(FIELD, BASE, options)
        error = ((decode_displacements(data, BASE) - FIELD) ** 2).sum()
        return float(error + WORTH * options.step**2 * 8 * len(data))

    best = min(cost(size) for size in range(8))
    assert cost(None) <= 1.03 * best


def test_a_price_on_bits_saves_more_bytes_than_a_coarser_step_of_equal_error(monkeypatch: pytest.MonkeyPatch) -> None:
    base = icosahedron(4)
    field = moving(base)

    def coded(step: float, price: float) -> tuple[int, float]:
        monkeypatch.setattr("meshreel.coding.paper.allocation.PRICE", price)
        data = encode_displacements(field, base, DisplacementOptions(step=step, anchor_count=6))
        return len(data), rms(decode_displacements(data, base) - field)

    size, error = coded(5e-4, 0.5)
    for step in np.geomspace(5e-4, 2e-3, 7):
        free_size, free_error = coded(float(step), 0.0)
        assert free_error > error or free_size > size
