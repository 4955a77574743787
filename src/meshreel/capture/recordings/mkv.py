"""Recordings of Azure Kinect and Orbbec Femto cameras: Matroska files with depth, colour and a calibration.

Their form: https://learn.microsoft.com/previous-versions/azure/kinect-dk/record-file-format. The numbers of
`calibration.json` are in shares of the sensor's picture, of which a mode takes a part.
"""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from ...geometry.cameras import Camera
from ...texts import json_of
from ..calibration.poses import pose_of
from .takes import Pictures, Sensor, Stream, Take, lens_of

KIND = "an Azure Kinect or Femto recording (.mkv)"
CALIBRATION = "calibration.json"
TITLES = {"CALIBRATION_CameraLocationD0": "DEPTH", "CALIBRATION_CameraLocationPV0": "COLOR"}  # of tracks, by camera
# Of the sensor's 1024 x 1024 pixels, in modes with pictures that are not square, and in others: left edge and width,
# upper edge and height.
NARROW, ALL = ((192, 640), (180, 576)), ((0, 1024), (0, 1024))


def fits(path: Path) -> bool:
    return path.suffix.lower() == ".mkv" and path.is_file()


def read(path: Path) -> Take:
    import av

    with av.open(path) as video:
        tracks = {track.metadata.get("title", "").upper(): track for track in video.streams.video}
        if "DEPTH" not in tracks:
            raise ValueError(f"no track has the title DEPTH, only {', '.join(tracks) or 'none'}")
        start = int(video.metadata.get("K4A_START_OFFSET_NS", 0)) / 1e9
        attached = {one.metadata.get("filename"): one.data for one in video.streams.attachments}
        data = attached.get(CALIBRATION)
        known = json_of(data.rstrip(b"\0"))["CalibrationInformation"]["Cameras"] if data else []
        cameras = {TITLES[one["Location"]]: one for one in known if one.get("Location") in TITLES}
        streams = {}
        for title in [title for title in ("DEPTH", "COLOR") if title in tracks]:
            track, seconds = tracks[title], (video.duration or 0) / 1e6
            count = track.frames or round(seconds * float(track.average_rate or 0))
            size, told = (track.width, track.height), cameras.get(title)
            lens = None if told is None else _lens(told, title == "DEPTH", *size)
            pictures = partial(_pictures, path, video.streams.video.index(track), start, title == "DEPTH")
            reach = float((told or {}).get("MetricRadius") or np.inf)
            streams[title] = Stream(*size, count, seconds * (count - 1) / max(count, 1), lens, pictures, reach)
        others = tuple(title for title in tracks if title not in streams)
    apart = None
    if "COLOR" in cameras:  # which has the way back, in metres
        back = cameras["COLOR"]["Rt"]
        apart = np.linalg.inv(pose_of(np.reshape(back["Rotation"], (3, 3)), back["Translation"]))
    sensor = Sensor("kinect", streams["DEPTH"], 0.001, streams.get("COLOR"), apart)
    remedy = f"the file has no {CALIBRATION} attached; record it with the camera's SDK"
    return Take(path, KIND, (sensor,), remedy, others)


def _lens(camera: dict[str, Any], deep: bool, width: int, height: int) -> Camera:
    """Return the lens of a mode from what is known of the whole sensor, whose first pixel begins at 0."""
    cx, cy, fx, fy, k1, k2, k3, k4, k5, k6, _, _, p2, p1 = map(float, camera["Intrinsics"]["ModelParameters"][:14])
    if deep:
        sides = zip(NARROW if width != height else ALL, (width, height), strict=True)
        (left, wide), (top, high) = ((begin * side / part, 1024 * side / part) for (begin, part), side in sides)
    else:  # 4:3, of which 16:9 leaves out as much above as below; early calibrations are of 16:9
        left, top, wide, high = 0.0, (width * 0.75 - height) / 2, float(width), width * 0.75
        if camera["SensorWidth"] * 9 == camera["SensorHeight"] * 16:
            cy, fy = (cy * 2304 + 384) / 3072, fy * 2304 / 3072
    center = (cx * wide - left - 0.5, cy * high - top - 0.5)
    return lens_of(width, height, (fx * wide, fy * high), center, (k1, k2, p1, p2, k3, k4, k5, k6))


def _pictures(path: Path, index: int, start: float, deep: bool) -> Pictures:
    """Yield depth as it is stored, JPEG as it is stored, and other colour as it is decoded."""
    import av

    with av.open(path) as video:
        track = video.streams.video[index]
        shape = track.height, track.width
        for packet in video.demux(track):
            if packet.size == 0 or packet.pts is None:
                continue
            time = start + float(packet.pts * (packet.time_base or 0))
            if deep:
                yield time, np.frombuffer(bytes(packet), ">u2", shape[0] * shape[1]).reshape(shape).astype("u2")
            elif track.codec_context.name == "mjpeg":
                yield time, bytes(packet)
            else:
                for frame in track.codec_context.decode(packet):
                    yield time, frame.to_ndarray(format="rgb24")
