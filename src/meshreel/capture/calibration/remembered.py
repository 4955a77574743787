"""Corrections of a rig's colour cameras, remembered in a file beside `rig.json`.

The file holds the digest of what they were computed from: with other cameras, pictures or options they are found again.
`rig.json` stays as the user wrote it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from jaxtyping import Float64

from ...errors import InputError
from ...io.write import replacing
from ..rig.rig import Rig
from .colors import Correction, Corrections

REMEMBERED = "color_calibration.json"
_DAMAGED = (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError)


def remembered(
    rig: Rig, looked_at: Sequence[int], depends_on: dict[str, Any], find: Callable[[], Corrections]
) -> Corrections:
    """Return the corrections of a rig's colour cameras from its folder, or find them and try to write them there.

    `looked_at` are the frames that they are found from, and `depends_on` is all else that they depend on beside the
    cameras. A file that is damaged or of other pictures is replaced; a folder that cannot be written stays as it is.
    """
    digest = _digest(rig, looked_at, depends_on)
    with suppress(*_DAMAGED):
        record = json.loads((rig.folder / REMEMBERED).read_bytes())
        if record["of"] == digest:
            return _corrections(rig, record["cameras"])
    found = find()
    entries = [
        {"name": camera.name, "log2_gains": one.gains.tolist(), "motion": one.pose.tolist()}
        for camera, one in zip(rig.color_cameras, found, strict=False)
    ]
    with suppress(OSError, InputError):
        if rig.folder.stat().st_mode & 0o222:  # root could write where nobody is meant to
            with replacing(rig.folder / REMEMBERED) as file:
                file.write((json.dumps({"of": digest, "cameras": entries}, indent=1) + "\n").encode())
    return found


def _corrections(rig: Rig, entries: list[dict[str, Any]]) -> Corrections:
    """Return corrections as they were written. Raises ValueError unless each is of its camera, and finite."""
    if entries and [entry["name"] for entry in entries] != [camera.name for camera in rig.color_cameras]:
        raise ValueError("of other cameras")
    return tuple(Correction(_numbers(entry["log2_gains"], 3), _numbers(entry["motion"], 6)) for entry in entries)


def _numbers(values: Any, count: int) -> Float64[np.ndarray, " n"]:
    numbers = np.array(values, dtype=np.float64)
    if numbers.shape != (count,) or not np.isfinite(numbers).all():
        raise ValueError(f"{values!r:.40} are not {count} finite numbers")
    return numbers


def _digest(rig: Rig, looked_at: Sequence[int], depends_on: dict[str, Any]) -> str:
    """Return the digest of all that corrections depend on; pictures count by their sizes in bytes."""
    files = [*rig.files, *(camera.files for camera in rig.color_cameras)]
    sizes = [[each[frame].stat().st_size if frame in each else -1 for frame in looked_at] for each in files]
    colors = [camera.view.record() | {"distortion": camera.view.distortion} for camera in rig.color_cameras]
    cameras = [camera.record() for camera in rig.cameras]
    facts = depends_on | {"cameras": cameras, "colors": colors, "frames": list(looked_at), "sizes": sizes}
    return hashlib.sha256(json.dumps(facts, sort_keys=True).encode()).hexdigest()
