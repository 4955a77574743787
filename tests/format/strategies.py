"""Hypothesis strategies for any record, made from its declaration."""

from hypothesis import strategies as st

from meshreel.format import kinds
from meshreel.format.records import Nested, record_fields


def records(record_type: type) -> st.SearchStrategy[object]:
    """Valid records of a type."""
    return st.builds(record_type, **{field.name: values(field.kind) for field in record_fields(record_type)})


def values(kind: kinds.Kind) -> st.SearchStrategy:
    """Valid values of a kind."""
    match kind:
        case kinds.Number():
            return numbers(kind)
        case kinds.Varint():
            return st.one_of(st.integers(0, 300), st.integers(0, 2**53 - 1))
        case kinds.Choice():
            return st.sampled_from(kind.values)
        case kinds.Bytes():
            return st.binary(min_size=kind.size, max_size=kind.size)
        case kinds.Blob() | kinds.Rest():
            return st.binary(max_size=40)
        case kinds.Text():
            return st.text(max_size=20)
        case kinds.Array():
            return st.tuples(*[values(kind.item)] * kind.count)
        case kinds.List():
            return st.lists(values(kind.item), max_size=5).map(tuple)
        case Nested():
            return records(kind.record)
    raise AssertionError(kind)


def numbers(kind: kinds.Number) -> st.SearchStrategy:
    """All numbers that fit."""
    bits = 8 * kind.least
    if kind.code in "fd":
        return st.floats(width=bits, allow_nan=False, allow_infinity=False)
    if kind.code.isupper():
        return st.integers(0, 2**bits - 1)
    return st.integers(-(2 ** (bits - 1)), 2 ** (bits - 1) - 1)
