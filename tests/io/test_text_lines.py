"""Numbers in lines of text are those of Python's float()."""

import locale
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.io.polygons import Lines, Unreadable

DECIMALS = st.from_regex(r"[+-]?([0-9]{1,25}\.?[0-9]{0,25}|\.[0-9]{1,25})([eE][+-]?[0-9]{1,3})?", fullmatch=True)
PRINTED = st.builds(lambda value, digits: f"{value:.{digits}g}", st.floats(allow_nan=False), st.integers(1, 40))


def read(data: bytes, **how) -> list[float]:
    lines = Lines.of(data)
    return lines.values(np.arange(len(lines)), **how)[0].tolist()


@settings(max_examples=300)
@given(st.lists(st.one_of(DECIMALS, PRINTED), max_size=20))
def test_numbers_are_those_of_float_to_the_bit(words: list[str]) -> None:
    found = read(" ".join(words).encode())
    assert [value.hex() for value in found] == [float(word).hex() for word in words]


@settings(max_examples=300)
@given(st.text(alphabet="0123456789+-.eEinfty", min_size=1, max_size=6))
def test_a_word_is_a_number_where_it_is_one_to_float(word: str) -> None:
    try:
        expected = [float(word).hex()]
    except ValueError:
        with pytest.raises(Unreadable, match=re.escape(f"line 1 ({word!r}) has {word!r} where a number must be")):
            read(word.encode())
    else:
        assert [value.hex() for value in read(word.encode())] == expected


@pytest.mark.parametrize("digits", [*range(12, 22), 800])
def test_halfway_cases_round_to_even(digits: int) -> None:
    for whole in (2**53 + 1, 2**53 + 3, 2**54 + 2, 2**54 + 6):
        for tail in ("", "." + "0" * digits, "." + "0" * digits + "1"):
            assert read(f"{whole}{tail}".encode()) == [float(f"{whole}{tail}")]


def test_a_locale_with_decimal_commas_changes_nothing() -> None:
    before = locale.setlocale(locale.LC_NUMERIC)
    for name in ("de_DE.UTF-8", "de_DE", "German"):
        try:
            locale.setlocale(locale.LC_NUMERIC, name)
        except locale.Error:
            continue
        break
    else:
        pytest.skip("no locale with decimal commas is installed")
    try:
        assert read(b"1.5 1.2345678901234567890123 1.5e300") == [1.5, 1.2345678901234567890123, 1.5e300]
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)


def test_the_place_of_a_bad_word_is_counted_in_any_newlines() -> None:
    with pytest.raises(Unreadable, match=r"line 5 \('7 x/1'\) has 'x' where"):
        read(b"1\r\n2\r3 # c\n\n  7 x/1\n", stop="/")


def test_lines_that_are_chosen_are_read_without_their_first_letters() -> None:
    lines = Lines.of(b"v 1 2\nw 3\nv 4 5 6\nv")
    values, counts = lines.values(np.array([0, 2, 3]), skip=1)
    assert values.tolist() == [1, 2, 4, 5, 6] and counts.tolist() == [2, 3, 0]
