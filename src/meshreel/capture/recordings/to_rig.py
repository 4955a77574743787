"""Takes to the folder of a rig: depth without the bends of its lens, colours as they were recorded, in common frames.

Pictures belong to one frame if they were taken within half a frame of each other. Colour is registered by calibration:
`rig.json` says where its camera is and how its lens bends, so that no picture is resampled for it.
"""

from __future__ import annotations

import io
import re
import shutil
import struct
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from itertools import chain, count
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float64, Int64

from ...errors import InputError
from ...geometry.cameras import Camera, Matrix
from ...io.pictures import pack_picture
from ...io.write import cannot_be_written, make_folder, part_of, write_file
from ..calibration.paths import refine_paths
from ..calibration.poses import turns_between
from ..rig.cameras import DepthCamera, distortion_of, placed
from ..rig.rig import POSES, packed_path, write_rig
from .takes import Picture, Sensor, Stream, Take, check_size, picture_size, reading

MILLIMETRE = 0.001  # m, the unit of depths that are recorded as floats
MOVES, TURNS = 0.05, 3.0  # m, degrees: a phone that tracks itself, on a tripod, strays by less (guess)
CUT_OFF = 0.02  # of a stream's pictures: where more are missing than the file promises, it is told (guess)
APART = (1e-4, 3600.0)  # s, between pictures: outside, time stamps are in another unit (guess)
LONGEST_GAP = 1e9  # frames: one whose time stamp is damaged may be as far away as 64 bits reach (guess)
NEAREST_ROOM = 0.7  # m: where depth ends before this, its unit may be wrong (guess)
LONGEST_NAME = 100  # characters of a camera's name, and of its folder (guess)
QUALITY = 95  # of JPEG, for colours that a package decoded: a third of a PNG's bytes
Pack = Callable[[Picture, Camera], tuple[bytes, str]]  # a picture to the bytes of a file, and its extension
Report = Callable[[int], None]  # how many pictures were read so far


def write_takes(
    takes: Sequence[Take], folder: Path, report: Report = lambda _: None, depth_unit: float | None = None
) -> list[str]:
    """Write a complete rig's folder; return warnings. `depth_unit`, m, replaces that of takes. Raises InputError."""
    parts = _parts(takes, depth_unit)
    with _appearing(folder) as place:
        pictures = count(1)
        for part in parts:
            part.read(place / part.name, lambda: report(next(pictures)))
        clock = Clock.of(np.concatenate([parts[0].depth.times(), parts[0].depth.lost]))
        if not APART[0] <= clock.period <= APART[1]:
            text = f"its depth pictures are {clock.period:.3g} s apart by their time stamps"
            raise InputError(f"{parts[0].take.path}: {text}; give time stamps in seconds")
        frames, remarks = _common(parts, clock)
        frames, untracked = _tracked(parts, frames)
        remarks += untracked
        for part in parts:
            part.depth.rename(frames)
            if part.color is not None:
                part.color.rename(frames)
            if part.color_path:
                write_file(place / part.name / "color" / POSES, packed_path(part.color_path))
        write_rig(place, tuple(part.camera() for part in parts), clock.rate, [part.beside() for part in parts])
        remarks += refine_paths(place)
    unread = {take.path: ", ".join(other for other in take.others if "Image" in other) for take in takes}
    remarks += [f"{path}: not read: {topics}" for path, topics in unread.items() if topics]
    unknown = sum(part.sensor.poses is None for part in parts)
    if len(parts) > 1 and (unknown or len(takes) > 1):
        finds = "and is not looked for where one moves: give poses in one world"
        finds = finds if any(part.moves for part in parts) else "meshreel calibrate finds it"
        text = f"how its {len(parts)} cameras stand to each other is not known; {finds}"
        remarks.append(f"{folder}: {text}")
    return [remark for part in parts for remark in part.remarks] + remarks


@dataclass(frozen=True, slots=True)
class Clock:
    """Frames of a recording by the times of a camera's pictures; where it dropped some, it has no numbers."""

    times: Float64[np.ndarray, " T"]  # s, ascending
    numbers: Int64[np.ndarray, " T"]
    period: float  # s

    @classmethod
    def of(cls, times: Float64[np.ndarray, " T"]) -> Clock:
        """Return the clock of a camera's pictures."""
        times = np.unique(times)
        steps = np.diff(times)
        period = float(np.median(steps)) if len(steps) else 1 / 30
        gaps = np.clip(np.rint(steps / period), 1, LONGEST_GAP).astype(np.int64)
        return cls(times, np.concatenate([[0], np.cumsum(gaps)]).astype(np.int64), period)

    @property
    def rate(self) -> float:
        return round(1 / self.period, 3) if self.period < 1000 else 1 / self.period

    def frames(self, times: Float64[np.ndarray, " P"]) -> dict[int, int]:
        """Return for each frame which picture of another camera was taken within half a frame of it, if any."""
        numbers = np.rint(np.interp(times, self.times, self.numbers)).astype(np.int64)
        away = np.abs(times - np.interp(numbers, self.numbers, self.times))
        near = [int(k) for k in np.argsort(-away, kind="stable") if away[k] <= self.period / 2]
        return {int(numbers[k]): k for k in near}  # the nearest comes last, and stays


