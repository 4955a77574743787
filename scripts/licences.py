"""Prints the licences of all that meshreel, each of its extras and its player bring, as far as installed here.

Fails where a licence is not known, or where one of the GPL family comes with any but those that may be any.
"""

from __future__ import annotations

import re
import sys
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

from packaging.requirements import Requirement

PLAYER = Path(__file__).resolve().parents[1] / "src/meshreel/player/LICENSES.txt"
EXTRAS = ("", "cli", "encode", "demo", "open3d", "las", "play", "usd", "alembic", "glb", "cluster", "remote")
MAY_BE_ANY = {"usd"}  # asked for by name: the user decides
COPYLEFT = re.compile(r"\b[AL]?GPL|General Public License", re.IGNORECASE)
WEAK = re.compile(r"\bMPL|Mozilla|\bEPL|\bCDDL|LicenseRef", re.IGNORECASE)  # its own files only, or read it yourself
# Wheels that carry more than their metadata says: what it is, and why it does not bind who uses or sells meshreel.
CARRIES = {
    "libigl": "modules igl.copyleft (GPL) and igl.triangle (not for sale) lie in the wheel; meshreel imports neither",
    "numpy": "GCC's runtime libraries (GPL with the GCC exception, libquadmath LGPL), linked dynamically",
    "scipy": "GCC's runtime libraries (GPL with the GCC exception, libquadmath LGPL), linked dynamically",
}


def brought(extra: str) -> list[Distribution]:
    """Return every distribution that the base (no `extra`) or an extra brings, in turn, by name."""
    found: dict[str, Distribution] = {}
    todo = [("meshreel", extra)]
    done = set(todo)
    while todo:
        name, wanted = todo.pop()
        try:
            found[name] = distribution(name)
        except PackageNotFoundError:
            raise SystemExit(f"licences: {name} is not installed; run scripts/setup") from None
        for requirement in map(Requirement, found[name].requires or []):
            marker = requirement.marker
            if marker is None or marker.evaluate({"extra": wanted}):
                nexts = {(canonical(requirement.name), one) for one in {"", *requirement.extras}}
                todo += nexts - done
                done |= nexts
    del found["meshreel"]
    return [found[name] for name in sorted(found)]


def canonical(name: str) -> str:
    """Return a package's name as indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def licence(package: Distribution) -> str:
    """Return the licence that the metadata name: as an SPDX expression, by classifier, or the field's first line."""
    about = package.metadata
    if expression := about.get("License-Expression"):
        return str(expression)
    classifiers = [
        line.split(" :: ")[-1] for line in about.get_all("Classifier") or [] if line.startswith("License ::")
    ]
    if classifiers:
        return ", ".join(classifiers)
    lines = [line.strip() for line in str(about.get("License") or "").splitlines() if line.strip()]
    if not lines and (text := licence_text(package)):
        lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[0][:60] if lines else ""


def licence_text(package: Distribution) -> str:
    """Return the texts of a package's licence files."""
    paths = [
        path
        for path in package.files or []
        if ".dist-info" in str(path) and re.search("licen|copying", str(path), re.I)
    ]
    return "\n".join(path.locate().read_text(encoding="utf-8", errors="replace") for path in paths)


def carries_copyleft(package: Distribution) -> bool:
    """Return whether the licence files name parts of the wheel under the GPL family, without a choice of another."""
    names = any("GPL" in path.name for path in package.files or [] if ".dist-info" in str(path))
    lines = re.findall(r"^\s*License: (.*)$", licence_text(package), re.MULTILINE)
    return names or any(COPYLEFT.search(line) and " OR " not in line for line in lines)


def verdict(package: Distribution, free: bool) -> tuple[str, bool]:
    """Return the line about a package's licence, and True if it is a fault; `free`: the extra may bring anything."""
    name, told = canonical(package.name), licence(package)
    if not told:
        return "not known: read its source", True
    if COPYLEFT.search(told) and " OR " not in told:
        return f"{told}: COPYLEFT", not free
    if name in CARRIES:
        return f"{told}; {CARRIES[name]}", False
    if carries_copyleft(package):
        return f"{told}, but parts are COPYLEFT: read its licence files, then write them into CARRIES", not free
    return f"{told}: {'weak copyleft or its own' if WEAK.search(told) else 'permissive'}", False


def main() -> int:
    """Print a table for each extra and the player's list; return 1 where there is a fault."""
    count = faults = 0
    base = {package.name for package in brought("")}
    for extra in EXTRAS:
        print(f"\n## meshreel[{extra}], besides the base\n" if extra else "## meshreel\n")
        for package in brought(extra):
            if extra and package.name in base:
                continue
            text, fault = verdict(package, extra in MAY_BE_ANY)
            count, faults = count + 1, faults + fault
            print(f"{'FAULT ' if fault else ''}{package.name} {package.version}: {text}")
    print("\n## the player, in src/meshreel/player/LICENSES.txt\n")
    for block in PLAYER.read_text(encoding="utf-8").split("-" * 78)[1:-1]:
        lines = [line for line in block.splitlines() if line.strip()]
        print(f"{lines[0].split(',')[0]}: {lines[1].rstrip('.')}")
    print(f"\n{count} packages, {faults} faults")
    return bool(faults)


if __name__ == "__main__":
    sys.exit(main())
