"""The moving picture of README.md: the room of `meshreel demo`, in the player.

`python -m meshreel_bench.decisions.moving_picture [FOLDER [DEMO]]` writes moving.webp, and moving.json with the numbers
of README.md, into docs/pictures. It runs the demo first, some minutes, unless it is given the folder of one.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

import meshreel
from meshreel.capture.rig.rig import read_cameras

from ..measure.headset import WEB, playing

FRAMES = 40  # of the recording
ALL = 99  # layers: no file has more
SIZE = (640, 420)  # pixels, width and height
QUALITY = 75  # of WebP, 0 to 100; chosen by eye


def main(folder: Path = Path("docs/pictures"), demo: Path | None = None) -> None:
    """Write the moving picture of the demo and its numbers."""
    with tempfile.TemporaryDirectory() as temporary:
        if demo is None:
            demo = Path(temporary) / "demo"
            command = [sys.executable, "-m", "meshreel", "demo", "-o", str(demo), "--frames", str(FRAMES)]
            subprocess.run(command, check=True)
        file = demo / "demo.reel"
        with meshreel.open(file) as video:
            frames, rate = len(video), video.frame_rate
        pictures = played(file, range(frames), Path(temporary))
    path, ms = folder / "moving.webp", round(1000 / rate)
    pictures[0].save(path, save_all=True, append_images=pictures[1:], duration=ms, quality=QUALITY, method=6)
    cameras = len(read_cameras(demo / "rig")[0])
    facts = {"frames": frames, "frame_rate": rate, "cameras": cameras, "bytes": file.stat().st_size}
    (folder / "moving.json").write_text(json.dumps(facts) + "\n", encoding="utf-8")


def played(file: Path, frames: range, folder: Path) -> list[Image.Image]:
    """Return the player's pictures of frames."""
    query = f"?autoplay=0&controls=0&layers={ALL}&interpolate=off"
    with playing(file) as address:
        values = [address + query, folder, *SIZE, *frames]
        subprocess.run(["node", "frames.mjs", *map(str, values)], cwd=WEB, check=True)
    return [Image.open(folder / f"{frame}.png").convert("RGB") for frame in frames]


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
