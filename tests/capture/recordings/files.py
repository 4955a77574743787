"""Recordings of a ball before a wall, written by the packages that read them: each at 10 pictures a second."""

import io
import json
from pathlib import Path

import numpy as np
from PIL import Image

from meshreel.io.pictures import pack_picture
from meshreel.io.write import write_picture
from tests.capture.depth_scenes import camera, measured

SIZE, COUNT, RATE = 96, 4, 10
CAMERA = camera(size=SIZE)
BALLS = [(0.1 * number - 0.1, 0.0, 0.0) for number in range(COUNT)]
DEPTHS = [measured(CAMERA, ball) for ball in BALLS]  # mm
TIMES = [100 + number / RATE for number in range(COUNT)]  # s
STILL = [0.0, 0.0, 0.0, 1.0, 0.1, 1.5, 0.2]  # x y z w, and a position, m
MATRIX = [[SIZE, 0, SIZE / 2 - 0.5], [0, SIZE, SIZE / 2 - 0.5], [0, 0, 1]]


def shade(number):
    """The colours of a frame: grey that grows."""
    return np.full((SIZE, SIZE, 3), 40 + 20 * number, np.uint8)


def jpeg(number):
    packed = io.BytesIO()
    Image.fromarray(shade(number)).save(packed, "JPEG", quality=95)
    return packed.getvalue()


def tum(folder, depth_times=TIMES, color_times=TIMES, poses=(STILL,) * COUNT, numbers="96 96 47.5 47.5"):
    """A TUM RGB-D folder; depth in 1/5000 m."""
    for name in ("depth", "rgb"):
        (folder / name).mkdir(parents=True)
    for number in range(COUNT):
        write_picture((DEPTHS[number] * 5).astype(np.uint16), folder / "depth" / f"{number}.png")
        (folder / "rgb" / f"{number}.jpg").write_bytes(jpeg(number))
    for name, times, kind in (("depth", depth_times, "png"), ("rgb", color_times, "jpg")):
        rows = [f"{time:.4f} {name}/{number}.{kind}" for number, time in enumerate(times)]
        (folder / f"{name}.txt").write_text("\n".join(["# a list", *rows]))
    rows = [f"{time} {' '.join(map(str, [*pose[4:], *pose[:4]]))}" for time, pose in zip(TIMES, poses, strict=False)]
    (folder / "groundtruth.txt").write_text("\n".join(rows))
    if numbers:
        (folder / "calibration.txt").write_text(numbers)
    return folder


