"""File names: the frame files of a sequence and their order, patterns, and names that are not Unicode text."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Sequence
from fractions import Fraction
from itertools import pairwise
from pathlib import Path, PurePath, PurePosixPath
from typing import Any, Literal, TypeVar

from ..errors import InputError
from .files import Place, Remote, located, located_all
from .meshes import EXTENSIONS

MESHES = "meshes"  # name of a folder of frames beside the files of their cameras
Order = Literal["auto", "all", "last", "name"]  # of names: by all their numbers, by the last one, or by letters
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


def find_frames(
    source: str | Path | Iterable[str | Path], order: Order = "auto"
) -> tuple[tuple[Place, ...], tuple[str, ...]]:
    """Return a source's frame files, or those of its folder `meshes`, and warnings. A list keeps its order."""
    if not isinstance(source, str | Path):
        return tuple(located_all(source)), ()
    path = located(source)
    if isinstance(path, Remote):
        return _find_remote(path, order)
    try:
        is_folder = path.is_dir()
    except OSError as error:  # a name that is too long, or a folder without permission
        raise InputError(f"{source}: cannot be read ({error.strerror}); check the path and its rights") from None
    if is_folder:
        folder, meshes = path, listed(path)
        if not meshes and (path / MESHES).is_dir():
            folder, meshes = path / MESHES, listed(path / MESHES)
        _check_kind(folder, meshes)
        return ordered(folder, folder, meshes, order)
    if path.exists():
        return (path,), ()
    if is_pattern(str(source)):
        root, meshes = globbed(path)
        if not meshes:
            raise InputError(f"{source}: no mesh file fits this pattern; check it, or name the folder")
        return ordered(root, root, meshes, order)
    raise InputError(f"{source}: no such file or folder; check the path")


def _find_remote(place: Remote, order: Order) -> tuple[tuple[Remote, ...], tuple[str, ...]]:
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
    meshes = [path for path in map(PurePosixPath, names) if _is_shown(path)]
    if wild is None or not meshes:
        _check_kind(place, meshes)
    paths, remarks = ordered(place, PurePosixPath(), meshes, order)
    return tuple(folder / str(path) for path in paths), remarks


def globbed(pattern: Path, kinds: Collection[str] = EXTENSIONS) -> tuple[Path, list[Path]]:
    """Return the folder above a pattern's first wildcard, and the files of these kinds that fit. Raises InputError."""
    parts = pattern.parts
    there = [k for k in range(len(parts)) if Path(*parts[: k + 1]).is_dir()]  # a folder may have brackets in its name
    fixed = next(k for k in range(len(there), len(parts)) if k == len(parts) - 1 or _MAGIC.search(parts[k]))
    root = Path(*pattern.parts[:fixed])
    try:
        paths = list(root.glob(str(Path(*pattern.parts[fixed:]))))
    except ValueError as error:
        raise InputError(f"{pattern}: is no pattern ({error}); mend it, or name the folder") from None
    return root, [path for path in paths if _is_shown(path, kinds) and not path.is_dir()]


def _is_shown(path: PurePath, kinds: Collection[str] = EXTENSIONS) -> bool:
    return path.suffix.lower() in kinds and not path.name.startswith(".")


def listed(folder: Path, kinds: Collection[str] = EXTENSIONS) -> list[Path]:
    """Return the files of these kinds in a folder, in any order. Raises InputError for one without permission."""
    try:
        return [path for path in folder.iterdir() if _is_shown(path, kinds) and not path.is_dir()]
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


def ordered(source: Place, root: _P, paths: list[_P], order: Order) -> tuple[tuple[_P, ...], tuple[str, ...]]:
    """Sort paths below `root` by the numbers in their names; return warnings about these, too."""
    names = {path.relative_to(root).with_suffix("").as_posix(): path for path in sorted(paths)}
    if len(paths) == 1:
        return tuple(paths), ()
    if order == "auto" and not any(re.search(r"\d", name) for name in names):
        remark = f"{source}: the {len(paths)} file names have no numbers; taken in alphabetical order"
        return tuple(names.values()), (remark,)
    found, numbers = in_order(source, list(names), order)
    return tuple(names[name] for name in found), gaps(source, numbers)


