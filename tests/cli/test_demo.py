"""`meshreel demo`: from nothing to a file, its numbers and a picture."""

from __future__ import annotations

import sys

import pytest

import meshreel
from meshreel.capture.procedural import SoftBodiesOptions
from meshreel.cli.console import called_as
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


@pytest.mark.skipif(sys.platform == "win32", reason="a program is found by its mode")
def test_a_command_is_shown_as_this_program_was_called(tmp_path, monkeypatch):
    here, there = tmp_path / "here" / "meshreel", tmp_path / "there" / "meshreel"
    for program in (here, there):
        program.parent.mkdir()
        program.write_text("#!/bin/sh\n")
        program.chmod(0o755)
    monkeypatch.setenv("PATH", str(here.parent))
    monkeypatch.chdir(tmp_path)
    module = str(tmp_path / "meshreel" / "__main__.py")
    calls = {str(here): "meshreel", "there/meshreel": "there/meshreel", module: f"{sys.executable} -m meshreel"}
    for called, shown in (calls | {"pytest": "meshreel"}).items():
        monkeypatch.setattr(sys, "argv", [called])
        assert called_as() == shown


def test_values_that_cannot_be_are_told(run, tmp_path):
    assert failed(run("demo", "-o", tmp_path / "d", "--frames", "0"), "frames", "0")
    assert failed(run("demo", "-o", tmp_path / "d", "--quality", "-1"), "quality", "-1")
    assert failed(run("demo", "-o", tmp_path / "d", "--jobs", "0"), "jobs", "0")
    assert not (tmp_path / "d").exists()
