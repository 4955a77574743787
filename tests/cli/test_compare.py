"""`meshreel compare`: every metric of a file or of meshes against the originals."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

import meshreel
from meshreel.capture.rig.rig import read_rig
from meshreel.capture.simulated.simulated_rig import SceneFrame, simulate_rig
from meshreel.container.writer import ReelWriter
from meshreel.geometry.cameras import pack_cameras
from meshreel.io.sequence import open_sequence
from meshreel.io.write import write_mesh
from meshreel.types import Mesh
from tests.capture.depth_scenes import camera
from tests.cli.conftest import FILE, failed
from tests.spheres import sliding_sphere

SMALL = ("--width", "64", "--height", "48")


@pytest.fixture(scope="module")
def decoded(tmp_path_factory):
    """The frames of the golden file as meshes."""
    folder = tmp_path_factory.mktemp("decoded")
    for number, mesh in enumerate(meshreel.open(FILE)):
        write_mesh(mesh, folder / f"{number:02}.ply")
    return folder


def test_a_file_against_its_own_meshes_is_all_but_exact(run, decoded, tmp_path):
    said = run("compare", decoded, FILE, *SMALL, "--json", "--sheet", tmp_path / "a.png", "--keys", "2")
    row = said.row
    assert said.code == 0
    assert row["bytes"] == FILE.stat().st_size and row["mbps"] == row["bytes"] * 20 / 1e6
    assert row["d2_psnr_paper"] > 110 and row["normal_error_deg"] < 0.1 and row["ssim_masked"] > 0.999
    assert (row["frames_compared"], row["frames_empty"], row["frames_missing"]) == (10, 4, 0)
    assert len(row["per_frame"]) == 10 and len(row["cameras"]) == 4
    assert row["key_frames"] == [2] and "d2_psnr_paper_without_keys" in row
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    json.dumps(row, allow_nan=False)


def test_frames_are_chosen_from_a_file_as_from_the_originals(run, decoded):
    row = run("compare", decoded, FILE, "--no-ssim", "--json", "--frames", "2:6").row
    assert row["frames_compared"] == 4 and row["bytes"] == FILE.stat().st_size
    assert row["d2_psnr_paper"] > 110
    assert failed(run("compare", decoded, FILE, "--frames", "2:6", "--splats"), "with the frames of", "meshreel cut")


def with_metadata(path, metadata):
    """The golden file with other metadata, at a path."""
    reader = meshreel.open(FILE).reader
    with ReelWriter(path, replace(reader.header, metadata=json.dumps(metadata))) as writer:
        for chunk in reader.groups:
            ends = np.cumsum([layer.size for layer in chunk.layers]).tolist()
            writer.add_group(chunk.first_frame, chunk.frame_count, reader.read_chunk(chunk.number), ends)
    return path


def test_the_key_frames_that_a_file_names_are_left_out_of_a_mean_of_their_own(run, decoded, tmp_path):
    keyed = with_metadata(tmp_path / "keyed.reel", {"key_frames": [2, 7, -1, 10, True, "3", None, 2.0]})
    row = run("compare", decoded, keyed, "--no-ssim", "--json").row
    assert row["key_frames"] == [2, 7]
    between = [row["per_frame"][i]["rms_forward_m"] for i in (3, 4, 5, 6, 8) if row["per_frame"][i]["diagonal_m"]]
    assert row["rms_forward_m_without_keys"] == pytest.approx(np.mean(between))
    assert run("compare", decoded, keyed, "--no-ssim", "--json", "--keys", "3").row["key_frames"] == [3]
    assert "without key frames" in run("compare", decoded, keyed, "--no-ssim").out


@pytest.mark.parametrize("metadata", [{}, {"key_frames": 3}, {"key_frames": {"2": 2}}])
def test_without_key_frames_the_table_has_no_column_for_them(run, decoded, tmp_path, metadata):
    bare = with_metadata(tmp_path / "bare.reel", metadata)
    assert "without key frames" not in run("compare", decoded, bare, "--no-ssim").out


def test_the_table_has_a_line_a_metric_and_shows_the_views(run, balls):
    said = run("compare", balls, balls, *SMALL)
    assert said.code == 0 and said.err == ""
    for name in (
        "d2_psnr_paper",
        "d1_psnr",
        "d2_psnr",
        "hausdorff95_forward_percent",
        "normal_error_deg",
        "ssim_masked",
    ):
        assert name in said.out
    assert said.out.count("SSIM view") == 4 and "64 x 48 pixels" in said.out
    assert "Mbps" not in said.out and "bytes" not in said.out  # meshes have no rate
    assert run("compare", balls, balls, "--no-ssim", "--quiet").out == ""


def test_a_known_shift_is_measured(run, tmp_path):
    ball = sliding_sphere(1)[0]
    for name, radius in (("a", 1.0), ("b", 1.01)):
        (tmp_path / name).mkdir()
        write_mesh(Mesh.of(radius * ball.vertices, ball.faces), tmp_path / name / "0.ply")
    row = run("compare", tmp_path / "a", tmp_path / "b", "--no-ssim", "--json").row
    assert row["rms_forward_m"] == pytest.approx(0.01, rel=0.02)
    assert row["d2_psnr_paper"] == pytest.approx(20 * np.log10(12**0.5 / 0.01), abs=0.2)
    scaled = run("compare", tmp_path / "a", tmp_path / "b", "--no-ssim", "--scale", "1.01", "--json").row
    assert scaled["rms_forward_m"] < 1e-6


def test_lengths_that_differ_are_reported_with_the_remedy(run, balls):
    assert failed(run("compare", balls, FILE), "3 frames", "10", "--frames")


def test_a_damaged_file_is_reported_by_its_name_and_the_frames(run, decoded, tmp_path):
    (tmp_path / "a.reel").write_bytes(FILE.read_bytes()[:-1])
    said = run("compare", decoded, tmp_path / "a.reel", "--no-ssim")
    assert failed(said, f"{tmp_path / 'a.reel'}: chunk 3 (frames 9 to 9): truncated", "copy the file again")


def test_missing_things_are_reported(run, balls, tmp_path):
    assert failed(run("compare", tmp_path / "none", FILE), "none")
    assert failed(run("compare", balls, tmp_path / "none.reel"), "none.reel")
    assert failed(run("compare", balls, tmp_path / "none"), "none")
    assert failed(run("compare", balls, balls, "--cameras", tmp_path / "none.json"), "none.json")
    assert failed(run("compare", balls, balls, "--keys", "9", "--no-ssim"), "9")


def test_a_reel_file_of_any_name_is_known_by_its_first_bytes(run, decoded, tmp_path):
    (tmp_path / "video.bin").write_bytes(FILE.read_bytes())
    assert run("compare", decoded, tmp_path / "video.bin", "--no-ssim", "--json").row["frames_compared"] == 10


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """A simulated rig of three frames before a plate, and its truth's meshes once more as decoded ones."""
    folder = tmp_path_factory.mktemp("rig")
    plate = Mesh.of([[-3, -3, 0.8], [3, -3, 0.8], [3, 3, 0.8], [-3, 3, 0.8]], [[0, 2, 1], [0, 3, 2]])
    balls = [Mesh.of(0.3 * mesh.vertices, mesh.faces) for mesh in sliding_sphere(3, levels=3)]
    frames = [SceneFrame.of([plate], [ball]) for ball in balls]
    simulate_rig(folder, frames, (camera(size=64), camera("side", 30.0, 64)), 30.0)
    (folder / "larger").mkdir()
    for number, (frame, ball) in enumerate(zip(frames, balls, strict=True)):
        larger = SceneFrame.of([plate], [Mesh.of(ball.vertices * 1.05, ball.faces)])
        write_mesh(larger.mesh, folder / "larger" / f"{number}.ply")
        assert len(larger.mesh.faces) == len(frame.mesh.faces)
    (folder / "two").mkdir()  # the last two frames
    for number in (1, 2):
        shutil.copy(folder / "larger" / f"{number}.ply", folder / "two")
    return folder


