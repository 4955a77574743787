"""Fit splats to pictures of a moving mesh: all frames share the splats, and the mesh moves them.

In: the mesh in some frames, with cameras and their pictures on white (renders of a coloured mesh from around it, or a
body in colour cameras, cropped to the mesh) -> splats, and the importance of each. Adam takes one picture after
another; splats that no camera sees move to where errors are. Needs the extra `splats` (torch).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float32, Float64, Int32

from ...errors import InputError, needed
from ...geometry.atlas import finer_places
from ...geometry.cameras import Camera, CameraPose, looking_at
from ...geometry.color_views import ColorPicture, Painted, sampled
from ...geometry.drawing import SeenPlaces, draw, draw_places
from ...geometry.splats import Carrier, Splats, locate, pose
from ...types import UP_AXES, Mesh, Up
from .splat_raster import LEAST, Drawing, Flat, project

COVER = 0.45  # initial standard deviation of a splat, in the root of its share of the surface (guess)
RATES = {  # learning rates of Adam, in the units of `Splats`; logarithms of scales, and logits of opacities (guess)
    "weights": 5e-3,
    "offsets": 3e-4,
    "turns": 5e-2,
    "scales": 3e-2,
    "opacities": 1e-1,
    "colors": 2e-2,
}
LARGER, LONGER = 1.0, 0.7  # largest differences of log scales: from the initial one, and from their mean (guess)
LAST = 0.1  # share of the learning rates that remains at the end (guess)
FIRST_OPACITY = 0.9  # initial opacity (guess)
STEPS = 900  # steps of Adam, each on one picture (guess)
MOVES = 5  # number of times that unseen splats move to where errors are (guess)
SEED = 0  # of the order of the pictures
DEAD = 0.05  # of the mean contribution of splats to pictures: a splat with less counts as unseen (guess)
GOLDEN = (math.sqrt(5) - 1) / 2  # turns from a frame's cameras to the next frame's, so that no two frames agree
TILTS = (0.1, 0.4)  # rad above the horizon, of alternate cameras (guess)
AWAY = 1.6  # sizes of the mesh between its middle and a camera (guess)
BORDER = 3  # pixels beside the mesh
FINER = 2  # samples a pixel, along both sides
HIDDEN = 0.01  # of the distance: surface that is nearer by more hides the mesh (guess)
Contribution = Float64[np.ndarray, " N"]  # of each splat to the pictures
Points = Float64[np.ndarray, "N 3"]  # or their colours
Colors = Callable[[SeenPlaces, Camera], Points]  # of places that a camera sees


@dataclass(frozen=True, slots=True)
class SplatView:
    """A camera, and its picture of the surface alone, on white."""

    camera: Camera
    pixels: Float32[np.ndarray, "H W 3"]  # sRGB, 0 to 1


@dataclass(frozen=True, slots=True)
class SplatFrame:
    """The mesh of a frame, and pictures of it."""

    carrier: Carrier
    views: tuple[SplatView, ...]


def fit_splats(frames: Sequence[SplatFrame], count: int, steps: int = STEPS) -> tuple[Splats, Contribution]:
    """Return `count` splats fitted to pictures of all frames in `steps` steps, and the contribution of each to these.

    Raises InputError if no camera sees the surface, and without torch.
    """
    pictures = [(frame.carrier, view) for frame in frames for view in frame.views]
    if not any((view.pixels < 1).any() for _, view in pictures):
        raise InputError(f"no splats: none of {len(pictures)} pictures shows the surface; check the cameras")
    with needed("splats are fitted by torch: pip install 'meshreel[splats]'"):
        import torch
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # sums have an order
    try:
        fit = _Fit(torch, frames, count)
        random = np.random.default_rng(SEED)
        every, queue = max(steps * 6 // 10 // (MOVES + 1), 1), list[int]()
        for step in range(steps):
            queue = queue or random.permutation(len(pictures)).tolist()
            fit.step(*pictures[queue.pop()], step / steps)
            if (step + 1) % every == 0 and (step + 1) // every <= MOVES:
                fit.move(random)
        return fit.result()
    finally:
        torch.set_num_threads(threads)


class _Fit:
    """State of a fit: splats as tensors of torch."""

    def __init__(self, torch: Any, frames: Sequence[SplatFrame], count: int) -> None:
        self._torch, carrier = torch, frames[0].carrier
        self._faces, weights, area = _spread(carrier, count)
        count = len(self._faces)
        self._first = float(np.log(COVER * np.sqrt(area / count)))  # initial logarithm of scales
        first = {
            "weights": weights,
            "offsets": np.zeros(count),
            "turns": np.zeros(count),
            "scales": np.full((count, 2), self._first),
            "opacities": np.full(count, np.log(FIRST_OPACITY / (1 - FIRST_OPACITY))),
            "colors": np.full((count, 3), 0.5),
        }
        self._own = {name: torch.tensor(first[name], dtype=torch.float32, requires_grad=True) for name in RATES}
        self._adam = torch.optim.Adam(
            [{"params": [self._own[name]], "lr": rate} for name, rate in RATES.items()], eps=1e-15
        )
        self._composite = _composite_function(torch)
        self.added, self._errors = np.zeros(count), np.zeros(count)
        self._paint(frames)

    def step(self, carrier: Carrier, view: SplatView, done: float) -> None:
        """Improve the splats by one picture; `done` is the share of the steps."""
        torch = self._torch
        drawing, picture = self._drawn(carrier, view.camera)
        target = torch.from_numpy(view.pixels)
        error = torch.where(target.isnan(), 0.0, picture - target)  # NaN: unknown
        self._adam.zero_grad()
        (error.abs().mean() + (error * error).mean()).backward()
        for group, rate in zip(self._adam.param_groups, RATES.values(), strict=True):
            group["lr"] = rate * LAST**done
        self._adam.step()
        with torch.no_grad():
            weights = self._own["weights"].clamp_(min=0)
            weights /= weights.sum(dim=1, keepdim=True).clamp_(min=1)
            scales, offsets = self._own["scales"], self._own["offsets"]
            middle = scales.mean(dim=1, keepdim=True).clamp_(self._first - LARGER, self._first + LARGER)
            scales[:] = middle + (scales - middle).clamp_(-LONGER, LONGER)
            offsets.clamp_(-float(np.exp(self._first)), float(np.exp(self._first)))
        self.added += drawing.shares()
        self._errors += drawing.shares(error.detach().abs().mean(dim=2).numpy().astype(np.float64))

    def move(self, random: np.random.Generator) -> None:
        """Move splats that add nothing to pictures to those with the largest errors, which become smaller."""
        torch, count = self._torch, len(self._faces)
        dead = np.flatnonzero(self.added < DEAD * self.added.mean())
        if len(dead):
            chance = np.where(self.added > 0, self._errors, 0)
            chance[dead] = 0
            parents = random.choice(count, len(dead), p=chance / chance.sum())
            self._faces[dead] = self._faces[parents]
            with torch.no_grad():
                for values in self._own.values():
                    values[dead] = values[parents]
                    for moments in self._adam.state[values].values():
                        if moments.dim():
                            moments[dead] = 0
                halves = np.unique(np.concatenate([dead, parents]))
                self._own["scales"][halves] -= np.log(1.3)
        self.added[:], self._errors[:] = 0, 0

    def result(self) -> tuple[Splats, Contribution]:
        """Return the splats, and the contribution of each to the pictures since the last move."""
        arrays = {name: values.detach().numpy().astype(np.float64) for name, values in self._own.items()}
        scales, turns = np.exp(arrays["scales"]), arrays["turns"]
        is_swapped = scales[:, 0] < scales[:, 1]
        scales[is_swapped] = scales[is_swapped][:, ::-1]
        turns = np.mod(turns + np.where(is_swapped, np.pi / 2, 0), np.pi)
        opacities, colors = 1 / (1 + np.exp(-arrays["opacities"])), np.clip(arrays["colors"], 0, 1)
        splats = Splats(self._faces.copy(), arrays["weights"], arrays["offsets"], turns, scales, opacities, colors)
        visible = (opacities >= LEAST) & (self.added > 0)
        return splats.take(visible), self.added[visible]

    def _drawn(self, carrier: Carrier, camera: Camera) -> tuple[Drawing, Any]:
        torch, own = self._torch, self._own
        weights = own["weights"]
        finer, now, along = locate(self._faces, weights.detach().numpy().astype(np.float64), carrier.levels)
        moved = (weights - weights.detach())[:, :, None] * _tensor(torch, along)
        corners = _tensor(torch, carrier.vertices[carrier.faces[finer]])
        lengths = own["offsets"], own["turns"], own["scales"].exp(), 1.0
        places = _tensor(torch, now) + moved.sum(dim=1)
        means, axes, scales = pose(torch, corners, places, _tensor(torch, along), lengths)
        matrices = _tensor(torch, camera.extrinsic[:3]), _tensor(torch, camera.intrinsic)
        flat = project(torch, means, axes, scales, matrices)
        opacities = torch.sigmoid(own["opacities"])
        if carrier.lacking is not None:
            opacities = opacities * torch.from_numpy(~carrier.lacking[finer])
        size, drawn = (camera.height, camera.width), list[Drawing]()
        picture = self._composite.apply(
            flat.centers, flat.conics, flat.spreads, flat.depths, opacities, own["colors"], size, drawn
        )
        return drawn[0], picture

    def _paint(self, frames: Sequence[SplatFrame]) -> None:
        """Give each splat the mean colour of the pixels that it covers in pictures of some frames."""
        sums, total = np.zeros((len(self._faces), 3)), np.full(len(self._faces), 1e-9)
        for frame in frames[:: max(len(frames) // 2, 1)]:
            for view in frame.views:
                drawing, _ = self._drawn(frame.carrier, view.camera)
                known = np.isfinite(view.pixels[..., 0])
                pixels = np.where(known[..., None], view.pixels, 0).astype(np.float64)
                sums += np.stack([drawing.shares(pixels[..., k]) for k in range(3)], axis=1)
                total += drawing.shares(known.astype(np.float64))
        with self._torch.no_grad():
            self._own["colors"][:] = _tensor(self._torch, sums / total[:, None])


def _composite_function(torch: Any) -> Any:
    """Return `Drawing` as a function that torch differentiates."""

    class Composite(torch.autograd.Function):
        @staticmethod
        def forward(context: Any, *values: Any) -> Any:
            *tensors, size, drawn = values
            arrays = [value.detach().numpy().astype(np.float64) for value in tensors]
            context.drawing = Drawing(Flat(*arrays[:4]), arrays[4], arrays[5], size)
            drawn.append(context.drawing)
            return _tensor(torch, context.drawing.picture)

        @staticmethod
        def backward(context: Any, *gradient: Any) -> Any:
            centers, conics, opacities, colors = context.drawing.gradients(gradient[0].numpy().astype(np.float64))
            gradients = [_tensor(torch, values) for values in (centers, conics, opacities, colors)]
            return gradients[0], gradients[1], None, None, gradients[2], gradients[3], None, None

    return Composite


def _spread(carrier: Carrier, count: int) -> tuple[Int32[np.ndarray, " N"], Float64[np.ndarray, "N 2"], float]:
    """Return base faces and places on them, evenly spread over the surface, and its area."""
    a, b, c = np.moveaxis(carrier.vertices[carrier.faces], 1, 0)
    ends = np.cumsum(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    finer = np.searchsorted(ends, (np.arange(count) + 0.5) / count * ends[-1])
    cut = finer_places(np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]]), carrier.levels)
    random = np.random.default_rng(count)  # places inside the finest faces
    inside = random.dirichlet(np.ones(3), count)
    weights = np.einsum("nk,nkd->nd", inside, cut[finer % len(cut)])
    return (finer // len(cut)).astype(np.int32), weights, float(ends[-1])


def _tensor(torch: Any, values: np.ndarray) -> Any:
    return torch.from_numpy(np.ascontiguousarray(values, dtype=np.float32))


def ring(mesh: Mesh, count: int, size: int, turn: float, up: Up = "y") -> list[Camera]:
    """Return cameras around a mesh, which fills pictures of `size` pixels; `turn`: the first one's angle, turns."""
    extent, cameras = mesh.diagonal, list[Camera]()
    above = np.array(UP_AXES[up])
    axis = int(np.abs(above).argmax())
    along, aside = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    for number in range(count):
        angle, tilt = 2 * math.pi * (number / count + turn), TILTS[number % len(TILTS)]
        way = math.cos(tilt) * (math.cos(angle) * along + math.sin(angle) * aside) + math.sin(tilt) * above
        pose = CameraPose.of_camera(looking_at(mesh.middle + AWAY * extent * way, mesh.middle, axis))
        camera = Camera(size, size, (float(size), float(size)), (0.0, 0.0), pose)
        cameras += [cut] if (cut := cut_to(camera, mesh, size)) else []
    return cameras


