"""The stub of the compiled core names what the core has."""

from __future__ import annotations

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
    [laplacian] = [node for node in stub.body if isinstance(node, ast.ClassDef)]
    methods = {node.name for node in laplacian.body if isinstance(node, ast.FunctionDef)} - {"__init__"}
    assert methods == {name for name in dir(_core.Laplacian) if not name.startswith("_")}


def test_places_whose_squares_overflow_are_refused_and_not_searched_for_ever():
    places = np.random.default_rng(0).random((8, 3)) * 1e200
    with pytest.raises(ValueError, match="finite"):
        _core.spread_centers(places, places[:4].copy(), np.zeros(8, np.int32), 1e-3, 8)
