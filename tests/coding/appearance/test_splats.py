"""Splats come back within their steps, from every prefix of layers; damage and hostile counts are refused."""

from dataclasses import replace

import numpy as np
import pytest

from meshreel.coding.appearance.splats import decode_splats, encode_splats
from meshreel.coding.entropy import encode_integers
from meshreel.coding.steps import RUNGS
from meshreel.errors import FormatError, InputError
from meshreel.format.budget import LIMITS, CostlyError
from meshreel.format.layout import Gaussians, GaussiansLayer
from meshreel.format.records import pack, unpack
from meshreel.geometry.splats import Splats
from tests.splats import some_splats

FACES, COUNT = 500, 1000
WANTED = some_splats(COUNT, FACES)
IMPORTANCE = np.random.default_rng(1).uniform(0, 1, COUNT)
DATA, ENDS = encode_splats(WANTED, IMPORTANCE)


@pytest.fixture
def one_layer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshreel.coding.appearance.splats.LAYERS", (1.0,))


def matched(found: Splats) -> np.ndarray:
    """Return which of the wanted splats each found one is: the nearest on its face by colour."""
    apart = np.abs(found.colors[:, None] - WANTED.colors[None]).sum(axis=2)
    return (apart + 9 * (found.faces[:, None] != WANTED.faces[None])).argmin(axis=1)


def test_splats_come_back_within_half_a_step() -> None:
    found = decode_splats(DATA, FACES)
    wanted = WANTED.take(matched(found))
    np.testing.assert_array_equal(found.faces, wanted.faces)
    assert np.abs(found.weights - wanted.weights).max() <= 1 / 128
    assert np.abs(found.offsets - wanted.offsets).max() <= 0.55e-4
    assert np.abs(np.log2(found.scales / wanted.scales)).max() <= 1 / 16 + 1e-9
    assert np.abs(found.opacities - wanted.opacities).max() <= 1 / 128
    assert np.abs(found.colors - wanted.colors).max() <= 3 / 256 + 1e-9
    apart = np.abs((found.turns - wanted.turns + np.pi / 2) % np.pi - np.pi / 2)
    is_long = wanted.scales[:, 0] >= 1.1 * wanted.scales[:, 1]
    assert apart[is_long].max() <= np.pi / 128 + 1e-9 and not found.turns[~is_long].any()


@pytest.mark.usefixtures("one_layer")
def test_what_was_decoded_loses_nothing_more() -> None:
    once = decode_splats(encode_splats(WANTED, IMPORTANCE)[0], FACES)
    again = decode_splats(encode_splats(once, np.ones(COUNT))[0], FACES)
    for name in ("faces", "offsets", "scales", "opacities"):
        np.testing.assert_allclose(np.sort(getattr(again, name), axis=0), np.sort(getattr(once, name), axis=0))


def test_each_prefix_of_layers_has_even_splats_that_are_larger() -> None:
    counts = [len(decode_splats(DATA[:end], FACES)) for end in ENDS]
    assert counts == [125, 500, 1000]
    first, whole = decode_splats(DATA[: ENDS[0]], FACES), decode_splats(DATA, FACES)
    np.testing.assert_allclose(first.scales, whole.scales[:125] * 8**0.25)
    assert IMPORTANCE[matched(first)].mean() > 0.8  # the most important of eight neighbours
    assert len(set((first.faces // 50).tolist())) == 10  # everywhere


def test_splats_take_less_than_nine_bytes() -> None:
    assert len(DATA) < 9 * COUNT


@pytest.mark.parametrize(
    ("changed", "named"),
    [
        ({"opacities": np.full(COUNT, np.nan)}, "opacities nan"),
        ({"opacities": np.full(COUNT, 1.5)}, "opacity 1.5"),
        ({"scales": np.full((COUNT, 2), np.inf)}, "scales"),
        ({"scales": np.zeros((COUNT, 2))}, "scales"),
        ({"colors": np.full((COUNT, 3), np.nan)}, "colors"),
    ],
)
def test_values_without_a_code_are_refused(changed: dict[str, np.ndarray], named: str) -> None:
    with pytest.raises(InputError, match=f"splat 0: .*{named}"):
        encode_splats(replace(WANTED, **changed), IMPORTANCE)


def test_no_splats_are_refused() -> None:
    with pytest.raises(InputError, match="no splats"):
        encode_splats(WANTED.take(np.zeros(0, np.int64)), IMPORTANCE[:0])


@pytest.mark.usefixtures("one_layer")
def test_damaged_splats_are_refused() -> None:
    data, _ = encode_splats(WANTED, IMPORTANCE)
    head, offset = unpack(Gaussians, data)
    layer, _ = unpack(GaussiansLayer, data, offset)

    def ints(value: int, rows: int = 1) -> bytes:
        return encode_integers(np.full(rows * COUNT, value, np.int32))

    heads = [
        replace(head, place_bits=0),
        replace(head, turn_bits=15),
        replace(head, offset_level=RUNGS),
        replace(head, count=COUNT - 1),
        replace(head, scale_level=255),
    ]
    layers = [
        replace(layer, count=0),
        replace(layer, count=COUNT + 1),
        replace(layer, faces=ints(1)),  # ends beyond the last face
        replace(layer, faces=ints(-1)),
        replace(layer, places=ints(-1, 2)),
        replace(layer, places=ints(65, 2)),  # more than 1 together
        replace(layer, turns=ints(64)),
        replace(layer, scales=ints(-1, 2)),
        replace(layer, opacities=ints(65)),
        replace(layer, colors=layer.colors[:-1]),
        replace(layer, offsets=layer.offsets + b"\0"),
    ]
    wrong = [pack(one) + pack(layer) for one in heads] + [pack(head) + pack(one) for one in layers]
    for bad in [*wrong, data[:-1], data + b"\0", b"", data[: offset // 2]]:
        with pytest.raises(FormatError):
            decode_splats(bad, FACES)
    with pytest.raises(FormatError):
        decode_splats(data, int(WANTED.faces.max()))


def test_a_hostile_count_is_refused_before_memory_is_taken() -> None:
    count = LIMITS.free // LIMITS.splat + 100_000
    streams = (encode_integers(np.zeros(rows * count, np.int32)) for rows in (1, 2, 1, 1, 2, 1, 3))
    head = replace(unpack(Gaussians, DATA)[0], count=count)
    data = pack(head) + pack(GaussiansLayer(count, *streams))
    assert len(data) < 1000
    with pytest.raises(CostlyError, match="splats"):
        decode_splats(data, FACES)
