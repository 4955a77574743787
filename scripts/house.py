"""Print the size of the house: lines by part, and the rooms, floors and imports between rooms of the encoder.

A room is a module or package directly in `encoder/`; its floor is the longest chain of imports below it.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ENCODER = ROOT / "src" / "meshreel" / "encoder"
PARTS = {  # folders, and the ending of the files that are counted
    "product": (["src/meshreel"], ".py"),
    "bench": (["bench/src"], ".py"),
    "tests of both": (["tests", "bench/tests"], ".py"),
    "TypeScript of decode": (["web/player-core/src/decode", "web/player-core/src/wasm"], ".ts"),
}


def main() -> None:
    """Print a line for each part, and one for the encoder."""
    for name, (folders, ending) in PARTS.items():
        files = [path for folder in folders for path in (ROOT / folder).rglob(f"*{ending}")]
        print(f"{name}: {sum(len(path.read_text(encoding='utf-8').splitlines()) for path in files)} lines")
    below = {room: set[str]() for path in ENCODER.rglob("*.py") if (room := _room(path)) != "__init__"}
    for path in ENCODER.rglob("*.py"):
        if (room := _room(path)) in below:
            below[room] |= {other for other in _imported(path) if other in below} - {room}

    @cache
    def floor(room: str) -> int:
        return 1 + max((floor(other) for other in below[room]), default=0)

    arrows = sum(map(len, below.values()))
    print(f"encoder: {len(below)} rooms, {max(map(floor, below))} floors, {arrows} imports between rooms")
    for room in sorted(below, key=floor, reverse=True):
        print(f"  {floor(room)} {room}: {', '.join(sorted(below[room])) or '-'}")


def _room(path: Path) -> str:
    first = path.relative_to(ENCODER).parts[0]
    return first.removesuffix(".py")


def _imported(path: Path) -> Iterator[str]:
    """Yield the rooms that a module of the encoder imports from."""
    depth = len(path.relative_to(ENCODER).parts)
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.level == depth and node.module:
            yield node.module.split(".")[0]


if __name__ == "__main__":
    main()
