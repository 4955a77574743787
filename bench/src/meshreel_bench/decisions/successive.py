"""Eight successive frames of a file as the first camera of its recording sees them, in the colours of their normals.

`python -m meshreel_bench.decisions.successive RIG FILE PICTURE [FIRST]` draws PICTURE-fused and PICTURE-decoded.
"""

from __future__ import annotations

import sys
from pathlib import Path

import meshreel
from meshreel.capture.recording import open_recording
from meshreel.metrics.render import Crop, look

from .drawing import Sheet

FRAMES, ROWS = 8, ("fused", "decoded")


def main(rig: Path, file: Path, picture: Path, first: int = 0) -> None:
    """Draw a row of each."""
    recording, _ = open_recording(rig)
    camera = recording.rig.cameras[0].view
    crop = Crop(0, camera.height, 0, camera.width)
    with meshreel.open(file) as video:
        for row, frames in zip(ROWS, (recording, video), strict=True):
            sheet = Sheet(FRAMES, camera.width)
            for panel in range(FRAMES):
                frame = first + panel
                sheet.image(panel, f"{row}, frame {frame}", look(frames[frame], camera, crop).colors)
            sheet.write(picture.with_stem(f"{picture.stem}-{row}"))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), Path(sys.argv[3]), int(sys.argv[4]) if sys.argv[4:] else 0)
