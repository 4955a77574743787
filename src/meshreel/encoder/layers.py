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

from ..analysis.fit.match import FrameSurface
from ..analysis.fit.surface_fit import Fit, Guides, fit_surfaces
from ..analysis.follow.correspond import KeyMotion, choose_key, from_last
from ..analysis.follow.fused_template import fused_mesh
from ..analysis.follow.template import base_mesh, shared_detail
from ..analysis.groups import cut_at, leading
from ..coding.layers.coder import EncodedLayers, LayersState, encode_layers
from ..coding.reference_mesh import CodedReference, code_on_lattice
from ..format.layout import Form
from ..format.records import pack
from ..types import Frames, Mesh
from .forms import EncodedGroup, cheaper, empty_groups, intra_only, laplacian
from .noise import above_noise
from .options import EncoderOptions
from .progress import Stages
from .tails import find_tails
from .target import measure, target_of

LATTICE = 0.33  # spacing of the base's lattice, in steps: what it rounds away is coded again with the motion
LATTICE_ALONE = 0.8  # the same for one frame, whose base need not move
TOO_COARSE = 1.5  # targets that the layers' distance may be before the Laplacian form is tried
STILL = 1.1  # times what a template usually leaves over that it may leave where it was
SHORTEST = 4  # frames that a group predicted from the one before must follow, or a new key frame is taken


@dataclass(frozen=True, slots=True)
class Followed:
    """A template at the end of a group: what the next group may begin with."""

    reference: CodedReference
    state: LayersState  # as decoded
    positions: Float64[np.ndarray, "V 3"]  # its fit to the last frame
    residual: float  # what its fits usually leave, RMS


@dataclass(frozen=True, slots=True)
class Keyed:
    """The template of a key frame, laid onto the frames that the key's surface is followed through."""

    key: int
    reference: CodedReference
    fit: Fit


def encode_interval(frames: Frames, options: EncoderOptions, stages: Stages | None = None) -> Iterator[EncodedGroup]:
    """The groups of a segment, frames all empty or none is; only those of one group are held at a time."""
    stages, options = stages or Stages(None, len(frames)), above_noise(options)
    if frames[0].is_empty:
        for group in empty_groups(len(frames)):
            stages.add("code", group.frame_count)
            yield group
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
    targets = [FrameSurface(frame) for frame in ahead]
    if before is not None and options.predict:
        continued = _continued(ahead, targets, before, options)
        if continued is not None:
            return continued
    return _alone(ahead, targets, options)


def _continued(
    ahead: Sequence[Mesh], targets: list[FrameSurface], before: Followed, options: EncoderOptions
) -> tuple[EncodedGroup, Followed | None] | None:
    """A group predicted from the one before, as long as its template fits; None where that is not long."""
    base = before.reference.base
    still = _standing(before, targets, options)
    if still is not None:
        return _coded(ahead, before.reference, still, before, options)
    predictions = from_last(Mesh(before.positions, base.faces), targets, options.embedded)
    targets = targets[: len(predictions)]
    if len(targets) < min(SHORTEST, len(ahead)):
        return None
    levels = before.reference.levels
    guides = Guides(before.positions, shared_detail(before.state.faces, len(before.state.base), levels))
    fit = Fit.at(base.faces, fit_surfaces(base.faces, predictions, targets, options.fit, guides), targets)
    target = target_of(ahead, options.target, options.noise).distance
    count = leading(_residuals(fit, options) / target, before.residual / target, options.groups)
    if count < min(SHORTEST, len(ahead)):
        return None
    return _coded(ahead[:count], before.reference, fit.first(count), before, options)


def _standing(before: Followed, targets: list[FrameSurface], options: EncoderOptions) -> Fit | None:
    """The template where it was, if it leaves no more over there than it usually does: a fit would only slide."""
    faces = before.reference.base.faces
    for some in (targets[-1:], targets):  # most bodies have moved by the last frame
        fit = Fit.at(faces, np.repeat(before.positions[None], len(some), axis=0), some)
        if _residuals(fit, options).max() > STILL * before.residual:
            return None
    return fit


def _alone(
    ahead: Sequence[Mesh], targets: list[FrameSurface], options: EncoderOptions
) -> tuple[EncodedGroup, Followed | None]:
    """A group with a key frame of its own, as long as its template fits; by Draco, the first frame that none fits."""
    count = len(ahead)
    while True:
        motion = _key_motion(targets[:count], options)
        frames = ahead[: motion.count]
        keyed = _keyed(frames, targets[: motion.count], motion, options)
        count = _fitted(frames, keyed, options)
        if count == len(frames) and keyed is not None:
            group, followed = _coded(frames, keyed.reference, keyed.fit, None, options)
            return (replace(group, key=keyed.key) if group.form == Form.LAYERS else group), followed
        if count == 0:
            return intra_only(frames, options), None


