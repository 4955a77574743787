"""Bones of a person: which of them carry each place, and where a stance puts them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float64

from ...geometry.strict import products
from ...geometry.topology import unique_edges, vertex_normals
from ...types import Mesh
from .figure import _bent, turn_about_y
from .person import (
    ANKLE, ARM, ELBOW, FOREARM, HIP, KNEE, SHOULDER, REST, UPPER_ARM, WRIST, Build, finger_joints, folds,
)
from .sculpture import Vector

Turn = Float64[np.ndarray, "3 3"]
PELVIS, CHEST, NECK, SKULL = range(4)
UPPER, FORE, HAND, THIGH, SHIN, FOOT, DIGITS = 0, 1, 2, 3, 4, 5, 6  # of a side, from `FIRST` on; two for each digit
FIRST, OF_SIDE = 4, 16  # bones before those of the left side, and of a side
WAIST, NAPE, NOD = np.array([0.0, 1.05, -0.008]), np.array([0.0, 1.44, -0.026]), np.array([0.0, 1.545, -0.016])
SMOOTHED = 6  # rounds in which weights of neighbours are averaged (guess)


@dataclass(frozen=True, slots=True)
class Limb:
    """Where a hand or a foot is to be, and how it is held; in the person's frame, of an adult's size."""

    place: Vector  # m, of the wrist or the ankle
    pole: Vector  # way to which elbow or knee points
    bend: float = 0.25  # rad, of each joint of the fingers; of a foot: the heel up
    turn: float = 0.0  # rad, of the foot outward, or of the hand about the forearm


@dataclass(frozen=True, slots=True)
class Stance:
    """Where a person is and what the body does at a moment."""

    place: Vector  # m, on the floor below the hips
    heading: float  # rad about y; 0 faces +z
    lift: float  # m, of the hips
    hands: tuple[Limb, Limb]  # left and right
    feet: tuple[Limb, Limb]
    tilt: float = 0.0  # rad, of the hips to the left
    twist: float = 0.0  # rad, of the chest to the left
    lean: float = 0.0  # rad, of the chest forward
    head: tuple[float, float, float] = (0.0, 0.0, 0.0)  # rad: to the left, down, towards the left shoulder


def segments() -> tuple[Float64[np.ndarray, "B 2 3"], Float64[np.ndarray, " B"], Float64[np.ndarray, " B"], list[int]]:
    """Return ends, radii, softness of the seams (m) and parents of the bones in the still pose."""
    ends = [((0, 0.93, -0.01), (0, 1.0, -0.01)), (WAIST, (0, 1.36, -0.005)), (NAPE, NOD), (NOD, (0, 1.66, 0))]
    radii, softness, parents = [0.13, 0.13, 0.05, 0.09], [0.03, 0.04, 0.02, 0.02], [-1, PELVIS, CHEST, NECK]
    for side in (1.0, -1.0):
        first = len(ends)
        flip = np.array([side, 1.0, 1.0])
        toe = ANKLE + [0.004, -0.045, 0.15]
        own = [(SHOULDER, ELBOW), (ELBOW, WRIST), (WRIST, WRIST + 0.085 * ARM), (HIP, KNEE), (KNEE, ANKLE), (ANKLE - [0, 0.04, 0.02], toe)]
        radii += [0.048, 0.036, 0.026, 0.075, 0.05, 0.04]
        softness += [0.035, 0.022, 0.012, 0.035, 0.03, 0.012]
        parents += [CHEST, first + UPPER, first + FORE, PELVIS, first + THIGH, first + SHIN]
        for joints in finger_joints():
            a, b, c = joints[-3:]
            own += [(a, b), (b, c)]
            radii += [0.009, 0.008]
            softness += [0.005, 0.004]
            parents += [first + HAND, first + DIGITS + len(own) - 8]
        ends += [(flip * a, flip * b) for a, b in own]
    return np.array(ends, float), np.array(radii), np.array(softness), parents


def weights(build: Build, mesh: Mesh) -> Float64[np.ndarray, "V B"]:
    """Return the share of each bone in the motion of each vertex of the still pose."""
    ends, radii, softness, parents = segments()
    points, gaps = mesh.vertices, np.empty((len(mesh.vertices), len(radii)))
    for bone, ((a, b), radius) in enumerate(zip(ends, radii, strict=True)):
        along = np.clip(np.einsum("nd,d->n", points - a, (b - a) / ((b - a) ** 2).sum()), 0, 1)
        gaps[:, bone] = np.sqrt(((points - a - along[:, None] * (b - a)) ** 2).sum(axis=1)) - radius
    near = np.eye(len(radii), dtype=bool)
    for bone, parent in enumerate(parents[1:], 1):
        near[bone, parent] = near[parent, bone] = True
    best = gaps.argmin(axis=1)
    shares = np.exp(-np.minimum((gaps - gaps.min(axis=1)[:, None]) / np.minimum(softness, softness[best][:, None]), 50.0)) * near[best]
    trunk = np.isin(best, (CHEST, NECK, SKULL)) & (points[:, 1] > 1.43)
    away = np.hypot(points[:, 0], points[:, 2] + 0.02) > 0.064
    height = np.where(away, np.where(points[:, 1] > 1.4835, 1.6, 1.40), points[:, 1])
    steps = [np.clip((height - low) / (high - low), 0, 1) for low, high in ((1.45, 1.48), (1.50, 1.56))]
    neck = np.zeros_like(shares)
    neck[:, CHEST], neck[:, NECK], neck[:, SKULL] = 1 - steps[0], steps[0] * (1 - steps[1]), steps[0] * steps[1]
    rigid = (trunk & ((points[:, 1] > 1.45) | away) & ((points[:, 1] > 1.4835) | ~away))
    shares[rigid] = neck[rigid]
    shares /= shares.sum(axis=1)[:, None]
    edges, _ = unique_edges(mesh.faces)
    degree = np.bincount(edges.reshape(-1), minlength=len(points))[:, None] + 1.0
    for _ in range(SMOOTHED):
        total = shares.copy()
        for bone in range(len(radii)):
            total[:, bone] += np.bincount(edges[:, 0], shares[edges[:, 1], bone], len(points))
            total[:, bone] += np.bincount(edges[:, 1], shares[edges[:, 0], bone], len(points))
        shares = total / degree
    return shares


def frame(way: Vector, pole: Vector) -> Turn:
    """Return the axes along a limb, to the side that its joint points to, and across."""
    first = way / np.linalg.norm(way)
    second = pole - first * float((pole * first).sum())
    second /= np.linalg.norm(second)
    return np.stack([first, second, np.cross(first, second)], axis=1)


def about(axis: Vector, angle: float) -> Turn:
    """Return the rotation about an axis."""
    x, y, z = axis / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * products(cross, cross)


X, Y, Z = np.eye(3)


def placed(build: Build, stance: Stance) -> Float64[np.ndarray, "B 3 4"]:
    """Return the motion of each bone from the still pose into the person's frame: turn and shift."""
    ends, _, _, _ = segments()
    moves = np.zeros((len(ends), 3, 4))

    def put(bone: int, turn: Turn, joint: Vector, place: Vector) -> None:
        moves[bone, :, :3], moves[bone, :, 3] = turn, place - products(turn, joint[:, None])[:, 0]

    def at(bone: int, point: Vector) -> Vector:
        return products(moves[bone, :, :3], point[:, None])[:, 0] + moves[bone, :, 3]

    put(PELVIS, about(Z, stance.tilt), ends[PELVIS, 0], ends[PELVIS, 0] + [0.0, stance.lift, 0.0])
    chest = products(about(Y, stance.twist), products(about(X, stance.lean), about(Z, -0.6 * stance.tilt)))
    put(CHEST, chest, WAIST, at(PELVIS, WAIST))
    left, down, side = stance.head
    for bone, joint, share in ((NECK, NAPE, 0.4), (SKULL, NOD, 1.0)):
        nod = products(about(Y, share * left), products(about(X, share * down), about(Z, -share * side)))
        put(bone, nod, joint, at(bone - 1, joint))
    for number, side_sign in enumerate((1.0, -1.0)):
        flip = np.array([side_sign, 1.0, 1.0])
        first = FIRST + number * OF_SIDE
        arm, leg = stance.hands[number], stance.feet[number]
        root = at(CHEST, flip * SHOULDER)
        elbow, wrist = _bent(root, arm.place, (UPPER_ARM, FOREARM), arm.pole)
        pole = elbow - (root + wrist) / 2
        if np.linalg.norm(pole) < 1e-4:
            pole = arm.pole
        still = frame(flip * ARM, -Z)
        upper = products(frame(elbow - root, pole), still.T)
        fore = products(about(wrist - elbow, side_sign * arm.turn), products(frame(wrist - elbow, pole), still.T))
        put(first + UPPER, upper, flip * SHOULDER, root)
        put(first + FORE, fore, flip * ELBOW, elbow)
        put(first + HAND, fore, flip * WRIST, wrist)
        for digit, joints in enumerate(finger_joints()):
            axis = flip[0] * Z * (1.0 if digit < 4 else 0.0) + (0.0 if digit < 4 else 1.0) * (0.8 * ARM * flip - 0.2 * Z * 0)
            bend = arm.bend if digit < 4 else 0.3 * arm.bend
            for which in range(2):
                bone = first + DIGITS + 2 * digit + which
                joint = flip * joints[-3 + which]
                turn = products(moves[first + HAND, :, :3], about(axis, -(which + 1) * bend * (1.0 if digit < 4 else side_sign)))
                put(bone, turn, joint, at(first + HAND if which == 0 else bone - 1, joint))
        hip = at(PELVIS, flip * HIP)
        knee, ankle = _bent(hip, leg.place, (float(np.linalg.norm(KNEE - HIP)), float(np.linalg.norm(ANKLE - KNEE))), leg.pole)
        put(first + THIGH, products(frame(knee - hip, leg.pole), frame(flip * (KNEE - HIP), Z).T), flip * HIP, hip)
        put(first + SHIN, products(frame(ankle - knee, leg.pole), frame(flip * (ANKLE - KNEE), Z).T), flip * KNEE, knee)
        put(first + FOOT, products(about(Y, side_sign * leg.turn), about(X, leg.bend)), flip * ANKLE, ankle)
    return moves


