"""Metadata of files that are joined, cut or scaled; by exact totals, parts give the means of one encode."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass
from itertools import accumulate
from typing import Any

from ..format.edit import ITEM
from ..format.view import ITEM as VIEW
from ..types import Up

HISTORY = "history"  # of an edited file: its edits, in words
PART = "part"  # of a part: its place in the sequence, its exact totals, and a digest of its options
LAST = "last_interval"  # of a cut whose frames are not even: microseconds from its last frame to what came next
KEYS = "key_frames"
CANONICAL = "canonical_references"
LEAST_COVERED = "least_covered"  # a share of a frame's surface, the track, and the frame
GUESSED = "guessed_m2"  # area of a background's surface that nobody saw, where planes go on through holes
MEANS = ("rms_m", "worst_rms_m", "d2_psnr_paper", "normal_error_deg")
_OF_GROUPS = (KEYS, CANONICAL, LEAST_COVERED, *MEANS)
_SHARED = ("preset", "quality", "noise_m", GUESSED, "up")  # that files are joined by
RECORDED = (*_OF_GROUPS, *_SHARED)  # by an encoder


@dataclass(frozen=True, slots=True)
class Totals:
    """Sums over frames, from which the means in the metadata are made."""

    frames: int
    squares: float  # m^2, of the distance
    worst: float  # m, the largest
    psnr: float  # dB
    angle: float  # degrees

    @staticmethod
    def added(parts: Sequence[Totals]) -> Totals:
        """Return the totals of all parts; sums are exact before they are rounded once."""
        frames, squares, worst, psnr, angle = zip(*map(astuple, parts), strict=True)
        return Totals(sum(frames), math.fsum(squares), max(worst), math.fsum(psnr), math.fsum(angle))

    @staticmethod
    def from_metadata(metadata: dict[str, Any], frames: int) -> Totals:
        """Return the totals of a file; of no part, by rounded means. Raises KeyError, TypeError or ValueError."""
        if PART in metadata:
            return Totals(frames, *map(_number, metadata[PART]["totals"]))
        rms, worst, psnr, angle = (_number(metadata[name]) for name in MEANS)
        return Totals(frames, frames * rms**2, worst, frames * psnr, frames * angle)

    @property
    def exact(self) -> list[float | None]:
        """The exact sums, for JSON."""
        return [value if math.isfinite(value) else None for value in astuple(self)[1:]]

    @property
    def means(self) -> dict[str, float | None]:
        """The means by their names, rounded."""
        root = (self.squares / self.frames) ** 0.5
        values = (root, self.worst, self.psnr / self.frames, self.angle / self.frames)
        return {name: shortened(value) for name, value in zip(MEANS, values, strict=True)}


def joined_metadata(parts: Sequence[tuple[dict[str, Any], int]]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the metadata of a whole from those of its parts and their numbers of frames; and tags that differ.

    Key frames and means are joined where all parts have them: scenes have none, and cuts no means. Raises KeyError,
    TypeError, ValueError or OverflowError for metadata that no encoder wrote.
    """
    dropped = {PART, ITEM, LAST} | {name for name in _OF_GROUPS if not all(name in metadata for metadata, _ in parts)}
    every = (item for metadata, _ in reversed(parts) for item in metadata.items())  # of several tags the first counts
    found = {name: value for name, value in every if name not in dropped}
    firsts = accumulate((frames for _, frames in parts), initial=0)  # the last is the number of all frames
    placed = [(first, metadata) for first, (metadata, _) in zip(firsts, parts, strict=False)]
    if KEYS in found:
        found[KEYS] = [first + key for first, metadata in placed for key in metadata[KEYS]]
    if LEAST_COVERED in found:
        each = [(first, *_least(metadata[LEAST_COVERED])) for first, metadata in placed]
        found[LEAST_COVERED] = min([share, track, first + frame] for first, share, track, frame in each)
    if CANONICAL in found:
        found[CANONICAL] = sum(metadata[CANONICAL] for metadata, _ in parts)
    if all(name in found for name in MEANS):
        found |= Totals.added([Totals.from_metadata(metadata, frames) for metadata, frames in parts]).means
    differing = {name for metadata, _ in parts for name in tags_of(metadata) if metadata[name] != found[name]}
    return found | {name: value for name, value in parts[-1][0].items() if name == LAST}, tuple(sorted(differing))


def tags_of(metadata: dict[str, Any]) -> set[str]:
    """Return the names of metadata that users gave, but for the first view, of which a guess is no loss."""
    return metadata.keys() - {PART, ITEM, HISTORY, LAST, VIEW, *RECORDED}


def scaled_metadata(metadata: dict[str, Any], scale: float) -> dict[str, Any]:
    """Return the metadata of scaled frames, whose units are metres. Raises KeyError, TypeError or ValueError."""
    if scale == 1:
        return metadata
    numbers = {name for name, value in metadata.items() if type(value) in (int, float)}
    times = {name: scale for name in numbers if name.endswith("_m")} | {GUESSED: scale**2}
    scaled = numbers & times.keys()
    found = {name: shortened(value * times[name]) if name in scaled else value for name, value in metadata.items()}
    if PART in metadata:
        squares, worst, *others = metadata[PART]["totals"]
        exact = [None if squares is None else squares * scale**2, None if worst is None else worst * scale, *others]
        found[PART] = metadata[PART] | {"totals": exact}
    return found


def shared(metadata: dict[str, Any]) -> dict[str, Any]:
    """Return the metadata that all parts share, with the digest of their options. Raises KeyError or TypeError."""
    found = {name: value for name, value in metadata.items() if name in _SHARED}
    return found | ({"options": metadata[PART]["options"], "frames": metadata[PART]["of"]} if PART in metadata else {})


def place_in_whole(metadata: dict[str, Any]) -> tuple[int, int] | None:
    """Return a part's first frame and its sequence's length, or None. Raises KeyError, TypeError or ValueError."""
    part = metadata.get(PART)
    return None if part is None else (int(part["first_frame"]), int(part["of"]))


def up_metadata(up: Up) -> dict[str, Any]:
    """Return the metadata that tells players which axis points up; none for y, their default."""
    return {} if up == "y" else {"up": up}


def shortened(value: float) -> float | None:
    """Round to four significant digits; None if JSON has no such number."""
    return float(f"{value:.4g}") if math.isfinite(value) else None


def _least(value: Any) -> tuple[float, int, int]:
    share, track, frame = value
    if not (0 <= share <= 1 and type(track) is type(frame) is int and min(track, frame) >= 0):
        raise ValueError(f"{LEAST_COVERED} {value}: not a share from 0 to 1, a track and a frame")
    return float(share), track, frame


def _number(value: float | None) -> float:
    return math.inf if value is None else float(value)
