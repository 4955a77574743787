"""Folders of the app Stray Scanner: depth of a LiDAR as PNG, colour as a video, and the phone's poses.

`depth/000000.png` (mm), `confidence/`, `rgb.mp4`, `camera_matrix.csv` of the colour pictures, `odometry.csv` with x
right, y down, z forward: https://github.com/strayrobots/scanner. Depth is aligned with colour.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np

from ...errors import InputError
from ...io.files import read_file, read_input
from ...io.pictures import last_number, read_depth, read_picture
from ..calibration.poses import pose_of
from .takes import Pictures, Poses, Sensor, Stream, Take, lens_of, picture_size, reading

KIND = "a Stray Scanner folder (depth/, rgb.mp4, odometry.csv)"
MATRIX, VIDEO = "camera_matrix.csv", "rgb.mp4"
RATE = 60.0  # 1/s, of ARKit's frames, where odometry.csv has no times


def fits(path: Path) -> bool:
    return (path / "odometry.csv").is_file() and (path / "depth").is_dir()


def read(path: Path) -> Take:
    with reading(path / "odometry.csv"):
        times, poses = _odometry(path)
    files = sorted((path / "depth").glob("*.png"))
    if not files:
        raise ValueError("depth/ has no *.png")
    numbers = {file: last_number(file.stem) or 0 for file in files}
    stamps = {file: times.get(n, n / RATE) for file, n in numbers.items() if n in times or not times}
    if not stamps:
        raise ValueError("odometry.csv has no row of a picture in depth/")
    width, height = picture_size(read_input(files[0]), str(files[0]))
    color = _video(path, times) if (path / VIDEO).is_file() else None
    lens = None if color is None or color.lens is None else color.lens.resized(width, height)

    def pictures() -> Pictures:
        for file, stamp in stamps.items():
            yield stamp, partial(measured, file)

    def measured(file: Path) -> np.ndarray:
        depth, sure = read_depth(file), path / "confidence" / file.name
        if sure.is_file():  # ARKit's confidence: 0 is low, as of pixels that mix two surfaces
            trusted = read_picture(sure)[..., 0] > 0
            if trusted.shape != depth.shape:
                text = f"{trusted.shape[1]} x {trusted.shape[0]} pixels where depth has"
                raise InputError(f"{sure}: {text} {depth.shape[1]} x {depth.shape[0]}; copy it again, or delete it")
            depth = np.where(trusted, depth, 0)
        return depth

    depth = Stream(width, height, len(files), max(stamps.values()) - min(stamps.values()), lens, pictures)
    sensor = Sensor("phone", depth, 0.001, color, np.eye(4), poses)
    return Take(path, KIND, (sensor,), f"it needs {MATRIX} and {VIDEO}, whose size the matrix is for")


def _odometry(path: Path) -> tuple[dict[int, float], Poses | None]:
    """Return times, s, by frame, and poses; early versions of the app wrote neither titles nor times."""
    rows = [line.replace(" ", "").split(",") for line in read_file(path / "odometry.csv").decode().splitlines() if line]
    titled = bool(rows) and "qx" in rows[0]
    titles = rows.pop(0) if titled else ["x", "y", "z", "qx", "qy", "qz", "qw"]
    table = np.array([row[: len(titles)] for row in rows], dtype=np.float64).reshape(-1, len(titles))
    if not np.isfinite(table).all():
        raise ValueError("it has a number that is not finite")
    columns = {title: table[:, number] for number, title in enumerate(titles)}
    stamped = (columns[name].tolist() for name in ("frame", "timestamp")) if titled else ([], [])
    times = {int(frame): time for frame, time in zip(*stamped, strict=True)}
    turns, places = (np.stack([columns[name] for name in names], axis=1) for names in (("qx", "qy", "qz", "qw"), "xyz"))
    when = columns["timestamp"] if titled else np.arange(len(table)) / RATE
    return times, Poses(pose_of(turns, places), when) if len(table) else None


def _video(path: Path, times: dict[int, float]) -> Stream:
    """Return the colours: picture n of the video belongs to depth picture n, whatever the video's clock says."""
    import av

    with reading(path / VIDEO), av.open(path / VIDEO) as video:
        stream = video.streams.video[0]
        seconds = float((stream.duration or 0) * (stream.time_base or 0))
        width, height, count = stream.width, stream.height, stream.frames
    lens = None
    if (path / MATRIX).is_file():
        with reading(path / MATRIX):
            text = read_file(path / MATRIX).decode()
            matrix = np.array([line.split(",") for line in text.splitlines() if line], np.float64).reshape(3, 3)
        lens = lens_of(width, height, (matrix[0, 0], matrix[1, 1]), (matrix[0, 2], matrix[1, 2]))

    def pictures() -> Pictures:
        with av.open(path / VIDEO) as video:
            for number, frame in enumerate(video.decode(video=0)):
                if number in times or not times:
                    yield times.get(number, number / RATE), frame.to_ndarray(format="rgb24")

    return Stream(width, height, count, seconds * (count - 1) / max(count, 1), lens, pictures)
