"""What a codec has decoded, looked at before it is measured."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..derived import DerivedSequence
from ..errors import InputError
from ..types import Mesh, MeshSequence


class Checked(DerivedSequence):
    """What a codec has decoded, a frame at a time: as many frames as there were, and coordinates that are finite."""

    def __init__(self, decoded: Sequence[Mesh], codec: str, source: MeshSequence) -> None:
        """Raises InputError where the number of frames is another."""
        super().__init__(source)
        if len(decoded) != len(source):
            raise InputError(f"{codec} decodes {len(decoded)} frames of {len(source)}")
        self._decoded, self._codec = decoded, codec

    def __getitem__(self, index: int) -> Mesh:
        mesh = self._decoded[index]
        if not np.isfinite(mesh.vertices).all():
            raise InputError(f"{self._codec} decodes coordinates that are not finite in frame {index}")
        return mesh
