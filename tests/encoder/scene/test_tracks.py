"""Bodies that never touch are tracks of their own also without a background; nothing is lost, one is coded as ever."""

from dataclasses import replace

import numpy as np
import pytest

import meshreel
from meshreel.analysis.survey import survey_sequence
from meshreel.coding.mesh import encode_empty, encode_intra
from meshreel.encoder.group.forms import NO_ERROR, EncodedGroup, Fidelity, target_of
from meshreel.encoder.group.interval import BodyFrames, Interval, NormalisedFrames
from meshreel.encoder.layers.recipe import LayersRecipe
from meshreel.encoder.sequence import Encoder
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.geometry.derived_sequences import DerivedSequence
from meshreel.geometry.topology import concatenate
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.io.write import write_mesh
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList
from tests.encoder.run.test_side_by_side import Scrambled
from tests.metrics.shapes import moved, sphere
from tests.small_bodies import body
from tests.small_options import quick
from tests.spheres import sliding_sphere

BALL = sphere(levels=3)
SMALL = moved(BALL, scale=0.2)
OPTIONS = replace(quick(key_interval=0.3), scene=None)  # of three frames
GONE = Mesh.empty()


def at(x: float, mesh: Mesh = BALL, y: float = 0.0) -> Mesh:
    return moved(mesh, (x, y, 0.0))


def frames_of(*bodies: list[Mesh]) -> MeshList:
    return MeshList(tuple(concatenate(meshes) for meshes in zip(*bodies, strict=True)), 10.0)


def encoded(sequence, path, options=OPTIONS, **more):
    """The video and the summary."""
    summary = Encoder(sequence, **more).encode(path, options)
    video = meshreel.open(path)
    assert summary.frame_count == len(video) == len(sequence) and path.stat().st_size == summary.size
    return video, summary


def surfaces(video) -> list[list[bool]]:
    """Whether each track has a surface, in each frame."""
    return [[not mesh.is_empty for mesh in track] for track in video.tracks]


@pytest.fixture
def plainly(monkeypatch):
    """Bodies coded frame by frame, where it does not matter how: a fraction of the time."""

    def encode(_, interval, *__):
        frames = list(interval.frames)
        if frames[0].is_empty:
            yield EncodedGroup(Form.EMPTY, len(frames), encode_empty(), (), NO_ERROR)
            return
        for mesh in frames:
            yield EncodedGroup(Form.DRACO, 1, encode_intra([mesh], 1e-4, 0), (), Fidelity(0.1, 2.0, 0.3, 60.0))

    monkeypatch.setattr(LayersRecipe, "encode", encode)


TWO = frames_of(body(1), [at(3 + 0.2 * t, mesh) for t, mesh in enumerate(body(3))])


@pytest.fixture(scope="module")
def two(tmp_path_factory):
    """Two bodies that bend and move apart: the path of the file, the video and the summary."""
    path = tmp_path_factory.mktemp("two") / "a.reel"
    return path, *encoded(TWO, path)


def test_bodies_that_move_apart_are_tracks_and_their_union_is_the_frame(two):
    _, video, summary = two
    assert len(video.tracks) == 2 and not video.reader.has_background
    for number, mesh in enumerate(TWO):
        low, high = (video.parts(number)[f"track {k}"].vertices[:, 0] for k in (0, 1))
        assert low.max() < high.min()
        assert surface_errors(mesh, video[number]).symmetric_rms < 2 * OPTIONS.method.target.distance * mesh.diagonal
    assert {group.track for group in summary.groups} == {0, 1}


def test_the_measures_that_are_told_are_those_of_whole_frames(two):
    _, video, summary = two
    errors = [surface_errors(mesh, video[number]) for number, mesh in enumerate(TWO)]
    assert summary.psnr == pytest.approx(np.mean([each.d2_psnr_paper for each in errors]), abs=0.1)
    rms = np.sqrt(np.mean([each.symmetric_rms**2 for each in errors]))
    assert video.metadata["rms_m"] == pytest.approx(rms, rel=0.1)
    assert video.metadata["normal_error_deg"] == pytest.approx(np.mean([each.angle for each in errors]), rel=0.1)


def test_targets_are_relative_to_the_whole_frame(monkeypatch, tmp_path):
    seen: list[float] = []

    def encode(recipe, interval, *_):
        target = target_of(list(interval.frames), recipe.options.target.scaled(interval.larger), 0.0)
        seen.append(target.distance / OPTIONS.method.target.distance)
        return iter([EncodedGroup(Form.EMPTY, len(interval.frames), encode_empty(), (), NO_ERROR)])

    monkeypatch.setattr(LayersRecipe, "encode", encode)
    monkeypatch.setattr(LayersRecipe, "judged", False)
    encoded(frames_of([BALL] * 3, [at(4 + t) for t in range(3)]), tmp_path / "a.reel")
    wanted = np.linalg.norm([6, 2, 2]) / np.linalg.norm([8, 2, 2])  # the first frame and the box of all
    assert seen == pytest.approx([wanted, wanted])


@pytest.mark.usefixtures("plainly")
def test_bodies_that_touch_once_are_one_track_as_long_as_the_key_interval(tmp_path):
    both = concatenate([BALL, at(2, BALL)])
    both = Mesh.of(both.vertices, [*both.faces, [0, 2, 260]])
    apart = concatenate([BALL, at(3)])
    video, _ = encoded(MeshList((apart, both, apart, apart, apart, apart), 10.0), tmp_path / "a.reel")
    assert surfaces(video) == [[True] * 6, [False] * 3 + [True] * 3]
    assert np.ptp(video.tracks[0][2].vertices[:, 0]) == pytest.approx(5, abs=0.1)


