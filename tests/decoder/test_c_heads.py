"""Heads of the golden files with fields at the edges of what they may be: C++ opens what Python opens, and no other."""

import shutil

import pytest

from tests.decoder.c_abi import DAMAGED, CError, CVideo
from tests.format.heads import FILES, heads, verdict

pytestmark = pytest.mark.skipif(shutil.which("cmake") is None, reason="needs CMake, of the extra dev")
QUICK = ("cut.reel", "empty.reel", "splats/splats.reel")
CASES = [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in FILES]


def of_c(head: bytes) -> str:
    """Return what `verdict` returns of Python."""
    try:
        with CVideo(head) as video:
            return f"{video.info.frames} {video.info.tracks}"
    except CError as error:
        assert error.status == DAMAGED
        return "refused"


@pytest.mark.parametrize("name", CASES)
def test_a_head_is_opened_by_the_c_library_where_python_opens_it(name: str):
    verdicts = [(verdict(head), of_c(head), head[14:].hex()) for head in heads(name)]
    assert [found for found in verdicts if found[0] != found[1]] == []
    opened = sum(known != "refused" for known, _, _ in verdicts)
    assert len(verdicts) > 900 and 0.2 < opened / len(verdicts) < 0.6
