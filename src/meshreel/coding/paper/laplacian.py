"""Laplacian coordinates on the decoded base mesh (paper, section 3.3.3, eqs. 11-13).

In: V x M weights. Out: (V + l) x M deltas, the mean-value Laplacian of the weights and below it the weights of l anchor
vertices. The inverse is least squares with a sparse factorisation that all columns share (decision 21).

Differs from the paper: mean-value weights are bounded so that degenerate faces cannot spoil a row; a vertex without
faces has the identity as its row; the anchors' rows may weigh more than 1, which gives them a finer step.
"""

from __future__ import annotations

import numpy as np

from ... import _core
from ...format.layout import AnchorRule
from ...geometry.topology import components
from ...shapes import Float64, Int32
from ...types import Mesh


def anchors(rule: AnchorRule, count: int, faces: Int32[np.ndarray, "F 3"], vertices: int) -> Int32[np.ndarray, " l"]:
    """Choose anchor vertices, ascending: `count`, or more if the mesh has more connected components of faces.

    Vertices that no face uses need no anchor: their row of the Laplacian determines them.
    """
    if rule is AnchorRule.FARTHEST:
        return _core.farthest_anchors(np.ascontiguousarray(faces), vertices, count)
    chosen = np.zeros(vertices, dtype=bool)
    if vertices:
        chosen[np.arange(count, dtype=np.int64) * vertices // max(count, 1)] = True
    used = np.zeros(vertices, dtype=bool)
    used[faces.reshape(-1)] = True
    labels = components(faces, vertices)
    served = np.zeros(vertices, dtype=bool)
    served[labels[chosen]] = True
    firsts = np.unique(labels, return_index=True)[1]
    chosen[firsts[~served[labels[firsts]]]] = True
    return np.flatnonzero(chosen & used).astype(np.int32)


class System:
    """Extended Laplacian of one base mesh, factorised once and used for any number of columns."""

    def __init__(self, base: Mesh, anchors: Int32[np.ndarray, " l"], weight: int = 1) -> None:
        self.vertices = len(base.vertices)
        self._core = _core.Laplacian(base.vertices, base.faces, anchors, float(weight))

    def forward(self, weights: Float64[np.ndarray, "V M"]) -> Float64[np.ndarray, "R M"]:
        """Return the deltas of some weights, anchors last (eq. 12)."""
        return self._core.forward(np.ascontiguousarray(weights))

    def inverse(self, deltas: Float64[np.ndarray, "R M"]) -> Float64[np.ndarray, "V M"]:
        """Return the weights that fit the deltas best in the least-squares sense (eq. 13)."""
        return self._core.inverse(np.ascontiguousarray(deltas))

    def quantize(
        self, deltas: Float64[np.ndarray, "R M"], steps: Float64[np.ndarray, " M"], prices: Float64[np.ndarray, " M"]
    ) -> Int32[np.ndarray, "R M"]:
        """Choose symbols such that `inverse(symbols * steps)` is near the weights of the deltas (decision 5).

        The inverse amplifies smooth errors of the deltas by orders of magnitude; here each rounding compensates the
        error of the earlier ones in the weights, so that the remaining error is white there. `prices` are the squared
        errors, in squared steps, that a symbol smaller by one is worth; 0 ignores the rate.
        """
        return self._core.quantize(deltas, steps, prices)
