"""Coding of one group of layers: its template's motion, patches where they pay, or the form that is cheaper.

In: frames, the positions of a template on them. Out: an EncodedGroup with its fidelity, and the decoder's state.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int32

from ...analysis.fit.frame import FrameSurface
from ...coding.layers.coder import EncodedLayers, LayersState, encode_layers
from ...coding.mesh import CodedReference
from ...format.budget import CostlyError
from ...format.layout import Form
from ...format.records import pack
from ...metrics.distance import BothClosest
from ...types import Mesh
from ..group.digests import note
from ..group.forms import EncodedGroup, Target, cheaper, cheapest_intra, intra_only, measure, most_for
from .options import LayersOptions
from .shown_frame import shown_frames
from .tails import find_tails

MOST_FOR_EDGES = 4  # times the bytes that frames with their edges may cost (guess)
ALWAYS_FOR_EDGES = 256  # bytes a frame that they may cost whatever else is cheap: 60 kbit/s, a tenth of a person's


@dataclass(frozen=True, slots=True)
class GroupCoder:
    """Inputs of the coding of a group, beside its template."""

    surfaces: Sequence[FrameSurface]
    target: Target  # that the frames should reach, normalised
    noise: float  # RMS distance of the frames from the truth, normalised
    options: LayersOptions
    tries_draco: bool = True  # Draco is tried in place of every group, not only where nothing else holds
    dearer: float = 0.0  # bytes a frame, for which Draco was tried and was no bargain

    @property
    def frames(self) -> list[Mesh]:
        """The frames themselves."""
        return [surface.mesh for surface in self.surfaces]

    def alone(self) -> EncodedGroup:
        """Encode the frames one by one; only the first of them where bytes may not hold more."""
        return intra_only(self.frames, self.target, self.options.intra)

    def layers(
        self, reference: CodedReference, positions: Float64[np.ndarray, "T V 3"], previous: LayersState | None
    ) -> tuple[EncodedGroup, LayersState | None]:
        """Encode the frames in their cheapest form; the state is None where that form is not `layers`.

        With a `previous` state they are predicted from it. Where the bytes of a group may not hold so many frames, it
        has only the first of them.
        """
        try:
            noise = self.options.tolerance * self.noise
            encoded = encode_layers(reference, positions, self.options.layers, previous, noise)
        except CostlyError:
            if len(self.surfaces) == 1:
                return self.alone(), None
            half = len(self.surfaces) // 2
            return replace(self, surfaces=self.surfaces[:half]).layers(reference, positions[:half], previous)
        note("fields and symbols", encoded.payload)
        payload, ends, shown, closest = self._with_tails(encoded, reference.base.faces)
        note("patches", payload[len(encoded.payload) :])
        count = len(self.surfaces)
        most = min(self.options.measured or count, count)
        some = [(2 * k + 1) * count // (2 * most) for k in range(most)]
        frames = self.frames
        fidelity = measure([frames[k] for k in some], [shown[k] for k in some], [closest[k] for k in some])
        note("fidelity", fidelity)
        chosen = EncodedGroup(Form.LAYERS, len(self.surfaces), payload, ends, fidelity, previous is not None)
        if not np.isfinite(chosen.fidelity.distance) or any(mesh.is_empty for mesh in shown):
            return self.alone(), None  # the template has collapsed: nothing is comparable
        if fidelity.angle > self.options.flat * self.target.angle:  # edges are lost, as those of few, large faces
            most = max(MOST_FOR_EDGES * len(payload), ALWAYS_FOR_EDGES * count)
            sharp = cheapest_intra(frames, self.target, most, self.options.intra)
            if sharp is not None:
                return sharp, None
        if self.tries_draco and most_for(chosen) > self.dearer:
            chosen = cheaper(frames, chosen, self.options.intra)
        return chosen, encoded.state if chosen.form == Form.LAYERS else None

    def _with_tails(
        self, encoded: EncodedLayers, faces: Int32[np.ndarray, "F 3"]
    ) -> tuple[bytes, tuple[int, ...], list[Mesh], list[BothClosest | None]]:
        """Return the encoded layers, with patches where they pay, where each ends, its frames, and what is closest."""
        payload, layers = encoded.payload, encoded.layers
        decoded = [Mesh(positions, faces) for positions in encoded.positions]
        if not self.options.tails:
            return payload, layers, decoded, [None] * len(decoded)
        known, free, uneven = zip(*((each.surface, each.free, each.uneven) for each in self.surfaces), strict=True)
        shown = shown_frames(known, decoded, free, uneven)
        found = find_tails(shown, len(payload), self.noise)
        if found is None:
            return payload, layers, decoded, [frame.closest for frame in shown]
        record, frames, closest = found
        payload += pack(record)
        return payload, (*layers, len(payload)), frames, [*closest]
