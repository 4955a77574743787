"""What a chunk may cost to decode: bytes of memory, by the bytes that the chunk has.

Pure arithmetic on numbers that a reader knows before it takes memory; FORMAT.md ("What a file may cost") has it in
words. A cost is an upper bound of the memory and, at some 2 ns for each byte of it, of the time. The player has the
same functions in budget.ts, with the numbers of `LIMITS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ..errors import FormatError
from ..types import Mesh


@dataclass(frozen=True, slots=True)
class Limits:
    """Numbers of the law; costs are in bytes. An element is a face or a vertex of a mesh as it is shown."""

    free: int = 192 << 20  # what any chunk may cost (guess): twice as much as any group of docs/results
    per_byte: int = 8192  # and more for each of its bytes (guess)
    together: int = 96 << 20  # memory that the groups of one frame may take, and per_byte more (guess)
    chain: int = 8  # times as much as a chunk's may the states cost that lead to one of the background (guess)
    head: int = 64 << 20  # bytes of the head, which is read whole (guess): of a file of weeks
    frames: int = 65_535  # of all groups: what one group may have
    frames_per_byte: int = 64  # and more for each byte of the file: a still group has 2 (guess)
    frame: int = 1024  # of a frame, whatever is in it
    # Costs of decoding, from measurement (scripts/worst_files.py), rounded up:
    element: int = 160  # of the largest mesh of a DRACO group; of a LAYERS group; of a change and what it changes
    shown: int = 30  # of an element in each frame of a DRACO group
    moving: int = 30  # of an element in each frame of a LAYERS group
    solved: int = 1600  # of an element of a LAPLACIAN group, whose least squares fill in
    column: int = 20  # of an element in each frame and for each component of a LAPLACIAN group
    pair: int = 100  # of two corners at one vertex of a LAPLACIAN group: a row of the least squares squared
    number: int = 40  # of a number in the basis of a LAPLACIAN group
    colors: int = 96 << 20  # what any chunk of colours may cost, and per_byte more (guess)
    painted: int = 32  # of a vertex with colours, in each frame
    painting: int = 256  # of a vertex of the largest mesh with colours
    pictures: int = 768 << 20  # what the pictures of a chunk, or of a layer, may cost, and per_byte more (guess)
    texel: int = 2  # of a picture that is decoded
    videos: int = 176 << 20  # memory that the decoders of all videos may take, and per_byte more: of 2048 x 2048
    splat: int = 1024  # of a splat, bound in a frame
    audio: int = 256 << 20  # bytes of a chunk of audio, which is held whole: hours (guess)
    held: int = 44  # of a texel of a video, whose decoder keeps up to 16 pictures (H.264; measured: 42)


LIMITS = Limits()


class CostlyError(FormatError):
    """Bytes that would cost more than so many may: a reader refuses them, and an encoder chooses others."""


@dataclass(frozen=True, slots=True)
class Size:
    """Faces and vertices of a mesh, before its midpoint subdivisions."""

    faces: int
    vertices: int
    levels: int = 0

    @classmethod
    def of(cls, mesh: Mesh, levels: int = 0) -> Size:
        """Return the size of a mesh that is to be subdivided `levels` times."""
        return cls(len(mesh.faces), len(mesh.vertices), levels)

    @property
    def elements(self) -> int:
        """Faces and vertices, at most, after the subdivisions; exact for a closed surface."""
        return (self.faces + self.vertices) * 4**self.levels


def allowance(size: int) -> int:
    """Return the cost that a chunk of `size` bytes may have."""
    return LIMITS.free + LIMITS.per_byte * size


def together(size: int) -> int:
    """Return the memory that the groups of one frame may take, which have `size` bytes together."""
    return LIMITS.together + LIMITS.per_byte * size


def draco_cost(meshes: Sequence[Size]) -> int:
    """Return the cost of a DRACO group, or of its first frames."""
    elements = [mesh.elements for mesh in meshes]
    return LIMITS.frame * len(meshes) + LIMITS.shown * sum(elements) + LIMITS.element * max(elements, default=0)


def layers_cost(base: Size, frames: int) -> int:
    """Return the cost of a LAYERS group with this base mesh and as many levels as are decoded."""
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
    """Return the cost of a change of the background."""
    return LIMITS.element * (before.elements + added.elements)


@dataclass(frozen=True, slots=True)
class Chain:
    """The chunks that lead to a state of the background: their cost and their bytes together."""

    cost: int = 0
    size: int = 0

    def then(self, before: Mesh, after: Mesh, size: int) -> Chain:
        """Return the chain with a chunk of `size` bytes more. Raises CostlyError where all of it costs too much."""
        longer = Chain(self.cost + change_cost(Size.of(before), Size.of(after)), self.size + size)
        if longer.cost > LIMITS.chain * allowance(longer.size):
            raise CostlyError(f"background: {longer.size} bytes of states that cost {longer.cost} to decode")
        return longer


def check_head(size: int) -> None:
    """Raise CostlyError if a head has more bytes than it may."""
    if size > LIMITS.head:
        raise CostlyError(f"a head of {size} bytes, over {LIMITS.head}")


def check_frames(frames: int, size: int) -> None:
    """Raise CostlyError if the groups of a file of `size` bytes have more frames, of all tracks, than they may."""
    most = LIMITS.frames + LIMITS.frames_per_byte * size
    if frames > most:
        raise CostlyError(f"{frames} frames of all tracks in a file of {size} bytes, over {most}")


def check_colors(meshes: Sequence[tuple[int, int]], size: int) -> None:
    """Raise CostlyError if colours of so many vertices in so many frames, of each mesh, cost more than they may."""
    cost = LIMITS.painted * sum(vertices * frames for vertices, frames in meshes)
    cost += LIMITS.painting * max((vertices for vertices, _ in meshes), default=0)
    if cost > LIMITS.colors + LIMITS.per_byte * size:
        raise CostlyError(f"colours: {size} bytes that cost {cost} to decode")


def splats_cost(count: int) -> int:
    """Return the cost of so many splats."""
    return LIMITS.splat * count


def check_pictures(texels: int, size: int) -> None:
    """Raise CostlyError if a video of so many texels, of all pictures together, costs more than it may."""
    cost = LIMITS.texel * texels
    if cost > LIMITS.pictures + LIMITS.per_byte * size:
        raise CostlyError(f"pictures: {size} bytes that cost {cost} to decode")


def are_costly(videos: Sequence[tuple[int, int]]) -> bool:
    """Return whether decoders of videos of so many texels, in chunks of so many bytes, take more than they may."""
    texels, size = (sum(column) for column in zip(*videos, strict=True))
    return LIMITS.held * texels > LIMITS.videos + LIMITS.per_byte * size


def check_cost(cost: int, size: int, what: str) -> None:
    """Raise CostlyError if decoding costs more than `size` bytes may."""
    if cost > allowance(size):
        raise CostlyError(f"{what}: {size} bytes that cost {cost} to decode, over {allowance(size)}")
