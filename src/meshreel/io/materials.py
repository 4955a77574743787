"""Materials of OBJ files, and the files that meshes name: found beside the mesh, never outside its folder."""

from __future__ import annotations

import posixpath
import re
import shlex
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path, PurePosixPath
from typing import NoReturn

import numpy as np

from ..errors import InputError
from ..types import Texture
from .files import Place, Remote, read_file
from .looks import Look, with_looks
from .pictures import read_picture
from .polygons import Polygons

_WORDS = {  # of terms that are not kept, unless all their numbers are the neutral one
    **dict.fromkeys(("d", "tf"), ("transparency", 1.0)),
    **dict.fromkeys(("tr",), ("transparency", 0.0)),
    **dict.fromkeys(("ks", "pr", "pm", "ps", "pc", "pcr", "aniso", "anisor"), ("shine", 0.0)),
    "ke": ("light (Ke)", 0.0),
}
_MAPS = {
    **dict.fromkeys(("norm", "bump", "map_bump", "map_kn"), "normal maps"),
    **dict.fromkeys(("map_d", "map_tr"), "transparency"),
    **dict.fromkeys(("map_ks", "map_ns", "map_pr", "map_pm", "map_ps", "map_rma", "map_orm", "refl"), "shine"),
    **dict.fromkeys(("map_ka",), "shadow maps (map_Ka)"),
    **dict.fromkeys(("map_ke",), "light (map_Ke)"),
    **dict.fromkeys(("disp", "map_disp"), "displacement maps"),
    "decal": "decals",
    "map_aat": "",
}
# Lighting that no picture of a surface has, or how a renderer works.
_SILENT = {"newmtl", "ka", "ns", "ni", "illum", "sharpness"}
_OPTIONS = {  # of maps, and their most numbers; "-mm 0 1" and the like change nothing
    **dict.fromkeys(("-s", "-o", "-t"), 3),
    **dict.fromkeys(("-blendu", "-blendv", "-cc", "-clamp", "-bm", "-boost", "-imfchan", "-texres", "-type"), 1),
    "-mm": 2,
}
_NEUTRAL = {"-mm": ["0", "1"], "-t": ["0"] * 3, "-clamp": ["off"], "-cc": ["off"], "-blendu": ["on"], "-blendv": ["on"]}
_NEUTRAL |= {"-bm": ["1"], "-boost": ["0"]}


def with_materials(polygons: Polygons, mesh: Place) -> Polygons:
    """Return polygons with the colours and pictures of their materials and faces. `mesh` is their file."""
    has_places, uv, count = polygons.uv is not None, polygons.uv, len(polygons.sizes)
    which = np.full(count, -1) if polygons.material_of is None else polygons.material_of
    if polygons.pictures:
        pairs = [_picture(mesh, _folder(mesh), name) for name in polygons.pictures]
        looks, named = [Look(None, picture) for picture, _ in pairs], {word for _, word in pairs if word}
    else:
        terms, named = _read_libraries(mesh, polygons.libraries)
        names = polygons.materials
        if not names and len(terms) == 1:  # the only one there is
            names, which = tuple(terms), np.zeros(count, np.int64)
        looks = [Look()] * len(names)
        for number in np.unique(which[which >= 0]):
            name = next((key for key in (names[number], _bare(names[number])) if key in terms), None)
            if name is None:
                named.add(f"material {names[number]!r} (no file describes it)")
                continue
            looks[number], scale, offset, words = _look(mesh, *terms[name], has_places)
            named |= words
            if uv is not None and (scale != (1.0, 1.0) or offset != (0.0, 0.0)):
                chosen = np.repeat(which == number, polygons.sizes)[:, None]
                uv = np.where(chosen, uv * np.array(scale) + np.array(offset), uv).astype(np.float32)
    return with_looks(replace(polygons, uv=uv), looks, which).naming(named)