@dataclass(slots=True)
class _Written:
    """Pictures of a stream in the rig's folder, in the order of the recording."""

    files: list[tuple[float, Path]] = field(default_factory=list)
    by_frame: dict[int, int] = field(default_factory=dict)
    lost: list[float] = field(default_factory=list)  # times of pictures that are damaged

    def times(self) -> Float64[np.ndarray, " P"]:
        return np.array([time for time, _ in self.files], dtype=np.float64)

    def fill(self, frames: set[int]) -> set[int]:
        """Show the last picture again in frames without one, the first before it; return these frames."""
        known, bare = np.array(sorted(self.by_frame)), frames - self.by_frame.keys()
        for frame in bare:
            before = int(np.searchsorted(known, frame, side="right")) - 1
            self.by_frame[frame] = self.by_frame[int(known[max(before, 0)])]
        return bare

    def rename(self, frames: set[int]) -> None:
        """Name pictures by their frames, and delete those of no frame."""
        for frame, index in sorted(self.by_frame.items()):
            if frame in frames:
                path = self.files[index][1]
                with cannot_be_written(path):
                    shutil.copyfile(path, path.with_name(f"frame_{frame:05}{path.suffix}"))
        for _, path in self.files:
            path.unlink()


class _Part:
    """A sensor that becomes cameras of a rig."""

    def __init__(self, take: Take, sensor: Sensor, name: str) -> None:
        if sensor.depth.lens is None:
            raise InputError(f"{take.path}: depth of {sensor.name} has no calibration: {take.calibrate}")
        self.take, self.sensor, self.name, self.lens = take, sensor, name, sensor.depth.lens
        self.unit, self.remarks, still = sensor.unit, list[str](), _still(take, sensor)
        self.moves, self.pose = still is None, np.eye(4) if still is None else still
        self.depth_path, self.color_path = dict[int, Matrix](), dict[int, Matrix]()  # by frame, of a camera that moves
        self.depth, self._farthest = _Written(), list[float]()  # steps, of each picture
        self.color: _Written | None = None
        self.stream = sensor.color
        if self.stream is not None and self.stream.lens is None:
            self.remarks.append(f"{take.path}: colour of {sensor.name} has no calibration and is left out")
            self.stream = None
        if self.stream is not None and sensor.color_to_depth is None:
            text = f"how colour of {sensor.name} lies on its depth is not known; taken as aligned"
            self.remarks.append(f"{take.path}: {text}")
        self.camera(), self.beside()  # raise InputError for numbers that no camera has

    def camera(self) -> DepthCamera:
        path = {frame: placed(self.name, pose) for frame, pose in self.depth_path.items()}
        return replace(self._as_camera(self.name, self.lens, self.pose), path=path)

    def beside(self) -> dict[str, Any] | None:
        """Return the colour camera as a record of `rig.json`."""
        if self.stream is None or self.stream.lens is None:
            return None
        apart = np.eye(4) if self.sensor.color_to_depth is None else self.sensor.color_to_depth
        record = self._as_camera(f"{self.name}-color", self.stream.lens, self.pose @ apart).record()
        record |= {"folder": f"{self.name}/color", "distortion": list(self.stream.lens.distortion)}
        record |= {"poses": f"{self.name}/color/{POSES}"} if self.moves else {}
        with reading(self.take.path):
            distortion_of(record)  # raises InputError for what no rig may have
        return record

    def _as_camera(self, name: str, lens: Camera, pose: Float64[np.ndarray, "4 4"]) -> DepthCamera:
        with reading(self.take.path):
            return DepthCamera(name, replace(lens, pose=placed(name, pose)), self.unit)

    def read(self, folder: Path, report: Callable[[], None]) -> None:
        """Write all pictures to a folder."""
        pixels = _straightened(self.lens, self.sensor.depth.reach)

        def straight(picture: Picture, lens: Camera) -> tuple[bytes, str]:
            assert isinstance(picture, np.ndarray)
            check_size(lens, picture.shape[1], picture.shape[0])
            if picture.dtype.kind == "f":
                depth, self.unit = picture * (self.sensor.unit / MILLIMETRE), MILLIMETRE
                with np.errstate(invalid="ignore"):  # what is none, or too far, is 0
                    picture = np.where((depth > 0) & (depth < 65535), np.rint(depth), 0).astype(np.uint16)
            self._farthest.append(float(np.percentile(picture[picture > 0], 95)) if picture.any() else 0.0)
            return pack_picture(picture if pixels is None else picture[pixels[0]] * pixels[1]), ".png"

        self.depth = self._write(self.sensor.depth, folder / "depth", straight, report)
        if 0 < (far := float(np.median(self._farthest)) * self.unit) < NEAREST_ROOM:
            text = f"its depth reaches {far:.3g} m, with {self.unit:g} m a step"
            self.remarks.append(f"{self.take.path}: {text}; if it should reach farther, say --depth-unit")
        if self.stream is not None:
            self.color = self._write(self.stream, folder / "color", _colored, report)

    def _write(self, stream: Stream, folder: Path, pack: Pack, report: Callable[[], None]) -> _Written:
        written, name, odd = _Written(), f"{folder.name} of {self.sensor.name}", list[str]()
        what = f"{self.take.path}: {name}"
        make_folder(folder)
        with reading(self.take.path, lambda: f", {name} from picture {len(written.files)} on"):
            for number, (time, picture) in enumerate(stream.pictures()):
                if not np.isfinite(time):
                    raise ValueError(f"picture {number} has the time {time}")
                try:
                    data, extension = pack(picture() if callable(picture) else picture, stream.lens or self.lens)
                except (InputError, ValueError, OSError, struct.error) as error:
                    odd.append(f"picture {number} ({time:.3f} s): {error}")
                    written.lost.append(time)
                    continue
                path = folder / f"read_{number}{extension}"
                with cannot_be_written(path):
                    path.write_bytes(data)
                written.files.append((time, path))
                report()
        if not written.files:
            raise InputError(f"{what}: {odd[0]}" if odd else f"{what} has no pictures; record it again")
        if odd:
            text = "1 picture is left out" if len(odd) == 1 else f"{len(odd)} pictures are left out, the first is"
            self.remarks.append(f"{what}: {text}: {odd[0]}")
        if (back := int((np.diff(written.times()) < 0).sum())) > 0:
            self.remarks.append(f"{what}: time stamps go back {back} times; its pictures are sorted by them")
        if stream.count - len(written.files) - len(odd) > max(1, CUT_OFF * stream.count):
            text = f"{len(written.files)} of {stream.count} pictures can be read; was the file cut off?"
            self.remarks.append(f"{what}: {text}")
        return written


