"""Panels of equal size for the documentation's pictures, meshes drawn, and the picture of docs/tutorial.md."""

from __future__ import annotations

import io
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from PIL import Image

from meshreel.analysis.scene.segmentation import segment
from meshreel.capture.recording import FusionOptions, open_recording
from meshreel.capture.simulated.demo_room import RoomOptions, furnished_room, room_cameras
from meshreel.capture.simulated.sensors import SensorOptions
from meshreel.capture.simulated.simulated_rig import simulate_rig
from meshreel.decoder.video import open as open_video
from meshreel.encoder.sequence import encode
from meshreel.geometry.cameras import looking_at
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.drawing import Parallel
from meshreel.geometry.topology import blend, components, concatenate, face_normals, part_of
from meshreel.metrics.render import look
from meshreel.metrics.viewpoints import Box
from meshreel.types import Mesh

from ..parallel_views import parallel_views_around

DPI = 100
TOP, GAP, RIGHT, BOTTOM = 26, 6, 80, 8  # pixels over, between, right (for a color bar) and under the panels
LIGHT = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
GREY = 0.82
FINE = 3  # samples a pixel and axis, averaged
COLORS = 256  # of a picture's palette
BODIES = np.array([[0.87, 0.45, 0.20], [0.20, 0.45, 0.70], [0.35, 0.65, 0.35]])  # RGB of three bodies


class Sheet:
    """A row of square panels with titles."""

    def __init__(self, panels: int, size: int = 300, bar: bool = False) -> None:
        self.size = size
        self.shape = (panels * (size + GAP) + (RIGHT if bar else 0), size + TOP + BOTTOM)
        self.figure = Figure(figsize=(self.shape[0] / DPI, self.shape[1] / DPI), dpi=DPI)
        FigureCanvasAgg(self.figure)
        self.axes = [self._axes(k * (size + GAP), size) for k in range(panels)]
        for axes in self.axes:
            axes.set_axis_off()

    def image(self, panel: int, title: str, pixels: np.ndarray) -> None:
        """A picture, pixel for pixel."""
        self.axes[panel].imshow(np.clip(pixels, 0, 1), interpolation="nearest")
        self.axes[panel].set_title(title, fontsize=9)

    def bar(self, image: Any, label: str) -> None:
        """The color bar right of the last panel."""
        bar = self._axes(len(self.axes) * (self.size + GAP), 12)
        self.figure.colorbar(image, cax=bar, extend="max").set_label(label, fontsize=8)
        bar.tick_params(labelsize=7)

    def _axes(self, left: int, width: int) -> Any:
        wide, high = self.shape
        return self.figure.add_axes((left / wide, BOTTOM / high, width / wide, self.size / high))


