"""Fuzz the Python decoders with atheris: `decode.py LAUNCHER [libFuzzer's arguments]`, named as the target.

A target is a part of the format; its inputs are whole .reel files, which the mutator of `mutate.py` changes there most.
A fault is a crash, an exception other than FormatError, a file that decodes in two ways, or an absurd use of memory.
"""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path
from random import Random

import atheris

with atheris.instrument_imports(include=["meshreel"]):
    import meshreel.decoder.video  # noqa: F401

from mutate import mutate
from verdict import check

OF_HEAD = {"container": 0.8}  # probability that the head is changed
MORE = 64  # bytes by which plain bytes may grow at once
MUTATOR = ctypes.CFUNCTYPE(ctypes.c_size_t, ctypes.c_void_p, ctypes.c_size_t, ctypes.c_size_t, ctypes.c_uint)


def change(data: bytes) -> bytes:
    """Change plain bytes as libFuzzer does, which has seen what they were compared with."""
    room = ctypes.create_string_buffer(data, len(data) + MORE)
    size = ctypes.CDLL(None).LLVMFuzzerMutate(room, ctypes.c_size_t(len(data)), ctypes.c_size_t(len(data) + MORE))
    return room.raw[:size]


def main() -> None:
    sys.argv.pop(0)
    of_head = OF_HEAD.get(Path(sys.argv[0]).name, 0.1)

    @MUTATOR
    def changed(data: int, size: int, most: int, seed: int) -> int:
        out = mutate(ctypes.string_at(data, size), Random(seed), change, of_head)[:most]
        ctypes.memmove(data, out, len(out))
        return len(out)

    ctypes.CDLL(os.environ["MESHREEL_MUTATOR"]).set_mutator(changed)
    atheris.Setup(sys.argv, check)
    atheris.Fuzz()


if __name__ == "__main__":
    main()
