"""Pictures of a track or a background: the texture of each frame, decoded on access from the video of its chain.

In: a reader, and the frames of a group. Out: texture coordinates of their faces, and the textures. Pictures are decoded
in order, from the chain's first unless an earlier picture was decoded last. Each layer of a background's pictures is a
separate chain.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from .. import _core
from ..coding.appearance.pictures import VideoDecoder, decode_pictures, from_i420
from ..container.reader import Chunk, ReelReader
from ..errors import FormatError
from ..format.budget import are_costly
from ..format.layout import LAYER_PICTURES, ChunkKind, Pictures, VideoCodec
from ..shapes import UInt8
from ..types import Mesh, Texture
from .cache import CachedGroups

CODECS = {ChunkKind.PICTURES: VideoCodec.AV1, ChunkKind.COMPATIBLE: VideoCodec.H264}


@dataclass(frozen=True, slots=True)
class _Place:
    """Position of the decoder of a chain."""

    decoder: VideoDecoder
    texels: int  # of a picture
    size: int  # bytes of the chunk whose pictures were decoded last
    after: tuple[int, int]  # number of this chunk, and its layer
    count: int = 0  # decoded pictures of this layer
    planes: np.ndarray | None = None  # of the last of these pictures


class Decoders:
    """Decoders of a file's videos, each at its last picture; the groups and the splats that its tracks keep."""

    def __init__(self) -> None:
        self.groups = CachedGroups()
        self.splats = dict[int, _core.Splats]()  # decoded last, by their chunk; replaced as a whole
        self.lock = threading.Lock()
        self.refused = dict[tuple[int, int], tuple[int, str]]()  # valid pictures and error, by chunk and layer
        self.places = dict[tuple[int, int], _Place]()  # by a chain's first chunk and layer, least recently used first

    def take(self, first: tuple[int, int], texels: int, size: int) -> _Place | None:
        """Remove and return the place of a chain, whose decoding may fail; drop others until there is room for it."""
        place = self.places.pop(first, None)
        while self.places and are_costly([(texels, size), *((one.texels, one.size) for one in self.places.values())]):
            del self.places[next(iter(self.places))]
        return place


@dataclass(frozen=True, slots=True)
class _Shown:
    """A picture, decoded when it is called; pickled as its pixels."""

    pictures: TrackPictures
    number: int
    at: int

    def __call__(self) -> UInt8[np.ndarray, "H W 3"]:
        return self.pictures.picture(self.number, self.at)

    def __reduce__(self) -> tuple[Any, ...]:
        return partial, (np.asarray, self())


