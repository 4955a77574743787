"""Audio: kept byte for byte, found by its bytes, in step after every edit."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

import meshreel
from meshreel.container.writer import AUDIO_PIECE, pack_head, with_audio
from meshreel.edit.edits import concat, cut, retime, tag, transform
from meshreel.errors import FormatError, InputError
from meshreel.format.layout import AudioFile, AudioType, Form
from meshreel.format.records import pack
from tests.decoder.test_chains import DATA
from tests.edit.test_edits import known, records
from tests.golden import GOLDEN
from tests.metrics.shapes import sphere
from tests.tones import tone

OPUS = b"OggS" + bytes(24) + b"OpusHead" + bytes(AUDIO_PIECE * 2)  # more than two pieces
SCENE = GOLDEN / "scene.reel"


@pytest.fixture
def heard(tmp_path: Path) -> Path:
    """A file of three chains of groups, whose audio begins a tenth of a second after its first frame."""
    (tmp_path / "bare.reel").write_bytes(known(SCENE.read_bytes(), {"preset": "best"}))
    tag(tmp_path / "bare.reel", tmp_path / "heard.reel", audio=OPUS, audio_start=0.1)
    return tmp_path / "heard.reel"


def test_an_encoded_file_has_the_audio_that_it_was_given(tmp_path):
    (tmp_path / "wrong.name").write_bytes(OPUS)
    summary = meshreel.encode([sphere(1)], tmp_path / "a.reel", audio=tmp_path / "wrong.name", audio_start=-1.5)
    video = meshreel.open(tmp_path / "a.reel")
    assert video.audio is not None and video.audio.data == OPUS
    assert (video.audio.media_type, video.audio.start) == ("audio/ogg", -1.5)
    assert summary.size == (tmp_path / "a.reel").stat().st_size and summary.audio == len(OPUS) + 10
    meshreel.encode([sphere(1)], tmp_path / "b.reel")
    tag(tmp_path / "b.reel", tmp_path / "c.reel", audio=OPUS, audio_start=-1.5)
    assert (tmp_path / "c.reel").read_bytes() == (tmp_path / "a.reel").read_bytes()
    tag(tmp_path / "a.reel", tmp_path / "d.reel", audio=b"")
    assert (tmp_path / "d.reel").read_bytes() == (tmp_path / "b.reel").read_bytes()


@pytest.mark.parametrize(
    ("container", "media"),
    [("ogg", "audio/ogg"), ("webm", "audio/webm"), ("mp4", "audio/mp4"), ("adts", "audio/aac"), ("mp3", "audio/mpeg")],
)
def test_audio_is_known_by_its_bytes(tmp_path, container, media):
    pytest.importorskip("av", reason="makes tones")
    tag(SCENE, tmp_path / "a.reel", audio=tone(0.5, container))
    audio = meshreel.open(tmp_path / "a.reel").audio
    assert audio is not None and audio.media_type == media
    assert records(meshreel.open(tmp_path / "a.reel")) == records(meshreel.open(SCENE))


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "has no bytes"),
        (b"RIFF" + bytes(40), "a WAV file"),
        (b"OggS" + bytes(24) + b"\x01vorbis", "an Ogg file without Opus"),
        (b"\x1aE\xdf\xa3 A_OPUS V_VP9", "has pictures, or no Opus"),
        (b"\0\0\0\x08ftyp\0\0\0\x1cmoovmp4ahdlr" + bytes(8) + b"vide", "an MP4 file that has pictures"),
        (b"\0\0\0\x08ftyp\0\0\0\x00", "no whole list of its tracks"),
        (b"\xff\xf1\x50\x80\x01\x1f\xfc" + bytes(20), "begins with ff f1"),
        (b"ID3\x04\0\0\x7f\x7f\x7f\x7f" + bytes(9), "begins with 49 44 33"),
        (b"<html>", "begins with 3c 68"),
    ],
)
def test_other_files_are_refused_by_name_with_a_remedy(tmp_path, data, message):
    (tmp_path / "talk.opus").write_bytes(data)
    with pytest.raises(InputError, match=rf"talk\.opus: .*{message}.*give Opus"):
        tag(SCENE, tmp_path / "a.reel", audio=tmp_path / "talk.opus")
    assert not (tmp_path / "a.reel").exists()


@pytest.mark.parametrize("start", [float("nan"), float("inf"), 1e9])
def test_a_start_that_is_none_is_refused(tmp_path, start):
    with pytest.raises(InputError, match=r"audio start .*: give seconds"):
        tag(SCENE, tmp_path / "a.reel", audio=OPUS, audio_start=start)


def test_a_cut_stays_in_step(tmp_path, heard):
    before = meshreel.open(heard)
    done = cut(heard, tmp_path / "a.reel", "5:9")
    after = meshreel.open(tmp_path / "a.reel").audio
    assert done.hidden and after is not None and before.audio is not None
    assert after.start == pytest.approx(0.1 - 5 / 25, abs=1e-6) and after.data == OPUS
    transform(tmp_path / "a.reel", tmp_path / "b.reel", scale=2.0)
    assert meshreel.open(tmp_path / "b.reel").audio == after
    tag(tmp_path / "a.reel", tmp_path / "c.reel", audio_start=0.25)
    assert meshreel.open(tmp_path / "c.reel").audio == replace(after, start=0.25)
    with pytest.raises(InputError, match="has other audio than a file before it, or the same at another time"):
        concat([heard, heard], tmp_path / "d.reel")


def test_cuts_of_one_file_join_with_its_audio(tmp_path):
    (tmp_path / "bare.reel").write_bytes(known(DATA))
    tag(tmp_path / "bare.reel", tmp_path / "heard.reel", audio=OPUS, audio_start=0.1)
    whole = meshreel.open(tmp_path / "heard.reel")
    key = next(g.first_frame for g in whole.reader.groups if g.first_frame and not whole.reader.group_before(g))
    pieces = [tmp_path / "a.reel", tmp_path / "b.reel"]
    for piece, frames in zip(pieces, (f":{key}", f"{key}:"), strict=True):
        cut(tmp_path / "heard.reel", piece, frames)
    concat(pieces, tmp_path / "joined.reel")
    joined = meshreel.open(tmp_path / "joined.reel")
    assert joined.audio == whole.audio and records(joined) == records(whole)


def test_joined_files_keep_the_one_audio_that_they_have(tmp_path, heard):
    bare = tmp_path / "bare.reel"
    concat([bare, heard], tmp_path / "a.reel")
    video = meshreel.open(tmp_path / "a.reel")
    assert video.audio is not None and video.audio.data == OPUS
    assert video.audio.start == pytest.approx(14 / 25 + 0.1, abs=1e-6)
    assert records(video) == 2 * records(meshreel.open(bare))
    tag(heard, tmp_path / "later.reel", audio_start=0.1 - 14 / 25)  # as a second half would have it
    concat([heard, tmp_path / "later.reel", bare], tmp_path / "b.reel")
    joined = meshreel.open(tmp_path / "b.reel").audio
    assert joined is not None and joined.start == 0.1


def test_another_speed_leaves_audio_out_and_says_so(tmp_path, heard):
    assert retime(heard, tmp_path / "a.reel", speed=2.0).lost_audio
    assert meshreel.open(tmp_path / "a.reel").audio is None
    assert not retime(tmp_path / "bare.reel", tmp_path / "b.reel", speed=2.0).lost_audio
    with pytest.raises(InputError, match=r"has no audio that could begin at 2 s"):
        tag(tmp_path / "a.reel", tmp_path / "c.reel", audio_start=2.0)


def test_audio_lies_behind_what_the_first_frame_needs_in_pieces(heard):
    reader = meshreel.open(heard).reader
    audio = reader.audio
    assert audio is not None and str(audio) == f"chunk {audio.number} (audio)"
    first = [*reader.chunks_of_frame(0), reader.static_of_frame(0)]
    assert max(chunk.number for chunk in first if chunk) < audio.number < len(reader.chunks) - 1
    assert [layer.size for layer in audio.layers[:-1]] == [AUDIO_PIECE] * (len(audio.layers) - 1)


@pytest.mark.parametrize(
    ("payload", "message"),
    [
        (pack(AudioFile(Form.AUDIO_FILE, AudioType.OGG, 0, b"")), "audio of 0 bytes"),
        (pack(AudioFile(Form.AUDIO_FILE, AudioType.OGG, -(1 << 62), b"x")), "begins at -4611686018427387904"),
        (bytes([Form.AUDIO_FILE, 99]) + bytes(9), "99 is none of the known values"),
        (bytes([Form.AUDIO_FILE, 1, 2]), "8 bytes needed"),
        (bytes([Form.DRACO, 1]) + bytes(9), "its form is 3"),
    ],
)
def test_damaged_audio_leaves_the_frames_alone(tmp_path, payload, message):
    (tmp_path / "a.reel").write_bytes(damaged(payload))
    video = meshreel.open(tmp_path / "a.reel")
    with pytest.raises(FormatError, match=rf"chunk \d+ \(audio\): .*{re.escape(message)}"):
        _ = video.audio
    assert records(video) == records(meshreel.open(SCENE))


def test_a_file_that_ends_within_its_audio_shows_the_frames_before(heard):
    audio = meshreel.open(heard).reader.audio
    assert audio is not None
    video = meshreel.open(heard.read_bytes()[: audio.offset + 99])
    with pytest.raises(FormatError, match=r"\(audio\): truncated"):
        _ = video.audio
    assert video.reader.missing[0].number == audio.number and len(video[0].vertices)


def damaged(payload: bytes) -> bytes:
    """The scene with this payload as its audio, as no writer writes it."""
    reader = meshreel.open(SCENE).reader
    index, place = with_audio(reader.index, payload)
    chunks = [reader.read_chunk(number) for number in range(len(reader.chunks))]
    return pack_head(reader.header, index) + b"".join([*chunks[:place], payload, *chunks[place:]])
