"""Taking a scene apart: moving surface, background, noise, and the size of the moving bodies (paper, section 3.2).

In: the frames of a scene, options. Out: Parts, which the encoding of every interval of the scene uses.
"""

from __future__ import annotations

import io
import zipfile
import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64

from ...analysis.scene.background import FRAMES, WALKED, Moment, fuse_background, fuse_still_depth, fuse_walk
from ...analysis.scene.bodies import beyond, ring, with_ring
from ...analysis.scene.color_looks import CHANGE_SIDE, ColorChange, ColorLooks
from ...analysis.scene.cut import Rest
from ...analysis.scene.labelling import ByPlace, ByRest, Segmentation
from ...analysis.scene.masks import Masker
from ...analysis.scene.segmentation import segment, segment_by
from ...analysis.scene.standing import REGION, LocalNoise, Standing
from ...analysis.survey import Survey, check_one_unit
from ...geometry.cameras import Camera
from ...geometry.closest_points import Surface, area_samples
from ...geometry.color_views import ColorFrames
from ...geometry.depth import DepthFrames, FreeSpace, is_carried
from ...geometry.derived_sequences import CapturedSequence, picked
from ...geometry.planes import close_planes
from ...geometry.threads import ahead
from ...geometry.topology import components, concatenate, face_means, face_normals, part_of
from ...geometry.voxels import Lattice
from ...geometry.work import passed
from ...types import Mesh, MeshSequence, evenly
from ..group.interval import Views
from ..settings.options import SceneOptions

PROBES = 12  # frames, at most, in which moving surface is measured (guess)
LOST = 0.5  # share of a frame's faces that may stand still where no background was found (guess)
SEEN_THROUGH = 2  # probed frames in which cameras see through a place whose surface counts as moving (guess)
APART, LEAST_APART = 4.0, 0.03  # deviations, and m: what is farther from the room is not of it (guess)
OUTLIER = 3.0  # times the segmentation's `noise`: still surface farther from the background is no noise (guess)
BLANK = 0.5  # share of the probed frames, and of a hole, in which a camera looks there and measures nothing (guess)
SAMPLES = 20_000  # vertices of a frame at which noise is measured (guess)
LOOKED_AT = 4  # frames in which surface that is called still is asked whether it rests (guess)
MOVED = 0.02  # share of the still surface that may be elsewhere at other times: rooms have less than .01
MOVED_SENSED = 0.2  # the same in a recording, whose sensors' errors may drift: rooms have up to .055


@dataclass(frozen=True, slots=True)
class Change:
    """A change of the room from a frame on."""

    frame: int
    came: Mesh  # m, surface that stands still from this frame on


@dataclass(frozen=True)
class Parts:
    """The parts of a scene, which all of its intervals share."""

    survey: Survey  # its unit is the diagonal of the largest body that moves, or the scene's own where nothing does
    segmentation: Segmentation
    background: Mesh  # m, as in the first frame; empty where nothing stands still
    changes: list[Change]
    noise: LocalNoise  # distances of still surface from the background: what bodies near it have
    free: tuple[FreeSpace, ...] = ()  # of some frames; none where no depth is known
    views: Views | None = None  # of colour cameras
    guesses: int = 0  # faces of the background, the last: there planes go on through holes that no camera saw into

    @cached_property
    def room(self) -> Callable[[int], Surface | None]:
        """The room after so many changes, prepared for queries; None where nothing stands in it."""
        return _rooms(self.background, self.changes)

    @cached_property
    def guessed(self) -> Mesh:
        """The surface of the background that is guessed."""
        count = len(self.background.faces)
        return part_of(self.background, np.arange(count) >= count - self.guesses)

    def moving(self, frame: int, mesh: Mesh) -> tuple[Mesh, int]:
        """Cut the surface that moves out of a frame, with what the room does not have there.

        Return it, and the number of faces of which neither has anything: bits that are too small, or seldom measured.
        """
        passed("bodies")
        by, moves = self.segmentation, self.segmentation.moving(frame, mesh)
        if isinstance(by, ByRest):
            return with_ring(mesh, moves, by.cell, self.room(0)), 0
        room = self.room(sum(change.frame <= frame for change in self.changes))
        off = np.ones(len(mesh.vertices), bool) if room is None else self._off(mesh, room)
        if room is not None:
            more = beyond(mesh, moves, off) & ~moves
            if self.free:  # room that is measured now and then was not seen through in other frames
                middles = face_means(mesh.vertices, mesh.faces[more])
                seen = sum(free.at(middles).astype(np.int64) for free in self.free)
                more[more] = seen >= min(SEEN_THROUGH, len(self.free))
            moves |= more
        lost = int((off[mesh.faces].all(axis=1) & ~moves).sum())
        return with_ring(mesh, moves, by.cell, self.room(0)), lost

    def _off(self, mesh: Mesh, room: Surface) -> Bool[np.ndarray, " V"]:
        """Return True for each vertex that is so far from the room that it is not of it."""
        gaps = room.distances(mesh.vertices)
        off = gaps > LEAST_APART
        off[off] = gaps[off] > APART * self.noise.at(mesh.vertices[off])[1]
        return off


