import json
import math
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.geometry.cameras import pack_cameras
from meshreel.metrics.comparison import ComparisonOptions, OriginalFrame, compare_sequences
from meshreel.metrics.distance import PSNR_CEILING, surface_errors
from meshreel.metrics.mpeg import MpegOptions, mpeg_errors
from meshreel.metrics.render import Visible, ssim_normals
from meshreel.metrics.viewpoints import Box, ViewOptions, views_around
from meshreel.types import Mesh, MeshList

from .shapes import noisy, sphere

QUICK = ComparisonOptions(ssim=False)
SMALL = ViewOptions(160, 120)
BODY = sphere(levels=3)
ORIGINALS = MeshList((BODY, BODY, BODY))
DECODED = MeshList(tuple(noisy(BODY, sigma, 1) for sigma in (0.01, 0.02, 0.03)))


def test_aggregates_are_the_mean_and_the_worst_of_the_frames():
    row = compare_sequences(ORIGINALS, DECODED, QUICK).to_row()
    errors = [surface_errors(a, b) for a, b in zip(ORIGINALS, DECODED, strict=True)]
    assert row["d2_psnr_paper"] == pytest.approx(np.mean([e.d2_psnr_paper for e in errors]))
    assert row["d2_psnr_paper_worst"] == errors[2].d2_psnr_paper
    assert row["normal_error_deg"] == pytest.approx(np.mean([e.angle for e in errors]))
    assert row["normal_error_deg_worst"] == errors[2].angle
    assert row["rms_forward_m"] == pytest.approx(np.mean([e.forward.rms for e in errors]))
    assert row["rms_forward_percent"] == pytest.approx(100 * row["rms_forward_m"] / BODY.diagonal)
    assert [f["d1_psnr"] for f in row["per_frame"]] == [e.d1_psnr for e in errors]
    assert row["frames_compared"] == 3 and "ssim" not in row
    assert row["covered_worst"] == errors[2].forward.covered < row["covered"] and row["least_covered_frame"] == 2
    assert row["invented_worst"] == 1 - errors[2].backward.covered


def test_an_original_frame_is_drawn_once_for_several_comparisons_and_changes_no_number(monkeypatch):
    drawn, look = list[Mesh](), Visible.look
    monkeypatch.setattr(Visible, "look", lambda self, *view: (drawn.append(self.mesh), look(self, *view))[1])
    cameras = views_around(Box.of(ORIGINALS), SMALL)
    options = ComparisonOptions(cameras)
    prepared = [OriginalFrame(mesh) for mesh in ORIGINALS]
    plain = compare_sequences(ORIGINALS, DECODED, options)
    drawn.clear()
    assert compare_sequences(prepared, DECODED, options) == plain
    assert len(drawn) == 2 * len(ORIGINALS) * len(cameras)
    drawn.clear()
    assert compare_sequences(prepared, DECODED, options) == plain
    assert len(drawn) == len(ORIGINALS) * len(cameras)  # of what is decoded


def test_ssim_uses_views_around_the_whole_sequence_and_prints_them():
    options = ComparisonOptions(views=SMALL)
    comparison = compare_sequences(ORIGINALS, DECODED, options)
    cameras = views_around(Box.of(ORIGINALS), SMALL)
    expected = [ssim_normals(a, b, cameras) for a, b in zip(ORIGINALS, DECODED, strict=True)]
    row = comparison.to_row()
    assert row["ssim_masked"] == pytest.approx(np.mean([s["ssim_masked"] for s in expected]))
    assert row["ssim"] == pytest.approx(np.mean([s["ssim"] for s in expected]))
    assert row["ssim_masked_worst"] == expected[2]["ssim_masked"]
    assert len(row["cameras"]) == 4 and row["cameras"][0]["intrinsic"]["width"] == 160


def test_a_camera_file_decides_the_views(tmp_path: Path):
    path = tmp_path / "views.json"
    path.write_bytes(pack_cameras(views_around(Box.of(ORIGINALS), SMALL)[:1]))
    comparison = compare_sequences(ORIGINALS, DECODED, ComparisonOptions(cameras=path))
    assert len(comparison.cameras) == 1 and comparison.cameras[0].width == 160


