"""ROS bags: ROS 1 (`.bag`, also of RealSense's own tools), ROS 2 (folders, `.db3`) and MCAP (`.mcap`).

Depth cameras are the image topics of 16 bits or floats; `camera_info` beside them has their lenses, `/tf_static` (in
RealSense's files `tf/0`) their poses, `/tf` the way of what carries them. Times are those of the pictures, not of their
recording.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import product, takewhile
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import UInt8, UInt16

from ...errors import InputError
from ...geometry.cameras import Camera, Matrix
from ...io.pictures import MOST_PIXELS, is_deep, parse_depth
from ..calibration.poses import pose_in_root, pose_of
from .takes import Picture, Pictures, Poses, Sensor, Stream, Take, lens_of, picture_size

KIND = "a ROS 1 or RealSense .bag, a ROS 2 bag, an .mcap"
# Type of depth, and its unit in ROS, m.
DEEP = dict.fromkeys(("16UC1", "mono16", "Z16", "z16"), ("<u2", 0.001))
DEEP |= {"16SC1": ("<i2", 0.001), "32FC1": ("<f4", 1.0)}
# Order of red, green, blue; OpenCV's bridge has blue first where an encoding does not say.
COLOR = {"rgb8": [0, 1, 2], "bgr8": [2, 1, 0], "rgba8": [0, 1, 2, 3], "bgra8": [2, 1, 0, 3]}
COLOR |= {"8UC3": [2, 1, 0], "8UC4": [2, 1, 0, 3]}
GREY = ("mono8", "8UC1")
# Places of luma and chroma in two bytes.
YUV = {"yuv422": (1, 0), "uyvy": (1, 0), "yuv422_yuy2": (0, 1), "yuyv": (0, 1)}
BAYER = {f"bayer_{order}8": order for order in ("rggb", "bggr", "gbrg", "grbg")}
MODELS = ("", "plumb_bob", "rational_polynomial", "none", "Brown Conrady", "Inverse Brown Conrady")
POSES = "tf2_msgs/msg/TFMessage"
COMPRESSED = struct.Struct("<iff")  # before the PNG of compressedDepth: form, and the two numbers of floats
RVL = struct.Struct("<II")  # behind it, before a stream of RVL: columns and rows


def fits(path: Path) -> bool:
    if path.is_file():
        return path.suffix.lower() in (".bag", ".mcap", ".db3")
    names = [one.name for one in path.iterdir()] if (path / "metadata.yaml").is_file() else []
    return any(kind in name for name in names for kind in (".mcap", ".db3"))


def read(path: Path) -> Take:
    with _opened(path) as bag:
        topics = [topic for topic in bag.topics() if topic.deep is not None]
        named = [topic for topic in topics if topic.deep and "depth" in topic.name.lower()]
        others = [topic for topic in topics if topic.deep and "infra" not in topic.name.lower()]
        deep = _distinct(named or others, "base")
        if not deep:
            forms = f"no depth pictures ({', '.join(DEEP)}, or compressed as PNG or RVL)"
            text = f"{forms}; its topics are {', '.join(bag.described()) or 'none'}"
            raise InputError(f"{path}: {text}; record a topic of depth")
        colors = [topic for topic in topics if not topic.deep and not re.search(r"infra|/ir\b", topic.name.lower())]
        tree = bag.tree()
        pairs = _paired(deep, colors, tree)
        used = {topic.name for pair in pairs for topic in pair if topic is not None}
        world = pose_in_root(tree, pairs[0][0].frame)[0]
        sensors = tuple(_sensor(bag, depth, color, tree, world) for depth, color in pairs)
        unread = tuple(text for text in bag.described() if text.split(" ")[0] not in used)
    return Take(path, KIND, sensors, "record the topics camera_info, too", unread)


@dataclass(frozen=True, slots=True)
class _Topic:
    """A topic with pictures, by its first message."""

    name: str
    count: int
    deep: bool | None  # depth, colour, or neither
    unit: float
    frame: str
    width: int
    height: int

    @property
    def base(self) -> str:
        """Its name without a form of compression."""
        return self.name.removesuffix("/compressed").removesuffix("/compressedDepth")

    @property
    def sdk(self) -> str:
        """Prefixes of a stream's names in RealSense's own files."""
        return self.name.removesuffix("/image/data")


class _Bag:
    """An open bag, whatever its version."""

    def __init__(self, path: Path, reader: Any, decode: Callable[[bytes, str], Any]) -> None:
        self.path, self.reader, self._decode = path, reader, decode

    def messages(self, name: str) -> Iterator[tuple[float, Any]]:
        """Yield the messages of a topic with their times, s: of the header, else of the recording."""
        found = [one for one in self.reader.connections if one.topic == name]
        for connection, recorded, data in self.reader.messages(found) if found else ():
            message = self._decode(data, connection.msgtype)
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            header = 0.0 if stamp is None else stamp.sec + stamp.nanosec / 1e9
            yield header or recorded / 1e9, message

    def first(self, name: str, good: Callable[[Any], bool] = lambda _: True) -> Any:
        """Return the first good message of a topic, otherwise the first; None without one."""
        first = next((message for _, message in self.messages(name)), None)
        return next((message for _, message in self.messages(name) if good(message)), first)

    def described(self) -> list[str]:
        return [f"{name} ({(kind.msgtype or '').split('/')[-1]})" for name, kind in sorted(self.reader.topics.items())]

    def topics(self) -> list[_Topic]:
        found = []
        for name, kind in sorted(self.reader.topics.items()):
            if (kind.msgtype or "").endswith(("/Image", "/CompressedImage")):
                first = self.first(name, lambda message: _topic("", 0, message).width > 0)
                found += [] if first is None else [_topic(name, kind.msgcount, first)]
        return found

    def tree(self) -> dict[str, tuple[str, Matrix]]:
        """Return each frame's parent, and its pose in that one."""
        stills = [one for _, message in self.messages("/tf_static") for one in message.transforms]
        parents = [(one.header.frame_id.lstrip("/"), _matrix(one.transform)) for one in stills]
        return dict(zip((one.child_frame_id.lstrip("/") for one in stills), parents, strict=True))

    @cached_property
    def links(self) -> dict[str, list[tuple[float, str, Matrix]]]:
        """The times, s, parents and poses of each frame that `/tf` moves."""
        links = dict[str, list[tuple[float, str, Matrix]]]()
        for _, message in self.messages("/tf"):
            for one in message.transforms:
                time = one.header.stamp.sec + one.header.stamp.nanosec / 1e9
                link = (time, one.header.frame_id.lstrip("/"), _matrix(one.transform))
                links.setdefault(one.child_frame_id.lstrip("/"), []).append(link)
        return links

    def way(self, frame: str, tree: dict[str, tuple[str, Matrix]]) -> Poses | None:
        """Return the poses of a frame in the root of all that carries it, by `/tf`; None where nothing moves it."""
        links = self.links
        found: Poses | None = None
        seen = set[str]()
        while frame in links and frame not in seen:
            seen.add(frame)
            times, parents, matrices = zip(*links[frame], strict=True)
            own = Poses(np.stack(matrices), np.array(times) if len(times) > 1 else None)  # one that is said once holds
            if found is None or found.times is None:
                found = Poses(own.matrices if found is None else own.matrices @ found.matrices, own.times)
            else:
                found = Poses(own.at(found.times) @ found.matrices, found.times)
            root, placed = pose_in_root(tree, parents[0])
            found, frame = Poses(placed @ found.matrices, found.times), root
        if found is None or found.times is None:
            return found
        known = np.isfinite(found.matrices).all(axis=(1, 2))
        return Poses(found.matrices[known], found.times[known]) if known.any() else None


