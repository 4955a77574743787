"""Encode splats: flat Gaussians on the faces of a base mesh, which move with it through all groups of a chain.

In -> out: splats <-> bytes, each layer a byte range, the most important splats first. In a layer, splats are in the
order of their faces, so that neighbours are alike.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import accumulate, pairwise

import numpy as np

from ...errors import FormatError, InputError
from ...format.budget import check_cost, splats_cost
from ...format.layout import Form, Gaussians, GaussiansLayer
from ...format.records import pack, unpack
from ...geometry.splats import Splats, locate
from ...shapes import Float64, Int64
from ..entropy import decode_integers, encode_integers
from ..steps import RUNGS, rung_of, step_of

ROUND = 1.1  # largest ratio of scales of a splat that counts as round, with angle 0 (guess): invisible
MOST_BITS = 14  # of a number of a splat
PLACE_BITS, TURN_BITS, OPACITY_BITS, COLOR_BITS = 7, 6, 6, 7  # of the weights of a face's corners, and so on (guess)
OFFSET_STEP = 1e-4  # normalised: .2 mm on a person (guess)
LAYERS = (0.125, 0.5, 1.0)  # share of the splats that the first k layers have (guess)


def encode_splats(splats: Splats, importance: Float64[np.ndarray, " N"]) -> tuple[bytes, tuple[int, ...]]:
    """Encode splats; return the payload and the ends of its layers. Raises InputError for values without a code."""
    _check_input(splats, importance)
    rungs = _rungs(splats.scales)
    middle = int(np.median(rungs[:, 0]))
    bits = (PLACE_BITS, TURN_BITS, OPACITY_BITS, COLOR_BITS)
    head = Gaussians(Form.GAUSSIANS, *bits, rung_of(OFFSET_STEP), middle, len(splats))
    first, *others = (pack(_encode_layer(splats.take(chosen), head)) for chosen in _layers(splats, importance))
    parts = [pack(head) + first, *others]
    return b"".join(parts), tuple(accumulate(map(len, parts)))


def decode_splats(data: bytes, faces: int) -> Splats:
    """Decode the splats of a payload, or of its first layers, on a base mesh of `faces` faces.

    The fewer splats, the larger they become. Raises FormatError if the bytes are damaged, and CostlyError if they have
    too many splats.
    """
    head, offset = unpack(Gaussians, data)
    bits = (head.place_bits, head.turn_bits, head.opacity_bits, head.color_bits)
    if head.form != Form.GAUSSIANS or not all(1 <= part <= MOST_BITS for part in bits) or head.offset_level >= RUNGS:
        raise FormatError(f"splats of form {head.form}, bits {bits} and offset level {head.offset_level}")
    layers, total = list[Splats](), 0
    while offset < len(data) or not layers:
        record, offset = unpack(GaussiansLayer, data, offset)
        total += record.count
        check_cost(splats_cost(total), len(data), "splats")
        layers.append(_decode_layer(record, head, faces))
    if total > head.count:
        raise FormatError(f"{total} splats of {head.count}")
    splats = Splats(*(np.concatenate([getattr(part, name) for part in layers]) for name in Splats.__slots__))
    return replace(splats, scales=splats.scales * math.sqrt(math.sqrt(head.count / total)))


def _encode_layer(splats: Splats, head: Gaussians) -> GaussiansLayer:
    """Encode the splats of a layer; they are in the order of their faces."""
    size, rungs = 1 << head.place_bits, _rungs(splats.scales)
    places = np.clip(np.rint(splats.weights * size), 0, size).astype(np.int64)
    places[:, 1] = np.minimum(places[:, 1], size - places[:, 0])  # a sum of 0 to `size`
    turns = np.rint(splats.turns / np.pi * (1 << head.turn_bits)).astype(np.int64) % (1 << head.turn_bits)
    turns[splats.scales[:, 0] < ROUND * splats.scales[:, 1]] = 0
    opacities = np.rint(splats.opacities * (1 << head.opacity_bits))
    red, green, blue = splats.colors.T
    differences = red - blue, green - (red + blue) / 2
    colors = np.rint(
        np.stack([(red + blue) / 4 + green / 2, *(difference / 2 for difference in differences)]) * 2.0**head.color_bits
    )
    return GaussiansLayer(
        len(splats),
        _packed(np.diff(splats.faces, prepend=0)),
        _packed(places.T),
        _packed(np.rint(splats.offsets / step_of(head.offset_level))),
        _packed(turns),
        _packed([rungs[:, 0] - head.scale_level, rungs[:, 1] - rungs[:, 0]]),
        _packed(opacities),
        _packed(np.diff(colors, axis=1, prepend=0)),
    )


def _decode_layer(record: GaussiansLayer, head: Gaussians, count: int) -> Splats:
    n, size = record.count, 1 << head.place_bits
    if n == 0:
        raise FormatError("splats: a layer without any")
    faces = np.cumsum(_unpacked(record.faces, n)[0])
    places = _unpacked(record.places, n, 2)
    offsets, turns = _unpacked(record.offsets, n)[0], _unpacked(record.turns, n)[0]
    longer, shorter = _unpacked(record.scales, n, 2)
    opacities = _unpacked(record.opacities, n)[0]
    luma, orange, green = np.cumsum(_unpacked(record.colors, n, 3), axis=1) / 2.0**head.color_bits
    rungs = np.stack([longer + head.scale_level, longer + head.scale_level + shorter], axis=1)
    limits = (
        (faces, count - 1, "face"),
        (places, size, "weight"),
        (places.sum(axis=0), size, "sum of weights"),
        (turns, (1 << head.turn_bits) - 1, "angle"),
        (shorter, RUNGS - 1, "ratio of scales"),
        (rungs, RUNGS - 1, "scale"),
        (opacities, 1 << head.opacity_bits, "opacity"),
    )
    for values, most, what in limits:
        if values.min() < 0 or values.max() > most:
            raise FormatError(f"splats: {what} {values.min()} to {values.max()}, beyond 0 to {most}")
    blend = luma - green, luma + green
    colors = np.stack([blend[0] + orange, blend[1], blend[0] - orange], axis=1)
    return Splats(
        faces.astype(np.int32),
        places.T / size,
        offsets * step_of(head.offset_level),
        turns * (np.pi / (1 << head.turn_bits)),
        _STEPS[rungs],
        opacities / (1 << head.opacity_bits),
        np.clip(colors, 0, 1),
    )


_STEPS = np.array([step_of(rung) for rung in range(RUNGS)])


def _packed(values: object) -> bytes:
    return encode_integers(np.asarray(values).reshape(-1).astype(np.int32))


def _unpacked(data: bytes, count: int, rows: int = 1) -> Int64[np.ndarray, "R N"]:
    return decode_integers(data, rows * count).reshape(rows, count).astype(np.int64)


def _rungs(scales: Float64[np.ndarray, "N 2"]) -> Int64[np.ndarray, "N 2"]:
    """Return the levels of scales above 0; the level of the shorter is not less."""
    rungs = np.clip(np.rint(-8 * np.log2(scales)), 0, RUNGS - 1).astype(np.int64)
    return np.maximum.accumulate(rungs, axis=1)


def _layers(splats: Splats, importance: Float64[np.ndarray, " N"]) -> list[Int64[np.ndarray, " _"]]:
    """Return the splats of each layer, in the order of their faces after four subdivisions.

    Layers are spread evenly over the surface: among neighbours in that order, the most important come first.
    """
    order = np.argsort(locate(splats.faces, splats.weights, 4)[0], kind="stable")
    n, rank = len(order), np.empty(len(order))
    run = max(round(LAYERS[-1] / LAYERS[0]), 1)  # neighbours of which one is in the first layer
    for start in range(0, n, run):
        values = importance[order[start : start + run]]
        rank[start : start + len(values)][np.argsort(-values, kind="stable")] = np.arange(len(values))
    by_rank = np.argsort(rank, kind="stable")
    bounds = [0, *(max(round(share * n), 1) for share in LAYERS)]
    parts = (np.sort(by_rank[a:b]) for a, b in pairwise(bounds) if b > a)
    return [order[part] for part in parts]


def _check_input(splats: Splats, importance: Float64[np.ndarray, " N"]) -> None:
    if len(splats) == 0:
        raise InputError("no splats: give at least one")
    for name in (*Splats.__slots__, "importance"):
        values = importance if name == "importance" else getattr(splats, name)
        wrong = ~np.isfinite(values).reshape(len(splats), -1).all(axis=1)
        if wrong.any():
            raise InputError(f"splat {int(wrong.argmax())}: {name} {values[wrong.argmax()]}; give finite numbers")
    outside = (splats.scales <= 0).any(axis=1) | (splats.opacities < 0) | (splats.opacities > 1)
    if outside.any():
        k = int(outside.argmax())
        text = f"splat {k}: scales {splats.scales[k]}, opacity {splats.opacities[k]:g}"
        raise InputError(f"{text}; give scales above 0 and opacities of 0 to 1")