def _picture(mesh: Place, folder: Place, name: str) -> tuple[Texture | None, str]:
    """Return the texture in a file that a file in `folder` names, or the name of what is not kept."""
    spellings = name, name.strip('"'), _bare(name)
    place = next((p for one in spellings if (p := find_beside(mesh, folder, one)) is not None), None)
    if place is not None:
        return Texture(partial(read_picture, place)), ""
    path = spellings[1].replace("\\", "/")
    if _is_absolute(path) or _inside(mesh, folder, path) is None:
        return Texture(partial(_refuse, str(mesh), name)), ""
    return None, f"a texture ({name} is not there)"


def _bare(name: str) -> str:
    """Return a name without a comment behind it, and without quotes."""
    return re.split(r"\s#", name)[0].strip().strip('"')


Terms = list[tuple[str, str]]  # keywords, in small letters, and what follows them


def _read_libraries(mesh: Place, libraries: tuple[str, ...]) -> tuple[dict[str, tuple[Place, Terms]], set[str]]:
    """Return the terms of each material, with the folder of its file."""
    found, named = dict[str, tuple[Place, Terms]](), set[str]()
    for line in libraries:
        names = _names_in(mesh, line)
        for name in names:
            place = find_beside(mesh, _folder(mesh), name)
            try:
                if place is None:
                    raise FileNotFoundError
                text = read_file(place).decode("utf-8-sig", "replace")  # some editors begin with a mark
            except (OSError, ValueError):
                named.add(f"materials ({name} cannot be read)")
                continue
            terms: Terms = []
            for words in (raw.strip().split(maxsplit=1) for raw in text.splitlines()):
                keyword, rest = words[0].lower() if words else "", words[1].strip() if len(words) > 1 else ""
                if keyword == "newmtl":
                    terms = []
                    found.setdefault(rest, (_folder(place), terms))
                elif keyword and not keyword.startswith("#"):
                    terms.append((keyword, rest))
    return found, named


def _names_in(mesh: Place, line: str) -> list[str]:
    """Return the names of files in a line: one with blanks, or several, in quotes or not."""
    whole = line.strip().strip('"')
    for one in (whole, _bare(whole)):
        if find_beside(mesh, _folder(mesh), one) is not None:
            return [one]
    try:
        several = shlex.split(re.split(r"\s#", whole)[0].replace("\\", "/"))
    except ValueError:
        several = whole.split()
    return several if len(several) > 1 and all(name.lower().endswith(".mtl") for name in several) else [whole]


def _look(
    mesh: Place, folder: Place, terms: Terms, has_places: bool
) -> tuple[Look, tuple[float, float], tuple[float, float], set[str]]:
    """Return the look of a material, what its places are multiplied by and moved by, and what is not kept of it."""
    color, picture, scale, offset, named = None, None, (1.0, 1.0), (0.0, 0.0), set[str]()
    for keyword, rest in terms:
        if keyword == "kd":
            values = _numbers(rest)
            if len(values) in (1, 3):
                full = 255 if max(values) <= 1.5 else 1  # fractions, blended ones a little above 1, or bytes
                red, green, blue = (round(min(max(full * value, 0.0), 255.0)) for value in (values * 3)[:3])
                color = red, green, blue
            else:
                named.add("a colour (Kd of another kind than red, green, blue)")
        elif keyword == "map_kd" and rest:
            name, options = _options(rest)
            scale, offset = _two(options.get("-s", []), 1.0), _two(options.get("-o", []), 0.0)
            named |= {f"{key} of map_Kd" for key, given in options.items() if _matters(key, given)}
            picture, word = _picture(mesh, folder, name)
            named |= {word} - {""}
        elif keyword in _MAPS:
            named.add(_MAPS[keyword])
        elif keyword in _WORDS:
            word, neutral = _WORDS[keyword]
            named |= {word} if any(value != neutral for value in _numbers(rest)) else set()
        elif keyword not in _SILENT:
            named.add(f"{keyword!r} of materials")
    if picture is not None and not has_places:
        named.add("a texture (the faces have no places in it)")
        picture = None
    if picture is not None and color is not None and len({*color}) > 1:
        named.add("Kd beside a picture")
    return Look(color if picture is None else None, picture), scale, offset, named - {""}


