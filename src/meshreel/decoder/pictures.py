"""Pictures of a track or a background: the texture of each frame, decoded on access from the video of its chain.

In: a reader, and the frames of a group. Out: the places of their faces in a texture, and the textures. Pictures are
decoded in their order, from the chain's first where another one was asked for last. Each layer of the pictures of a
background is a chain of its own.
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
from ..format.layout import LAYER_PICTURES, ChunkKind
from ..geometry.atlas import Layout
from ..shapes import UInt8
from ..types import Mesh, Texture


@dataclass(frozen=True, slots=True)
class _Place:
    """Where the decoder of a chain stands."""

    first: tuple[int, int]  # chunk and layer with which the chain begins
    decoder: VideoDecoder
    after: tuple[int, int]  # chunk and layer whose pictures were decoded last
    count: int  # of these pictures


class TrackPictures:
    """Textures of the frames of one track."""

    def __init__(self, reader: ReelReader) -> None:
        self._reader = reader
        self._layouts: tuple[int, Layout] | None = None  # of the atlas that was asked for last
        self._sizes = dict[int, tuple[int, int]]()  # of the textures of all atlases that were asked for
        self._layers = dict[tuple[int, int], tuple[int, int]]()  # what `_sizes_of` found, by chunk and layer
        self._background: tuple[int, int, Mesh] | None = None  # the state and picture shown last, and their mesh
        self._place: _Place | None = None
        self._last: tuple[tuple[int, int], np.ndarray] | None = None  # chunk and frame, and the planes of its picture
        self._lock = threading.Lock()  # of the decoder, which has one place

    def textured(self, chunk: Chunk, meshes: list[Mesh], canvas: Canvas) -> list[Mesh]:
        """Return the frames of a group with the textures that it has. FormatError where its atlas is damaged."""
        pictures = self._pictures_of(chunk)
        if pictures is None:
            return meshes
        atlas = self._reader.chunks[pictures.depends_on[1]]
        if self._layouts is None or self._layouts[0] != atlas.number:
            whole = None if chunk.frame_count == 0 else 1
            base = atlas_base(self._reader.read_chunk(atlas.depends_on[0], whole))
            layout = decode_atlas(self._reader.read_chunk(atlas.number), base)
            self._layouts, self._sizes[atlas.number] = (atlas.number, layout), (layout.width, layout.height)
        places = canvas.uv(self._layouts[1])
        pairs = enumerate(zip(meshes, places, strict=True))
        return [replace(mesh, uv=uv, texture=self._texture(pictures, frame)) for frame, (mesh, uv) in pairs]

    def shown(self, static: Chunk, mesh: Mesh, frame: int) -> Mesh:
        """Return the mesh of a background with the picture of a frame; the same mesh where it has it, or has none."""
        pictures = self._pictures_of(static)
        if pictures is None or mesh.texture is None:
            return mesh
        at = self._at(pictures, frame - self._reader.shown_from(static))
        if self._background is None or self._background[:2] != (static.number, at):
            self._background = static.number, at, replace(mesh, texture=self._texture(pictures, at))
        return self._background[2]

    def planes(self, number: int, at: int) -> UInt8[np.ndarray, "R W"]:
        """Return the planes of picture `at` of chunk `number`.

        Raises FormatError where it, or a picture before it in its chain, is damaged.
        """
        with self._lock:
            if self._last is None or self._last[0] != (number, at):
                self._last = (number, at), self._decoded(number, at)
            return self._last[1]

    def picture(self, number: int, at: int) -> UInt8[np.ndarray, "H W 3"]:
        """Return the same picture in sRGB."""
        pixels = from_i420(self.planes(number, at))
        pixels.flags.writeable = False
        return pixels

    def _texture(self, pictures: Chunk, at: int) -> Texture:
        return Texture(partial(self.picture, pictures.number, at))

    def _pictures_of(self, chunk: Chunk) -> Chunk | None:
        return self._reader.companion_of(chunk, ChunkKind.PICTURES) or self._reader.companion_of(
            chunk, ChunkKind.COMPATIBLE
        )

    def _at(self, pictures: Chunk, frame: int) -> int:
        """Return which of a background's pictures is shown in a frame, counted from the first that it is shown in."""
        last = len(pictures.layers) - 1
        at = frame // self._sizes_of(pictures.number, 0)[0]
        if at < last * LAYER_PICTURES:
            return at
        return min(at, last * LAYER_PICTURES + self._sizes_of(pictures.number, last)[1] - 1)

    def _sizes_of(self, number: int, layer: int) -> tuple[int, int]:
        """Return of a layer of a background's pictures the frames that each is shown for, and how many they are."""
        if (number, layer) not in self._layers:
            record = decode_pictures(self._reader.read_layer(number, layer), 0)
            self._layers[number, layer] = record.interval, len(record.packets)
        return self._layers[number, layer]

    def _decoded(self, number: int, at: int) -> UInt8[np.ndarray, "R W"]:
        chain, planes = self._chain(number, at), None
        here = chain[-1], at % LAYER_PICTURES if self._is_static(number) else at
        place, self._place = self._place, None  # until the pictures are decoded: a decoder that failed is of no use
        if place is not None and (place.first != chain[0] or (place.after, place.count) > here):
            place = None
        for link in chain if place is None else chain[chain.index(place.after) :]:
            chunk = self._reader.chunks[link[0]]
            try:
                record = decode_pictures(self._reader.read_layer(*link), chunk.frame_count)
                if place is None:
                    size = self._sizes[chunk.depends_on[1]]
                    place = _Place(link, VideoDecoder(*size, record.codec), link, 0)
                stop = here[1] + 1 if link == here[0] else len(record.packets)
                if stop > len(record.packets):
                    raise FormatError(f"{len(record.packets)} pictures in a layer that is not the last")
                for packet in record.packets[place.count if link == place.after else 0 : stop]:
                    planes = place.decoder.decode(packet)
            except FormatError as error:
                raise FormatError(f"{chunk}: {error}") from error
            place = replace(place, after=link, count=stop)
        assert place is not None and planes is not None
        self._place = place
        return planes

    def _chain(self, number: int, at: int) -> list[tuple[int, int]]:
        """Return chunk and layer of all pictures that are decoded before one of them, and with it."""
        if self._is_static(number):
            return [(number, at // LAYER_PICTURES)]
        chain = [number]
        while len(before := self._reader.chunks[chain[-1]].depends_on) > 2:
            chain.append(before[2])
        return [(link, 0) for link in reversed(chain)]

    def _is_static(self, number: int) -> bool:
        return self._reader.chunks[number].frame_count == 0
