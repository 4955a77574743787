"""Warnings of what a file lacks of its sequence: faces, surface that flies, colours.

In: the survey, the parts of a scene, the written groups. Out: lines of text.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from ...analysis.survey import Survey
from ..file.summary import GroupSummary
from ..scene.parts import Parts
from ..scene.static import Static

ASTRAY = 0.005  # of the surface: noise, and what a border of the background lacks, is less (guess)


def warnings_of(seen: Survey) -> tuple[str, ...]:
    """Return warnings of surface that no file of the sequence has."""
    found = []
    if seen.dropped:
        found.append(f"{seen.dropped} faces without area or with the vertices of another face are not kept")
    if seen.flattened:
        count, first = len(seen.flattened), seen.flattened[0]
        text = f"{count} frames have faces, but none with an area: they count as empty (first frame {first} of these)"
        found.append(text)
    return tuple(found)


def warnings_of_scene(parts: Parts, moves: bool, dropped: int) -> Iterator[str]:
    """Yield warnings of still surface, of all moving surface or of `dropped` faces of it that the file lacks."""
    if parts.astray > ASTRAY:
        text = f"{100 * parts.astray:.1f} % of the surface stands still, but is far from the background that frames"
        why = "it flies, or is there for a while only"
        yield f"{text} share, and is not kept: {why}; to keep all, encode with --dynamic-only"
    if not moves:
        least = 2 * parts.segmentation.cell
        text = f"nothing moves by more than {least:.2g} m, or no view sees it: the whole scene is background"
        yield f"{text}; if something does, encode with --dynamic-only"
    if dropped:
        yield f"{dropped} faces of bits that move, far from all bodies and there only for a moment, are not kept"


def warnings_of_colors(groups: Sequence[GroupSummary], states: Sequence[Static] = ()) -> Iterator[str]:
    """Yield a warning of what has colours that the file has not."""
    frames = sum(group.frame_count for group in groups if group.lost_colors)
    bare = [f"{frames} frames"] * (frames > 0) + ["the background"] * any(state.lost_colors for state in states)
    if bare:
        yield f"no colours of {' and of '.join(bare)}: they would cost a reader too much"
