"""Export of the splats of a frame to PLY as viewers of 3D Gaussian splatting read it (Kerbl et al. 2023).

In: Gaussians in metres. Out: a file with their places, logarithms of scales, quaternions, logits of opacities, and
colours as harmonics of degree 0. Those that the frame does not show are left out.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..decoder.video import Video
from ..errors import InputError
from ..geometry.rigid import quaternions
from ..geometry.splats import Bound
from ..io.write import replacing

HARMONIC = 0.28209479177387814  # of degree 0: 1 / (2 sqrt(pi))
MOST_OPACITY = 1 - 2**-10  # whose logit is finite
NAMES = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3"


def check_splats(video: Video, name: str) -> None:
    """Raise InputError where a video has no splats."""
    if not video.reader.has_splats:
        raise InputError(f"{name}: has no splats; encode with --splats 8000")


def write_splats(bound: Bound | None, path: Path) -> None:
    """Write Gaussians, which may be none, to a PLY file, which appears when it is complete."""
    rows = np.zeros((0, len(NAMES.split()))) if bound is None else _rows(bound)
    properties = "".join(f"property float {name}\n" for name in NAMES.split())
    head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{properties}end_header\n"
    with replacing(path) as file:
        file.write(head.encode() + rows.astype("<f4").tobytes())


def _rows(bound: Bound) -> np.ndarray:
    shown = bound.opacities > 0
    opacities = np.minimum(bound.opacities[shown], MOST_OPACITY)
    columns = (
        bound.means[shown],
        bound.axes[shown, 2],
        (bound.colors[shown] - 0.5) / HARMONIC,
        np.log(opacities / (1 - opacities))[:, None],
        np.log(bound.scales[shown]),
        quaternions(np.swapaxes(bound.axes[shown], 1, 2)),
    )
    return np.concatenate(columns, axis=1)
