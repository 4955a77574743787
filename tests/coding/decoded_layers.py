"""A group of form `layers` decoded by itself, without patches."""

import numpy as np

from meshreel.coding.layers.coder import LayersState, decode_records, read_layers
from meshreel.errors import FormatError


def decode_layers(
    data: bytes, levels: int | None = None, previous: LayersState | None = None
) -> tuple[np.ndarray, np.ndarray, LayersState]:
    """Return the faces, the positions in every frame, and the state that predicts the next group.

    With `levels`, decode at most that many subdivisions; `data` may then end after them.
    """
    records = read_layers(data, levels)
    if levels is None and records.end != len(data):
        raise FormatError(f"layers: {len(data) - records.end} bytes too many")
    return decode_records(records, previous)
