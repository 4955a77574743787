"""Measure cameras that move (decision 45): the demo's room before a camera in a hand, and before one that stands still.

`python -m meshreel_bench.decisions.walks FOLDER [7-SCENES]` simulates both in FOLDER, encodes them, compares them with
the truth and with their depth, and prints a row of docs/decisions/measured.jsonl for each; some ten minutes.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from meshreel.capture.calibration.paths import kept, refine_paths, refined
from meshreel.capture.recordings import open_take
from meshreel.capture.recordings.to_rig import write_takes
from meshreel.capture.rig.cameras import DepthCamera
from meshreel.capture.rig.rig import POSES, read_rig
from meshreel.capture.simulated.sensors import SensorOptions
from meshreel.capture.simulated.simulated_rig import TRUTH, ColorSensorOptions, simulate_rig
from meshreel.capture.simulated.stage import COLOR_SCALE, NOISE, WIDTH, StageOptions, stage, stage_cameras
from meshreel.geometry.cameras import CameraPose, looking_at

Row = dict[str, Any]
FRAMES, RATE = 40, 20.0  # of the simulated takes, and 1/s
DRIFT = (0.01, 0.5)  # m and degrees, standard deviation of the last recorded pose
TRUTH_EVERY = 4  # frames
STILL = 13  # the pose of the walk from which the camera that stands still looks


def walking(count: int, width: int = WIDTH) -> DepthCamera:
    """Return a camera that a hand carries to and fro before the open side of the demo's room."""
    path = dict[int, CameraPose]()
    for k in range(count):
        angle = math.radians(28 * math.sin(2 * math.pi * 0.8 * k / max(count - 1, 1)))
        tremble = np.array([0.02 * math.sin(0.9 * k), 0.05 * math.sin(0.35 * k), 0.02 * math.cos(0.7 * k)])
        eye = np.array([2.7 * math.sin(angle), 1.5, 2.7 * math.cos(angle)]) + tremble
        path[k] = CameraPose.of_camera(looking_at(eye, np.array([0.25 * math.sin(0.2 * k), 0.9, -0.3])))
    one = stage_cameras(width)[0]
    still = path[min(STILL, count - 1)]
    return replace(one, name="phone", view=replace(one.view, pose=still), path=path)


def simulated(folder: Path, camera: DepthCamera, count: int, drift: tuple[float, float]) -> Path:
    """Write what a camera measures of the demo's scene, and the truth; return the rig's folder."""
    sensor, color = SensorOptions(noise=NOISE, pose_error=drift), ColorSensorOptions(scale=COLOR_SCALE, noise=1.0)
    simulate_rig(folder, stage(StageOptions(count, RATE)), (camera,), RATE, sensor, color=color)
    return folder


def rows(folder: Path, scan: Path | None = None, count: int = FRAMES, width: int = WIDTH) -> Iterator[Row]:
    """Yield the row of the still camera, of the walk, and of a recording of a walk if there is one."""
    camera = walking(count, width)
    still = simulated(folder / "still", replace(camera, path={}), count, (0.0, 0.0))
    yield {"case": "simulated: one camera that stands still"} | compared(still)
    yield {"case": f"simulated: a walk of {count} frames"} | walked(simulated(folder / "walk", camera, count, DRIFT))
    if scan is not None:
        rig = folder / "scan"
        write_takes([open_take(scan)], rig)
        for file in rig.rglob(POSES):  # as recorded: `walked` refines, and tells of both
            if kept(file).exists():
                kept(file).replace(file)
        yield {"case": f"7-scenes: a walk of {len(read_rig(rig).frames)} frames"} | walked(rig)


def walked(rig: Path) -> Row:
    """Refine the poses of a rig's first camera; return by how much, and what `compared` does."""
    found = refined(read_rig(rig), 0)
    refine_paths(rig)
    before, after = (None, None) if found is None else (1000 * found[1], 1000 * found[2])
    return {"before_mm": before, "after_mm": after} | compared(rig)


def compared(rig: Path) -> Row:
    """Encode a rig; return the file's size and how near it is to the truth, if there is one, and to the depth."""
    file, truth = rig.with_suffix(".reel"), rig / TRUTH
    subprocess.run([sys.executable, "-m", "meshreel", "encode", str(rig), "-o", str(file), "--quiet"], check=True)
    knowing = ["--truth", str(truth), "--truth-every", str(TRUTH_EVERY)] if truth.is_dir() else []
    command = [sys.executable, "-m", "meshreel", "compare", str(rig), str(file), "--no-ssim", "--json", *knowing]
    told = json.loads(subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout)
    row: Row = {"bytes": file.stat().st_size}
    row |= {name: told["depth"]["decoded"][name] for name in ("all_covered", "all_invented")}
    if knowing:
        decoded = told["truth"]["decoded"]
        row |= {f"{part}_median_mm": 1000 * decoded[f"{part}_median_m"] for part in ("people", "background")}
        row["people_covered"] = decoded["people_covered"]
    return row


if __name__ == "__main__":
    given = [Path(argument) for argument in sys.argv[1:]]
    for row in rows(given[0], given[1] if len(given) > 1 else None):
        print(json.dumps({"decision": "walks"} | row), flush=True)
