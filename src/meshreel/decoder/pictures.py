"""Pictures of a track: the texture of each frame, decoded on access from the video of its chain.

In: a reader, and the frames of a group. Out: the places of their faces in a texture, and the textures. Pictures are
decoded in their order, from the chain's first where another one was asked for last.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..coding.appearance.atlas import decode_atlas
from ..coding.appearance.pictures import VideoDecoder, decode_pictures, from_i420
from ..coding.colored import Canvas, atlas_base
from ..container.reader import Chunk, ReelReader
from ..errors import FormatError
from ..format.layout import ChunkKind
from ..geometry.atlas import Layout
from ..shapes import UInt8
from ..types import Mesh, Texture


@dataclass(frozen=True, slots=True)
class _Place:
    """Where the decoder of a chain stands."""

    atlas: int  # number of its chunk
    decoder: VideoDecoder
    after: int  # number of the chunk whose pictures were decoded last
    count: int  # of these pictures


class TrackPictures:
    """Textures of the frames of one track."""

    def __init__(self, reader: ReelReader) -> None:
        self._reader = reader
        self._layouts: tuple[int, Layout] | None = None  # of the atlas that was asked for last
        self._sizes = dict[int, tuple[int, int]]()  # of the textures of all atlases that were asked for
        self._place: _Place | None = None
        self._last: tuple[tuple[int, int], np.ndarray] | None = None  # chunk and frame, and the planes of its picture
        self._lock = threading.Lock()  # of the decoder, which has one place

    def textured(self, chunk: Chunk, meshes: list[Mesh], canvas: Canvas) -> list[Mesh]:
        """Return the frames of a group with the textures that it has. FormatError where its atlas is damaged."""
        pictures = self._reader.companion_of(chunk, ChunkKind.PICTURES)
        if pictures is None:
            return meshes
        atlas = self._reader.chunks[pictures.depends_on[1]]
        if self._layouts is None or self._layouts[0] != atlas.number:
            whole = None if chunk.frame_count == 0 else 1
            base = atlas_base(self._reader.read_chunk(atlas.depends_on[0], whole))
            layout = decode_atlas(self._reader.read_chunk(atlas.number), base)
            self._layouts, self._sizes[atlas.number] = (atlas.number, layout), (layout.width, layout.height)
        places = canvas.uv(self._layouts[1])
        texture = partial(self.picture, pictures.number)
        pairs = enumerate(zip(meshes, places, strict=True))
        return [replace(mesh, uv=uv, texture=Texture(partial(texture, frame))) for frame, (mesh, uv) in pairs]

    def planes(self, number: int, frame: int) -> UInt8[np.ndarray, "R W"]:
        """Return the planes of the picture of a frame, counted in its group, whose pictures are chunk `number`.

        Raises FormatError where it, or a picture before it in its chain, is damaged.
        """
        with self._lock:
            if self._last is None or self._last[0] != (number, frame):
                self._last = (number, frame), self._decoded(number, frame)
            return self._last[1]

    def picture(self, number: int, frame: int) -> UInt8[np.ndarray, "H W 3"]:
        """Return the same picture in sRGB."""
        pixels = from_i420(self.planes(number, frame))
        pixels.flags.writeable = False
        return pixels

    def _decoded(self, number: int, frame: int) -> UInt8[np.ndarray, "R W"]:
        chain = self._chain(number)
        atlas, at = chain[0].depends_on[1], [link.number for link in chain]
        place = self._place
        if place is None or place.atlas != atlas or (place.after, place.count) > (number, frame):
            place = _Place(atlas, VideoDecoder(*self._sizes[atlas]), at[0], 0)
        self._place, planes = None, None  # until the pictures are decoded: a decoder that failed is of no use
        for link in chain[at.index(place.after) :]:
            packets = decode_pictures(self._reader.read_chunk(link.number), max(1, link.frame_count))
            done = place.count if link.number == place.after else 0
            stop = frame + 1 if link.number == number else len(packets)
            for packet in packets[done:stop]:
                try:
                    planes = place.decoder.decode(packet)
                except FormatError as error:
                    raise FormatError(f"{link}: {error}") from error
            place = replace(place, after=link.number, count=stop)
        self._place = place
        assert planes is not None
        return planes

    def _chain(self, number: int) -> list[Chunk]:
        """Return the chunks of pictures from the first of the chain to one of them."""
        chain = [self._reader.chunks[number]]
        while len(chain[-1].depends_on) > 2:
            chain.append(self._reader.chunks[chain[-1].depends_on[2]])
        return chain[::-1]
