"""Colours of what is coded, after its geometry: of each group's vertices, and textures and splats of a chain of groups.

In: groups as they are coded, the frames that they are of. Out: the same with what belongs to them. Where no frame has
colours, nothing is done. A chain is a group that needs no other, and those that are predicted from it one after the
other: they have one atlas, in which the surface hardly changes, and their pictures are one video.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np
from jaxtyping import Float64, UInt8

from ... import _core
from ...analysis.appearance.bake import bake, picture, texels_of, unwrap, vertex_colors
from ...analysis.appearance.splat_fit import GOLDEN, SplatFrame, SplatView, fit_splats, rendered, ring, taken
from ...coding.appearance.atlas import encode_atlas
from ...coding.appearance.splats import encode_splats
from ...coding.colored import Canvas, canvas_of, encode_group_colors, finest_faces
from ...coding.layers.coder import LayersState
from ...container.writer import Companion
from ...errors import InputError
from ...format.budget import CostlyError
from ...format.layout import ChunkKind, Form
from ...geometry import work
from ...geometry.color_views import Paint
from ...geometry.splats import Carrier
from ...geometry.threads import mapped
from ...types import GREY, Mesh, evenly
from ..group.forms import NORMALISED, EncodedGroup
from ..group.interval import Interval
from .videos import TEXTURE_SIZES, AppearanceOptions, TextureOptions, Videos

USED = 0.43  # of a texture is on the surface, as unwrapped; measured on basketball_player
COARSER = 2.0  # steps of vertex colours beneath pictures, at half of their bytes (decision 28)
LIGHT = 25.0  # levels of 255 by which the mean colour beneath pictures may be off: a tenth of the range (guess)
MOST_FITTING = 1024  # texels, unless a larger texture is asked for: 2 mm on a person


def colored_groups(
    groups: Iterable[EncodedGroup], interval: Interval, options: AppearanceOptions | None
) -> Iterator[EncodedGroup]:
    """Yield the groups of an interval with the colours of their frames."""
    if options is None:
        yield from groups
        return
    at, chain = 0, _Chain(interval, options)
    for group in groups:
        numbers = range(at, at + group.frame_count)
        at = numbers.stop
        if not group.predicted:
            yield from chain.done()
            chain = _Chain(interval, options)
        meshes = [interval.frames[number] for number in numbers]
        paints = mapped(interval.paint, numbers, meshes)
        if any(paint is not None for paint in paints):
            chain.add(group, numbers, paints, has_pictures(interval, meshes, options))
        else:
            chain.groups.append(group)
    yield from chain.done()


def has_pictures(interval: Interval, meshes: Iterable[Mesh], options: AppearanceOptions | None) -> bool:
    """Return whether these frames of an interval are to have textures, where their form allows it."""
    if options is None or options.texture is None:
        return False
    if options.texture.always or interval.views is not None:
        return True
    return any(mesh.texture is not None for mesh in meshes)


class _Chain:
    """Groups of one chain, their splats, and the video of their pictures."""

    def __init__(self, interval: Interval, options: AppearanceOptions) -> None:
        self.groups = list[EncodedGroup]()
        self._splats = None if options.splats is None else ChainSplats(options.splats, interval)
        self._pictured = list[int]()  # which of the groups have pictures
        self._options = options
        self._video: _Video | None = None
        self._still: Float64[np.ndarray, "V 3"] | None = None  # of the template beneath pictures, in all frames
        self._before: tuple[_core.GroupState | None, LayersState | None] = None, None  # that predict the next group

    def add(self, group: EncodedGroup, numbers: range, paints: Sequence[Paint | None], pictured: bool) -> None:
        """Add a group with the colours of its frames, which have these numbers in the interval."""
        options, (core, known) = self._options, self._before
        decoded = _core.Group(group.payload, len(paints), None, core, NORMALISED)
        meshes = [Mesh(*arrays) for arrays in decoded.frames()]
        canvas = canvas_of(group.payload, [len(mesh.vertices) for mesh in meshes], None, known)
        if self._splats is not None:
            self._splats.add(group.form, canvas, meshes, numbers)
        colors = mapped(_vertex_colors, paints, meshes)
        texture = options.texture if pictured and not self.groups and group.form == Form.LAYERS else None
        is_covered = texture is not None or self._video is not None
        step = COARSER * options.color_step if is_covered else options.color_step
        if is_covered:
            colors = self._stilled(colors, paints, canvas.meshes[0].vertices)
        encoded, self._before = None, (None, None)
        with suppress(CostlyError):
            encoded = encode_group_colors(canvas, colors, step, None if known is None else known.colors)
        if decoded.state is not None:
            base, coded = canvas.meshes[0].base, None if encoded is None else encoded.state
            last = LayersState(base.faces, meshes[-1].vertices[: len(base.vertices)], (), coded)
            self._before = decoded.state, last
        if encoded is None:  # the summary tells of it
            self.groups.append(replace(group, lost_colors=True))
            return
        companions = [Companion(ChunkKind.COLORS, encoded.payload, encoded.layers)]
        if texture is not None:
            self._video = _Video(canvas, texture, paints, meshes)
            companions.append(Companion(ChunkKind.ATLAS, self._video.atlas))
        if self._video is not None:
            self._pictured.append(len(self.groups))
            self._video.add(paints, meshes)
        self.groups.append(replace(group, companions=tuple(companions)))

    def _stilled(
        self, colors: Sequence[UInt8[np.ndarray, "_ 3"]], paints: Sequence[Paint | None], count: int
    ) -> list[UInt8[np.ndarray, "_ 3"]]:
        """Return colours of vertices, of which the template's `count` change with the light alone: pictures lie above.

        They are the mean of the chain's first group, and move on with the mean of all vertices where that is off.
        """
        pairs = zip(colors, paints, strict=True)
        painted = np.mean([color[:count] for color, paint in pairs if paint is not None], axis=0)
        if self._still is None:
            self._still = painted
        light = painted.mean(axis=0) - self._still.mean(axis=0)
        if np.abs(light).max() > LIGHT:
            self._still = self._still + light
        still = np.rint(self._still.clip(0, 255)).astype(np.uint8)
        return [np.concatenate([still, color[count:]]) for color in colors]

    def done(self) -> list[EncodedGroup]:
        """Return the groups with their splats and pictures."""
        groups = self.groups
        if self._splats is not None and groups:
            groups[0] = replace(groups[0], companions=(*groups[0].companions, *self._splats.companions()))
        if self._video is not None:
            pictures = self._video.videos.finish([groups[k].frame_count for k in self._pictured])
            for k, own in zip(self._pictured, pictures, strict=True):
                groups[k] = replace(groups[k], companions=(*groups[k].companions, *own))
        return groups


class _Video:
    """The atlas of a chain, and the video of its pictures."""

    def __init__(
        self, canvas: Canvas, options: TextureOptions, paints: Sequence[Paint | None], meshes: Sequence[Mesh]
    ) -> None:
        template = canvas.meshes[0]
        layout = unwrap(template.base, fitting_sizes(options.size, paints, meshes))
        self.atlas = encode_atlas(template.base, layout)
        self._texels, self._count = texels_of(layout, template.levels), template.vertices
        self._faces = finest_faces(template.base, template.levels)
        count = len(self._texels.pixels)
        self._colors, self._seen = np.full((count, 3), GREY, np.uint8), np.zeros(count, bool)  # so far
        self.videos = Videos(layout, options)

    def add(self, paints: Sequence[Paint | None], meshes: Sequence[Mesh]) -> None:
        """Add the pictures of frames, whose meshes begin with the template.

        What no camera sees keeps the colour that was seen last; until then it has that of the surface around it.
        """
        for baked in mapped(self._baked, paints, meshes):
            if baked is not None:
                colors, seen = baked
                self._colors[seen] = colors[seen]
                self._seen |= seen
            self.videos.add(picture(self._texels, self._whole(meshes[0]), self._colors, self._seen))

    def _baked(self, paint: Paint | None, mesh: Mesh) -> tuple[np.ndarray, np.ndarray] | None:
        return None if paint is None else bake(paint, self._whole(mesh), self._texels)

    def _whole(self, mesh: Mesh) -> Mesh:
        return Mesh(mesh.vertices[: self._count], self._faces)


def _vertex_colors(paint: Paint | None, mesh: Mesh) -> UInt8[np.ndarray, "V 3"]:
    work.passed("color")
    if paint is None or mesh.is_empty:
        return np.full(mesh.vertices.shape, GREY, np.uint8)
    return vertex_colors(paint, mesh)


def fitting_sizes(size: int | None, paints: Sequence[Paint | None], meshes: Sequence[Mesh]) -> Sequence[int]:
    """Return the width of a texture that is asked for, or else widths to try: the first has the detail of the pictures.

    The pictures are those that show some of these frames. Larger textures are for meshes of many small charts.
    """
    if size is not None:
        return (size,)
    pairs = zip(paints, meshes, strict=True)
    wanted = next(paint.pixels_on(mesh) for paint, mesh in pairs if paint is not None) / USED
    first = next((size for size in TEXTURE_SIZES if size <= MOST_FITTING and size * size >= wanted), MOST_FITTING)
    return [size for size in TEXTURE_SIZES if size >= first]


FRAMES = 16  # of a chain, whose pictures are looked at, at most (guess)
VIEWS = 6  # of each, where there are no colour cameras (guess)
SIZE = 256  # pixels, of the longer side of the body in a picture (guess)


class ChainSplats:
    """The frames of a chain, and in the end its splats."""

    def __init__(self, count: int, interval: Interval) -> None:
        self._splats, self._interval = count, interval
        self._frames, self._every, self._count = list[tuple[int, Carrier]](), 1, 0

    def add(self, form: Form, canvas: Canvas, meshes: Sequence[Mesh], numbers: Sequence[int]) -> None:
        """Add a group's decoded frames if they share one mesh; `numbers` are their indices in the interval."""
        if form not in (Form.LAYERS, Form.LAPLACIAN):
            return
        for number, carrier in zip(numbers, canvas.carriers(meshes), strict=True):
            if self._count % self._every == 0:
                self._frames.append((number, carrier))
            self._count += 1
            if len(self._frames) == 4 * FRAMES:  # of a long chain, not all are in memory
                self._frames, self._every = self._frames[::2], 2 * self._every

    def companions(self) -> tuple[Companion, ...]:
        """Return the splats, fitted to all frames together; none where no frame can have some.

        Raises InputError where no picture shows the surface.
        """
        some = self._frames
        if not some:
            return ()
        chosen = [some[k] for k in evenly(len(some), FRAMES)]
        frames = [SplatFrame(carrier, self._views(number)) for number, carrier in chosen]
        try:
            splats, importance = fit_splats(frames, self._splats)
        except InputError as error:
            first = self._interval.first_frame
            raise InputError(f"frames {first + some[0][0]} to {first + some[-1][0]}: {error}") from error
        payload, layers = encode_splats(splats, importance)
        return (Companion(ChunkKind.SPLATS, payload, layers),)

    def _views(self, number: int) -> tuple[SplatView, ...]:
        """Return pictures of a frame: of colour cameras, or rendered from around it."""
        interval = self._interval
        mesh, views = interval.frames[number], interval.views
        if views is not None:
            at = interval.first_frame + number
            return taken(views.pictures(at), mesh, views.surface(at), SIZE)
        return rendered(mesh, ring(mesh, VIEWS, SIZE, GOLDEN * number, interval.up)) if mesh.is_colored else ()
