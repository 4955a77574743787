"""Pictures of frames as the player shows them: in their own colours, or as clay in its light, with smooth edges.

In: the parts of a frame, the box and the axis by which they stand, a view. Out: red, green, blue and alpha. Colours are
blended as the screen has them (sRGB). The light and its constants are those of `SURFACE_FRAGMENT` in the player's
shaders; `clay` is of its `colors.ts`. The same pictures come on every machine.
"""

from __future__ import annotations

import math
import struct
import zlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product

import numpy as np

from ..shapes import Float64, Int32, UInt8
from ..types import UP_AXES, UPRIGHT, Mesh, Up
from .cameras import Camera, CameraPose, matrix_of
from .color_views import colors_on
from .drawing import Crop, SeenPlaces, draw_places
from .ground import Ground
from .splat_drawing import FlatSplats
from .splats import Bound
from .strict import exp, norm, products, rounded
from .threads import mapped
from .topology import blend, face_normals, vertex_normals

FOV = 45.0  # degrees, of the picture's height: the player's
FROM = (0.25, 0.25, 1.0)  # direction in which a view of the whole stands, upright: the player's
MARGIN = 1.05  # of the distance at which everything just fits: the player's
SIDE = 2  # samples along each side of a pixel
BAND = 64  # rows of samples that are in memory together (guess)
SMALLEST = 3  # how often a texture is halved at most: gutters keep charts apart in so many levels
NOTEBOOK = (400, 300)  # pixels of the picture of a mesh (guess)

Vectors = Float64[np.ndarray, "N 3"]
Rgba = Float64[np.ndarray, "H W 4"]  # 0 to 1; red, green and blue are multiplied by alpha
_CLAY, _BEHIND = np.array([220.0, 216.0, 208.0]), np.array([185.0, 189.0, 198.0])  # of the first track, of a background
_HUES = (0x56B4E9, 0x009E73, 0xF0E442, 0x0072B2, 0xD55E00, 0xCC79A7, 0xE69F00)  # of the tracks after it


@dataclass(frozen=True, slots=True)
class Viewpoint:
    """A camera that looks at a target, with what points up in the recording up in the picture."""

    position: tuple[float, ...]  # three, in the unit of the vertices, as the target
    target: tuple[float, ...]
    fov: float = FOV  # degrees, of the picture's height

    def camera(self, up: Up, width: int, height: int) -> Camera:
        """Return the camera of a picture of so many pixels."""
        eye, above = np.array(self.position), np.array(UP_AXES[up])
        forward = _unit(np.array(self.target) - eye)
        right = np.cross(forward, above)
        right = _unit(right) if norm(right) > 1e-9 else np.array([1.0, 0.0, 0.0])  # straight from above or below
        axes = np.stack([right, np.cross(forward, right), forward])
        focal = height / 2 / rounded(math.tan(math.radians(self.fov) / 2))
        pose = CameraPose(matrix_of(axes.T, eye), matrix_of(axes, -(axes * eye).sum(axis=1)))
        return Camera(width, height, (focal, focal), (width / 2, height / 2), pose)

    def turned(self, share: float, up: Up) -> Viewpoint:
        """Return the view with the camera a share of a turn around the target, as the player turns by itself."""
        c, s = (rounded(of(-2 * math.pi * share)) for of in (math.cos, math.sin))
        upright, around = np.array(UPRIGHT[up], np.float64), np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
        turn = products(products(upright.T, around), upright)
        away = products(turn, (np.array(self.position) - self.target)[:, None])[:, 0]
        return replace(self, position=tuple((self.target + away).tolist()))


