"""ROS bags: ROS 1 (`.bag`, also of RealSense's own tools), ROS 2 (folders, `.db3`) and MCAP (`.mcap`).

Depth cameras are the image topics of 16 bits or floats; `camera_info` beside them has their lenses, `/tf_static` (in
RealSense's files `tf/0`) their poses. Times are those of the pictures, not of their recording.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import product, takewhile
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ...geometry.cameras import Camera, Matrix
from ...io.pictures import parse_depth
from ..calibration.poses import pose_in_root, pose_of
from .takes import Picture, Pictures, Sensor, Stream, Take, lens_of, picture_size

KIND = "a ROS 1 or RealSense .bag, a ROS 2 bag, an .mcap"
DEEP = {"16UC1": ("<u2", 0.001), "mono16": ("<u2", 0.001), "32FC1": ("<f4", 1.0)}  # type, and its unit in ROS, m
# Order of red, green, blue.
COLOR = {"rgb8": [0, 1, 2], "bgr8": [2, 1, 0], "rgba8": [0, 1, 2, 3], "bgra8": [2, 1, 0, 3]}
MODELS = ("", "plumb_bob", "rational_polynomial", "none", "Brown Conrady", "Inverse Brown Conrady")
POSES = "tf2_msgs/msg/TFMessage"
COMPRESSED = struct.Struct("<iff")  # before the PNG of compressedDepth: form, and the two numbers of floats


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
            forms = f"no depth pictures ({', '.join(DEEP)}, or compressedDepth as PNG)"
            text = f"{forms}; its topics are {', '.join(bag.described()) or 'none'}"
            raise InputError(f"{path}: {text}; record a topic of depth")
        colors = [topic for topic in topics if not topic.deep]
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

    def first(self, name: str) -> Any:
        """Return the first message of a topic, None without one."""
        return next((message for _, message in self.messages(name)), None)

    def described(self) -> list[str]:
        return [f"{name} ({(kind.msgtype or '').split('/')[-1]})" for name, kind in sorted(self.reader.topics.items())]

    def topics(self) -> list[_Topic]:
        found = []
        for name, kind in sorted(self.reader.topics.items()):
            if (kind.msgtype or "").endswith(("/Image", "/CompressedImage")):
                first = self.first(name)
                found += [] if first is None else [_topic(name, kind.msgcount, first)]
        return found

    def tree(self) -> dict[str, tuple[str, Matrix]]:
        """Return each frame's parent, and its pose in that one."""
        stills = [one for _, message in self.messages("/tf_static") for one in message.transforms]
        parents = [(one.header.frame_id.lstrip("/"), _matrix(one.transform)) for one in stills]
        return dict(zip((one.child_frame_id.lstrip("/") for one in stills), parents, strict=True))


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
        encoding, size, readable = message.encoding, (message.width, message.height), message.encoding in COLOR
    else:  # as `16UC1; compressedDepth png`, `rgb8; jpeg compressed bgr8`, `jpeg`
        encoding = message.format.split(";")[0].strip()
        start = COMPRESSED.size if "compressedDepth" in message.format else 0
        try:
            size, readable = picture_size(bytes(message.data)[start:], name), not encoding.startswith("mono")
        except InputError:  # no PNG or JPEG, as RVL is none
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
        return shared, "image_rect" not in color.name  # a rectified picture was resampled

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
    poses = placed[None] if depth.frame in tree and root == world else None
    return Sensor(depth.base.strip("/").replace("/", "-"), _stream(bag, depth), unit, seen, apart, poses)


def _stream(bag: _Bag, topic: _Topic) -> Stream:
    info = bag.first(f"{topic.base.rpartition('/')[0]}/camera_info") or bag.first(f"{topic.sdk}/info/camera_info")
    lens = None if info is None else _lens(info, "image_rect" in topic.base)

    def pictures() -> Pictures:
        with _opened(bag.path) as again:
            for time, message in again.messages(topic.name):
                yield time, _pixels(message)

    seconds = (bag.reader.end_time - bag.reader.start_time) / 1e9
    lens = None if lens is None else lens.resized(topic.width, topic.height)
    return Stream(topic.width, topic.height, topic.count, seconds, lens, pictures)


def _lens(info: Any, straight: bool) -> Camera | None:
    """Return the lens that a CameraInfo tells, None where it has zeros; `straight`: of rectified pictures."""
    matrix, bends, projection = (
        np.asarray(getattr(info, name, getattr(info, name.upper(), None)), np.float64) for name in ("k", "d", "p")
    )
    numbers = projection.reshape(3, 4) if straight and projection.any() else matrix.reshape(3, 3)
    if not numbers.any():
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
    channels = COLOR.get(message.encoding, [0])
    kind = np.dtype(DEEP.get(message.encoding, ("u1",))[0]).newbyteorder(">" if message.is_bigendian else "<")
    wide = message.width * len(channels) * kind.itemsize
    if message.step < wide or len(data) < message.height * message.step:
        size = f"{message.width} x {message.height} pixels of {message.encoding}"
        raise ValueError(f"{size} in {len(data)} bytes, {message.step} a row, are too few")
    rows = np.frombuffer(data, np.uint8, message.height * message.step).reshape(message.height, -1)
    values = np.ascontiguousarray(rows[:, :wide]).view(kind).reshape(message.height, message.width, -1)
    return values[..., channels[:3]] if len(channels) > 1 else values[..., 0].astype(kind.newbyteorder("="))


def _unpacked(form: str, data: bytes) -> Picture:
    if "compressedDepth" in form:
        _, a, b = COMPRESSED.unpack_from(data)
        depth = parse_depth(data[COMPRESSED.size :], form)
        if not form.startswith("32FC1"):
            return depth
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(depth > 0, a / (depth - b), 0)
    return parse_depth(data, form) if form.split(";")[0].strip() in DEEP else data


def _matrix(transform: Any) -> Matrix:
    turn, place = transform.rotation, transform.translation
    return pose_of([turn.x, turn.y, turn.z, turn.w], [place.x, place.y, place.z])
