"""`meshreel demo`: from nothing to a file, its numbers and a picture."""

from __future__ import annotations

import pytest

import meshreel
from meshreel.capture.procedural import SoftBodiesOptions
from tests.cli.conftest import failed


@pytest.mark.usefixtures("quick_presets")
def test_the_demo_leaves_a_file_and_a_picture_and_tells_its_numbers(run, tmp_path, monkeypatch):
    def small(frames, frame_rate, begin):
        return SoftBodiesOptions(frames, frame_rate, 0.06, 1, begin=begin)

    monkeypatch.setattr("meshreel.cli.demo.SoftBodiesOptions", small)
    said = run("demo", "-o", tmp_path / "demo", "--frames", "2", "--no-ssim", "--json")
    assert said.code == 0
    assert said.row["frames"] == 2 and said.row["d2_psnr_paper"] > 40
    assert len(meshreel.open(tmp_path / "demo" / "demo.reel")) == 2
    assert (tmp_path / "demo" / "demo.png").read_bytes()[:4] == b"\x89PNG"


def test_values_that_cannot_be_are_told(run, tmp_path):
    assert failed(run("demo", "-o", tmp_path / "d", "--frames", "0"), "frames", "0")
    assert failed(run("demo", "-o", tmp_path / "d", "--quality", "-1"), "quality", "-1")
    assert failed(run("demo", "-o", tmp_path / "d", "--jobs", "0"), "jobs", "0")
    assert not (tmp_path / "d").exists()
