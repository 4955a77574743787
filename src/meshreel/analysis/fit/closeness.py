"""Distance between a fitted template and a frame, by samples of both surfaces, which decides keys and cuts.

In: a template; its positions on a frame. Out: the RMS distance, the larger of both directions, since either alone
misses surface that the other lacks; infinite if a template is wrong: if more surface of a clean frame than usual has no
counterpart, or one that faces away (folds, shards turned inside out).
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float64, Int32

from ...geometry.closest_points import Surface, area_samples
from ...geometry.topology import vertex_normals
from ...types import Mesh
from .frame import ON_BORDER, FrameSurface

SAMPLES = 4000  # of each surface: as many as tracking matches
STRAY = 6.0  # RMS distances of the noise: samples farther off are surface that the other side lacks: a guess
SHARED = 0.4  # least share of the samples of each surface that noisy frames have in common (guess)
FAR = 0.006  # diagonals: samples farther off have no counterpart (1 cm on a body; decision 24), unless within
FAR_OFF = 4.0  # distances to reach (guess)
WRONG = 0.03  # share of samples beyond the usual share: visible folds; good fits have up to .012 (decision 24)


def shared_distance(
    squares: tuple[Float64[np.ndarray, " N"], Float64[np.ndarray, " M"]],
    over: tuple[Bool[np.ndarray, " N"], Bool[np.ndarray, " M"]],
    noise: float,
) -> float:
    """Return the RMS distance, the larger of both directions, of the surface that two noisy surfaces have in common.

    `squares` are squared distances of samples of each from the other; `over` is True where a sample lies over the
    other surface, not past its border. Surface that one side lacks says nothing about the motion of the rest; infinite
    only if too little is shared.
    """
    shared = [each[inside & (each <= (STRAY * noise) ** 2)] for each, inside in zip(squares, over, strict=True)]
    if any(len(part) < max(SHARED * inside.sum(), 1) for part, inside in zip(shared, over, strict=True)):
        return np.inf
    return float(np.sqrt(max(part.mean() for part in shared)))


class Closeness:
    """A template prepared for measuring its distance from frames."""

    def __init__(
        self, faces: Int32[np.ndarray, "F 3"], rest: Float64[np.ndarray, "V 3"], target: float, noise: float = 0.0
    ) -> None:
        """`target` is the distance to reach, `noise` the RMS distance of the frames from the truth.

        With noise, holes of the frames do not count.
        """
        mesh = Mesh(rest, faces)
        self._surface, self._samples, self._noise = Surface(mesh), area_samples(mesh, SAMPLES), noise
        self._far = max(FAR, FAR_OFF * target)
        self._usual = 1.0  # share without counterpart in the best fit: gear wheels in mesh face each other

    def of(self, positions: Float64[np.ndarray, "V 3"], frame: FrameSurface) -> float:
        """Return the RMS distance between the template at these positions and a frame; infinite where it is wrong."""
        self._surface.move(positions)
        chosen = frame.samples(SAMPLES)
        template, frame_points = positions[self._samples], frame.mesh.vertices[chosen]
        to_frame, to_fit = frame.surface.closest(template), self._surface.closest(frame_points)
        normals = vertex_normals(self._surface.mesh)[self._samples]
        fit_normals, frame_normals = self._surface.normals[to_fit.faces], frame.surface.normals[to_frame.faces]
        back, ahead = ((to_frame.points - template) ** 2).sum(axis=1), ((to_fit.points - frame_points) ** 2).sum(axis=1)
        if self._noise > 0:  # holes of noisy frames do not call for another template
            inside = frame.inside_at(to_frame) > ON_BORDER, ~self._surface.past_border(to_fit)
            return shared_distance((back, ahead), inside, self._noise)
        wrong = (np.einsum("nd,nd->n", normals, frame_normals) < 0) | (back > self._far**2)
        lacking = (np.einsum("nd,nd->n", frame.normals[chosen], fit_normals) < 0) | (ahead > self._far**2)
        share = float(max(wrong.mean(), lacking.mean()))
        self._usual = min(self._usual, share)
        if share > self._usual + WRONG:
            return np.inf
        return float(np.sqrt(max(back.mean(), ahead.mean())))
