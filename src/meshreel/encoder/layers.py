"""The recipe of layers: a key frame's base mesh follows the other frames of an interval for as long as it can.

In -> out: an interval, whose frames are read in order -> groups with their fidelity. The first group of an interval
stands alone; the next ones are predicted from the one before while its template still fits. Frames that no template
follows are coded one by one.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float64, Int32

from ..analysis.fit.frame import FrameSurface
from ..analysis.fit.surface_fit import Fit, Guides, fit_surfaces
from ..analysis.follow.correspond import KeyMotion, choose_key, from_last
from ..analysis.follow.fused_template import fused_mesh
from ..analysis.follow.template import base_mesh, shared_detail
from ..analysis.groups import cut_at, leading
from ..coding.layers.coder import EncodedLayers, LayersState, encode_layers
from ..coding.reference_mesh import CodedReference, code_on_lattice
from ..format.budget import CostlyError
from ..format.layout import Form
from ..format.records import pack
from ..types import Mesh
from .digests import Digests, note
from .forms import EncodedGroup, cheaper, empty_groups, intra_only, laplacian
from .interval import Interval
from .options import LayersOptions
from .progress import Stages
from .tails import find_tails
from .target import Fidelity, measure, target_of

LATTICE = 0.33  # spacing of the base's lattice, in steps: the motion codes what it rounds away (decision 0014)
LATTICE_ALONE = 0.8  # the same for a single frame, whose base need not move (decision 0014)
TOO_COARSE = 1.5  # targets that the layers' distance may reach before the Laplacian form is tried (guess)
STILL = 1.1  # times its usual residual that a template may leave without a new fit (guess)
SHORTEST = 4  # frames, at least, of a group predicted from the one before; else a new key is taken (decision 0015)


@dataclass(frozen=True, slots=True)
class Ahead:
    """The frames that a group may have, prepared for matching, and their noise."""

    surfaces: list[FrameSurface]
    noise: float  # RMS distance of the frames from the truth, normalised
    digests: Digests | None = None

    @property
    def frames(self) -> list[Mesh]:
        """The frames themselves."""
        return [surface.mesh for surface in self.surfaces]

    def __len__(self) -> int:
        return len(self.surfaces)

    def first(self, count: int) -> Ahead:
        """Return the first `count` frames."""
        return replace(self, surfaces=self.surfaces[:count])

    def target(self, options: LayersOptions) -> Fidelity:
        """Return the fidelity that these frames should reach, normalised."""
        return target_of(self.frames, options.target, self.noise)

    def residuals(self, fit: Fit) -> Float64[np.ndarray, " T"]:
        """Return the residuals that decide on a fit; holes of noisy frames are no reason for another template."""
        return fit.by_area if self.noise == 0 else fit.common


@dataclass(frozen=True, slots=True)
class Followed:
    """The template at the end of a group, from which the next group may be predicted."""

    reference: CodedReference
    state: LayersState  # as decoded
    positions: Float64[np.ndarray, "V 3"]  # its fit to the last frame
    residual: float  # usual residual of its fits, RMS


@dataclass(frozen=True, slots=True)
class Keyed:
    """The template of a key frame, fitted to the frames through which the key's surface is followed."""

    key: int
    reference: CodedReference
    fit: Fit


def encode_interval(interval: Interval, options: LayersOptions, stages: Stages | None = None) -> Iterator[EncodedGroup]:
    """Yield the groups of an interval; only the frames of one group are in memory at a time."""
    frames = interval.frames
    stages = stages or Stages(None, len(frames))
    if frames[0].is_empty:
        for group in empty_groups(len(frames)):
            stages.add("code", group.frame_count)
            yield group
        return
    at, before = 0, None
    while at < len(frames):
        numbers = range(at, min(at + options.group_size, len(frames)))
        ahead = Ahead([FrameSurface(frames[k]) for k in numbers], interval.noise, interval.digests)
        note(ahead.digests, "frames", *(array for mesh in ahead.frames for array in (mesh.vertices, mesh.faces)))
        group, before = _next_group(ahead, before, options)
        stages.add("code", group.frame_count)
        at += group.frame_count
        yield group


