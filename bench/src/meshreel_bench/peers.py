"""Measurements against a peer of equal quality: decoding times side by side, and what per-frame Draco would cost.

In -> out: a codec's point and the anchors' rows, or a decoded video -> numbers for a row. Both sides of a ratio are
measured in one fresh process, by turns.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from meshreel.analysis.survey import Survey, survey
from meshreel.decoder.video import Video
from meshreel.encoder.draco import IntraOptions, cheapest_intra
from meshreel.encoder.target import measure
from meshreel.errors import InputError
from meshreel.types import Mesh, MeshSequence

from .checked import Checked, Confirmed
from .codecs import make_codec
from .fresh import FRAMES
from .rows import Point, Row
from .said import last_words
from .timer import ONE_THREAD

ANCHOR = "decimated_draco_subdivided"  # A2s
EQUAL = "d2_psnr_paper"  # quality that is to be equal


def measure_pair(point: Point, sequence: MeshSequence, rows: Sequence[Row]) -> Row:
    """Decoding of a point, ms a frame, beside that of the anchor's smallest stream that is at least as good.

    `draco_ms` is DracoPy alone on the anchor's meshes; `subdivided_ms` decodes the anchor's file, free subdivision
    included. Raises InputError where no row of the point, or none of a good enough anchor, was measured.
    """
    codec = make_codec(point.codec, point.options)
    anchor = equal_anchor(_own_row(codec.name, codec.options, point, rows), rows)
    streams = [codec.encode(sequence), make_codec("decimated_draco", anchor["options"]).encode(sequence)]
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / "codec.reel", Path(folder) / "anchor.reel"]
        for path, data in zip(paths, streams, strict=True):
            path.write_bytes(data)
        times = run_fresh("pair", *map(str, paths))
    equal = {"options": anchor["options"], "mbps": anchor["mbps"], EQUAL: anchor[EQUAL]}
    return {
        "sequence": point.sequence,
        "codec": codec.name,
        "options": codec.options,
        "bytes": len(streams[0]),
        "anchor": equal,
    } | times


def equal_anchor(row: Row, rows: Sequence[Row]) -> Row:
    """Of the anchor's rows on the same frames that are at least as good as `row`, the smallest; InputError for none."""
    same = [
        r for r in rows if r["sequence"] == row["sequence"] and r["codec"] == ANCHOR and r["frames"] == row["frames"]
    ]
    good = [r for r in same if r[EQUAL] >= row[EQUAL]]
    if not good:
        best = max((r[EQUAL] for r in same), default=0.0)
        raise InputError(
            f"{row['sequence']}: no anchor point reaches {row[EQUAL]:.2f} dB (best {best:.2f}); add a finer one"
        )
    return min(good, key=lambda r: r["mbps"])


def cheapest_forms(sequence: MeshSequence, video: Video) -> list[int | None]:
    """For each group, bytes of the cheapest per-frame Draco form at its quality; None where none costs less."""
    seen, found = survey(sequence), list[int | None]()
    for chunk in video.reader.groups:
        numbers = range(chunk.first_frame, chunk.first_frame + chunk.frame_count)
        frames = [seen.normalise(sequence[i]) for i in numbers]
        if frames[0].is_empty:
            found.append(None)
            continue
        quality = measure(frames, [_normalised(video[i], seen) for i in numbers])
        form = cheapest_intra(frames, quality, chunk.size, IntraOptions())
        found.append(None if form is None else len(form[0]))
    return found


def run_fresh(task: str, *arguments: str) -> Row:
    """What `evaluation.fresh` measures, on one thread."""
    command = [sys.executable, "-m", "meshreel_bench.fresh", task, *arguments]
    with tempfile.TemporaryFile() as said:  # not a pipe: who inherits its end could keep it open
        answer = subprocess.run(
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=said, env=os.environ | ONE_THREAD
        )
        if answer.returncode != 0:
            raise RuntimeError(f"measuring `{task}` in a fresh process failed: {last_words(answer.returncode, said)}")
    return dict(json.loads(answer.stdout))


def measure_fresh_decode(data: bytes, decoder: bytes, decoded: Checked) -> tuple[Row, Confirmed]:
    """First frame and steady state, ms, and peak memory of decoding these bytes from a file in a fresh process.

    With `decoded`, the frames that were decoded here, of which each that is asked for is then compared with that of the
    fresh process. `decoder` is the pickled codec.
    """
    return _decoded_apart("decode", data, decoder, decoded)


def confirmed(data: bytes, decoder: bytes, decoded: Checked) -> Confirmed:
    """The frames as `measure_fresh_decode` gives them, where nothing is timed."""
    return _decoded_apart("frames", data, decoder, decoded)[1]


def _decoded_apart(task: str, data: bytes, decoder: bytes, decoded: Checked) -> tuple[Row, Confirmed]:
    if len(decoded):
        decoded[0]  # raises what is wrong with it, in words
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / "video", Path(folder) / "codec"]
        for path, content in zip(paths, (data, decoder), strict=True):
            path.write_bytes(content)
        row = run_fresh(task, *map(str, paths))
    return row, Confirmed(decoded, row.pop(FRAMES))


def _own_row(name: str, options: Row, point: Point, rows: Sequence[Row]) -> Row:
    own = [r for r in rows if r["sequence"] == point.sequence and r["codec"] == name and r["options"] == options]
    own = [r for r in own if EQUAL in r]
    if not own:
        raise InputError(
            f"{point.sequence}: {name} {options} has no quality row yet; put that point into the experiment"
        )
    return own[0]


def _normalised(mesh: Mesh, seen: Survey) -> Mesh:
    """A decoded mesh in the encoder's coordinates."""
    return Mesh(np.ascontiguousarray((mesh.vertices - seen.center) / seen.diagonal), mesh.faces)