def cut_to(camera: Camera, mesh: Mesh, size: int, most: float = math.inf) -> Camera | None:
    """Crop a camera's picture to the mesh, and scale its longer side to `size` pixels; None: out of sight.

    Its pixels become at most `most` times as fine.
    """
    if mesh.is_empty:
        return None
    local = mesh.vertices @ camera.extrinsic[:3, :3].T + camera.extrinsic[:3, 3]
    if local[:, 2].min() <= 0:
        return None
    places = camera.project(local)
    low, high = places.min(axis=0), places.max(axis=0)
    if most < math.inf:  # a real picture ends at its border
        low, high = np.maximum(low, 0), np.minimum(high, [camera.width, camera.height])
    extent = float((high - low).max())
    if (high - low).min() < 1:
        return None
    scale = min((size - 2 * BORDER) / extent, most)
    width, height = (max(math.ceil(scale * side) + 2 * BORDER, 8) for side in (high - low))
    moved = np.array([[scale, 0, BORDER - scale * low[0]], [0, scale, BORDER - scale * low[1]], [0, 0, 1]])
    return Camera.of(width, height, moved @ camera.intrinsic, camera.extrinsic)


def rendered(mesh: Mesh, cameras: Sequence[Camera]) -> tuple[SplatView, ...]:
    """Return unlit pictures of a coloured mesh."""
    painted = Painted(mesh)
    return tuple(_view(mesh, camera, lambda seen, _: painted.on(seen.faces, seen.barycentric)) for camera in cameras)


