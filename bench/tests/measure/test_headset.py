"""Playing in a browser that is slowed down: values that agree with each other, on a procedural file."""

import os
import shutil

import pytest
from meshreel_bench.measure.headset import ROOT, WEB, headset_values

from meshreel.errors import InputError

DATA = (ROOT / "conformance/v1/layers.reel").read_bytes()
can_play = (os.environ.get("CHROMIUM") or shutil.which("chromium")) and (WEB / "node_modules/playwright-core").exists()


@pytest.mark.clock  # on a busy machine it plays nothing in its time
@pytest.mark.skipif(not can_play, reason="no chromium, or no node_modules: scripts/setup web")
def test_what_decoding_takes_grows_with_the_throttle():
    fast, slow = (headset_values(DATA, 1, throttle, 24) for throttle in (1, 16))
    for found in (fast, slow):
        assert all(number is not None and number >= 0 for number in found.values())
        assert 0 < found["main_ms"] <= found["main_99_ms"] and found["heap_mb"] > 1 and found["upload_mb_s"] > 0
        assert 0 < found["fps"] < 25.5 and found["shown_share"] <= 1 and found["triangles"] > 100
    # of the page nothing is asked: beside other jobs, DevTools' pauses miss pictures of less than a millisecond
    assert slow["decode_group_ms"] > 2 * fast["decode_group_ms"]


def test_what_is_missing_to_play_is_named(monkeypatch):
    monkeypatch.setenv("PATH", "")
    with pytest.raises(
        InputError, match="node: No such file or directory; run in a checkout, after `scripts/setup web`"
    ):
        headset_values(DATA, 0, 1, 24)
