"""What a notebook shows of a video and of a mesh, and videos in other processes."""

import gc
import io
import multiprocessing
import os
import pickle
import re
import struct
import subprocess
import sys
import threading
import zlib
from base64 import b64decode
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from html import unescape
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

import numpy as np
import pytest

import meshreel
from meshreel.container.sources import BytesSource
from meshreel.decoder import video as module
from meshreel.decoder.page import player_page
from meshreel.errors import FormatError, InputError
from meshreel.geometry.picture import NOTEBOOK
from meshreel.types import Texture
from tests.container.test_http import LARGE
from tests.golden import GOLDEN, frame_record
from tests.metrics.shapes import sphere

SCENE = GOLDEN / "scene.reel"
TEXTURED = sorted((GOLDEN / "colored").glob("*.reel"))


def test_a_notebook_shows_the_player_with_the_file_in_a_frame():
    shown = meshreel.open(SCENE)._repr_html_()
    assert "scene.reel, 14 frames" in shown
    (frame,) = re.findall(r'srcdoc="([^"]*)"', shown)
    page = unescape(frame)
    assert page == player_page(SCENE.read_bytes(), "scene.reel") == meshreel.open(SCENE)._page()
    (recording,) = re.findall(r', "([A-Za-z0-9+/=]+)"\);\n</script>', page)
    assert b64decode(recording) == SCENE.read_bytes()
    assert not re.search(r'(src|href)="', page)  # it fetches nothing


def test_no_name_of_a_file_ends_the_script_or_a_tag():
    page = player_page(b"", "</script><b>'\"")
    assert page.count("</script>") == 1 and "<b>" not in page


def test_a_large_file_is_a_table_that_says_how_to_play_it(monkeypatch):
    monkeypatch.setattr(module, "INLINE", 1000)
    shown = meshreel.open(SCENE)._repr_html_()
    assert "<table>" in shown and "14 frames" in shown and "meshreel play" in shown and "srcdoc" not in shown


def test_a_closed_file_is_a_table_that_says_so_and_short_reads_are_continued(monkeypatch):
    video, pread = meshreel.open(SCENE), os.pread
    monkeypatch.setattr("os.pread", lambda file, length, offset: pread(file, min(length, 1000), offset))
    assert video.reader.source.get_bytes(3, 2500) == SCENE.read_bytes()[3:2503]
    video.close()
    with pytest.raises(InputError, match=r"scene.reel: cannot be read at byte 0: it is closed"):
        video.reader.source.get_bytes(0, 10)
    assert "it is closed; open it again" in video._repr_html_() and "<table>" in video._repr_html_()


@pytest.fixture
def shown(monkeypatch, tmp_path):
    """Pages that a browser was asked for, all of which lie in `tmp_path`."""
    opened: list[Path] = []
    monkeypatch.setattr("webbrowser.open", lambda url: opened.append(Path(url2pathname(urlsplit(url).path))) or True)
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setattr("meshreel.decoder.video.LOADED", 0.0)
    return opened


def test_show_opens_a_page_that_is_whole(shown):
    video = meshreel.open(SCENE)
    video.show()
    assert [page.name for page in shown] == ["scene.html"] and shown[0].read_text() == video._page()


@pytest.mark.parametrize("end", ["close", "with", "collected", "again", "at"])
def test_what_show_wrote_is_removed_with_the_video(shown, tmp_path, end):
    video = meshreel.open(SCENE)
    threads = threading.active_count()
    video.show()
    assert shown[0].exists()
    if end == "close":
        video.close()
        video.close()
    elif end == "with":
        with video:
            pass
    elif end == "again":
        video.show()
        assert shown[1].exists() and len(list(tmp_path.iterdir())) == 1
        video.close()
    else:
        other = video.at(0) if end == "at" else None
        del video
        gc.collect()
        if other is not None:
            other.show()
            other.close()
    assert not list(tmp_path.iterdir()) and threading.active_count() == threads


def test_a_page_lasts_until_a_browser_has_had_time_to_load_it(shown, monkeypatch, tmp_path):
    slept = list[float]()
    monkeypatch.setattr("meshreel.decoder.video.LOADED", 7.0)
    monkeypatch.setattr("time.sleep", lambda seconds: slept.append(seconds) or shown[0].read_bytes())
    meshreel.open(SCENE).show()
    gc.collect()
    assert len(slept) == 1 and 0 < slept[0] <= 7 and not list(tmp_path.iterdir())


def test_the_end_of_a_process_removes_what_show_wrote(tmp_path):
    code = "import meshreel, sys; from meshreel.decoder import video; video.LOADED = 0; import webbrowser, tempfile\n"
    code += "tempfile.tempdir = sys.argv[2]; webbrowser.open = lambda url: not print(url)\n"
    code += "v = meshreel.open(sys.argv[1]); v.show()"
    told = subprocess.run([sys.executable, "-c", code, SCENE, tmp_path], capture_output=True, text=True, check=False)
    assert "scene.html" in told.stdout and not list(tmp_path.iterdir())


