"""Embedded deformation: a key frame's mesh followed through the frames around it, outward, frame by frame.

In: the key frame's clean mesh, then any neighbour frame of any connectivity. Out: where its points are in each frame.
A graph of nodes on the mesh is moved by point-to-plane ICP, few nodes first, as rigid as can be, from the neighbour
frame's result with extrapolated velocity. Coordinates are normalised: the sequence's diagonal is 1.
In place of the paper's volume tracking (section 3.1) where docs/decisions/0011-correspondence.md says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64
from scipy.spatial import cKDTree
from scipy.spatial.transform import Rotation

from ...errors import InputError
from ...geometry.closest_points import Surface
from ...geometry.topology import clean, vertex_normals
from ...types import Mesh
from ..fit.conjugate_gradients import Limits
from ..fit.match import Target
from .embedded_graph import DeformationGraph, area_samples, build_graph, farthest_first
from .embedded_match import NORMAL_REACH, SampledTarget
from .embedded_solve import GraphSolver, Planes, Pose, Rest, moved, rotation, turned, unmoved

BACK_ROUNDS = 2  # which nodes move a point is known only where it comes from: the first round guesses
UNUSUAL = 1.25  # times the median residual so far: tried again


@dataclass(frozen=True, slots=True)
class Stage:
    """Rounds of one graph; one entry per round in `gates` and `rigidity`."""

    nodes: int
    gates: tuple[float, ...]  # pairs farther apart do not count; of the diagonal
    rigidity: tuple[float, ...]  # squared row weight of an edge against the data of a node

    def __post_init__(self) -> None:
        if self.nodes < 1:
            raise InputError(f"nodes is {self.nodes}; give at least 1")
        if len(self.gates) != len(self.rigidity) or not self.gates or min(self.gates + self.rigidity) <= 0:
            raise InputError(f"gates {self.gates}, rigidity {self.rigidity}: give each round a positive value of both")


@dataclass(frozen=True, slots=True)
class EmbeddedOptions:
    """How the key mesh follows a frame; lengths in units of the sequence's bounding-box diagonal."""

    coarse: Stage = Stage(200, (0.1, 0.08, 0.06, 0.06, 0.045, 0.03, 0.024), (10.0, 3.0, 3.0, 1.0, 0.5, 0.2, 0.1))
    fine: Stage = Stage(900, (0.024, 0.018, 0.012, 0.012), (0.3, 0.1, 0.1, 0.05))
    samples: int = 4000  # points of the key mesh, and of a frame, that are matched
    neighbours: int = 4  # nodes that move a point
    agreement: float = 0.3  # least cosine between the normals of a pair
    torn: tuple[float, float] = (0.5, 0.15)  # share of its length by which an edge misses that then counts a quarter
    doubt: float = 0.0005  # a residual above it, if unusual, is tried again: from another start, with edges that tear
    rekeyed: float = 0.0015  # a residual above it makes another frame be tried as the key
    lost: float = 0.004  # a residual above it leaves the frame where no surface fit finds back
    settled: float = 0.0005  # a median residual below it counts as this much: about what noise leaves
    uneven: float = 1.8  # times the median residual above which something has appeared that the key has not
    damping: float = 0.01  # squared row weight of a node's step against its data
    iterations: int = 60  # of the conjugate gradients, at most, a round
    tolerance: float = 1e-2  # their relative residual

    def __post_init__(self) -> None:
        if self.coarse.nodes > self.fine.nodes:
            raise InputError(
                f"{self.coarse.nodes} coarse nodes and {self.fine.nodes} fine ones: give fewer coarse ones"
            )
        if self.samples < 3 or self.neighbours < 1 or self.iterations < 1:
            raise InputError(
                f"samples {self.samples}, neighbours {self.neighbours}, iterations {self.iterations}: give >= 3, 1, 1"
            )
        if not -1 <= self.agreement < 1:
            raise InputError(f"agreement {self.agreement} is a cosine: give at least -1 and less than 1")
        if not (self.damping > 0 and 0 <= self.tolerance < 1):
            raise InputError(f"damping {self.damping}, tolerance {self.tolerance}: give > 0, and 0 to 1")
        if not (min(self.torn) > 0 and min(self.doubt, self.rekeyed, self.lost, self.settled, self.uneven) >= 0):
            raise InputError(
                f"torn {self.torn}, doubt {self.doubt}, rekeyed {self.rekeyed}, lost {self.lost}, "
                f"settled {self.settled}, uneven {self.uneven}: give > 0, and >= 0 for the others"
            )