class NoRoom(Exception):
    """A sequence that seemed to be a scene has no background that holds in every frame: its text says why."""


def take_apart(
    sequence: CapturedSequence,
    survey: Survey,
    options: SceneOptions,
    masker: Masker | None = None,
    standing: Standing | None = None,
) -> Parts:
    """Separate a scene into background and moving surface; by the masks of a masker where there is one.

    Raises InputError where frames are of different units, and NoRoom where surface that is called still is not.
    """
    check_one_unit(survey)
    segmentation: Segmentation
    if masker is None:
        segmentation = segment(sequence, options.cameras, standing)
    else:
        segmentation = segment_by(masker, sequence, options.cameras)
    depth = sequence.depth if options.from_depth else None
    if isinstance(segmentation, ByRest):  # frames without noise: their own surface, of which none has to be measured
        background, noisy = segmentation.room, Mesh.empty()
    else:
        if standing is not None:
            _check_it_rests(sequence, segmentation, standing)
        background = noisy = _background(sequence, depth, segmentation)
        if background.is_empty:
            _check_nothing_lost(sequence, segmentation)
    changes = [_change(sequence, depth, segmentation, frame) for frame in segmentation.changes]
    sizes, noise = _measured(sequence, segmentation, noisy, changes)
    survey = replace(survey, scale=(float(np.median(sizes)) if sizes else 0.0) or survey.diagonal)
    free, seen = free_space(sequence), len(background.faces)
    if options.close_planes and free:
        background = _closed(background, noise, free, changes)
    views, guesses = Views.of(sequence, survey), len(background.faces) - seen
    return Parts(survey, segmentation, background, changes, noise, free, views, guesses)


def _closed(background: Mesh, noise: LocalNoise, free: Sequence[FreeSpace], changes: Sequence[Change]) -> Mesh:
    """Close holes in planes of the background that no depth camera saw into and that no later surface fills."""
    came = _rooms(Mesh.empty(), changes)(len(changes))

    def is_open(points: Float64[np.ndarray, "N 3"], normals: Float64[np.ndarray, "N 3"]) -> Bool[np.ndarray, " N"]:
        through = np.sum([one.at(points) for one in free], axis=0) >= min(SEEN_THROUGH, len(free))
        blank = np.sum([one.blank(points, normals) for one in free], axis=0) > BLANK * len(free)
        later = np.zeros(len(points), bool) if came is None else came.distances(points) <= LEAST_APART
        return through | later | (blank.mean() > BLANK)

    return close_planes(background, lambda points: noise.at(points)[0], is_open)


def free_space(sequence: CapturedSequence) -> tuple[FreeSpace, ...]:
    """Return the space that depth cameras saw through in some frames; none if no depth is known."""
    depth, some = sequence.depth, evenly(len(sequence), PROBES)
    return () if depth is None else tuple(FreeSpace.of(depth[number]) for number in some)


def cameras_of(pictures: DepthFrames | ColorFrames | None, count: int) -> tuple[Camera, ...]:
    """Return the cameras of the pictures of `count` frames, some of which may lack a camera's picture.

    None where one moves: what is known of a place in its picture holds for no other frame.
    """
    found = dict[int, Camera]()
    if pictures is None or is_carried(pictures.__getitem__, count):
        return ()
    for number in evenly(count, PROBES):
        some = pictures[number]
        found |= {at: each.camera for at, each in enumerate(some) if each is not None}
        if len(found) == len(some):
            break
    return tuple(found[at] for at in sorted(found))


