"""A rig's recording as a benchmark has it: each frame fused once and kept as a file."""

from __future__ import annotations

from pathlib import Path

from meshreel.capture.recording import Recording
from meshreel.geometry.cameras import Camera
from meshreel.geometry.color_views import ColorFrames
from meshreel.geometry.depth import DepthFrames
from meshreel.io.sequence import open_sequence
from meshreel.io.write import frame_names, make_folder, write_mesh
from meshreel.types import Frames, Mesh, Up


class Captured(Frames):
    """The frames of a recording, made as `meshreel capture` makes them where the folder lacks them."""

    def __init__(self, recording: Recording, folder: Path) -> None:
        make_folder(folder)
        for number, name in enumerate(frame_names(len(recording), "ply")):
            if not (folder / name).exists():
                write_mesh(recording[number], folder / name)
        self._recording, self._meshes = recording, open_sequence(folder)
        self.frame_rate = recording.frame_rate

    def __len__(self) -> int:
        return len(self._recording)

    def __getitem__(self, index: int) -> Mesh:
        return self._meshes[range(len(self))[index]]

    @property
    def cameras(self) -> tuple[Camera, ...]:
        """Cameras of the capture."""
        return tuple(camera.view for camera in self._recording.rig.cameras)

    @property
    def up(self) -> Up:
        """The axis that points up."""
        return self._recording.up

    @property
    def colors(self) -> ColorFrames | None:
        """The pictures of the colour cameras, by frame."""
        return self._recording.colors

    @property
    def depth(self) -> DepthFrames:
        """The depth pictures of the cameras, by frame."""
        return self._recording.depth
