"""A segment of frames becomes groups of layers: a key frame's base mesh follows the others for as long as it can.

In -> out: frames in normalised coordinates, asked for in order -> payloads with what was measured on them. The first
group of a segment stands alone; the next ones are predicted from the one before while its template still fits.
Frames that no template follows are coded one by one.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int32

from .analysis.correspond import choose_key, from_last
from .analysis.fit import Guides, fit_targets, residuals
from .analysis.fit_match import Target
from .analysis.groups import cut_at, leading
from .analysis.template import base_mesh, shared_detail
from .choice import NO_ERROR, measure
from .coding.intra import encode_empty
from .coding.layers import EncodedLayers, LayersState, encode_layers
from .coding.reference import CodedReference, code_on_lattice
from .format.layout import Form
from .format.records import pack
from .tails import find_tails
from .types import Mesh
from .windows import EncodedGroup, EncoderOptions, Stages, cheaper, intra_only, laplacian, target_of

LATTICE = 0.33  # spacing of the base's lattice, in steps: what it rounds away is coded again with the motion
LATTICE_ALONE = 0.8  # the same for one frame, whose base need not move
TOO_COARSE = 1.5  # targets that the layers' distance may be before the Laplacian form is tried
STILL = 1.1  # times what a template usually leaves over that it may leave where it was
MOST_EMPTY = 65_535  # frames of a group without surface: what its field in the index holds
SHORTEST = 4  # frames that a group predicted from the one before must follow, or a new key frame is taken


@dataclass(frozen=True, slots=True)
class Followed:
    """A template at the end of a group: what the next group may begin with."""

    reference: CodedReference
    state: LayersState  # as decoded
    positions: Float64[np.ndarray, "V 3"]  # its fit to the last frame
    residual: float  # what its fits usually leave, RMS


@dataclass(frozen=True, slots=True)
class Fitted:
    """A template on some frames."""

    positions: Float64[np.ndarray, "T V 3"]
    residuals: Float64[np.ndarray, " T"]  # RMS, symmetric

    @staticmethod
    def of(faces: Int32[np.ndarray, "F 3"], positions: Float64[np.ndarray, "T V 3"], targets: list[Target]) -> Fitted:
        """Positions with what they leave over."""
        return Fitted(positions, np.array([residual.by_area for residual in residuals(faces, positions, targets)]))

    def first(self, count: int) -> Fitted:
        """The first so many frames."""
        return Fitted(self.positions[:count], self.residuals[:count])


def encode_segment(
    frames: Sequence[Mesh], options: EncoderOptions, stages: Stages | None = None
) -> Iterator[EncodedGroup]:
    """The groups of a segment, frames all empty or none is; only those of one group are held at a time."""
    stages = stages or Stages(None, len(frames))
    if frames[0].is_empty:
        for start in range(0, len(frames), MOST_EMPTY):
            count = min(MOST_EMPTY, len(frames) - start)
            stages.add("code", count)
            yield EncodedGroup(Form.EMPTY, count, encode_empty(), (), NO_ERROR)
        return
    at, before = 0, None
    while at < len(frames):
        ahead = [frames[number] for number in range(at, min(at + options.group_size, len(frames)))]
        group, before = _next_group(ahead, before, options)
        stages.add("code", group.frame_count)
        at += group.frame_count
        yield group


def _next_group(
    ahead: Sequence[Mesh], before: Followed | None, options: EncoderOptions
) -> tuple[EncodedGroup, Followed | None]:
    """The group that begins with the first of these frames."""
    if before is not None and options.predict:
        continued = _continued(ahead, before, options)
        if continued is not None:
            return continued
    found = _alone(ahead, options)
    while isinstance(found, int):
        found = _alone(ahead[:found], options)
    return found


def _continued(
    ahead: Sequence[Mesh], before: Followed, options: EncoderOptions
) -> tuple[EncodedGroup, Followed | None] | None:
    """A group predicted from the one before, as long as its template fits; None where that is not long."""
    base = before.reference.base
    targets = [Target(frame) for frame in ahead]
    still = _standing(before, targets)
    if still is not None:
        return _coded(ahead, before.reference, still, before, options)
    predictions = from_last(Mesh(before.positions, base.faces), targets, options.embedded)
    targets = targets[: len(predictions)]
    if len(targets) < min(SHORTEST, len(ahead)):
        return None
    levels = before.reference.levels
    guides = Guides(before.positions, shared_detail(before.state.faces, len(before.state.base), levels))
    fitted = Fitted.of(base.faces, fit_targets(base.faces, predictions, targets, options.fit, guides), targets)
    target = target_of(ahead, options).distance
    count = leading(fitted.residuals / target, before.residual / target, options.groups)
    if count < min(SHORTEST, len(ahead)):
        return None
    return _coded(ahead[:count], before.reference, fitted.first(count), before, options)


def _standing(before: Followed, targets: list[Target]) -> Fitted | None:
    """The template where it was, if it leaves no more over there than it usually does: a fit would only slide."""
    faces = before.reference.base.faces
    for some in (targets[-1:], targets):  # most bodies have moved by the last frame
        fitted = Fitted.of(faces, np.repeat(before.positions[None], len(some), axis=0), some)
        if fitted.residuals.max() > STILL * before.residual:
            return None
    return fitted


def _alone(ahead: Sequence[Mesh], options: EncoderOptions) -> tuple[EncodedGroup, Followed | None] | int:
    """A group with a key frame of its own, or the number of frames to try instead."""
    targets = [Target(frame) for frame in ahead]
    course = choose_key(targets, options.embedded, options.keys)
    if course.count == 0:
        return len(ahead) // 2  # no key is followed back to the first frame
    ahead, targets, key = ahead[: course.count], targets[: course.count], course.key
    lattice = options.layers.step * (LATTICE if len(ahead) > 1 else LATTICE_ALONE)
    reference = code_on_lattice(base_mesh(ahead[key], options.template), lattice, options.template.levels)
    base, faces = reference.mesh, reference.base.faces
    if base.is_empty:
        return 1 if len(ahead) > 1 else (intra_only(ahead, options), None)
    predictions = course.move(reference.base)
    guides = Guides(None, shared_detail(base.faces, len(base.vertices), reference.levels))
    fit = replace(options.fit, key=key)
    fitted = Fitted.of(faces, fit_targets(faces, predictions, targets, fit, guides), targets)
    target = target_of(ahead, options)
    if len(ahead) > 1:
        cut = cut_at(fitted.residuals / target.distance, options.groups)
        if cut is not None:
            return cut
    elif fitted.residuals[0] > options.groups.limit * target.distance:
        return intra_only(ahead, options), None
    group, followed = _coded(ahead, reference, fitted, None, options)
    return (replace(group, key=key) if group.form == Form.LAYERS else group), followed


def _coded(
    frames: Sequence[Mesh], reference: CodedReference, fit: Fitted, before: Followed | None, options: EncoderOptions
) -> tuple[EncodedGroup, Followed | None]:
    """The cheapest form of a group, and what the next may begin with."""
    encoded = encode_layers(reference, fit.positions, options.layers, before.state if before else None)
    payload, layers, decoded = _with_tails(frames, encoded, reference.base.faces, options)
    quality = measure(frames, decoded)
    group = EncodedGroup(Form.LAYERS, len(frames), payload, layers, quality, before is not None)
    if quality.distance > TOO_COARSE * target_of(frames, options).distance:
        other = laplacian(frames, reference, fit.positions, options.displacements)
        if other.quality.reaches(quality) and len(other.payload) < len(group.payload):
            group = other
    if not np.isfinite(group.quality.distance):
        return intra_only(frames, options), None  # the template has collapsed: nothing can be compared with it
    group = cheaper(frames, group, options)
    if group.form != Form.LAYERS:
        return group, None
    usual = before.residual if before else float(np.median(fit.residuals))
    return group, Followed(reference, encoded.state, fit.positions[-1], usual)


def _with_tails(
    frames: Sequence[Mesh], encoded: EncodedLayers, faces: Int32[np.ndarray, "F 3"], options: EncoderOptions
) -> tuple[bytes, tuple[int, ...], list[Mesh]]:
    """Payload, ends of its layers, and frames as decoded; with a layer of patches where that pays."""
    payload, layers = encoded.payload, encoded.layers
    found = options.tails and find_tails(frames, encoded.positions, faces, len(payload), options.tails)
    if not found:
        return payload, layers, [Mesh(positions, faces) for positions in encoded.positions]
    payload += pack(found.record)
    return payload, (*layers, len(payload)), found.frames
