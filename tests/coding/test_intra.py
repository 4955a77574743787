"""The form `draco`: frames on a lattice, and refused payloads."""

import math

import numpy as np
import pytest

from meshreel.coding.mesh import code_on_lattice, decode_empty, decode_intra, encode_empty, encode_intra, encode_mesh
from meshreel.errors import FormatError, InputError
from meshreel.format.budget import LIMITS
from meshreel.format.layout import DracoGroup, Form
from meshreel.format.records import pack
from meshreel.types import Mesh

from .paper.test_laplacian import icosahedron

BALL = icosahedron(2)


@pytest.mark.parametrize("step", [1e-2, 1e-4])
def test_a_vertex_moves_by_half_a_step_along_each_axis_at_most(step: float) -> None:
    [mesh, nothing] = decode_intra(encode_intra([BALL, Mesh.empty()], step, 0))
    assert nothing.is_empty and len(mesh.vertices) == len(BALL.vertices)
    gaps = np.abs(mesh.vertices[:, None] - BALL.vertices[None]).max(axis=2).min(axis=1)
    assert gaps.max() <= step / 2 * (1 + 1e-3)
    np.testing.assert_array_equal(mesh.vertices, np.round(mesh.vertices / step) * step)


def test_subdivision_is_free_and_keeps_the_vertices() -> None:
    plain, finer = (encode_intra([BALL], 1e-3, levels) for levels in (0, 2))
    assert len(plain) == len(finer)
    [coarse], [fine] = decode_intra(plain), decode_intra(finer)
    assert len(fine.faces) == 16 * len(coarse.faces)
    np.testing.assert_array_equal(fine.vertices[: len(coarse.vertices)], coarse.vertices)


def test_subdivision_to_an_absurd_size_is_refused_before_memory_is_taken() -> None:
    levels = next(k for k in range(20) if len(BALL.faces) * 4**k > LIMITS.faces)
    with pytest.raises(FormatError, match=f"subdivided {levels} times"):
        decode_intra(encode_intra([BALL], 1e-3, levels))


def test_bytes_that_are_no_draco_mesh_are_refused() -> None:
    for bad in (b"DRACO", encode_mesh(BALL, 1e-3)[:-20], b"\0" * 50):
        with pytest.raises(FormatError, match="Draco"):
            decode_intra(pack(DracoGroup(Form.DRACO, 0, 1e-3, (bad,))))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("step", [1e-8, 1e-300, 1e-310, 5e-324, 0.0, -1e-3, math.inf, math.nan])
def test_a_step_that_no_lattice_has_is_refused_without_a_warning(step: float) -> None:
    with pytest.raises(InputError, match="at most 21 bits"):
        encode_mesh(BALL, step)
    if step in (1e-300, 0.0):
        with pytest.raises(InputError, match="at most 21 bits"):
            code_on_lattice(BALL, step, 1)
    if step in (1e-310, 5e-324, 0.0, -1e-3):
        with pytest.raises(FormatError, match="not finite" if step > 0 else "not above 0"):
            decode_intra(pack(DracoGroup(Form.DRACO, 0, step, (encode_mesh(BALL, 1e-3),))))


def test_an_empty_group_is_one_byte() -> None:
    assert encode_empty() == bytes([Form.EMPTY])
    assert [mesh.is_empty for mesh in decode_empty(encode_empty(), 3)] == [True] * 3
    with pytest.raises(FormatError, match="bytes too many"):
        decode_empty(encode_empty() + b"\0", 3)
