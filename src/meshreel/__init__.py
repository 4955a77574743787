"""meshreel: compression of time-varying meshes into one small .reel file.

`meshreel.encode(sequence, path)` writes the file and needs the extra `encode`; `meshreel.open(path)` returns its frames
as meshes and needs no extra.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from .errors import FormatError, InputError, MeshreelError

if TYPE_CHECKING:
    from . import edit
    from .conversions import as_sequence
    from .decoder.video import Video, open
    from .encoder.sequence import encode
    from .encoder.settings.options import EncoderOptions
    from .encoder.settings.settings import Settings
    from .io.sequence import SequenceOptions, open_sequence
    from .types import Mesh, MeshList, MeshSequence

__version__ = "0.1.0"

__all__ = [
    "EncoderOptions",
    "FormatError",
    "InputError",
    "Mesh",
    "MeshList",
    "MeshSequence",
    "MeshreelError",
    "SequenceOptions",
    "Settings",
    "Video",
    "as_sequence",
    "edit",
    "encode",
    "open",
    "open_sequence",
]

# Imported on first use: decoding never imports the encoder, and Ctrl-C ends the command line before NumPy is loaded.
_LATER = {
    **dict.fromkeys(("Video", "open"), ".decoder.video"),
    **dict.fromkeys(("Mesh", "MeshList", "MeshSequence"), ".types"),
    "EncoderOptions": ".encoder.settings.options",
    "SequenceOptions": ".io.sequence",
    "Settings": ".encoder.settings.settings",
    "as_sequence": ".conversions",
    "edit": ".edit",
    "encode": ".encoder.sequence",
    "open_sequence": ".io.sequence",
}


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        module = import_module(_LATER[name], __name__)
        import_module(".types", __name__).Mesh._repr_png_ = _picture
        return module if _LATER[name].endswith(f".{name}") else getattr(module, name)
    except ModuleNotFoundError as error:
        raise ImportError(f"meshreel.{name} needs the extra `encode`: pip install 'meshreel[encode]'") from error


def _picture(mesh: Mesh) -> bytes | None:
    """Return the picture of a mesh for notebooks, None for one without faces."""
    from dataclasses import replace

    from .geometry.picture import picture

    try:
        return None if mesh.is_empty else picture(mesh)
    except MeshreelError:  # its texture is damaged, or needs PyAV
        return picture(replace(mesh, texture=None))


def __dir__() -> list[str]:
    """List the public names and every module's own; modules below may change without notice."""
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})
