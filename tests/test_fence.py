"""What a player may rely on: a handful of names, and no heavy package behind them."""

from __future__ import annotations

import subprocess
import sys

import meshreel
from tests.golden import GOLDEN

HEAVY = (
    "open3d",
    "scipy",
    "torch",
    "skimage",
    "igl",
    "fast_simplification",
    "matplotlib",
    "trimesh",
    "rich",
    "cyclopts",
)
ENCODER_SIDE = (
    *("analysis", "capture", "metrics", "encoder", "layered", "windows", "choice", "presets", "rate_control"),
    *("cli", "io"),
)

LOOK = f"""
import sys
import meshreel.decoder.video
for path in sys.argv[1:]:
    for frame in meshreel.decoder.video.open(path):
        pass
loaded = set(sys.modules)
print([name for name in {HEAVY!r} if name in loaded])
print([name for name in {ENCODER_SIDE!r} if "meshreel." + name in loaded])
"""


def test_decoding_loads_no_heavy_package_and_nothing_of_the_encoder():
    command = [sys.executable, "-c", LOOK, *(str(GOLDEN / f"{name}.reel") for name in ("mixed", "layers", "scene"))]
    answer = subprocess.run(command, capture_output=True, text=True, check=True)
    assert answer.stdout.split("\n")[:2] == ["[]", "[]"]


def test_the_promised_names_are_these():
    assert meshreel.__all__ == [
        "EncoderOptions",
        "FormatError",
        "InputError",
        "Mesh",
        "MeshList",
        "MeshSequence",
        "MeshreelError",
        "Video",
        "encode",
        "open",
        "open_sequence",
        "preset_options",
    ]
    assert len(meshreel.__all__) <= 15
    assert all(getattr(meshreel, name) is not None for name in meshreel.__all__)
