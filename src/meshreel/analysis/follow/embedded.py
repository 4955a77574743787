"""Embedded deformation: track a key frame's mesh outward through the frames around it (Sumner et al. 2007).

In: the key frame's clean mesh, then neighbour frames of any connectivity. Out: its positions in each frame. A graph of
nodes on the mesh is moved by point-to-plane ICP, few nodes first, as rigidly as possible, starting from the neighbour
frame's result with extrapolated velocity. Coordinates are normalised: the sequence's diagonal is 1. Colours give a
start where shape misleads: if a body moves by its own thickness, the nearest surface is another finger, leg or side.
It replaces the paper's volume tracking (section 3.1) in preset `best` (docs/decisions/0011-correspondence.md).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from threading import Lock

import numpy as np
from jaxtyping import Float64, Int64
from scipy.spatial import cKDTree

from ... import _core
from ...geometry import work
from ...geometry.closest_points import MovingSurface, area_samples
from ...geometry.color_views import Paint
from ...geometry.rigid import quaternions
from ...geometry.strict import products, rotations_of
from ...geometry.threads import mapped_until
from ...geometry.topology import clean, vertex_normals
from ...types import Mesh
from ..fit.frame import ON_BORDER, FrameSurface, shared_distance
from .embedded_graph import (
    Binding,
    DeformationGraph,
    Motion,
    Nodes,
    Pose,
    build_graph,
    farthest_first,
    moved,
    rotation,
    turned,
)
from .rigid import RigidBody, RigidMotion

Painter = Callable[[], Paint | None]  # opens the colour source of a frame, if it has one
Samples = Float64[np.ndarray, "S 3"]

NOISY_LOST = 3.0  # RMS distances of the noise that a residual may have in addition: legs vanish (decision 16)
CLEARLY = 0.8  # share of the best residual that a start by colour must reach: it is rougher than one by shape (guess)
UNUSUAL = 1.25  # a frame is retried if its residual exceeds this many times the median so far, and its neighbour's
AGREEMENT = 0.3  # smallest cosine between the normals of a pair (guess)
TORN = (0.5, 0.15)  # an edge off by this share of its length counts a quarter; try, retry (decision 15)
NOISY_TORN = (0.9,)  # the same under noise, which tears short edges: surface crumples from frame to frame (decision 28)
NOISY_NODES = 500  # of the fine graph under noise, at most: more follow the noise (decision 28)
DOUBT = 0.0005  # diagonals: a frame with a larger, unusual residual is tried again from elsewhere (decision 15)
LOST = 0.004  # diagonals: a frame with a larger residual is lost: no surface fit would recover it (decision 15)
DAMPING = 0.01  # squared row weight of a node's step relative to its data (guess)
ITERATIONS = 60  # largest number of conjugate-gradient iterations per round (guess)
TOLERANCE = 1e-2  # relative residual at which they stop (guess)
LEVEL = 0.001  # diagonals that count as one level of a colour, of 255; .0003 does as well (decision 28)
REACH = 0.3  # diagonals, largest joint distance in place and colour of a pair (guess)
AROUND = 40  # samples next to a node whose median offset it takes (guess)
FEWEST = 200  # smallest number of samples of known colour, on either side, for an estimate (guess)


@dataclass(frozen=True, slots=True)
class Stage:
    """Rounds with one deformation graph; one entry per round in `gates` and `rigidity`."""

    nodes: int
    gates: tuple[float, ...]  # largest distances of pairs, in diagonals
    rigidity: tuple[float, ...]  # squared row weights of an edge relative to the data of a node


@dataclass(frozen=True, slots=True)
class EmbeddedOptions:
    """Options of embedded deformation; lengths in units of the sequence's bounding-box diagonal (decisions 11, 15)."""

    coarse: Stage = Stage(200, (0.1, 0.08, 0.06, 0.06, 0.045, 0.03, 0.024), (10.0, 3.0, 3.0, 1.0, 0.5, 0.2, 0.1))
    fine: Stage = Stage(900, (0.024, 0.018, 0.012, 0.012), (0.3, 0.1, 0.1, 0.05))
    samples: int = 4000  # points of the key mesh, and of a frame, that are matched


