"""Recordings of the app Record3D: its `.r3d` files, and what it exports as EXR and JPG.

Both have metadata (K column by column, poses x y z w and position in ARKit's axes), JPEG pictures and depth in metres,
coarser than colour and aligned with it. Depth of `.r3d` is compressed by LZFSE, for which PyPI has no built package.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...io.file_names import last_number
from ...io.read import MOST_BYTES, read_file
from .takes import FLIP, Lens, Picture, Pictures, Sensor, Stream, Take, picture_size, pose, reading

KIND = "a Record3D recording (.r3d, or the folder of its export EXR + JPG)"
EXPORT = "EXR_RGBD"


def fits(path: Path) -> bool:
    """Return whether a file has the app's extension, or a folder what it exports."""
    return path.suffix.lower() == ".r3d" if path.is_file() else _folder(path) is not None


def read(path: Path) -> Take:
    """Return the camera of a recording."""
    if not path.is_file():
        folder = _folder(path) or path
        names = sorted(f"{place}/{file.name}" for place in ("rgb", "depth") for file in (folder / place).glob("*.*"))
        about = json.loads(read_file(folder / "metadata.json"))
        depth = _Depth(_by_number(names, ".exr"), lambda name: _exr(folder / name))
        return _take(path, about, depth, _by_number(names, ".jpg"), lambda name: read_file(folder / name))
    archive = zipfile.ZipFile(path)  # open as long as its pictures may be asked for
    names, about = archive.namelist(), json.loads(_unpacked(archive, "metadata"))
    aspect = float(about["w"]) / float(about["h"])
    depth = _Depth(_by_number(names, ".depth"), lambda name: _lzfse(_unpacked(archive, name), aspect))
    return _take(path, about, depth, _by_number(names, ".jpg"), lambda name: _unpacked(archive, name))


@dataclass(frozen=True, slots=True)
class _Depth:
    names: dict[int, str]  # by frame
    load: Callable[[str], np.ndarray]  # m


def _folder(path: Path) -> Path | None:
    places = (path, path / EXPORT)
    return next((p for p in places if (p / "metadata.json").is_file() and (p / "depth").is_dir()), None)


def _unpacked(archive: zipfile.ZipFile, name: str) -> bytes:
    if archive.getinfo(name).file_size > MOST_BYTES:
        raise ValueError(f"{name} in it has {archive.getinfo(name).file_size} bytes")
    return archive.read(name)


def _by_number(names: list[str], extension: str) -> dict[int, str]:
    found = {last_number(Path(name).stem): name for name in names if name.endswith(extension)}
    return {number: found[number] for number in sorted(n for n in found if n is not None)}


def _take(
    path: Path, about: dict[str, Any], depth: _Depth, color: dict[int, str], load: Callable[[str], bytes]
) -> Take:
    if not depth.names:
        raise ValueError("it has no depth pictures")
    rate, stamps = float(about.get("fps", 30)), about.get("frameTimestamps") or []
    times = {n: float(stamps[n]) if n < len(stamps) else n / rate for n in {*depth.names, *color}}
    size = picture_size(load(next(iter(color.values())))) if color else (int(about["w"]), int(about["h"]))
    lens = None
    if "K" in about:
        k = np.array(about["K"], np.float64).reshape(3, 3).T
        lens = Lens(int(about["w"]), int(about["h"]), (k[0, 0], k[1, 1]), (k[0, 2], k[1, 2])).resized(*size)
    told = (
        (about["dh"], about["dw"]) if {"dh", "dw"} <= {*about} else depth.load(next(iter(depth.names.values()))).shape
    )

    def stream(names: dict[int, str], size: tuple[int, int], load: Callable[[str], Picture]) -> Stream:
        def pictures() -> Pictures:
            for number, name in names.items():
                yield times[number], load(name)

        there = [times[number] for number in names]
        return Stream(*size, len(names), max(there) - min(there), lens and lens.resized(*size), pictures)

    given = np.array(about.get("poses") or np.zeros((0, 7)), np.float64).reshape(-1, 7)
    poses = pose(given[:, :4], given[:, 4:]) @ FLIP if len(given) else None
    beside = stream(color, size, load) if color else None
    seen = stream(depth.names, (int(told[1]), int(told[0])), depth.load)
    sensor = Sensor("phone", seen, 1.0, beside, np.eye(4), poses)
    return Take(path, KIND, (sensor,), "its metadata have no K; export the recording again")


def _lzfse(data: bytes, aspect: float) -> np.ndarray:
    """Return the depths, m, in the bytes of a file of an .r3d; `aspect` is width by height."""
    try:
        import liblzfse
    except ImportError:
        text = "the depth of an .r3d is compressed by LZFSE, which meshreel does not read by itself"
        remedy = "export it in Record3D as EXR + JPG, or pip install pyliblzfse (needs a C compiler)"
        raise InputError(f"{text}; {remedy}") from None
    depth = np.frombuffer(liblzfse.decompress(data), "<f4")
    return depth.reshape(-1, max(1, round((len(depth) * aspect) ** 0.5)))


def _exr(path: Path) -> np.ndarray:
    """Return the depths, m, of an EXR file: its red channel, or its only one."""
    import OpenEXR

    with reading(path), OpenEXR.File(str(path), separate_channels=True) as file:
        channels = file.channels()
        return np.array(channels["R" if "R" in channels else min(channels)].pixels, np.float32)
