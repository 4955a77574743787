"""Sequences by name: what they are made of, and that other data by the same name are refused."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest
from meshreel_bench.datasets import DEMO, FOURS, Store, checksums
from meshreel_bench.datasets.remesh import SideBySide
from meshreel_bench.datasets.rooms import PROCEDURAL

from meshreel.capture.calibration.colors import REMEMBERED
from meshreel.errors import InputError
from meshreel.types import MeshList
from tests.shared_data import ROOT
from tests.spheres import sliding_sphere

BALLS = sliding_sphere(3, levels=1)


def open_dataset(name, data, frames=None):
    return Store(data).open(name, frames).sequence


@pytest.fixture
def planted(monkeypatch, tmp_path):
    """Data whose checksums are known: a file and a folder."""
    (tmp_path / "performers" / "walker").mkdir(parents=True)
    np.savez(tmp_path / "performers" / "ball.npz", vertices=[BALLS[0].vertices], faces=BALLS[0].faces)
    (tmp_path / "performers" / "walker" / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    known = {
        "performers/ball.npz": hashlib.sha256((tmp_path / "performers" / "ball.npz").read_bytes()).hexdigest(),
        "performers/walker": checksums.checksum(tmp_path / "performers" / "walker"),
    }
    for module in ("datasets", "datasets.checksums"):
        monkeypatch.setattr(f"meshreel_bench.{module}.known_checksums", lambda: known)
    return tmp_path


def test_bodies_stand_side_by_side_each_at_its_own_place():
    still = MeshList(tuple(BALLS[0] for _ in range(5)), 25.0)
    both = SideBySide([(still, (0.0, 0.0, 0.0)), (BALLS, (4.0, 1.0, 0.0))])
    assert len(both) == 3 and both.frame_rate == 25.0
    count = len(BALLS[0].vertices)
    for number, mesh in enumerate(both):
        assert np.array_equal(mesh.vertices[:count], BALLS[0].vertices)
        assert np.allclose(mesh.vertices[count:], BALLS[number].vertices + (4.0, 1.0, 0.0), atol=0)
        assert len(mesh.faces) == 2 * len(BALLS[0].faces) and mesh.faces[len(BALLS[0].faces) :].min() == count
    with pytest.raises(IndexError):
        both[3]


@pytest.mark.parametrize("name", ["ball", "walker"])
def test_data_that_are_not_what_the_name_means_are_refused(planted, name):
    assert len(open_dataset(name, planted)) == 1
    path = planted / "performers" / name
    file = path / "a.obj" if path.is_dir() else path.with_suffix(".npz")
    file.write_bytes(file.read_bytes() + b"\n")
    with pytest.raises(InputError, match=rf"{name}.*SHA-256 .* copy it again, or give your own data another name"):
        open_dataset(name, planted)


def test_a_file_more_or_one_by_another_name_is_other_data(planted):
    folder = planted / "performers" / "walker"
    first = checksums.checksum(folder)
    (folder / "b.obj").write_text("")
    second = checksums.checksum(folder)
    (folder / "b.obj").rename(folder / "c.obj")
    third = checksums.checksum(folder)
    assert len({first, second, third}) == 3
    (folder / REMEMBERED).write_text("{}")  # of an encode, beside a rig's description
    assert checksums.checksum(folder) == third


def test_a_table_of_checksums_is_rewritten_from_the_data(planted):
    table = planted / "checksums.json"
    table.write_text(json.dumps(dict.fromkeys(["performers/walker", "performers/ball.npz"], "")))
    checksums.write_checksums(planted, table)
    assert json.loads(table.read_text()) == checksums.known_checksums()


def test_what_is_missing_is_told(tmp_path):
    with pytest.raises(InputError, match="no sequence 'dancer' below"):
        open_dataset("dancer", tmp_path)
    with pytest.raises(InputError, match="room2 is captured into a folder that is kept"):
        open_dataset("room2", tmp_path)


def test_the_procedural_sequences_need_no_data(tmp_path):
    assert len(open_dataset(DEMO, tmp_path / "none", 2)) == 2
    room = Store(tmp_path / "none", tmp_path / "cache").open(PROCEDURAL, 2)
    assert len(room.sequence) == 2 and len(room.cameras) == 4 and room.scene is not None
    assert room.sequence[1].diagonal == pytest.approx(room.scene.truth[1].mesh.diagonal, rel=0.2)
    again = Store(tmp_path / "none", tmp_path / "cache").open(PROCEDURAL, 2)
    assert np.array_equal(again.sequence[0].vertices, room.sequence[0].vertices)


@pytest.mark.parametrize("four", FOURS)
def test_the_papers_synthetic_scene_in_small(four: str) -> None:
    if not ROOT.exists():
        pytest.skip(f"benchmark data not present: {ROOT}")
    sequence = open_dataset(four, ROOT)
    assert len(sequence) == 10 and sequence.frame_rate == 30.0
    mesh = sequence[9]
    alone = [open_dataset(name, ROOT, 10)[9] for name in FOURS[four]]
    assert len(mesh.faces) == sum(len(body.faces) for body in alone)
    ends = []
    for body, place in zip(alone, FOURS[four].values(), strict=True):
        low, high = body.vertices.min(axis=0) + place, body.vertices.max(axis=0) + place
        assert abs(low[1]) < 0.1  # on one floor
        ends += [low[0], high[0]]
    assert ends == sorted(ends)  # none in another


def test_living_room_is_captured_once(tmp_path):
    if not ROOT.exists():
        pytest.skip(f"benchmark data not present: {ROOT}")
    known = Store(ROOT, tmp_path).open("living_room", 2)
    assert len(known.sequence) == 2 and known.sequence.frame_rate == 8.0 and known.scene is None
    assert (known.cameras[0].width, known.cameras[0].height) == (320, 240)
    file = tmp_path / "living_room" / "meshes" / "frame_00001.ply"
    made = file.stat().st_mtime_ns
    again = Store(ROOT, tmp_path).open("living_room", 3)
    assert len(again.sequence) == 3 and file.stat().st_mtime_ns == made


def test_a_name_may_ask_for_another_order_of_frames(planted):
    forth = [0.0, 1.0, 2.0]
    vertices = [BALLS[0].vertices + (x, 0.0, 0.0) for x in forth]
    np.savez(planted / "own.npz", vertices=vertices, faces=BALLS[0].faces)
    store = Store(planted)
    back = store.open("own-backwards").sequence
    assert [mesh.vertices[0, 0] - BALLS[0].vertices[0, 0] for mesh in back] == pytest.approx(forth[::-1])
    looped = store.open("own-forth-and-back", 8).sequence
    shifts = [mesh.vertices[0, 0] - BALLS[0].vertices[0, 0] for mesh in looped]
    assert shifts == pytest.approx([0, 1, 2, 1, 0, 1, 2, 1])
    assert len(store.open("own-forth-and-back", 2).sequence) == 2


def test_a_sequence_of_ones_own_has_a_digest_and_those_of_the_benchmark_have_none(planted):
    store = Store(planted)
    assert store.digest("ball") is None and store.digest(DEMO) is None and store.digest("room2-forth-and-back") is None
    np.savez(planted / "own.npz", vertices=[BALLS[0].vertices], faces=BALLS[0].faces)
    first = store.digest("own")
    np.savez(planted / "own.npz", vertices=[BALLS[1].vertices], faces=BALLS[0].faces)
    assert first is not None and store.digest("own") not in (None, first)
    assert len(open_dataset(str(planted / "performers" / "walker"), Path("nowhere"))) == 1  # without a checksum
