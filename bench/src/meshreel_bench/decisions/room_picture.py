"""The picture of docs/tutorial.md: the procedural room as it is captured, taken apart, coded and decoded."""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from meshreel.analysis.scene.segmentation import segment
from meshreel.capture.recording import Recording, open_recording
from meshreel.capture.rig.fusion import FusionOptions
from meshreel.capture.simulated.demo_room import RoomOptions, furnished_room, room_cameras
from meshreel.capture.simulated.simulated_rig import SensorOptions, simulate_rig
from meshreel.decoder.video import open as open_video
from meshreel.encoder.sequence import encode
from meshreel.geometry.topology import components, concatenate, part_of
from meshreel.types import Mesh

from .drawing import BODIES, Sheet, oblique, shaded

FRAMES, SHOWN = 20, 9
WIDTH, NOISE, VOXEL = 256, 0.3, 0.03  # as `meshreel demo` has them
PANEL = 300  # pixels
GREY = np.full(3, 0.82)
FROM = np.array([0.42, 0.42, 1.0])  # where the picture is seen from


def draw(path: Path) -> None:
    """A fused frame, the faces that move, the background alone, the frame decoded."""
    with tempfile.TemporaryDirectory() as folder:
        capture = captured(Path(folder) / "rig")
        frame, moves = capture[SHOWN], segment(capture).moving(SHOWN, capture[SHOWN])
        encode(capture, Path(folder) / "room.reel")
        with open_video(Path(folder) / "room.reel") as video:
            background, decoded = video.background(SHOWN), video[SHOWN]
    sheet, camera = Sheet(4, PANEL), oblique([background], FROM, (PANEL, PANEL), 1.03)
    colored, colors = _colored(frame, moves)
    sheet.image(0, f"fused: {len(frame.faces)} faces", shaded(frame, camera))
    sheet.image(1, f"moving: {100 * moves.mean():.0f} % of the faces", shaded(colored, camera, colors))
    sheet.image(2, f"background, once: {len(background.faces)} faces", shaded(background, camera))
    sheet.image(3, f"decoded: {len(decoded.faces)} faces", shaded(decoded, camera))
    sheet.write(path)


def captured(folder: Path) -> Recording:
    """The frames as they are fused."""
    room = furnished_room(RoomOptions(frames=FRAMES))
    simulate_rig(folder, room, room_cameras(WIDTH), room.options.frame_rate, SensorOptions(noise=NOISE))
    return open_recording(folder, FusionOptions(VOXEL))[0]


def _colored(mesh: Mesh, moves: np.ndarray) -> tuple[Mesh, Float64[np.ndarray, "V 3"]]:
    """The mesh with what moves split off, and a color for each of its vertices: one a body, the largest first."""
    still, moving = (part_of(mesh, chosen) for chosen in (~moves, moves))
    label = components(moving.faces, len(moving.vertices))
    rank = np.argsort(np.argsort(-np.bincount(label), kind="stable"), kind="stable")[label]
    colors = np.concatenate([np.tile(GREY, (len(still.vertices), 1)), BODIES[rank % len(BODIES)]])
    return concatenate([still, moving]), colors
