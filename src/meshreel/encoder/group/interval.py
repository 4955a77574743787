"""Intervals: frames of one track that need no others to be encoded, with their noise and their cameras."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from operator import attrgetter
from typing import Any

import numpy as np
from jaxtyping import Float64

from ...analysis.scene.standing import LocalNoise
from ...analysis.survey import Survey, piece_of_faces
from ...errors import InputError
from ...geometry.color_views import MARGIN, ColorFrames, ColorPicture, ColorViews, Paint, Painted
from ...geometry.depth import DepthFrames, DepthPicture, FreeSpace
from ...geometry.derived_sequences import CapturedSequence, DerivedSequence, Recent, only
from ...geometry.topology import clean, part_of
from ...types import Frames, Mesh, MeshSequence, Placement, Up, offset

UNEVEN = (0.25, 4.0)  # least and most noise of a place, in RMS noises of the frames (guess)
MOST_RECENT = 1 << 27  # bytes: what four cameras of 1280 x 1152 pixels see in 40 frames, or their pictures in 7
MOST_FRAMES = 64  # in a group: the tracker's distances and the basis grow with it (guess)


@dataclass(frozen=True, slots=True)
class Interval:
    """Frames that are encoded together and need no others; all are empty or none is."""

    frames: Frames  # normalised
    noise: float = 0.0  # RMS distance of the frames from the truth, normalised; 0: a clean capture
    local: LocalNoise | None = field(default=None, kw_only=True)  # the noise by place, m; None: alike everywhere
    place: Placement = field(
        default=Placement(1.0, (0.0, 0.0, 0.0)), kw_only=True
    )  # of the frames, for noise and depth
    frame_rate: float = field(default=30.0, kw_only=True)  # 1/s
    first_frame: int = 0  # its number in the sequence
    track: int = 0
    # Digest of the frames; empty where they are frames of the sequence, or pieces of them: it has their digests.
    surface: str = ""
    up: Up = field(default="y", kw_only=True)  # the axis that points up
    views: Views | None = field(default=None, kw_only=True)  # of colour cameras
    depth: DepthFrames | None = field(default=None, kw_only=True)  # of the sequence
    weight: Fraction = field(default=Fraction(1), kw_only=True)  # of each frame in progress: bodies share a frame
    pictured: bool = field(default=False, kw_only=True)  # with textures or splats, which frames of Draco cannot have
    larger: float = field(default=1.0, kw_only=True)  # diagonal of whole frames / of this body: targets are of frames

    @property
    def stop(self) -> int:
        """The number of the frame that follows."""
        return self.first_frame + len(self.frames)

    def to_send(self) -> Interval:
        """Return the interval for a worker process, which reads those of its frames that are in files."""
        frames = self.frames.only() if isinstance(self.frames, NormalisedFrames) else self.frames
        if (views := self.views) is not None:
            views = replace(views, sequence=only(views.sequence, range(self.first_frame, self.stop)))
        return replace(self, frames=frames, views=views)

    def paint(self, number: int, mesh: Mesh) -> Paint | None:
        """Return the colour source of frame `number`, counted from the first, with this mesh; None: no colours."""
        if mesh.is_empty or not (mesh.is_colored or self.views is not None):
            return None
        return Painted(mesh) if self.views is None else self.views.at(self._of_sequence(number))

    def unevenness(self, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"] | None:
        """Return the noise at points of the frames, in units of `noise`; None where it is the same everywhere."""
        if self.local is None or self.noise == 0:
            return None
        found = self.local.at(self.place.origin + self.place.scale * points)[0]
        return np.clip(found / (self.place.scale * self.noise), *UNEVEN)

    def free(self, number: int) -> FreeSpace | None:
        """Return the space that cameras saw through in frame `number`, counted from the first; None if unknown."""
        return None if self.depth is None else FreeSpace.of(self.depth[self._of_sequence(number)], self.place)

    def _of_sequence(self, number: int) -> int:
        return self.first_frame + offset(number, range(len(self.frames)))

    @property
    def observed(self) -> Any:
        """Observations from reading the frames, for `learn` of the interval that was sent."""
        return self.frames.sequence.observed if isinstance(self.frames, NormalisedFrames) else None

    def learn(self, observed: Any) -> None:
        """Take what a worker observed. Raises InputError for a frame that has changed since it was read first."""
        if isinstance(self.frames, NormalisedFrames):
            self.frames.sequence.learn(observed)


class NormalisedFrames(Frames):
    """Frames of a sequence in normalised coordinates, computed on access."""

    def __init__(self, sequence: DerivedSequence, survey: Survey, numbers: range) -> None:
        self.sequence, self._survey, self._numbers = sequence, survey, numbers

    def __len__(self) -> int:
        return len(self._numbers)

    def __getitem__(self, index: int) -> Mesh:
        return self._survey.normalise(self.sequence[self._numbers[offset(index, range(len(self)))]])

    def only(self) -> NormalisedFrames:
        """Return the same frames, with nothing else of their sequence."""
        found = copy.copy(self)
        found.sequence = self.sequence.only(self._numbers)
        found._survey = replace(self._survey, diagonals=(), flattened=(), pieces=())  # normalising needs none of these
        return found


class BodyFrames(NormalisedFrames):
    """One body of frames of a sequence, cut out on access."""

    def __init__(
        self, sequence: DerivedSequence, survey: Survey, numbers: range, body: int, bodies: tuple[tuple[int, ...], ...]
    ) -> None:
        """Take of each frame the pieces that are this body; `bodies` has the body of each piece of each frame."""
        super().__init__(sequence, survey, numbers)
        self._body, self._bodies = body, bodies

    def __getitem__(self, index: int) -> Mesh:
        """Return the body in a frame. Raises InputError for a survey that has other pieces of the frame."""
        mesh, bodies = clean(self.sequence[self._numbers[offset(index, range(len(self)))]]), self._bodies[index]
        pieces = piece_of_faces(mesh)
        if (count := 1 + int(pieces.max(initial=0))) != len(bodies):
            text = f"{self.sequence.name(self._numbers[index])}: has {count} large pieces, in its survey {len(bodies)}"
            raise InputError(f"{text}; write it again with meshreel survey")
        return self._survey.normalise(part_of(mesh, np.array(bodies)[pieces] == self._body))


def frames_in(key_interval: float, frame_rate: float) -> int:
    """Return the largest number of frames in a key interval, s."""
    return max(1, round(key_interval * frame_rate))


def check_group_size(size: int) -> None:
    """Raise InputError for a group that may hold no frame, or more than `MOST_FRAMES`."""
    if not 1 <= size <= MOST_FRAMES:
        raise InputError(f"group size must be in 1 to {MOST_FRAMES}, got {size}")


@dataclass(frozen=True, slots=True)
class Views:
    """The colour pictures of a sequence, and its frames, whose surface hides what is behind it."""

    colors: ColorFrames
    sequence: MeshSequence
    place: Placement  # of the coordinates in which the cameras are asked
    depth: DepthFrames | None = None  # of the sequence
    seen: Recent[ColorViews] = field(
        default_factory=lambda: Recent(MOST_RECENT, attrgetter("nbytes")), kw_only=True, compare=False
    )  # without pictures
    placed: Recent[list[ColorPicture]] = field(
        default_factory=lambda: Recent(MOST_RECENT, _bytes_of_pictures), kw_only=True, compare=False
    )

    @staticmethod
    def of(sequence: CapturedSequence, survey: Survey) -> Views | None:
        """Return the views of a sequence, None where no colour cameras recorded it."""
        colors, place = sequence.colors, Placement(survey.unit, tuple(survey.center))
        return None if colors is None else Views(colors, sequence, place, sequence.depth)

    def at(self, number: int) -> ColorViews:
        """Return the cameras' views of a frame, whose surface hides a place; those asked for last are kept."""
        if (views := self.seen.get(number)) is None:
            measured = () if self.depth is None else self.depth[number]
            depths = [picture.placed(self.place) for picture in measured if picture is not None]
            views = self.of_surface(number, self.surface(number), depths).without_pictures
            self.seen.keep(number, views)
        return views.with_pictures(self.pictures(number))

    def of_surface(self, number: int, hides: Mesh, depths: Sequence[DepthPicture] = ()) -> ColorViews:
        """Return the cameras' views of a surface in a frame, in normalised coordinates."""
        return ColorViews(self.pictures(number), hides, MARGIN / self.place.scale, depths)

    def pictures(self, number: int) -> list[ColorPicture]:
        """Return the pictures of a frame, for places in normalised coordinates; those asked for last are kept."""
        if (pictures := self.placed.get(number)) is None:
            pictures = [picture.placed(self.place) for picture in self.colors[number] if picture is not None]
            self.placed.keep(number, pictures)
        return pictures

    def surface(self, number: int) -> Mesh:
        """Return all surface of a frame, in normalised coordinates."""
        mesh, place = self.sequence[number], self.place
        return mesh.at((mesh.vertices - place.origin) / place.scale)


def _bytes_of_pictures(pictures: list[ColorPicture]) -> int:
    return sum(picture.pixels.nbytes for picture in pictures)
