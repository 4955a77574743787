"""Groups in rows: key frames, quality without them, distance from them, and where bytes go."""

from __future__ import annotations

import json
from dataclasses import replace
from math import inf

import pytest
from meshreel_bench.groups import at_borders, by_distance, bytes_between, group_records, key_frames, without_keys

from meshreel.metrics.distance import PSNR_CEILING
from tests.container.files import HEADER, small_file


def row(scores, *groups):
    """A row with a masked SSIM for each frame; groups are (frames, bytes) or (frames, bytes, key)."""
    records, first = [], 0
    for frames, size, *key in groups:
        records.append({"first_frame": first, "frames": frames, "bytes": size} | ({"key": key[0]} if key else {}))
        first += frames
    per_frame = [{"ssim_masked": score, "normal_error_deg": 10 - score} for score in scores]
    return {"groups": records, "per_frame": per_frame}


def test_without_a_word_on_keys_the_best_frame_of_each_group_is_left_out():
    found = row([1, 3, 2, 5, 4], (3, 10), (2, 10))
    assert key_frames(found, "ssim_masked") == key_frames(found, "normal_error_deg") == [1, 3]
    assert without_keys(found, "ssim_masked") == pytest.approx((1 + 2 + 4) / 3)


def test_a_key_that_is_known_is_left_out_instead():
    assert without_keys(row([1, 3, 2], (3, 10, 2)), "ssim_masked") == 2


def test_frames_of_their_own_are_keys_unless_all_are():
    assert without_keys(row([1, 2], (1, 5), (1, 5)), "ssim_masked") == 1.5
    assert without_keys(row([9, 1, 2], (1, 5), (2, 5)), "ssim_masked") == 1


@pytest.mark.parametrize(
    ("metric", "best", "value"),
    [("d2_psnr", True, PSNR_CEILING), ("ssim_masked", True, 1.0), ("rms_forward_m", False, inf)],
)
def test_a_value_that_was_not_finite_is_what_it_can_be_of_that_metric(metric, best, value):
    found = {"groups": row([0, 0], (2, 10))["groups"], "per_frame": [{metric: 0.5}, {metric: None}]}
    assert key_frames(found, metric) == [1 if best else 0]
    assert by_distance(found, metric)[0 if best else 1] == (0 if best else 1, value, 1)


def test_what_was_not_measured_is_none():
    assert without_keys(row([1.0], (1, 5)), "d2_psnr") is None
    assert without_keys({"per_frame": []}, "ssim_masked") is None


def test_quality_by_distance_from_the_key_and_its_step_at_a_border():
    found = row([1, 3, 2, 5, 4], (3, 10), (2, 10))
    assert by_distance(found, "ssim_masked") == [(0, 4.0, 2), (1, pytest.approx(7 / 3), 3)]
    assert at_borders(found, "ssim_masked") == 3
    assert at_borders(row([1, 2], (2, 10)), "ssim_masked") is None


def test_bytes_of_a_group_are_spread_over_its_frames():
    found = row([0] * 6, (4, 80), (2, 10))
    assert [bytes_between(found, *span) for span in ((0, 3), (3, 6), (0, 6))] == [60, 30, 90]


@pytest.mark.parametrize(("metadata", "keys"), [({}, [None] * 3), ({"key_frames": [4, 15]}, [4, None, 15])])
def test_records_come_from_the_file_with_keys_where_it_names_them(metadata, keys):
    records = group_records(small_file(replace(HEADER, metadata=json.dumps(metadata))))
    assert [record.get("key") for record in records] == keys
    assert [(record["first_frame"], record["frames"]) for record in records] == [(0, 10), (10, 5), (15, 3)]
    assert records[1] == {"first_frame": 10, "frames": 5, "form": "empty", "bytes": 1}