def stray(folder, poses=(STILL,) * COUNT):
    """A Stray Scanner folder, whose video is twice as large as its depth."""
    import av

    for name in ("depth", "confidence"):
        (folder / name).mkdir(parents=True)
    for number in range(COUNT):
        write_picture(DEPTHS[number], folder / "depth" / f"{number:06}.png")
        sure = np.full((SIZE, SIZE), 2, np.uint8)
        sure[0] = 0
        (folder / "confidence" / f"{number:06}.png").write_bytes(pack_picture(sure))
    with av.open(str(folder / "rgb.mp4"), "w") as video:
        stream = video.add_stream("mpeg4", rate=RATE)
        stream.width = stream.height = 2 * SIZE
        stream.pix_fmt = "yuv420p"
        for number in range(COUNT):
            frame = av.VideoFrame.from_ndarray(np.kron(shade(number), np.ones((2, 2, 1), np.uint8)), format="rgb24")
            video.mux(stream.encode(frame))
        video.mux(stream.encode())
    rows = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    rows += [
        f"{t}, {n:06}, {', '.join(map(str, [*p[4:], *p[:4]]))}"
        for n, (t, p) in enumerate(zip(TIMES, poses, strict=False))
    ]
    (folder / "odometry.csv").write_text("\n".join(rows))
    matrix = np.array(MATRIX) * [[2], [2], [1]] + [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    (folder / "camera_matrix.csv").write_text("\n".join(", ".join(map(str, row)) for row in matrix))
    return folder


def record3d_metadata(poses=(STILL,) * COUNT):
    about = {"w": SIZE, "h": SIZE, "dw": SIZE, "dh": SIZE, "fps": RATE, "K": np.array(MATRIX).T.ravel().tolist()}
    return about | {"poses": [list(pose) for pose in poses], "frameTimestamps": TIMES}


def exr(folder):
    """What Record3D exports."""
    import OpenEXR

    place = folder / "EXR_RGBD"
    for name in ("depth", "rgb"):
        (place / name).mkdir(parents=True)
    for number in range(COUNT):
        (place / "rgb" / f"{number}.jpg").write_bytes(jpeg(number))
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
        depth = np.where(DEPTHS[number] > 0, DEPTHS[number] / 1000, np.nan).astype(np.float32)
        OpenEXR.File(header, {"R": depth}).write(str(place / "depth" / f"{number}.exr"))
    (place / "metadata.json").write_text(json.dumps(record3d_metadata()))
    return folder


def mkv(path: Path, calibration: dict | None, depth_mode=(640, 576), title="DEPTH"):
    """An Azure Kinect recording; depth of frame n is 1000 + n mm in the whole picture."""
    import av

    with av.open(str(path), "w", options={"allow_raw_vfw": "1"}) as video:
        deep, color = video.add_stream("rawvideo", rate=RATE), video.add_stream("mjpeg", rate=RATE)
        deep.width, deep.height, deep.pix_fmt = *depth_mode, "gray16be"
        color.width, color.height, color.pix_fmt = 1280, 720, "yuvj444p"
        deep.metadata["title"], color.metadata["title"] = title, "COLOR"
        video.metadata["K4A_START_OFFSET_NS"] = "2000000000"
        if calibration is not None:
            video.add_attachment(
                "calibration.json", "application/octet-stream", json.dumps(calibration).encode() + b"\0"
            )
        for number in range(COUNT):
            depth = np.full(depth_mode[::-1], 1000 + number, np.uint16)
            grey = np.full((720, 1280, 3), 40 + 20 * number, np.uint8)
            for stream, pixels, form in ((deep, depth, "gray16be"), (color, grey, "rgb24")):
                frame = av.VideoFrame.from_ndarray(pixels, format=form)
                frame.pts = number
                video.mux(stream.encode(frame))
        for stream in (deep, color):
            video.mux(stream.encode())
    return path


class Bag:
    """A bag that rosbags writes: ROS 1 (.bag), ROS 2 (a folder) or MCAP, with pictures of one camera."""

    def __init__(self, path: Path, form: str) -> None:
        from rosbags import rosbag1, rosbag2
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self.old = form == "bag"
        self.store = get_typestore(Stores.ROS1_NOETIC if self.old else Stores.ROS2_HUMBLE)
        self.store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
        plugin = {} if self.old else {"version": 9, "storage_plugin": rosbag2.StoragePlugin[form.upper()]}
        self.writer = (rosbag1.Writer if self.old else rosbag2.Writer)(path, **plugin)
        self.topics: dict = {}
        self.path = path

    def __enter__(self):
        self.writer.open()
        return self

    def __exit__(self, *_):
        self.writer.close()

    def of(self, kind, *values, **named):
        return self.store.types[kind.replace("/", "/msg/")](*values, **named)

    def write(self, topic, kind, message, time=TIMES[0]):
        kind = kind.replace("/", "/msg/")
        if topic not in self.topics:
            self.topics[topic] = self.writer.add_connection(topic, kind, typestore=self.store)
        pack = self.store.serialize_ros1 if self.old else self.store.serialize_cdr
        self.writer.write(self.topics[topic], int(time * 1e9), pack(message, kind))

    def header(self, time, frame):
        stamp = self.of("builtin_interfaces/Time", int(time), round(time % 1 * 1e9))
        return self.of("std_msgs/Header", **({"seq": 0} if self.old else {}), stamp=stamp, frame_id=frame)

    def image(self, topic, pixels, encoding, time, frame="optical"):
        data, (height, width) = np.frombuffer(pixels.tobytes(), np.uint8), pixels.shape[:2]
        values = (self.header(time, frame), height, width, encoding, 0, len(data) // height, data)
        self.write(topic, "sensor_msgs/Image", self.of("sensor_msgs/Image", *values), time + 0.02)

    def compressed(self, topic, data, form, time, frame="optical"):
        message = self.of("sensor_msgs/CompressedImage", self.header(time, frame), form, np.frombuffer(data, np.uint8))
        self.write(topic, "sensor_msgs/CompressedImage", message, time + 0.02)

    def info(self, topic, bends=(), model="plumb_bob", matrix=MATRIX):
        roi, flat = self.of("sensor_msgs/RegionOfInterest", 0, 0, 0, 0, False), np.array(matrix, float).ravel()
        shared = (SIZE, SIZE, model, np.array(bends, float), flat, np.eye(3).ravel(), np.zeros(12), 0, 0, roi)
        message = self.of("sensor_msgs/CameraInfo", self.header(TIMES[0], "optical"), *shared)
        self.write(topic, "sensor_msgs/CameraInfo", message)

    def transform(self, place, turn=(0.0, 0.0, 0.0, 1.0)):
        made = self.of("geometry_msgs/Vector3", *place), self.of("geometry_msgs/Quaternion", *turn)
        return self.of("geometry_msgs/Transform", *made)

    def move(self, parent, child, place, time):
        one = self.of("geometry_msgs/TransformStamped", self.header(time, parent), child, self.transform(place))
        self.write("/tf", "tf2_msgs/TFMessage", self.of("tf2_msgs/TFMessage", [one]), time)

    def still(self, parent, child, place, turn=(0.0, 0.0, 0.0, 1.0)):
        one = self.of("geometry_msgs/TransformStamped", self.header(0, parent), child, self.transform(place, turn))
        self.write("/tf_static", "tf2_msgs/TFMessage", self.of("tf2_msgs/TFMessage", [one]))
