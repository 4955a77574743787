"""`meshreel capture` of point clouds: a folder becomes frames, all of them, also after an interruption."""

import json
from pathlib import Path

import numpy as np
import pytest

from meshreel.capture.clouds import open_clouds
from meshreel.io.sequence import open_sequence
from tests.capture.test_clouds import POINTS, pcd, ply
from tests.cli.conftest import failed
from tests.geometry.test_points import outwards


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "clouds"
    made.mkdir()
    for number in range(3):
        ply(made / f"cloud_{number}.ply", POINTS + [0.1 * number, 0, 0])
    return made


def test_a_folder_becomes_a_mesh_per_frame_also_after_an_interruption(run, folder, tmp_path):
    out = tmp_path / "meshes"
    row = json.loads(run("capture", folder, "-o", out, "--json").out)
    assert (row["frames"], row["fused"], row["frame_rate"]) == (3, 3, 30.0)
    for number, mesh in enumerate(open_sequence(out)):
        errors = np.linalg.norm(mesh.vertices - [0.5 + 0.1 * number, 1.0, -2.0], axis=1) - 1
        assert np.abs(errors).max() < 0.02 and mesh.is_colored and outwards(mesh) == 1
    before = {path.name: path.read_bytes() for path in out.glob("*.ply")}
    (out / "frame_00001.ply").unlink()
    assert json.loads(run("capture", folder, "-o", out, "--json").out)["fused"] == 1
    assert {path.name: path.read_bytes() for path in out.glob("*.ply")} == before
    assert failed(run("capture", folder, "-o", out, "--voxel", "0.1"), "other inputs or options", "voxel")


def test_lists_patterns_ranges_and_units_are_taken(run, folder, tmp_path):
    files = sorted(folder.glob("*.ply"))
    assert open_clouds([files[2], files[0]])[0].files == (files[2], files[0])
    assert open_clouds([folder / "cloud_*.ply"], frames="1:")[0].files == tuple(files[1:])
    some = ("--unit", "cm", "--frames", ":1", "--fragment", "0")
    assert run("capture", folder, "-o", tmp_path / "out", *some).code == 0
    assert open_sequence(tmp_path / "out")[0].diagonal == pytest.approx(0.02 * 3**0.5, rel=0.01)
    assert failed(run("capture", folder, "-o", tmp_path / "other", "--truncation", "3"), "--truncation")


def test_several_kinds_and_few_points_are_refused(run, folder, tmp_path):
    pcd(folder / "cloud_3.pcd", "binary")
    assert failed(run("capture", folder, "-o", tmp_path / "out"), "holds .pcd, .ply files")
    few = ply(tmp_path / "few.ply", POINTS[:9])
    assert failed(run("capture", few, "-o", tmp_path / "out"), "few.ply: too few points")
    assert not (tmp_path / "out").exists()


def test_what_encode_refuses_names_capture(run, folder, tmp_path):
    assert failed(run("encode", folder, "-o", tmp_path / "x.reel"), "3000 vertices and no faces", "meshreel capture")


def test_a_sensor_turns_faces_to_it_and_bare_points_and_large_units_are_told(run, folder, tmp_path):
    said = run("capture", folder, "-o", tmp_path / "a", "--frames", ":1", "--seen-from", "0.5", "1", "-2")
    assert said.code == 0 and outwards(open_sequence(tmp_path / "a")[0]) < 0.01  # from the middle of the ball
    few = np.concatenate([POINTS, POINTS[:300] * 3])
    points = ply(tmp_path / "b.ply", few[:3000]).parent / "c.npz"
    np.savez(points, points=few)
    said = run("capture", points, "-o", tmp_path / "c", "--voxel", "0.05")
    assert "% of its points got no surface; a --voxel above 0.05" in said.err and "--seen-from" in said.err
    np.savez(tmp_path / "mm.npz", points=1000 * POINTS)
    assert "give --unit mm or cm" in run("capture", tmp_path / "mm.npz", "-o", tmp_path / "d").err


def test_a_list_in_another_order_than_its_numbers_is_told(run, folder, tmp_path):
    files = [folder / f"cloud_{number}.ply" for number in (0, 2, 1)]
    assert "cloud_2.ply: is not in the order of the numbers" in run("capture", *files, "-o", tmp_path / "a").err


def test_a_run_that_made_no_frame_blocks_no_folder(run, folder, tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "capture.json").write_text("{}")
    assert run("capture", folder, "-o", tmp_path / "a").code == 0
    assert "points" in json.loads((tmp_path / "a" / "capture.json").read_text())
