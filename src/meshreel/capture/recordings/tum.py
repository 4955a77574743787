"""Folders in the form of the TUM RGB-D benchmark: lists of pictures with time stamps, depth aligned with colour.

`depth.txt`, `rgb.txt` (or `associations.txt`) and, for poses, `groundtruth.txt`, as
https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats describes them. Depth is in 1/5000 m.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...geometry.cameras import Camera
from ...io.files import read_input
from ...io.pictures import read_depth
from ..calibration.poses import pose_of
from .takes import Poses, Sensor, Stream, Take, lens_of, reading, stream_of

KIND = "a TUM RGB-D folder (depth.txt, rgb.txt)"
UNIT = 1 / 5000  # m
LISTS = ("associations.txt", "associated.txt", "associate.txt")
ROW = (float, str)  # of a list: a time, s, and a file's name
OWN = "calibration.txt"  # fx fy cx cy, and k1 k2 p1 p2 k3: the form of the ETH3D SLAM benchmark
# Of the colour cameras, by parts of the folders' names: the benchmark's page on file formats.
KNOWN = {
    "freiburg1": "517.3 516.5 318.6 255.3 0.2624 -0.9531 -0.0054 0.0026 1.1633",
    "freiburg2": "520.9 521.0 325.1 249.7 0.2312 -0.7849 -0.0033 -0.0001 0.9172",
    "freiburg3": "535.4 539.2 320.1 247.6",
}


def fits(path: Path) -> bool:
    return any((path / name).is_file() for name in ("depth.txt", *LISTS))


def read(path: Path) -> Take:
    depth, color = _lists(path)
    numbers = _numbers(path)
    seen, beside = _stream(depth, numbers, True), _stream(color, numbers, False) if color else None
    sensor = Sensor("camera", seen, UNIT, beside, np.eye(4), _poses(path, depth))
    return Take(path, KIND, (sensor,), f"write fx fy cx cy (k1 k2 p1 p2 k3) into {path / OWN}")


def _lists(path: Path) -> tuple[list[tuple[float, Path]], list[tuple[float, Path]]]:
    """Return times, s, and files of depth and of colour."""
    if (path / "depth.txt").is_file():
        color = _rows(path / "rgb.txt", ROW) if (path / "rgb.txt").is_file() else []
        return [(t, path / name) for t, name in _rows(path / "depth.txt", ROW)], [(t, path / name) for t, name in color]
    rows = list(_rows(next(path / name for name in LISTS if (path / name).is_file()), ROW * 2))
    pairs = [(t, path / name) for row in rows for t, name in (row[:2], row[2:])]
    first = "depth" in rows[0][1] if rows else True
    return pairs[0 if first else 1 :: 2], pairs[1 if first else 0 :: 2]


def _numbers(path: Path) -> list[float]:
    """Return fx fy cx cy, and what its lens has beside them, of a folder; none where they are not known."""
    own = path / OWN
    if not own.is_file():
        known = next((text for name, text in KNOWN.items() if name in path.resolve().name), "")
        return [float(number) for number in known.split()]
    text = " ".join(" ".join(words) for words in _lines(own).values())
    try:
        given = [float(number) for number in text.split()]
    except ValueError:
        given = [math.nan]
    if given and (len(given) < 4 or not all(map(math.isfinite, given))):
        raise InputError(f"{own}: has {text!r:.60}; give the numbers fx fy cx cy, and k1 k2 p1 p2 k3 where it bends")
    return given


def _lines(path: Path) -> dict[int, list[str]]:
    """Return the words of each line that has some and is no comment, by its number; any bytes may be a file's name."""
    lines = read_input(path).decode("utf-8-sig", "surrogateescape").splitlines()
    words = {number: line.replace(",", " ").split() for number, line in enumerate(lines, 1)}
    return {number: each for number, each in words.items() if each and not each[0].startswith("#")}


def _rows(path: Path, columns: tuple[type, ...]) -> Iterator[list[Any]]:
    """Yield the first columns of each line. Raises InputError, which names a line that has others."""
    for number, words in _lines(path).items():
        if columns == ROW and len(words) > 2:  # a name may have blanks
            words = [words[0], " ".join(words[1:])]
        try:
            row = [column(word) for column, word in zip(columns, words[: len(columns)], strict=True)]
        except ValueError:
            row = [math.nan]
        if not all(math.isfinite(value) for value in row if isinstance(value, float)):
            wanted = " ".join("NAME" if column is str else "NUMBER" for column in columns)
            raise InputError(f"{path}: line {number} is {' '.join(words)!r:.60}; give {wanted}")
        yield row


def _stream(rows: list[tuple[float, Path]], given: list[float], deep: bool) -> Stream:
    def lens(width: int, height: int) -> Camera | None:
        return lens_of(width, height, (given[0], given[1]), (given[2], given[3]), tuple(given[4:9])) if given else None

    return stream_of(rows, lens, read_depth if deep else read_input)


def _poses(path: Path, depth: list[tuple[float, Path]]) -> Poses | None:
    """Return the poses while depth was recorded."""
    if not (path / "groundtruth.txt").is_file():
        return None
    rows = np.array(list(_rows(path / "groundtruth.txt", (float,) * 8)), dtype=np.float64).reshape(-1, 8)
    times = [time for time, _ in depth]
    rows = rows[np.argsort(rows[:, 0], kind="stable")]
    first, last = (int(np.searchsorted(rows[:, 0], edge)) for edge in (min(times), max(times)))
    if first < last:  # with those before and after; of another clock all count
        rows = rows[max(first - 1, 0) : last + 1]
    with reading(path / "groundtruth.txt"):
        return Poses(pose_of(rows[:, 4:], rows[:, 1:4]), rows[:, 0]) if len(rows) else None