def in_order(source: Place, names: list[str], order: Order = "auto") -> tuple[list[str], list[int]]:
    """Return names by their numbers, and these if one alone decides. Raises InputError, which names `source`."""
    if order == "name":
        return sorted(names), []
    found, columns = _decided(source, names, order)
    whole = len(columns) == 1 and "." not in columns[0][0]
    return found, [int(columns[0][names.index(name)]) for name in found] if whole else []


def frame_keys(source: Place, names: list[str], order: Order = "auto") -> dict[str, tuple[str | Fraction, ...]]:
    """Return the key that each name is sorted by, equal in folders of pictures of one moment. Raises as `in_order`."""
    if order == "name":
        return {name: (name,) for name in names}
    if len(names) == 1:
        return {names[0]: (Fraction(re.findall(r"\d+", names[0])[-1]),)}
    _, columns = _decided(source, names, order, of_time=True)
    return {name: tuple(map(Fraction, key)) for name, key in zip(names, zip(*columns, strict=True), strict=True)}


def _decided(source: Place, names: list[str], order: Order, of_time: bool = False) -> tuple[list[str], list[Column]]:
    """Return names in order and the numbers that decide it; `of_time` as `_columns` has it."""
    patterns = {re.sub(r"\d+", "#", name): name for name in names}
    if len(patterns) > 1:
        first, second = sorted(patterns.values())[:2]
        text = f"{source}: names follow {len(patterns)} patterns, as {first!r} and {second!r}"
        raise InputError(f"{text}; give a glob that fits one of them, move the others away, or --order name")
    columns = _columns(names, next(iter(patterns)), of_time)
    if not columns:
        raise InputError(f"{source}: {names[0]!r} and {len(names) - 1} more names differ by no number; mend them")
    both = (columns, columns[-1:])
    by_all, by_last = (_sorted(source, names, list(zip(*chosen, strict=True)), order) for chosen in both)
    if not by_all:  # two names share the one number
        _sorted(source, names, list(zip(*columns, strict=True)), "last")
    if order == "last" or by_all == by_last:
        best = max(columns, key=lambda column: (_evenness(column), -max(map(len, column))))  # not a time
        return by_last or by_all, [best]
    if order != "all" and _evenness(columns[0]) > max(0.5, _evenness(columns[-1])):
        return by_all, columns[:1]  # what stands behind is a count, or a hash
    if order == "all" or all(map(_wraps, columns[1:])):
        return by_all, columns
    if not by_last:
        _sorted(source, names, list(zip(*columns[-1:], strict=True)), "last", f", or --order all for {_first(by_all)}")
    ways = f"{_first(by_all)} (--order all), or {_first(by_last)} (--order last); say which"
    raise InputError(f"{source}: the {len(names)} names have several numbers, and may be in the order {ways}")


def _first(names: list[str]) -> str:
    return f"{', '.join(names[:3])} ..."


Column = tuple[str, ...]  # a number of each name, as it is written


def _columns(names: list[str], pattern: str, of_time: bool) -> list[Column]:
    """Return the numbers that differ; two with a point between are one, of a time also where the whole is alike."""
    columns, found = zip(*(re.findall(r"\d+", name) for name in names), strict=True), list[Column | None]()
    before: Column | None = None
    for column, text in zip(columns, ["", *pattern.split("#")[1:]], strict=False):
        whole = before if of_time and len({*map(len, column)}) == 1 else found[-1] if found else None
        before = column
        if len({*map(int, column)}) == 1:
            found.append(None)
        elif text == "." and whole is not None and "." not in whole[0]:
            found[-1] = before = tuple(f"{one}.{part}" for one, part in zip(whole, column, strict=True))
        else:
            found.append(column)
    return [column for column in found if column is not None]


