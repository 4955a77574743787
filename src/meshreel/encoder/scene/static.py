"""The background of a scene as chunks: once as a whole, then its changes, with their colours (paper, section 3.2).

In: the parts of a scene. Out: the payloads of its states, in the order of time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float64, UInt8

from ...analysis.appearance.bake import (
    Texels,
    face_places,
    fitted_colors,
    median_colors,
    picture,
    texels_of,
    unwrap,
)
from ...analysis.appearance.projection import projected, shown_whole, steady_normals
from ...analysis.scene.labelling import ByRest
from ...coding.appearance.atlas import encode_atlas
from ...coding.appearance.pictures import MOST_CRF
from ...coding.background import changed, decode_background, decode_change, encode_background, encode_change
from ...coding.colored import background_canvas, encode_group_colors
from ...container.writer import Companion
from ...format.budget import Chain, CostlyError
from ...format.layout import ChunkKind
from ...geometry.atlas import Layout
from ...geometry.closest_points import distances
from ...geometry.color_views import Paint, Painted
from ...geometry.decimate import decimate_faces
from ...geometry.depth import is_carried
from ...geometry.derived_sequences import CapturedSequence, is_colored
from ...geometry.flat import flattened
from ...geometry.threads import ahead
from ...geometry.topology import clean
from ...geometry.work import passed
from ...types import Mesh, Placement, evenly
from ..appearance.colors import COARSER, fitting_sizes
from ..appearance.videos import AppearanceOptions, TextureOptions, layered_pictures
from ..settings.options import SceneOptions
from .parts import Parts

# Of the background's vertices (decision 19; the last three: decision 41).
FRACTIONS = (0.75, 0.5, 0.35, 0.22, 0.15, 0.1, 0.07, 0.045, 0.03, 0.02, 0.013, 0.009, 0.006)
HALVINGS = 2  # of the factor between two fractions, in search for a smaller mesh that is near enough (guess)
LEAST_NOISE = 8e-4  # of the unit, the least noise that a background is coded for: bodies are as near to frames (guess)
WORTH = 0.9  # of the bytes without planes, that a way with planes may take: they cost nearness on what bends (guess)
WORST = 4.0  # times what is allowed on average, of a place where there is no noise to hide it (guess)
STILL_FRAMES = 16  # in which a background is looked at for its colours, at most (guess)
WALK_FRAMES = 64  # the same where a camera moves, and sees a part in each (guess)
WALK_PICTURES = 8  # of these, which say how fine its texture is (guess)
PICTURES_A_SECOND = 8  # of a background: shadows move slowly (guess)
FINER = 2  # by which the rate factor of a background's pictures is below that of a body's (guess)
FOR_A_DOUBLING = 9  # of the rate factor, for each doubling of texels along a pixel: living_room has 38 dB at .06 Mbps
NEAR = 3.0  # times the noise, within which a frame shows a place of the background (guess)
LEAST_NEAR = 0.01  # m, the least such distance (guess)


@dataclass(frozen=True, slots=True)
class Static:
    """A state of the background from a frame on: whole, or a patch of the one before."""

    frame: int
    payload: bytes
    is_patch: bool
    companions: tuple[Companion, ...] = ()  # the colours of its vertices, or of those that the patch adds
    lost_colors: bool = False  # it has colours that a reader would refuse

    def __len__(self) -> int:
        return len(self.payload) + sum(map(len, self.companions))


@dataclass(frozen=True, slots=True)
class Look:
    """The demands of the colours of a background on its faces."""

    is_flat: bool = True  # flat pieces lie on planes, in large faces: their corners lack the colours of what is between
    cut: Callable[[int, Mesh], Mesh] | None = None  # faces of a whole state from a frame on, for a texture


def encode_static(
    parts: Parts,
    count: int,
    frame_rate: float,
    options: SceneOptions,
    look: Look = Look(),
) -> list[Static]:
    """Encode the states of the background: as few faces as stay about as near to it as the noise.

    The first state is whole, as are those of a refresh; each change of the room is a patch of the state before, but for
    a background with pictures, whose atlas is of a whole state.
    """
    survey = parts.survey
    place = Placement(survey.unit, tuple(survey.center))
    usual = max(float(np.median(parts.noise.off)) / survey.unit if len(parts.noise.off) else 0.0, LEAST_NOISE)
    step = options.lattice * usual

    def coded(mesh: Mesh) -> list[tuple[bytes, Mesh]]:
        # Where there is less noise than usual, more would be spent on little: a room's background would double.
        most = options.coarse * np.maximum(parts.noise.at(mesh.vertices)[1] / survey.unit, usual)
        exact = isinstance(parts.segmentation, ByRest)
        return _coded(mesh.at((mesh.vertices - survey.center) / survey.unit), most, step, exact, look.is_flat)

    def whole_state(frame: int, mesh: Mesh) -> tuple[bytes, Mesh]:
        payload = encode_background(mesh if look.cut is None else look.cut(frame, mesh), step)
        return payload, decode_background(payload)  # the next patch counts faces in the decoded order

    ways = coded(parts.background)
    if look.cut is not None and not parts.background.is_empty:
        ways = [whole_state(0, mesh) for _, mesh in ways]
    payload, state = min(ways, key=_size)
    found = [] if state.is_empty else [Static(0, payload, False)]
    chain, changes = Chain(0, len(payload)), {change.frame: change for change in parts.changes}
    again = set(refreshes(count, frame_rate, options)) | (set() if look.cut is None else set(changes))
    for frame in sorted({*changes, *again} - {0}):
        whole = state.is_empty or frame in again
        if change := changes.get(frame):
            came = min(coded(change.came), key=_size)[1]
            before, gone = state, parts.segmentation.gone(frame, place.of(state))
            payload = encode_change(before, gone, came, step)
            try:
                state = decode_change(payload, before)
                chain = chain.then(before, state, len(payload))
            except CostlyError:  # no reader would decode it
                state, whole = changed(before, gone, came), True
        if whole and not state.is_empty:
            payload, state = whole_state(frame, state)
            chain = Chain(0, len(payload))
        if not (whole and state.is_empty):
            found.append(Static(frame, payload, not whole))
    return found


def refreshes(count: int, frame_rate: float, options: SceneOptions) -> range:
    """Return the frames at which the whole background is sent; the first frame is one of them."""
    return range(0, count, count if options.refresh is None else max(1, round(options.refresh * frame_rate)))


def _size(way: tuple[bytes, Mesh]) -> int:
    return len(way[0])


def _coded(
    mesh: Mesh, most: Float64[np.ndarray, " V"], step: float, exact: bool, flat: bool
) -> list[tuple[bytes, Mesh]]:
    """Encode a mesh with the fewest vertices that keep it near; return payload and decoded mesh, of each way.

    The RMS of its vertices' distances, in units of what is allowed at each, is at most 1; if `exact`, no distance is
    over `WORST`, from it or from what is decoded. With `flat`, there is a way in which flat pieces lie on planes, and
    all else is as near as without planes.
    """
    if mesh.is_empty:
        return [(b"", mesh)]

    def is_near(decoded: Mesh) -> bool:
        off = distances(mesh.vertices, decoded) / most
        near = float((off**2).mean()) <= 1
        if near and exact:
            near = float(max(off.max(), (distances(decoded.vertices, mesh) / np.median(most)).max())) <= WORST
        return near

    plain = _smallest(mesh, step, is_near)
    laid, on_planes = flattened(mesh, most) if flat and not exact else (mesh, np.zeros(len(mesh.vertices), bool))
    if not on_planes.any():
        return [plain]
    rough = ~on_planes

    def off_by(decoded: Mesh) -> float:
        """Return the sum of squared distances, in units of what is allowed, of the vertices that are not on planes."""
        return float(((distances(mesh.vertices[rough], decoded) / most[rough]) ** 2).sum())

    limit = off_by(plain[1])

    def is_as_near(decoded: Mesh) -> bool:
        near = off_by(decoded) <= limit
        return near and float(((distances(laid.vertices[on_planes], decoded) / most[on_planes]) ** 2).mean()) <= 1

    flat_way = _smallest(laid, step, is_as_near)
    return [plain, flat_way] if len(flat_way[0]) < WORTH * len(plain[0]) else [plain]


def _smallest(mesh: Mesh, step: float, is_near: Callable[[Mesh], bool]) -> tuple[bytes, Mesh]:
    """Return the payload and the decoded mesh with the fewest faces of those tried that are near."""

    def tried(small: Mesh) -> tuple[bytes, Mesh, bool]:
        payload = encode_background(small, step)
        decoded = decode_background(payload)
        return payload, decoded, not decoded.is_empty and is_near(decoded)

    steps = [clean(mesh)]  # each from the one before: these are nearer to the mesh than what is made from it at once
    for fraction in FRACTIONS:
        steps.append(decimate_faces(steps[-1], max(4, round(2 * fraction * len(mesh.vertices)))))
    failed = 0
    for best in reversed(steps):
        payload, decoded, near = tried(best)
        if near:
            break
        failed = len(best.faces)
    for _ in range(HALVINGS if failed and near else 0):
        small = decimate_faces(best, round((failed * len(best.faces)) ** 0.5))
        smaller = tried(small)
        if smaller[2]:
            best, (payload, decoded, _) = small, smaller
        else:
            failed = len(small.faces)
    return payload, decoded


def colored_states(
    sequence: CapturedSequence, parts: Parts, background: SceneOptions, options: AppearanceOptions | None
) -> list[Static]:
    """Encode the states of the background with the colours that still surface has from each state to the next."""
    if options is None or not (sequence.colors is not None or is_colored(sequence)):
        return encode_static(parts, len(sequence), sequence.frame_rate, background)
    found, mesh, looks, bare = list[Static](), Mesh.empty(), _Looks(sequence, parts), False
    texture = options.texture if options.texture and (options.texture.always or looks.has_pictures) else None
    look = Look(False) if texture is None else Look(cut=looks.shown_whole)
    states = encode_static(parts, len(sequence), sequence.frame_rate, background, look)
    ends = [state.frame for state in states[1:]] + [len(sequence)]
    for state, end in zip(states, ends, strict=True):
        mesh = decode_change(state.payload, mesh) if state.is_patch else decode_background(state.payload)
        canvas, bare = background_canvas(state.payload), bare and state.is_patch  # what changes it has no colours, too
        [coded] = canvas.meshes
        frames, surface = range(state.frame, end), None
        points, normals = ([each] for each in face_places(mesh))
        count = len(points[0])
        if texture and not state.is_patch:
            layout, scale = looks.layout(mesh, frames, texture.size)
            texels = texels_of(layout, 0)
            normals_there = steady_normals(mesh)[texels.faces]
            surface = _Unwrapped(mesh, layout, scale, texels, texels.places(mesh), normals_there)
            points, normals = [*points, surface.places], [*normals, surface.normals]
        colors, seen = looks.colors(frames, np.concatenate(points), np.concatenate(normals))
        guessed = looks.guessed(np.concatenate(points))
        seen &= ~guessed
        fitted = fitted_colors(mesh, colors[:count].astype(np.float64), seen[:count])
        shown = fitted[len(mesh.vertices) - coded.vertices :]
        try:
            step = COARSER * options.color_step if texture else options.color_step  # beneath pictures
            encoded = encode_group_colors(canvas, [shown], step, None)
        except CostlyError:  # the summary tells of it
            bare = True
        if bare:
            found.append(replace(state, lost_colors=True))
            continue
        companions = [Companion(ChunkKind.COLORS, encoded.payload)]
        if surface is not None and texture is not None:
            companions.append(Companion(ChunkKind.ATLAS, encode_atlas(mesh, surface.layout)))
            usual = colors[count:], seen[count:], guessed[count:]
            companions += _pictured(surface, usual, frames, looks, texture)
        found.append(replace(state, companions=tuple(companions)))
    return found


@dataclass(frozen=True, slots=True)
class _Unwrapped:
    """The texels of a background, and where they are."""

    mesh: Mesh
    layout: Layout
    scale: float  # texels along a pixel of the cameras; 1 where there are none
    texels: Texels
    places: Float64[np.ndarray, "N 3"]
    normals: Float64[np.ndarray, "N 3"]


def _pictured(
    surface: _Unwrapped,
    usual: tuple[UInt8[np.ndarray, "N 3"], Bool[np.ndarray, " N"], Bool[np.ndarray, " N"]],
    frames: range,
    looks: _Looks,
    options: TextureOptions,
) -> list[Companion]:
    """Return a slow video of what a background looks like, where shadows move: what a frame hides is as usual.

    `usual` are the colours of the texels, which of them are known, and which are of surface that is guessed.
    """
    crf = options.crf - FINER + round(FOR_A_DOUBLING * math.log2(max(1.0, surface.scale)))
    slow = replace(options, crf=min(max(1, crf), MOST_CRF))

    def picture_of(frame: int) -> UInt8[np.ndarray, "H W 3"]:
        colors, seen = looks.moment(min(frame + some.step // 2, frames[-1]), surface.places, surface.normals)
        seen &= ~usual[2]
        return picture(surface.texels, surface.mesh, np.where(seen[:, None], colors, usual[0]), usual[1] | seen)

    if looks.is_walk:  # what a camera that moves sees at a moment would be a patch that wanders over the room
        once = picture(surface.texels, surface.mesh, usual[0], usual[1])
        return layered_pictures(surface.layout, frames[:: len(frames)], lambda _: once, slow)
    some = frames[:: max(1, round(looks.frame_rate / PICTURES_A_SECOND))]
    return layered_pictures(surface.layout, some, picture_of, slow)


class _Looks:
    """Colours of a scene's still surface in its frames, by places in normalised coordinates."""

    def __init__(self, sequence: CapturedSequence, parts: Parts) -> None:
        self._sequence, self._parts, self._views = sequence, parts, parts.views
        self.has_pictures = self._views is not None or sequence[0].texture is not None
        self.frame_rate = sequence.frame_rate
        self.is_walk = sequence.colors is not None and is_carried(sequence.colors.__getitem__, len(sequence))

    def guessed(self, points: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        """Return which places are of surface that is guessed: pictures show what stands before it."""
        if self._parts.guessed.is_empty:
            return np.zeros(len(points), bool)
        survey = self._parts.survey
        return distances(survey.center + survey.unit * points, self._parts.guessed) <= self._near

    def colors(
        self, frames: range, points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"]
    ) -> tuple[UInt8[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
        """Return the usual colours of places over some frames, and which of them are known.

        Prefer frames in which the point is away from a depth discontinuity; near one, foreground colour bleeds in.
        """
        some = [frames[number] for number in evenly(len(frames), WALK_FRAMES if self.is_walk else STILL_FRAMES)]
        if self._views is None:
            return median_colors(points, normals, map(self._paint, some))
        views = self._views
        colors, known = median_colors(points, normals, ahead(lambda number: views.at(number).clear, some))
        rest = np.flatnonzero(~known)
        colors[rest], known[rest] = median_colors(points[rest], normals[rest], map(self._paint, some))
        return colors, known

    def moment(
        self, number: int, points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"]
    ) -> tuple[UInt8[np.ndarray, "N 3"], Bool[np.ndarray, " N"]]:
        """Return the colours of places in one frame, and which of them it shows, away from the border of what moves."""
        passed("pictures")
        paint = self._paint(number) if self._views is None else self._views.at(number).clear
        colors, seen = paint.at(points, normals)
        return np.clip(np.rint(colors), 0, 255).astype(np.uint8), seen

    def layout(self, mesh: Mesh, frames: range, size: int | None) -> tuple[Layout, float]:
        """Return the places of a background in a texture, as cameras see it where there are some, and its scale."""
        if self._views is None:
            return unwrap(mesh, fitting_sizes(size, [self._paint(frames.start)], [mesh])), 1.0
        if self.is_walk:  # no moment has pictures of it all: a texture for twice as many pixels as the fullest has
            some = [frames[number] for number in evenly(len(frames), WALK_PICTURES)]
            widths = [fitting_sizes(size, [self._paint(number)], [mesh]) for number in some]
            wide = min(2 * max(each[0] for each in widths), max(each[-1] for each in widths))
            return unwrap(mesh, sorted({width for each in widths for width in each if size or width >= wide})), 1.0
        return projected(mesh, self._views.of_surface(frames[evenly(len(frames), 1)[0]], mesh))

    def shown_whole(self, frame: int, mesh: Mesh) -> Mesh:
        """Return a background from a frame on, of faces that are in pictures entirely, where cameras took some."""
        return mesh if self._views is None or self.is_walk else shown_whole(mesh, self._views.of_surface(frame, mesh))

    def _paint(self, number: int) -> Paint:
        if self._views is not None:
            return self._views.at(number)
        survey = self._parts.survey
        mesh = self._sequence[number]
        still = mesh.with_faces(~self._parts.segmentation.moving(number, mesh))
        return Painted(still.at((still.vertices - survey.center) / survey.unit), self._near / survey.unit)

    @property
    def _near(self) -> float:
        """Distance, m, within which a frame or what is guessed shows a place of the background."""
        return max(NEAR * self._parts.noise.mean, LEAST_NEAR)
