"""What a layer of patches is worth on captured bodies: none, dropped faces only, both, and all that there is to gain.

python benchmarks/tails.py --data ../shared/data/performers        # half an hour; `dancer crane ...` for some

In: folders and .npz files of performers. Out: a table, and the rows `tails` of docs/decisions/measured.jsonl.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from captured import Case, Row, asked_cases, keep
from jaxtyping import Bool

from meshreel.coding.layers.coder import LayersState, decode_layers
from meshreel.encoder.forms import EncodedGroup
from meshreel.encoder.layers import encode_interval
from meshreel.encoder.presets import preset_options
from meshreel.encoder.tails import TailOptions, find_tails
from meshreel.format.layout import Form
from meshreel.format.records import pack
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import drop_unreferenced
from meshreel.metrics.distance import SurfaceErrors, surface_errors
from meshreel.metrics.ssim import ssim_normals
from meshreel.metrics.viewpoints import Box, parallel_views_around
from meshreel.types import Mesh

DECISION, FRAME_RATE, VIEW = "tails", 30.0, 512
QUALITIES = (25, 50, 85)
CASES = (
    Case("dancer"),
    Case("basketball_player"),
    Case("mitch"),
    Case("collision", 15, 31),
    Case("crane", 80, 16),
)
WAYS: dict[str, TailOptions | None] = {
    "none": None,
    "dropped faces": TailOptions(shares=()),
    "and patches": TailOptions(),
}
UNCODED = 4.0  # RMS distances from which surface counts as a tail, where nothing has a price


def main() -> int:
    """Measures every case that was asked for and puts its rows in the place of older ones."""
    for case, frames in asked_cases(__doc__, CASES):
        for quality in QUALITIES:
            groups = list(encode_interval(frames, replace(preset_options("best", quality), tails=None)))
            keep(rows_of(case, quality, frames, groups), "case", "quality")
    return 0


def rows_of(case: Case, quality: float, frames: Sequence[Mesh], groups: Sequence[EncodedGroup]) -> Iterator[Row]:
    """A row for each way to treat the tails of groups that are coded without."""
    decoded = list(places_of(groups))
    known: tuple[int, Row] | None = None
    for way, options in WAYS.items():
        begin = time.process_time()
        shown, size, first = list[Mesh](), 0, 0
        for group, plain in zip(groups, decoded, strict=True):
            meshes, more = treated(frames[first : first + group.frame_count], plain, len(group.payload), options)
            shown, size, first = shown + meshes, size + len(group.payload) + more, first + group.frame_count
        cost = (time.process_time() - begin) / len(frames)
        if known is None or known[0] != size:  # where no byte is spent nothing changes
            known = size, summary(frames, shown)
        yield row(case, quality, way, size) | {"cpu_s_per_frame": cost} | known[1]
    everything = [without_tails(a, b) for a, b in zip(frames, chain(*decoded), strict=True)]
    yield row(case, quality, "all tails, not coded", None) | summary(frames, everything)


def row(case: Case, quality: float, way: str, size: int | None) -> Row:
    """What was measured, and its size."""
    name = f"{case.performer} {case.first}-{case.first + case.count - 1}"
    mbps = None if size is None else size * 8 * FRAME_RATE / case.count / 1e6
    return {"decision": DECISION, "case": name, "quality": quality, "way": way, "mbps": mbps}


def places_of(groups: Sequence[EncodedGroup]) -> Iterator[list[Mesh]]:
    """The frames of each group."""
    state: LayersState | None = None
    for group in groups:
        assert group.form == Form.LAYERS, "a group of another form has no tails: choose other frames"
        faces, positions, state = decode_layers(group.payload, None, state)
        yield [Mesh(places, faces) for places in positions]


def treated(
    frames: Sequence[Mesh], plain: list[Mesh], size: int, options: TailOptions | None
) -> tuple[list[Mesh], int]:
    """The frames of a group as shown, and the bytes of its patches."""
    positions = np.stack([mesh.vertices for mesh in plain])
    found = options and find_tails(frames, positions, plain[0].faces, size, options)
    return (found.frames, len(pack(found.record))) if found else (plain, 0)


def without_tails(original: Mesh, decoded: Mesh) -> Mesh:
    """The decoded mesh without its faces that are far from the original, and with the original's far from it."""
    gone, lost = far(decoded, original), far(original, decoded)
    faces = np.concatenate([decoded.faces[~gone], original.faces[lost] + len(decoded.vertices)])
    return drop_unreferenced(Mesh.of(np.concatenate([decoded.vertices, original.vertices]), faces))


def far(mesh: Mesh, other: Mesh) -> Bool[np.ndarray, " F"]:
    """Faces whose centroid is farther from the other mesh than UNCODED times the RMS of the nearest 98 %."""
    points = mesh.vertices[mesh.faces].mean(axis=1)
    distances = np.linalg.norm(Surface(other).closest(points).points - points, axis=1)
    body = np.sort(distances)[: int(0.98 * len(distances))]
    return np.asarray(distances > UNCODED * np.sqrt(np.mean(body**2)))


def summary(frames: Sequence[Mesh], shown: Sequence[Mesh]) -> Row:
    """Means over the frames, PSNR of the mean error; SSIM in four orthographic views."""
    errors = [surface_errors(a, b) for a, b in zip(frames, shown, strict=True)]
    cameras = parallel_views_around(Box.of(frames), VIEW)
    return {
        "d2_psnr_paper": mean_psnr([e.d2_psnr_paper for e in errors]),
        "d2_psnr": mean_psnr([e.d2_psnr for e in errors]),
        "symmetric_psnr": mean_psnr([e.symmetric_psnr for e in errors]),
        "worst_symmetric_psnr": min(e.symmetric_psnr for e in errors),
        "normal_error_deg": mean_angle(errors),
        "ssim_masked": float(np.mean([ssim_normals(a, b, cameras).masked for a, b in zip(frames, shown, strict=True)])),
    }


def mean_psnr(values: Sequence[float]) -> float:
    """The PSNR of the frames' mean squared error, dB."""
    return float(-10 * np.log10(np.mean([10 ** (-value / 10) for value in values])))


def mean_angle(errors: Sequence[SurfaceErrors]) -> float:
    """Degrees."""
    return float(np.mean([e.angle for e in errors]))


if __name__ == "__main__":
    sys.exit(main())
