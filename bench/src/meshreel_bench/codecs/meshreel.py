"""meshreel itself, by the functions that its users call. In -> out: a sequence <-> a .reel file."""

from __future__ import annotations

import tempfile
from dataclasses import asdict, dataclass
from pathlib import Path

from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import EncoderOptions
from meshreel.encoder.settings.settings import Settings
from meshreel.types import MeshSequence

from ..codec import Progress
from .base import TwoSteps
from .groups import prepare, shared_options
from .variants import find_variant


class Prepared(TwoSteps):
    """A codec that first prepares an encoder of meshreel."""

    __slots__ = ()

    @property
    def encoder_options(self) -> EncoderOptions:
        """Options of the encoder."""
        raise NotImplementedError

    @property
    def analysis_key(self) -> str:
        """Equal for options with which `prepare` finds the same."""
        return repr(shared_options(self.encoder_options))

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> Encoder:
        """Return an encoder that has found what operating points share. Raises InputError for unusable frames."""
        encoder = Encoder(sequence, progress=progress)
        prepare(encoder, self.encoder_options)
        return encoder


@dataclass(frozen=True, slots=True)
class MeshreelCodec(Prepared):
    """A preset at a quality; options that are None keep the preset's values; `basis_size` is m; see `.variants`."""

    preset: str = "paper"
    quality: float = 50.0  # 0 to 100
    basis_size: int | None = None
    group_size: int | None = None
    centers: int | None = None
    color: str = "none"  # studies of geometry compare with codecs that have no colours
    color_quality: float | None = None
    texture: int | None = None
    key_interval: float | None = None  # s
    variant: str | None = None

    def __post_init__(self) -> None:
        find_variant(self.variant)

    @property
    def name(self) -> str:
        """The name in rows and plots; colours, their own quality, keys, a fixed m or a variant make another curve."""
        colored = "" if self.color == "none" else f", {self.color}"
        if self.color_quality is not None:
            colored += f", geometry at {self.quality:g}"
        if self.key_interval is not None:
            colored += f", keys each {self.key_interval:g} s"
        changed = "" if self.variant is None else f", {self.variant}"
        return f"meshreel {self.preset}{colored}{changed}" + ("" if self.basis_size is None else " m")

    @property
    def encoder_options(self) -> EncoderOptions:
        """Options of the encoder."""
        chosen = {name: value for name, value in asdict(self).items() if value is not None and name != "variant"}
        return find_variant(self.variant)(Settings(**chosen).resolved())

    def code(self, analysis: Encoder, progress: Progress | None = None) -> bytes:
        """Return the .reel file."""
        analysis.progress = progress
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "video.reel"
            analysis.encode(path, self.encoder_options)
            return path.read_bytes()
