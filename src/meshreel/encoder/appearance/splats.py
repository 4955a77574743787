"""Splats of a chain of groups, fitted to what its frames look like, after their geometry is coded.

In: groups as they are coded, and the frames that they are of. Out: what belongs to the first group. A chain is a group
that needs no other, and those that are predicted from it: their frames share the faces of one base mesh.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...analysis.appearance.splat_fit import SplatFrame, SplatView, fit_splats
from ...analysis.appearance.splat_views import GOLDEN, rendered, ring, taken
from ...coding.appearance.splats import encode_splats
from ...coding.colored import Canvas
from ...container.writer import Companion
from ...errors import InputError
from ...format.layout import ChunkKind, Form
from ...geometry.splats import Carrier
from ...types import Mesh, evenly
from ..group.interval import Interval
from .options import SplatOptions


class ChainSplats:
    """The frames of a chain, and in the end its splats."""

    def __init__(self, options: SplatOptions, interval: Interval) -> None:
        self._options, self._interval = options, interval
        self._frames, self._every, self._count = list[tuple[int, Carrier]](), 1, 0

    def add(self, form: Form, canvas: Canvas, meshes: Sequence[Mesh], numbers: Sequence[int]) -> None:
        """Add the frames of a group, as decoded, with their numbers in the interval, where they are of one mesh."""
        if form not in (Form.LAYERS, Form.LAPLACIAN):
            return
        for number, carrier in zip(numbers, canvas.carriers(meshes), strict=True):
            if self._count % self._every == 0:
                self._frames.append((number, carrier))
            self._count += 1
            if len(self._frames) == 4 * self._options.frames:  # of a long chain, not all are in memory
                self._frames, self._every = self._frames[::2], 2 * self._every

    def companions(self) -> tuple[Companion, ...]:
        """Return the splats, fitted to all frames together; none where no frame can have some.

        Raises InputError where no picture shows the surface.
        """
        o, some = self._options, self._frames
        if not some:
            return ()
        chosen = [some[k] for k in evenly(len(some), o.frames)]
        frames = [SplatFrame(carrier, self._views(number)) for number, carrier in chosen]
        try:
            splats, importance = fit_splats(frames, o.fit)
        except InputError as error:
            first = self._interval.first_frame
            raise InputError(f"frames {first + some[0][0]} to {first + some[-1][0]}: {error}") from error
        payload, layers = encode_splats(splats, importance, o.coding)
        return (Companion(ChunkKind.SPLATS, payload, layers),)

    def _views(self, number: int) -> tuple[SplatView, ...]:
        """Return pictures of a frame: of colour cameras, or rendered from around it."""
        interval, o = self._interval, self._options
        mesh, views = interval.frames[number], interval.views
        if views is not None:
            at = interval.first_frame + number
            return taken(views.pictures(at), mesh, views.surface(at), o.size)
        return rendered(mesh, ring(mesh, o.views, o.size, GOLDEN * number, interval.up)) if mesh.is_colored else ()
