"""meshoptimizer and Draco at other levels: frames survive within half a lattice step, and empty ones too."""

from __future__ import annotations

import numpy as np
import pytest
from meshreel_bench.codecs import make_codec

from meshreel.errors import InputError
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList
from tests.spheres import sliding_sphere


def check(codec, qp):
    balls = MeshList((*sliding_sphere(2, levels=3), Mesh.empty()))
    *decoded, empty = codec.decode(codec.encode(balls))
    assert empty.is_empty and len(decoded) == 2
    for ball, mesh in zip(balls, decoded, strict=False):
        assert len(mesh.faces) == len(ball.faces)
        step = np.ptp(ball.vertices, axis=0).max() / (2**qp - 1)
        assert surface_errors(ball, mesh).symmetric_rms < step


@pytest.mark.parametrize("qp", [8, 12])
def test_meshoptimizer_keeps_surfaces_to_its_lattice(qp):
    pytest.importorskip("meshoptimizer")
    check(make_codec("meshoptimizer", {"qp": qp}), qp)


@pytest.mark.parametrize("level", [0, 5, 10])
def test_draco_keeps_surfaces_at_every_level(level):
    codec = make_codec("draco", {"qp": 10, "level": level})
    assert codec.name == "draco, other levels"
    check(codec, 10)


@pytest.mark.parametrize(
    ("codec", "options", "text"), [("draco", {"level": 11}, "give 0 to 10"), ("meshoptimizer", {"qp": 17}, "16 bits")]
)
def test_points_that_are_not_there_are_refused(codec, options, text):
    with pytest.raises(InputError, match=text):
        make_codec(codec, options)
