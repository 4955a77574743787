"""Takes: what one file or folder of a recorder holds, before it is a rig; one picture at a time is in memory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
from jaxtyping import Float64

from ...errors import InputError
from ...geometry.cameras import Camera
from ...io.files import read_input
from ...io.pictures import opened
from ..calibration.poses import poses_between

Picture = np.ndarray | bytes  # depths H x W in the sensor's unit, integers or floats; colours H x W x 3; a PNG or JPEG
Unread = Callable[[], Picture]  # reads one picture, which may be damaged
Pair = tuple[float, float]  # along x and y
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])  # from x right, y down, z forward to x right, y up, z backward (ARKit, OpenGL)
LOST_TRACK = 0.2  # s without a pose, after which a camera that moves may be anywhere (guess)
SKEW = 0.05  # of a product of a rotation with its transpose: recorded ones are rounded (guess)
Pictures = Iterator[tuple[float, Picture | Unread]]  # each with its time on the take's clock, s


@dataclass(frozen=True, slots=True)
class Stream:
    """The pictures of one camera."""

    width: int  # pixels
    height: int  # pixels
    count: int  # pictures; about as many, where the file does not say
    seconds: float  # from the first to the last
    lens: Camera | None  # None where the take has no calibration of it; its pose counts for nothing
    pictures: Callable[[], Pictures]  # reads the take from its beginning
    reach: float = np.inf  # largest tangent of an angle to the optical axis for which the lens's distortion holds

    def __post_init__(self) -> None:
        if not self.reach > 0:
            raise ValueError(f"its lens bends up to a tangent of {self.reach:g}: give a number above 0")

    @property
    def rate(self) -> float:
        """Pictures a second; 0 where there are fewer than two."""
        return (self.count - 1) / self.seconds if self.seconds > 0 and self.count > 1 else 0.0


@dataclass(frozen=True, slots=True)
class Poses:
    """The poses of a camera: one for all times, or one for each time."""

    matrices: Float64[np.ndarray, "T 4 4"]  # camera to world, m
    times: Float64[np.ndarray, " T"] | None = None  # s, on the take's clock; None: one pose, for all times

    def __post_init__(self) -> None:
        turns, last = self.matrices[:, :3, :3], self.matrices[:, 3]
        known = np.isfinite(self.matrices).all(axis=(1, 2))
        with np.errstate(invalid="ignore", over="ignore"):
            skew = np.abs(turns @ np.swapaxes(turns, 1, 2) - np.eye(3)).max(axis=(1, 2))
            bad = known & ((skew > SKEW) | (np.linalg.det(turns) < 0) | (last != [0, 0, 0, 1]).any(axis=1))
        if bad.any():
            which = int(bad.argmax())
            rows = self.matrices[which].round(3).tolist()
            raise InputError(f"pose {which} is {rows}: give a rotation and a translation, camera to world, in metres")

    def at(self, times: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, "P 4 4"]:
        """Return poses at times, between those before and after; NaN where none is known near a time.

        Near is `LOST_TRACK`, or what usually is between two poses where that is more.
        """
        if self.times is None:
            return np.repeat(self.matrices[:1], len(times), axis=0)
        good = np.isfinite(self.matrices).all(axis=(1, 2))
        known, first = np.unique(self.times[good], return_index=True)
        found = poses_between(known, self.matrices[good][first], times)
        after = np.clip(np.searchsorted(known, times), 0, len(known) - 1)
        gaps = np.minimum(np.abs(known[after] - times), np.abs(times - known[np.maximum(after - 1, 0)]))
        usual = float(np.quantile(np.diff(known), 0.25, method="lower")) if len(known) > 1 else 0.0
        found[gaps > max(LOST_TRACK, usual)] = np.nan
        return found


@dataclass(frozen=True, slots=True)
class Sensor:
    """A depth camera, and the colour camera beside it."""

    name: str
    depth: Stream
    unit: float = 0.001  # m, what 1 means in its pictures
    color: Stream | None = None
    color_to_depth: Float64[np.ndarray, "4 4"] | None = None  # m; None where the take does not say
    poses: Poses | None = None  # of the depth camera


@dataclass(frozen=True, slots=True)
class Take:
    """Contents of a file or folder."""

    path: Path
    kind: str  # of recording
    sensors: tuple[Sensor, ...]
    calibrate: str  # what a user does where the calibration is missing
    others: tuple[str, ...] = ()  # streams that are not read


def lens_of(width: int, height: int, focal: Pair, center: Pair, distortion: tuple[float, ...] = ()) -> Camera:
    """Return the lens of intrinsics to which middles of pixels are whole numbers. Raises ValueError if not finite."""
    if not np.isfinite(distortion).all():
        raise ValueError(f"its lens bends by {distortion}: not finite")
    return Camera(width, height, focal, (center[0] + 0.5, center[1] + 0.5), distortion=distortion)


def stream_of(
    files: Sequence[tuple[float, Path]], lens: Callable[[int, int], Camera | None], read: Callable[[Path], Picture]
) -> Stream:
    """Return the stream of files with their times, s; `lens` gets the size of the first that is there."""
    if not files:
        raise ValueError("its list of pictures is empty")
    first = next((file for _, file in files if file.is_file()), files[0][1])
    width, height = picture_size(read_input(first, "mend the list that names it"), str(first))

    def pictures() -> Pictures:
        for time, file in files:
            yield time, partial(read, file)

    times = [time for time, _ in files]
    return Stream(width, height, len(files), max(times) - min(times), lens(width, height), pictures)


def check_size(lens: Camera, width: int, height: int) -> None:
    """Raise InputError for a picture of another size."""
    if (width, height) != (lens.width, lens.height):
        raise InputError(f"{width} x {height} pixels where its lens has {lens.width} x {lens.height}")


@contextmanager
def reading(path: Path, where: Callable[[], str] = str) -> Iterator[None]:
    """Turn what packages raise for a damaged file into an InputError that names the file, and `where` in it."""
    try:
        yield
    except InputError as error:
        if f"{path}" in str(error):
            raise
        raise InputError(f"{path}: {error}") from None
    except ModuleNotFoundError as error:
        text = f"{error.name} is missing; install it with: pip install 'meshreel[recordings]'"
        raise InputError(f"{path}: {text}") from None
    except Exception as error:
        missing = " is missing" if isinstance(error, KeyError) and " " not in f"{error}" else ""
        reason = " ".join(f"{getattr(error, 'strerror', None) or error}{missing}".split()) or type(error).__name__
        text = "copy it again, or repair it with the recorder's tool"
        raise InputError(f"{path}: cannot be read{where()} ({reason:.200}); {text}") from error


def picture_size(data: bytes, where: str) -> tuple[int, int]:
    """Return width and height of a PNG or JPEG, of which only the head is read. Raises InputError for others."""
    with opened(data, where, f"its {len(data)} bytes are no PNG or JPEG; copy it again", "copy it again") as image:
        return image.size
