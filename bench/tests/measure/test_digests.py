"""The small sequences of digests exercise what their methods do."""

import pytest
from meshreel_bench.codecs import make_codec
from meshreel_bench.measure import digests
from meshreel_bench.rows import Point

from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.format.layout import ChunkKind, Form


def forms(sequence, preset):
    options = {"preset": preset} | (digests.FEW if preset == "paper" else {})
    chunks = ReelReader(BytesSource(make_codec("meshreel", options).encode(sequence))).chunks
    return {Form(chunk.form) for chunk in chunks if chunk.kind == ChunkKind.GROUP}


@pytest.mark.slow
def test_bodies_of_digests_are_followed_and_move():
    assert forms(digests._body(), "best") == {Form.LAYERS} and forms(digests._body(), "paper") == {Form.LAPLACIAN}
    assert Form.LAYERS in forms(digests._room()[0], "best")


@pytest.mark.slow
def test_methods_have_digests_of_their_own_and_points_of_a_curve_share_one():
    points = [
        Point("own", "meshreel", options)
        for options in (
            {"preset": "best", "quality": 20.0},
            {"preset": "best", "quality": 80.0},
            {"preset": "best", "variant": "fast"},
        )
    ]
    first, second, fast = map(digests.encoder_digest, points)
    assert first == second != fast and None not in (first, fast)