def test_key_frames_can_be_left_out_of_the_means():
    options = ComparisonOptions(ssim=False, keys=(0,))
    row = compare_sequences(ORIGINALS, DECODED, options).to_row()
    frames = row["per_frame"]
    assert row["d2_psnr_paper_without_keys"] == pytest.approx(np.mean([f["d2_psnr_paper"] for f in frames[1:]]))
    assert row["d2_psnr_paper_without_keys"] < row["d2_psnr_paper"]
    assert row["key_frames"] == [0]
    only = compare_sequences(MeshList((BODY,)), MeshList((BODY,)), options).to_row()
    assert "d2_psnr_paper_without_keys" not in only


def test_mpegs_measures_are_there_where_they_are_asked_for():
    options = ComparisonOptions(ssim=False, mpeg=MpegOptions(pixels=32, grid=64))
    row = compare_sequences(ORIGINALS, DECODED, options).to_row()
    last = mpeg_errors(BODY, DECODED[2], Box.of(ORIGINALS), options.mpeg)
    assert (
        row["mpeg_d1_psnr_worst"] == last["mpeg_d1_psnr"]
        and row["ibsm_geometry_psnr_worst"] == last["ibsm_geometry_psnr"]
    )
    assert row["mpeg_d2_psnr"] > row["mpeg_d2_psnr_worst"] == last["mpeg_d2_psnr"]
    assert "ibsm_luma_psnr" not in row


def test_a_row_is_strict_json_even_where_values_are_infinite():
    lossless = compare_sequences(ORIGINALS, ORIGINALS, QUICK)
    assert lossless.frames[0]["d2_psnr_paper"] == math.inf
    row = lossless.to_row()
    assert row["d2_psnr_paper"] == PSNR_CEILING and row["per_frame"][0]["d2_psnr_paper"] is None
    assert json.loads(json.dumps(row, allow_nan=False)) == row


def test_frames_empty_on_both_sides_are_left_out_and_missing_ones_count():
    empty = Mesh.empty()
    row = compare_sequences(MeshList((BODY, empty)), MeshList((DECODED[0], empty)), QUICK).to_row()
    assert row["d2_psnr_paper"] == pytest.approx(surface_errors(BODY, DECODED[0]).d2_psnr_paper)
    assert (row["frames_empty"], row["frames_missing"]) == (1, 0)
    row = compare_sequences(MeshList((BODY, BODY)), MeshList((DECODED[0], empty)), QUICK).to_row()
    assert row["frames_missing"] == 1 and row["d2_psnr_paper_worst"] == 0
    assert row["rms_forward_m"] is None
    row = compare_sequences(MeshList((empty,)), MeshList((empty,)), ComparisonOptions(views=SMALL)).to_row()
    assert row["frames_empty"] == 1 and "d2_psnr_paper" not in row


def test_faces_without_area_are_as_empty_as_no_faces():
    line = Mesh.of(BODY.vertices * [1, 0, 0], BODY.faces)
    row = compare_sequences([line, BODY], [line, BODY], QUICK).to_row()
    assert row["frames_empty"] == 1 and row["diagonal_m"] == BODY.diagonal
    assert "d2_psnr_paper" not in compare_sequences([line], [line], QUICK).to_row()


def test_frames_are_read_one_at_a_time():
    alive: list[int] = []

    def decoded() -> Iterator[Mesh]:
        for i in range(3):
            alive.append(i)
            yield DECODED[i]

    def originals() -> Iterator[Mesh]:
        for i in range(3):
            assert alive == list(range(i))
            yield BODY

    compare_sequences(originals(), decoded(), QUICK)


@pytest.mark.parametrize("flip", [False, True])
def test_sequences_of_unequal_length_are_refused(flip: bool):
    pair = (ORIGINALS, MeshList(DECODED.meshes[:2]))
    with pytest.raises(InputError, match="after 2 frames"):
        compare_sequences(*(pair[::-1] if flip else pair), QUICK)


def test_bad_key_frames_are_refused():
    with pytest.raises(InputError):
        ComparisonOptions(keys=(-1,))
    with pytest.raises(InputError, match="3 frames"):
        compare_sequences(ORIGINALS, DECODED, ComparisonOptions(ssim=False, keys=(3,)))