class Tracker:
    """Tracker of a key frame's mesh: registers one frame at a time, outward from the key in either direction."""

    def __init__(
        self, key_mesh: Mesh, key: int, options: EmbeddedOptions, noise: float = 0.0, paint: Painter | None = None
    ) -> None:
        """Take the key's mesh, which has faces; `paint` opens its colour source, used only if shape alone misleads."""
        self.options, self.key = options, key
        self._noise, self._doubt, self.lost = noise, math.hypot(DOUBT, noise), math.hypot(LOST, NOISY_LOST * noise)
        self.mesh = clean(key_mesh)
        o = self.options
        self._samples = area_samples(self.mesh, o.samples)
        self._moved = MovingSurface(self.mesh)
        self._tears: tuple[float, ...] = NOISY_TORN if noise else TORN
        count = min(o.fine.nodes, NOISY_NODES) if noise else o.fine.nodes
        nodes = farthest_first(self.mesh, self._samples, count)
        self._graph, coarse = build_graph(self.mesh, nodes), build_graph(self.mesh, nodes[: o.coarse.nodes])
        self._fine, self._few = self._rest(self._graph), self._rest(coarse)
        self._nodes_by_few = coarse.bind(self._graph.nodes, coarse.cells[nodes])
        self._all = self._graph.bind(self.mesh.vertices, self._graph.cells)
        self._poses = {key: Pose.at(self._graph.nodes)}
        self.residuals = {key: 0.0}  # RMS distances of the moved key mesh and registered frames, as by `step`
        self._paint, self._coloring = paint, Lock()
        self._colored: ColoredPlaces | None = None
        self._torn = dict[int, float]()  # of `_tears`, that with which a frame was registered best: it is tried first
        self._body = RigidBody(self.mesh, noise) if noise > 0 else None  # bending costs clean bodies nothing
        self._rigid = {} if self._body is None else {key: RigidMotion(np.eye(3), np.zeros(3))}

    def step(self, frame: int, surface: FrameSurface, paint: Painter | None = None) -> float:
        """Register a frame, starting from the nearest registered frame between it and the key; return its residual.

        A frame may be registered again. `paint` opens the frame's colour source. Frames on both sides of the key may be
        registered side by side once the one beside the key, on the side that begins, is known.
        """
        assert frame != self.key, "the key needs no registration"
        work.count("frames tracked")
        pose, residual = self._follow(frame, surface, paint)
        self._poses[frame], self.residuals[frame] = pose, residual
        if self._body is not None and self._known(frame) in self._rigid:
            motion = self._body.brought(surface, RigidMotion.between(self._graph.nodes, pose.positions))
            if self._body.holds(surface, motion, self._carried(pose), residual):
                self._rigid[frame] = motion
        return residual

    def rigid(self, frames: Iterable[int]) -> list[RigidMotion] | None:
        """Return the rigid motions from the key to registered frames; None if the body's motion is not rigid."""
        motions = [self._rigid.get(frame) for frame in frames]
        return None if None in motions else [motion for motion in motions if motion is not None]

    def bound(self, mesh: Mesh) -> Binding:
        """Bind the vertices of a mesh on or near the key mesh, for `placed`."""
        return self.motion([self.key]).bound(mesh.vertices, vertex_normals(mesh))

    def placed(self, frame: int, points: Float64[np.ndarray, "P 3"], binding: Binding) -> Float64[np.ndarray, "P 3"]:
        """Move bound points to a registered frame."""
        return moved(points, self._graph.nodes, binding, self._poses[frame])

    def motion(self, frames: Sequence[int]) -> Motion:
        """Return the motion through some registered frames, in the given order."""
        poses = [self._poses[frame] for frame in frames]
        if (rigid := self.rigid(frames)) is not None:
            count = len(self._graph.nodes)
            poses = [Pose(np.tile(step.turn, (count, 1, 1)), step.of(self._graph.nodes)) for step in rigid]
        rotations = np.stack([pose.rotations for pose in poses])
        positions = np.stack([pose.positions for pose in poses])
        residuals = np.array([self.residuals[frame] for frame in frames])
        return Motion(self.mesh, self._graph, rotations, positions, residuals)

    def _rest(self, graph: DeformationGraph) -> _Rest:
        points, normals = self.mesh.vertices[self._samples], vertex_normals(self.mesh)[self._samples]
        binding = graph.bind(points, graph.cells[self._samples])
        return _Rest(graph.nodes, graph.edges, points, normals, binding, np.ones(len(graph.edges)))

    def _known(self, frame: int) -> int:
        """Return the registered frame, between a frame and the key, that is nearest to it and not empty."""
        low, high = sorted((frame, self.key))
        return min((f for f in self._followed if low <= f <= high and f != frame), key=lambda f: abs(f - frame))

    @property
    def _followed(self) -> list[int]:
        """Registered frames with a measured pose: the key, and all that are not empty."""
        return [frame for frame, residual in list(self.residuals.items()) if residual < np.inf]

    def _follow(self, frame: int, surface: FrameSurface, paint: Painter | None) -> tuple[Pose, float]:
        """Register a frame from several starts until one is good enough; return the best pose and its residual."""
        o, last = self.options, self._known(frame)
        target = surface.sampled(o.samples)
        known = [at for at in self._followed if (at - self.key) * (frame - self.key) > 0 or at == self.key + 1]
        usual = float(np.median([self.residuals[at] for at in known if self.residuals[at] > 0] or [0.0]))
        usual = max(usual, self.residuals[last])  # includes noise; it grows away from the key
        starts = self._starts(frame, target)
        best = self._poses[last], np.inf
        enough = max(self._doubt, UNUSUAL * usual)
        before = self._torn.get(self.key + 1 if last == self.key else last, self._tears[0])
        tries = [(starts[0], before), *((starts[0], torn) for torn in self._tears if torn != before)]
        tries += [(start, self._tears[0]) for start in starts[1:]]

        def tried(start: Pose, torn: float) -> tuple[Pose, float]:
            return self._from(start, target, torn, surface)

        found = mapped_until(lambda result: result[1] < enough, tried, *zip(*tries, strict=True))
        best = min([best, *found], key=lambda result: result[1])
        self._torn[frame] = next((torn for (_, torn), each in zip(tries, found, strict=False) if each is best), before)
        if found[-1][1] < enough:
            return best
        for start in self._by_color(starts[0], surface, paint):
            result = self._from(start, target, self._tears[0], surface)
            if result[1] < CLEARLY * best[1] or result[1] <= self.lost < best[1]:
                best = result
        stay = self._poses[last], self._measure(self._poses[last], surface)
        return best if best[1] < stay[1] else stay

    def _from(self, start: Pose, target: _core.DeformTarget, torn: float, surface: FrameSurface) -> tuple[Pose, float]:
        """Return the pose registered from a start, and its residual; a coarse graph at rest there moves it first."""
        few, fine = self._few, self._fine
        coarse = Pose(start.rotations[: len(few.nodes)], start.positions[: len(few.nodes)])
        points, normals = moved(fine.points, fine.nodes, fine.binding, start), turned(fine.normals, fine.binding, start)
        held = few.core.holds(coarse.rotations, coarse.positions, torn)
        rest = _Rest(coarse.positions, few.edges, points, normals, few.binding, held)
        carried = self._rounds(rest, Pose.at(coarse.positions), target, self.options.coarse, torn)
        positions = moved(start.positions, coarse.positions, self._nodes_by_few, carried)
        start = Pose(products(rotation(self._nodes_by_few, carried), start.rotations), positions)
        pose = self._rounds(fine, start, target, self.options.fine, torn)
        return pose, self._measure(pose, surface)

    def _starts(self, frame: int, surface: _core.DeformTarget) -> list[Pose]:
        """Return the neighbour's pose and its extrapolation, the better match of the frame first."""
        last = self._known(frame)
        side = 1 if frame > last else -1
        before = [f for f in self._followed if (last - f) * side > 0]
        if not before:
            return [self._poses[last]]
        first = max(before, key=lambda f: f * side)
        before_last, at, ratio = self._poses[first], self._poses[last], (frame - last) / (last - first)
        turn = quaternions(products(at.rotations, before_last.rotations.transpose(0, 2, 1)))
        turns = rotations_of(turn * [1, ratio, ratio, ratio])  # the tangent of half the angle grows; exact for 1
        ahead = Pose(products(turns, at.rotations), at.positions + ratio * (at.positions - before_last.positions))
        gate, poses = self.options.coarse.gates[-1], [ahead, at]
        weights = [self._fine.core.matched(surface, pose.rotations, pose.positions, gate, AGREEMENT) for pose in poses]
        return poses if weights[0] >= weights[1] else poses[::-1]

    def _by_color(self, pose: Pose, surface: FrameSurface, paint: Painter | None) -> Iterator[Pose]:
        """Yield the pose shifted to places of the key's colours in the frame, if both have colours."""
        frame_paint = paint() if paint is not None else None
        if frame_paint is None:
            return
        with self._coloring:  # both sides of the key may ask at a time
            if self._paint is not None and (key_paint := self._paint()) is not None:
                self._colored = ColoredPlaces(self.mesh, self._samples, key_paint)
            self._paint = None
        if self._colored is not None:
            points = moved(self._fine.points, self._fine.nodes, self._fine.binding, pose)
            offsets = self._colored.offsets(pose.positions, points, surface, self.options.samples, frame_paint)
            if offsets is not None:
                yield Pose(pose.rotations, pose.positions + offsets)

    def _rounds(self, rest: _Rest, pose: Pose, surface: _core.DeformTarget, stage: Stage, torn: float) -> Pose:
        gates, rigidity = np.array(stage.gates), np.array(stage.rigidity)
        rounds = (gates, rigidity, torn, DAMPING, AGREEMENT, TOLERANCE, ITERATIONS)
        return Pose(*rest.core.deform(surface, pose.rotations, pose.positions, *rounds))

    def _carried(self, pose: Pose) -> Float64[np.ndarray, "V 3"]:
        """Return the vertices of the key mesh in a pose."""
        return moved(self.mesh.vertices, self._graph.nodes, self._all, pose)

    def _measure(self, pose: Pose, surface: FrameSurface) -> float:
        """Return the RMS distance over samples of both surfaces; the larger of both directions."""
        vertices = self._carried(pose)
        frame_points, key_points = surface.mesh.vertices[surface.samples(self.options.samples)], vertices[self._samples]
        with self._moved.at(vertices) as now:
            back = now.closest(frame_points)
            beside = now.past_border(back) if self._noise > 0 else None
        ahead = surface.surface.closest(key_points)
        squares = surface.gaps(ahead, key_points, surface.samples(self.options.samples), back.points)
        if beside is not None:  # compare only surface that both have
            inside = surface.inside_at(ahead) > ON_BORDER, ~beside
            return shared_distance(squares, inside, self._noise)
        return float(np.sqrt(max(each.mean() for each in squares)))


