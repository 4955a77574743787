"""The paper's recipe: an interval of frames is tracked, fitted to one reference, cut where the fit fails, and coded.

In -> out: frames in normalised coordinates -> groups with their fidelity (paper, sections 3.1 and 3.3). An interval
needs no other frames, so intervals can be spread over processes.

Differs from the paper: groups are not all of one length, and frames that no reference follows are coded one by one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from jaxtyping import Float64

from ...analysis.fit.surface_fit import Fit, FitOptions, Guides, fit_frames, snap_to_vertices
from ...analysis.plan import cut_at
from ...analysis.reference.extraction import MDS, extract_reference, predict
from ...analysis.reference.track import track_centers
from ...coding.group import decode_group
from ...coding.paper.displacements import DisplacementOptions
from ...coding.paper.group import encode_laplacian
from ...coding.reference_mesh import CodedReference, code_reference
from ...errors import NoReferenceError
from ...format.budget import CostlyError
from ...format.layout import Form
from ...types import Centers, Mesh
from ..group.digests import note
from ..group.forms import EncodedGroup, cheaper, empty_groups, intra_only
from ..group.interval import Interval
from ..group.progress import Stages
from ..group.target import measure, target_of
from .options import PaperOptions

REFERENCE_BITS = 14  # of the reference's lattice (paper: qp = 14)
LEVELS = 1  # midpoint subdivisions of the decoded reference (decision 10)
DEPTH = 1  # nested cuts at most; frames that are lost after them are coded one by one (guess)


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


FindGroups = Callable[[Interval, PaperOptions, "Stages | None"], list[FoundGroup]]


def find_groups(interval: Interval, options: PaperOptions, stages: Stages | None = None) -> list[FoundGroup]:
    """Cut an interval into groups that one reference follows each, or none does; every frame has a surface.

    The interval is cut where the fit fails, `DEPTH` times at most.
    """
    frames = list(interval.frames)
    stages = stages or Stages(None, len(frames))
    if len(frames) == 1:
        return [FoundGroup(frames, None)]
    centers = track_centers(frames, options.track)
    note("centers", centers.positions)
    stages.add("track", len(frames))
    return _Cutting(options, interval.noise).groups(frames, centers, DEPTH, stages)


@dataclass(frozen=True, slots=True)
class PaperRecipe:
    """The paper's recipe; `find` may keep what it found, so that references of an earlier encode are used again."""

    options: PaperOptions
    find: FindGroups = find_groups

    bodies_apart: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """The name of the preset."""
        return "paper-literal" if self.options.is_literal else "paper"

    @property
    def group_size(self) -> int:
        """The largest number of frames in a group, the paper's GoF."""
        return self.options.group_size

    def longest(self, frame_rate: float) -> int:
        """Return the number of frames in a group, at any rate: an interval is one group."""
        del frame_rate
        return self.options.group_size

    def encode(self, interval: Interval, stages: Stages | None = None) -> Iterator[EncodedGroup]:
        """Yield an interval as one group, or as several where one reference cannot follow."""
        count = len(interval.frames)
        stages = stages or Stages(None, count)
        if interval.frames[0].is_empty:
            yield from empty_groups(count)
        else:
            for found in self.find(interval, self.options, stages):
                yield from _encode_group(found, self.options, interval.noise)
        stages.add("code", count)


def analyze(
    frames: Sequence[Mesh], centers: Centers, options: PaperOptions, stages: Stages, again: bool = False
) -> tuple[Fitted, Float64[np.ndarray, " T"]]:
    """Return the fitted reference of a group, as decoded, and each frame's residual (paper, sections 3.3.1 and 3.3.2).

    Fewer poses are tried `again`, of a part of frames that were one group. Raises NoReferenceError where no surface can
    be made of the frames.
    """
    reference = extract_reference(frames, centers, options.reference, options.pose == "mds", again)
    if reference.mesh.is_empty:
        raise NoReferenceError("no surface is common to the frames")
    stages.add("reference", len(frames))
    coded = code_reference(reference.mesh, REFERENCE_BITS, LEVELS)
    if coded.base.is_empty:
        raise NoReferenceError("the reference mesh has no faces left after Draco")
    predictions = predict(reference, coded.base, centers)
    fit = _fit(coded, predictions, frames, options, reference.key)
    stages.add("fit", len(frames))
    return Fitted(coded, fit.positions, reference.frame == MDS), fit.residuals


def _fit(
    coded: CodedReference,
    predictions: Float64[np.ndarray, "T V 3"],
    frames: Sequence[Mesh],
    options: PaperOptions,
    key: int,
) -> Fit:
    if options.fit == "nearest":
        return snap_to_vertices(coded.base.faces, predictions, frames)
    return fit_frames(coded.base.faces, predictions, frames, FitOptions(), Guides(key=key))


@dataclass(frozen=True, slots=True)
class _Cutting:
    """Division of an interval into groups."""

    options: PaperOptions
    noise: float
    again: bool = False  # the frames are a part of some that were one group

    def groups(self, frames: Sequence[Mesh], centers: Centers, depth: int, stages: Stages) -> list[FoundGroup]:
        """Cut frames as `find_groups` does, from tracked centers; `depth` times at most."""
        options = self.options
        if len(frames) == 1:
            return [FoundGroup(frames, None)]
        try:
            fitted, residuals = analyze(frames, centers, options, stages, self.again)
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
        again = Stages(None, len(frames))  # these frames have been through the stages once
        return [*parts.groups(head, known, depth - 1, again), *parts.groups(tail, retracked, depth - 1, again)]


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
    fidelity = measure(frames, decode_group(payload, len(frames)))
    return EncodedGroup(Form.LAPLACIAN, len(frames), payload, layers, fidelity)


def displacement_field(
    reference: CodedReference, positions: Float64[np.ndarray, "T V 3"]
) -> Float64[np.ndarray, "V T 3"]:
    """Return the offsets of a reference's vertices to their positions in each frame (paper, section 3.3.2)."""
    return np.ascontiguousarray(np.moveaxis(positions, 0, 1) - reference.base.vertices[:, None])
