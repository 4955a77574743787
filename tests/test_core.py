"""The stub of the compiled core names what the core has."""

import ast
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel import _core


def test_the_stub_and_the_core_have_the_same_names():
    stub = ast.parse((Path(meshreel.__file__).parent / "_core.pyi").read_text())
    declared = {node.name for node in stub.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    assert declared == {name for name in dir(_core) if not name.startswith("_")}
    for declaration in (node for node in stub.body if isinstance(node, ast.ClassDef)):
        methods = {node.name for node in declaration.body if isinstance(node, ast.FunctionDef)} - {"__init__"}
        assert methods == {name for name in dir(getattr(_core, declaration.name)) if not name.startswith("_")}


def test_places_whose_squares_overflow_are_refused_and_not_searched_for_ever():
    places = np.random.default_rng(0).random((8, 3)) * 1e200
    with pytest.raises(ValueError, match="finite"):
        _core.spread_centers(places, places[:4].copy(), np.zeros(8, np.int32), 1e-3, 8)


FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]], np.int32)  # of a tetrahedron
MOST = 2**64 - 1


@pytest.mark.parametrize("count", [2**31, 2**63, MOST - 1, MOST])
def test_counts_beyond_32_bits_are_refused_before_they_wrap_around(count: int):
    _, finer = _core.subdivide(FACES, 4)
    for faces in (FACES, FACES[:0]):
        with pytest.raises(ValueError, match="index"):
            _core.subdivide(faces, count)
    with pytest.raises(ValueError, match="index"):
        _core.siblings(finer, count, 6)
    third = pow(3, -1, 2**64) * 4 % 2**64  # 3 * third - 3 is 1: that many symbols are there
    with pytest.raises(ValueError):
        _core.orthonormal_inverse(np.ones(1, np.int32), 3, third)
    with pytest.raises(ValueError):
        _core.siblings(finer[:0], 4, MOST)


def test_what_the_core_writes_to_is_never_a_copy():
    rows = np.zeros((4, 3, 2))
    edges, finer = _core.subdivide(FACES, 4)
    level = _core.Level(FACES, edges, *(np.asarray(array) for array in _core.siblings(finer, 4, len(edges))))
    for room in (np.empty((2, 10, 3), np.float16), np.empty((2, 20, 3))[:, ::2], np.empty((2, 10, 3))[::-1]):
        with pytest.raises(TypeError):
            _core.decode_last_level(b"", level, rows, None, None, room)
    for faces in (np.empty((4, 3), np.int64), np.empty((8, 3), np.int32)[::2]):
        with pytest.raises(TypeError):
            _core.keep_faces(FACES, np.zeros(4, np.uint8), faces)
    for symbols in (np.zeros(6), np.zeros(12, np.int32)[::2]):
        with pytest.raises(TypeError):
            _core.decode_integers(b"\0\0", symbols)
