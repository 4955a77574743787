"""PSNRs of colours against formulas."""

import math
from dataclasses import replace

import numpy as np
import pytest

from meshreel.metrics.color import color_errors
from meshreel.metrics.comparison import frame_row
from meshreel.types import Mesh
from tests.metrics.shapes import sphere

BALL = sphere(levels=3)


def painted(color: tuple[int, int, int], mesh: Mesh = BALL) -> Mesh:
    return replace(mesh, colors=np.tile(np.array(color, np.uint8), (len(mesh.vertices), 1)))


def yuv(r: float, g: float, b: float) -> np.ndarray:
    y = 0.2126 * r + 0.7152 * g + 0.0722 * b
    return np.array([y, (b - y) / 1.8556, (r - y) / 1.5748])


@pytest.mark.parametrize("one, two", [((100, 100, 100), (110, 110, 110)), ((200, 10, 30), (190, 25, 30))])
def test_constant_colors_differ_as_the_formula_says(one, two) -> None:
    found = color_errors(painted(one), painted(two))
    apart = np.abs(yuv(*one) - yuv(*two))
    for value, difference in zip((found["y_psnr"], found["u_psnr"], found["v_psnr"]), apart, strict=True):
        wanted = math.inf if difference < 1e-9 else 20 * math.log10(255 / difference)
        assert value == wanted or abs(value - wanted) < 1e-6
    assert found["yuv_psnr"] == (6 * found["y_psnr"] + found["u_psnr"] + found["v_psnr"]) / 8


def test_the_worse_direction_counts() -> None:
    half = BALL.vertices[BALL.faces].mean(axis=1)[:, 0] > 0
    part = painted((100, 100, 100), Mesh(BALL.vertices, BALL.faces[half]))
    colors = painted((100, 100, 100)).colors.copy()
    colors[BALL.vertices[:, 0] < -0.1] = 200  # what the part lacks has another colour
    found = color_errors(replace(BALL, colors=colors), part)
    assert found["y_psnr"] < 15 and color_errors(part, part)["y_psnr"] == math.inf
    assert found["y_psnr"] == color_errors(part, replace(BALL, colors=colors))["y_psnr"]


def test_meshes_without_faces_or_colors() -> None:
    assert color_errors(Mesh.empty(), Mesh.empty())["y_psnr"] == math.inf
    assert color_errors(painted((1, 2, 3)), Mesh.empty())["yuv_psnr"] == 0
    assert color_errors(painted((128, 128, 128)), BALL)["y_psnr"] == math.inf  # none is grey


def test_frames_with_colors_have_their_errors_in_the_row() -> None:
    assert "yuv_psnr" not in frame_row(BALL, BALL, [])
    assert frame_row(painted((9, 9, 9)), painted((19, 19, 19)), [])["y_psnr"] == pytest.approx(20 * math.log10(25.5))
