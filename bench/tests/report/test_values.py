"""Values of rows: metrics, rates, what follows from groups and frames."""

import msgspec
import pytest
from meshreel_bench.experiments.study import D2, NORMALS
from meshreel_bench.names import TSMC, TVMC, title
from meshreel_bench.report.values import REST_S, curve, curve_of, floors, hull_of, rated, value
from meshreel_bench.rows import ColorBytes, Decoding, Encoding, Group, Stream

from bench.tests.made_up import failed, floor, row

ROW = row("ball", "best", 1.0, 60.0)


def with_stream(bytes, **changed):
    return msgspec.structs.replace(ROW, stream=Stream(bytes, **changed))


def test_values_are_metrics_rates_and_times():
    assert value(ROW, "d2_psnr_paper") == 60.0 and value(ROW, "encode_s") == 7.0 and value(ROW, "decode_ms") == 2.0
    assert value(ROW, "encode_s.code") == 7.0 and value(ROW, "encode_s.track") is None and value(ROW, "none") is None
    assert value(failed("ball", "best", "slow"), "mbps") is None


def test_times_at_rest_are_scaled_by_the_loop_beside_them_and_work_has_its_kind():
    assert value(ROW, "encode_s_at_rest") is None and value(ROW, "decode_ms_at_rest") is None
    encoding, decoding = Encoding(7.0, reference_s=2 * REST_S, work={"frames fitted": 1.5}), Decoding(5.0, 2.0, 9.0)
    made = msgspec.structs.replace(ROW, encoding=encoding, decoding=decoding)
    assert value(made, "encode_s_at_rest") == pytest.approx(3.5) and value(made, "decode_ms_at_rest") is None
    assert value(made, "work.frames fitted") == 1.5 and value(made, "work.frames read") is None


def test_the_model_of_an_hour_knows_one_worker_and_loses_time_where_intervals_are_few():
    def busy(workers, interval):
        encoding = Encoding(1.0, stages_s={"survey": 0.1, "code": 0.9})
        return value(msgspec.structs.replace(ROW, encoding=encoding), f"efficiency.{workers}.{interval}")

    assert value(ROW, "efficiency.8.60") is None and busy(1, 60) == pytest.approx(1.0)
    assert 1 > busy(8, 60) > busy(100, 60) > busy(100, 120) > 0.5
    assert busy(108_000, 108_000) < 1e-4  # one interval: all others wait for it


def test_the_model_of_cores_knows_what_an_interval_does_side_by_side():
    def busy(cores, seconds):
        encoding = Encoding(1.0, stages_s={"track": 0.4, "measure": 0.5, "code": 0.1})
        return value(msgspec.structs.replace(ROW, encoding=encoding), f"cores.{cores}.{seconds}")

    assert busy(1, 4) == pytest.approx(1.0) == busy(1, 60)
    assert busy(8, 4) == busy(8, 1) == pytest.approx(1 / 8 / (0.4 / 2 + 0.5 / 8 + 0.1))
    assert busy(15, 60) == pytest.approx(1.0) and busy(8, 60) == pytest.approx(15 / 16)  # so many intervals
    assert busy(30, 60) == pytest.approx(1 / 2 / (0.4 / 2 + 0.5 / 2 + 0.1))


def test_a_background_counts_as_sent_every_ten_seconds():
    made = with_stream(1000, coded_frames=10, background_bytes=400)
    assert value(made, "mbps_background_10s") == pytest.approx(8 * (600 * 30 / 10 + 40) / 1e6)


def test_ssim_without_keys_leaves_out_key_frames_and_takes_the_best_frame_for_one_that_is_not_named():
    frames = {"ssim_masked": [0.5] * 4 + [0.9] + [0.5] * 5}
    made = msgspec.structs.replace(ROW, per_frame=frames)
    named = msgspec.structs.replace(made, stream=Stream(9, 10, 0, [Group(0, 10, "layers", 9, 0)]))
    unnamed = msgspec.structs.replace(made, stream=Stream(9, 10, 0, [Group(0, 10, "layers", 9)]))
    assert value(unnamed, "ssim_masked_without_keys") == pytest.approx(0.5)
    assert value(named, "ssim_masked_without_keys") == pytest.approx(4.9 / 9)