@dataclass(frozen=True, slots=True)
class Standing:
    """Orientation and extent of a recording: its box, in the unit of its vertices, and its axis that points up."""

    box: tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]  # lower and upper corner
    up: Up = "y"

    @property
    def middle(self) -> Float64[np.ndarray, "3"]:
        return (self.box[0] + self.box[1]) / 2

    @property
    def size(self) -> Float64[np.ndarray, "3"]:
        """Width, height and depth, upright."""
        return np.abs(np.array(UPRIGHT[self.up]) @ (self.box[1] - self.box[0]))

    @property
    def bottom(self) -> float:
        """Coordinate of its lowest side along the axis that points up."""
        return float((np.array(UP_AXES[self.up]) * self.middle).sum()) - float(self.size[1]) / 2

    def fitted(self, width: int, height: int) -> Viewpoint:
        """Return the view of all of it with which the player begins."""
        toward = _unit(np.array(FROM))
        right = _unit(np.cross([0.0, 1.0, 0.0], toward))
        above = np.cross(toward, right)
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        x, y, z = (((signs * self.size / 2) * axis).sum(axis=1) for axis in (right, above, toward))
        high = (math.sqrt(2) - 1) / MARGIN  # of half of FOV
        top, bottom = float((y + high * z).max()), float((y - high * z).min())  # where the view's borders meet the axis
        lift = (top + bottom) / 2 / above[1]
        widest = float((np.abs(x) * height / width / high + z).max())
        distance = max((top - bottom) / (2 * high), widest) - lift * toward[1] or 1.0
        target = self.middle + np.array([0.0, lift, 0.0]) @ np.array(UPRIGHT[self.up])
        eye = target + (distance * toward) @ np.array(UPRIGHT[self.up])
        return Viewpoint(tuple(eye.tolist()), tuple(target.tolist()))

    def framed(self, view: Viewpoint, width: int, height: int) -> Viewpoint:
        """Return a file's view, made for a square picture, in one of so many pixels, by the player's `timesAway`."""
        target = np.array(view.target)
        away = np.array(view.position) - target
        corners = np.array(list(product(*zip(*self.box, strict=True)))) - target
        x, y, z = products(view.camera(self.up, width, height).pose.from_world[:3, :3], corners.T)
        tangent, aspect = rounded(math.tan(math.radians(view.fov) / 2)), width / height

        def least(wide: float) -> float:  # distance at which a picture so much wider than high holds all corners
            return float((np.maximum(np.abs(x) / wide, np.abs(y)) / tangent - z).max())

        square, near = least(1), least(aspect)  # not above 0 where all is behind the target
        is_held = min(square, near) > 0 and norm(away) >= square
        times = 1 / aspect if aspect < 1 else near / square if is_held else 1.0
        return replace(view, position=tuple((target + times * away).tolist()))