def _next_group(ahead: Ahead, before: Followed | None, options: LayersOptions) -> tuple[EncodedGroup, Followed | None]:
    """Encode the group that begins with the first of these frames."""
    if before is not None and options.predict:
        continued = _continued(ahead, before, options)
        if continued is not None:
            return continued
    return _alone(ahead, options)


def _continued(ahead: Ahead, before: Followed, options: LayersOptions) -> tuple[EncodedGroup, Followed | None] | None:
    """Encode a group predicted from the one before, as long as its template fits; None where that is not long."""
    base = before.reference.base
    still = _standing(ahead, before)
    if still is not None:
        return _coded(ahead, before.reference, still, before, options)
    predictions = from_last(Mesh(before.positions, base.faces), ahead.surfaces, options.embedded, ahead.noise)
    note(ahead.digests, "tracked from the group before", predictions)
    followed = ahead.first(len(predictions))
    if len(followed) < min(SHORTEST, len(ahead)):
        return None
    detail = shared_detail(before.state.faces, len(before.state.base), before.reference.levels)
    guides = Guides(before.positions, detail, noise=ahead.noise)
    positions = fit_surfaces(base.faces, predictions, followed.surfaces, options.fit, guides)
    fit = Fit.at(base.faces, positions, followed.surfaces)
    target = ahead.target(options).distance
    count = leading(ahead.residuals(fit) / target, before.residual / target, options.groups)
    if count < min(SHORTEST, len(ahead)):
        return None
    return _coded(ahead.first(count), before.reference, fit.first(count), before, options)


def _standing(ahead: Ahead, before: Followed) -> Fit | None:
    """Return the template where it was, if its residual there is hardly larger than usual: a fit would only slide."""
    faces = before.reference.base.faces
    for some in (ahead.surfaces[-1:], ahead.surfaces):  # most bodies have moved by the last frame
        fit = Fit.at(faces, np.repeat(before.positions[None], len(some), axis=0), some)
        if ahead.residuals(fit).max() > STILL * before.residual:
            return None
    return fit


def _alone(ahead: Ahead, options: LayersOptions) -> tuple[EncodedGroup, Followed | None]:
    """Encode a group with its own key frame, as long as its template fits; by Draco, one frame that none fits."""
    count = len(ahead)
    while True:
        motion = _key_motion(ahead.first(count), options)
        group = ahead.first(motion.count)
        note(group.digests, "key and motion", motion.key, motion.motion.positions, motion.motion.residuals)
        keyed = _keyed(group, motion, options)
        count = _fitted(group, keyed, options)
        if count == len(group) and keyed is not None:
            encoded, followed = _coded(group, keyed.reference, keyed.fit, None, options)
            is_keyed = encoded.form == Form.LAYERS and keyed.key < encoded.frame_count
            return (replace(encoded, key=keyed.key) if is_keyed else encoded), followed
        if count == 0:
            return intra_only(group.frames, group.target(options), options.intra), None


