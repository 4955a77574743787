"""Encodes at several rates share groups, which are found once and only for their interval and options."""

from dataclasses import replace

import pytest
from meshreel_bench.codecs import meshreel as stored
from meshreel_bench.codecs.meshreel import GroupStore, prepare, shared_options
from meshreel_bench.codecs.tvmc import track_sequence

from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.encoder.group.forms import Fidelity
from meshreel.encoder.group.interval import Interval
from meshreel.encoder.paper.recipe import find_groups
from meshreel.encoder.sequence import Encoder, encode
from meshreel.encoder.settings.options import EncoderOptions
from meshreel.types import Mesh, MeshList
from tests.scenes import ball, with_room
from tests.small_options import quick, with_method
from tests.spheres import deforming_sphere

BODY = tuple(soft_bodies(SoftBodiesOptions(frames=4, people=1, spacing=0.04)))
PAPER = quick("paper", group_size=2)


def with_basis(size: int) -> EncoderOptions:
    return with_method(PAPER, displacements=replace(PAPER.method.displacements, basis_size=size))


@pytest.fixture
def analysed(monkeypatch):
    """Numbers of frames of the intervals that were analysed, in order."""
    counts = list[int]()
    monkeypatch.setattr(
        stored, "find_groups", lambda some, *rest: counts.append(len(some.frames)) or find_groups(some, *rest)
    )
    return counts


def test_a_prepared_encoder_analyses_each_interval_once_and_writes_the_bytes_of_an_unprepared_one(analysed, tmp_path):
    sequence = MeshList((*BODY, Mesh.empty()))
    prepared = Encoder(sequence)
    prepare(prepared, with_basis(1))
    assert analysed == [2, 2]  # the empty frame is not analysed
    for size in (1, 2):
        prepared.encode(tmp_path / "prepared.reel", with_basis(size))
        assert analysed == [2, 2]
        encode(sequence, tmp_path / "alone.reel", options=with_basis(size))
        assert (tmp_path / "prepared.reel").read_bytes() == (tmp_path / "alone.reel").read_bytes()
        analysed[2:] = []


def test_an_encoder_that_was_prepared_for_other_options_analyses_again(analysed, tmp_path):
    prepared = Encoder(MeshList(BODY))
    prepare(prepared, PAPER)
    prepared.encode(tmp_path / "a.reel", with_method(PAPER, group_size=4))
    assert analysed == [2, 2, 4]


@pytest.mark.parametrize("codec", ["meshreel", "tvmc"])
def test_bodies_of_a_noisy_scene_are_analysed_once_with_their_noise(codec, monkeypatch, tmp_path):
    """`encode` and the tracking of TVMC reuse the analyses that `prepare` kept."""
    noises = list[float]()
    monkeypatch.setattr(
        stored, "find_groups", lambda interval, *rest: noises.append(interval.noise) or find_groups(interval, *rest)
    )
    options, rolling = quick(preset="paper", group_size=2), with_room([ball(0.5 + 0.35 * t) for t in range(4)])
    prepared = Encoder(MeshList(tuple(rolling)))
    prepare(prepared, options)
    analysed = len(noises)
    assert analysed >= 2 and min(noises) > 0
    for _ in range(2):
        if codec == "meshreel":
            prepared.encode(tmp_path / "a.reel", options)
        else:
            assert track_sequence(prepared, options).groups
    assert len(noises) == analysed


def test_kept_groups_are_those_that_find_groups_returns():
    store, ball = GroupStore(), list(deforming_sphere(3, levels=2))
    options = replace(PAPER.method, target=Fidelity(1e-7, 1.0, 1e-7))  # never reached
    store.find(Interval(ball), options)
    kept, found = store.find(Interval(ball), options), find_groups(Interval(ball), options)
    assert [len(group.frames) for group in kept] == [len(group.frames) for group in found] and len(kept) > 1
    for ours, theirs in zip(kept, found, strict=True):
        assert all(a is b for a, b in zip(ours.frames, theirs.frames, strict=True))
        assert (ours.fitted is None) == (theirs.fitted is None)


@pytest.mark.parametrize(("preset", "coding"), [("paper", "displacements"), ("best", "layers")])
def test_options_that_affect_the_rate_alone_are_not_shared(preset, coding):
    options = quick(preset)
    finer = {coding: replace(getattr(options.method, coding), step=0.05)}
    rates = with_method(replace(options, quality=3.0), **finer)
    assert shared_options(rates) == shared_options(options)
    assert shared_options(replace(options, scene=None)) != shared_options(options)
    finer = with_method(options, group_size=5)
    assert (shared_options(finer) == shared_options(options)) == (preset == "best")