def chart(wide: float, high: float) -> tuple[Figure, Any]:
    """An empty figure, inches, and its axes."""
    figure = Figure(figsize=(wide, high), dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.add_subplot()


def write_figure(figure: Figure, path: Path) -> None:
    """A figure as a PNG with a palette."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=DPI, metadata={"Software": None})
    write_small(buffer, path)


def write_small(source: io.BytesIO | Path, path: Path) -> None:
    """A picture with few colors, so that it is small."""
    picture = Image.open(source).convert("RGB").quantize(COLORS, Image.Quantize.MEDIANCUT, dither=Image.Dither.NONE)
    picture.save(path, optimize=True)


def camera_for(meshes: list[Mesh], size: int, view: int = 0) -> Parallel:
    """A parallel view of everything in the meshes: 0 front, 1 right, 2 back, 3 left."""
    return parallel_views_around(Box.of(meshes), size)[view]


def oblique(meshes: list[Mesh], towards_eye: np.ndarray, shape: tuple[int, int], margin: float) -> Parallel:
    """A parallel view that holds all meshes, `shape` pixels wide and high, `margin` times as large as they need."""
    rotation = looking_at(towards_eye, np.zeros(3))[:3, :3].T
    turned = np.concatenate([mesh.vertices for mesh in meshes]) @ rotation.T
    low, high = turned.min(axis=0), turned.max(axis=0)
    extrinsic = np.eye(4)
    extrinsic[:3, :3], extrinsic[:3, 3] = rotation, -(low + high) / 2
    pixel = margin * max((high - low)[:2] / shape)  # m
    return Parallel(*shape, pixel, extrinsic)


def shaded(mesh: Mesh, camera: Parallel, colors: Float64[np.ndarray, "V 3"] | None = None) -> np.ndarray:
    """A mesh under a lamp beside the camera: grey, or colors of its vertices."""
    camera = _finer(camera)
    view = look(mesh, camera)
    picture = np.ones((camera.height, camera.width, 3))
    turned = view.normals @ camera.extrinsic[:3, :3].T * [1, -1, -1]
    light = 0.45 + 0.55 * np.abs(turned @ LIGHT)
    base = np.full((len(view.points), 3), GREY)
    if colors is not None:
        hits = Surface(mesh).closest(view.points)
        base = blend(colors, mesh.faces[hits.faces], hits.barycentric)
    picture[view.covered] = base * light[:, None]
    return _averaged(picture)


def normal_colored(mesh: Mesh, camera: Parallel) -> np.ndarray:
    """A mesh in the colors of its normals, as in the paper."""
    camera = _finer(camera)
    return _averaged(look(mesh, camera).colors)


def heat(mesh: Mesh, camera: Parallel, other: Mesh) -> np.ma.MaskedArray:
    """Distance from what the camera sees of a mesh to the surface of another one; masked where nothing is seen."""
    view = look(mesh, camera)
    distances = np.ma.masked_array(np.zeros(view.covered.shape), mask=~view.covered)
    distances[view.covered] = np.linalg.norm(Surface(other).closest(view.points).points - view.points, axis=1)
    return distances


def placed(points: Float64[np.ndarray, "K 3"], camera: Parallel) -> Float64[np.ndarray, "K 3"]:
    """Points in the coordinates of a camera."""
    return points @ camera.extrinsic[:3, :3].T + camera.extrinsic[:3, 3]


def draw_edges(axes: Any, title: str, mesh: Mesh, camera: Parallel, line: float) -> None:
    """The mesh's faces with their edges, nearest last."""
    points = placed(mesh.vertices, camera)
    flat, normals = camera.project(points)[mesh.faces], face_normals(Mesh(points, mesh.faces))[0]
    order = np.argsort(-points[mesh.faces][:, :, 2].mean(axis=1), kind="stable")
    order = order[normals[order, 2] < 0]  # the front
    light = 0.45 + 0.55 * np.abs((normals * [1, -1, -1]) @ LIGHT)
    grey = np.repeat((0.85 * light)[order, None], 3, axis=1)
    axes.add_collection(PolyCollection(flat[order], facecolors=grey, edgecolors=(0.1, 0.2, 0.4), linewidths=line))
    _finish(axes, title, camera)


def draw_points(
    axes: Any, title: str, points: np.ndarray, camera: Parallel, colors: np.ndarray, size: float = 7.0
) -> None:
    """Points as dots, nearest last; small ones have no rim."""
    local = placed(points, camera)
    order = np.argsort(-local[:, 2], kind="stable")
    flat = camera.project(local)
    rim = 0.2 if size > 1 else 0.0
    axes.scatter(*flat[order].T, s=size, c=colors[order], linewidths=rim, edgecolors="black")
    _finish(axes, title, camera)


def _finish(axes: Any, title: str, camera: Parallel) -> None:
    axes.set(xlim=(0, camera.width), ylim=(camera.height, 0))
    axes.set_title(title, fontsize=9)


def _finer(camera: Parallel) -> Parallel:
    return replace(camera, width=FINE * camera.width, height=FINE * camera.height, pixel=camera.pixel / FINE)


def _averaged(picture: np.ndarray) -> np.ndarray:
    high, wide = picture.shape[0] // FINE, picture.shape[1] // FINE
    return picture.reshape(high, FINE, wide, FINE, 3).mean(axis=(1, 3))


FRAMES, SHOWN = 20, 9
WIDTH, NOISE, VOXEL = 256, 0.3, 0.03  # pixels; of the sensor; m: as the procedural room of experiments has them
PANEL = 300  # pixels
FROM = np.array([0.42, 0.42, 1.0])  # where the picture is seen from


def draw_room(path: Path) -> None:
    """A fused frame, the faces that move, the background alone, the frame decoded."""
    with tempfile.TemporaryDirectory() as folder:
        rig, room = Path(folder) / "rig", furnished_room(RoomOptions(frames=FRAMES))
        simulate_rig(rig, room, room_cameras(WIDTH), room.options.frame_rate, SensorOptions(noise=NOISE))
        capture = open_recording(rig, FusionOptions(VOXEL))[0]
        frame, moves = capture[SHOWN], segment(capture).moving(SHOWN, capture[SHOWN])
        encode(capture, Path(folder) / "room.reel")
        with open_video(Path(folder) / "room.reel") as video:
            background, decoded = video.background(SHOWN), video[SHOWN]
    sheet, camera = Sheet(4, PANEL), oblique([background], FROM, (PANEL, PANEL), 1.03)
    still, moving = (part_of(frame, chosen) for chosen in (~moves, moves))
    label = components(moving.faces, len(moving.vertices))
    rank = np.argsort(np.argsort(-np.bincount(label), kind="stable"), kind="stable")[label]  # the largest body first
    colors = np.concatenate([np.full((len(still.vertices), 3), GREY), BODIES[rank % len(BODIES)]])
    sheet.image(0, f"fused: {len(frame.faces)} faces", shaded(frame, camera))
    colored = shaded(concatenate([still, moving]), camera, colors)
    sheet.image(1, f"moving: {100 * moves.mean():.0f} % of the faces", colored)
    sheet.image(2, f"background, once: {len(background.faces)} faces", shaded(background, camera))
    sheet.image(3, f"decoded: {len(decoded.faces)} faces", shaded(decoded, camera))
    write_figure(sheet.figure, path)
