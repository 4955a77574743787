"""Bones of a person: which of them carry each vertex of the still pose, and where a stance puts them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from ...geometry.strict import norm, products
from ...geometry.topology import unique_edges, vertex_normals
from ...types import Mesh
from .figure import bent, turn_about_y
from .person import (
    AHEAD,
    ANKLE,
    ARM,
    COLLAR,
    ELBOW,
    FOREARM,
    HIP,
    KNEE,
    REST,
    SHOULDER,
    UP,
    UPPER_ARM,
    WRIST,
    Build,
    finger_joints,
    folds,
)
from .sculpture import Vector

Turn = Float64[np.ndarray, "3 3"]
Shares = Float64[np.ndarray, "V B"]
Moves = Float64[np.ndarray, "B 3 4"]  # turn, and shift in m

PELVIS, CHEST, NECK, SKULL = range(4)
UPPER, FORE, HAND, THIGH, SHIN, FOOT, DIGITS = range(7)  # of a side; two for each of five digits
FIRST, OF_SIDE = 4, 16  # bones before those of the left side, and of a side
WAIST, NAPE, NOD = np.array([0.0, 1.05, -0.008]), np.array([0.0, 1.44, -0.026]), np.array([0.0, 1.545, -0.016])
LEFT = np.array([1.0, 0.0, 0.0])
NECK_RADIUS = 0.064  # m; what is farther out and above the collar is the head (guess)
SMOOTHED = 6  # rounds in which weights of neighbours are averaged (guess)


@dataclass(frozen=True, slots=True)
class Limb:
    """Place and hold of a hand or a foot, in the person's frame, of an adult's size."""

    place: Vector  # m, of the wrist or the ankle
    pole: Vector  # way to which elbow or knee points
    bend: float  # rad, of each joint of the fingers; of a foot, how far the heel is up
    turn: float = 0.0  # rad, of the foot outward, or of the hand about the forearm


@dataclass(frozen=True, slots=True)
class Stance:
    """Place and pose of a person at a moment."""

    place: Vector  # m, on the floor below the hips
    heading: float  # rad about y; 0 faces +z
    lift: float  # m, of the hips
    hands: tuple[Limb, Limb]  # left and right
    feet: tuple[Limb, Limb]
    tilt: float = 0.0  # rad, of the hips: the left one up
    twist: float = 0.0  # rad, of the chest to the left
    lean: float = 0.0  # rad, of the chest forward
    head: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rad: to the left, down, towards the left shoulder


@dataclass(frozen=True, slots=True)
class Bones:
    """Bones of the still pose."""

    ends: Float64[np.ndarray, "B 2 3"]  # m
    radii: Float64[np.ndarray, " B"]  # m, of what is around them
    seams: Float64[np.ndarray, " B"]  # m, widths of the transition to a neighbour
    parents: tuple[int, ...]


def bones() -> Bones:
    """Return the bones: trunk, then those of the left side, then those of the right."""
    ends = [((0.0, 0.93, -0.01), (0.0, 1.0, -0.01)), (WAIST, (0.0, 1.36, -0.005)), (NAPE, NOD), (NOD, (0.0, 1.66, 0.0))]
    radii, seams, parents = [0.13, 0.13, 0.05, 0.09], [0.03, 0.04, 0.02, 0.02], [-1, PELVIS, CHEST, NECK]
    heel, toe = ANKLE - [0.0, 0.04, 0.02], ANKLE + [0.004, -0.045, 0.15]
    own = [(SHOULDER, ELBOW), (ELBOW, WRIST), (WRIST, WRIST + 0.085 * ARM), (HIP, KNEE), (KNEE, ANKLE), (heel, toe)]
    own += [(joints[k], joints[k + 1]) for joints in finger_joints() for k in (-3, -2)]
    for side in (1.0, -1.0):
        first = len(ends)
        radii += [0.048, 0.036, 0.026, 0.075, 0.05, 0.04, *(0.009, 0.008) * 5]
        seams += [0.035, 0.022, 0.012, 0.035, 0.03, 0.006, *(0.005, 0.004) * 5]
        parents += [CHEST, first + UPPER, first + FORE, PELVIS, first + THIGH, first + SHIN]
        for digit in range(5):
            parents += [first + HAND, first + DIGITS + 2 * digit]
        ends += [(np.array([side, 1.0, 1.0]) * a, np.array([side, 1.0, 1.0]) * b) for a, b in own]
    return Bones(np.array(ends, float), np.array(radii), np.array(seams), tuple(parents))


def weights(mesh: Mesh) -> Shares:
    """Return the share of each bone in the motion of each vertex of the still pose."""
    there, points = bones(), mesh.vertices
    gaps = np.empty((len(points), len(there.radii)))
    for bone, ((a, b), radius) in enumerate(zip(there.ends, there.radii, strict=True)):
        along = np.clip(np.einsum("nd,d->n", points - a, (b - a) / norm(b - a) ** 2), 0, 1)
        gaps[:, bone] = np.sqrt(((points - a - along[:, None] * (b - a)) ** 2).sum(axis=1)) - radius
    near = np.eye(len(there.radii), dtype=bool)  # a bone, its parent and its children
    for bone, parent in enumerate(there.parents[1:], 1):
        near[bone, parent] = near[parent, bone] = True
    best = gaps.argmin(axis=1)
    seams = np.minimum(there.seams, there.seams[best][:, None])
    shares = np.exp(-np.minimum((gaps - gaps.min(axis=1)[:, None]) / seams, 50.0)) * near[best]
    above = points[:, 1] > COLLAR
    hair = above & (np.hypot(points[:, 0], points[:, 2] + 0.02) > NECK_RADIUS)
    nods = np.where(hair, 1.0, np.clip((points[:, 1] - 1.50) / 0.06, 0, 1))  # from the neck to the head
    shares[above] = 0.0
    shares[above, NECK], shares[above, SKULL] = 1 - nods[above], nods[above]
    return _smoothed(shares / shares.sum(axis=1)[:, None], mesh)


def _smoothed(shares: Shares, mesh: Mesh) -> Shares:
    """Average weights with those of neighbours, so that joints bend softly."""
    (a, b), count = unique_edges(mesh.faces)[0].T, len(mesh.vertices)
    degree = np.bincount(np.concatenate([a, b]), minlength=count)[:, None] + 1.0
    for _ in range(SMOOTHED):
        around = [np.bincount(a, column[b], count) + np.bincount(b, column[a], count) for column in shares.T]
        shares = (shares + np.stack(around, axis=1)) / degree
    return shares


def carried(mesh: Mesh, shares: Shares, build: Build, stance: Stance) -> Mesh:
    """Return the mesh of the still pose in a stance, with the folds of the stance, m."""
    moves = placed(stance)
    folded = folds(mesh.vertices, bends(moves), build.trouser) - folds(mesh.vertices, REST, build.trouser)
    still = mesh.vertices + folded[:, None] * vertex_normals(mesh)
    blended = products(shares, moves.reshape(len(moves), 12)).reshape(-1, 3, 4)
    own = np.einsum("nij,nj->ni", blended[:, :, :3], still) + blended[:, :, 3]
    return mesh.at(build.size * products(own, turn_about_y(stance.heading).T) + stance.place)


def bends(moves: Moves) -> tuple[float, ...]:
    """Return how far elbows and knees (left, right) and the waist are bent, 0 to 1."""
    joints = [FIRST + side * OF_SIDE + bone for bone in (UPPER, THIGH) for side in (0, 1)]
    pairs = [*((bone, bone + 1) for bone in joints), (PELVIS, CHEST)]
    cosines = [(float((moves[a, :, :3] * moves[b, :, :3]).sum()) - 1) / 2 for a, b in pairs]
    return tuple(min((1 - cosine) / 1.2, 1.0) for cosine in cosines)


def placed(stance: Stance) -> Moves:
    """Return the motion of each bone from the still pose into the person's frame."""
    joints = bones().ends[:, 0]
    moves = np.zeros((len(joints), 3, 4))
    _put(moves, PELVIS, about(AHEAD, stance.tilt), joints[PELVIS], joints[PELVIS] + stance.lift * UP)
    chest = products(about(UP, stance.twist), products(about(LEFT, stance.lean), about(AHEAD, -0.6 * stance.tilt)))
    _put(moves, CHEST, chest, WAIST, _moved(moves, PELVIS, WAIST))
    left, down, aside = stance.head
    for bone, share in ((NECK, 0.4), (SKULL, 1.0)):
        nod = products(about(LEFT, share * down), about(AHEAD, -share * aside))
        _put(moves, bone, products(about(UP, share * left), nod), joints[bone], _moved(moves, bone - 1, joints[bone]))
    for number, side in enumerate((1.0, -1.0)):
        _put_arm(moves, joints, FIRST + number * OF_SIDE, side, stance.hands[number])
        _put_leg(moves, joints, FIRST + number * OF_SIDE, side, stance.feet[number])
    return moves


