"""Log a video for the Rerun viewer, every part as a mesh over time: `python rerun_log.py scan.reel; rerun scan.rrd`."""

import sys
from pathlib import Path

import rerun as rr

import meshreel

video = meshreel.open(sys.argv[1])
rr.init("meshreel")
rr.save(Path(sys.argv[1]).with_suffix(".rrd").name)  # in the current folder; rr.spawn() opens the viewer instead
up = f"RIGHT_HAND_{video.up[-1].upper()}_{'DOWN' if '-' in video.up else 'UP'}"
rr.log("/", getattr(rr.ViewCoordinates, up), static=True)
shown = {}
for frame, seconds in enumerate(video.timestamps):
    rr.set_time("video", duration=seconds)
    for name, mesh in video.parts(frame).items():
        if mesh is not shown.get(name):  # a background is logged when it changes
            look = {"vertex_positions": mesh.vertices, "triangle_indices": mesh.faces, "vertex_colors": mesh.colors}
            rr.log([name], rr.Mesh3D(**look))
            shown[name] = mesh
