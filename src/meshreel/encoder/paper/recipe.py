"""The paper's recipe: an interval of frames is tracked, fitted to one reference, cut where the fit fails, and coded.

In -> out: frames in normalised coordinates -> groups with their fidelity (paper, sections 3.1 and 3.3). An interval
needs no other frames, so intervals can be spread over processes.

Differs from the paper: groups are not all of one length, and frames that no reference follows are coded one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal

import numpy as np
from jaxtyping import Float64

from ... import _core
from ...analysis.fit.surface_fit import FitOptions, fit_frames, snap_to_vertices
from ...analysis.plan import cut_at
from ...analysis.reference.extraction import MDS, PoseChoice, ReferenceOptions, extract_reference, predict
from ...analysis.reference.track import TrackOptions, track_centers
from ...coding.mesh import CodedReference, code_reference
from ...coding.paper.displacements import DisplacementOptions, encode_laplacian
from ...errors import NoReferenceError
from ...format.budget import CostlyError
from ...format.layout import Form
from ...types import Centers, Mesh
from ..group.digests import note
from ..group.forms import (
    NORMALISED,
    EncodedGroup,
    IntraOptions,
    Target,
    cheaper,
    empty_groups,
    intra_only,
    measure,
    target_of,
)
from ..group.interval import Interval, check_group_size

REFERENCE_BITS = 14  # of the reference's lattice (paper: qp = 14)
LEVELS = 1  # midpoint subdivisions of the decoded reference (decision 10)
DEPTH = 1  # nested cuts at most; frames that are lost after them are coded one by one (guess)
PLAIN_ZONE = 0.5  # of a step: rounding to the nearest symbol, as the paper has it
PLAIN_OFFSETS = (0,)  # the same step for all components, as the paper has it


@dataclass(frozen=True, slots=True)
class PaperOptions:
    """Options of `PaperRecipe`; the defaults are those of quality 50.

    The first three, and the offsets and dead zone of `displacements`, say where the recipe is better than the paper's
    words, or does as they say (preset `paper-literal`).
    """

    pose: PoseChoice = "fit"  # of the reference
    fit: Literal["surface", "nearest"] = "surface"  # of the reference: to the surface; to the frames' nearest vertices
    cuts: bool = True  # groups in two where a reference does not follow, then Draco; False: one group always

    group_size: int = 10  # most frames in a group, the paper's GoF
    target: Target = Target(0.0005, 7.0, 0.0008)  # that every frame should reach, relative to its own diagonal
    track: TrackOptions = field(default_factory=TrackOptions)
    reference: ReferenceOptions = field(default_factory=ReferenceOptions)
    displacements: DisplacementOptions = field(default_factory=DisplacementOptions)
    intra: IntraOptions = field(default_factory=IntraOptions)

    def __post_init__(self) -> None:
        check_group_size(self.group_size)


@dataclass(frozen=True, slots=True)
class Fitted:
    """A reference that follows the frames of a group, and its positions in each."""

    reference: CodedReference
    positions: Float64[np.ndarray, "T V 3"]  # of its base's vertices, normalised
    canonical: bool = False  # whether it lies in the pose of eq. 5


@dataclass(frozen=True, slots=True)
class FoundGroup:
    """Frames that become one group, with the reference that follows them."""

    frames: Sequence[Mesh]
    fitted: Fitted | None  # None: no reference follows them


FindGroups = Callable[[Interval, PaperOptions], list[FoundGroup]]


def find_groups(interval: Interval, options: PaperOptions) -> list[FoundGroup]:
    """Cut an interval into groups that one reference follows each, or none does; every frame has a surface.

    The interval is cut where the fit fails, `DEPTH` times at most.
    """
    frames = list(interval.frames)
    if len(frames) == 1:
        return [FoundGroup(frames, None)]
    centers = track_centers(frames, options.track)
    note("centers", centers.positions)
    return _Cutting(options, interval.noise).groups(frames, centers, DEPTH)


@dataclass(frozen=True, slots=True)
class PaperRecipe:
    """The paper's recipe; `find` may keep what it found, so that references of an earlier encode are used again."""

    options: PaperOptions
    find: FindGroups = find_groups

    bodies_apart: ClassVar[bool] = False
    judged: ClassVar[bool] = False  # its errors are the paper's, for comparisons

    def finer(self) -> PaperRecipe:
        """Return the same: the paper knows no other way."""
        return self

    @property
    def name(self) -> str:
        """The name of the preset: `paper-literal` if every step follows the paper's words."""
        o = self.options
        plain = (o.displacements.dead_zone, o.displacements.offsets) == (PLAIN_ZONE, PLAIN_OFFSETS)
        return "paper-literal" if plain and (o.pose, o.fit, o.cuts) == ("mds", "nearest", False) else "paper"

    def longest(self, frame_rate: float) -> int:
        """Return the number of frames in a group, at any rate: an interval is one group."""
        del frame_rate
        return self.options.group_size

    def encode(self, interval: Interval) -> Iterator[EncodedGroup]:
        """Yield an interval as one group, or as several where one reference cannot follow."""
        if interval.frames[0].is_empty:
            yield from empty_groups(len(interval.frames))
            return
        for found in self.find(interval, self.options):
            yield from _encode_group(found, self.options, interval.noise)


