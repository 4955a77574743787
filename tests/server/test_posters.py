"""Posters: cached per version of a file, drawn without blocking other requests, with a transparent background."""

from __future__ import annotations

import asyncio
import io
import sys
import time
import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from meshreel.server import painter as pictures
from meshreel.server import posters
from meshreel.server.app import make_app
from meshreel.server.library import Library
from meshreel.types import Mesh
from tests.coding.draco_bombs import cloud, reel_of

POSTER = "/posters/walk.reel.png"


CALLS = "import itertools\ncount = itertools.count(1)\ndef poster(path): return b'%d' % next(count)"
HANG = "import re\ndef poster(path): re.match('(a+)+$', 'a' * 64 + 'b')"  # in one call, which lets no other thread run
FILL = "def poster(path): return bytes(3 * 2**30)"


def test_a_poster_is_drawn_once_until_its_file_changes(client, folder, painter):
    painter(CALLS)
    first = client.get(POSTER)
    tag = first.headers["etag"]
    assert first.content == client.get(POSTER).content == b"1"
    unchanged = client.get(POSTER, headers={"If-None-Match": tag})
    assert (unchanged.status_code, unchanged.content, unchanged.headers["etag"]) == (304, b"", tag)
    scene = (folder.parent / "outside.reel").read_bytes()
    (folder / "walk.reel").write_bytes(scene)
    changed = client.get(POSTER, headers={"If-None-Match": tag})
    assert changed.status_code == 200 and changed.headers["etag"] != tag and changed.content == b"2"


def test_without_a_renderer_there_is_a_plain_tile_that_is_not_kept(client, painter):
    painter("import sys\nsys.modules['PIL'] = None\nposter = painter.poster")
    tile = client.get(POSTER)
    assert tile.headers["content-type"] == "image/svg+xml" and tile.headers["cache-control"] == "no-store"
    assert "etag" not in tile.headers


def test_no_more_posters_are_kept_than_said(painter, monkeypatch):
    painter(CALLS)
    monkeypatch.setattr(posters, "MOST_POSTERS", 2)
    kept = posters.Posters()
    for tag in "abcd":
        asyncio.run(kept.of(Path("walk.reel"), tag))
    assert [tag for _, tag in kept._known] == ["c", "d"]


@pytest.mark.parametrize(
    "fault",
    [HANG, "def poster(path): __import__('os').abort()", "def poster(path): raise KeyError"]
    + ["def poster(path): __import__('os').write(3, b'x')", "def poster(path): return bytes(2**21)"]
    + [pytest.param(FILL, marks=pytest.mark.skipif(sys.platform != "linux", reason="no limit of memory is kept to"))],
    ids=["never ends", "crashes", "raises", "answers out of turn", "answers too much", "takes all memory"],
)
def test_a_file_that_breaks_the_painter_has_a_plain_tile_and_others_have_theirs(painter, monkeypatch, folder, fault):
    painter(f"{fault}\nbad = poster\ndef poster(path): return bad(path) if path.name == 'walk.reel' else b'good'")
    monkeypatch.setattr(posters, "PATIENCE", 0.5)
    drawn, began = posters.Posters(), time.monotonic()
    for _ in range(20):  # a second trial would take its time again
        assert asyncio.run(drawn.of(folder / "walk.reel", "tag")) is None
    assert asyncio.run(drawn.of(folder / "cut.reel", "tag")) == b"good"
    assert time.monotonic() - began < 20
    drawn.close()
    assert asyncio.run(drawn.of(folder / "walk.reel", "tag")) is None


def test_a_painter_that_died_between_two_posters_costs_the_next_file_nothing(painter, folder):
    painter(CALLS)
    drawn = posters.Posters()
    assert asyncio.run(drawn.of(folder / "walk.reel", "tag")) == b"1"
    drawn._painter._process.kill()
    drawn._painter._process.wait()
    assert asyncio.run(drawn.of(folder / "cut.reel", "tag")) == b"1"  # of a new process
    drawn.close()


def test_a_poster_for_which_no_process_can_be_had_now_is_drawn_later(painter, monkeypatch, folder):
    def full(*_, **__):
        raise OSError(24, "Too many open files")

    painter(CALLS)
    drawn = posters.Posters()
    with monkeypatch.context() as patched:
        patched.setattr(posters.subprocess, "Popen", full)
        assert asyncio.run(drawn.of(folder / "walk.reel", "tag")) is None
    assert asyncio.run(drawn.of(folder / "walk.reel", "tag")) == b"1"
    drawn.close()


def test_more_posters_than_said_wait_for_none(painter, monkeypatch, folder):
    painter(HANG)
    monkeypatch.setattr(posters, "MOST_WAITING", 2)
    monkeypatch.setattr(posters, "LONGEST_WAIT", 0.2)

    async def ask():
        drawn = posters.Posters()
        try:
            for tag in "abc":
                assert await drawn.of(folder / "walk.reel", tag) is None
            assert len(drawn._drawn) == 2
        finally:
            drawn.close()

    asyncio.run(ask())


