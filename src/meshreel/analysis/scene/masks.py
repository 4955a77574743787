"""Masks of moving pixels, from image files or a tracker, and pictures for tools that make them (paper, section 3.2).

In: the faces and depths that the views see in a frame, and the pictures of colour cameras if there are any. Out: one
mask per view, True at moving surface; pictures without lens distortion, or normals as colors, also in folders laid out
as `ImageMasks` reads them; and sheets of pictures of a segmentation, in the colors of its bodies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Bool, Float64, Integer, UInt8

from ...errors import InputError
from ...geometry.cameras import Camera, pack_cameras, unpack_cameras
from ...geometry.drawing import Seen, draw
from ...io.files import read_input
from ...io.pictures import find_masks, last_number, read_mask
from ...io.write import frame_names, make_folder, write_file, write_picture
from ...types import Frames, Mesh, offset
from .color_looks import ColorLooks

_BODIES = ((214, 39, 40), (31, 119, 180), (44, 160, 44), (255, 127, 14), (148, 103, 189), (23, 190, 207))
_LIGHT = np.array([0.36, 0.80, 0.48])
_AMBIENT = 0.45  # share of the color that unlit surface keeps: chosen by eye
_LEGEND = "light gray: still; colors: moving, one color per body (six in turn); dark gray: moving, part of no body"
Picture = UInt8[np.ndarray, "H W 3"]
CAMERAS = "cameras.json"  # file name: Open3D's pinhole camera JSON, beside the folders of the views
VIEW_FILES = "view_*.json"  # as TSMC's authors release the cameras of a scene


def normal_picture(seen: Seen, view: Camera) -> Picture:
    """Render normals n in world axes as colors (n + 1) / 2; white where nothing is seen.

    Normals are computed from the depths of neighbouring pixels, so they face the camera whatever the orientation of the
    faces.
    """
    ahead = view.ahead
    hit = np.isfinite(seen.depth)
    points = np.where(hit, seen.depth, np.nan)[..., None] * ahead
    normals = np.nan_to_num(np.cross(_step(points, 1), _step(points, 0)))
    normals *= -np.sign((normals * ahead).sum(axis=-1, keepdims=True))
    world = np.einsum("hwd,de->hwe", normals, view.extrinsic[:3, :3])
    world /= np.maximum(np.linalg.norm(world, axis=-1, keepdims=True), 1e-30)
    colors = np.rint(255 * (world + 1) / 2).astype(np.uint8)
    return np.where(hit[..., None], colors, np.uint8(255))


def write_views(
    folder: Path,
    frames: Frames,
    views: Sequence[Camera],
    report: Callable[[int], None] = lambda _done: None,
    colors: ColorLooks | None = None,
) -> None:
    """Write pictures of each frame from each view: view00/frame_00000.png ..., and `cameras.json` last.

    The pictures are those in `colors`, if given, whose views these are; else normals. A tool that makes masks from them
    keeps names and sizes, and puts the same `cameras.json` beside its masks. `report` is called with the number of
    finished frames.
    """
    views = one_size(views, "views")
    places = [folder / f"view{number:02}" for number in range(len(views))]
    for place in places:
        make_folder(place)
    for number, name in enumerate(frame_names(len(frames), "png")):
        mesh = frames[number]
        for view, place in enumerate(places):
            photo = None if colors is None else colors.at(number, view)
            picture = normal_picture(draw(mesh, views[view]), views[view]) if photo is None else photo
            write_picture(picture, place / name)
        report(number + 1)
    write_file(folder / CAMERAS, pack_cameras(views))


def _step(points: Float64[np.ndarray, "H W 3"], axis: int) -> Float64[np.ndarray, "H W 3"]:
    """Return the vector to the next point along an axis, to the side that differs less in depth: edges stay sharp."""
    ahead = np.diff(points, axis=axis)
    none = np.full_like(np.take(points, [0], axis=axis), np.nan)
    after, before = np.concatenate([ahead, none], axis=axis), np.concatenate([none, ahead], axis=axis)
    costs = [np.where(np.isnan(step[..., 2:]), np.inf, np.abs(step[..., 2:])) for step in (after, before)]
    return np.where(costs[0] <= costs[1], after, before)


_RESTS, _NO_BODY = (205, 205, 205), (90, 90, 90)
_GAP, _LEFT, _TOP, _TEXT = 4, 64, 24, 14  # pixels: between pictures, left of them, above and below them, of text


def label_colors(moving: Bool[np.ndarray, " F"], bodies: Integer[np.ndarray, " F"]) -> UInt8[np.ndarray, "F 3"]:
    """Return a color for each face: light gray if still, one of six by the body's number, dark gray if of no body."""
    by_body = np.array(_BODIES, np.uint8)[(bodies.astype(np.int64) - 1) % len(_BODIES)]
    colors = np.where((bodies > 0)[:, None], by_body, np.array(_NO_BODY, np.uint8))
    return np.where(moving[:, None], colors, np.array(_RESTS, np.uint8))


def look_at_labels(
    mesh: Mesh, moving: Bool[np.ndarray, " F"], bodies: Integer[np.ndarray, " F"], views: Sequence[Camera]
) -> tuple[list[Picture], list[int]]:
    """Return each view's picture, and the number of moving faces that it sees."""
    colors = label_colors(moving, bodies)
    pictures, counts = list[Picture](), list[int]()
    for view in views:
        seen = draw(mesh, view)
        normals = normal_picture(seen, view).astype(np.float64) * (2 / 255) - 1
        light = _AMBIENT + (1 - _AMBIENT) * np.abs(normals @ _LIGHT)
        hit = seen.faces >= 0
        pictures.append(np.full((*hit.shape, 3), 255, np.uint8))  # white where nothing is seen
        pictures[-1][hit] = np.rint(colors[seen.faces[hit]] * np.minimum(light[hit], 1)[:, None])
        counts.append(int(moving[np.unique(seen.faces[hit])].sum()))
    return pictures, counts