def _check_it_rests(sequence: MeshSequence, segmentation: Segmentation, standing: Standing) -> None:
    """Raise NoRoom where too much of the surface that is called still is elsewhere at other times."""
    still, moved, most, where = 0.0, 0.0, 0.0, ""
    for number in evenly(len(sequence), LOOKED_AT):
        mesh = sequence[number]
        areas = np.where(segmentation.moving(number, mesh), 0, face_normals(mesh)[1])
        chosen = standing.moves(mesh) & (areas > 0)
        still, moved = still + float(areas.sum()), moved + float(areas[chosen].sum())
        if areas[chosen].sum() > most:
            most, place = areas[chosen].sum(), np.median(mesh.vertices[mesh.faces[chosen]], axis=(0, 1))
            where = f"around {place[0]:.2f} {place[1]:.2f} {place[2]:.2f} in frame {number}"
    if moved > (MOVED_SENSED if standing.sensed else MOVED) * still:
        text = f"{100 * moved / still:.0f} % of what seems to stand still moves by more than its noise, most of it"
        raise NoRoom(f"{text} {where}")


def _check_nothing_lost(sequence: MeshSequence, segmentation: Segmentation) -> None:
    """Raise NoRoom where there is no background, but much of a frame stands still: the file would lack it."""
    for number in evenly(len(sequence), FRAMES):
        mesh = sequence[number]
        still = segmentation.still_at_first(number, mesh)
        if still.sum() > LOST * len(mesh.faces):
            text = f"{still.sum()} of {len(mesh.faces)} faces of frame {number}, which is {mesh.diagonal:.3g} m large,"
            raise NoRoom(f"{text} stand still, but are too small for a room")