class Tracker:
    """Follows a key frame's mesh outward, one frame at a time, in either direction."""

    def __init__(self, key_mesh: Mesh, key: int, options: EmbeddedOptions | None = None) -> None:
        self.options, self.key = options or EmbeddedOptions(), key
        self.mesh = clean(key_mesh)
        if self.mesh.is_empty:
            raise InputError(f"the key frame {key} is empty; choose one that has a surface")
        if not np.isfinite(self.mesh.vertices).all():
            raise InputError(f"the key frame {key} has coordinates that are not finite; repair it first")
        o = self.options
        self._samples = area_samples(self.mesh, o.samples)
        nodes = farthest_first(self.mesh, self._samples, o.fine.nodes)
        self._graph, coarse = build_graph(self.mesh, nodes), build_graph(self.mesh, nodes[: o.coarse.nodes])
        self._fine, self._few = GraphSolver(self._rest(self._graph)), self._rest(coarse)
        self._nodes_by_few = coarse.bind(self._graph.nodes, coarse.cells[nodes], o.neighbours)
        self._all = self._graph.bind(self.mesh.vertices, self._graph.cells, o.neighbours)
        self._poses = {key: Pose.at(self._graph.nodes)}
        self._residuals = {key: 0.0}

    def step(self, frame: int, mesh: Mesh | Target) -> float:
        """Registers a frame, from the nearest one between it and the key that is known; its residual.

        Infinite for an empty frame, which gets its neighbour's pose. A frame may be registered again.
        """
        if frame == self.key:
            raise InputError(f"frame {frame} is the key: it needs no registration; step to another")
        target = mesh if isinstance(mesh, Target) else None if mesh.is_empty else Target(mesh)
        if target is not None and not np.isfinite(target.mesh.vertices).all():
            raise InputError(f"frame {frame} has coordinates that are not finite; repair it first")
        pose, residual = self._poses[self._known(frame)], np.inf
        if target is not None:
            pose, residual = self._follow(frame, target)
        self._poses[frame], self._residuals[frame] = pose, residual
        return residual

    def residual(self, frame: int) -> float:
        """Symmetric RMS distance of the moved key mesh and a registered frame: the worse of both directions."""
        return self._residuals[frame]

    def motion(self, frames: Sequence[int]) -> Motion:
        """The motion through some registered frames, in the order asked for."""
        rotations = np.stack([self._poses[frame].rotations for frame in frames])
        positions = np.stack([self._poses[frame].positions for frame in frames])
        residuals = np.array([self._residuals[frame] for frame in frames])
        return Motion(self.mesh, self._graph, rotations, positions, residuals, self.options.neighbours)

    def _rest(self, graph: DeformationGraph) -> Rest:
        points, normals = self.mesh.vertices[self._samples], vertex_normals(self.mesh)[self._samples]
        binding = graph.bind(points, graph.cells[self._samples], self.options.neighbours)
        return Rest(graph.nodes, graph.edges, points, normals, binding)

    def _known(self, frame: int) -> int:
        """The registered frame from which this one is begun: the nearest between it and the key."""
        low, high = sorted((frame, self.key))
        return min((f for f in self._followed() if low <= f <= high and f != frame), key=lambda f: abs(f - frame))

    def _followed(self) -> list[int]:
        """The frames that have a pose of their own: the key, and all that were not empty."""
        return [frame for frame, residual in self._residuals.items() if residual < np.inf]

    def _follow(self, frame: int, target: Target) -> tuple[Pose, float]:
        """The best of some ways to go on, by residual: where the first is good enough, no other is tried."""
        o, last = self.options, self._known(frame)
        there = SampledTarget(target, o.samples, o.agreement)
        usual = np.median([r for r in self._residuals.values() if 0 < r < np.inf] or [0.0])  # noise is not failure
        starts = self._starts(frame, there)
        best = self._poses[last], np.inf
        tries = [(starts[0], o.torn[0]), (starts[0], o.torn[1]), *((start, o.torn[0]) for start in starts[1:])]
        for start, torn in tries:
            pose = self._rounds(self._fine, self._carried(start, there, torn), there, o.fine, torn)
            residual = self._measure(pose, target)
            if residual < best[1]:
                best = pose, residual
            if residual < max(o.doubt, UNUSUAL * float(usual)):
                return best
        stay = self._poses[last], self._measure(self._poses[last], target)
        return best if best[1] < stay[1] else stay

    def _starts(self, frame: int, target: SampledTarget) -> list[Pose]:
        """The neighbour's pose, and that moved on as it moved before; the one that is nearer to the frame first."""
        last = self._known(frame)
        side = 1 if frame > last else -1
        before = [f for f in self._followed() if (last - f) * side > 0]
        if not before:
            return [self._poses[last]]
        first = max(before, key=lambda f: f * side)
        ahead = _extrapolated(self._poses[first], self._poses[last], (frame - last) / (last - first))
        gate = self.options.coarse.gates[-1]
        poses = [ahead, self._poses[last]]
        return sorted(poses, key=lambda pose: -_planes(self._fine.rest, pose, target, gate).weights.sum())

    def _carried(self, pose: Pose, target: SampledTarget, torn: float) -> Pose:
        """The pose carried by a few nodes whose rest is that pose: what is known of the detail stays."""
        few, fine = self._few, self._fine.rest
        here = Pose(pose.rotations[: len(few.nodes)], pose.positions[: len(few.nodes)])
        points, normals = moved(fine.points, fine.nodes, fine.binding, pose), turned(fine.normals, fine.binding, pose)
        rest = Rest(here.positions, few.edges, points, normals, few.binding)
        solver = GraphSolver(rest, GraphSolver(few).holds(here, torn))
        carried = self._rounds(solver, Pose.at(here.positions), target, self.options.coarse, torn)
        positions = moved(pose.positions, here.positions, self._nodes_by_few, carried)
        return Pose(rotation(self._nodes_by_few, carried) @ pose.rotations, positions)

    def _rounds(self, solver: GraphSolver, pose: Pose, target: SampledTarget, stage: Stage, torn: float) -> Pose:
        o = self.options
        for gate, rigidity in zip(stage.gates, stage.rigidity, strict=True):
            planes = _planes(solver.rest, pose, target, gate)
            stiffness = rigidity * solver.holds(pose, torn)
            following = solver.step(pose, planes, stiffness, o.damping, Limits(o.iterations, o.tolerance))
            if not following.is_finite:
                break
            pose = following
        return pose

    def _measure(self, pose: Pose, target: Target) -> float:
        """Root mean square distance over samples of both surfaces; the larger of both directions."""
        mesh = Mesh(moved(self.mesh.vertices, self._graph.nodes, self._all, pose), self.mesh.faces)
        theirs = target.mesh.vertices[area_samples(target.mesh, self.options.samples)]
        gaps = (_gaps(target.surface, mesh.vertices[self._samples]), _gaps(Surface(mesh), theirs))
        return float(np.sqrt(max(np.mean(gap) for gap in gaps)))