def sheet(rows: Sequence[tuple[int, Sequence[Picture]]], views: Sequence[int]) -> UInt8[np.ndarray, "Y X 3"]:
    """Draw pictures of one size on a sheet: a row per frame, a column per view, with their numbers and a legend."""
    from PIL import Image, ImageDraw, ImageFont

    height, width, _ = rows[0][1][0].shape
    size = (_LEFT + len(views) * (width + _GAP), _TOP + len(rows) * (height + _GAP) + _TOP)
    image = Image.new("RGB", size, "white")
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(_TEXT)
    for k, view in enumerate(views):
        draw.text((_LEFT + k * (width + _GAP), _GAP), f"view {view}", "black", font)
    for i, (frame, pictures) in enumerate(rows):
        top = _TOP + i * (height + _GAP)
        draw.text((_GAP, top), f"frame\n{frame}", "black", font)
        for k, picture in enumerate(pictures):
            image.paste(Image.fromarray(picture), (_LEFT + k * (width + _GAP), top))
    draw.text((_LEFT, size[1] - _TOP + _GAP), _LEGEND, "black", font)
    return np.asarray(image)


@runtime_checkable
class Masker(Protocol):
    """Base class of sources of masks, which mark the pixels of each view that see moving surface."""

    views: tuple[Camera, ...] | None = None  # cameras of the masks; None: those that the scene is segmented with
    observes: bool = False  # whether `foresee` and `observe` must be called before the first masks

    def foresee(self, moments: Sequence[Sequence[Seen]], colors: ColorLooks | None = None) -> None:
        """Receive all views of a few moments, to choose a reference view; called once, before `observe`.

        `colors` are the pictures of the views if these are colour cameras.
        """
        del moments, colors

    def observe(self, frame: int, seen: Sequence[Seen], views: Sequence[Camera]) -> None:
        """Receive the views of a frame; called for every frame in order, before the first masks."""
        del frame, seen, views

    def masks(self, frame: int, seen: Sequence[Seen], views: Sequence[Camera]) -> Bool[np.ndarray, "X H W"]:
        """Return the masks of one frame in the order of the views; True: moving."""


class ImageMasks(Masker):
    """Masks made by another tool: `cameras.json`, and view00/frame_00000.png for each view and frame.

    Pixels are object numbers; 0 means still.
    """

    views: tuple[Camera, ...]

    def __init__(self, folder: Path, frames: int) -> None:
        """Read every file of `frames` frames. Raises InputError if one is missing, damaged or of another size."""
        self.views = read_view_file(folder / CAMERAS, "the cameras of the masks, as Open3D pinhole camera JSON")
        self._files = find_masks(folder, len(self.views), frames)
        for view, files in zip(self.views, self._files, strict=True):
            for frame, path in enumerate(files):
                height, width = read_mask(path).shape  # reads all of it, so that damage is found before encoding starts
                if (width, height) != (view.width, view.height):
                    text = f"{width} x {height} pixels where its camera has {view.width} x {view.height}"
                    raise InputError(f"{path} (frame {frame}): {text}; make masks of the camera's size")
        surplus = len([path for path in self._files[0][0].parent.iterdir() if path.suffix.lower() == ".png"]) - frames
        text = f"{folder}: has masks for {surplus} more frames than the {frames} of the sequence: the first are used"
        self.remarks = (f"{text}, beginning with frame 0",) if surplus > 0 else ()

    def masks(self, frame: int, seen: Sequence[Seen], views: Sequence[Camera]) -> Bool[np.ndarray, "X H W"]:
        """Return the masks of one frame; `views` must be `self.views`."""
        assert len(seen) == len(views) == len(self.views), "masks belong to their own views"
        return self.objects(frame) > 0

    def objects(self, frame: int) -> UInt8[np.ndarray, "X H W"]:
        """Return the number of the moving object that each pixel of each view sees; 0: none."""
        return np.stack([read_mask(files[offset(frame, range(len(files)))]) for files in self._files])


def read_view_file(path: Path, wanted: str = "Open3D pinhole camera JSON") -> tuple[Camera, ...]:
    """Read views, all of one size, from a file, or from the files `view_00.json` and so on of a folder.

    Raises InputError, which says what is `wanted`, if they are invalid.
    """
    if path.is_dir():
        files = sorted(path.glob(VIEW_FILES), key=lambda file: (last_number(file.stem) or 0, file.name))
        if not files:
            raise InputError(f"{path}: holds no {VIEW_FILES}; give {wanted}, or a folder with such files")
        return one_size([view for file in files for view in read_view_file(file, wanted)], str(path))
    return one_size(unpack_cameras(read_input(path, f"give {wanted}"), str(path)), str(path))


def one_size(views: Sequence[Camera], name: str) -> tuple[Camera, ...]:
    """Return the views as a tuple. Raises InputError, which calls them `name`, if there is none or sizes differ."""
    if not views:
        raise InputError(f"{name}: has 0 cameras; give at least one")
    sizes = sorted({(view.width, view.height) for view in views})
    if len(sizes) > 1:
        two = " and ".join(f"{width} x {height}" for width, height in sizes[:2])
        raise InputError(f"{name}: cameras of {two} pixels; give cameras of one size")
    return tuple(views)
