"""The benchmark scenes `room2` and `room2-standing` (`meshreel_bench.datasets.rooms`) as rigs in a folder.

python benchmarks/rooms.py -o build/room2                            # 60 frames in which they walk; five minutes
python benchmarks/rooms.py --scene room2-standing -o build/standing   # in which they hardly move
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from meshreel_bench.datasets.rooms import CAMERAS, FRAMES, SPEEDS, RoomOptions, simulate_room

from meshreel.capture.simulated_rig import SensorOptions


def main(arguments: list[str]) -> int:
    """Writes one scene."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, required=True)
    parser.add_argument("--scene", choices=tuple(SPEEDS), default="room2")
    parser.add_argument("--data", type=Path, default=Path("../shared/data"))
    parser.add_argument("--frames", type=int, default=FRAMES)
    parser.add_argument("--noise", type=float, default=SensorOptions().noise)
    chosen = parser.parse_args(arguments)
    options = RoomOptions(chosen.scene, chosen.frames, SensorOptions(noise=chosen.noise))
    count = simulate_room(chosen.output, chosen.data, options, lambda done: print(f"\r{done}", end=""))
    print(f"\r{chosen.output}: {count} frames of {CAMERAS} cameras")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
