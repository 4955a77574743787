"""Splats of a chain of groups, fitted to what its frames look like, after their geometry is coded.

In: groups as they are coded, and the frames that they are of. Out: what belongs to the first group. A chain is a group
that needs no other, and those that are predicted from it: their frames share the faces of one base mesh.
"""

from __future__ import annotations

from collections.abc import Sequence

from ...analysis.appearance.splat_fit import GOLDEN, SplatFrame, SplatView, fit_splats, rendered, ring, taken
from ...coding.appearance.splats import encode_splats
from ...coding.colored import Canvas
from ...container.writer import Companion
from ...errors import InputError
from ...format.layout import ChunkKind, Form
from ...geometry.splats import Carrier
from ...types import Mesh, evenly
from ..group.interval import Interval

FRAMES = 16  # of a chain, whose pictures are looked at, at most (guess)
VIEWS = 6  # of each, where there are no colour cameras (guess)
SIZE = 256  # pixels, of the longer side of the body in a picture (guess)


class ChainSplats:
    """The frames of a chain, and in the end its splats."""

    def __init__(self, count: int, interval: Interval) -> None:
        self._splats, self._interval = count, interval
        self._frames, self._every, self._count = list[tuple[int, Carrier]](), 1, 0

    def add(self, form: Form, canvas: Canvas, meshes: Sequence[Mesh], numbers: Sequence[int]) -> None:
        """Add the frames of a group, as decoded, with their numbers in the interval, where they are of one mesh."""
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
