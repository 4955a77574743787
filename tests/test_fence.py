"""The public names, and the packages that decoding must not import."""

import os
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
    "jaxtyping",
    "importlib.metadata",
    "unittest",
    "DracoPy",
)
LATER = ("meshreel.coding.paper", "html", *HEAVY)  # what some files need, or none
MOST_OPENING = 2.0  # CPU times of importing NumPy that opening a file may take (guess; with jaxtyping it takes more)
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


def test_importing_the_package_loads_no_numpy_and_none_of_its_parts():
    code = "import sys, meshreel; print([name for name in sys.modules if name.startswith(('numpy', 'meshreel.'))])"
    answer = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert answer.stdout == "['meshreel.errors']\n"


def test_opening_loads_nothing_that_only_some_files_need():
    opened = f"import sys, meshreel; meshreel.open({str(GOLDEN / 'layers.reel')!r})"
    command = [sys.executable, "-c", f"{opened}; print([name for name in {LATER!r} if name in sys.modules])"]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "[]\n"


@pytest.mark.clock
def test_opening_takes_hardly_longer_than_importing_numpy():
    opening, numpy = least_seconds(f"import meshreel; meshreel.open({str(GOLDEN / 'layers.reel')!r})", "import numpy")
    assert opening <= MOST_OPENING * numpy


def least_seconds(*codes: str) -> list[float]:
    """Return the least CPU time of fresh processes that run each code, with compiled modules and one thread of BLAS."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    times = [[seconds(code, environment) for code in codes] for _ in range(15)]  # in turn: other jobs disturb all alike
    return [min(of_one) for of_one in zip(*times, strict=True)]


def seconds(code: str, environment: dict[str, str]) -> float:
    command = [sys.executable, "-c", f"{code}\nimport time; print(time.process_time())"]
    return float(subprocess.run(command, capture_output=True, env=environment, check=True).stdout)


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
        "Settings",
        "Video",
        "as_sequence",
        "edit",
        "encode",
        "open",
        "open_sequence",
    ]
    assert 12 <= len(meshreel.__all__) <= 16
    assert all(getattr(meshreel, name) is not None for name in meshreel.__all__)


def test_dir_lists_the_promised_names_and_what_every_module_has():
    assert [name for name in dir(meshreel) if not name.startswith("_")] == sorted(meshreel.__all__)
    assert {"__version__", "__doc__", "__file__"} <= set(dir(meshreel))
    assert not [name for name in dir(meshreel) if name.startswith("_") and not name.startswith("__")]


def test_a_name_that_is_not_promised_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'decode'"):
        _ = meshreel.decode
