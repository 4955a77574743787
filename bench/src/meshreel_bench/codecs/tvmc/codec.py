"""TVMC* at an operating point. In -> out: a sequence <-> the bytes of `layout`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from meshreel.coding.layers.patches import run_lengths
from meshreel.encoder.group.progress import Stages
from meshreel.encoder.paper.options import PaperOptions
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import EncoderOptions
from meshreel.encoder.settings.settings import Settings
from meshreel.errors import InputError
from meshreel.types import Mesh

from ...codec import Progress
from ..meshreel import Prepared
from .layout import MAGIC, VERSION, Group, Kind, State, Stream, pack_stream, unpack_stream
from .tracked import MOST_CELLS, encode_tracked
from .tracking import Tracked, Tracking, Untracked, track_sequence
from .video import TvmcVideo

USUAL = 2000  # vertices of a reference
LEAST_QP, MOST_QP = 2, 16  # bits; guesses


def quality_of_vertices(vertices: int) -> float:
    """Return the quality, 0 to 100, whose reference mesh is nearest to this number of vertices."""
    return min(max(50 + 50 * math.log(max(vertices, 1) / USUAL, 2.5), 0.0), 100.0)


@dataclass(frozen=True, slots=True)
class TvmcCodec(Prepared):
    """TVMC* with displacements of `qp` bits; operating points that differ in `qp` alone share an analysis."""

    qp: int = 9  # bits along the longest side of the widest frame's displacements
    vertices: int = USUAL  # of the reference, before its subdivision
    group_size: int = 10  # largest number of frames in a group
    centers: int = 2000

    def __post_init__(self) -> None:
        if not LEAST_QP <= self.qp <= MOST_QP:
            raise InputError(f"qp {self.qp}: give {LEAST_QP} to {MOST_QP} bits")
        _ = self.encoder_options  # raises InputError for invalid options

    @property
    def name(self) -> str:
        """The name in rows and plots; a larger reference makes another curve."""
        return "tvmc" if self.vertices <= USUAL else f"tvmc, {self.vertices} vertices"

    @property
    def encoder_options(self) -> EncoderOptions:
        """Options of preset `paper` at the quality with `vertices` vertices, which sets the target of references."""
        quality = quality_of_vertices(self.vertices)
        options = Settings("paper", quality, group_size=self.group_size, centers=self.centers).resolved()
        assert isinstance(options.method, PaperOptions)
        reference = replace(options.method.reference, vertices=self.vertices)
        return replace(options, method=replace(options.method, reference=reference))

    def code(self, analysis: Encoder, progress: Progress | None = None) -> bytes:
        """Return the stream of an analysed sequence."""
        data, count = self.pack(track_sequence(analysis, self.encoder_options)), len(analysis.sequence)
        Stages(progress, count).add("code", count)
        return data

    def pack(self, tracking: Tracking) -> bytes:
        """Return the stream of tracked groups."""
        seen, step = tracking.seen, self.step(tracking)
        bare = np.array([seen.is_bare(frame) for frame in range(len(seen.diagonals))])
        return pack_stream(
            Stream(
                magic=MAGIC,
                version=VERSION,
                frame_count=len(bare),
                origin=tuple(map(float, seen.center)),
                scale=seen.unit,
                step=step,
                bare=tuple(run_lengths(bare).tolist()) if tracking.states and bare.any() else (),
                states=tuple(State(state.frame, state.payload) for state in tracking.states),
                groups=tuple(_group(group, step) for group in tracking.groups),
            )
        )

    def step(self, tracking: Tracking) -> float:
        """Return the step of displacements, normalised; one for all groups, so that still vertices stay."""
        fields = [group.field for group in tracking.groups if isinstance(group, Tracked)]
        width = max((float(np.ptp(field, axis=0).max()) for field in fields), default=0.0)  # of the widest frame's box
        largest = max((float(np.abs(field).max()) for field in fields), default=0.0)
        return max(width / (2**self.qp - 1), largest / MOST_CELLS) or 1.0

    def background_bytes(self, data: bytes) -> int:
        """Return the size of all states of the background in the stream."""
        return sum(len(state.payload) for state in unpack_stream(data).states)

    def decode(self, data: bytes) -> Sequence[Mesh]:
        """Return the frames, from the bytes alone, each decoded on access."""
        return TvmcVideo(data)


def _group(group: Tracked | Untracked, step: float) -> Group:
    if isinstance(group, Untracked):
        return Group(group.first_frame, group.frame_count, Kind.DRACO, group.payload)
    payload = encode_tracked(group.reference, group.field, step)
    return Group(group.first_frame, group.field.shape[1], Kind.TRACKED, payload)