@dataclass(frozen=True, slots=True)
class Motion:
    """Where points of the key mesh are in T frames."""

    mesh: Mesh  # the key frame's
    graph: DeformationGraph
    rotations: Float64[np.ndarray, "T N 3 3"]
    positions: Float64[np.ndarray, "T N 3"]
    residuals: Float64[np.ndarray, " T"]  # symmetric RMS; 0 at the key, infinite at an empty frame
    neighbours: int = 4

    def move(
        self, points: Float64[np.ndarray, "P 3"], normals: Float64[np.ndarray, "P 3"] | None = None
    ) -> Float64[np.ndarray, "T P 3"]:
        """Points on or near the key mesh, in each frame; their normals keep them off a near sheet that faces away."""
        own = np.concatenate([self.mesh.vertices, NORMAL_REACH * vertex_normals(self.mesh)], axis=1)
        asked = points if normals is None else np.concatenate([points, NORMAL_REACH * normals], axis=1)
        vertices = cKDTree(own[:, : asked.shape[1]]).query(asked)[1].reshape(-1)
        binding = self.graph.bind(points, self.graph.cells[vertices], self.neighbours)
        poses = (Pose(r, p) for r, p in zip(self.rotations, self.positions, strict=True))
        return np.stack([moved(points, self.graph.nodes, binding, pose) for pose in poses])

    def back(self, frame: int, mesh: Mesh) -> Mesh:
        """A mesh that lies on or near a frame, moved to where it would be in the key frame: the inverse of `move`.

        Faces in which a point has no way back are left out.
        """
        pose = Pose(self.rotations[frame], self.positions[frame])
        own = self.graph.bind(self.mesh.vertices, self.graph.cells, self.neighbours)
        there = moved(self.mesh.vertices, self.graph.nodes, own, pose)
        facing = turned(vertex_normals(self.mesh), own, pose)
        asked = np.concatenate([mesh.vertices, NORMAL_REACH * vertex_normals(mesh)], axis=1)
        near = cKDTree(np.concatenate([there, NORMAL_REACH * facing], axis=1)).query(asked)[1].reshape(-1)
        points, cells = self.mesh.vertices[near], self.graph.cells[near]
        for _ in range(BACK_ROUNDS):
            points, known = unmoved(
                mesh.vertices, self.graph.nodes, self.graph.bind(points, cells, self.neighbours), pose
            )
        return clean(Mesh(points, mesh.faces[known[mesh.faces].all(axis=1)]))


