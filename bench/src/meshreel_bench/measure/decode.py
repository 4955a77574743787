"""Decoding as it is timed: from bytes, in a fresh process, the best of three passes over all frames.

The meshes that are measured are those of the fresh process: nothing but the bytes decides them.
"""

from __future__ import annotations

import pickle
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from meshreel.errors import InputError
from meshreel.types import Mesh, Texture

from ..rows import Decoding
from .clock import peak_rss_mb, reference_s
from .worker import in_fresh_process

PASSES = 3
SLOW_MS = 2000.0  # a frame: a codec that takes so long in all passes so far is not timed again (guess)


def decoded_apart(decoder: bytes, data: bytes, numbers: Sequence[int], frames: int) -> tuple[Decoding, list[Mesh]]:
    """Return times, and the decoded meshes of some frames. Raises InputError where another number of frames comes."""
    times, *meshes = in_fresh_process(_decode, decoder, data, tuple(numbers), frames)
    return times, meshes


def _decode(decoder: bytes, data: bytes, numbers: Sequence[int], frames: int) -> Iterator[Decoding | Mesh]:
    """Yield times, then the meshes; `decoder` was pickled before its codec has seen a sequence."""
    decode: Callable[[bytes], Sequence[Mesh]] = pickle.loads(decoder).decode
    start = time.process_time()
    opened = decode(data)
    if not hasattr(opened, "__getitem__") or len(opened) == 0:
        raise InputError(f"decodes a {type(opened).__name__} without frames, of {frames}")
    opened[0]
    first_ms = 1e3 * (time.process_time() - start)
    passes = [_pass_ms(decode, data)]
    while len(passes) < PASSES and len(passes) * passes[0] < SLOW_MS:
        passes.append(_pass_ms(decode, data))
    peak_mb, vertices, kept = peak_rss_mb(), list[int](), dict[int, Mesh]()
    reference = min(reference_s() for _ in range(PASSES))  # the best, as of the passes
    shown = decode(data)
    for number, mesh in enumerate(shown):
        vertices.append(len(_checked(mesh, number).vertices))
        if number in numbers:  # textures are decoded when they are asked for: here
            kept[number] = mesh if mesh.texture is None else replace(mesh, texture=Texture.of(mesh.texture.pixels))
    if len(vertices) != frames:
        raise InputError(f"decodes {len(vertices)} frames of {frames}")
    yield Decoding(first_ms, min(passes), float(np.mean(vertices)), peak_mb, reference)
    yield from (kept[number] for number in numbers)


def _pass_ms(decode: Callable[[bytes], Sequence[Mesh]], data: bytes) -> float:
    """Return the time of a frame, with its share of opening: lazy and eager decoders are timed alike."""
    start = time.process_time()
    count = sum(1 for _ in decode(data))
    return 1e3 * (time.process_time() - start) / max(count, 1)


def _checked(mesh: Mesh, number: int) -> Mesh:
    """Return the mesh. Raises InputError where it cannot be measured."""
    if not isinstance(mesh, Mesh):
        raise InputError(f"decodes a {type(mesh).__name__}, which is no meshreel.Mesh, in frame {number}")
    if not np.isfinite(mesh.vertices).all():
        raise InputError(f"decodes coordinates that are not finite in frame {number}")
    if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        raise InputError(f"decodes faces of vertices that are not there in frame {number}")
    return mesh
