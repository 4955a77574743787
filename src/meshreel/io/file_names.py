"""File names: the frame files of a sequence and their order, patterns, and names that are not Unicode text."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import pairwise
from pathlib import Path, PurePath, PurePosixPath
from typing import TypeVar

from ..errors import InputError
from .files import Place, Remote, located
from .meshes import EXTENSIONS

MESHES = "meshes"  # name of a folder of frames beside the files of their cameras
_MAGIC = re.compile(r"[*?\[]")
_P = TypeVar("_P", bound=PurePath)


def is_text(name: str) -> bool:
    """Return whether a name is Unicode text. Linux allows names that are not; Python has lone surrogates for them."""
    try:
        name.encode()
    except UnicodeEncodeError:
        return False
    return True


def is_pattern(name: str) -> bool:
    return _MAGIC.search(name) is not None


def find_frames(source: str | Path | Iterable[str | Path]) -> tuple[tuple[Place, ...], tuple[str, ...]]:
    """Return the frame files of a source and warnings about their order. A list keeps its order.

    For a folder without mesh files, use its subfolder `meshes`, as in the releases of TSMC's authors.
    """
    if not isinstance(source, str | Path):
        return tuple(located(path) for path in source), ()
    path = located(source)
    if isinstance(path, Remote):
        return _find_remote(path)
    try:
        is_folder = path.is_dir()
    except OSError as error:  # a name that is too long, or a folder without permission
        raise InputError(f"{source}: cannot be read ({error.strerror}); check the path and its rights") from None
    if is_folder:
        folder, meshes = path, _listed(path)
        if not meshes and (path / MESHES).is_dir():
            folder, meshes = path / MESHES, _listed(path / MESHES)
        _check_kind(folder, meshes)
        return _ordered(folder, folder, meshes)
    if path.exists():
        return (path,), ()
    if is_pattern(str(source)):
        root, meshes = _globbed(path)
        if not meshes:
            raise InputError(f"{source}: no mesh file fits this pattern; check it, or name the folder")
        return _ordered(root, root, meshes)
    raise InputError(f"{source}: no such file or folder; check the path")


def _find_remote(place: Remote) -> tuple[tuple[Remote, ...], tuple[str, ...]]:
    """Return the frame files of a folder behind a URL or of a pattern, or the single file."""
    wild = _MAGIC.search(place.url)
    if wild is None and place.suffix.lower() in EXTENSIONS:
        return (place,), ()
    end = len(place.url) if wild is None else place.url.rindex("/", 0, wild.start())
    folder = Remote(place.url[:end])
    try:
        names = folder.names(place.url[end + 1 :])
    except OSError as error:
        raise InputError(f"{place}: cannot be read ({error}); check the URL and your rights") from None
    meshes = [path for path in map(PurePosixPath, names) if _has_mesh_name(path)]
    if wild is None or not meshes:
        _check_kind(place, meshes)
    paths, remarks = _ordered(place, PurePosixPath(), meshes)
    return tuple(folder / str(path) for path in paths), remarks


def _globbed(pattern: Path) -> tuple[Path, list[Path]]:
    fixed = next(k for k, part in enumerate(pattern.parts) if _MAGIC.search(part))
    root = Path(*pattern.parts[:fixed])
    try:
        paths = list(root.glob(str(Path(*pattern.parts[fixed:]))))
    except ValueError as error:
        raise InputError(f"{pattern}: is no pattern ({error}); mend it, or name the folder") from None
    return root, [path for path in paths if _has_mesh_name(path) and not path.is_dir()]


def _has_mesh_name(path: PurePath) -> bool:
    return path.suffix.lower() in EXTENSIONS and not path.name.startswith(".")


def _listed(folder: Path) -> list[Path]:
    try:
        return [path for path in folder.iterdir() if _has_mesh_name(path) and not path.is_dir()]
    except OSError as error:
        raise InputError(f"{folder}: cannot be read ({error.strerror}); check its rights") from None


def _check_kind(folder: Place, files: Sequence[PurePath]) -> None:
    """Raise InputError if a folder has no mesh files, or several kinds."""
    kinds = Counter(path.suffix.lower() for path in files)
    if not files:
        raise InputError(f"{folder}: holds 0 mesh files; give a folder with {', '.join(EXTENSIONS)} files")
    if len(kinds) > 1:
        counts = ", ".join(f"{count} {kind}" for kind, count in sorted(kinds.items()))
        raise InputError(f"{folder}: holds several kinds of files ({counts}); choose one, as '{folder}/*{min(kinds)}'")


def _ordered(source: Place, root: _P, paths: list[_P]) -> tuple[tuple[_P, ...], tuple[str, ...]]:
    """Sort paths below `root` by frame number, the last number that differs between names of one pattern."""
    names = {path: path.relative_to(root).with_suffix("").as_posix() for path in sorted(paths)}
    if len(paths) == 1:
        return tuple(paths), ()
    numbers = {path: tuple(int(n) for n in re.findall(r"\d+", name)) for path, name in names.items()}
    patterns = {re.sub(r"\d+", "#", name): name for name in names.values()}
    if not any(numbers.values()):
        return tuple(names), (f"{source}: the {len(paths)} file names have no numbers; taken in alphabetical order",)
    if len(patterns) > 1:
        first, second = sorted(patterns.values())[:2]
        text = f"{source}: names follow {len(patterns)} patterns, as {first!r} and {second!r}"
        raise InputError(f"{text}; give a glob that fits one of them")
    columns = list(zip(*numbers.values(), strict=True))
    varying = next((k for k in reversed(range(len(columns))) if len(set(columns[k])) > 1), 0)
    key = {path: number[varying] for path, number in numbers.items()}
    order = sorted(names, key=lambda path: key[path])
    for before, after in pairwise(order):
        if key[before] == key[after]:
            text = f"{source}: {names[before]!r} and {names[after]!r} both have frame number {key[before]}"
            raise InputError(f"{text}; give a glob that fits only one of them")
    return tuple(order), _gaps(source, [key[path] for path in order])


def _gaps(source: Place, numbers: Sequence[int]) -> tuple[str, ...]:
    """Return a warning about missing frame numbers, if most numbers are one step apart."""
    steps = [after - before for before, after in pairwise(numbers)]
    usual, count = Counter(steps).most_common(1)[0]
    wide = [(before, step) for before, step in zip(numbers, steps, strict=False) if step >= 2 * usual]
    if not wide or 2 * count <= len(steps):  # timestamps in place of numbers have uneven steps
        return ()
    lost, (first, step) = sum(step // usual - 1 for _, step in wide), wide[0]
    text = f"{lost} frames are missing between the file names, the first between {first} and {first + step}"
    return (f"{source}: {text}; the others follow one another without a pause",)
