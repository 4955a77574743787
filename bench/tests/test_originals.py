"""Kept pictures of originals: the same bits with and without, whatever the folder has been through."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from meshreel_bench import originals
from meshreel_bench.bench import Bench
from meshreel_bench.measure import measure_point
from meshreel_bench.originals import KeptPictures
from meshreel_bench.rd_rows import RATED
from meshreel_bench.rows import Point

from meshreel.metrics.comparison import ComparisonOptions
from meshreel.metrics.render import Pixels, Visible, Window, window_of
from meshreel.metrics.ssim import ssim_normals
from meshreel.metrics.viewpoints import Box, ViewOptions, parallel_views_around, views_around
from meshreel.types import Mesh
from tests.metrics.shapes import moved, noisy, sphere

BODY = sphere(levels=2)
FRAMES = [noisy(moved(BODY, (0.1 * k, 0, 0)), 0.01, k) for k in range(3)]
SMALL = ViewOptions(160, 120)
CAMERAS = (*views_around(Box.of(FRAMES), SMALL)[:2], *parallel_views_around(Box.of(FRAMES), 100)[:1])
NOWHERE = Mesh.empty()
DECODED = {
    "nearly the same": noisy(BODY, 0.02, 7),
    "larger than the picture": moved(BODY, scale=3.0),
    "around the camera": moved(BODY, scale=30.0),
    "elsewhere": moved(BODY, (0.7, 0.6, 0)),
    "nothing": NOWHERE,
}


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "cache" / "originals"


def kept(folder):
    return sorted(folder.rglob("*.npz"))


def scores(decoded, seen=Visible, around=views_around, views=SMALL):
    """Of all frames against one decoded mesh."""
    cameras = around(Box.of(FRAMES), views)
    return [ssim_normals(mesh, decoded, cameras, seen) for mesh in FRAMES]


def nothing_is_rendered(monkeypatch):
    monkeypatch.setattr(originals, "Visible", None)


@pytest.mark.parametrize("views", [(views_around, SMALL), (parallel_views_around, 120)])
@pytest.mark.parametrize("decoded", DECODED.values(), ids=DECODED)
def test_scores_are_the_same_bit_by_bit_with_and_without(folder, monkeypatch, decoded, views):
    wanted = scores(decoded, Visible, *views)
    assert scores(decoded, KeptPictures(folder), *views) == wanted
    assert len(kept(folder)) == 3 * 4
    nothing_is_rendered(monkeypatch)
    assert scores(decoded, KeptPictures(folder), *views) == wanted


def test_pictures_kept_for_one_decoded_mesh_serve_all_others(folder, monkeypatch):
    scores(DECODED["nearly the same"], KeptPictures(folder))
    wanted = {name: scores(decoded) for name, decoded in DECODED.items()}
    nothing_is_rendered(monkeypatch)
    assert {name: scores(decoded, KeptPictures(folder)) for name, decoded in DECODED.items()} == wanted


@pytest.mark.parametrize("camera", CAMERAS)
def test_a_picture_is_what_is_seen_in_any_window(folder, camera):
    own = window_of([BODY], camera)
    windows = (own, Window(0, camera.height, 0, camera.width), Window(20, 60, 30, 70), Window(0, 3, 0, 3))
    for window in (*windows, Window(0, 0, 0, 0)):
        pixels = Pixels(camera, window)
        seen, wanted = KeptPictures(folder)(BODY).look(pixels), Visible(BODY).look(pixels)
        assert np.array_equal(seen.covered, wanted.covered) and seen.colors.tobytes() == wanted.colors.tobytes()
    assert len(kept(folder)) == 1


def test_another_mesh_camera_or_renderer_has_a_picture_of_its_own(folder, monkeypatch):
    pixels = Pixels(CAMERAS[0], Window(0, 120, 0, 160))
    vertices = BODY.vertices.copy()
    vertices[5, 1] = np.nextafter(vertices[5, 1], 2)
    turned = Mesh.of(BODY.vertices, BODY.faces[:, ::-1])
    meshes = (BODY, Mesh.of(vertices, BODY.faces), turned, Mesh.of(BODY.vertices, BODY.faces[:-1]), NOWHERE)
    nearer = replace(CAMERAS[2], back=CAMERAS[2].back + 1)
    for count, mesh in enumerate(meshes, 1):
        KeptPictures(folder)(mesh).look(pixels)
        assert len(kept(folder)) == count
    for count, camera in enumerate((CAMERAS[1], CAMERAS[2], nearer), len(meshes) + 1):
        KeptPictures(folder)(BODY).look(Pixels(camera, pixels.window))
        assert len(kept(folder)) == count
    monkeypatch.setattr(originals, "_renderer", lambda: "other")
    KeptPictures(folder)(BODY).look(pixels)
    assert len(kept(folder)) == count + 1 and len(kept(folder / "other")) == 1


def test_who_renders_is_known_by_code_libraries_and_processor(monkeypatch, tmp_path):
    fresh = originals._renderer.__wrapped__
    names = {originals._renderer()}
    assert names == {fresh()}
    monkeypatch.setattr(originals, "cpu", lambda: "another")
    names.add(fresh())
    monkeypatch.setattr(originals.np, "__version__", "0.0")
    names.add(fresh())
    changed = tmp_path / "render.py"
    changed.write_text("# changed")
    monkeypatch.setattr(originals, "sources", lambda _package: [changed])
    names.add(fresh())
    assert len(names) == 4


@pytest.mark.parametrize("damage", [b"", b"PK", None, "cut", "flipped"])
def test_a_damaged_file_is_made_again(folder, damage):
    wanted = scores(BODY)
    scores(BODY, KeptPictures(folder))
    for path in kept(folder):
        whole = path.read_bytes()
        middle = len(whole) // 2
        flipped = whole[:middle] + bytes([whole[middle] ^ 1]) + whole[middle + 1 :]
        harmed = {"cut": whole[:middle], "flipped": flipped}.get(damage, damage)
        path.unlink()
        path.mkdir() if harmed is None else path.write_bytes(harmed)
    assert scores(BODY, KeptPictures(folder)) == wanted
    if damage is not None:
        assert all(np.load(path)["window"].shape == (4,) for path in kept(folder))


def test_files_of_other_contents_are_made_again(folder):
    wanted = scores(BODY)
    scores(BODY, KeptPictures(folder))
    short, *others = kept(folder)
    with np.load(short) as found:
        few = dict(found) | {"colors": found["colors"][1:]}
    np.savez(short, **few)
    for path in others:
        np.savez(path, something=np.zeros(3))
    assert scores(BODY, KeptPictures(folder)) == wanted


def test_a_folder_that_is_full_or_cannot_be_written_changes_nothing(folder, monkeypatch):
    wanted = scores(BODY)
    folder.parent.mkdir()
    folder.write_text("a file")
    assert scores(BODY, KeptPictures(folder)) == wanted and folder.read_text() == "a file"
    folder.unlink()
    monkeypatch.setattr(originals, "MOST", 1)
    assert scores(BODY, KeptPictures(folder)) == wanted
    assert len(kept(folder)) == 1  # the first found room


def test_where_there_is_no_room_what_other_renderers_kept_is_removed_first(folder, monkeypatch):
    pixels = [Pixels(camera, Window(0, 100, 0, 100)) for camera in CAMERAS]
    monkeypatch.setattr(originals, "_renderer", lambda: "older")
    KeptPictures(folder)(BODY).look(pixels[0])
    monkeypatch.setattr(originals, "_renderer", lambda: "newer")
    KeptPictures(folder)(BODY).look(pixels[0])
    assert [path.name for path in sorted(folder.iterdir())] == ["newer", "older"]
    monkeypatch.setattr(originals, "MOST", originals._size(folder) * 3 // 4)
    KeptPictures(folder)(BODY).look(pixels[1])
    assert [path.name for path in folder.iterdir()] == ["newer"] and len(kept(folder)) == 2
    KeptPictures(folder)(BODY).look(pixels[2])
    assert len(kept(folder)) == 2


def test_several_may_keep_the_same_at_once(folder):
    wanted = scores(BODY)
    with ThreadPoolExecutor(4) as pool:
        found = list(pool.map(lambda _: scores(BODY, KeptPictures(folder)), range(4)))
    assert found == [wanted] * 4 and len(kept(folder)) == 3 * 4
    assert not [path for path in folder.rglob("*") if path.suffix == ".part"]


def test_a_row_is_the_same_where_pictures_are_kept_and_where_they_are_not(tmp_path, monkeypatch):
    np.savez(tmp_path / "ball.npz", vertices=np.stack([mesh.vertices for mesh in FRAMES]), faces=BODY.faces)
    bench = Bench(tmp_path, "figure6", ComparisonOptions(views=SMALL))
    cached = replace(bench, cache=tmp_path / "rows.cache")
    point = Point("ball", "draco", {"qp": 6}, kind=RATED)
    rows = [measure_point(point, bench), measure_point(point, cached)]
    assert len(kept(cached.cache / originals.KEPT_PICTURES)) == 3 * 4
    nothing_is_rendered(monkeypatch)
    rows.append(measure_point(point, cached))
    judged = [{key: found for key, found in each.items() if _judges(key)} for each in rows]
    assert judged[0] == judged[1] == judged[2] and 0.5 < judged[0]["ssim_masked"] < 1


def _judges(key):
    """Whether a key of a row is about quality or bytes, and not about times, memory and pictures to look at."""
    return not key.startswith(("encode", "decode", "pictures"))
