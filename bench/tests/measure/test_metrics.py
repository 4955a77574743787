"""Bridges and slivers; scores of segmentations, by arithmetic."""

import numpy as np
import pytest
from meshreel_bench.datasets import Store
from meshreel_bench.measure.metrics import count_bridges, count_degenerate, score_labels
from meshreel_bench.measure.point import dynamic_ratio, measure_point
from meshreel_bench.names import FLOOR_RATIO, FOUND_NAME
from meshreel_bench.rows import Point

from meshreel.errors import InputError
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh
from tests.shared_data import ROOT
from tests.spheres import sliding_sphere

BALL = sliding_sphere(1, levels=2)[0]
TWO = concatenate([BALL, Mesh.of(BALL.vertices + (3.0, 0, 0), BALL.faces)])


def test_a_triangle_that_joins_two_bodies_is_a_bridge_and_one_without_area_is_counted():
    count = len(BALL.vertices)
    joined = Mesh.of(TWO.vertices, np.concatenate([TWO.faces, [[0, 1, count]]]))
    assert count_bridges(TWO, TWO) == 0 and count_bridges(TWO, joined) == 1 and count_bridges(BALL, BALL) == 0
    flat = Mesh.of(BALL.vertices, np.concatenate([BALL.faces, [[0, 0, 1]]]))
    assert count_degenerate(BALL) == 0 and count_degenerate(flat) == 1


def labels(*numbers):
    return np.array(numbers, bool)


def test_overlap_over_union_mean_and_worst_are_full_for_the_truth_and_frames_without_motion():
    true = [labels(1, 1, 0, 0), labels(1, 1, 1, 0)]
    score = score_labels([labels(1, 0, 1, 0), labels(1, 1, 1, 0)], true)
    assert score["iou_mean"] == pytest.approx(2 / 3) and score["iou_worst"] == pytest.approx(1 / 3)
    assert score["static_called_dynamic"] == 1 / 3  # one of the three static faces of both frames
    true = [labels(1, 0), labels(0, 0)]
    assert score_labels(true, true) == {"iou_mean": 1, "iou_worst": 1, "static_called_dynamic": 0}
    assert score_labels([labels(1, 0)], [labels(0, 0)])["iou_worst"] == 0
    assert score_labels([labels(0, 1)], [labels(1, 1)])["static_called_dynamic"] == 0  # nothing stands there
    with pytest.raises(InputError, match="frame 1: 1 labels for 2 faces"):
        score_labels([labels(1), labels(1)], [labels(1), labels(1, 0)])
    with pytest.raises(InputError, match="only 1 frames"):
        score_labels([labels(1)], [labels(1), labels(1)])
    with pytest.raises(InputError, match="0 frames"):
        score_labels([], [])


def test_the_dynamic_ratio_is_the_share_of_the_vertices_of_faces_that_move():
    square = Mesh.of([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]])
    assert dynamic_ratio([(square, labels(0, 0)), (square, labels(1, 0))]) == 3 / 8


def test_the_share_of_a_recording_whose_truth_nobody_knows_is_that_of_what_is_found(tmp_path):
    if not ROOT.exists():
        pytest.skip(f"benchmark data not present: {ROOT}")
    row = measure_point(Point("living_room", "captured", {}, 8), Store(ROOT, tmp_path))
    assert row.name == FOUND_NAME and list(row.metrics) == [FLOOR_RATIO]
    assert 0.01 < row.metrics[FLOOR_RATIO] < 0.1  # one person in a room
