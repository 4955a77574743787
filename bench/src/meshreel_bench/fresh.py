"""Measurements in a process of its own, which `runner.py` and `peers.py` start: nothing else is in memory, or warm.

`decode FILE [CODEC]` gives times of decoding a .reel file, or that of another codec, and digests of its frames;
`frames FILE [CODEC]` gives these alone; `draco FILE` gives times of DracoPy on the frames in an .npz, the named peer;
`pair FILE FILE` decodes two files by turns, the second with DracoPy alone too; `encode NAME DATA FRAMES OPTIONS`
encodes a sequence, `scene` one of the benchmark's scenes. Times are processor time; decoding starts from bytes. The
steady state is the best of three passes, each group's cost spread over its frames.
"""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from meshreel.decoder.video import Video
from meshreel.decoder.video import open as open_video
from meshreel.types import Mesh

FRAMES = "frames_sha256"  # of a row: the digest of each mesh that is decoded
PASSES = 3
SLOW_MS = 2000.0  # a frame: who takes so long in all passes so far is not asked again
PAIR_PASSES = 7


def main(task: str, *arguments: str) -> None:
    """Prints what `task` measured; what codecs print goes where errors go."""
    answer = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)
    tasks: dict[str, Callable[..., dict[str, Any]]] = {
        "decode": measure_decode,
        "frames": decode_frames,
        "draco": measure_draco,
        "pair": measure_pair,
        "encode": measure_encode,
        "scene": measure_scene_encode,
    }
    row = tasks[task](*arguments)
    answer.write(json.dumps(row | {"peak_rss_mb": peak_rss_mb()}) + "\n")
    answer.flush()


def measure_decode(path: str, decoder: str | None = None) -> dict[str, Any]:
    """First frame and steady state, ms a frame, of the file at `path`; `decoder` is a file with a pickled codec."""
    decode, data = _decoder(decoder), Path(path).read_bytes()
    start = time.process_time()
    decode(data)[0]
    first_ms = 1e3 * (time.process_time() - start)
    passes = [_pass_ms(lambda: decode(data))]
    while len(passes) < PASSES and len(passes) * passes[0] < SLOW_MS:
        passes.append(_pass_ms(lambda: decode(data)))
    row = {"first_frame_ms": first_ms, "frame_ms": min(passes)} | decode_frames(path, decoder)
    return row | {"vertices": row.pop("vertices") / row["frames"]}


def decode_frames(path: str, decoder: str | None = None) -> dict[str, Any]:
    """The digests of all frames of the file at `path`, and how many frames and vertices there are."""
    decode, data = _decoder(decoder), Path(path).read_bytes()
    found = [(len(mesh.vertices), digest(mesh)) for mesh in decode(data)]
    return {"frames": len(found), "vertices": sum(size for size, _ in found), FRAMES: [told for _, told in found]}


def digest(mesh: Mesh) -> str:
    """SHA-256 of a mesh's vertices and faces."""
    return hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest()


def measure_draco(path: str) -> dict[str, Any]:
    """ms a frame of DracoPy on an .npz whose arrays are Draco bytes, a frame each."""
    import DracoPy
    import numpy as np

    frames = [frame.tobytes() for frame in np.load(path).values()]
    DracoPy.decode(frames[0])
    passes = []
    for _ in range(PASSES):
        start = time.process_time()
        for frame in frames:
            DracoPy.decode(frame)
        passes.append(1e3 * (time.process_time() - start) / len(frames))
    return {"frame_ms": min(passes), "frames": len(frames)}


def measure_pair(path: str, anchor: str) -> dict[str, Any]:
    """ms a frame of the file at `path`, of the anchor's file, and of DracoPy alone on the anchor's meshes, by turns."""
    import DracoPy

    from meshreel.format.layout import DracoGroup
    from meshreel.format.records import unpack_all

    data, other = Path(path).read_bytes(), Path(anchor).read_bytes()
    reader = open_video(other).reader
    groups = [unpack_all(DracoGroup, reader.read_chunk(chunk.number)) for chunk in reader.groups]
    meshes = [mesh for group in groups for mesh in group.meshes if mesh]
    sizes = [len(mesh.vertices) for mesh in open_video(data)]
    times: dict[str, list[float]] = {"frame_ms": [], "draco_ms": [], "subdivided_ms": []}
    for _ in range(PAIR_PASSES):
        times["frame_ms"].append(_pass_ms(lambda: open_video(data)))
        start = time.process_time()
        for mesh in meshes:
            DracoPy.decode(mesh)
        times["draco_ms"].append(1e3 * (time.process_time() - start) / len(sizes))
        times["subdivided_ms"].append(_pass_ms(lambda: open_video(other)))
    best = {name: min(passes) for name, passes in times.items()}
    return best | {"frames": len(sizes), "vertices": sum(sizes) / len(sizes)}


def measure_encode(name: str, data: str, frames: str, options: str) -> dict[str, Any]:
    """Bytes and CPU s a frame of encoding so many frames of a sequence; the memory is what it is run for."""
    from meshreel.encoder.sequence import encode

    from .codecs.meshreel import MeshreelCodec
    from .datasets import open_dataset

    sequence = open_dataset(name, Path(data), int(frames))
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        summary = encode(sequence, Path(folder) / "video.reel", MeshreelCodec(**json.loads(options)).encoder_options)
    seconds = time.process_time() - start
    return {"frames": summary.frame_count, "bytes": summary.size, "encode_s": seconds / summary.frame_count}


def measure_scene_encode(name: str, data: str, cache: str, frames: str, quality: str) -> dict[str, Any]:
    """The same of a captured scene and the preset `best`; longer than it is, it is played forth and back."""
    from meshreel.encoder.presets import preset_options
    from meshreel.encoder.sequence import encode
    from meshreel.geometry.derived_sequences import forth_and_back

    from .datasets.scenes import open_scene

    sequence = forth_and_back(open_scene(name, Path(data), Path(cache)).meshes, int(frames))
    start = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        summary = encode(sequence, Path(folder) / "scene.reel", preset_options("best", float(quality)))
    seconds = time.process_time() - start
    return {"frames": summary.frame_count, "bytes": summary.size, "encode_s": seconds / summary.frame_count}


def peak_rss_mb() -> float | None:
    """Largest resident set of this process so far, MB; None where the platform does not tell."""
    status = Path("/proc/self/status")
    if status.exists():  # Linux: getrusage would give a child its parent's peak
        [line] = [line for line in status.read_text().splitlines() if line.startswith("VmHWM:")]
        return int(line.split()[1]) * 1024 / 1e6
    try:
        import resource
    except ImportError:  # Windows
        return None
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e6


def _decoder(path: str | None) -> Callable[[bytes], Sequence[Mesh] | Video]:
    """Of the codec that is pickled there; of .reel files where there is none."""
    if path is None:
        return open_video
    decode: Callable[[bytes], Sequence[Mesh]] = pickle.loads(Path(path).read_bytes()).decode
    return decode


def _pass_ms(opened: Callable[[], Sequence[Mesh] | Video]) -> float:
    """Opening counts: who decodes all of it then is as slow as who decodes frame by frame."""
    start = time.process_time()
    video = opened()
    for _ in video:
        pass
    return 1e3 * (time.process_time() - start) / len(video)


if __name__ == "__main__":
    main(*sys.argv[1:])