def register(key_mesh: Mesh, frames: Sequence[Mesh], key: int, options: EmbeddedOptions | None = None) -> Motion:
    """The motion of the key frame's mesh through all frames, outward from the key."""
    if not 0 <= key < len(frames):
        raise InputError(f"key {key} is not one of {len(frames)} frames: give 0 to {len(frames) - 1}")
    tracker = Tracker(key_mesh, key, options)
    for frame in [*range(key + 1, len(frames)), *range(key - 1, -1, -1)]:
        tracker.step(frame, frames[frame])
    return tracker.motion(range(len(frames)))


def _planes(rest: Rest, pose: Pose, target: SampledTarget, gate: float) -> Planes:
    points, normals = moved(rest.points, rest.nodes, rest.binding, pose), turned(rest.normals, rest.binding, pose)
    return target.planes(points, normals, gate)


def _extrapolated(first: Pose, last: Pose, ratio: float) -> Pose:
    """The pose that goes on from `last` by `ratio` times the step from `first`."""
    turn = Rotation.from_matrix(last.rotations @ first.rotations.transpose(0, 2, 1)).as_rotvec()
    rotations = Rotation.from_rotvec(ratio * turn).as_matrix() @ last.rotations
    return Pose(rotations, last.positions + ratio * (last.positions - first.positions))


def _gaps(surface: Surface, points: Float64[np.ndarray, "N 3"]) -> Float64[np.ndarray, " N"]:
    """Squared distances."""
    offsets = surface.closest(points).points - points
    return np.einsum("nd,nd->n", offsets, offsets)
