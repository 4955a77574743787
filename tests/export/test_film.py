"""Films have the frames, times and sizes that were asked for, and the same bytes each time."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.edit.edits import tag
from meshreel.errors import InputError
from meshreel.export.film import BACKGROUND, FilmOptions, export_film
from meshreel.format.view import View
from meshreel.geometry.threads import threads
from tests.golden import GOLDEN
from tests.tones import tone

av = pytest.importorskip("av", reason="films need the extra color")
Image, ImageSequence = (pytest.importorskip(f"PIL.{name}") for name in ("Image", "ImageSequence"))

SPLATS = GOLDEN / "splats/splats.reel"
FILE, UNEVEN, SCENE = GOLDEN / "colored/vertices.reel", GOLDEN / "mixed.reel", GOLDEN / "scene.reel"
SMALL = (64, 48)


def exported(
    path: Path, options: FilmOptions = FilmOptions(size=SMALL), file: Path = FILE, frames: range | None = None
):
    """Writes a film; its pictures and their times, s."""
    with meshreel.open(file) as video:
        export_film(video.reader, path, range(len(video)) if frames is None else frames, options)
    with av.open(path) as film:
        shown = [*film.decode(film.streams.video[0])]
        return np.stack([frame.to_ndarray(format="rgb24") for frame in shown]), [frame.time for frame in shown]


@pytest.mark.parametrize("kind", ["mp4", "webm", "gif"])
def test_a_film_has_a_picture_of_each_frame_at_its_time(tmp_path, kind):
    pictures, times = exported(tmp_path / f"a.{kind}")
    assert pictures.shape == (12, 48, 64, 3) and np.allclose(times, np.arange(12) / 25, atol=1e-3)
    assert np.abs(pictures[:, 0, 0] - np.array(BACKGROUND)).max() <= 3
    assert all((before != after).any() for before, after in pairwise(pictures))
    assert max(pictures[0].max(axis=(0, 1))) > 150


@pytest.mark.parametrize("kind", ["mp4", "webm", "gif", "png"])
def test_the_same_film_has_the_same_bytes(tmp_path, kind):
    for name, count in (("a", 1), ("b", 3)):
        with threads(count):
            exported(tmp_path / f"{name}.{kind}", frames=range(3))
    assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()


def test_an_mp4_is_one_that_plays_everywhere_and_begins_before_it_is_whole(tmp_path):
    exported(tmp_path / "a.mp4")
    data = (tmp_path / "a.mp4").read_bytes()
    assert data.index(b"moov") < data.index(b"mdat")
    with av.open(tmp_path / "a.mp4") as film:
        context = film.streams.video[0].codec_context
        assert (context.name, context.pix_fmt, film.streams.video[0].average_rate) == ("h264", "yuv420p", 25)
        assert (context.colorspace, context.color_range) == (1, 1)
        assert film.duration == pytest.approx(480_000, abs=1000)


def test_a_gif_begins_again_and_may_be_transparent(tmp_path):
    exported(tmp_path / "a.gif", FilmOptions(size=SMALL, background=None))
    with Image.open(tmp_path / "a.gif") as film:
        assert film.info["loop"] == 0 and film.n_frames > 6
        seen = [np.asarray(frame.convert("RGBA")) for frame in ImageSequence.Iterator(film)]
    assert all(one[0, 0, 3] == 0 and set(np.unique(one[..., 3])) == {0, 255} for one in seen)


def test_a_webm_may_be_transparent(tmp_path):
    exported(tmp_path / "a.webm", FilmOptions(size=SMALL, background=None))
    with av.open(tmp_path / "a.webm") as film:
        assert film.streams.video[0].metadata["alpha_mode"] == "1"
        decoder = av.CodecContext.create("libvpx-vp9", "r")
        [first] = decoder.decode(next(film.demux(film.streams.video[0])))
    alpha = np.frombuffer(first.planes[3], np.uint8).reshape(-1, first.planes[3].line_size)
    assert alpha[0, 0] < 5 and alpha[24, 32] > 250


def test_uneven_times_are_kept_and_given_rates_are_even(tmp_path):
    _, times = exported(tmp_path / "a.mp4", file=UNEVEN, frames=range(1, 10))
    with meshreel.open(UNEVEN) as video:
        assert np.allclose(times, np.array(video.timestamps[1:]) - video.timestamps[1], atol=1e-4)
    _, times = exported(tmp_path / "b.mp4", FilmOptions(size=SMALL, rate=10), UNEVEN)
    assert np.allclose(times, [0, 0.1, 0.2])


def test_seconds_repeat_frames_and_leave_them_out(tmp_path):
    frames = range(3)
    whole, _ = exported(tmp_path / "a.gif", frames=frames)
    twice, times = exported(tmp_path / "b.gif", FilmOptions(size=SMALL, seconds=0.24), frames=frames)
    assert len(twice) == 6 and times[-1] == pytest.approx(0.2) and np.abs(twice[3:].astype(int) - whole).mean() < 1
    assert len(exported(tmp_path / "c.gif", FilmOptions(size=SMALL, seconds=0.08), frames=frames)[0]) == 2


def test_a_turntable_goes_around_a_still_and_ends_before_its_begin(tmp_path):
    options = FilmOptions(size=SMALL, turntable=True, seconds=0.8, rate=10)
    pictures, times = exported(tmp_path / "a.gif", options, frames=range(1))
    steps = [np.abs(pictures[k].astype(int) - pictures[0]).mean() for k in range(8)]
    assert len(times) == 8 and min(steps[1:]) > 0.3 and steps[7] == pytest.approx(steps[1], rel=0.8)


def test_a_png_is_the_first_frame_from_a_view(tmp_path):
    with meshreel.open(FILE) as video:
        middle = np.mean(video.box, axis=0)
        view = View(tuple(middle + [0, 0, 10]), tuple(middle), 30.0)
        export_film(video.reader, tmp_path / "a.png", range(3, 7), FilmOptions(view, size=SMALL, background=None))
        near, edge = (np.asarray(Image.open(tmp_path / "a.png"))[at] for at in ((24, 32), (0, 0)))
    assert near[3] == 255 and edge[3] == 0


@pytest.mark.parametrize(
    ("kind", "container", "codec"), [("mp4", "adts", "aac"), ("mp4", "ogg", "opus"), ("webm", "ogg", "opus")]
)
def test_audio_goes_along_from_its_start(tmp_path, kind, container, codec):
    tag(FILE, tmp_path / "heard.reel", audio=tone(1.0, container), audio_start=0.1)
    with meshreel.open(tmp_path / "heard.reel") as video:
        assert export_film(video.reader, tmp_path / f"a.{kind}", range(12), FilmOptions(size=SMALL)).has_audio
    with av.open(tmp_path / f"a.{kind}") as film:
        assert film.streams.audio[0].codec_context.name == codec
        heard = [float(packet.pts * packet.time_base) for packet in film.demux(film.streams.audio[0]) if packet.size]
    assert heard[0] == pytest.approx(0.1, abs=0.03) and 0.4 < heard[-1] < 0.48


@pytest.mark.parametrize("data", [tone(0.5, "mp3"), b"OggS" + bytes(24) + b"OpusHead" + bytes(99)])
def test_audio_that_a_format_does_not_take_is_left_out(tmp_path, data):
    tag(FILE, tmp_path / "heard.reel", audio=data)
    with meshreel.open(tmp_path / "heard.reel") as video:
        assert not export_film(video.reader, tmp_path / "a.webm", range(2), FilmOptions(size=SMALL)).has_audio


@pytest.mark.parametrize("frame", [0, 5, 9])
def test_splats_are_drawn_in_place_of_the_surface_but_for_patches(tmp_path, frame):
    """Frame 0 has a patch beside its splats, frame 5 splats alone, and frame 9 none; the surface is grey clay."""
    with meshreel.open(SPLATS) as video:
        assert len(video.tracks[0].patches(frame).faces) == {0: 32, 5: 0, 9: 128}[frame]
    exported(tmp_path / "a.png", FilmOptions(size=(128, 96), background=None), SPLATS, range(frame, frame + 1))
    seen = np.asarray(Image.open(tmp_path / "a.png")).astype(int)
    seen = seen[seen[..., 3] > 250, :3]
    clay = (np.ptp(seen, axis=1) < 30) & (seen.min(axis=1) > 60)
    assert (np.ptp(seen, axis=1) > 90).any() == (frame != 9)
    assert clay.any() == (frame != 5)


def test_parts_of_a_scene_are_drawn_alone(tmp_path):
    seen = {
        only: exported(tmp_path / "a.gif", FilmOptions(size=SMALL, only=only), SCENE, range(1))[0]
        for only in ("all", "background", "moving")
    }
    assert (seen["all"] != seen["background"]).any() and (seen["all"] != seen["moving"]).any()


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("a.mp4", {"size": (65, 48)}, "66 x 48"),
        ("a.webm", {"size": (64, 47)}, "64 x 48"),
        ("a.mp4", {"background": None}, "no transparency"),
        ("a.gif", {"rate": 60.0}, "50 at most"),
        ("a.gif", {"seconds": 1e7}, "100000 at most"),
        ("no/a.gif", {}, "there is no folder"),
    ],
)
def test_what_a_format_cannot_hold_is_an_error_that_names_it(tmp_path, name, options, words):
    with pytest.raises(InputError, match=words):
        exported(tmp_path / name, FilmOptions(**{"size": SMALL} | options))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "values",
    [
        {"size": (8, 48)},
        {"size": (64, 9000)},
        {"seconds": 0.0},
        {"rate": float("nan")},
        {"view": View((0, 0, 1), (0, 0, 1))},
    ],
)
def test_values_out_of_range_are_errors(values):
    with pytest.raises(InputError, match="give"):
        FilmOptions(**values)
