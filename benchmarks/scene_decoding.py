"""What a scene costs to decode: `python benchmarks/scene_decoding.py BACKGROUND.ply BODY.reel BODY.reel ...`.

Files of one sequence each become tracks of one scene, with the background decimated; CPU ms a frame,
the best of some passes: of everything, of the bodies alone, and of putting the parts together. One JSON row.
"""

from __future__ import annotations

import io
import json
import sys
import time
from collections.abc import Callable
from itertools import accumulate
from pathlib import Path

from meshreel.coding.background import encode_background
from meshreel.container.reader import ReelReader
from meshreel.container.sources import BytesSource
from meshreel.container.writer import ReelWriter
from meshreel.decoder.video import open as open_video
from meshreel.geometry.decimate import decimate
from meshreel.geometry.topology import concatenate, weld
from meshreel.io.meshes import read_mesh
from meshreel.types import Mesh

VERTICES = 15_600  # some 27k faces of a room that depth cameras saw
STEP = 0.001  # of a body's diagonal
PASSES = 5


def main(background: str, *bodies: str) -> None:
    """Prints what was measured."""
    readers = [ReelReader(BytesSource(Path(body).read_bytes())) for body in bodies]
    data = scene(weld(read_mesh(Path(background)).mesh), readers)
    video = open_video(data)
    parts = [list(video.parts(frame).values()) for frame in range(len(video))]
    row = {
        "frames": len(video),
        "bytes": len(data),
        "faces": [len(mesh.faces) for mesh in parts[0]],
        "vertices": [len(mesh.vertices) for mesh in parts[0]],
        "scene_ms": best(lambda: sum(len(mesh.faces) for mesh in open_video(data))) / len(video),
        "moving_ms": best(lambda: sum(len(m.faces) for track in open_video(data).tracks for m in track)) / len(video),
        "together_ms": best(lambda: sum(len(concatenate(meshes).faces) for meshes in parts)) / len(video),
        "background_ms": best(lambda: open_video(data).background(0)),
        "first_frame_ms": best(lambda: open_video(data)[0]),
    }
    print(json.dumps(row))


def scene(background: Mesh, bodies: list[ReelReader]) -> bytes:
    """A file of all bodies, which must be equally long, in front of the background."""
    file, header = io.BytesIO(), bodies[0].header
    still = decimate(background, VERTICES)
    placed = Mesh.of((still.vertices - still.vertices.mean(axis=0)) / header.scale, still.faces)
    order = sorted((g.first_frame, track, g.number) for track, body in enumerate(bodies) for g in body.groups)
    with ReelWriter(file, header) as writer:
        state = writer.add_static(encode_background(placed, STEP))
        for first, track, number in order:
            group, payload = bodies[track].chunks[number], bodies[track].read_chunk(number)
            before = writer.last_of(track)
            depends_on = (state, *([before] if group.depends_on and before is not None else []))
            ends = list(accumulate(layer.size for layer in group.layers))
            writer.add_group(first, group.frame_count, payload, ends, depends_on, track)
    return file.getvalue()


def best(work: Callable[[], int | Mesh]) -> float:
    """CPU time, ms."""
    times = []
    for _ in range(PASSES):
        start = time.process_time()
        work()
        times.append(1e3 * (time.process_time() - start))
    return min(times)


if __name__ == "__main__":
    main(*sys.argv[1:])
