"""Colours of what is coded: of the vertices of groups, after their geometry, and of the states of a background.

In: groups as they are coded, the frames that they are of. Out: the same with the payloads of their colours. Where no
frame has colours, nothing is done.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from ..analysis.appearance.lookup import Painted
from ..analysis.appearance.vertices import vertex_colors
from ..coding.colored import canvas_of, encode_group_colors
from ..coding.group import continue_group
from ..coding.layers.coder import LayersState
from ..format.budget import CostlyError
from ..types import GREY, Frames, Mesh
from .forms import EncodedGroup
from .options import AppearanceOptions

STILL_FRAMES = 16  # in which a background is looked at, at most (guess)
NEAR = 3.0  # times the noise, within which a frame shows a place of the background (guess)
LEAST_NEAR = 0.01  # m, the same at least (guess)


def colored_groups(
    groups: Iterable[EncodedGroup], frames: Frames, options: AppearanceOptions | None
) -> Iterator[EncodedGroup]:
    """Yield the groups of an interval with the colours of their frames."""
    at, state = 0, None
    for group in groups:
        numbers = range(at, at + group.frame_count)
        at = numbers.stop
        if options is not None:
            some = [frames[number] for number in numbers]
            if any(mesh.is_colored for mesh in some):
                group, state = _colored(group, some, options, state if group.predicted else None)
        yield group


def _colored(
    group: EncodedGroup, frames: list[Mesh], options: AppearanceOptions, before: LayersState | None
) -> tuple[EncodedGroup, LayersState | None]:
    """Return a group with its colours, and the state from which those of the next group may be predicted."""
    meshes, after = continue_group(group.payload, len(frames), None, before)
    canvas = canvas_of(group.payload, [len(mesh.vertices) for mesh in meshes], None, before)
    colors = [_vertex_colors(frame, mesh) for frame, mesh in zip(frames, meshes, strict=True)]
    known = None if before is None else before.colors
    try:
        encoded = encode_group_colors(canvas, colors, options.colors, known)
    except CostlyError:  # the summary tells of a group without colours
        return group, after
    after = None if after is None else replace(after, colors=encoded.state)
    return replace(group, colors=encoded.payload, color_layers=encoded.layers), after


def _vertex_colors(frame: Mesh, mesh: Mesh) -> np.ndarray:
    if frame.is_empty or mesh.is_empty or not frame.is_colored:
        return np.full(mesh.vertices.shape, GREY, np.uint8)
    return vertex_colors(Painted(frame), mesh)
