"""Laws of records: unpack undoes pack; bad bytes raise FormatError, values that do not fit InputError."""

import tracemalloc
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.errors import FormatError, InputError
from meshreel.format import kinds
from meshreel.format.kinds import F32, F64, I64, U8, U16, U32, Array, Blob, Bytes, Choice, List, Text
from meshreel.format.layout import PAYLOADS, RECORDS, Layer
from meshreel.format.records import Nested, least_size, pack, unpack, unpack_all
from tests.format.strategies import records

# The run-time type checker draws items of tuples at random, which hypothesis takes for the test's own doing.
pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module")


class Fruit(IntEnum):
    APPLE = 1
    PEAR = 5


@dataclass(frozen=True, slots=True)
class Everything:
    """One field of each kind."""

    small: Annotated[tuple[int, ...], Array(2, U8), ""]
    medium: Annotated[int, U16, ""]
    large: Annotated[int, U32, ""]
    signed64: Annotated[int, I64, ""]
    single: Annotated[float, F32, ""]
    double: Annotated[float, F64, ""]
    short: Annotated[int, kinds.Varint(), ""]
    fruit: Annotated[Fruit, Choice(U8, Fruit), ""]
    fixed: Annotated[bytes, Bytes(3), ""]
    blob: Annotated[bytes, Blob(U16), ""]
    text: Annotated[str, Text(U8), ""]
    layers: Annotated[tuple[Layer, ...], List(U8, Nested(Layer)), ""]
    blobs: Annotated[tuple[bytes, ...], List(kinds.Varint(), Blob(kinds.Varint())), ""]
    rest: Annotated[bytes, kinds.Rest(), ""]


@dataclass(frozen=True, slots=True)
class Counted:
    """A list whose count may lie."""

    values: Annotated[tuple[int, ...], List(U32, I64), ""]


@dataclass(frozen=True, slots=True)
class One:
    """One number of each kind that the tests below need."""

    number: Annotated[int, kinds.Varint(), ""] = 0
    float64: Annotated[float, F64, ""] = 0.0
    text: Annotated[str, Text(U8), ""] = ""
    fruit: Annotated[Fruit, Choice(U8, Fruit), ""] = Fruit.APPLE
    fixed: Annotated[bytes, Bytes(2), ""] = b"ab"
    pair: Annotated[tuple[int, ...], Array(2, U8), ""] = (1, 2)
    layers: Annotated[tuple[Layer, ...], List(U8, Nested(Layer)), ""] = ()


@settings(max_examples=60)
@given(records(Everything))
def test_unpack_undoes_pack(record):
    assert unpack_all(Everything, pack(record)) == record


@pytest.mark.parametrize("record_type", RECORDS + PAYLOADS, ids=lambda record: record.__name__)
def test_unpack_undoes_pack_for_every_record_of_the_layout(record_type):
    @settings(max_examples=25)
    @given(records(record_type))
    def law(record):
        data = pack(record)
        assert unpack(record_type, b"before" + data, 6) == (record, 6 + len(data))
        assert len(data) >= least_size(record_type)

    law()


@settings(max_examples=60)
@given(st.data())
def test_every_truncation_is_a_format_error(data):
    record = data.draw(records(One))
    whole = pack(record)
    cut = data.draw(st.integers(0, len(whole) - 1))
    with pytest.raises(FormatError):
        unpack(One, whole[:cut])


@settings(max_examples=60)
@given(st.binary(max_size=60))
def test_any_bytes_give_a_record_or_a_format_error(data):
    for record_type in (Everything, *RECORDS, *PAYLOADS):
        try:
            record, end = unpack(record_type, data)
        except FormatError:
            continue
        assert pack(record) == data[:end]  # one value, one spelling


def test_an_extra_byte_is_a_format_error():
    with pytest.raises(FormatError, match="1 bytes too many"):
        unpack_all(One, pack(One()) + b"x")


def test_a_lying_count_allocates_nothing():
    data = b"\xff\xff\xff\xff" + bytes(80)
    tracemalloc.start()
    with pytest.raises(FormatError, match=r"Counted\.values: 4294967295 values .* 80 bytes left"):
        unpack(Counted, data)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100_000


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("number", -1),
        ("number", 1 << 53),
        ("number", 1.5),
        ("float64", float("nan")),
        ("float64", float("inf")),
        ("float64", "text"),
        ("text", "x" * 256),
        ("text", "\ud800"),
        ("fruit", 2),
        ("fixed", b"abc"),
        ("pair", (1, 2, 3)),
        ("pair", (1, 256)),
        ("layers", ("no layer",)),
        ("layers", (Layer(1, 1 << 32),)),
        ("layers", (Layer(1, 2),) * 256),
    ],
)
def test_a_value_that_does_not_fit_is_an_input_error_naming_the_field(field, value):
    with pytest.raises(InputError, match=rf"One\.{field}: "):
        pack(One(**{field: value}))


@pytest.mark.parametrize(
    ("record_type", "data", "message"),
    [
        (Layer, b"\x80\x00" + bytes(4), "longer than it needs"),
        (Layer, b"\xff" * 10 + bytes(4), "beyond 53 bits"),
        (Layer, b"\xff" * 9 + b"\x02" + bytes(4), "beyond 53 bits"),
        (One, b"\x00" + b"\x00" * 6 + b"\xf0\x7f", "not finite"),
        (One, bytes(9) + b"\x01\xff", "UTF-8"),
        (One, bytes(10) + b"\x02", "none of the known"),
    ],
)
def test_bytes_with_no_meaning_are_a_format_error(record_type, data, message):
    with pytest.raises(FormatError, match=message):
        unpack(record_type, data)


def test_numbers_are_little_endian():
    assert pack(Layer(300, 0x01020304)) == b"\xac\x02\x04\x03\x02\x01"