def test_bytes_of_a_group_are_spread_over_its_frames():
    groups = [Group(0, 40, "layers", 400), Group(40, 20, "layers", 100)]
    made = msgspec.structs.replace(ROW, frames=60, stream=Stream(500, 60, 0, groups))
    assert value(made, "second_half_over_first") == pytest.approx((100 + 100) / 300)
    assert value(ROW, "second_half_over_first") is None


def test_groups_with_surface_have_a_mean_length_and_the_largest_step_at_their_borders_counts():
    groups = [Group(0, 6, "layers", 9), Group(6, 4, "draco", 9), Group(0, 10, "empty", 1)]
    frames = {"d2_psnr_paper": [60.0, 70.0, 60.0, 60.0, 60.0, 60.0, 62.0, 61.0, None, 61.0]}
    made = msgspec.structs.replace(ROW, stream=Stream(100, 10, 30, groups, ColorBytes(background=20)), per_frame=frames)
    assert (value(made, "group_frames"), value(made, "draco_groups"), value(made, "border_step_db")) == (5, 1, 2)
    assert value(made, "background_mbps") == pytest.approx(made.mbps / 2)
    assert value(ROW, "border_step_db") is None and value(floor("ball"), "group_frames") is None


def test_a_curve_has_the_points_of_its_name_and_larger_is_better():
    rows = [row("ball", "best", 1.0, 60.0), row("ball", "best", 2.0, 65.0), row("ball", "draco", 3.0, 66.0)]
    found = curve(rows, "best", NORMALS)
    assert list(found.qualities) == pytest.approx([-6.0, -5.0]) and list(found.rates) == pytest.approx([1, 2], rel=1e-4)
    assert len(hull_of(rows, ("best", "draco", "none"), D2).rates) >= 2


def test_points_with_a_fixed_basis_are_a_curve_by_what_else_is_chosen():
    options = {"basis_size": 3, "quality": 50.0, "centers": 2000}
    assert curve_of(msgspec.structs.replace(ROW, name="meshreel paper m", options=options)) == TSMC
    more = msgspec.structs.replace(ROW, name="meshreel paper m", options=options | {"centers": 1000})
    assert curve_of(more) == f"{TSMC}, centers 1000" and title(f"{TSMC}, centers 1000").startswith("TSMC (")
    assert title(TVMC) == "TVMC*" and title("zipmesh") == "zipmesh"


def test_rows_without_a_rate_are_on_no_curve_and_the_floor_is_that_of_the_truth():
    rows = [ROW, failed("ball", "best", "slow"), floor("ball", d2_psnr_paper=59.0, ssim=None)]
    assert rated(rows, "ball") == [ROW] and floors(rows) == {"d2_psnr_paper": 59.0}


def test_a_rate_of_a_key_counts_once_what_a_chain_begins_with():
    colors = ColorBytes(vertices=2400, atlas=600, pictures=[9000, 100, 300], base=2000)
    found = row("person", "codec", 1.0, 40.0, frames=3, stream=Stream(21_400, 3, colors=colors))
    geometry = 21_400 - 12_400 - 2000
    wanted = 2400 + 600 + 9000 + 119 * 200 + 2000 + geometry * 120 / 3
    assert value(found, "mbps.120") == pytest.approx(wanted * 8 * 30 / 120 / 1e6)
    assert value(found, "texture_mbps.32") == pytest.approx((9600 + 31 * 200) * 8 * 30 / 32 / 1e6)
    assert value(found, "vertices_mbps.120") == pytest.approx(2400 * 2 / 1e6)
    assert value(found, "color_share") == pytest.approx(12_400 / 21_400)
    several = row("room", "codec", 1.0, 40.0, stream=Stream(1000, 10, colors=ColorBytes(background=500, chains=2)))
    assert value(several, "mbps.120") == several.mbps and value(several, "texture_mbps.120") is None
    assert value(several, "background_color_mbps") == pytest.approx(0.5 * several.mbps)
    assert value(row("person", "codec", 1.0, 40.0), "color_mbps") is None
