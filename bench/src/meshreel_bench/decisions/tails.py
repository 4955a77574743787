"""Decision 13: a layer of patches on captured bodies; none, dropped faces alone, both, all that could be gained."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import chain

import numpy as np
from jaxtyping import Bool

from meshreel.encoder.forms import EncodedGroup
from meshreel.encoder.interval import Interval
from meshreel.encoder.layers import encode_interval
from meshreel.encoder.presets import layers_options
from meshreel.encoder.tails import TailOptions, find_tails
from meshreel.format.records import pack
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.topology import drop_unreferenced
from meshreel.metrics.distance import surface_errors
from meshreel.metrics.ssim import ssim_normals
from meshreel.metrics.viewpoints import Box
from meshreel.types import Mesh

from ..parallel_views import parallel_views_around
from .rows import Case, Row, Sources, decoded, mbps_of

VIEW = 512  # pixels a side of a view
QUALITIES = (25, 50, 85)
CASES = (Case("dancer"), Case("basketball_player"), Case("mitch"), Case("collision", 15, 31), Case("crane", 80, 16))
WAYS: dict[str, TailOptions | None] = {
    "none": None,
    "dropped faces": TailOptions(shares=()),
    "and patches": TailOptions(),
}
UNCODED = 4.0  # RMS distances from which surface is replaced where nothing has a price: the first of `TailOptions`
BODY = 0.98  # share of the nearest surface by which that RMS is measured, as in `encoder.tails`


def measure(sources: Sources) -> Iterator[Row]:
    """Yield the rows of every case and quality."""
    for case in CASES:
        frames = case.frames(sources.data)
        name = f"{case.performer} {case.first}-{case.first + case.count - 1}"
        for quality in QUALITIES:
            groups = list(encode_interval(Interval(frames), replace(layers_options(quality), tails=None)))
            for row in rows_of(frames, groups):
                yield {"case": name, "quality": quality} | row


def rows_of(frames: Sequence[Mesh], groups: Sequence[EncodedGroup]) -> Iterator[Row]:
    """Yield a row for each way to treat the tails of groups that are coded without."""
    plain = list(decoded(groups))
    known: tuple[int, Row] | None = None
    for way, options in WAYS.items():
        begin, shown, first = time.process_time(), list[Mesh](), 0
        size = sum(len(group.payload) for group in groups)
        for group, meshes in zip(groups, plain, strict=True):
            own = frames[first : first + group.frame_count]
            treated, more = with_tails(own, meshes, len(group.payload), options)
            shown, size, first = shown + treated, size + more, first + group.frame_count
        cost = (time.process_time() - begin) / len(frames)
        if known is None or known[0] != size:  # frames differ only where bytes are spent
            known = size, summary(frames, shown)
        yield {"way": way, "mbps": mbps_of(size, len(frames)), "cpu_s_per_frame": cost} | known[1]
    everything = [replaced(a, b) for a, b in zip(frames, chain(*plain), strict=True)]
    yield {"way": "all tails, not coded", "mbps": None} | summary(frames, everything)


def with_tails(
    frames: Sequence[Mesh], plain: list[Mesh], size: int, options: TailOptions | None
) -> tuple[list[Mesh], int]:
    """Return the frames of a group as shown, and the bytes of its patches."""
    found = options and find_tails(frames, plain, size, options, noise=0.0)
    return (found.frames, len(pack(found.record))) if found else (plain, 0)


def replaced(original: Mesh, shown: Mesh) -> Mesh:
    """Return the decoded mesh with its faces that are far from the original replaced by the original's far from it."""
    gone, lost = far(shown, original), far(original, shown)
    faces = np.concatenate([shown.faces[~gone], original.faces[lost] + len(shown.vertices)])
    return drop_unreferenced(Mesh.of(np.concatenate([shown.vertices, original.vertices]), faces))


def far(mesh: Mesh, other: Mesh) -> Bool[np.ndarray, " F"]:
    """Return which faces have their centroid beyond `UNCODED` RMS distances of the other mesh."""
    points = mesh.vertices[mesh.faces].mean(axis=1)
    distances = np.linalg.norm(Surface(other).closest(points).points - points, axis=1)
    body = np.sort(distances)[: int(BODY * len(distances))]
    return np.asarray(distances > UNCODED * np.sqrt(np.mean(body**2)))


def summary(frames: Sequence[Mesh], shown: Sequence[Mesh]) -> Row:
    """Return PSNRs of the mean error, and means of angles and of SSIM in four parallel views."""
    errors = [surface_errors(a, b) for a, b in zip(frames, shown, strict=True)]
    cameras = parallel_views_around(Box.of(frames), VIEW)
    return {
        "d2_psnr_paper": mean_psnr([each.d2_psnr_paper for each in errors]),
        "d2_psnr": mean_psnr([each.d2_psnr for each in errors]),
        "symmetric_psnr": mean_psnr([each.symmetric_psnr for each in errors]),
        "worst_symmetric_psnr": min(each.symmetric_psnr for each in errors),
        "normal_error_deg": float(np.mean([each.angle for each in errors])),
        "ssim_masked": float(np.mean([ssim_normals(a, b, cameras).masked for a, b in zip(frames, shown, strict=True)])),
    }


def mean_psnr(values: Sequence[float]) -> float:
    """Return the PSNR of the frames' mean squared error, dB."""
    return float(-10 * np.log10(np.mean([10 ** (-value / 10) for value in values])))