def test_with_the_truth_both_are_compared_with_it(run, rig):
    said = run("compare", rig / "truth", rig / "larger", "--no-ssim", "--json", "--truth", rig / "truth")
    found = said.row["truth"]
    assert found["frames"] == [0, 1, 2] and len(found["per_frame"]) == 3
    floor, decoded = found["noise_floor"], found["decoded"]
    assert floor["people_median_m"] < 1e-6 and floor["covered"] == 1 and floor["people_ssim_masked"] > 0.999
    assert 0.003 < decoded["people_median_m"] < 0.016 and decoded["background_median_m"] < 1e-6
    assert decoded["people_ssim_masked"] < 0.99 and "d2_psnr_paper" in said.row
    told = run("compare", rig / "truth", rig / "larger", "--no-ssim", "--truth", rig / "truth", "--truth-every", "2")
    assert "against the truth, 2 frames" in told.out and "people_coverage_rms_m" in told.out


def test_frames_of_a_rig_are_judged_by_its_depth_pictures(run, rig, tmp_path):
    found = run("compare", rig, rig / "larger", "--no-ssim", "--json").row["depth"]
    assert len(found["decoded"]["per_frame"]) == found["originals"]["frames_judged"] == 3
    assert found["originals"]["all_covered"] > 0.95 and found["decoded"]["all_invented"] < 0.05
    said = run("compare", rig, rig / "larger")  # no pictures are rendered unless they are asked for
    assert "ssim" not in said.out and "frames_empty" not in said.out and "frames_compared" in said.out
    assert "ssim" in run("compare", rig, rig / "larger", "--ssim", "--width", "32", "--height", "32").out
    assert "by the depth pictures, 3 frames" in said.out and "another recording" not in said.err
    (tmp_path / "far").mkdir()
    for number, mesh in enumerate(open_sequence(rig / "larger")):
        write_mesh(mesh.at(mesh.vertices + 9.0), tmp_path / "far" / f"{number}.ply")
    told = run("compare", rig, tmp_path / "far", "--no-ssim").err
    assert "far: covers 0 % of what the depth cameras of" in told and "is it of another recording" in told


