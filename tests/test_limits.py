"""docs/limits.md states the constants of the code."""

import re
from importlib import import_module
from math import prod
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[1] / "docs" / "limits.md"
UNITS = {"KiB": 1 << 10, "MiB": 1 << 20, "GiB": 1 << 30}
OTHERS = ("", "s", "pixels", "texels", "bytes")  # units in which the constants are
ROWS = re.findall(r"^\| ([^|*]+) \| ([\d,]+(?: x \d+)?) ?(\w*) \| `([\w.]+)` \|", PAGE.read_text("utf-8"), re.MULTILINE)


def test_every_row_but_titles_has_a_number_and_a_constant() -> None:
    lines = [line for line in PAGE.read_text("utf-8").splitlines() if line.startswith("| ")]
    titles = [line for line in lines if line.startswith("| **")]
    assert len(ROWS) == len(lines) - len(titles) - 1 > 25  # the first is the table's head
    assert len({constant for *_, constant in ROWS}) == len(ROWS)


@pytest.mark.parametrize(("number", "unit", "constant"), [row[1:] for row in ROWS], ids=lambda value: value)
def test_a_limit_is_the_constant_that_it_names(number: str, unit: str, constant: str) -> None:
    assert unit in UNITS or unit in OTHERS
    stated = prod(int(factor) for factor in number.replace(",", "").split(" x ")) * UNITS.get(unit, 1)
    assert stated == _value(constant)


def _value(constant: str) -> object:
    """Value of a module's constant, or of a field of one, by its dotted name in the package."""
    names = constant.split(".")
    for count in range(len(names) - 1, 0, -1):
        try:
            value: object = import_module(".".join(["meshreel", *names[:count]]))
        except ModuleNotFoundError:
            continue
        for name in names[count:]:
            value = getattr(value, name)
        return value
    raise AssertionError(constant)
