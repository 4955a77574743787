"""Export of a .reel file to one file per frame: a mesh, or its splats as PLY (Kerbl et al. 2023), SPZ or GLB.

Splats have positions, logarithms of scales, quaternions, opacities (in PLY their logits), and colours as harmonics of
degree 0, without those that the frame hides. SPZ is Niantic's, version 3: 20 bytes a splat, packed by gzip. GLB has the
extension KHR_gaussian_splatting, as the draft under review has it.
"""

from __future__ import annotations

import gzip
import io
import math
import struct
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..container.reader import ReelReader
from ..decoder.video import Video
from ..errors import FormatError, InputError, path_of
from ..geometry.rigid import quaternions
from ..geometry.splats import Bound
from ..io.glb_file import GlbFile, light
from ..io.write import write_file, write_mesh
from ..shapes import Float64, UInt8

Part = Literal["all", "background", "moving"]


def write_frames(
    decode: Callable[[int], Any],
    paths: Sequence[Path],
    progress: Callable[[int], None] = lambda _: None,
    write: Callable[[Any, Path], None] = write_mesh,
) -> list[FormatError]:
    """Decode and write each frame; return errors of damaged ones, whose old files are removed. Raises InputError."""
    failed: list[FormatError] = []
    for number, path in enumerate(paths):
        try:
            write(decode(number), path)  # writing decodes the texture
        except FormatError as error:
            failed.append(error)
            path.unlink(missing_ok=True)
        progress(number + 1)
    return failed


def check_part(file: Path, reader: ReelReader, part: Part) -> None:
    if part == "background" and not reader.has_background:
        raise InputError(f"{file}: has no background, leave out --only background")
    if part == "moving" and not reader.has_moving:
        raise InputError(f"{file}: has nothing that moves, leave out --only moving")


HARMONIC = 0.28209479177387814  # of degree 0: 1 / (2 sqrt(pi))
SPLATS = "KHR_gaussian_splatting"
MOST_OPACITY = 1 - 2**-10  # whose logit is finite
NAMES = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"


def check_splats(video: Video, name: str) -> None:
    if not video.reader.has_splats:
        raise InputError(f"{name}: has no splats; encode with --splats 8000")


def write_splats(bound: Bound | None, path: Path) -> None:
    """Write Gaussians, which may be none, to a .ply, .spz or .glb file, which appears when it is complete."""
    rows = np.zeros((0, len(NAMES.split()))) if bound is None else _rows(bound)
    path = Path(path_of(path))
    write_file(path, {".spz": _spz, ".glb": _glb}.get(path.suffix, _ply)(rows))


def _ply(rows: Float64[np.ndarray, "N 17"]) -> bytes:
    properties = "".join(f"property float {name}\n" for name in NAMES.split())
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    return head.encode() + rows.astype("<f4").tobytes()


def _spz(rows: Float64[np.ndarray, "N 17"]) -> bytes:
    """Return an SPZ file: a head, then each attribute of all splats; constants are those of its specification."""
    places, colors, logits, scales, turns = rows[:, :3], rows[:, 6:9], rows[:, 9], rows[:, 10:13], rows[:, 13:]
    most = float(np.abs(places).max(initial=1.0))
    fraction = min(max(22 - math.floor(math.log2(most)), 0), 16)  # bits of a place behind the point
    fixed = np.clip(np.round(places * 2**fraction), 1 - 2**23, 2**23 - 1).astype("<i4")
    looks = [_bytes(255 / (1 + np.exp(-logits))), _bytes(255 * (0.15 * colors + 0.5)), _bytes(16 * (scales + 10))]
    packed_turns = _smallest_three(turns[:, [1, 2, 3, 0]]).view(np.uint8)
    parts = [np.ascontiguousarray(fixed).view(np.uint8).reshape(-1, 4)[:, :3], *looks, packed_turns]
    head = struct.pack("<4sIIBBBB", b"NGSP", 3, len(rows), 0, fraction, 0, 0)
    return gzip.compress(head + b"".join(part.tobytes() for part in parts), mtime=0)


def _glb(rows: Float64[np.ndarray, "N 17"]) -> bytes:
    """Return a GLB file of points with the attributes of splats, and the colours that other viewers show."""
    file, scene = GlbFile(io.BytesIO(), "splats"), {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{}]}
    if len(rows):
        opacities = 1 / (1 + np.exp(-rows[:, 9:10]))
        shown = light(_bytes(255 * (HARMONIC * rows[:, 6:9] + 0.5)))
        values = {
            "POSITION": rows[:, :3],
            "COLOR_0": np.concatenate([shown, opacities], axis=1),
            f"{SPLATS}:ROTATION": rows[:, [14, 15, 16, 13]],
            f"{SPLATS}:SCALE": rows[:, 10:13],  # logarithms, as in PLY
            f"{SPLATS}:OPACITY": opacities,
            f"{SPLATS}:SH_DEGREE_0_COEF_0": rows[:, 6:9],
        }
        attributes = dict[str, int]()
        for name, value in values.items():
            file.open_vertices(4 * value.shape[1])
            kind = "SCALAR" if value.shape[1] == 1 else f"VEC{value.shape[1]}"
            attributes[name] = file.put(value.astype("<f4"), kind, bounded=name == "POSITION")
        about = {SPLATS: {"kernel": "ellipse", "colorSpace": "srgb_rec709_display"}}
        file.use(SPLATS)
        file.add("meshes", {"primitives": [{"attributes": attributes, "mode": 0, "extensions": about}]})
        file.add("nodes", {"mesh": 0})
        scene["scenes"] = [{"nodes": [0]}]
    packed = io.BytesIO()
    file.finish(packed, scene)
    return packed.getvalue()


def _smallest_three(turns: Float64[np.ndarray, "N 4"]) -> np.ndarray:
    """Return quaternions x y z w in 32 bits each: the index of the largest part, then sign and size of the others."""
    rows, largest = np.arange(len(turns)), np.abs(turns).argmax(axis=1)
    turns = turns * np.where(turns[rows, largest] < 0, -1.0, 1.0)[:, None]
    packed = largest.astype("<u4")
    for part in range(4):
        values = turns[:, part]
        size = np.round(511 * np.minimum(np.abs(values) * math.sqrt(2), 1)).astype("<u4")
        packed = np.where(largest == part, packed, packed << 10 | (values < 0).astype("<u4") << 9 | size)
    return packed.astype("<u4")


def _bytes(values: Float64[np.ndarray, "..."]) -> UInt8[np.ndarray, "..."]:
    return np.clip(np.round(values), 0, 255).astype(np.uint8)


def _rows(bound: Bound) -> Float64[np.ndarray, "N 17"]:
    visible = bound.opacities > 0
    opacities = np.minimum(bound.opacities[visible], MOST_OPACITY)
    logits, axes = np.log(opacities / (1 - opacities))[:, None], bound.axes[visible]
    looks = [(bound.colors[visible] - 0.5) / HARMONIC, logits, np.log(bound.scales[visible])]
    return np.concatenate([bound.means[visible], axes[:, 2], *looks, quaternions(np.swapaxes(axes, 1, 2))], axis=1)