@pytest.mark.usefixtures("plainly")
def test_bits_that_come_and_go_are_kept(tmp_path):
    bits = [[at(-2 + t, SMALL, y=3.0)] if t % 2 else [] for t in range(6)]
    sequence = MeshList(tuple(concatenate([BALL, at(5), *some]) for some in bits), 10.0)
    video, _ = encoded(sequence, tmp_path / "a.reel")
    assert len(video.tracks) == 2
    for mesh, shown in zip(sequence, video, strict=True):
        assert len(shown.faces) == len(mesh.faces)
        assert surface_errors(mesh, shown).symmetric_rms < 1e-3


@pytest.mark.usefixtures("plainly")
def test_a_body_keeps_its_track_and_one_that_is_gone_for_an_interval_is_empty(tmp_path):
    """In the second interval the second body is gone and a third has come; in the last one there is no surface."""
    way = [0.2 * t for t in range(12)]
    first = [at(-x) for x in way[:9]] + [GONE] * 3
    second = [at(9 + x) for x in way[:3]] + [GONE] * 3 + [at(9 - x) for x in way[6:9]] + [GONE] * 3
    third = [GONE] * 3 + [at(4, y=9.0)] * 6 + [GONE] * 3
    video, _ = encoded(frames_of(second, third, first), tmp_path / "a.reel")  # the order of faces does not count
    assert surfaces(video) == [
        [True] * 9 + [False] * 3,
        [True] * 9 + [False] * 3,
        [False] * 6 + [True] * 3 + [False] * 3,
    ]
    middles = [[track[k].vertices[:, 0].mean() for k in (0, 4, 7)] for track in video.tracks[:2]]
    assert middles[0] == pytest.approx([9, 4, 4], abs=0.01)
    assert middles[1] == pytest.approx([0, -0.8, -1.4], abs=0.01)
    assert video.tracks[2][7].vertices[:, 0].mean() == pytest.approx(7.6, abs=0.01)


def test_one_body_is_coded_as_whole_frames_are(tmp_path):
    sequence = sliding_sphere(7)
    video, _ = encoded(sequence, tmp_path / "a.reel")
    survey = survey_sequence(sequence)
    assert len(video.tracks) == 1
    wanted = [
        group.payload
        for numbers in survey.intervals(round(OPTIONS.key_interval * sequence.frame_rate))
        for group in OPTIONS.recipe().encode(Interval(NormalisedFrames(DerivedSequence(sequence), survey, numbers)))
    ]
    assert [video.reader.read_chunk(chunk.number) for chunk in video.reader.groups] == wanted


def test_preset_paper_has_one_track(tmp_path):
    video, _ = encoded(TWO, tmp_path / "a.reel", replace(quick("paper", group_size=3), scene=None))
    assert len(video.tracks) == 1


@pytest.mark.usefixtures("plainly")
def test_workers_cut_their_body_out_of_files_that_they_read(tmp_path):
    for number in range(60):
        write_mesh(concatenate([at(-number), at(9), at(9, SMALL, y=3.0)]), tmp_path / f"frame_{number:03}.ply")
    opened, executor = [open_sequence(tmp_path, SequenceOptions(10.0)) for _ in range(2)], Scrambled()
    options = replace(OPTIONS, key_interval=6.0)
    encoded(opened[0], tmp_path / "one.reel", options)
    encoded(opened[1], tmp_path / "many.reel", options, executor=executor)
    assert (tmp_path / "one.reel").read_bytes() == (tmp_path / "many.reel").read_bytes()
    assert max(executor.sizes) < 8000


@pytest.mark.usefixtures("plainly")
def test_a_stopped_encode_continues_with_the_bodies_that_are_missing(tmp_path, monkeypatch):
    sequence = frames_of([BALL] * 6, [at(4 + t) for t in range(6)])
    encoded(sequence, tmp_path / "whole.reel")
    coded, calls = LayersRecipe.encode, list[tuple[int, int]]()

    def stops(recipe, interval, *rest):
        calls.append((interval.first_frame, interval.track))
        if len(calls) == 2:
            raise KeyboardInterrupt
        return coded(recipe, interval, *rest)

    monkeypatch.setattr(LayersRecipe, "encode", stops)
    with pytest.raises(KeyboardInterrupt):
        Encoder(sequence, jobs=1).encode(tmp_path / "a.reel", OPTIONS)
    with pytest.raises(InputError, match="has the 1 intervals that are done"):
        Encoder(sequence, jobs=1).encode(tmp_path / "a.reel", OPTIONS)
    assert Encoder(sequence, jobs=1).encode(tmp_path / "a.reel", OPTIONS, resume=True).continued == 1
    assert calls == [(0, 0), (0, 1), (0, 1), (3, 0), (3, 1)]
    assert (tmp_path / "a.reel").read_bytes() == (tmp_path / "whole.reel").read_bytes()


def test_a_survey_that_has_other_pieces_of_a_frame_is_refused():
    survey = survey_sequence(TWO)
    survey = replace(survey, pieces=tuple((*pieces, pieces[-1]) for pieces in survey.pieces))
    frames = BodyFrames(DerivedSequence(TWO), survey, range(3), 0, ((0, 1, 1),) * 3)
    with pytest.raises(InputError, match="frame 1: has 2 large pieces, in its survey 3; write it again"):
        frames[1]
