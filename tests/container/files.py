"""A small .reel file with a static chunk, layers and dependent groups, for the tests of reading and of damage."""

import io

from meshreel.container.sources import BytesSource
from meshreel.container.writer import ReelWriter
from meshreel.format.layout import DracoGroup, EmptyGroup, Form, Header, LaplacianGroup
from meshreel.format.records import pack

HEADER = Header(30.0, (1.0, 2.0, 3.0), 1.75, (-0.5, -0.25, 0.0), (0.5, 0.25, 0.5), '{"quality": 50}', 1_000_000)

PAYLOADS = (
    pack(DracoGroup(Form.DRACO, 0, 0.001, (b"background",))),
    pack(LaplacianGroup(Form.LAPLACIAN, 2, 0.001, b"reference", b"displacements of ten frames")),
    pack(EmptyGroup(Form.EMPTY)),
    pack(DracoGroup(Form.DRACO, 1, 0.001, (b"frame 15", b"", b"frame 17"))),
)
FRAMES = 18


def small_file(header: Header = HEADER) -> bytes:
    """Chunks 0 static, 1 frames 0-9 in three layers, 2 frames 10-14 empty, 3 frames 15-17."""
    file = io.BytesIO()
    with ReelWriter(file, header) as writer:
        background = writer.add_static(PAYLOADS[0])
        writer.add_group(0, 10, PAYLOADS[1], layers=(20, 30, len(PAYLOADS[1])), depends_on=(background,))
        writer.add_group(10, 5, PAYLOADS[2])
        writer.add_group(15, 3, PAYLOADS[3])
    return file.getvalue()


class Counted(BytesSource):
    """Remembers which byte ranges were asked for."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self.ranges: list[tuple[int, int]] = []

    def get_bytes(self, offset: int, length: int) -> bytes:
        self.ranges.append((offset, length))
        return super().get_bytes(offset, length)
