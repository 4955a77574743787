"""What a head must satisfy beyond its bytes: each guard trips."""

from __future__ import annotations

from dataclasses import replace

import pytest

from meshreel.errors import FormatError
from meshreel.format.checks import check_header, check_index, parse_metadata
from meshreel.format.layout import ChunkKind, Form, Header, Index, IndexEntry, Layer

HEADER = Header(30.0, (0.0, 0.0, 0.0), 1.7, (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), "{}")
STATIC = IndexEntry(ChunkKind.STATIC, Form.DRACO, 0, (), (Layer(9, 0),))
GROUP = IndexEntry(ChunkKind.GROUP, Form.DRACO, 5, (), (Layer(9, 0),))


def test_what_the_encoder_writes_passes():
    check_header(HEADER, 10)
    check_header(replace(HEADER, intervals=(1, 2)), 3)
    check_index(Index((STATIC, replace(GROUP, depends_on=(0,)))))
    check_index(Index((GROUP, STATIC, replace(GROUP, depends_on=(0, 1)), replace(GROUP, depends_on=(2,)))))
    assert parse_metadata('{"quality": 50}') == {"quality": 50}


@pytest.mark.parametrize(
    "change",
    [
        {"frame_rate": 0.0},
        {"frame_rate": -30.0},
        {"scale": 0.0},
        {"scale": 1e300},
        {"origin": (0.0, 1e16, 0.0)},
        {"maximum": (0.5, -0.6, 0.5)},
        {"intervals": (1, 2, 3)},
        {"intervals": (1, 0)},
    ],
)
def test_a_header_that_means_nothing_is_refused(change):
    with pytest.raises(FormatError, match=r"Header\."):
        check_header(replace(HEADER, **change), 3)


@pytest.mark.parametrize(
    ("chunks", "message"),
    [
        ((), "no frames"),
        ((STATIC,), "no frames"),
        ((replace(STATIC, frames=3),), "STATIC of 3 frames"),
        ((replace(GROUP, frames=0),), "GROUP of 0 frames"),
        ((replace(GROUP, layers=()),), "without bytes"),
        ((replace(GROUP, layers=(Layer(3, 0), Layer(0, 0))),), "without bytes"),
        ((GROUP, GROUP, replace(GROUP, depends_on=(0,))), "neither a static chunk"),
        ((GROUP, replace(STATIC, depends_on=(0,))), "that depends on group 0"),
        ((replace(GROUP, depends_on=(0,)),), "neither a static chunk"),
        ((replace(GROUP, depends_on=(1 << 60,)),), "neither a static chunk"),
    ],
)
def test_an_index_that_contradicts_itself_is_refused(chunks, message):
    with pytest.raises(FormatError, match=message):
        check_index(Index(chunks))


@pytest.mark.parametrize(
    "text", ["", "[]", "{", "NaN", '{"a": Infinity}', '{"a": 1e999}', '{"a": "\\ud800"}', "[" * 60000, "1" * 60000]
)
def test_metadata_that_is_no_json_object_is_refused(text):
    with pytest.raises(FormatError, match=r"Header\.metadata"):
        parse_metadata(text)