def _parts(takes: Sequence[Take], depth_unit: float | None) -> list[_Part]:
    """Return the sensors of all takes, with names that differ, also as names of folders."""
    found: dict[str, _Part] = {}
    for take in takes:
        for sensor in take.sensors:
            name = re.sub(r"[^\w-]+", "-", f"{take.path.resolve().stem}-{sensor.name}").strip("-")[:LONGEST_NAME]
            others = (f"{name}-{number}" for number in count(2))
            name = next(one for one in chain([name], others) if one.lower() not in found)
            sensor = sensor if depth_unit is None else replace(sensor, unit=depth_unit)
            found[name.lower()] = _Part(take, sensor, name)
    return list(found.values())


def _common(parts: list[_Part], clock: Clock) -> tuple[set[int], list[str]]:
    """Give pictures their frames; return the frames that some depth camera has, and warnings."""
    remarks, first = list[str](), parts[0].take.path
    for part in parts:
        times, shift = part.depth.times(), 0.0
        if times.min() > clock.times[-1] or times.max() < clock.times[0]:
            shift = float(clock.times[0] - times.min())
            remarks.append(f"{part.take.path}: was at another time than {first} by its clock; both begin together now")
        for written in (part.depth, part.color):
            if written is not None:
                written.by_frame = clock.frames(written.times() + shift)
        if (lost := len(times) - len(part.depth.by_frame)) > 0:
            text = f"{lost} of {len(times)} depth pictures are left out: another one is at their time or nearer"
            text += "" if part is parts[0] else f", or no frame of {first} is within half a frame"
            remarks.append(f"{part.take.path}: {part.sensor.name}: {text}")
    frames = set[int]().union(*(part.depth.by_frame for part in parts))
    for part in parts:
        if part.color is not None and part.color.by_frame and (bare := part.color.fill(frames)):
            half = f"half a frame ({500 * clock.period:.3g} ms)"
            text = f"{len(bare)} of {len(frames)} frames have no colour within {half}, and keep the last one"
            remarks.append(f"{part.take.path}: {part.sensor.name}: {text}; the first is frame {min(bare)}")
    for part in parts:
        if part.color is not None and not part.color.by_frame:
            frames = set()
        if not frames & part.depth.by_frame.keys():
            text = f"{part.sensor.name} has no frame in common with the others"
            raise InputError(f"{part.take.path}: {text}; do the clocks of depth and colour agree?")
    return frames, remarks


