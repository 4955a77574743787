"""Makes the generated files anew, or with --check changes nothing and fails where one is stale: FORMAT.md's tables and
the records of the player and of the C++ decoder from meshreel.format.layout, the constants of the player's ground from
meshreel.geometry.ground, the table of docs/reliability.md from its rows.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

import format_code
import format_tables
import reliability

from meshreel.format.layout import PAYLOADS, RECORDS

ROOT = Path(__file__).resolve().parents[1]
DOCUMENT = ROOT / "FORMAT.md"
MODULE = ROOT / "web/player-core/src/format/layout.gen.ts"
GROUND = ROOT / "web/player-three/src/ground.gen.ts"
HEADER = ROOT / "core/src/layout.gen.h"


def made() -> dict[Path, str]:
    """Each generated file as it should be."""
    return {
        DOCUMENT: format_tables.fill_tables(DOCUMENT.read_text(encoding="utf-8"), RECORDS + PAYLOADS),
        MODULE: format_code.typescript(RECORDS + PAYLOADS),
        GROUND: ground_constants(),
        HEADER: format_code.cpp(RECORDS + PAYLOADS),
        reliability.PAGE: reliability.filled(),
    }


def ground_constants() -> str:
    """The module of the ground's constants for the player; read as text, as importing them needs the compiled core."""
    text = (ROOT / "src/meshreel/geometry/ground.py").read_text(encoding="utf-8")
    head = "// Made from src/meshreel/geometry/ground.py, which explains these, by scripts/generate. Do not edit.\n\n"
    found = re.findall(r"^([A-Z]+) = ([\d.]+)  #", text, re.MULTILINE)
    return head + "".join(f"export const {name} = {float(value):g};\n" for name, value in found)


def main(arguments: list[str]) -> int:
    """The exit code: 1 where --check finds a difference."""
    if arguments not in ([], ["--check"]):
        print("usage: scripts/generate [--check]", file=sys.stderr)
        return 2
    stale = {
        path: text for path, text in made().items() if not path.exists() or path.read_text(encoding="utf-8") != text
    }
    for path, text in stale.items():
        if arguments:
            print(f"{path.relative_to(ROOT)} is stale: run scripts/generate", file=sys.stderr)
        else:
            path.write_text(text, encoding="utf-8", newline="\n")
    return 1 if arguments and stale else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
