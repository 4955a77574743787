"""Cameras as the encoder looks through them: at one frame, in normalised coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ...analysis.survey import Survey
from ...geometry.color_views import MARGIN, ColorFrames, ColorPicture, ColorViews
from ...geometry.depth import DepthFrames, FreeSpace
from ...geometry.derived_sequences import CapturedSequence, only
from ...types import Mesh, MeshSequence, Placement


@dataclass(frozen=True, slots=True)
class Views:
    """The colour pictures of a sequence, and its frames, whose surface hides what is behind it."""

    colors: ColorFrames
    sequence: MeshSequence
    place: Placement  # of the coordinates in which the cameras are asked

    @staticmethod
    def of(sequence: CapturedSequence, seen: Survey) -> Views | None:
        """Return the views of a sequence, None where no colour cameras recorded it."""
        colors = sequence.colors
        return None if colors is None else Views(colors, sequence, Placement(seen.unit, tuple(seen.center)))

    def only(self, numbers: Sequence[int]) -> Views:
        """Return the views of these frames, under the same numbers, to send to another process."""
        return replace(self, sequence=only(self.sequence, numbers))

    def at(self, number: int, clear: bool = False, hides: Mesh | None = None) -> ColorViews:
        """Return the cameras' views of a frame; if `clear`, only away from steps in depth.

        What hides a place is the surface of the frame, or another one in normalised coordinates.
        """
        hides = self.surface(number) if hides is None else hides
        return ColorViews(self.pictures(number), hides, MARGIN / self.place.scale, clear)

    def pictures(self, number: int) -> list[ColorPicture]:
        """Return the pictures of a frame, for places in normalised coordinates."""
        return [picture.placed(self.place) for picture in self.colors[number] if picture is not None]

    def surface(self, number: int) -> Mesh:
        """Return all surface of a frame, in normalised coordinates."""
        mesh, place = self.sequence[number], self.place
        return mesh.at((mesh.vertices - place.origin) / place.scale)


@dataclass(frozen=True, slots=True)
class Sight:
    """The depth pictures of a sequence, which tell where there is no surface."""

    depth: DepthFrames
    place: Placement  # of the coordinates in which they are asked

    @staticmethod
    def of(sequence: CapturedSequence, seen: Survey) -> Sight | None:
        """Return the sight of a sequence, None where no depth cameras are known."""
        return None if sequence.depth is None else Sight(sequence.depth, Placement(seen.unit, tuple(seen.center)))

    def at(self, number: int) -> FreeSpace:
        """Return the space that cameras saw through in a frame."""
        return FreeSpace.of(self.depth[number], self.place)
