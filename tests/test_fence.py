"""The public names, and the packages that decoding must not import."""

from __future__ import annotations

import subprocess
import sys

import pytest

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
ENCODER_SIDE = ("analysis", "capture", "metrics", "encoder", "export", "server", "cli", "io")

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
        "SequenceOptions",
        "Video",
        "as_sequence",
        "encode",
        "open",
        "open_sequence",
        "preset_options",
    ]
    assert 12 <= len(meshreel.__all__) <= 16
    assert all(getattr(meshreel, name) is not None for name in meshreel.__all__)


def test_dir_lists_the_promised_names_and_only_these():
    assert dir(meshreel) == sorted(meshreel.__all__)


def test_a_name_that_is_not_promised_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'decode'"):
        _ = meshreel.decode