def test_files_are_answered_however_many_wait_for_a_poster(live, folder, player, painter):
    gate = folder.parent / "gate"
    painter(f"""
import pathlib, time
def poster(path):
    while not pathlib.Path({str(gate)!r}).exists():
        time.sleep(0.01)
    return b"picture"
""")
    address = live(make_app(Library(folder), player))

    def fetch(path):
        with urllib.request.urlopen(f"{address}{path}", timeout=60) as answer:
            return answer.read()

    with ThreadPoolExecutor(64) as pool:
        waiting = [pool.submit(fetch, "posters/walk.reel.png") for _ in range(60)]  # more than a server has threads
        try:
            time.sleep(1)
            began = time.monotonic()
            assert fetch("files/walk.reel") == (folder / "walk.reel").read_bytes() and fetch("style.css")
            assert time.monotonic() - began < 1 and not any(poster.done() for poster in waiting)
        finally:
            gate.touch()
        assert {poster.result(60) for poster in waiting} == {b"picture"}


@pytest.mark.parametrize("method", ["sequential", "kd-tree"])
def test_a_bomb_that_draco_believes_costs_its_limits_and_the_server_answers(
    live, folder, player, painter, monkeypatch, method
):
    """The bomb goes to Draco as it is, as it did before its claims were read."""
    (folder / "walk.reel").write_bytes(cloud(200_000_000, method))
    painter("import DracoPy\ndef poster(path): DracoPy.decode(path.read_bytes())")
    monkeypatch.setattr(posters, "PATIENCE", 2.0)
    address, seconds = live(make_app(Library(folder), player)), []

    def fetch(path):
        began = time.monotonic()
        with urllib.request.urlopen(f"{address}{path}", timeout=60) as answer:
            kind = answer.headers["content-type"]
        return kind, time.monotonic() - began

    with ThreadPoolExecutor(1) as pool:
        poster = pool.submit(fetch, "posters/walk.reel.png")
        while not seconds or not poster.done():  # Draco may give up at once for want of memory
            seconds.append(fetch("style.css")[1])
            time.sleep(0.05)
    kind, took = poster.result()
    assert kind == "image/svg+xml" and took < 2 + 8  # the process starts within some of them
    assert max(seconds) < 1
    assert fetch("posters/walk.reel.png")[1] < 1  # it is not tried again


def test_a_hostile_file_in_a_folder_that_is_served_has_a_plain_tile(client, folder):
    (folder / "walk.reel").write_bytes(reel_of(cloud(200_000_000, "kd-tree")))
    assert client.get(POSTER).headers["content-type"] == "image/svg+xml"


@pytest.mark.parametrize("towards", [1, -1])
def test_a_room_is_seen_from_where_it_is_open(towards):
    """A wall that faces +z or -z, whose right half (+x, as seen from +z) is lower than its left."""
    pytest.importorskip("scipy")
    image = pytest.importorskip("PIL.Image")
    corners = np.array([[-1, 0, 0], [1, 0, 0], [1, 0.5, 0], [-1, 2, 0]], dtype=np.float64)
    faces = np.array([[0, 1, 2], [0, 2, 3]], dtype=np.int32)
    wall = Mesh.of(corners, faces if towards > 0 else faces[:, ::-1])
    picture = np.asarray(image.open(io.BytesIO(pictures.picture(wall, "y"))))
    assert picture.shape == (pictures.HEIGHT, pictures.WIDTH, 4) and set(np.unique(picture[..., 3])) == {0, 255}
    left, right = np.split(picture[..., 3] > 0, 2, axis=1)
    assert (left.sum() > 1.5 * right.sum()) if towards > 0 else (right.sum() > 1.5 * left.sum())


def test_a_poster_stands_on_its_feet():
    pytest.importorskip("scipy")
    image = pytest.importorskip("PIL.Image")
    corners = np.array([[-2, 0, 0], [2, 0, 0], [0, 1, 0.1], [0, 1, -0.1]], dtype=np.float64)  # broad feet at y = 0
    hut = Mesh.of(corners, np.array([[0, 1, 2], [1, 0, 3], [0, 2, 3], [2, 1, 3]], dtype=np.int32))
    turned = {"y": corners, "-y": corners * [1, -1, -1], "z": corners[:, [0, 2, 1]] * [1, -1, 1]}
    drawn = [image.open(io.BytesIO(pictures.picture(Mesh.of(v, hut.faces), up))) for up, v in turned.items()]
    shapes = [np.asarray(picture)[..., 3] > 0 for picture in drawn]
    for shape in shapes:
        rows = np.flatnonzero(shape.any(axis=1))
        assert shape[rows[-4:]].sum() > 5 * shape[rows[:4]].sum()
        assert (shape == shapes[0]).mean() > 0.99


def test_a_poster_has_the_players_light_and_clay():
    eye, up, height = np.tile([0.0, 0, 2], (4, 1)), np.array([0.0, 1, 0]), np.array([0.5, 0.5, 0.5, 0.01])
    right, left, below, sole = pictures.lit(
        np.array([[1.0, 0, 0.2], [-1, 0, 0.2], [0, -1, 0.2], [0, -1, 0.2]]), eye, up, height
    )
    assert right[1] > left[1] + 0.2 and below[1] > sole[1] + 0.1 > 0.1
    front = pictures.CLAY * pictures.lit(np.array([[0.0, 0, 1]]), eye[:1], up, height[:1])
    assert np.allclose(
        front, [0.74, 0.73, 0.70], atol=0.02
    )  # as the test of the player's shader has it: 0.87 of the colour
