"""Preset `best` from sequence to file: random-access points, executors, what is recorded, odd input."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.encoder.sequence import encode
from meshreel.format.layout import Form
from meshreel.metrics.comparison import ComparisonOptions, compare_sequences
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList
from tests.small_options import quick, resolve_small
from tests.spheres import sliding_sphere

OPTIONS = quick(group_size=2, key_interval=0.2)
BALLS = MeshList(tuple(sliding_sphere(8, step=0.02, levels=4)), frame_rate=20.0)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Eight frames, a random-access point every four: the file and the summary."""
    path = tmp_path_factory.mktemp("best") / "balls.reel"
    return path, encode(BALLS, path, options=OPTIONS)


def test_every_key_interval_has_a_group_that_stands_alone(written):
    path, summary = written
    with meshreel.open(path) as video:
        alone = {group.first_frame for group in video.reader.groups if not group.depends_on}
        assert {0, 4} <= alone
        assert [bool(group.depends_on) for group in video.reader.groups] == [g.predicted for g in summary.groups]
        assert summary.groups[1].predicted and summary.groups[0].form == summary.groups[1].form == Form.LAYERS
        assert len(video) == 8 and video.reader.metadata["preset"] == "best"


def test_an_executor_gives_the_same_bytes(written, tmp_path):
    path, summary = written
    last: dict[str, int] = {}
    with ThreadPoolExecutor(2) as executor:
        again = encode(
            BALLS,
            tmp_path / "b.reel",
            options=OPTIONS,
            executor=executor,
            progress=lambda now: last.update({now.stage: now.done}),
        )
    assert (tmp_path / "b.reel").read_bytes() == path.read_bytes()
    assert replace(again, work={}) == replace(summary, work={})  # each interval reads its frames again
    assert {last[stage] for stage in ("survey", "track", "fit", "code")} == {8}


def test_more_empty_frames_than_a_group_holds_are_more_groups(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.encoder.group.forms.MOST_EMPTY", 100)
    reported: dict[str, int] = {}
    frames = MeshList((Mesh.empty(),) * 150, frame_rate=30.0)
    options = replace(OPTIONS, key_interval=600.0)
    summary = encode(
        frames, tmp_path / "a.reel", options=options, progress=lambda now: reported.update({now.stage: now.done})
    )
    assert [group.frame_count for group in summary.groups] == [100, 50]
    assert (reported["survey"], reported["code"]) == (150, 150)
    with meshreel.open(tmp_path / "a.reel") as video:
        assert len(video) == 150 and video[120].is_empty


def test_the_summary_agrees_with_measurements_of_the_file(written):
    path, summary = written
    with meshreel.open(path) as video:
        row = compare_sequences(BALLS, video, ComparisonOptions(ssim=False)).to_row()
        distances = [surface_errors(a, b).symmetric_rms for a, b in zip(BALLS, video, strict=True)]
        assert video.reader.metadata["d2_psnr_paper"] == pytest.approx(row["d2_psnr_paper"], abs=0.01)
    assert summary.psnr == pytest.approx(row["d2_psnr_paper"], abs=0.01)
    assert max(distances) / BALLS[0].diagonal < 1e-3


def test_without_options_preset_best_is_taken(tmp_path, monkeypatch):
    resolve_small(monkeypatch.setattr)
    encode(MeshList((BALLS[0],)), tmp_path / "a.reel")
    with meshreel.open(tmp_path / "a.reel") as video:
        assert (video.reader.metadata["preset"], video.reader.metadata["quality"]) == ("best", 50)


def test_an_odd_sequence_comes_back_frame_by_frame(tmp_path):
    """Nothing, a ball, a ball ten thousand times its size, one face, nothing."""
    ball = BALLS[0]
    triangle = Mesh.of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    frames = (Mesh.empty(), ball, Mesh.of(1e4 * ball.vertices, ball.faces), triangle, Mesh.empty(), Mesh.empty())
    summary = encode(MeshList(frames), tmp_path / "a.reel", options=quick())
    video = meshreel.open(tmp_path / "a.reel")
    assert [mesh.is_empty for mesh in video] == [frame.is_empty for frame in frames]
    assert [group.form for group in summary.groups][-1] == Form.EMPTY
    for frame, found in zip(frames, video, strict=True):
        if not frame.is_empty:
            assert surface_errors(frame, found).symmetric_rms < 0.01 * frame.diagonal


def test_coordinates_around_a_million_keep_their_millimetres(tmp_path):
    far = np.array([4.5e6, 1.2e2, 5.1e6])
    balls = MeshList(tuple(Mesh.of(ball.vertices + far, ball.faces) for ball in list(BALLS)[:2]))
    encode(balls, tmp_path / "far.reel", options=quick())
    for ball, found in zip(BALLS, meshreel.open(tmp_path / "far.reel"), strict=False):
        assert surface_errors(ball, Mesh.of(found.vertices - far, found.faces)).symmetric_rms < 0.003
