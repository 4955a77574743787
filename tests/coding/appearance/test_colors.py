"""Colours of vertices: what comes back, what stands still costs nothing, and damage."""

import numpy as np
import pytest

from meshreel.coding.appearance.colors import ColoredMesh, decode_colors, encode_colors
from meshreel.coding.colored import Canvas
from meshreel.errors import FormatError
from meshreel.geometry.topology import subdivide_midpoint
from tests.metrics.shapes import sphere

BALL, LEVELS, FRAMES = sphere(levels=2), 2, 3
FINE = subdivide_midpoint(BALL, LEVELS).vertices
SHAPE = ColoredMesh(BALL, LEVELS, FRAMES, len(FINE))
WAVES = (127 + 100 * np.sin(4 * FINE[:, [0, 1, 2]] + [0, 1, 2])).astype(np.uint8)
STILL = np.repeat(WAVES[None], FRAMES, axis=0)


def coded(colors: np.ndarray = STILL, before: np.ndarray | None = None, step: float = 1 / 64):
    return encode_colors([SHAPE], [colors], step, before, layered=True)


def test_colors_come_back_within_the_step() -> None:
    for step in (1 / 64, 1 / 16, 1 / 4):
        encoded = coded(step=step)
        [found], state = decode_colors(encoded.payload, [SHAPE])
        np.testing.assert_array_equal(found, encoded.colors[0])
        np.testing.assert_array_equal(state, encoded.state)
        assert np.abs(found.astype(int) - STILL).mean() < 255 * step


def test_colors_that_stand_still_cost_nothing_in_the_next_group() -> None:
    first = coded()
    assert len(coded(before=first.state).payload) < 20 < len(first.payload) / 20
    other = np.clip(STILL.astype(int) + 40, 0, 255).astype(np.uint8)
    later = coded(other, first.state)
    [found], _ = decode_colors(later.payload, [SHAPE], first.state)
    assert np.abs(found.astype(int) - other).mean() < 6


def test_the_first_layers_are_the_colors_of_the_first_levels() -> None:
    encoded = coded()
    for levels, end in enumerate(encoded.layers):
        count = len(subdivide_midpoint(BALL, levels).vertices)
        [found], _ = decode_colors(encoded.payload[:end], [ColoredMesh(BALL, levels, FRAMES, count)])
        np.testing.assert_array_equal(found, encoded.colors[0][:, :count])


def test_grey_is_grey_and_nothing_is_nothing() -> None:
    grey = np.full_like(STILL, 128)
    assert (coded(grey).colors[0] == 128).all()
    assert encode_colors([], [], 0.0909).colors == ()


def test_frames_and_meshes_have_the_same_colors() -> None:
    rng = np.random.default_rng(0)
    patches = (2, 0, 3)
    canvas = Canvas((ColoredMesh(BALL, 0, 3, 66), ColoredMesh(BALL, 0, 1, 5)), patches)
    frames = [rng.integers(0, 256, (66 + more, 3)).astype(np.uint8) for more in patches]
    for one, other in zip(canvas.by_frame(canvas.by_mesh(frames)), frames, strict=True):
        np.testing.assert_array_equal(one, other)
    alone = Canvas((ColoredMesh(BALL, 0, 2, 66), ColoredMesh(BALL, 0, 1, 66)))
    frames = [rng.integers(0, 256, (66, 3)).astype(np.uint8) for _ in range(3)]
    for one, other in zip(alone.by_frame(alone.by_mesh(frames)), frames, strict=True):
        np.testing.assert_array_equal(one, other)


def test_damaged_colors_are_refused() -> None:
    data, state = coded().payload, coded().state
    with pytest.raises(FormatError, match="chroma 0"):
        decode_colors(data[:2] + b"\0" + data[3:], [SHAPE])
    follows = coded(before=state).payload
    with pytest.raises(FormatError, match="not at hand"):
        decode_colors(follows, [SHAPE])
    with pytest.raises(FormatError, match="predicted from those of 7"):
        decode_colors(follows, [SHAPE], np.zeros((7, 3)))
    with pytest.raises(FormatError):  # a mesh of other vertices
        decode_colors(data, [ColoredMesh(BALL, LEVELS, FRAMES, SHAPE.vertices + 1)])
