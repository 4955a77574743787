"""Colour cameras as an encode uses them: calibrated once, for its options, in all that it bakes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.analysis.appearance.calibrate import CalibrationOptions
from meshreel.encoder.group import views
from meshreel.encoder.group.views import Calibrated
from meshreel.encoder.sequence import Encoder
from meshreel.geometry.derived_sequences import DerivedSequence
from meshreel.types import MeshList
from tests.colored_cameras import WRONG, Shown, around, ball
from tests.small_options import quick

QUICK = CalibrationOptions(frames=2, places=800, halvings=(1, 0), rounds=4)


@pytest.fixture(scope="module")
def wrong() -> Shown:
    return ball(around(replace(WRONG, pose_error=0.4), 3, 64), 2)


def test_cameras_are_corrected_in_every_frame(wrong: Shown) -> None:
    sequence = Calibrated(wrong, QUICK)
    assert sequence.colors is sequence.colors
    for given, mended in zip(wrong.colors[1], sequence.colors[1], strict=True):
        assert not np.array_equal(given.camera.extrinsic, mended.camera.extrinsic) and mended.gains != given.gains
        np.testing.assert_array_equal(given.pixels, mended.pixels)
    assert Calibrated(MeshList((wrong[0],)), QUICK).colors is None


@pytest.mark.slow
def test_an_encode_calibrates_once_unless_told_not_to(
    wrong: Shown, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked, honest = [], views.calibrate
    monkeypatch.setattr(views, "calibrate", lambda *given: asked.append(1) or honest(*given))
    options, shown = replace(quick(color="vertices"), scene=None), []
    encoder = Encoder(DerivedSequence(wrong))
    for calibration in (QUICK, QUICK, None):
        look = replace(options.appearance, calibration=calibration)
        encoder.encode(tmp_path / "x.reel", replace(options, appearance=look), resume=False)
        shown.append(meshreel.open(tmp_path / "x.reel")[0].colors)
    assert len(asked) == 1
    np.testing.assert_array_equal(shown[0], shown[1])
    assert (shown[0] != shown[2]).any()
