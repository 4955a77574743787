"""The slide of a template to where its colours were: analytic patterns, no texture, places that nobody sees."""

import numpy as np
import pytest

from meshreel.analysis.fit.slide import Slide

SIDE = 40
X, Y = np.meshgrid(np.arange(SIDE), np.arange(SIDE))
FLAT = np.stack([X, Y, 0 * X], axis=2).reshape(-1, 3).astype(np.float64)
CORNER = (SIDE * Y + X)[:-1, :-1].reshape(-1, 1)
FACES = np.concatenate([CORNER + [0, 1, SIDE], CORNER + [1, SIDE + 1, SIDE]]).astype(np.int32)
INNER = ((X > 6) & (X < SIDE - 7) & (Y > 6) & (Y < SIDE - 7)).reshape(-1)


class Pattern:
    """Colours of a plane: waves along both axes, which have moved by `moved` edges, in changing light."""

    def __init__(self, moved: float = 0.0, contrast: float = 80.0, light: float = 0.0, hidden: bool = False) -> None:
        self.moved, self.contrast, self.light, self.hidden = moved, contrast, light, hidden

    def at(self, points: np.ndarray, normals: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        del normals
        x, y = points[:, 0] - self.moved, points[:, 1]
        values = 128 + self.contrast * np.sin(x / 1.7) * np.cos(y / 2.1) + self.light * x
        return np.repeat(values[:, None], 3, axis=1), np.full(len(points), not self.hidden)

    def pixels_on(self, mesh: object) -> float:
        del mesh
        return np.inf


@pytest.mark.parametrize("light", [0.0, 1.0])
def test_a_template_follows_a_pattern_that_has_moved(light: float) -> None:
    found = Slide(FACES, FLAT, Pattern()).to(FLAT, Pattern(0.8, light=light)) - FLAT
    assert np.abs(found[:, 2]).max() == 0
    assert found[INNER, 0].mean() == pytest.approx(0.8, abs=0.1) and abs(found[INNER, 1].mean()) < 0.05
    assert np.abs(found[INNER] - [0.8, 0, 0]).mean() < 0.2


@pytest.mark.parametrize("paint", [Pattern(0.8, contrast=0.0), Pattern(0.8, hidden=True)])
def test_without_texture_or_sight_nothing_moves(paint: Pattern) -> None:
    np.testing.assert_allclose(Slide(FACES, FLAT, Pattern()).to(FLAT, paint), FLAT, atol=0.05)
    np.testing.assert_array_equal(Slide(FACES, FLAT, paint).to(FLAT, paint), FLAT)


class Coarse(Pattern):
    """The same, of which the pictures show a pixel a vertex."""

    def pixels_on(self, mesh: object) -> float:
        del mesh
        return SIDE**2


def test_colors_are_compared_no_finer_than_pictures_show_them() -> None:
    found = Slide(FACES, FLAT, Coarse()).to(FLAT, Coarse(0.8)) - FLAT
    assert np.abs(found[INNER] - [0.8, 0, 0]).mean() < 0.3
    fine, coarse = (Slide(FACES, FLAT, paint)._finer.shape[0] for paint in (Pattern(), Coarse()))
    assert coarse == SIDE**2 and fine > 12 * coarse