def _background(sequence: CapturedSequence, depth: DepthFrames | None, segmentation: Segmentation) -> Mesh:
    """Fuse the surface that stands still at first, from the cameras' depth where it is known."""
    cell = segmentation.cell
    is_moving = depth is not None and is_carried(depth.__getitem__, len(sequence))
    numbers = evenly(len(sequence), WALKED if is_moving else FRAMES)

    def stands(number: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        passed("background")
        return segmentation.still_at_first(number, mesh)

    if depth is not None:
        return _fused(sequence, depth, numbers, stands, cell, is_moving)

    def clear(number: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
        still = stands(number, mesh)
        return still & ~ring(mesh, ~still, cell)

    return fuse_background(picked(sequence, numbers, clear), cell)


def _fused(
    sequence: CapturedSequence,
    depth: DepthFrames,
    numbers: Sequence[int],
    still: Callable[[int, Mesh], Bool[np.ndarray, " F"]],
    cell: float,
    is_moving: bool,
) -> Mesh:
    """Fuse the still faces of some frames from their depth pictures, which are known; cameras may be moving."""

    def moment(number: int) -> Moment:
        mesh = sequence[number]
        return Moment(depth[number], mesh, still(number, mesh))

    return (fuse_walk if is_moving else fuse_still_depth)(ahead(moment, numbers), cell)


def _change(sequence: CapturedSequence, depth: DepthFrames | None, segmentation: Segmentation, frame: int) -> Change:
    numbers = [frame + number for number in evenly(len(sequence) - frame, FRAMES)]
    if depth is not None:

        def still(number: int, mesh: Mesh) -> Bool[np.ndarray, " F"]:
            return ~segmentation.moving(number, mesh)

        is_moving = is_carried(depth.__getitem__, len(sequence))
        room = _fused(sequence, depth, numbers, still, segmentation.cell, is_moving)
        return Change(frame, part_of(room, segmentation.came(frame, room)))
    later = picked(sequence, numbers, lambda _, mesh: segmentation.came(frame, mesh))
    return Change(frame, fuse_background(later, segmentation.cell))


def _rooms(background: Mesh, changes: Sequence[Change]) -> Callable[[int], Surface | None]:
    """Return a callable that prepares all that stood in the room up to so many changes; None where that is nothing."""

    @lru_cache(maxsize=2)  # the first, and the one that frames of the same time have
    def after(count: int) -> Surface | None:
        there = concatenate([background, *(change.came for change in changes[:count])])
        return None if there.is_empty else Surface(there)

    return after


def _measured(
    sequence: CapturedSequence, segmentation: Segmentation, background: Mesh, changes: Sequence[Change]
) -> tuple[list[float], LocalNoise]:
    """Return the diagonals of the largest body in each of some frames, m, and the noise of still surface.

    Surface that is far from the background is no noise.
    """
    far, sizes = OUTLIER * segmentation.noise, list[float]()
    places, distances = list[Float64[np.ndarray, "N 3"]](), list[Float64[np.ndarray, " N"]]()
    room_after = _rooms(background, changes)

    def seen(number: int) -> tuple[Mesh, Bool[np.ndarray, " F"]]:
        mesh = sequence[number]
        return mesh, segmentation.moving(number, mesh)

    some = evenly(len(sequence), PROBES)
    for number, (mesh, moves) in zip(some, ahead(seen, some), strict=True):
        passed("noise")
        moving = part_of(mesh, moves)
        if moves.any():
            label = components(moving.faces, len(moving.vertices))
            largest = moving.vertices[label == np.bincount(label).argmax()]
            sizes.append(Mesh(largest, moving.faces[:0]).diagonal)
        still = part_of(mesh, ~moves)
        room = room_after(sum(change.frame <= number for change in changes))
        if room is not None and not still.is_empty:
            points = still.vertices[area_samples(still, SAMPLES)]
            hits = room.closest(points)
            ways = points - hits.points
            gaps, outward = np.linalg.norm(ways, axis=1), (ways * room.normals[hits.faces]).sum(axis=1)
            places.append(points[gaps < far])
            distances.append(np.copysign(gaps, outward)[gaps < far])
    fine = REGION * segmentation.cell
    wide = max(fine, float(np.median(sizes or [0.0])) / 2)
    return sizes, LocalNoise.of(places, distances, fine, wide, cameras_of(sequence.depth, len(sequence)))


_COLORS = ("depth", "hue", "limit")  # arrays of a ColorChange
_DAMAGED = (KeyError, ValueError, TypeError, IndexError, OSError, EOFError, zipfile.BadZipFile, zlib.error)


def pack_parts(parts: Parts) -> bytes | None:
    """Pack the parts of a scene; None where masks segment it, whose source only the next run can open."""
    by = parts.segmentation
    if not isinstance(by, ByPlace):
        return None
    arrays: dict[str, Any] = {
        "numbers": [parts.survey.unit, by.cell, by.lattice.size, by.island, parts.guesses],
        "noise places": parts.noise.places,
        "noise": np.stack([parts.noise.rms, parts.noise.off]),
        "origin": by.lattice.origin,
        "keys": by.keys,
        "chosen": by.chosen,
        "until": by.rest.until,
        "since": by.rest.since,
        "changes": np.array([change.frame for change in parts.changes], np.int64),
    }
    for number, mesh in enumerate([parts.background, *(change.came for change in parts.changes)]):
        arrays |= {f"vertices {number}": mesh.vertices, f"faces {number}": mesh.faces}
        arrays |= {} if mesh.colors is None else {f"colors {number}": mesh.colors}
    if by.colors is not None:
        arrays |= {name: getattr(by.colors, name) for name in _COLORS}
        arrays |= {"looks": by.colors.looks.frame, "nearer": by.colors.nearer}
    packed = io.BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **arrays)
    return packed.getvalue()


def unpack_parts(data: bytes, sequence: CapturedSequence, survey: Survey) -> Parts | None:
    """Return the parts of a surveyed scene, or None where no encoder packed them."""
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            unit, cell, size, island, guesses = arrays["numbers"].tolist()
            rms, off = arrays["noise"]
            noise = LocalNoise(arrays["noise places"], rms, off, cameras_of(sequence.depth, len(sequence)))
            rest = Rest(arrays["until"], arrays["since"])
            places = Lattice(arrays["origin"], size), arrays["keys"], arrays["chosen"]
            by = ByPlace(cell, *places, rest, island, _colors(arrays, sequence))
            frames = arrays["changes"].tolist()
            background, *came = (
                Mesh(arrays[f"vertices {number}"], arrays[f"faces {number}"], arrays.get(f"colors {number}"))
                for number in range(1 + len(frames))
            )
    except _DAMAGED:
        return None
    changes = [Change(frame, mesh) for frame, mesh in zip(frames, came, strict=True)]
    survey = replace(survey, scale=unit)
    return Parts(survey, by, background, changes, noise, free_space(sequence), Views.of(sequence, survey), int(guesses))


def _colors(arrays: Any, sequence: CapturedSequence) -> ColorChange | None:
    """Return the usual view of the colour cameras, or None if the scene has none."""
    if "looks" not in arrays or sequence.colors is None:
        return None
    looks = ColorLooks(sequence.colors, int(arrays["looks"]), CHANGE_SIDE)
    return ColorChange(looks, float(arrays["nearer"]), *(arrays[name] for name in _COLORS))
