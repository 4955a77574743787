"""Cut first inputs for the fuzzers out of the golden files: `seeds.py FOLDER` writes FOLDER/TARGET/NAME.

Python targets take whole files. C++ targets take arguments of calls as `input.h` reads them: here decoding the golden
files is watched, and what the core is called with is written down.
"""

from __future__ import annotations

import hashlib
import struct
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from mutate import parse
from verdict import color, verdict

from meshreel import _core
from meshreel.coding.layers import coder, trajectories
from meshreel.format.layout import CodedField, ColorsLevel, Form, LayersGroup, LayersLevel
from meshreel.format.records import unpack, unpack_all

GOLDEN = Path(__file__).resolve().parents[2] / "conformance" / "v1"
TARGETS = {  # of Python, and the forms of which a file must have one
    "container": set(Form),
    "layers": {Form.LAYERS},
    "laplacian": {Form.LAPLACIAN},
    "intra": {Form.DRACO},
    "background": {Form.PATCH},
    "patches": {Form.LAYERS},
    "colored": {Form.VERTEX_COLORS},
}
Write = Callable[[str, bytes], None]


def main(folder: Path) -> None:
    def write(target: str, data: bytes) -> None:
        (folder / target).mkdir(parents=True, exist_ok=True)
        (folder / target / hashlib.sha1(data).hexdigest()).write_bytes(data)

    watch_calls(write)
    for path in sorted(GOLDEN.rglob("*.reel")):
        data = path.read_bytes()
        forms = {chunk.entry.form for chunk in parse(data)[1]}
        for target, wanted in TARGETS.items():
            if forms & wanted and (target != "patches" or path.stem in ("layers_patched", "scene")):
                write(target, data)
        verdict(data)
        color(data)


def watch_calls(write: Write) -> None:
    """Have each call of the core that decodes a golden file written as an input of its target."""

    def watch(owner: Any, name: str, see: Callable[..., None]) -> None:
        call = getattr(owner, name)

        def watched(*values: Any) -> Any:
            see(*values)
            return call(*values)

        setattr(owner, name, watched)

    def weights(data: bytes, sizes: Any, columns: Any, starts: Any, near: Any) -> None:
        links = struct.pack("<HB", len(starts) - 1, 0)
        for v in range(1, len(starts) - 1):
            own = near[starts[v] : starts[v + 1]]
            links += bytes([len(own), *(v - 1 - own).tolist()])
        count = min(len(columns), 3)
        write(
            "weights",
            links + bytes([count]) + raw(data[: sum(sizes[:count])]) + b"\1" + sizes[:count].astype("<u2").tobytes(),
        )

    def motion(record: bytes, base: Any, frames: int) -> None:
        group = unpack_all(LayersGroup, record)
        for target in ("least_squares", "subdivision", "packing"):
            write(target, mesh(base.vertices, base.faces) + bytes(range(1, 200)))
        head = bytes([frames - 1, group.origin, group.levels]) + raw(group.base)[1:] + bytes([group.shared])
        write("motion", mesh(base.vertices, base.faces) + head + field(group.motion) + b"\0")

    def level(record: bytes, near: Any, known: Any, before: Any, *_: Any) -> None:
        made = unpack_all(LayersLevel, record)
        head = bytes([known.shape[2], made.origin, made.curvature, made.sibling_weight]) + field(made.scalars) + b"\0"
        previous = b"\0" if before is None else b"\1" + np.rint(1000 * before).astype("<i2").tobytes()
        write("level", mesh(known[:, :, 0], near.level.coarse) + head + previous)

    def draco(meshes: Any) -> None:
        write("draco", bytes([len(meshes)]) + b"".join(raw(data)[1:] for data in meshes))

    def colors(
        records: bytes, vertices: Any, faces: Any, levels: int, count: int, frames: int, chroma: float, before: Any
    ) -> None:
        base, at = unpack(CodedField, records)
        out = mesh(vertices, faces) + bytes([frames - 1, levels]) + field(base)
        for _ in range(levels):
            made, at = unpack(ColorsLevel, records, at)
            out += bytes([made.sibling_weight]) + field(made.values)
        last = b"\0" if before is None else b"\1" + np.rint(1000 * before).astype("<i2").tobytes()
        write("colors", out + b"\0\0" + last.ljust(1 + 6 * count, b"\0") + bytes([round(64 * chroma)]))

    def places(vertices: Any, faces: Any, joins: Any, starts: Any, rests: Any) -> None:
        counts = struct.pack("<HHH", len(joins), len(starts), len(rests))
        numbers = [
            symbol
            for stream, room in ((joins, 4), (starts, 6), (rests, 2))
            for symbol in [*stream.tolist(), *[0] * (room * len(faces) - len(stream))]
        ]
        write("places", mesh(vertices, faces) + b"\0" + counts + b"".join(map(number, numbers)))

    watch(_core, "decode_integers", lambda data, values: write("integers", struct.pack("<H", len(values)) + raw(data)))
    watch(_core, "decode_weights", weights)
    watch(trajectories, "decode_trajectories", motion)
    watch(coder, "decode_trajectories", motion)
    watch(coder, "decode_level", level)
    watch(coder, "decode_last", level)
    watch(_core, "check_draco", draco)
    watch(_core, "decode_colors", colors)
    watch(_core, "decode_places", places)


def mesh(vertices: Any, faces: Any) -> bytes:
    """Return a mesh as `mesh_of` of input.h reads it, its places rounded to 2^-14."""
    corners = faces.astype("u1" if len(vertices) < 256 else "<u2").tobytes()
    return (
        struct.pack("<HHBb", len(vertices), len(faces), 0, -2)
        + np.rint(vertices * 2**14).astype("<i2").tobytes()
        + corners
    )


def field(record: CodedField) -> bytes:
    """Return a field as `put_field` of input.h reads it."""
    return bytes([record.columns, record.step_level]) + raw(record.basis) + raw(record.symbols)


def number(value: int) -> bytes:
    """Return a number as `number` of input.h reads it."""
    return struct.pack("b", value) if -127 <= value <= 127 else b"\x80" + struct.pack("<i", value)


def raw(stream: bytes) -> bytes:
    """Return a stream that `stream_of` of input.h takes as it is."""
    return b"\0" + struct.pack("<H", len(stream)) + stream


if __name__ == "__main__":
    main(Path(sys.argv[1]))
