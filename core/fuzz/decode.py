"""Fuzz the Python decoders with atheris: `decode.py LAUNCHER [libFuzzer's arguments]`, named as the target.

A target is a part of the format; its inputs are whole .reel files, which the mutator of `mutate.py` changes there most.
A fault is a crash, an exception other than FormatError, a file that decodes in two ways, or an absurd use of memory.
"""

from __future__ import annotations

import sys
from pathlib import Path
from random import Random

import atheris

with atheris.instrument_imports(include=["meshreel"]):
    import meshreel.decoder.video  # noqa: F401

from mutate import mutate
from verdict import check

OF_HEAD = {"container": 0.8}  # probability that the head is changed


def main() -> None:
    sys.argv.pop(0)
    target = Path(sys.argv[0]).name

    def changed(data: bytes, most: int, seed: int) -> bytes:
        out = mutate(data, Random(seed), lambda part: atheris.Mutate(part, len(part) + 64), OF_HEAD.get(target, 0.1))
        return out if len(out) <= most else data[:most]

    atheris.Setup(sys.argv, check, custom_mutator=changed)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