def bends(moves: Float64[np.ndarray, "B 3 4"]) -> tuple[float, ...]:
    """Return how far elbows and knees (left, right) and the waist are bent, 0 to 1."""
    pairs = [(FIRST + side * OF_SIDE + bone, FIRST + side * OF_SIDE + bone + 1) for bone in (UPPER, THIGH) for side in (0, 1)]
    cosines = [(float((moves[a, :, :3] * moves[b, :, :3]).sum()) - 1) / 2 for a, b in (*pairs, (PELVIS, CHEST))]
    return tuple(min((1 - cosine) / 1.2, 1.0) for cosine in cosines)


def carried(mesh: Mesh, shares: Float64[np.ndarray, "V B"], build: Build, stance: Stance) -> Mesh:
    """Return the mesh of the still pose in a stance, with the folds of the stance, m."""
    moves = placed(build, stance)
    folded = folds(mesh.vertices, bends(moves), build.trouser) - folds(mesh.vertices, REST, build.trouser)
    still = mesh.vertices + folded[:, None] * vertex_normals(mesh)
    blended = products(shares, moves.reshape(len(moves), 12)).reshape(-1, 3, 4)
    own = np.einsum("nij,nj->ni", blended[:, :, :3], still) + blended[:, :, 3]
    return mesh.at(build.size * products(own, turn_about_y(stance.heading).T) + stance.place)
