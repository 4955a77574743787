"""The KLT of a block's distances: a mean and principal components, learned offline, and the weights of blocks.

A vector is a sum of products of discrete Legendre (Gram) polynomials of total degree 8 at most, even or odd along each
axis, for blocks were learned under all symmetries of the cube: it takes about twenty small integers. Weights are
quantised in turn, each rounding made good by those to come. Decoded distances are in integers: the same on every
platform. Voxels that blocks share get the mean of their values.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

import numpy as np
from jaxtyping import Bool, Float64, Int32, Int64

from meshreel.coding.entropy import decode_integers, encode_integers
from meshreel.errors import FormatError
from meshreel.format.kinds import Blob, Varint
from meshreel.geometry.voxels import distinct, moved
from meshreel.types import Mesh

from ..necgs.volumes import cases_of, cut
from .grid import OFFSETS, POINTS, SIDE, VOLUME, Blocks, block_keys

DEGREE = 8  # of the polynomials, in all three axes together
ONE = 1 << 12  # what a value of 1 is in a basis; a vector's root mean square is 1
COEFFICIENT = 1 << 9  # what a coefficient of 1 is
MOST = 64  # components that were learned
ENERGY = 1 << 20  # what a mean square of 1 is in the package data
_BLOB = Blob(Varint())
FILE = "basis.bin"  # package data: energies, mean and components; its trainer is in this repository, commit 4ca03122


@dataclass(frozen=True, slots=True)
class BasisSymbols:
    """A basis as symbols of the stream."""

    classes: Int32[np.ndarray, " M"]  # parities of each vector: 4 x odd along x, 2 x along y, 1 x along z
    coefficients: tuple[Int32[np.ndarray, " _"], ...]  # of the mean, which is even, in voxels; then of each vector


@dataclass(frozen=True, slots=True)
class Model:
    """Basis at a block's voxels, in units of 1 / ONE, and step: integers, float64 so that products are exact."""

    mean: Float64[np.ndarray, " N"]  # voxels
    vectors: Float64[np.ndarray, "N M"]  # root mean square 1, strongest first
    step: int  # of the weights, in units of 1 / STEP_ONE voxels


@cache
def degrees() -> Int64[np.ndarray, "K 3"]:
    """The polynomials' degrees along the axes, low totals first."""
    every = [d for d in itertools.product(range(POINTS), repeat=3) if sum(d) <= DEGREE]
    return np.array(sorted(every, key=lambda d: (sum(d), d)))


@cache
def polynomials() -> Float64[np.ndarray, "N K"]:
    """Each polynomial at a block's voxels, root mean square 1, in whole multiples of 1 / ONE; times ONE."""
    x = np.arange(POINTS) - POINTS // 2.0
    rows = [np.ones(POINTS), x]
    for n in range(1, POINTS - 1):  # the recurrence of Gram's polynomials
        rows.append(((2 * n + 1) * x * rows[n] - n * (POINTS**2 - n**2) / 4 * rows[n - 1]) / (n + 1))
    scaled = np.stack([row / np.sqrt(sum(v * v for v in row.tolist()) / POINTS) for row in rows])
    a, b, c = (scaled[degrees()[:, axis]][:, OFFSETS[:, axis]].T for axis in range(3))
    return np.rint(a * b * c * ONE)


@cache
def members(kind: int) -> Int64[np.ndarray, " K"]:
    """The polynomials of one parity class."""
    return np.flatnonzero(degrees() % 2 @ [4, 2, 1] == kind)


def model_of(symbols: BasisSymbols, step: int) -> Model:
    """The model of a basis and a step; exact: all numbers are integers below 2^53."""
    kinds = [0, *symbols.classes.tolist()]
    columns = [polynomials()[:, members(k)] @ c for k, c in zip(kinds, symbols.coefficients, strict=True)]
    values = np.stack([np.floor(column / COEFFICIENT + 0.5) for column in columns], axis=1)
    return Model(values[:, 0].copy(), np.ascontiguousarray(values[:, 1:]), step)


def encode_basis(symbols: BasisSymbols) -> bytes:
    """The classes, then the coefficients."""
    coefficients = np.concatenate(symbols.coefficients).astype(np.int32)
    return join([encode_integers(symbols.classes), encode_integers(coefficients)])


def decode_basis(data: bytes, count: int) -> BasisSymbols:
    """The basis of `count` vectors."""
    first, second = split(data, 2)
    classes = decode_integers(first, count)
    lengths = np.cumsum([len(members(kind)) for kind in [0, *classes.tolist()]])
    coefficients = decode_integers(second, int(lengths[-1]))
    return BasisSymbols(classes, tuple(np.split(coefficients, lengths[:-1])))


