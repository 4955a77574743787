"""meshreel: time-varying meshes as one small .reel file.

`meshreel.open(path)` gives a Video of meshes; `meshreel.encode(sequence, path)` makes the file. Encoding needs the
extra `encode`; opening does not.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .decoder.video import Video, open
from .errors import FormatError, InputError, MeshreelError
from .types import Mesh, MeshList, MeshSequence

if TYPE_CHECKING:
    from .encoder.options import EncoderOptions
    from .encoder.presets import preset_options
    from .encoder.sequence import encode
    from .io.sequence import open_sequence

__version__ = "0.1.0"

__all__ = [
    "EncoderOptions",
    "FormatError",
    "InputError",
    "Mesh",
    "MeshList",
    "MeshSequence",
    "MeshreelError",
    "Video",
    "encode",
    "open",
    "open_sequence",
    "preset_options",
]

# Found on first use, so that a player never imports the encoder.
_LATER = {
    "EncoderOptions": ".encoder.options",
    "encode": ".encoder.sequence",
    "open_sequence": ".io.sequence",
    "preset_options": ".encoder.presets",
}


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(_LATER[name], __name__), name)
    except ModuleNotFoundError as error:
        raise ImportError(f"meshreel.{name} needs the extra `encode`: pip install 'meshreel[encode]'") from error
