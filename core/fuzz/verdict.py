"""Verdict on a file: refused, or a digest of what it decodes to. Python and the player must agree on it.

In: the bytes of a .reel file. Out: a Verdict. FormatError is the only exception that a decoder may raise, and it stays
inside; any other one is a fault and passes through. `verdict.py FILE...` checks files as the fuzzers do; without a
file it writes the verdicts on the committed corpus, which the player's tests read.
"""

from __future__ import annotations

import hashlib
import json
import sys
import zlib
from contextlib import suppress
from pathlib import Path

from meshreel.coding.group import payload_bytes_by_purpose
from meshreel.decoder.video import open as open_video
from meshreel.errors import FormatError

MOST_FRAMES = 24  # looked at, from the first (a decision: a run takes milliseconds)
CORPUS = Path(__file__).parent / "corpus"
VERDICTS = CORPUS / "verdicts.json"


def verdict(data: bytes, layers: int | None = None) -> str:
    """Return "refused" for a file that cannot be opened; otherwise how many frames decode, and a digest of them all.

    At most `layers` layers beyond the first are decoded. The digest is of each frame's positions and faces, or of
    the word "refused". Colours are not of it: the player shows what it can without them.
    """
    try:
        video = open_video(data).at(layers, colors=False)
    except FormatError:
        return "refused"
    total, shown = hashlib.sha256(), 0
    for frame in range(min(len(video), MOST_FRAMES)):
        try:
            mesh = video[frame]
        except FormatError:
            total.update(b"refused")
            continue
        shown += 1
        total.update(mesh.vertices.astype("<f8").tobytes())
        total.update(mesh.faces.astype("<i4").tobytes())
    return f"{shown} {total.hexdigest()[:16]}"


def check(data: bytes) -> None:
    """Decode and describe a file; then decode it again, which must give the same, or with fewer layers."""
    first = verdict(data)
    describe(data)
    color(data)
    layers = zlib.crc32(data) % 4
    if layers == 3:
        assert verdict(data) == first, "a file that decodes in two ways"
    elif first != "refused":
        verdict(data, layers)


def color(data: bytes) -> None:
    """Decode the colours of a file."""
    with suppress(FormatError):
        video = open_video(data)
        for frame in range(min(len(video), MOST_FRAMES)):
            with suppress(FormatError):
                for mesh in video.parts(frame).values():
                    assert mesh.colors is None or len(mesh.colors) == len(mesh.vertices)
                    assert mesh.texture is None or mesh.texture.pixels.shape[2] == 3


def describe(data: bytes) -> None:
    """Ask what is asked of a file without its frames."""
    with suppress(FormatError):
        video = open_video(data)
        reader = video.reader
        assert repr(video) and video.up and video.duration > 0
        assert reader.has_background in (False, True) and len(reader.missing) <= len(reader.chunks)
        for chunk in reader.chunks:
            with suppress(FormatError):
                assert all(size >= 0 for size in payload_bytes_by_purpose(reader.read_chunk(chunk.number)).values())


def corpus() -> list[Path]:
    """Return the .reel files of the committed corpus."""
    return sorted(CORPUS.glob("*/*.reel"))


def verdicts() -> dict[str, list[str]]:
    """Return the verdict on each file of the corpus, with all layers and with one beyond the first."""
    files = {f"{path.parent.name}/{path.name}": path.read_bytes() for path in corpus()}
    return {name: [verdict(data), verdict(data, 1)] for name, data in files.items()}


def main(names: list[str]) -> None:
    for name in names:
        check(Path(name).read_bytes())
    if not names:
        VERDICTS.write_text(json.dumps(verdicts(), indent=0) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main(sys.argv[1:])