def _key_motion(targets: list[FrameSurface], options: EncoderOptions) -> KeyMotion:
    """The way of a key frame's surface through the first of these frames: as many as some key is followed back from."""
    while (motion := choose_key(targets, options.embedded, options.keys)).count == 0:
        targets = targets[: len(targets) // 2]
    return motion


def _keyed(
    frames: Sequence[Mesh], targets: list[FrameSurface], motion: KeyMotion, options: EncoderOptions
) -> Keyed | None:
    """The template of the motion's key and its fit to the frames; None where nothing is left of its base mesh.

    That fused from all frames where there is noise; else the key frame's own, or the fused one where only that fits.
    """
    if options.noise > 0:
        return _laid(targets, motion, True, options) or _laid(targets, motion, False, options)
    own = _laid(targets, motion, False, options)
    if own is None or len(frames) == 1 or _fitted(frames, own, options) == len(frames):
        return own
    fused = _laid(targets, motion, True, options)
    return own if fused is None else min(own, fused, key=lambda one: float(np.mean(one.fit.by_area**2)))


def _laid(targets: list[FrameSurface], motion: KeyMotion, fuse: bool, options: EncoderOptions) -> Keyed | None:
    """A base mesh of the key frame's surface, or of the fused one, laid onto the frames; None where nothing is left."""
    key = targets[motion.key].mesh
    surface = fused_mesh(motion.motion, targets, options.noise, options.fused) if fuse else key
    if surface.is_empty:
        return None
    lattice = options.layers.step * (LATTICE if len(targets) > 1 else LATTICE_ALONE)
    reference = code_on_lattice(base_mesh(surface, options.template), lattice, options.template.levels)
    base, faces = reference.mesh, reference.base.faces
    if base.is_empty:
        return None
    detail = shared_detail(base.faces, len(base.vertices), reference.levels)
    template, rest = reference.base, None
    if fuse:
        rest = fit_surfaces(faces, template.vertices[None], [FrameSurface(surface)], options.fit)[0]
        template = Mesh(rest, faces)
    fit = replace(options.fit, key=motion.key)
    positions = fit_surfaces(faces, motion.move(template), targets, fit, Guides(rest, detail))
    return Keyed(motion.key, reference, Fit.at(faces, positions, targets))


def _residuals(fit: Fit, options: EncoderOptions) -> Float64[np.ndarray, " T"]:
    """What a fit leaves over of each frame; holes of noisy frames are no reason for another template."""
    return fit.by_area if options.noise == 0 else fit.common


def _fitted(frames: Sequence[Mesh], keyed: Keyed | None, options: EncoderOptions) -> int:
    """How many of the first frames a key frame should be looked for in: all where the template fits, 0 for no more."""
    if keyed is None:
        return 1 if len(frames) > 1 else 0
    residuals, target = _residuals(keyed.fit, options), target_of(frames, options.target, options.noise).distance
    if len(frames) == 1:
        return 0 if residuals[0] > options.groups.limit * target else 1
    cut = cut_at(residuals / target, options.groups)
    return len(frames) if cut is None else cut


def _coded(
    frames: Sequence[Mesh], reference: CodedReference, fit: Fit, before: Followed | None, options: EncoderOptions
) -> tuple[EncodedGroup, Followed | None]:
    """The cheapest form of a group, and what the next may begin with."""
    encoded = encode_layers(reference, fit.positions, options.layers, before.state if before else None)
    payload, layers, decoded = _with_tails(frames, encoded, reference.base.faces, options)
    fidelity = measure(frames, decoded)
    group = EncodedGroup(Form.LAYERS, len(frames), payload, layers, fidelity, before is not None)
    if (
        options.noise == 0
        and fidelity.distance > TOO_COARSE * target_of(frames, options.target, options.noise).distance
    ):
        other = laplacian(frames, reference, fit.positions, options.displacements)
        if other.fidelity.reaches(fidelity) and len(other.payload) < len(group.payload):
            group = other
    if not np.isfinite(group.fidelity.distance):
        return intra_only(frames, options), None  # the template has collapsed: nothing can be compared with it
    group = cheaper(frames, group, options)
    if group.form != Form.LAYERS:
        return group, None
    usual = before.residual if before else float(np.median(_residuals(fit, options)))
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
