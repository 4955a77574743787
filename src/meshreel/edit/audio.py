"""Audio of a file. In: an audio file, or the audio of files that are joined. Out: the bytes of a chunk.

Opus in Ogg or WebM, AAC in MP4 or ADTS, and MP3 are told by their first bytes and their lists of tracks, never by their
names: what can be played is for a player to say.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import replace

from ..container.sources import viewed
from ..errors import InputError
from ..format.budget import LIMITS
from ..format.layout import AudioFile, AudioType, Form
from ..format.records import pack
from ..io.files import Place, located, read_input

_START = 1 << 16  # bytes at the start within which Ogg and WebM name their tracks (guess)
_PICTURES = re.compile(rb"hdlr.{8}vide|V_(VP[89]|AV1|MPEG)", re.DOTALL)  # marks of a video track in MP4 and in WebM
_KNOWN = {b"RIFF": "a WAV file", b"fLaC": "a FLAC file", b"FORM": "an AIFF file", b"caff": "a CAF file"}
_KNOWN |= {b"\x89PNG": "a PNG picture"}
_REMEDY = "give Opus (.opus, .ogg, .webm), AAC (.m4a, .aac) or MP3, as ffmpeg -i IN -vn -c:a libopus OUT.opus makes it"
Given = str | Place | bytes  # a path, a URL (extra `remote`), or the bytes of an audio file
_MOST = 1e8  # s, three years: a larger offset was meant in another unit (guess)
_CLOSE = 1000  # microseconds within which joined files have the same audio at the same time: times are rounded


def packed_audio(audio: Given, start: float, first_time: int = 0) -> bytes:
    """Return the payload of audio `start` seconds after the first frame (`first_time`). Raises InputError."""
    if not abs(start) <= _MOST:  # also NaN
        raise InputError(f"audio start {start}: give seconds after the first frame, as 0.5; or before it, as -2")
    held = viewed(audio)
    data = read_input(located(audio)) if held is None else bytes(held)
    kind = audio_type(data, str(audio) if held is None else "the audio")
    return pack(AudioFile(Form.AUDIO_FILE, kind, first_time + round(1e6 * start), data))


def joined_audio(joined: AudioFile | None, path: Place, record: AudioFile | None, later: int) -> AudioFile | None:
    """Return joined files' audio and that of a next one, `later` microseconds later. Raises InputError for another."""
    if record is None:
        return joined
    moved = replace(record, start=record.start + later)
    if joined is None:
        return moved
    if moved.data != joined.data or abs(moved.start - joined.start) > _CLOSE:
        text = f"{path}: has other audio than a file before it, or the same at another time, and a file has one"
        raise InputError(f"{text}; take it away with meshreel tag FILE --no-audio, and add one to the joined file")
    return joined


def audio_type(data: bytes, name: str) -> AudioType:
    """Return the type of an audio file. Raises InputError, which begins with the file's name, for other bytes."""
    if not data:
        raise InputError(f"{name}: has no bytes; {_REMEDY}")
    if len(data) > LIMITS.audio - (1 << 10):
        raise InputError(f"{name}: {len(data)} bytes, over {LIMITS.audio}; give it fewer bits a second")
    start = data[:_START]
    if data[:4] == b"OggS" and b"OpusHead" in start[:512]:
        return AudioType.OGG
    if data[:4] == b"\x1aE\xdf\xa3" and b"A_OPUS" in start and not _PICTURES.search(start):
        return AudioType.WEBM
    if data[4:8] == b"ftyp" and (tracks := dict(_boxes(data)).get(b"moov")) is not None:
        if b"mp4a" in tracks and not _PICTURES.search(tracks):
            return AudioType.MP4
    elif (coded := _coded(data)) is not None:
        return coded
    raise InputError(f"{name}: {_found(data)}, which no .reel file keeps; {_REMEDY}")


def _boxes(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield name and contents of the complete boxes of an MP4 file."""
    at = 0
    while at + 8 <= len(data):
        size, head = int.from_bytes(data[at : at + 4], "big"), 8
        if size == 1:
            size, head = int.from_bytes(data[at + 8 : at + 16], "big"), 16
        size = size or len(data) - at  # 0: to the end
        if size < head or size > len(data) - at:
            return
        yield data[at + 4 : at + 8], data[at + head : at + size] if data[at + 4 : at + 8] == b"moov" else b""
        at += size


def _coded(data: bytes) -> AudioType | None:
    """Return the name of ADTS or MPEG for frames of these formats, which a tag may precede."""
    at = 0
    if data[:3] == b"ID3" and len(data) > 10:
        at = 10 + sum((byte & 0x7F) << (21 - 7 * k) for k, byte in enumerate(data[6:10]))
    head = data[at : at + 7]
    if len(head) < 7 or head[0] != 0xFF:
        return None
    if head[1] & 0xF6 == 0xF0:
        size = (head[3] & 3) << 11 | head[4] << 3 | head[5] >> 5
        after = data[at + size : at + size + 2]
        return AudioType.ADTS if size > 7 and (not after or after[0] == 0xFF) else None
    is_mp3 = head[1] & 0xE6 == 0xE2 and head[2] >> 4 not in (0, 15) and head[2] >> 2 & 3 != 3
    return AudioType.MPEG if is_mp3 else None


def _found(data: bytes) -> str:
    """Return a description of bytes of unknown type."""
    if data[:4] == b"OggS":
        return "an Ogg file without Opus"
    if data[:4] == b"\x1aE\xdf\xa3":
        return "a WebM or Matroska file that has pictures, or no Opus"
    if data[4:8] == b"ftyp":
        return "an MP4 file that has pictures, no AAC, or no whole list of its tracks"
    return _KNOWN.get(data[:4], f"a file that begins with {data[:8].hex(' ')}")
