"""Writes a .reel file with a tone to its standard output, for tests of the player: its start, and the tone's length."""

import sys
import tempfile
from pathlib import Path

from meshreel.edit.edits import retime, tag
from tests.golden import GOLDEN
from tests.tones import tone

FRAME_RATE = 3.5  # 1/s: 14 frames last 4 s


def heard(start: float, seconds: float) -> bytes:
    """The bytes of a file of 4 s, whose tone begins `start` seconds after its first frame."""
    with tempfile.TemporaryDirectory() as folder:
        slow, found = Path(folder, "slow.reel"), Path(folder, "heard.reel")
        retime(GOLDEN / "scene.reel", slow, FRAME_RATE)
        tag(slow, found, audio=tone(seconds), audio_start=start)
        return found.read_bytes()


if __name__ == "__main__":
    sys.stdout.buffer.write(heard(*map(float, sys.argv[1:])))