class TrackPictures:
    """Textures of the frames of one track."""

    def __init__(self, reader: ReelReader, decoders: Decoders) -> None:
        self._reader, self._decoders = reader, decoders
        self._layouts: tuple[int, _core.AtlasLayout] | None = None  # number and layout of the atlas used last
        self._sizes = dict[int, tuple[int, int]]()  # width and height of textures, by atlas
        self._layers = dict[tuple[int, int], tuple[int, int]]()  # results of `_sizes_of`, by chunk and layer
        self._background: tuple[int, int, Mesh] | None = None  # state and picture shown last, and their mesh

    def place(self, chunk: Chunk, decoded: _core.Group | _core.Background) -> Callable[[int], Texture] | None:
        """Place a group or a background in its texture; return the texture of each frame, or None if it has none.

        Raises FormatError if its atlas is damaged.
        """
        pictures = self._pictures_of(chunk)
        if pictures is None:
            return None
        atlas = self._reader.chunks[pictures.depends_on[1]]
        layouts = self._layouts  # read once, and replaced as a whole: another thread may replace it, too
        if layouts is None or layouts[0] != atlas.number:
            whole = None if chunk.frame_count == 0 else 1
            owner = self._reader.read_chunk(atlas.depends_on[0], whole)
            layout = _core.read_atlas(self._reader.read_chunk(atlas.number), owner)
            self._sizes[atlas.number] = layout.width, layout.height
            self._layouts = layouts = atlas.number, layout
        decoded.place(layouts[1])
        return partial(self._texture, pictures)

    def shown(self, static: Chunk, mesh: Mesh, frame: int) -> Mesh:
        """Return the mesh of a background with the picture of a frame, or as it is if it has no pictures."""
        pictures = self._pictures_of(static)
        if pictures is None or mesh.texture is None:
            return mesh
        at = self._at(pictures, self._reader.edit.coded(frame) - self._reader.shown_from[static.number])
        last = self._background
        if last is None or last[:2] != (static.number, at):
            self._background = last = static.number, at, replace(mesh, texture=self._texture(pictures, at))
        return last[2]

    def planes(self, number: int, at: int) -> UInt8[np.ndarray, "R W"]:
        """Return the planes of picture `at` of chunk `number`.

        Raises FormatError if this picture, or one before it in its chain, is damaged.
        """
        with self._decoders.lock:
            return self._decoded(number, at)

    def picture(self, number: int, at: int) -> UInt8[np.ndarray, "H W 3"]:
        """Return the same picture in sRGB."""
        pixels = from_i420(self.planes(number, at))
        pixels.flags.writeable = False
        return pixels

    def _texture(self, pictures: Chunk, at: int) -> Texture:
        width, height = self._sizes[pictures.depends_on[1]]
        return Texture(_Shown(self, pictures.number, at), (height, width))

    def _pictures_of(self, chunk: Chunk) -> Chunk | None:
        return next(filter(None, (self._reader.companion_of(chunk, kind) for kind in CODECS)), None)

    def _at(self, pictures: Chunk, frame: int) -> int:
        """Return the number of a background's picture in a frame, counted from the first that is coded with it."""
        last = len(pictures.layers) - 1
        at = frame // self._sizes_of(pictures.number, 0)[0]
        if at < last * LAYER_PICTURES:
            return at
        return min(at, last * LAYER_PICTURES + self._sizes_of(pictures.number, last)[1] - 1)

    def _sizes_of(self, number: int, layer: int) -> tuple[int, int]:
        """Return the frames for which each picture of a background's layer is shown, and the number of pictures."""
        if (number, layer) not in self._layers:
            record = self._record((number, layer), self._reader.read_layer(number, layer))
            self._layers[number, layer] = record.interval, len(record.packets)
        return self._layers[number, layer]

    def _decoded(self, number: int, at: int) -> UInt8[np.ndarray, "R W"]:
        chain, decoders = self._chain(number, at), self._decoders
        width, height = self._sizes[self._reader.chunks[number].depends_on[1]]
        wanted = chain[-1], 1 + (at % LAYER_PICTURES if self._reader.chunks[number].frame_count == 0 else at)
        place = decoders.take(chain[0], width * height, self._reader.chunks[number].size)
        if place is not None and (place.after, place.count) > wanted:
            place = None
        if place is None or (place.after, place.count) < wanted:
            place = self._advanced(place, chain, wanted[1], width, height)
        decoders.places[chain[0]] = place
        assert place.planes is not None
        return place.planes

    def _advanced(
        self, place: _Place | None, chain: list[tuple[int, int]], count: int, width: int, height: int
    ) -> _Place:
        """Return the place behind the first `count` pictures of the last link of a chain."""
        for link in chain if place is None else chain[chain.index(place.after) :]:
            stop, done, chunk = count if link == chain[-1] else None, 0, self._reader.chunks[link[0]]
            whole, message = self._decoders.refused.get(link, (0, ""))
            if message and (stop is None or stop > whole):
                raise FormatError(message)
            data = self._reader.read_layer(*link)
            try:
                record = self._record(link, data)
                place = place or _Place(VideoDecoder(width, height, record.codec), width * height, 0, link)
                planes, done = place.planes, place.count if link == place.after else 0
                for packet in record.packets[done:stop]:
                    planes, done = place.decoder.decode(packet), done + 1
            except FormatError as error:
                self._decoders.refused[link] = done, f"{chunk}: {error}"
                raise FormatError(f"{chunk}: {error}") from error
            place = replace(place, size=chunk.size, after=link, count=done, planes=planes)
        assert place is not None
        return place

    def _record(self, link: tuple[int, int], data: bytes) -> Pictures:
        """Unpack a layer of pictures; of a background, all but the last have the same number."""
        chunk = self._reader.chunks[link[0]]
        width, height = self._sizes[chunk.depends_on[1]]
        record = decode_pictures(data, chunk.frame_count, width * height)
        if record.codec != CODECS[ChunkKind(chunk.kind)]:  # another coding could take more memory than was checked
            raise FormatError(f"pictures of codec {int(record.codec)} in a chunk of kind {ChunkKind(chunk.kind).name}")
        if link[1] < len(chunk.layers) - 1 and len(record.packets) < LAYER_PICTURES:
            raise FormatError(f"{len(record.packets)} pictures in a layer that is not the last")
        return record

    def _chain(self, number: int, at: int) -> list[tuple[int, int]]:
        """Return chunks and layers of the pictures that must be decoded for one picture, its own last."""
        if self._reader.chunks[number].frame_count == 0:  # a background
            return [(number, at // LAYER_PICTURES)]
        chain = [number]
        while len(before := self._reader.chunks[chain[-1]].depends_on) > 2:
            chain.append(before[2])
        return [(link, 0) for link in reversed(chain)]