def _refuse(mesh: str, name: str) -> NoReturn:
    text = f"{mesh}: its picture {name} is outside the folder of the mesh"
    raise InputError(f"{text}, where nothing is read; copy it beside the mesh, or encode with --color none")


def _numbers(text: str) -> list[float]:
    """Return the numbers at the beginning of a text."""
    values = list[float]()
    for word in text.split():
        try:
            values.append(float(word))
        except ValueError:
            break
    return values


def _two(words: list[str], default: float) -> tuple[float, float]:
    first, second = (_numbers(" ".join(words)) + [default] * 2)[:2]
    return first, second


def _matters(option: str, given: list[str]) -> bool:
    """Return True if an option of a map changes the picture, and is not followed."""
    neutral = _NEUTRAL.get(option)
    same = neutral is not None and [word.lower().removesuffix(".0") for word in given] == neutral[: len(given)]
    return option not in ("-s", "-o") and not same


def _options(rest: str) -> tuple[str, dict[str, list[str]]]:
    """Return the name of a picture, and the options before it."""
    options = dict[str, list[str]]()
    while match := re.match(r"(-[a-zA-Z]+)\s+", rest):
        option = match[1].lower()
        if option not in _OPTIONS:
            break
        rest = rest[match.end() :]
        given = options.setdefault(option, [])
        numeric = option in ("-s", "-o", "-t", "-mm")
        while len(given) < _OPTIONS[option]:
            word = re.match(r"(\S+)\s+", rest)
            if word is None or (numeric and not _numbers(word[1])):
                break
            given.append(word[1])
            rest = rest[word.end() :]
    return rest.strip(), options


def _folder(place: Place) -> Place:
    return place.parent if isinstance(place, Path) else Remote(place.url.rsplit("/", 1)[0])


def _is_absolute(name: str) -> bool:
    return name.startswith("/") or re.match(r"[a-zA-Z]:", name) is not None


def _inside(mesh: Place, folder: Place, name: str) -> PurePosixPath | None:
    """Return the path below the mesh's folder of a file that a file in `folder` names; None if it is not below it."""
    root = _folder(mesh)
    if isinstance(folder, Path) and isinstance(root, Path):
        begin = folder.relative_to(root).as_posix()
    else:
        begin = str(folder).removeprefix(str(root)).strip("/")
    path = posixpath.normpath(posixpath.join(begin, name))
    return None if path.startswith(("..", "/")) else PurePosixPath(path)


def find_beside(mesh: Place, folder: Place, name: str) -> Place | None:
    """Return the file that one in `folder` names, in any case: there, or beside the mesh; never outside its folder."""
    name = name.replace("\\", "/")
    root = _folder(mesh)
    paths = [] if _is_absolute(name) else [_inside(mesh, folder, name), _inside(mesh, root, name)]
    last = name.rsplit("/", 1)[-1]
    paths += [_inside(mesh, folder, last), _inside(mesh, root, last)] if last not in ("", ".", "..") else []
    if not isinstance(root, Path):
        first = next((path for path in paths if path is not None), None)
        return None if first is None else root / str(first)
    found = (_spelled(root, path.parts) for path in paths if path is not None)
    return next((place for place in found if place is not None), None)


def _spelled(root: Path, parts: tuple[str, ...]) -> Path | None:
    """Return a file below a folder, with letters of either case."""
    place = root
    for part in parts:
        try:
            if not (place / part).exists():
                part = _listed(place, place.stat().st_mtime_ns).get(part.lower(), "")
        except (OSError, ValueError):  # of a name too long, or with a null
            return None
        if not part:
            return None
        place = place / part
    try:
        return place if place.is_file() else None
    except OSError:
        return None


@lru_cache(maxsize=16)
def _listed(folder: Path, _changed: int) -> dict[str, str]:
    return {path.name.lower(): path.name for path in sorted(folder.iterdir(), reverse=True)}