def _key_motion(ahead: Ahead, options: LayersOptions) -> KeyMotion:
    """Return the motion of a key frame's surface through the first frames; fewer where no key is followed back."""
    while (motion := choose_key(ahead.surfaces, options.embedded, options.keys, ahead.noise)).count == 0:
        ahead = ahead.first(len(ahead) // 2)
    return motion


def _keyed(group: Ahead, motion: KeyMotion, options: LayersOptions) -> Keyed | None:
    """Return the key's template and its fit to the frames; None where nothing is left of its base mesh.

    With noise, the template is fused from all frames; else it is the key frame's, or the fused one where only that
    fits.
    """
    if group.noise > 0:
        return _laid(group, motion, True, options) or _laid(group, motion, False, options)
    own = _laid(group, motion, False, options)
    if own is None or len(group) == 1 or _fitted(group, own, options) == len(group):
        return own
    fused = _laid(group, motion, True, options)
    return own if fused is None else min(own, fused, key=lambda one: float(np.mean(one.fit.by_area**2)))


def _laid(group: Ahead, motion: KeyMotion, fuse: bool, options: LayersOptions) -> Keyed | None:
    """Fit a base mesh of the key frame's surface, or of the fused one, to the frames; None where nothing is left."""
    surfaces, noise = group.surfaces, group.noise
    surface = fused_mesh(motion.motion, surfaces, noise, options.fused) if fuse else surfaces[motion.key].mesh
    if surface.is_empty:
        return None
    lattice = options.layers.step_above(noise) * (LATTICE if len(group) > 1 else LATTICE_ALONE)
    reference = code_on_lattice(base_mesh(surface, options.template, noise), lattice, options.template.levels)
    base, faces = reference.mesh, reference.base.faces
    note(group.digests, "template, coded", reference.base.vertices, reference.base.faces)
    if base.is_empty:
        return None
    detail = shared_detail(base.faces, len(base.vertices), reference.levels)
    template, rest = reference.base, None
    if fuse:
        alone = Guides(noise=noise)
        rest = fit_surfaces(faces, template.vertices[None], [FrameSurface(surface)], options.fit, alone)[0]
        template = Mesh(rest, faces)
    guides = Guides(rest, detail, motion.key, noise)
    positions = fit_surfaces(faces, motion.move(template), surfaces, options.fit, guides)
    return Keyed(motion.key, reference, Fit.at(faces, positions, surfaces))


def _fitted(group: Ahead, keyed: Keyed | None, options: LayersOptions) -> int:
    """Return how many of the first frames to look for a key in: all where the template fits, 0 to give up."""
    if keyed is None:
        return 1 if len(group) > 1 else 0
    residuals, target = group.residuals(keyed.fit), group.target(options).distance
    if len(group) == 1:
        return 0 if residuals[0] > options.groups.limit * target else 1
    cut = cut_at(residuals / target, options.groups)
    return len(group) if cut is None else cut


def _coded(
    group: Ahead, reference: CodedReference, fit: Fit, before: Followed | None, options: LayersOptions
) -> tuple[EncodedGroup, Followed | None]:
    """Encode a group in its cheapest form; the template that the next may begin with is the second value.

    Where its bytes may not hold so many frames, it has only the first of them.
    """
    frames, previous = group.frames, before.state if before else None
    note(group.digests, "fit", fit.positions)
    try:
        encoded = encode_layers(reference, fit.positions, options.layers, previous, group.noise)
    except CostlyError:
        if len(group) == 1:
            return intra_only(frames, group.target(options), options.intra), None
        half = len(group) // 2
        return _coded(group.first(half), reference, fit.first(half), before, options)
    note(group.digests, "fields and symbols", encoded.payload)
    shown = _with_tails(group, encoded, reference.base.faces, options)
    note(group.digests, "patches", shown.payload[len(encoded.payload) :])
    fidelity = measure(frames, shown.frames)
    note(group.digests, "fidelity", fidelity)
    chosen = EncodedGroup(Form.LAYERS, len(frames), shown.payload, shown.layers, fidelity, before is not None)
    target = group.target(options)
    if group.noise == 0 and fidelity.distance > TOO_COARSE * target.distance:
        with suppress(CostlyError):
            other = laplacian(frames, reference, fit.positions, options.displacements)
            if other.fidelity.reaches(fidelity) and len(other.payload) < len(chosen.payload):
                chosen = other
    if not np.isfinite(chosen.fidelity.distance):
        return intra_only(frames, target, options.intra), None  # the template has collapsed: nothing is comparable
    chosen = cheaper(frames, chosen, options.intra)
    if chosen.form != Form.LAYERS:
        return chosen, None
    usual = before.residual if before else float(np.median(group.residuals(fit)))
    return chosen, Followed(reference, encoded.state, fit.positions[-1], usual)


@dataclass(frozen=True, slots=True)
class _Shown:
    """A payload of layers, and the frames that it decodes to."""

    payload: bytes
    layers: tuple[int, ...]  # where each ends
    frames: list[Mesh]


def _with_tails(
    group: Ahead, encoded: EncodedLayers, faces: Int32[np.ndarray, "F 3"], options: LayersOptions
) -> _Shown:
    """Return the encoded layers, with a layer of patches where that pays."""
    payload, layers = encoded.payload, encoded.layers
    decoded = [Mesh(positions, faces) for positions in encoded.positions]
    if options.tails is None:
        return _Shown(payload, layers, decoded)
    found = find_tails(group.frames, decoded, len(payload), options.tails, noise=group.noise)
    if found is None:
        return _Shown(payload, layers, decoded)
    payload += pack(found.record)
    return _Shown(payload, (*layers, len(payload)), found.frames)
