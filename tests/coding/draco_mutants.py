"""Campaign of damaged Draco meshes: `python -m tests.coding.draco_mutants COUNT` adds a row of what they cost.

Each is a valid mesh with some bytes changed, or a mesh of random symbols of edgebreaker whose claims are true. Decoding
gives a mesh or a FormatError; the counts are of those that Draco got to see.
"""

import sys
import time
from collections import Counter
from pathlib import Path

import numpy as np

from meshreel.coding.mesh import check_claims, decode_mesh, encode_mesh
from meshreel.errors import FormatError
from meshreel.types import Mesh
from scripts.reliability import add_row

from .draco_bombs import Draco, flat, varint

MOST_SECONDS, MOST_MEMORY = 2, 60  # of one mesh; MB above what Draco has taken for an honest one
BYTES = (0, 1, 2, 3, 0x7F, 0x80, 0xFF)


def valid_meshes(seed: int) -> list[bytes]:
    """Return Draco bytes of surfaces with and without holes, handles and noise, small and by valence."""
    numbers = np.random.default_rng(seed)
    grids = [flat(side) for side in (3, 20, 40, 60)]
    noisy = [Mesh.of(g.vertices + numbers.normal(0, 0.3, g.vertices.shape), g.faces) for g in grids]
    torn = [Mesh.of(g.vertices, g.faces[numbers.random(len(g.faces)) < 0.8]) for g in grids]
    tangle = Mesh.of(numbers.random((40, 3)), [numbers.choice(40, 3, replace=False) for _ in range(90)])
    return [encode_mesh(mesh, step) for mesh in [*grids, *noisy, *torn, tangle] for step in (0.5, 0.02)]


def mutant(numbers: np.random.Generator, valid: list[bytes]) -> bytes:
    """Return a valid mesh of a list with one to four bytes changed, half of them among the first and last hundred."""
    data = bytearray(valid[numbers.integers(len(valid))])
    for _ in range(numbers.integers(1, 5)):
        near = int(numbers.integers(5, min(100, len(data))))
        place = (near, -near, int(numbers.integers(5, len(data))))[numbers.choice(3, p=(0.35, 0.15, 0.5))]
        data[place] = numbers.choice(BYTES) if numbers.random() < 0.5 else data[place] ^ 1 << numbers.integers(8)
    return bytes(data)


def surface(numbers: np.random.Generator) -> bytes:
    """Return a mesh of random symbols and handles, most of which Draco can put together."""
    chances, many = numbers.dirichlet(np.ones(5)), numbers.random() ** 12
    symbols, depth, points, handles = ["E"], 1, 3, dict[int, int]()
    for symbol in numbers.choice(list("CSLRE"), int(numbers.integers(1, 3000)), p=chances):
        source = max(0, len(symbols) - int(numbers.integers(1, 8)))
        if symbol == "S" and points > 1 and symbols[source] in "LRE" and numbers.random() < many:
            handles[source] = len(symbols)
        elif symbol == "S" and (depth < 2 or points < 2):
            continue
        else:
            depth += {"E": 1, "S": -1}.get(symbol, 0)
        points += {"E": 3, "L": 1, "R": 1, "S": -1}.get(symbol, 0)
        symbols.append(symbol)
    return Draco("".join(symbols), handles=packed(handles, symbols)).pack()


def packed(handles: dict[int, int], symbols: list[str]) -> bytes:
    """Return handles, from the number of a symbol to that of a split, both in the order of decoding."""
    data, bits, before, last = varint(len(handles)), 0, 0, len(symbols) - 1
    for k, source in enumerate(sorted(handles, reverse=True)):  # the bytes count backwards
        data += varint(last - source - before) + varint(handles[source] - source)
        before, bits = last - source, bits | (symbols[source] != "L") << k
    return data + bits.to_bytes((len(handles) + 7) // 8, "little")


def run(count: int, seed: int = 0) -> dict[str, float]:
    """Decode so many damaged meshes and return counts, the longest CPU time (s), and the growth of the peak (MB)."""
    numbers, valid = np.random.default_rng(seed), valid_meshes(seed)
    decode_mesh(valid[0], 0.5)  # what Draco takes once
    counts, longest, before = Counter[str](), 0.0, peak(is_new=True)
    for k in range(count):
        data = surface(numbers) if k % 4 == 0 else mutant(numbers, valid)
        begin = time.process_time()
        counts[outcome(data)] += 1
        longest = max(longest, time.process_time() - begin)
    return {"count": count, **counts, "longest": round(longest, 3), "peak": round(peak() - before, 1)}


def outcome(data: bytes) -> str:
    """Tell how far a mesh came: what is raised other than FormatError is a fault."""
    try:
        check_claims([data])
    except FormatError:
        return "refused"
    try:
        decode_mesh(data, 0.02)
    except FormatError:
        return "refused by Draco"
    return "decoded"


def peak(is_new: bool = False) -> float:
    """Return the most memory that this process has had, or from now on if `is_new`, MB; 0 where that is not told.

    `ru_maxrss` will not do: a process inherits that of the one that started it.
    """
    try:
        if is_new:
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
        status = Path("/proc/self/status").read_text(encoding="ascii")
    except OSError:
        return 0.0
    return int(status.split("VmHWM:")[1].split()[0]) / 2**10


def main(count: int) -> None:
    """Run so many, and append what was found to the rows of docs/reliability.md."""
    begin = time.perf_counter()
    cost = run(count)
    faults = int(cost["longest"] > MOST_SECONDS) + int(cost["peak"] > MOST_MEMORY)
    told = f"{cost['decoded']:,} decoded; longest {cost['longest']} s, peak {cost['peak']} MB above the start"
    add_row(
        "A damaged Draco mesh is refused or decoded in little time and memory",
        f"python -m tests.coding.draco_mutants {count}",
        (count, "meshes"),
        faults,
        time.perf_counter() - begin,
        told,
    )


if __name__ == "__main__":
    main(int(sys.argv[1]))