def test_a_sheet_of_a_rig_is_what_its_cameras_see_of_the_chosen_frames(run, rig, tmp_path):
    """Two cameras of 64 x 64 pixels, two of three frames; an axis may begin with a hyphen."""
    said = run("compare", rig, rig / "truth", "--no-ssim", "--sheet", tmp_path / "a.png", "--sheet-frames", "0", "2")
    assert said.code == 0, said
    with Image.open(tmp_path / "a.png") as sheet:
        assert 4 * 64 < sheet.height < 5 * 64 + 40 and 3 * 64 < sheet.width < 3 * 64 + 200
    said = run("compare", rig, rig / "truth", "--no-ssim", "--up", "-y")
    assert said.code == 0, said


def test_cameras_of_several_sizes_are_refused_before_anything_is_measured(run, rig, tmp_path):
    views = [camera.view for camera in read_rig(rig).cameras]
    (tmp_path / "views.json").write_bytes(pack_cameras([views[0], replace(views[1], width=32, height=32)]))
    command = ("compare", rig, rig / "truth", "--no-ssim", "--sheet", tmp_path / "a.png")
    said = run(*command, "--cameras", tmp_path / "views.json")
    assert failed(said, "several sizes") and not (tmp_path / "a.png").exists()


def test_the_truth_takes_the_frames_of_the_originals(run, rig):
    command = (
        "compare",
        rig / "truth",
        rig / "two",
        "--no-ssim",
        "--json",
        "--truth",
        rig / "truth",
        "--frames",
        "1:3",
    )
    row = run(*command).row["truth"]
    assert row["noise_floor"]["people_median_m"] < 1e-6 and row["frames"] == [0, 1]


def test_a_truth_that_does_not_fit_is_reported(run, rig, balls, tmp_path):
    assert failed(run("compare", rig / "two", rig / "two", "--truth", rig / "truth"), "truth of 3 frames", "have 2")
    assert failed(run("compare", balls, balls, "--truth", tmp_path), "rig.json")
    assert failed(run("compare", balls, balls, "--truth", rig / "truth", "--truth-every", "0"), "--truth-every 0")
    assert failed(run("compare", balls, balls, "--truth", rig), "no clean meshes")


def test_a_rig_is_an_original(run, rig, tmp_path):
    """What `encode` takes, `compare` takes, with what must be known of it."""
    assert run("capture", rig, "-o", tmp_path / "meshes", "--quiet").code == 0
    said = run("compare", rig, tmp_path / "meshes", "--no-ssim", "--json")
    assert said.code == 0 and said.row["frames_compared"] == 3 and said.row["d2_psnr_paper"] > 90
    shutil.copytree(rig, tmp_path / "lossy")
    sorted((tmp_path / "lossy").glob("*/depth/*.png"))[1].unlink()
    said = run("compare", tmp_path / "lossy", tmp_path / "meshes", "--no-ssim", "--json")
    assert "lacks 1 of 3 frames" in said.row["warnings"][0]