def about(axis: Vector, angle: float) -> Turn:
    """Return the rotation about an axis."""
    x, y, z = axis / norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * products(cross, cross)


def _put(moves: Moves, bone: int, turn: Turn, joint: Vector, place: Vector) -> None:
    """Turn a bone about its joint, which is moved to a place."""
    moves[bone, :, :3], moves[bone, :, 3] = turn, place - products(turn, joint[:, None])[:, 0]


def _moved(moves: Moves, bone: int, point: Vector) -> Vector:
    return products(moves[bone, :, :3], point[:, None])[:, 0] + moves[bone, :, 3]


def _frame(way: Vector, pole: Vector) -> Turn:
    """Return the axes along a limb, to the side that its joint points to, and across."""
    first = way / norm(way)
    second = pole - first * float((pole * first).sum())
    second /= norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def _put_arm(moves: Moves, joints: Float64[np.ndarray, "B 3"], first: int, side: float, limb: Limb) -> None:
    """Place the bones of an arm, a hand and its fingers."""
    root = _moved(moves, CHEST, joints[first + UPPER])
    elbow, wrist = bent(root, limb.place, (UPPER_ARM, FOREARM), limb.pole)
    back = _frame(joints[first + FORE] - joints[first + UPPER], -AHEAD).T
    out = elbow - (root + wrist) / 2
    upper, fore = (products(_frame(way, out), back) for way in (elbow - root, wrist - elbow))
    fore = products(about(wrist - elbow, side * limb.turn), fore)
    for bone, turn, place in ((UPPER, upper, root), (FORE, fore, elbow), (HAND, fore, wrist)):
        _put(moves, first + bone, turn, joints[first + bone], place)
    for digit in range(5):
        is_thumb = digit == 4
        axis = ARM * (side, 1.0, 1.0) if is_thumb else side * AHEAD
        for number in (0, 1):
            bone = first + DIGITS + 2 * digit + number
            bend = -(1 + number) * limb.bend * (0.3 * side if is_thumb else 1.0)
            parent = first + HAND if number == 0 else bone - 1
            _put(moves, bone, products(fore, about(axis, bend)), joints[bone], _moved(moves, parent, joints[bone]))


def _put_leg(moves: Moves, joints: Float64[np.ndarray, "B 3"], first: int, side: float, limb: Limb) -> None:
    """Place the bones of a leg and its foot."""
    hip = _moved(moves, PELVIS, joints[first + THIGH])
    knee, ankle = bent(hip, limb.place, (norm(KNEE - HIP), norm(ANKLE - KNEE)), limb.pole)
    ways = (joints[first + SHIN] - joints[first + THIGH], (ANKLE - KNEE) * (side, 1.0, 1.0))
    out = knee - (hip + ankle) / 2
    thigh, shin = (
        products(_frame(way, out), _frame(still, AHEAD).T)
        for way, still in zip((knee - hip, ankle - knee), ways, strict=True)
    )
    foot = products(about(UP, side * limb.turn), about(LEFT, limb.bend))
    _put(moves, first + THIGH, thigh, joints[first + THIGH], hip)
    _put(moves, first + SHIN, shin, joints[first + SHIN], knee)
    _put(moves, first + FOOT, foot, ANKLE * (side, 1.0, 1.0), ankle)