@dataclass(frozen=True, slots=True)
class Body:
    """A part of a frame, and the clay of what has no colours."""

    mesh: Mesh
    clay: Float64[np.ndarray, "3"]  # 0 to 255
    splats: Bound | None = None  # drawn in place of the mesh
    patches: Mesh | None = None  # of the mesh, drawn beside splats

    @property
    def surface(self) -> Mesh:
        """Part of the mesh that is drawn."""
        return self.mesh if self.splats is None else self.patches or Mesh.empty()

    @staticmethod
    def of_track(mesh: Mesh, number: int = 0) -> Body:
        """Return a part that moves, whose clay has a hue of its own, but for the first."""
        hue, darker = _HUES[(number - 1) % len(_HUES)], 0.68 ** (number // len(_HUES))
        color = darker * np.array([hue >> 16, hue >> 8 & 255, hue & 255])
        return Body(mesh, _CLAY if number == 0 else _CLAY + 0.3 * (color - _CLAY))

    @staticmethod
    def behind(mesh: Mesh) -> Body:
        """Return a background."""
        return Body(mesh, _BEHIND)


def draw_picture(
    bodies: Sequence[Body], standing: Standing, view: Viewpoint, size: tuple[int, int], ground: bool = False
) -> Rgba:
    """Return the picture of a frame, transparent where nothing is; of equally near parts the first is seen.

    `ground`: with the player's ground below it, on which it casts a shadow.
    """
    camera = view.camera(standing.up, SIDE * size[0], SIDE * size[1])
    below = Ground.under([body.mesh for body in bodies], standing) if ground else None
    looks = [_Look(body, camera, standing) for body in bodies if not body.surface.is_empty]
    splats = [body.splats for body in bodies if body.splats is not None]
    flat = FlatSplats.of(Bound.join(splats), view.camera(standing.up, *size)) if splats else None
    tops = range(0, camera.height, BAND)
    crops = [Crop(top, min(top + BAND, camera.height), 0, camera.width) for top in tops]
    return np.concatenate(mapped(partial(_band, looks, flat, below, camera), crops))


def _band(looks: list[_Look], splats: FlatSplats | None, ground: Ground | None, camera: Camera, crop: Crop) -> Rgba:
    nearest, found = np.full(crop.shape, np.inf), np.zeros((*crop.shape, 4))
    for look in looks:
        seen = draw_places(look.mesh, camera, crop)
        nearer = seen.depth < nearest[seen.covered]
        at = np.flatnonzero(seen.covered)[nearer]
        nearest.reshape(-1)[at] = seen.depth[nearer]
        found.reshape(-1, 4)[at, :3], found.reshape(-1, 4)[at, 3] = look.colors(seen, nearer) / 255, 1
    if ground is not None:
        ground.lay(found, nearest, camera, crop)
    picture = (found[::2, ::2] + found[1::2, ::2] + (found[::2, 1::2] + found[1::2, 1::2])) / 4
    if splats is not None:
        samples = nearest.reshape(len(picture), SIDE, -1, SIDE).swapaxes(1, 2).reshape(-1, SIDE * SIDE)
        splats.lay(picture, crop.top // SIDE, samples)
    return picture


class _Look:
    """A part prepared to be drawn."""

    def __init__(self, body: Body, camera: Camera, standing: Standing) -> None:
        mesh = body.surface
        self._is_lit = mesh.colors is None
        clay = np.broadcast_to(body.clay.round().astype(np.uint8), mesh.vertices.shape)
        self.mesh = replace(mesh, colors=np.ascontiguousarray(clay)) if self._is_lit else mesh
        self._eye, self._standing = camera.pose.to_world[:3, 3], standing
        if self._is_lit:
            self._normals, self._face_normals = vertex_normals(mesh), face_normals(mesh)[0]
        if mesh.uv is not None and mesh.texture is not None:
            self._levels = [mesh.texture.pixels]
            self._level = _level(mesh, camera, self._levels[0].shape[:2])
            while len(self._levels) <= self._level.max():
                self._levels.append(_halved(self._levels[-1]))

    def colors(self, seen: SeenPlaces, chosen: np.ndarray) -> Vectors:
        """Return the colours of the chosen places, 0 to 255."""
        mesh, faces, weights = self.mesh, seen.faces[chosen], seen.barycentric[chosen]
        if mesh.uv is None or mesh.texture is None:
            lit, colors = np.ones(len(faces), bool), colors_on(mesh, None, faces, weights)
        else:
            lit, levels = np.isnan(mesh.uv[:, 0, 0])[faces], self._level[faces]
            colors = np.empty((len(faces), 3))
            for level, pixels in enumerate(self._levels):
                at = levels == level
                colors[at] = colors_on(mesh, pixels, faces[at], weights[at])
        if self._is_lit and lit.any():
            colors[lit] *= self._light(faces[lit], weights[lit])
        return np.minimum(colors, 255)

    def _light(self, faces: Int32[np.ndarray, " N"], weights: Vectors) -> Vectors:
        """Return red, green and blue of the light at places, as `shaded` of the player's shader."""
        corners, up = self.mesh.faces[faces], np.array(UP_AXES[self._standing.up])
        points, normals = blend(self.mesh.vertices, corners, weights), _units(blend(self._normals, corners, weights))
        to_eye, faced = self._eye - points, self._face_normals[faces]
        outside = _dots(faced, to_eye) * _dots(faced, normals) >= 0
        to_eye = _units(to_eye)
        away = np.clip((-_dots(normals, to_eye) - 0.1) / 0.4, 0, 1)
        inside = np.where(outside, 0, away * away * (3 - 2 * away))[:, None]
        height = (_dots(points, up) - self._standing.bottom) / (float(self._standing.size[1]) or 1.0)
        light = self._light_on(normals, to_eye, height)
        return light + inside * (self._light_on(-normals, to_eye, height) - light) if inside.any() else light

    def _light_on(self, normals: Vectors, to_eye: Vectors, height: Float64[np.ndarray, " N"]) -> Vectors:
        """Return the light on surface of these normals, seen from outside."""
        up = np.array(UP_AXES[self._standing.up])
        lamp = _units(to_eye + 0.7 * up + 0.5 * _units(np.cross(up, to_eye) + 1e-6))
        key = np.maximum((_dots(normals, lamp) + 0.3) / 1.3, 0)
        quarter = np.sqrt(np.sqrt(key))
        key = key * quarter * np.sqrt(np.sqrt(quarter))  # to the power of 1.3125, for the shader's 1.3: roots are exact
        sky = 0.5 + 0.5 * _dots(normals, up)
        hidden = (1 - sky) * exp(-7 * np.maximum(height, 0))
        low, high = np.array([0.27, 0.255, 0.245]), np.array([0.43, 0.44, 0.46])
        ambient = (low + (high - low) * sky[:, None]) * (1 - 0.6 * hidden[:, None])
        return ambient + 0.68 * key[:, None] * np.array([1.0, 0.985, 0.96])


def _level(mesh: Mesh, camera: Camera, shape: tuple[int, ...]) -> Int32[np.ndarray, " F"]:
    """Return how often the texture is halved for each face: until a sample has less than four texels."""
    assert mesh.uv is not None
    places = camera.project(camera.local(mesh.vertices))[mesh.faces]  # NaN behind the camera
    ratio = shape[0] * shape[1] * _areas(mesh.uv.astype(np.float64)) / np.maximum(_areas(places), 1e-12)
    return (ratio[:, None] >= 4.0 ** np.arange(1, SMALLEST + 1)).sum(axis=1).astype(np.int32)


def _areas(corners: Float64[np.ndarray, "F 3 2"]) -> Float64[np.ndarray, " F"]:
    (x, y), (z, w) = ((corners[:, k] - corners[:, 0]).T for k in (1, 2))
    return np.abs(x * w - y * z)


def _halved(pixels: UInt8[np.ndarray, "H W 3"]) -> UInt8[np.ndarray, "R C 3"]:
    if min(pixels.shape[:2]) < 4:
        return pixels
    rows, columns = (side // 2 * 2 for side in pixels.shape[:2])
    wide = pixels[:rows, :columns].astype(np.uint16)
    return ((wide[::2, ::2] + wide[1::2, ::2] + wide[::2, 1::2] + wide[1::2, 1::2] + 2) >> 2).astype(np.uint8)


def _dots(a: Vectors, b: np.ndarray) -> Float64[np.ndarray, " N"]:
    return (a * b).sum(axis=1)


def _units(vectors: Vectors) -> Vectors:
    return vectors / np.maximum(np.sqrt(_dots(vectors, vectors)), 1e-12)[:, None]


def _unit(vector: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, "3"]:
    return vector / norm(vector)


def finished(picture: Rgba, background: tuple[int, ...] | None) -> UInt8[np.ndarray, "H W C"]:
    """Return a picture as 8-bit sRGB before a background, or with alpha as fourth channel where there is none."""
    alpha = picture[..., 3:]
    if background is not None:
        return (255 * picture[..., :3] + (1 - alpha) * np.array(background)).round().astype(np.uint8)
    own = picture[..., :3] / np.where(alpha > 0, alpha, 1)
    return (255 * np.concatenate([own, alpha], axis=2)).round().astype(np.uint8)


def picture(mesh: Mesh) -> bytes:
    """Return a small PNG of a mesh with faces for notebooks, whose up axis is y."""
    standing = Standing(mesh.box)
    view = standing.fitted(*NOTEBOOK)
    return _png(finished(draw_picture([Body.of_track(mesh)], standing, view, NOTEBOOK), None))


def _png(pixels: np.ndarray) -> bytes:
    """Return a PNG without Pillow, which the light install lacks."""
    height, width = pixels.shape[:2]
    rows = np.concatenate([np.zeros((height, 1), np.uint8), pixels.reshape(height, -1)], axis=1)  # without filters
    head = struct.pack(">2I5B", width, height, 8, 6, 0, 0, 0)  # 8 bits, red, green, blue and alpha
    parts = [(b"IHDR", head), (b"IDAT", zlib.compress(rows.tobytes())), (b"IEND", b"")]
    chunks = [
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data)) for kind, data in parts
    ]
    return b"\x89PNG\r\n\x1a\n" + b"".join(chunks)
