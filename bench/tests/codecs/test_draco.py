"""Decimated Draco: in a file, and its meshes alone."""

from __future__ import annotations

import numpy as np
import pytest
from meshreel_bench.codecs import make_codec

from meshreel.errors import InputError
from meshreel.metrics.distance import surface_errors
from tests.spheres import sliding_sphere

POINT = {"fraction": 0.5, "qp": 10}


def test_meshes_alone_are_those_of_the_file_in_fewer_bytes():
    balls = sliding_sphere(2, levels=3)
    file, alone = make_codec("decimated_draco", POINT), make_codec("decimated_draco", POINT | {"decoder": "DracoPy"})
    assert alone.name == "decimated_draco, DracoPy"
    data, fewer = file.encode(balls), alone.encode(balls)
    assert len(fewer) < len(data)
    for ball, one, other in zip(balls, file.decode(data), alone.decode(fewer), strict=True):
        assert len(one.faces) == len(other.faces) and np.allclose(one.diagonal, other.diagonal, rtol=1e-3)
        assert surface_errors(ball, other).symmetric_psnr == pytest.approx(
            surface_errors(ball, one).symmetric_psnr, abs=1
        )


@pytest.mark.parametrize("wrong", [{"decoder": "zip"}, {"decoder": "DracoPy", "levels": 1}])
def test_what_has_no_decoder_is_refused(wrong):
    with pytest.raises(InputError, match="give DracoPy and no levels"):
        make_codec("decimated_draco", POINT | wrong)
