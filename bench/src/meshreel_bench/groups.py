"""What the groups of a video are, for rows, and what rows say of them: quality without key frames and around them.

In -> out: the bytes of a .reel file -> a record a group; a row -> values. A key frame that the file does not name is
taken to be the best frame of its group, metric by metric: what is said without keys is then never too good.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.format.layout import MAGIC
from meshreel.metrics.distance import PSNR_CEILING

from .rows import Row

SMALLER_IS_BETTER = ("normal_error_deg", "normal_error_at_vertices_deg", "rms_forward_m", "rms_backward_m")
KEYS = "key_frames"  # of the file's metadata: numbers of the frames, where an encoder writes them


def group_records(data: bytes) -> list[Row]:
    """First frame, frames, form, bytes and, where the metadata has `key_frames`, the key frame of every group.

    No records of bytes that are no .reel file.
    """
    if not data.startswith(MAGIC):
        return []
    reader = ReelReader(BytesSource(data))
    keys = {int(key) for key in reader.metadata.get(KEYS, ())}
    records = []
    for chunk in reader.groups:
        record: Row = {"first_frame": chunk.first_frame, "frames": chunk.frame_count}
        record |= {"form": chunk.form.name.lower(), "bytes": chunk.size}
        own = keys & set(range(chunk.first_frame, chunk.first_frame + chunk.frame_count))
        records.append(record | ({"key": min(own)} if own else {}))
    return records


def key_frames(row: Row, metric: str) -> list[int]:
    """The key frame of every group of a row, or the frame that is best by `metric` where it is not known."""
    pick: Callable[..., Any] = np.argmin if metric in SMALLER_IS_BETTER else np.argmax
    values = _values(row, metric)
    keys = []
    for group in row["groups"]:
        first = group["first_frame"]
        keys.append(group.get("key", first + int(pick(values[first : first + group["frames"]]))))
    return keys


def without_keys(row: Row, metric: str) -> float | None:
    """The mean of a metric over the frames that are no key frames; over all where every frame is one.

    None where the row has no groups or did not measure the metric.
    """
    if not row.get("groups") or metric not in row["per_frame"][0]:
        return None
    values = _values(row, metric)
    others = np.setdiff1d(np.arange(len(values)), key_frames(row, metric))
    chosen = others if len(others) else np.arange(len(values))
    return float(np.mean(values[chosen]))


def by_distance(row: Row, metric: str) -> list[tuple[int, float, int]]:
    """(frames from the key, mean of the metric, frames counted): how quality falls with the distance from the key."""
    values, found = _values(row, metric), dict[int, list[float]]()
    for group, key in zip(row["groups"], key_frames(row, metric), strict=True):
        for frame in range(group["first_frame"], group["first_frame"] + group["frames"]):
            found.setdefault(abs(frame - key), []).append(float(values[frame]))
    return [(distance, float(np.mean(found[distance])), len(found[distance])) for distance in sorted(found)]


def at_borders(row: Row, metric: str) -> float | None:
    """The mean step of a metric between the last frame of a group and the first of the next; None for one group."""
    values = _values(row, metric)
    first = [group["first_frame"] for group in row["groups"][1:]]
    return float(np.mean([abs(values[i] - values[i - 1]) for i in first])) if first else None


def bytes_between(row: Row, first: int, last: int) -> float:
    """Bytes of the frames `first` to `last` (without it); a group's are spread evenly over its frames."""
    total = 0.0
    for group in row["groups"]:
        begin, end = group["first_frame"], group["first_frame"] + group["frames"]
        total += group["bytes"] * max(0, min(end, last) - max(begin, first)) / group["frames"]
    return total


def _values(row: Row, metric: str) -> np.ndarray:
    """A metric's value for every frame; None, one that was not finite, is what that stands for."""
    infinite = _infinite(metric)
    return np.array([infinite if (v := frame[metric]) is None else v for frame in row["per_frame"]], dtype=np.float64)


def _infinite(metric: str) -> float:
    """A PSNR without error counts as in the means of a row; a distance is that of a frame which is not there."""
    if "psnr" in metric:
        return PSNR_CEILING
    if metric.startswith("ssim"):
        return 1.0
    return np.inf if metric.startswith(("rms", "hausdorff95")) else 0.0