def _sorted(source: Place, names: list[str], keys: list[Column], order: Order, remedy: str = "") -> list[str]:
    """Return names by their numbers; none where two have equal ones, which is an error if all numbers count."""
    numbers = {name: tuple(map(Fraction, key)) for name, key in zip(names, keys, strict=True)}
    found = sorted(names, key=numbers.__getitem__)
    for before, after in pairwise(found):
        if numbers[before] == numbers[after]:
            if len(keys[0]) == 1 and order != "last":
                return []
            text = f"{source}: {before!r} and {after!r} both have frame number {float(numbers[before][-1]):.12g}"
            raise InputError(f"{text}; give a glob that fits only one of them{remedy}")
    for others in _other_readings(names, keys) if order == "auto" else ():
        if (other := sorted(names, key=dict(zip(names, others, strict=True)).__getitem__)) != found:
            ways = f"{_first(found)} (--order all), or {_first(other)} (name them so that these sort); say which"
            raise InputError(f"{source}: numbers of the {len(names)} names may be fractions, or dates: {ways}")
    return found


def _other_readings(names: list[str], keys: list[Column]) -> Iterator[list[tuple[Any, ...]]]:
    """Yield keys of names by other readings of their numbers: as versions, as decimals, as dates that end in a year."""
    yield [tuple(map(int, ".".join(key).split("."))) for key in keys]
    columns = list(zip(*keys, strict=True))
    if any(one[0] == "0" and len(one) > min(map(len, column)) for column in columns for one in column):  # 033 beside 1
        yield [tuple(Fraction(one if "." in one else f"0.{one}") for one in key) for key in keys]
    dates = [re.search(r"(?<!\d)(\d\d)\D(\d\d)\D((?:19|20)\d\d)(?!\d)", name) for name in names]
    for parts in ((3, 2, 1), (3, 1, 2)) if all(dates) else ():
        pairs = zip(dates, keys, strict=True)
        yield [(*(date and date[part] for part in parts), *map(Fraction, key)) for date, key in pairs]


def _evenness(column: Column) -> float:
    """Return the share of equal steps, or nearly so, between numbers; 0 if two numbers are equal."""
    values = sorted(map(float, column))
    steps = sorted(after - before for before, after in pairwise(values))
    usual = steps[len(steps) // 2]
    return sum(abs(step - usual) <= 0.1 * usual for step in steps) / len(steps) if steps[0] > 0 else 0.0


def _wraps(column: Column) -> bool:
    """Return True if numbers run up to a limit of clocks: to 60 or 24, or through all digits behind a second."""
    widths = {len(number) for number in column}
    limit = {2: 60, 3: 1000, 6: 10**6, 9: 10**9}.get(widths.pop(), 0) if len(widths) == 1 else 0
    return limit > max(map(float, column)) >= limit / 3


def gaps(source: Place, numbers: Sequence[int]) -> tuple[str, ...]:
    """Return a warning about missing frame numbers, if most numbers are one step apart."""
    if len(numbers) < 2:
        return ()
    steps = [after - before for before, after in pairwise(numbers)]
    usual, count = Counter(steps).most_common(1)[0]
    wide = [(before, step) for before, step in zip(numbers, steps, strict=False) if step >= 2 * usual]
    if not wide or 2 * count <= len(steps):  # timestamps in place of numbers have uneven steps
        return ()
    lost, (first, step) = sum(step // usual - 1 for _, step in wide), wide[0]
    place = f"missing between the file names, the {'one' if lost == 1 else 'first'} between {first} and {first + step}"
    text = f"1 frame is {place}" if lost == 1 else f"{lost} frames are {place}"
    return (f"{source}: {text}; the others follow one another without a pause",)
