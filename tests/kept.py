"""Files that many tests need and that take long to make: made once, for all workers of a run and for later runs.

They lie in build/tests/kept under a digest of the sources, the helpers of tests and the versions of packages, so that a
change of any makes all of them again. A file gets its name when it is whole: two workers never see half of one.
"""

import hashlib
import importlib.metadata
import os
import pickle
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterable
from functools import cache
from pathlib import Path
from typing import Any

import meshreel

TESTS = Path(__file__).resolve().parent
FOLDER = TESTS.parent / "build" / "tests" / "kept"
MOST = 4  # states of the sources that are kept: this one and the last ones
PACKAGES = ("numpy", "scipy", "DracoPy", "libigl", "trimesh", "fast-simplification", "av", "xatlas", "pillow", "torch")


def kept(make: Callable[[Path], Any], name: str, *key: object) -> tuple[Path, Any]:
    """Return the file that `make` writes, never to be changed, and the value that it returned when it did.

    `name` is the file's; `key` is all that its bytes follow from: values that can be pickled, paths by what they hold.
    """
    folder = _folder() / _digest(name, make.__qualname__, *key)
    if not folder.exists():
        made = Path(tempfile.mkdtemp(dir=_folder()))
        (made / "value").write_bytes(pickle.dumps(make(made / name)))
        try:
            made.rename(folder)
        except OSError:  # another worker was first
            shutil.rmtree(made)
    return folder / name, pickle.loads((folder / "value").read_bytes())


def content(path: Path) -> str:
    """Return the digest of a file, or of a folder's files and their names."""
    files = sorted(path.rglob("*")) if path.is_dir() else [path]
    return _sum(part for file in files if file.is_file() for part in (file.name.encode(), file.read_bytes()))


def _digest(*key: object) -> str:
    return _sum(pickle.dumps(content(part) if isinstance(part, Path) else part) for part in key)[:32]


def _sum(parts: Iterable[bytes]) -> str:
    return hashlib.sha256(b"".join(hashlib.sha256(part).digest() for part in parts)).hexdigest()


@cache
def _folder() -> Path:
    """Return the folder of these sources; the ones of states that are long gone are removed."""
    package = Path(meshreel.__file__).parent
    sources = [path for path in sorted(package.rglob("*")) if path.suffix in (".py", ".so", ".pyd")]
    helpers = [path for path in sorted(TESTS.rglob("*.py")) if not path.name.startswith("test_")]
    versions = [f"{name} {_version(name)}" for name in PACKAGES]
    digest = _sum(
        [path.read_bytes() for path in (*sources, *helpers)] + [sys.version.encode(), *map(str.encode, versions)]
    )
    (own := FOLDER / digest[:16]).mkdir(parents=True, exist_ok=True)
    os.utime(own)
    for old in sorted(FOLDER.iterdir(), key=lambda folder: -folder.stat().st_mtime)[MOST:]:
        shutil.rmtree(old, ignore_errors=True)
    return own


def _version(name: str) -> str:
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        return "none"