def learned(count: int) -> tuple[BasisSymbols, Float64[np.ndarray, " M"]]:
    """The first `count` vectors that were learned, and each weight's mean square, voxels squared."""
    first, second = split((files(__package__) / FILE).read_bytes(), 2)
    energies = decode_integers(first, MOST) / ENERGY
    symbols = decode_basis(second, MOST)
    return BasisSymbols(symbols.classes[:count], symbols.coefficients[: count + 1]), energies[:count]


def join(blobs: Iterable[bytes]) -> bytes:
    """Return all blobs behind their lengths."""
    return b"".join(map(_BLOB.pack, blobs))


def split(data: bytes, count: int) -> list[bytes]:
    """Return the `count` blobs of `data`. Raises FormatError where it holds fewer, or more."""
    blobs, offset = list[bytes](), 0
    while len(blobs) < count:
        blob, offset = _BLOB.unpack(data, offset)
        blobs.append(blob)
    if offset != len(data):
        raise FormatError(f"{len(data) - offset} bytes too many; the stream is damaged")
    return blobs


TRUNCATION = 3.0  # voxels
STEP_ONE = 1 << 12  # what a step of 1 voxel is in the stream
_FAR = 0.03  # what a voxel counts that no crossed edge ends at
_ROUNDS = 3  # of the targets beyond truncation
_NOISE = 0.001  # voxels squared, against which the energies of the components count
_CHUNK = 400  # blocks whose systems are in memory at once
LARGEST = 1 << 20  # of a weight in units of 1 / STEP_ONE: sums stay exact


def beyond(values: Float64[np.ndarray, "B N"], fitted: Float64[np.ndarray, "B N"]) -> Float64[np.ndarray, "B N"]:
    """The distances to fit: beyond truncation what is fitted already, if it is beyond truncation on that side, too."""
    side = np.where(values < 0, -1.0, 1.0)
    return np.where(np.abs(values) > TRUNCATION, side * np.maximum(side * fitted, TRUNCATION), values)


def forward(blocks: Blocks, model: Model, energies: Float64[np.ndarray, " M"]) -> Int32[np.ndarray, "B M"]:
    """The symbols of the weights; `energies` are the mean squares to expect, voxels squared."""
    vectors, mean = model.vectors / ONE, model.mean / ONE
    noise, most = _NOISE + (model.step / STEP_ONE) ** 2 / 12, 2 * TRUNCATION
    symbols = np.zeros((len(blocks.places), vectors.shape[1]), np.int32)
    every = np.where(blocks.near, 1.0, np.where(blocks.known, _FAR, 0.0))  # weights of voxels in the fit
    for start in range(0, len(symbols), _CHUNK):
        part = slice(start, start + _CHUNK)
        values, counts = blocks.values[part], every[part]
        inverse = np.linalg.inv(np.matmul(vectors.T, counts[:, :, None] * vectors) + np.diag(noise / energies))
        weights = np.zeros((len(values), vectors.shape[1]))
        for number in range(_ROUNDS):
            target = beyond(values, mean + weights @ vectors.T) if number else np.clip(values, -most, most)
            weights = np.einsum("bij,bj->bi", inverse, (counts * (target - mean)) @ vectors)
        symbols[part] = _quantised(weights, inverse, model.step / STEP_ONE)
    return symbols


def _quantised(rest: Float64[np.ndarray, "B M"], inverse: Float64[np.ndarray, "B M M"], unit: float) -> np.ndarray:
    """Return symbols of weights; the rounding error of one is spread over the following ones by least squares."""
    symbols = np.zeros(rest.shape, np.int32)
    upper = np.swapaxes(np.linalg.cholesky(inverse), 1, 2)
    for k in range(rest.shape[1]):
        symbols[:, k] = np.rint(rest[:, k] / unit)
        error = (rest[:, k] - symbols[:, k] * unit) / upper[:, k, k]
        rest[:, k:] -= error[:, None] * upper[:, k, k:]
    return symbols


_SURE = 3 * ONE * STEP_ONE  # three voxels: what is farther has no more of a vote
_BARELY = ONE * STEP_ONE // 64
_MOST = 1 << 27  # of a distance, 8 voxels: eight of these fit in 32 bits
_NEAR = ONE * STEP_ONE  # a voxel: what is farther from the zero level shows nowhere
_HIGH = np.indices((2, 2, 2)).reshape(3, -1).T  # from a block to those that have some of its voxels as their first ones
VOXELS = SIDE**3  # voxels of a block that are no other's
Keys = Int64[np.ndarray, " _"]  # of blocks, sorted
Values = Int32[np.ndarray, "O S S S"]


@dataclass(frozen=True, slots=True)
class Field:
    """Distances at the voxels of a frame's blocks, never 0."""

    places: Int64[np.ndarray, "B 3"]
    values: Int32[np.ndarray, "B P P P"]  # whole multiples of 1 / (ONE STEP_ONE) voxels; that many
    voxels: Int32[np.ndarray, "B P P P"]  # their numbers, the same in all blocks that share one