def analyze(
    frames: Sequence[Mesh], centers: Centers, options: PaperOptions, again: bool = False
) -> tuple[Fitted, Float64[np.ndarray, " T"]]:
    """Return the fitted reference of a group, as decoded, and each frame's residual (paper, sections 3.3.1 and 3.3.2).

    Fewer poses are tried `again`, of a part of frames that were one group. Raises NoReferenceError where no surface can
    be made of the frames.
    """
    reference = extract_reference(frames, centers, options.reference, options.pose, again)
    if reference.mesh.is_empty:
        raise NoReferenceError("no surface is common to the frames")
    coded = code_reference(reference.mesh, REFERENCE_BITS, LEVELS)
    if coded.base.is_empty:
        raise NoReferenceError("the reference mesh has no faces left after Draco")
    predictions = predict(reference, coded.base, centers)
    if options.fit == "nearest":
        fit = snap_to_vertices(coded.base.faces, predictions, frames)
    else:
        fit = fit_frames(coded.base.faces, predictions, frames, FitOptions(), reference.key)
    return Fitted(coded, fit.positions, reference.frame == MDS), fit.residuals


@dataclass(frozen=True, slots=True)
class _Cutting:
    """Division of an interval into groups."""

    options: PaperOptions
    noise: float
    again: bool = False  # the frames are a part of some that were one group

    def groups(self, frames: Sequence[Mesh], centers: Centers, depth: int) -> list[FoundGroup]:
        """Cut frames as `find_groups` does, from tracked centers; `depth` times at most."""
        options = self.options
        if len(frames) == 1:
            return [FoundGroup(frames, None)]
        try:
            fitted, residuals = analyze(frames, centers, options, self.again)
        except NoReferenceError:
            return [FoundGroup(frames, None)]
        note("reference, coded", fitted.reference.base.vertices, fitted.reference.base.faces)
        note("fit", fitted.positions)
        cut = cut_at(residuals / target_of(frames, options.target, self.noise).distance)
        if cut is None or not options.cuts:
            return [FoundGroup(frames, fitted)]
        if depth == 0:
            return [FoundGroup(frames, None)]
        head, tail = frames[:cut], frames[cut:]
        known = replace(centers, positions=centers.positions[:cut])
        retracked = track_centers(tail, options.track)  # centers that were lost before the cut would spoil the tail
        parts = replace(self, again=True)
        return [*parts.groups(head, known, depth - 1), *parts.groups(tail, retracked, depth - 1)]


def _encode_group(found: FoundGroup, options: PaperOptions, noise: float) -> Iterator[EncodedGroup]:
    """Yield a group in the cheaper of both forms, or in the only one it can have; its halves where bytes are few."""
    frames = found.frames
    if found.fitted is not None:
        with suppress(CostlyError):
            group = laplacian(frames, found.fitted.reference, found.fitted.positions, options.displacements)
            is_fixed = options.displacements.basis_size is not None or not options.cuts
            group = group if is_fixed else cheaper(frames, group, options.intra)
            yield replace(group, canonical=found.fitted.canonical and group.form == Form.LAPLACIAN)
            return
    while frames:
        group = intra_only(frames, target_of(frames, options.target, noise), options.intra)
        yield group
        frames = frames[group.frame_count :]


def laplacian(
    frames: Sequence[Mesh],
    reference: CodedReference,
    positions: Float64[np.ndarray, "T V 3"],
    options: DisplacementOptions,
) -> EncodedGroup:
    """Encode a group in the `laplacian` form. Raises CostlyError where readers would refuse it."""
    try:
        payload, layers = encode_laplacian(reference, displacement_field(reference, positions), options)
    except ValueError as error:  # least squares that are singular, or whose elimination fills in
        raise CostlyError(f"laplacian: {error}") from error
    decoded = _core.Group(payload, len(frames), None, None, NORMALISED)
    fidelity = measure(frames, [Mesh(*arrays) for arrays in decoded.frames()])
    return EncodedGroup(Form.LAPLACIAN, len(frames), payload, layers, fidelity)


def displacement_field(
    reference: CodedReference, positions: Float64[np.ndarray, "T V 3"]
) -> Float64[np.ndarray, "V T 3"]:
    """Return the offsets of a reference's vertices to their positions in each frame (paper, section 3.3.2)."""
    return np.ascontiguousarray(np.moveaxis(positions, 0, 1) - reference.base.vertices[:, None])
