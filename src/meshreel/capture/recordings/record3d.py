"""Recordings of the app Record3D: its `.r3d` files, and what it exports as EXR and JPG.

Both have metadata (K column by column, poses x y z w and position in ARKit's axes), JPEG pictures and depth in metres,
coarser than colour and aligned with it. Depth of `.r3d` is compressed by LZFSE, for which PyPI has no built package.
"""

from __future__ import annotations

import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from ...errors import needed
from ...io.files import MOST_BYTES, read_file
from ...io.pictures import last_number
from ...texts import json_of
from ..calibration.poses import pose_of
from .takes import FLIP, Picture, Pictures, Poses, Sensor, Stream, Take, lens_of, picture_size, reading

KIND = "a Record3D recording (.r3d, or the folder of its export EXR + JPG)"
EXPORT = "EXR_RGBD"


def fits(path: Path) -> bool:
    return path.suffix.lower() == ".r3d" if path.is_file() else _folder(path) is not None


def read(path: Path) -> Take:
    if (folder := _folder(path)) is not None:
        names = sorted(f"{place}/{file.name}" for place in ("rgb", "depth") for file in (folder / place).glob("*.*"))
        load: Callable[[str], bytes] = partial(_stored, folder)
        about, decode = json_of(load("metadata.json")), partial(_exr, folder)
    else:
        archive = zipfile.ZipFile(path)  # open as long as its pictures may be asked for
        names, load = archive.namelist(), partial(_unpacked, archive)
        about = json_of(load("metadata"))
        decode = partial(_lzfse, load, float(about["w"]) / max(1.0, float(about["h"])))
    deep, color = _by_number(names, (".exr", ".depth")), _by_number(names, (".jpg",))
    if not deep:
        raise ValueError("it has no depth pictures")
    rate, stamps = float(about.get("fps", 30)), about.get("frameTimestamps") or []
    size, lens = (int(about["w"]), int(about["h"])), None
    if not (rate > 0 and min(size) > 0):
        raise ValueError(f"its metadata have {rate:g} fps and pictures of {size[0]} x {size[1]}")
    stamped = max(*deep, *color) < len(stamps)  # those of some would be on another clock
    times = {n: float(stamps[n]) if stamped else n / rate for n in {*deep, *color}}
    if "K" in about:
        k = np.array(about["K"], np.float64).reshape(3, 3).T
        lens = lens_of(*size, (k[0, 0], k[1, 1]), (k[0, 2], k[1, 2]))
    height, width = (about["dh"], about["dw"]) if "dh" in about else decode(next(iter(deep.values()))).shape

    def stream(names: dict[int, str], size: tuple[int, int], load: Callable[[str], Picture]) -> Stream:
        def pictures() -> Pictures:
            for number, name in names.items():
                yield times[number], load(name)

        there = [times[number] for number in names]
        return Stream(*size, len(names), max(there) - min(there), lens and lens.resized(*size), pictures)

    given = np.array(about.get("poses") or np.zeros((0, 7)), np.float64).reshape(-1, 7)
    given = given[: len(stamps)] if stamped else given
    when = np.array([float(stamps[n]) if stamped else n / rate for n in range(len(given))])
    poses = Poses(pose_of(given[:, :4], given[:, 4:]) @ FLIP, when) if len(given) else None
    first = next(iter(color.values()), "")
    beside = stream(color, picture_size(load(first), first), load) if color else None
    sensor = Sensor("phone", stream(deep, (int(width), int(height)), decode), 1.0, beside, np.eye(4), poses)
    return Take(path, KIND, (sensor,), "its metadata have no K; export the recording again")


def _folder(path: Path) -> Path | None:
    places = (path, path / EXPORT)
    return next((p for p in places if (p / "metadata.json").is_file() and (p / "depth").is_dir()), None)


def _stored(folder: Path, name: str) -> bytes:
    return read_file(folder / name)


def _unpacked(archive: zipfile.ZipFile, name: str) -> bytes:
    if archive.getinfo(name).file_size > MOST_BYTES:
        raise ValueError(f"{name} in it has {archive.getinfo(name).file_size} bytes")
    return archive.read(name)


def _by_number(names: list[str], extensions: tuple[str, ...]) -> dict[int, str]:
    found = {last_number(Path(name).stem): name for name in names if name.endswith(extensions)}
    return {number: found[number] for number in sorted(n for n in found if n is not None)}


def _lzfse(load: Callable[[str], bytes], aspect: float, name: str) -> np.ndarray:
    """Return the depths, m, in a file of an .r3d; `aspect` is width by height."""
    text = "the depth of an .r3d is compressed by LZFSE, which meshreel does not read by itself"
    remedy = "export it in Record3D as EXR + JPG, or pip install pyliblzfse (needs a C compiler)"
    with needed(f"{text}; {remedy}"):
        import liblzfse
    depth = np.frombuffer(liblzfse.decompress(load(name)), "<f4")
    return depth.reshape(-1, max(1, round((len(depth) * aspect) ** 0.5)))


def _exr(folder: Path, name: str) -> np.ndarray:
    """Return the depths, m, of an EXR file: its red channel, or its only one."""
    import OpenEXR

    with reading(folder / name), OpenEXR.File(str(folder / name), separate_channels=True) as file:
        channels = file.channels()
        return np.array(channels["R" if "R" in channels else min(channels)].pixels, np.float32)