@dataclass(frozen=True, slots=True)
class _Rest:
    """Deformation graph at rest, with the samples bound to it."""

    nodes: Nodes
    edges: Int64[np.ndarray, "E 2"]
    points: Samples
    normals: Samples
    binding: Binding
    held: Float64[np.ndarray, " E"]  # factor of each edge's squared row weight: 1, or a quarter for one that is torn

    @property
    def core(self) -> _core.Deformation:
        edges, bound = self.edges.astype(np.int32), self.binding.indices.astype(np.int32)
        weights = self.binding.weights
        return _core.Deformation(self.nodes, edges, self.held, self.points, self.normals, bound, weights)


class ColoredPlaces:
    """Samples of a key mesh with their colours."""

    def __init__(self, mesh: Mesh, samples: Int64[np.ndarray, " S"], paint: Paint) -> None:
        """Take the key's mesh, the vertices that are its samples, and the source of its colours."""
        self._colors, self._known = paint.at(mesh.vertices[samples], vertex_normals(mesh)[samples])

    def offsets(self, nodes: Nodes, points: Samples, frame: FrameSurface, count: int, paint: Paint) -> Nodes | None:
        """Return each node's offset to samples of its colour, of about `count` in a frame; None: unknown.

        `points` are the last positions of the key's samples.
        """
        samples = frame.samples(count)
        colors, known = paint.at(frame.mesh.vertices[samples], frame.normals[samples])
        frame_points, key_points = frame.mesh.vertices[samples][known], points[self._known]
        if min(len(frame_points), len(key_points)) < FEWEST:
            return None
        joint = cKDTree(np.concatenate([frame_points, LEVEL * colors[known]], axis=1))
        far, near = joint.query(np.concatenate([key_points, LEVEL * self._colors[self._known]], axis=1))
        paired = far <= REACH
        if paired.sum() < FEWEST:
            return None
        around = cKDTree(key_points[paired]).query(nodes, AROUND)[1]
        return np.median((frame_points[near[paired]] - key_points[paired])[around], axis=1)
