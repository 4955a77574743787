"""Progress of a fit or a training, kept in the folder that MESHREEL_NECGS_KEEP names: an encode that was killed
goes on from there, to the same bytes; its time is that of what was left. Without such a folder nothing is kept.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

FOLDER = "MESHREEL_NECGS_KEEP"


def key_of(parts: Iterable[Any]) -> str:
    """Return a name for what is made of these parts: arrays by their bytes, all else by its text."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part.tobytes() if hasattr(part, "tobytes") else repr(part).encode())
    return digest.hexdigest()[:24]


def recall(key: str) -> Any:
    """Return the state kept under this name, or None."""
    import torch

    path = _path(key)
    return None if path is None or not path.exists() else torch.load(path, map_location="cpu", weights_only=True)


def keep(key: str, state: Any) -> None:
    """Keep a state of tensors, numbers, lists and dicts, in the place of one of the same name."""
    import torch

    if (path := _path(key)) is not None:
        path.parent.mkdir(parents=True, exist_ok=True)
        torch.save(state, part := path.with_suffix(f".{os.getpid()}"))
        part.replace(path)


def _path(key: str) -> Path | None:
    folder = os.environ.get(FOLDER)
    return Path(folder, f"{key}.pt") if folder else None
