"""Digests of what encoders make of a small body or room, and of data: rows of other digests than today's are stale.

Rows of one curve share a digest: bytes of the same input are equal on every machine, at one point for all. Codecs whose
arithmetic may differ by machine have a digest of their source, those of other distributions their version.
"""

from __future__ import annotations

import hashlib
import inspect
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path

from meshreel.capture.recording import FusionOptions, open_recording
from meshreel.capture.simulated.demo_room import RoomOptions
from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.capture.simulated.simulated_rig import TRUTH, read_truth
from meshreel.geometry.color_views import Painted
from meshreel.geometry.topology import components, part_of
from meshreel.types import Mesh, MeshList, MeshSequence

from ..codecs import codec_version, make_codec
from ..datasets import is_scene
from ..datasets.rooms import record_procedural
from ..datasets.scenes import Captured, SceneData, SceneFrames
from ..datasets.solid import solid_colors, textured
from ..experiments.study import INSTEAD
from ..rows import Option, Options, Point, Row

BY_SOURCE = ("klt_tsdf", "necgs")
FRAMES = 4  # of the small sequences: fewer, or coarser ones, are coded one by one, by Draco (measured)
SPACING, APART, RATE, WIDTH = 0.025, 0.06, 6.0, 64  # m, of the body and the room; 1/s; pixels of a depth picture
FEW: Options = {"centers": 200}  # of volume tracking, where a method has it: 2,000 take a minute (measured)
_DIGITS = 16


def encoder_digest(point: Point) -> str | None:
    """Return the digest of a point's encoder today; None where it does not work on the small sequence."""
    if point.codec in INSTEAD:  # what encoders find, or play
        point = Point(point.sequence, "meshreel", {"preset": "best"})
    return codec_version(point.codec) or _digest(point.codec, (*point.method.items(),), is_scene(point.sequence))


def is_stale(row: Row) -> bool:
    """Return whether a measured row is of another encoder than today's, as far as that works here, or of an unknown."""
    today = None if row.failed else encoder_digest(row.point)
    return today is not None and row.encoder != today


@cache
def _digest(codec: str, options: tuple[tuple[str, Option], ...], of_scene: bool) -> str | None:
    digest = hashlib.sha256()
    try:
        tracks = codec == "tvmc" or (codec == "meshreel" and dict(options).get("preset") != "best")
        made = make_codec(codec, dict(options) | (FEW if tracks else {}))
        if codec in BY_SOURCE:
            for path in sorted(Path(inspect.getfile(type(made))).parent.glob("*.py")):
                digest.update(path.read_bytes())
        else:
            digest.update(made.encode(_room()[0] if of_scene else _body()))
    except (Exception, SystemExit):  # its row says why
        return None
    return digest.hexdigest()[:_DIGITS]


@cache
def _body() -> MeshSequence:
    """Return one of the procedural bodies, with colours and a texture."""
    frames = list[Mesh]()
    for mesh in soft_bodies(SoftBodiesOptions(FRAMES, spacing=SPACING)):
        body = part_of(mesh, components(mesh.faces, len(mesh.vertices))[mesh.faces[:, 0]] == 0)
        frames.append(textured(body, Painted(replace(body, colors=solid_colors(body.vertices)))))
    return MeshList(tuple(frames))


@cache
def _room() -> tuple[SceneFrames, object]:
    """Return the procedural room with the colours and the depth of its cameras, and the folder that it lies in."""
    kept = tempfile.TemporaryDirectory()
    folder = Path(kept.name)
    record_procedural(folder / "rig", RoomOptions(FRAMES, RATE, APART), WIDTH)
    recording, _ = open_recording(folder / "rig", FusionOptions(APART), keep=False)
    captured, truth = Captured(recording, folder / "meshes"), read_truth(folder / "rig" / TRUTH)
    return SceneFrames(SceneData("small", folder, captured, truth), range(FRAMES)), kept