@pytest.mark.usefixtures("shown")
def test_without_a_browser_the_page_stays_for_its_reader(monkeypatch, tmp_path):
    monkeypatch.setattr("webbrowser.open", lambda _: False)
    with pytest.raises(InputError, match=r"no browser was found: open .*recording.html"):
        meshreel.open(SCENE.read_bytes()).show()
    gc.collect()
    assert len(list(tmp_path.rglob("recording.html"))) == 1


def test_show_of_a_closed_file_writes_nothing(shown, tmp_path):
    video = meshreel.open(SCENE)
    video.close()
    with pytest.raises(InputError, match="it is closed; open it again"):
        video.show()
    assert not shown and not list(tmp_path.iterdir())


def pixels_of(data: bytes) -> np.ndarray:
    """The pixels of a PNG as `picture` writes it."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    size = struct.unpack(">I", data[33:37])[0]
    rows = np.frombuffer(zlib.decompress(data[41 : 41 + size]), np.uint8).reshape(NOTEBOOK[1], 1 + 4 * NOTEBOOK[0])
    return rows[:, 1:].reshape(*NOTEBOOK[::-1], 4)


def test_the_picture_of_a_mesh_has_its_colors_and_an_empty_one_has_none():
    ball = sphere(0.5, 3)
    red = replace(ball, colors=np.tile(np.array([255, 0, 0], np.uint8), (len(ball.vertices), 1)))
    seen = pixels_of(meshreel.Mesh._repr_png_(red) or b"")
    assert seen[..., 0].max() > 200 and seen[..., 1:3].max() == 0
    assert meshreel.Mesh.empty()._repr_png_() is None


def test_the_picture_of_a_mesh_whose_texture_cannot_be_read_has_the_colors_of_its_vertices():
    def refuse() -> np.ndarray:
        raise InputError("textures need the extra `color`")

    ball = sphere(0.5, 2)
    green = replace(ball, colors=np.tile(np.array([0, 255, 0], np.uint8), (len(ball.vertices), 1)))
    uv = np.zeros((len(ball.faces), 3, 2), np.float32)
    assert meshreel.Mesh._repr_png_(replace(green, uv=uv, texture=Texture(refuse))) == meshreel.Mesh._repr_png_(green)


def last_frame(video: meshreel.Video) -> object:
    return frame_record(video[-1])


@pytest.mark.parametrize("way", [str, Path, Path.read_bytes, lambda path: BytesSource(path.read_bytes())])
def test_a_video_goes_to_another_process(way):
    video = meshreel.open(way(SCENE)).at(layers=1)
    again = pickle.loads(pickle.dumps(video))
    assert again.layers == 1 and repr(again) == repr(video) and last_frame(again) == last_frame(video)
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        assert pool.submit(last_frame, video).result() == last_frame(video)


def test_a_video_of_a_file_object_says_how_it_can_be_pickled():
    with pytest.raises(InputError, match="open it by its path"):
        pickle.dumps(meshreel.open(io.BytesIO(SCENE.read_bytes())))


def read_often(video: meshreel.Video, results: object) -> None:
    """Put what goes wrong while chunks are read over and over; their checksums tell."""
    try:
        for number in range(3000):
            video.reader.read_chunk(number % len(video.reader.chunks))
        results.put("")
    except FormatError as error:
        results.put(str(error))


def test_forked_processes_that_share_an_open_file_do_not_disturb_each_other(tmp_path):
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("this system does not fork")
    (tmp_path / "a.reel").write_bytes(LARGE)
    video = meshreel.open(tmp_path / "a.reel")
    context = multiprocessing.get_context("fork")
    queue = context.SimpleQueue()
    workers = [context.Process(target=read_often, args=(video, queue)) for _ in range(4)]
    for worker in workers:
        worker.start()
    assert [queue.get() for _ in workers] == [""] * 4
    for worker in workers:
        worker.join()


def test_a_mesh_with_a_texture_is_pickled_as_it_is_shown():
    pytest.importorskip("av", reason="textures need the extra color")
    found = [meshreel.open(path)[0] for path in TEXTURED]
    found = [mesh for mesh in found if mesh.texture is not None]
    assert found
    for mesh in found:
        again = pickle.loads(pickle.dumps(mesh))
        assert np.array_equal(again.vertices, mesh.vertices) and again.texture.shape == mesh.texture.shape
        assert np.array_equal(again.texture.pixels, mesh.texture.pixels)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="forks are of POSIX")
def test_a_fork_leaves_the_page_of_its_parent(shown):
    video = meshreel.open(SCENE)
    video.show()
    if (child := os.fork()) == 0:
        video.close()
        os._exit(0)
    os.waitpid(child, 0)
    assert shown[0].exists()
    video.close()
    assert not shown[0].exists()