def taken(pictures: Sequence[ColorPicture], body: Mesh, whole: Mesh, size: int) -> tuple[SplatView, ...]:
    """Return a body in colour cameras' pictures, on white; NaN where it is hidden, and beyond the picture.

    `whole` is all surface of the frame.
    """
    cut = ((picture, cut_to(picture.camera.straight, body, size, most=1.0)) for picture in pictures)
    return tuple(_view(body, camera, partial(_pictured, picture, whole)) for picture, camera in cut if camera)


def _pictured(picture: ColorPicture, whole: Mesh, seen: SeenPlaces, camera: Camera) -> Points:
    nearest = draw(whole, camera).depth[seen.covered]
    positions, _ = picture.project(seen.points)
    height, width = picture.pixels.shape[:2]
    with np.errstate(invalid="ignore"):
        inside = (positions >= 0).all(axis=1) & (positions <= [width, height]).all(axis=1)
    known = inside & (nearest > (1 - HIDDEN) * seen.depth)
    colors = np.full((len(positions), 3), np.nan)
    colors[known] = sampled(picture.pixels, positions[known]) / picture.gains
    return colors


def _view(mesh: Mesh, camera: Camera, colors: Colors) -> SplatView:
    """Draw a view with `FINER` x `FINER` samples per pixel, whose colours are averaged."""
    fine = camera.resized(FINER * camera.width, FINER * camera.height)
    seen = draw_places(mesh, fine)
    picture = np.full((fine.height, fine.width, 3), 255.0)
    picture[seen.covered] = colors(seen, fine)
    parts = picture.reshape(camera.height, FINER, camera.width, FINER, 3)
    return SplatView(camera, (parts.mean(axis=(1, 3)) / 255).astype(np.float32))
