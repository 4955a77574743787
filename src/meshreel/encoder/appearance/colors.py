"""Colours of what is coded, after its geometry: of the vertices of each group, and the textures of a chain of groups.

In: groups as they are coded, the frames that they are of. Out: the same with what belongs to them. Where no frame has
colours, nothing is done. A chain is a group that needs no other, and those that are predicted from it one after the
other: they have one atlas, in which the surface hardly changes, and their pictures are one video.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...analysis.appearance.bake import bake, picture, texels_of, unwrap, vertex_colors
from ...coding.appearance.atlas import encode_atlas
from ...coding.colored import Canvas, canvas_of, encode_group_colors, finest_faces
from ...coding.group import continue_group
from ...coding.layers.coder import LayersState
from ...container.writer import Companion
from ...format.budget import CostlyError
from ...format.layout import ChunkKind, Form
from ...geometry.color_views import Paint
from ...types import GREY, Mesh
from ..group.forms import EncodedGroup
from ..group.interval import Interval
from ..group.progress import Stages
from .options import TEXTURE_SIZES, AppearanceOptions, TextureOptions
from .splats import ChainSplats
from .videos import Videos

USED = 0.43  # of a texture is on the surface, as unwrapped; measured on basketball_player
COARSER = 2.0  # steps of vertex colours beneath pictures, at half of their bytes (decision 28)
MOST_FITTING = 1024  # texels, unless a larger texture is asked for: 2 mm on a person


def colored_groups(
    groups: Iterable[EncodedGroup], interval: Interval, options: AppearanceOptions | None, stages: Stages | None = None
) -> Iterator[EncodedGroup]:
    """Yield the groups of an interval with the colours of their frames."""
    if options is None:
        yield from groups
        return
    at, state, chain = 0, None, _Chain(interval, options)
    for group in groups:
        numbers = range(at, at + group.frame_count)
        at = numbers.stop
        if not group.predicted:
            yield from chain.done()
            state, chain = None, _Chain(interval, options)
        meshes = [interval.frames[number] for number in numbers]
        paints = [interval.paint(number, mesh) for number, mesh in zip(numbers, meshes, strict=True)]
        if any(paint is not None for paint in paints):
            pictured = has_pictures(interval, meshes, options)
            state = chain.add(group, _Frames(numbers, paints), options, state, pictured)
            if stages is not None:
                stages.add("color", group.frame_count)
        else:
            chain.pass_on(group)
    yield from chain.done()


def has_pictures(interval: Interval, meshes: Iterable[Mesh], options: AppearanceOptions | None) -> bool:
    """Return whether these frames of an interval are to have textures, where their form allows it."""
    if options is None or options.texture is None:
        return False
    if options.texture.always or interval.views is not None:
        return True
    return any(mesh.texture is not None for mesh in meshes)


@dataclass(frozen=True, slots=True)
class _Frames:
    """Frames of a group: their numbers in the interval, and what knows their colours."""

    numbers: range
    paints: list[Paint | None]


class _Chain:
    """Groups of one chain, their splats, and the video of their pictures."""

    def __init__(self, interval: Interval, options: AppearanceOptions) -> None:
        self._groups = list[EncodedGroup]()
        self._splats = None if options.splats is None else ChainSplats(options.splats, interval)
        self._pictured = list[bool]()  # whether each of the groups has pictures
        self._video: _Video | None = None

    def pass_on(self, group: EncodedGroup) -> None:
        """Add a group without colours."""
        self._groups.append(group)
        self._pictured.append(False)

    def add(
        self,
        group: EncodedGroup,
        frames: _Frames,
        options: AppearanceOptions,
        before: LayersState | None,
        pictured: bool,
    ) -> LayersState | None:
        """Add a group with the colours of its frames; return the state that those of the next are predicted from."""
        paints = frames.paints
        meshes, after = continue_group(group.payload, len(paints), None, before)
        canvas = canvas_of(group.payload, [len(mesh.vertices) for mesh in meshes], None, before)
        if self._splats is not None:
            self._splats.add(group.form, canvas, meshes, frames.numbers)
        colors = [_vertex_colors(paint, mesh) for paint, mesh in zip(paints, meshes, strict=True)]
        texture = options.texture if pictured and not self._groups and group.form == Form.LAYERS else None
        is_covered = texture is not None or self._video is not None
        step = COARSER * options.color_step if is_covered else options.color_step
        try:
            encoded = encode_group_colors(canvas, colors, step, None if before is None else before.colors)
        except CostlyError:  # the summary tells of it
            self.pass_on(replace(group, lost_colors=True))
            return after
        companions = [Companion(ChunkKind.COLORS, encoded.payload, encoded.layers)]
        if texture is not None:
            self._video = _Video(canvas, texture, paints, meshes)
            companions.append(Companion(ChunkKind.ATLAS, self._video.atlas))
        if self._video is not None:
            for paint, mesh in zip(paints, meshes, strict=True):
                self._video.add(paint, mesh)
        self._groups.append(replace(group, companions=tuple(companions)))
        self._pictured.append(self._video is not None)
        return None if after is None else replace(after, colors=encoded.state)

    def done(self) -> list[EncodedGroup]:
        """Return the groups with their splats and pictures."""
        if self._splats is not None and self._groups:
            first = self._groups[0]
            companions = (*first.companions, *self._splats.companions())
            self._groups[0] = replace(first, companions=companions)
        if self._video is None:
            return self._groups
        counts = [group.frame_count for group, own in zip(self._groups, self._pictured, strict=True) if own]
        pictures = iter(self._video.videos.finish(counts))
        return [
            replace(group, companions=(*group.companions, *next(pictures))) if own else group
            for group, own in zip(self._groups, self._pictured, strict=True)
        ]


class _Video:
    """The atlas of a chain, and the video of its pictures."""

    def __init__(
        self, canvas: Canvas, options: TextureOptions, paints: Sequence[Paint | None], meshes: Sequence[Mesh]
    ) -> None:
        template = canvas.meshes[0]
        layout = unwrap(template.base, options.size or fitting_size(paints, meshes))
        self.atlas = encode_atlas(template.base, layout)
        self._texels, self._count = texels_of(layout, template.levels), template.vertices
        self._faces = finest_faces(template.base, template.levels)
        count = len(self._texels.pixels)
        self._colors, self._seen = np.full((count, 3), GREY, np.uint8), np.zeros(count, bool)  # so far
        self.videos = Videos(layout, options)

    def add(self, paint: Paint | None, mesh: Mesh) -> None:
        """Add the picture of a frame, whose mesh begins with the template.

        What nobody sees keeps the colour that was seen last.
        """
        if paint is not None:
            colors, seen = bake(paint, Mesh(mesh.vertices[: self._count], self._faces), self._texels)
            self._colors[seen] = colors[seen]
            self._seen |= seen
        self.videos.add(picture(self._texels, self._colors, self._seen))


def _vertex_colors(paint: Paint | None, mesh: Mesh) -> np.ndarray:
    if paint is None or mesh.is_empty:
        return np.full(mesh.vertices.shape, GREY, np.uint8)
    return vertex_colors(paint, mesh)


def fitting_size(paints: Sequence[Paint | None], meshes: Sequence[Mesh]) -> int:
    """Return the width of the texture that has the detail of the pictures that show some of these frames."""
    some = next((k for k, paint in enumerate(paints) if paint is not None), 0)
    paint = paints[some]
    wanted = 0.0 if paint is None else paint.pixels_on(meshes[some]) / USED
    return next((size for size in TEXTURE_SIZES if size <= MOST_FITTING and size * size >= wanted), MOST_FITTING)
