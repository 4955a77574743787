"""What a codec gives, looked at before and as it is measured: streams, meshes, and the same meshes of another process.

In -> out: what `encode` or `decode` of anybody returned -> the same, or InputError that says what it is.
"""

from __future__ import annotations

import json
import pickle
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from meshreel.errors import InputError
from meshreel.geometry.derived_sequences import DerivedSequence
from meshreel.io.meshes import FARTHEST
from meshreel.metrics.comparison import ComparisonOptions, compare_sequences
from meshreel.metrics.render import Looked, Visible
from meshreel.types import Frames, Mesh, MeshSequence

from .codec import Codec
from .fresh import digest
from .rows import Row


def compared(
    originals: Frames, decoded: Frames, options: ComparisonOptions, seen: Callable[[Mesh], Looked] = Visible
) -> Row:
    """Every metric, as a row has it. Raises InputError where no frame of either has surface."""
    row = compare_sequences(originals, decoded, options, seen).to_row()
    if row["frames_empty"] == row["frames_compared"]:
        raise InputError("no frame has a face with an area; give a sequence with surface")
    return row


def decoder_of(codec: Codec) -> bytes:
    """The codec as its decoder has it: pickled before `encode` has seen a sequence, so that it can keep nothing.

    Raises InputError where it cannot be pickled.
    """
    try:
        return pickle.dumps(codec)
    except Exception as error:  # pickle raises what the codec's class does, too
        raise InputError(f"{codec.name} cannot be pickled ({error}); define its class in a module") from error


def decoded_by(decoder: bytes, data: bytes, codec: str, source: MeshSequence) -> Checked:
    """What the pickled codec decodes. Raises InputError where the number of frames is another."""
    return Checked(pickle.loads(decoder).decode(data), codec, source)


def check_told(codec: Codec, data: object) -> None:
    """Raises InputError where a codec's stream is no bytes, or none, or what it tells of itself is not for JSON."""
    name: Any = codec.name
    if not isinstance(name, str) or not name.strip():
        raise InputError(f"a codec is called {name!r}; give a text that is not empty")
    if type(data) is not bytes:  # the length of other buffers is not that of their bytes
        raise InputError(f"{name} encodes to {_kind(data)}; give bytes")
    if not data:
        raise InputError(f"{name} encodes to no bytes; give at least one, a rate of 0 has no place on a curve")
    try:
        told = json.dumps(codec.options, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"options of {name} are not ready for JSON ({error}): {codec.options}") from error
    if not told.startswith("{"):
        raise InputError(f"options of {name} are {told[:60]}; give a dict")


class Checked(DerivedSequence):
    """What a codec has decoded, a frame at a time: as many frames as there were, each a mesh that can be measured."""

    def __init__(self, decoded: Sequence[Mesh], codec: str, source: MeshSequence) -> None:
        """Raises InputError where the number of frames is another."""
        super().__init__(source)
        if len(decoded) != len(source):
            raise InputError(f"{codec} decodes {len(decoded)} frames of {len(source)}")
        self.codec = codec
        self._decoded = decoded

    def __getitem__(self, index: int) -> Mesh:
        mesh = self._decoded[index]
        if problem := _problem(mesh):
            raise InputError(f"{self.codec} decodes {problem} in frame {index}")
        return mesh


class Confirmed(DerivedSequence):
    """The same, and each frame that is asked for is the one that a fresh process decodes from the bytes alone."""

    def __init__(self, decoded: Checked, digests: Sequence[str]) -> None:
        """Raises InputError where the number of frames is another."""
        super().__init__(decoded)
        if len(digests) != len(decoded):
            raise InputError(f"{decoded.codec} decodes {len(digests)} frames of {len(decoded)} in a fresh process")
        self._checked, self._digests = decoded, digests

    def __getitem__(self, index: int) -> Mesh:
        mesh = self._checked[index]
        if digest(mesh) != self._digests[index]:
            told = f"{self._checked.codec} decodes another frame {index} in a fresh process"
            raise InputError(f"{told}; bytes alone must decide")
        return mesh


def _problem(mesh: object) -> str | None:
    """What keeps a mesh from being measured."""
    if not isinstance(mesh, Mesh):
        return f"{_kind(mesh)}, which is no meshreel.Mesh,"
    for name, array, dtype in (("vertices", mesh.vertices, np.float64), ("faces", mesh.faces, np.int32)):
        found: Any = array
        if not isinstance(found, np.ndarray):
            return f"{name} that are {_kind(found)} and no array (Mesh.of makes one)"
        if found.dtype != dtype or found.ndim != 2 or found.shape[1] != 3:
            return f"{name} of shape {found.shape} and type {found.dtype} (Mesh.of makes (N, 3), {np.dtype(dtype)})"
    if not np.isfinite(mesh.vertices).all():
        return "coordinates that are not finite"
    if len(mesh.vertices) and np.abs(mesh.vertices).max() > FARTHEST:
        return f"coordinates beyond {FARTHEST:g}"
    if len(mesh.faces) and not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        return f"faces of vertices {mesh.faces.min()} to {mesh.faces.max()}, and {len(mesh.vertices)} vertices,"
    return None


def _kind(found: object) -> str:
    return f"a {type(found).__name__}"