@contextmanager
def _opened(path: Path) -> Iterator[_Bag]:
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    old = path.suffix.lower() == ".bag" and path.is_file()
    store = get_typestore(Stores.ROS1_NOETIC if old else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", POSES))  # ROS 1 has it elsewhere
    with (rosbag1.Reader if old else rosbag2.Reader)(path) as reader:
        yield _Bag(path, reader, store.deserialize_ros1 if old else store.deserialize_cdr)


def _topic(name: str, count: int, message: Any) -> _Topic:
    if hasattr(message, "encoding"):
        encoding, size = message.encoding, (message.width, message.height)
        readable = encoding in (*COLOR, *GREY, *YUV, *BAYER)
    else:  # as `16UC1; compressedDepth png`, `rgb8; jpeg compressed bgr8`, `jpeg`
        encoding = message.format.split(";")[0].strip()
        data = bytes(message.data)[COMPRESSED.size if "compressedDepth" in message.format else 0 :]
        try:
            if "rvl" in message.format.lower():
                size, readable = RVL.unpack_from(data), False
            else:
                size, readable = picture_size(data, name), not encoding.startswith("mono")
                encoding = "16UC1" if encoding == "png" and is_deep(data) else encoding
        except (InputError, struct.error):
            encoding, size, readable = "", (0, 0), False
    deep = True if encoding in DEEP else False if readable else None
    unit = DEEP.get(encoding, ("", 1.0))[1]
    return _Topic(name, count, deep, unit, message.header.frame_id.lstrip("/"), *size)


def _distinct(topics: list[_Topic], name: str) -> list[_Topic]:
    """Return topics without those that repeat one in another compression (base), or of one camera (frame)."""
    return list({getattr(topic, name): topic for topic in reversed(topics)}.values())[::-1]


def _paired(deep: list[_Topic], colors: list[_Topic], tree: dict[str, Any]) -> list[tuple[_Topic, _Topic | None]]:
    """Pair depth with the colour whose name begins alike; where no two begin alike, with any.

    Depth that was moved into the colour's frame repeats other depth: only the measured one stays where `tree` knows
    how both cameras lie, else only the moved one.
    """

    def alike(depth: _Topic, color: _Topic) -> tuple[int, bool]:
        pairs = zip(depth.name.split("/")[1:], color.name.split("/")[1:], strict=False)
        shared = len(list(takewhile(lambda pair: pair[0] == pair[1], pairs)))
        return shared, not _is_straight(color.name)  # a rectified picture was resampled

    near: dict[_Topic | None, list[_Topic]] = {}
    for depth in deep:
        best = max(colors, key=partial(alike, depth), default=None)
        lone = best is None or alike(depth, best)[0] == 0 < max(alike(*pair)[0] for pair in product(deep, colors))
        near.setdefault(None if lone else best, []).append(depth)
    pairs: list[tuple[_Topic, _Topic | None]] = []
    for color, found in near.items():
        if color is not None:
            own = [depth for depth in found if depth.frame != color.frame]
            known = own and pose_in_root(tree, own[0].frame)[0] == pose_in_root(tree, color.frame)[0]
            found = own if known or own == found else [depth for depth in found if depth.frame == color.frame]
            found = _distinct(found, "frame")
        pairs += [(depth, None if number else color) for number, depth in enumerate(found)]
    return pairs


def _sensor(bag: _Bag, depth: _Topic, color: _Topic | None, tree: dict[str, Any], world: str) -> Sensor:
    """Return a depth camera and the colour beside it; its pose counts in the frame `world` only."""
    (root, placed), unit = pose_in_root(tree, depth.frame), depth.unit
    option = f"{depth.sdk.rpartition('/')[0]}/option/Depth Units/value"
    for name in {option, option.replace(" ", "_")} & bag.reader.topics.keys():
        unit = round(float(bag.first(name).data), 9)  # 0.001 as 32 bits is a little more
    apart, seen = None, None
    if color is not None:
        seen, (other, beside) = _stream(bag, color), pose_in_root(tree, color.frame)
        to_depth, to_color = bag.first(f"{depth.sdk}/tf/0"), bag.first(f"{color.sdk}/tf/0")
        if to_depth is not None and to_color is not None:  # from their common reference
            apart = _matrix(to_depth) @ np.linalg.inv(_matrix(to_color))
        elif root == other:
            apart = np.linalg.inv(placed) @ beside
    if (way := bag.way(root, tree)) is not None:
        poses: Poses | None = Poses(way.matrices @ placed, way.times)
    else:
        poses = Poses(placed[None]) if depth.frame in tree and root == world else None
    return Sensor(depth.base.strip("/").replace("/", "-"), _stream(bag, depth), unit, seen, apart, poses)


def _stream(bag: _Bag, topic: _Topic) -> Stream:
    names = f"{topic.base.rpartition('/')[0]}/camera_info", f"{topic.sdk}/info/camera_info"
    infos = (bag.first(name, lambda info: info.width > 0 and _lens(info, False) is not None) for name in names)
    info = next((info for info in infos if info is not None), None)
    lens = None if info is None else _lens(info, _is_straight(topic.base))

    def pictures() -> Pictures:
        with _opened(bag.path) as again:
            for time, message in again.messages(topic.name):
                yield time, partial(_pixels, message)

    seconds = (bag.reader.end_time - bag.reader.start_time) / 1e9
    lens = None if lens is None or not topic.width else lens.resized(topic.width, topic.height)
    return Stream(topic.width, topic.height, topic.count, seconds, lens, pictures)


def _is_straight(name: str) -> bool:
    """Return True if a topic's name says that its pictures are rectified."""
    return "rect" in name.rpartition("/")[2].lower()


def _lens(info: Any, straight: bool) -> Camera | None:
    """Return the lens that a CameraInfo tells, None where it has zeros; `straight`: of rectified pictures."""
    matrix, bends, projection = (np.asarray(getattr(info, k, getattr(info, k.upper(), None)), float) for k in "kdp")
    numbers = projection.reshape(3, 4) if straight and projection.any() else matrix.reshape(3, 3)
    if not numbers.any() or not info.width:
        return None
    if straight or not bends.any():
        bends = bends[:0]
    elif info.distortion_model not in MODELS:
        raise ValueError(f"camera_info has the lens model {info.distortion_model}; rectify the pictures")
    (fx, _, cx), (_, fy, cy) = numbers[0, :3], numbers[1, :3]
    return lens_of(int(info.width), int(info.height), (fx, fy), (cx, cy), tuple(bends[:8].tolist()))


def _pixels(message: Any) -> Picture:
    data = bytes(message.data)
    if not hasattr(message, "encoding"):
        return _unpacked(message.format, data)
    if message.encoding in YUV:
        return _from_yuv(_numbers(message, 2), *YUV[message.encoding])
    numbers = _numbers(message)
    if message.encoding in BAYER:
        return _from_bayer(numbers, BAYER[message.encoding])
    return np.repeat(numbers[..., None], 3, axis=2) if message.encoding in GREY else numbers


def _numbers(message: Any, each: int = 1) -> np.ndarray:
    """Return the numbers of a picture that is not compressed, `each` a pixel; colours as red, green, blue."""
    data, channels = bytes(message.data), COLOR.get(message.encoding, [0] * each)
    kind = np.dtype(DEEP.get(message.encoding, ("u1",))[0]).newbyteorder(">" if message.is_bigendian else "<")
    wide = message.width * len(channels) * kind.itemsize
    if message.step < wide or len(data) < message.height * message.step:
        size = f"{message.width} x {message.height} pixels of {message.encoding}"
        raise ValueError(f"{size} in {len(data)} bytes, {message.step} a row, are too few")
    rows = np.frombuffer(data, np.uint8, message.height * message.step).reshape(message.height, -1)
    values = np.ascontiguousarray(rows[:, :wide]).view(kind).reshape(message.height, message.width, -1)
    if each > 1:
        return values.reshape(message.height, -1)
    if len(channels) > 1:
        return values[..., channels[:3]]
    found = values[..., 0].astype(kind.newbyteorder("="))
    return np.maximum(found, 0).astype(np.uint16) if kind.kind == "i" else found


def _from_yuv(pairs: UInt8[np.ndarray, "H N"], luma: int, chroma: int) -> UInt8[np.ndarray, "H W 3"]:
    """Return colours of pairs of luma and chroma in limited range (ITU-R BT.601)."""
    y = (pairs[:, luma::2].astype(np.float32) - 16) * 1.164
    u, v = (np.repeat(pairs[:, chroma + at :: 4].astype(np.float32) - 128, 2, axis=1) for at in (0, 2))
    channels = [y + 1.596 * v, y - 0.392 * u - 0.813 * v, y + 2.017 * u]
    return np.clip(np.rint(np.stack(channels, axis=2)), 0, 255).astype(np.uint8)


def _from_bayer(raw: UInt8[np.ndarray, "H W"], order: str) -> UInt8[np.ndarray, "H W 3"]:
    """Return colours of a picture with one channel a pixel; `order` are the channels of its first two rows of two."""
    from scipy.ndimage import convolve

    weights = np.array([[1, 2, 1], [2, 4, 2], [1, 2, 1]], np.float32)
    found = []
    for name in "rgb":
        mask = np.zeros(raw.shape, np.float32)
        for at in (k for k in range(4) if order[k] == name):
            mask[at // 2 :: 2, at % 2 :: 2] = 1
        sums = convolve(raw * mask, weights, mode="mirror"), convolve(mask, weights, mode="mirror")
        found.append(np.where(mask > 0, raw, np.rint(sums[0] / sums[1])))
    return np.stack(found, axis=2).astype(np.uint8)


def _from_rvl(data: bytes) -> UInt16[np.ndarray, "H W"]:
    """Return the depth in a stream of RVL (Wilson 2017): runs of zeros, and differences of what is between them."""
    columns, rows = RVL.unpack_from(data)
    if not 0 < columns * rows <= MOST_PIXELS:
        raise ValueError(f"a picture of {columns} x {rows}")
    words = np.frombuffer(data[RVL.size :][: (len(data) - RVL.size) // 4 * 4], "<u4")
    digits = (words[:, None] >> np.arange(28, -1, -4, dtype=np.uint32) & 15).reshape(-1).astype(np.int64)
    ends = np.flatnonzero(digits < 8)  # of numbers, three bits a digit, the lowest first
    begins = np.concatenate([[0], ends[:-1] + 1]) if len(ends) else ends
    place = np.arange(len(digits)) - np.repeat(begins, ends - begins + 1) if len(ends) else digits[:0]
    values = np.add.reduceat((digits[: len(place)] & 7) << np.minimum(3 * place, 60), begins) if len(ends) else begins
    seen, steps, at, k = np.zeros(columns * rows, bool), list[np.ndarray](), 0, 0
    while at < len(seen):
        run, count = values[k : k + 2].tolist() if k + 1 < len(values) else (0, 0)
        if run + count == 0 or at + run + count > len(seen) or k + 2 + count > len(values):
            raise ValueError(f"RVL ends at pixel {at} of {len(seen)}")
        seen[at + run : at + run + count] = True
        steps.append(values[k + 2 : k + 2 + count])
        at, k = at + run + count, k + 2 + count
    changes = np.concatenate([values[:0], *steps])
    depth = np.zeros(len(seen), np.uint16)
    depth[seen] = np.cumsum((changes >> 1) ^ -(changes & 1)).astype(np.uint16)
    return depth.reshape(rows, columns)


def _unpacked(form: str, data: bytes) -> Picture:
    if "compressedDepth" in form:
        _, a, b = COMPRESSED.unpack_from(data)
        packed = data[COMPRESSED.size :]
        depth = _from_rvl(packed) if "rvl" in form.lower() else parse_depth(packed, form)
        if not form.startswith("32FC1"):
            return depth
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(depth > 0, a / (depth - b), 0)
    return parse_depth(data, form) if form.split(";")[0].strip() in DEEP or is_deep(data) else data


def _matrix(transform: Any) -> Matrix:
    turn, place = transform.rotation, transform.translation
    return pose_of([turn.x, turn.y, turn.z, turn.w], [place.x, place.y, place.z])
