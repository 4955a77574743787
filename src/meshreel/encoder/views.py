"""Colour cameras as the encoder looks through them: at one frame, in normalised coordinates."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..analysis.survey import Survey
from ..geometry.color_views import MARGIN, ColorFrames, ColorViews
from ..geometry.derived_sequences import CapturedSequence, only
from ..types import MeshSequence, Placement


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

    def at(self, number: int, clear: bool = False) -> ColorViews:
        """Return what the cameras saw in a frame; if `clear`, only away from steps in depth."""
        place = self.place
        pictures = [picture.placed(place) for picture in self.colors[number] if picture is not None]
        mesh = self.sequence[number]
        return ColorViews(pictures, mesh.at((mesh.vertices - place.origin) / place.scale), MARGIN / place.scale, clear)