def field_of(places: Int64[np.ndarray, "B 3"], symbols: Int32[np.ndarray, "B M"], model: Model) -> Field:
    """The distances that the symbols of some sorted blocks stand for."""
    weights = np.clip(symbols.astype(np.float64) * model.step, -LARGEST, LARGEST)
    whole = weights @ model.vectors.T + STEP_ONE * model.mean  # integers below 2^53: exact in any order
    values = np.clip(whole, -_MOST, _MOST, out=whole).astype(np.int32).reshape(-1, POINTS, POINTS, POINTS)
    keys = block_keys(places)
    owners = distinct(np.concatenate([moved(keys, high) for high in _HIGH]))  # blocks that voxels are first ones of
    total, counts = (np.zeros((len(owners), SIDE, SIDE, SIDE), kind) for kind in (np.int32, np.int8))
    voxels, inner = np.empty(values.shape, np.int32), np.arange(VOXELS, dtype=np.int32).reshape(counts.shape[1:])
    for high in _HIGH:
        at = np.searchsorted(owners, moved(keys, high))
        there, here = (at, *_first(high)), (slice(None), *(slice(SIDE, None) if h else slice(SIDE) for h in high))
        total[there] += values[here]
        counts[there] += 1
        voxels[here] = VOXELS * at[:, None, None, None] + inner[_first(high)]
    shared = counts > 1
    total[shared] //= counts[shared]  # the mean, rounded down
    total[total == 0] = 1
    return Field(places, _closed(keys, owners, total, counts > 0).reshape(-1)[voxels], voxels)


def _first(high: Int64[np.ndarray, " 3"]) -> tuple[slice, slice, slice]:
    """The first of an owner's voxels along some axes, all of them along the others."""
    x, y, z = (slice(1) if h else slice(None) for h in high)
    return x, y, z


def _closed(keys: Keys, owners: Keys, values: Values, known: Bool[np.ndarray, "O S S S"]) -> Values:
    """Return distances without surface that leaves the blocks by less than a voxel, which would end there in a hole.

    A block that is not there is on one side, that of its known voxels; others, if near, are put on this one.
    """
    beside = list[tuple[tuple[np.ndarray, slice, slice, slice], np.ndarray]]()
    for back in _HIGH:
        names = moved(owners, -back)
        rows = np.flatnonzero(~np.isin(names, keys, assume_unique=True))
        beside.append(((rows, *_first(back)), names[rows]))
    absent = distinct(np.concatenate([names for _, names in beside]))
    votes, wanted = np.zeros(len(absent)), np.zeros(values.shape, np.int8)
    for at, names in beside:
        vote = np.where(known[at], np.clip(values[at], -_SURE, _SURE), 0).sum(axis=(1, 2, 3))
        votes += np.bincount(np.searchsorted(absent, names), vote, len(absent))
    for at, names in beside:
        wanted[at] += np.sign(votes)[np.searchsorted(absent, names)].astype(np.int8)[:, None, None, None]
    turned = known & ((wanted < 0) != (values < 0)) & (wanted != 0) & (np.abs(values) < _NEAR)
    values[turned] = np.where(wanted[turned] < 0, -_BARELY, _BARELY)
    return values


def crossed(field: Field, chosen: Bool[np.ndarray, " B"]) -> Int64[np.ndarray, " C"]:
    """The numbers of the cells of the chosen blocks that the zero level passes through, sorted by their places."""
    cells = np.flatnonzero(cases_of(field.values[chosen]) - np.uint8(1) < 254)  # 0 and 255 are not crossed
    cells += VOXELS * (np.flatnonzero(chosen) - np.arange(chosen.sum()))[cells // VOXELS]
    return cells[np.argsort(block_keys(cells_at(cells, field)))]


def polygonize(field: Field) -> tuple[Mesh, Int64[np.ndarray, " F"]]:
    """The zero level inside the blocks, in voxel units, and the number of each face's cell."""
    found, values = cut(field.values, field.voxels), field.values.reshape(-1)
    low, high = values[found.low], values[found.high]
    block, inner = np.divmod(found.low, VOLUME)
    vertices = (SIDE * field.places[block] + OFFSETS[inner]).astype(np.float64)
    axis = np.argmax(OFFSETS[found.high - VOLUME * block] != OFFSETS[inner], axis=1)
    vertices[np.arange(len(low)), axis] += low / (low - high)
    return Mesh.of(vertices, found.faces), found.cells


def cells_at(cells: Int64[np.ndarray, " C"], field: Field) -> Int64[np.ndarray, "C 3"]:
    """The places of cells."""
    block, cell = np.divmod(cells, VOXELS)
    return SIDE * field.places[block] + np.stack([cell >> 6, cell >> 3 & 7, cell & 7], axis=1)
