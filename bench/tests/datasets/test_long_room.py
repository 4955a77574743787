"""The long room: made frame by frame, and everything in it changes."""

import numpy as np
import pytest
from meshreel_bench.datasets import long_room
from meshreel_bench.datasets.long_room import DRIFT, EYE, LongRoom
from meshreel_bench.experiments import study
from meshreel_bench.experiments.study import Study, Which
from meshreel_bench.report.verdicts import verdicts
from meshreel_bench.rows import Encoding, Point, Row

ROOM = LongRoom()


def test_a_longer_take_begins_as_a_shorter_one_does():
    assert len(ROOM) == 1800 and len(LongRoom(3)) == 3
    for number in (0, 2):
        first, second = LongRoom(3)[number], ROOM[number]
        assert np.array_equal(first.vertices, second.vertices) and np.array_equal(first.colors, second.colors)
    with pytest.raises(IndexError):
        LongRoom(3)[3]


def test_visitors_go_light_changes_things_move_and_the_sensor_drifts(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(long_room, "NOISE", 0.0)
    empty, later, last = (ROOM[number] for number in (100, 470, 1799))
    assert len(ROOM[45].vertices) > len(empty.vertices) == len(later.vertices) == len(last.vertices)
    assert later.colors.mean() < 0.9 * empty.colors.mean()  # the lamp is out
    still = ((last.vertices - EYE) / (1 + 1799 * DRIFT), (empty.vertices - EYE) / (1 + 100 * DRIFT))
    apart = np.linalg.norm(still[0] - still[1], axis=1)
    assert 0.01 < (apart > 0.2).mean() < 0.2 and np.median(apart) < 1e-9  # a stool and a crate are elsewhere
    drift = np.linalg.norm(last.vertices - EYE, axis=1) / np.linalg.norm(still[0], axis=1)
    assert np.allclose(drift, 1.005, atol=1e-5)


def test_time_a_frame_that_grows_with_the_take_is_a_missed_promise():
    rows = [
        Row(point=Point("a", "b", frames=frames), name="b", frames=frames, encoding=Encoding(s, {}, 100.0, 0.0233))
        for frames, s in ((300, 1.0), (1800, 1.3))
    ]
    promises = tuple(study.Flat(Which("a", "b"), key=key) for key in ("encode_mb", "encode_s_at_rest"))
    memory, seconds = verdicts(Study("", ("a",), (), promises=promises), rows)
    assert memory.met and not seconds.met and "time a frame" in seconds.text
    assert seconds.value == "1 s at 300 frames, 1.3 at 1800: +30.0 %"
