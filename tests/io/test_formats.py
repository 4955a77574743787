"""What readers of meshes do with everything that the formats' specifications have: nothing is lost without a word."""

from pathlib import Path

import numpy as np
import pytest

from tests.io import formats
from tests.io.specifications import all_cases

CASES = {f"{case.format} {case.feature}": case for case in all_cases()}


@pytest.mark.parametrize("name", CASES)
def test_all_of_a_format_is_kept_or_named_or_refused(tmp_path: Path, name: str) -> None:
    found = formats.fate(CASES[name], tmp_path)
    assert found.kind != "lost", f"{name}: neither surface nor colours change, and no warning names it"
    assert "Traceback" not in found.words and np.isin(found.kind, formats.KINDS)


def test_the_page_of_formats_says_what_readers_do() -> None:
    assert formats.PAGE.read_text(encoding="utf-8") == formats.filled(), "run python -m tests.io.formats"
