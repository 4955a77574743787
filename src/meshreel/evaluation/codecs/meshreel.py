"""meshreel itself, through the same door as its users."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ...decoder import open as open_video
from ...encoder import encode
from ...presets import preset_options
from ...types import Mesh, MeshSequence
from ..codec import Progress


@dataclass(frozen=True, slots=True)
class MeshreelCodec:
    """A preset at a quality; `basis_size` fixes the number of components m."""

    preset: str = "paper"
    quality: float = 50.0  # 0 to 100
    basis_size: int | None = None
    group_size: int = 10
    centers: int = 2000

    @property
    def name(self) -> str:
        """What rows and plots call it; points with a fixed m are a curve of their own."""
        return f"meshreel {self.preset}" + ("" if self.basis_size is None else " m")

    @property
    def options(self) -> dict[str, Any]:
        """The operating point, ready for JSON."""
        return asdict(self)

    def encode(self, sequence: MeshSequence, progress: Progress | None = None) -> bytes:
        """The .reel file."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "video.reel"
            encode(sequence, path, preset_options(**self.options), progress=progress)
            return path.read_bytes()

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """The frames, from the bytes alone."""
        return open_video(data)
