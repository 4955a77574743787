"""Damaged payloads of every coder: too few or too many bytes are refused, and a changed one harms nothing."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from meshreel.coding.appearance.colors import decode_colors
from meshreel.coding.appearance.splats import decode_splats
from meshreel.coding.background import decode_background, decode_change
from meshreel.coding.group import decode_group
from meshreel.coding.paper.displacements import decode_displacements
from meshreel.errors import FormatError
from meshreel.types import Mesh

from . import test_background as background
from .appearance import test_colors as colors
from .appearance import test_splats as splats
from .decoded_layers import decode_layers
from .layers import test_coder as layers
from .layers import test_patches as patches
from .paper import test_displacements as displacements

Decode = Callable[[bytes], Sequence[Mesh | np.ndarray]]


def of_layers(data: bytes) -> list[Mesh]:
    faces, positions, _ = decode_layers(data)
    return [Mesh(places, faces) for places in positions]


# Each with where damage begins, and how far apart it is further in.
PAYLOADS: dict[str, tuple[bytes, int, int, Decode]] = {
    "displacements": (displacements.DATA, 0, 37, lambda data: [decode_displacements(data, displacements.BASE)]),
    "layers": (layers.CODED.payload, 0, 37, of_layers),
    "patches": (patches.PAYLOAD, len(patches.CODED.payload), 1, lambda data: decode_group(data, patches.FRAMES)),
    "background": (background.WHOLE, 0, 1, lambda data: [decode_background(data)]),
    "change": (background.CHANGE, 0, 1, lambda data: [decode_change(data, background.BEFORE)]),
    "colors": (colors.coded().payload, 0, 1, lambda data: [decode_colors(data, [colors.SHAPE])[0][0]]),
    "splats": (splats.DATA, 0, 37, lambda data: [decode_splats(data, splats.FACES).scales]),
}


@pytest.mark.parametrize("name", [name for name in PAYLOADS if name != "splats"])  # whose layers may be cut
def test_every_truncation_and_a_byte_too_many_are_refused(name: str) -> None:
    data, first, apart, decode = PAYLOADS[name]
    for size in {*range(first + 1, min(first + 200, len(data))), *range(first + 1, len(data), apart)}:
        with pytest.raises(FormatError):
            decode(data[:size])
    for empty in [b""] * (first == 0):
        with pytest.raises(FormatError):
            decode(empty)
    with pytest.raises(FormatError, match="too many" if name != "displacements" else "do not fit"):
        decode(data + b"\0")


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", PAYLOADS)
@pytest.mark.parametrize("flip", [0x01, 0x80, 0xFF])
def test_a_changed_byte_gives_what_can_be_shown_or_a_format_error(name: str, flip: int) -> None:
    data, first, apart, decode = PAYLOADS[name]
    for place in range(first, len(data), apart):
        damaged = bytearray(data)
        damaged[place] ^= flip
        try:
            found = decode(bytes(damaged))
        except FormatError:
            continue
        for part in found:
            assert np.isfinite(part.vertices if isinstance(part, Mesh) else part).all()
            if isinstance(part, Mesh) and not part.is_empty:
                assert part.faces.min() >= 0 and part.faces.max() < len(part.vertices)
