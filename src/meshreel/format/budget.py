"""Limits on the memory that decoding may take, in proportion to the bytes of a chunk.

Pure arithmetic on numbers that a reader knows before it allocates; FORMAT.md ("What a file may cost") states the rules.
A cost is an upper bound of the memory and, at some 2 ns for each byte of it, of the time. The decoder in
C++ has the same functions in core/decoder/budget.h, with the numbers of `LIMITS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import FormatError
from ..types import Mesh


@dataclass(frozen=True, slots=True)
class Limits:
    """Constants of the limits; costs are in bytes. An element is a face or a vertex of a mesh as it is shown."""

    free: int = 192 << 20  # cost allowed to any chunk (guess): twice as much as any group of docs/results
    per_byte: int = 8192  # additional cost allowed for each byte of a chunk (guess)
    together: int = 96 << 20  # memory of the groups of one frame, plus per_byte (guess)
    chain: int = 8  # cost of all states that lead to a background, in costs of one chunk of their bytes (guess)
    head: int = 64 << 20  # bytes of the head, which is read whole: that of weeks of video (guess)
    frames: int = 65_535  # of all groups: as many as one group may have
    frames_per_byte: int = 64  # additional frames for each byte of the file: a still group has 2 (guess)
    frame: int = 1024  # cost of a frame, whatever is in it
    # Costs of decoding, from measurement (scripts/worst_files.py), rounded up:
    element: int = 160  # of the largest mesh of a DRACO group; of a LAYERS group; of a change and what it changes
    shown: int = 30  # of an element in each frame of a DRACO group
    moving: int = 30  # of an element in each frame of a LAYERS group
    solved: int = 1600  # of an element of a LAPLACIAN group, whose least squares fill in
    column: int = 20  # of an element in each frame and for each component of a LAPLACIAN group
    pair: int = 100  # of two corners at one vertex of a LAPLACIAN group: a row of the least squares squared
    number: int = 40  # of a number in the basis of a LAPLACIAN group
    colors: int = 96 << 20  # cost allowed to any chunk of colours, plus per_byte (guess)
    painted: int = 32  # of a vertex with colours, in each frame
    painting: int = 256  # of a vertex of the largest mesh with colours
    pictures: int = 768 << 20  # cost allowed to the pictures of a chunk, or of a layer, plus per_byte (guess)
    texel: int = 2  # of a decoded picture
    videos: int = 176 << 20  # memory allowed to the decoders of all videos, plus per_byte: one video of 2048 x 2048
    splat: int = 1024  # of a splat, bound in a frame
    audio: int = 256 << 20  # bytes of a chunk of audio, which is in memory as a whole: hours (guess)
    faces: int = 64_000_000  # faces or vertices of a group, or places of them in all frames (guess): memory
    numbers: int = 1 << 29  # of the decoded places of a group: 4 GiB
    held: int = 44  # of a texel of a video, whose decoder keeps up to 16 pictures (H.264; measured: 42)


LIMITS = Limits()


class CostlyError(FormatError):
    """Bytes that would cost more to decode than their number allows: readers refuse them, encoders avoid them."""


@dataclass(frozen=True, slots=True)
class Size:
    """Faces and vertices of a mesh, before its midpoint subdivisions."""

    faces: int
    vertices: int
    levels: int = 0

    @classmethod
    def of(cls, mesh: Mesh, levels: int = 0) -> Size:
        """Return the size of a mesh that will be subdivided `levels` times."""
        return cls(len(mesh.faces), len(mesh.vertices), levels)

    @property
    def elements(self) -> int:
        """Faces and vertices, at most, after the subdivisions; exact for a closed surface."""
        return (self.faces + self.vertices) * 4**self.levels


def allowance(size: int) -> int:
    """Return the cost allowed to a chunk of `size` bytes."""
    return LIMITS.free + LIMITS.per_byte * size


def together(size: int) -> int:
    """Return the memory allowed to the groups of one frame, which have `size` bytes in total."""
    return LIMITS.together + LIMITS.per_byte * size


def draco_cost(meshes: Sequence[Size]) -> int:
    """Return the cost of a DRACO group, or of its first frames."""
    elements = [mesh.elements for mesh in meshes]
    return LIMITS.frame * len(meshes) + LIMITS.shown * sum(elements) + LIMITS.element * max(elements, default=0)


def layers_cost(base: Size, frames: int) -> int:
    """Return the cost of a LAYERS group with this base mesh; `base.levels` is the number of decoded levels."""
    products = (base.faces + base.vertices) * frames**2 // 4  # each number of the base's motion is a sum of 3 T
    return base.elements * (LIMITS.moving * frames + LIMITS.element) + products


def laplacian_cost(reference: Size, frames: int, components: int, pairs: int) -> int:
    """Return the cost of a LAPLACIAN group; `pairs` of corners of faces meet at the vertices of its reference."""
    numbers = 3 * frames * (1 + components)
    growing = LIMITS.column * (frames + components) + LIMITS.solved
    products = numbers // 12  # a multiplication for each vertex and number
    alone = LIMITS.pair * pairs + LIMITS.number * numbers + LIMITS.frame * frames
    return reference.elements * (growing + products) + alone


def change_cost(before: Size, added: Size) -> int:
    return LIMITS.element * (before.elements + added.elements)


@dataclass(frozen=True, slots=True)
class Chain:
    """The chunks that lead to a state of the background: their cost and their bytes together."""

    cost: int = 0
    size: int = 0

    def then(self, before: Mesh, after: Mesh, size: int) -> Chain:
        """Return the chain extended by a chunk of `size` bytes. Raises CostlyError if the whole costs too much."""
        longer = Chain(self.cost + change_cost(Size.of(before), Size.of(after)), self.size + size)
        if longer.cost > LIMITS.chain * allowance(longer.size):
            raise CostlyError(f"background: {longer.size} bytes of states that cost {longer.cost} to decode")
        return longer


def check_head(size: int) -> None:
    if size > LIMITS.head:
        raise CostlyError(f"a head of {size} bytes, over {LIMITS.head}")


def check_frames(frames: int, size: int) -> None:
    """Raise CostlyError if the groups of a file of `size` bytes have more frames, over all tracks, than allowed."""
    most = LIMITS.frames + LIMITS.frames_per_byte * size
    if frames > most:
        raise CostlyError(f"{frames} frames of all tracks in a file of {size} bytes, over {most}")


def check_colors(meshes: Sequence[tuple[int, int]], size: int) -> None:
    """Raise CostlyError if colours cost more than allowed; `meshes` are numbers of vertices and frames."""
    cost = LIMITS.painted * sum(vertices * frames for vertices, frames in meshes)
    cost += LIMITS.painting * max((vertices for vertices, _ in meshes), default=0)
    if cost > LIMITS.colors + LIMITS.per_byte * size:
        raise CostlyError(f"colours: {size} bytes that cost {cost} to decode")


def splats_cost(count: int) -> int:
    return LIMITS.splat * count


def check_pictures(texels: int, size: int) -> None:
    """Raise CostlyError if a video with `texels` in all its pictures costs more than `size` bytes may."""
    cost = LIMITS.texel * texels
    if cost > LIMITS.pictures + LIMITS.per_byte * size:
        raise CostlyError(f"pictures: {size} bytes that cost {cost} to decode")


def are_costly(videos: Sequence[tuple[int, int]]) -> bool:
    """Return whether the decoders of videos, given as texels and bytes of each, take more memory than allowed."""
    texels, size = (sum(column) for column in zip(*videos, strict=True))
    return LIMITS.held * texels > LIMITS.videos + LIMITS.per_byte * size


def check_cost(cost: int, size: int, what: str) -> None:
    """Raise CostlyError if decoding costs more than `size` bytes may."""
    if cost > allowance(size):
        raise CostlyError(f"{what}: {size} bytes that cost {cost} to decode, over {allowance(size)}")