def _tracked(parts: list[_Part], frames: set[int]) -> tuple[set[int], list[str]]:
    """Give cameras that move their poses; return the frames of which all are known that have a picture, and warnings.

    The pose of a picture is that at its own time, so colour that was taken between two depths is where it was then.
    """
    remarks = list[str]()
    for part in parts:
        if part.sensor.poses is None or part.sensor.poses.times is None:
            continue
        if not part.moves:
            known = np.isfinite(part.sensor.poses.at(part.depth.times())).all(axis=(1, 2))
            if not known.all():
                text = f"only {known.sum()} of {len(known)} depth pictures have a pose of {part.sensor.name} near them"
                remarks.append(f"{part.take.path}: {text}; by these it stands still")
            continue
        apart = np.eye(4) if part.sensor.color_to_depth is None else part.sensor.color_to_depth
        pairs = [(part.depth, part.depth_path, np.eye(4))]
        pairs += [(part.color, part.color_path, apart)] if part.color is not None else []
        lost = set[int]()
        for written, path, beside in pairs:
            numbers = sorted(frames & written.by_frame.keys())
            times = written.times()[[written.by_frame[number] for number in numbers]]
            for number, pose in zip(numbers, part.sensor.poses.at(times), strict=True):
                path[number] = pose @ beside
            lost |= {number for number in numbers if not np.isfinite(path[number]).all()}
        if lost:
            text = f"{len(lost)} of {len(frames)} frames are left out: no pose of {part.sensor.name} is known then"
            remarks.append(f"{part.take.path}: {text}; the first is frame {min(lost)}")
        frames = frames - lost
        if not frames:
            text = f"no pose of {part.sensor.name} is of the time of a picture"
            raise InputError(f"{part.take.path}: {text}; do the clocks of poses and pictures agree?")
    for part in parts:
        for path in (part.depth_path, part.color_path):
            for number in path.keys() - frames:
                del path[number]
    return frames, remarks


def _still(take: Take, sensor: Sensor) -> Matrix | None:
    """Return the pose of a sensor that stands still, the identity where it is not known, None where it moves."""
    if sensor.poses is None:
        return np.eye(4)
    poses = sensor.poses.matrices[np.isfinite(sensor.poses.matrices).all(axis=(1, 2))]  # trackers write NaN when lost
    if not len(poses):
        raise InputError(f"{take.path}: no pose of {sensor.name} is finite; record it again")
    places = poses[:, :3, 3]
    away = np.linalg.norm(places - np.median(places, axis=0), axis=1)
    usual = poses[int(away.argmin())]
    turned = float(turns_between(poses, np.broadcast_to(usual, poses.shape)).max())
    return None if away.max() > MOVES or turned > TURNS else usual


def _straightened(lens: Camera, reach: float) -> tuple[tuple[np.ndarray, np.ndarray], Bool[np.ndarray, "H W"]] | None:
    """Return for each pixel of a straight lens which of a picture's it is, not blended, and whether there is one."""
    if not any(lens.distortion):
        return None
    ahead = lens.ahead
    x, y = np.moveaxis(lens.project(ahead.reshape(-1, 3)).reshape(lens.height, lens.width, 2), 2, 0)
    inside = (x > 0) & (x < lens.width) & (y > 0) & (y < lens.height)
    inside &= np.hypot(ahead[..., 0], ahead[..., 1]) <= reach
    row, column = (np.where(inside, place, 0).astype(np.int64) for place in (y, x))
    return (row, column), inside


def _colored(picture: Picture, lens: Camera) -> tuple[bytes, str]:
    """Return the bytes of a picture's file, and its extension. Raises InputError where it does not fit the lens."""
    if isinstance(picture, bytes):
        check_size(lens, *picture_size(picture, "colour"))
        return picture, ".jpg" if picture[:2] == b"\xff\xd8" else ".png"
    from PIL import Image

    check_size(lens, picture.shape[1], picture.shape[0])
    packed = io.BytesIO()
    Image.fromarray(picture).save(packed, "JPEG", quality=QUALITY, subsampling=0)
    return packed.getvalue(), ".jpg"


@contextmanager
def _appearing(folder: Path) -> Iterator[Path]:
    """Yield a new folder, which takes the name `folder` at the end of the block; after a failure, nothing is left."""
    if not folder.name:
        raise InputError(f"{folder}: is the folder that you are in; name a new one for the rig")
    with cannot_be_written(folder):
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise InputError(f"{folder}: is there already; choose another folder for the rig, or delete it")
        made = part_of(folder)
        shutil.rmtree(made, ignore_errors=True)  # of a run that was killed
        made.mkdir(parents=True)
    try:
        yield made
        with cannot_be_written(folder):
            if folder.exists():
                folder.rmdir()
            made.rename(folder)
    finally:
        shutil.rmtree(made, ignore_errors=True)
