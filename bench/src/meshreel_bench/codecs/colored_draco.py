"""Draco per frame with colours: of vertices, or of the input's textures, as AVIF images or one AV1 video. <-> bytes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import DracoPy
import msgspec
import numpy as np
from PIL import Image

from meshreel.analysis.appearance.bake import vertex_colors
from meshreel.coding.appearance.pictures import VideoDecoder, VideoEncoder, from_i420, to_i420
from meshreel.coding.mesh import COMPRESSION_LEVEL
from meshreel.errors import InputError
from meshreel.geometry.color_views import Painted
from meshreel.types import Mesh, MeshSequence, Texture

from ..codec import Options, Progress
from ..rows import ColorBytes
from .draco import check_qp

WAYS = ("vertices", "avif", "av1")


class Frames(msgspec.Struct, frozen=True):
    """All that a decoder needs."""

    meshes: list[bytes]
    pictures: list[bytes] = []


@dataclass(frozen=True, slots=True)
class ColoredDracoCodec(Options):
    """Draco with colours."""

    color: str = "vertices"  # one of `WAYS`
    qp: int = 10  # bits along each frame's longest side
    bits: int = 8  # of a vertex' red, green and blue each, or of a place along the side of a texture
    size: int = 1024  # pixels, width and height of a texture
    quality: int = 50  # of AVIF, 0 to 100; of video its rate factor, 1 to 63, of which less is better

    def __post_init__(self) -> None:
        check_qp(self.qp)
        if self.color not in WAYS or not 1 <= self.bits <= (8 if self.color == WAYS[0] else 20):
            raise InputError(f"color {self.color!r}, bits {self.bits}: give one of {WAYS}, and 1 to 8, or 20 of places")
        if not (16 <= self.size <= 4096 and self.size % 2 == 0 and 1 <= self.quality <= 100):
            raise InputError(f"size {self.size}, quality {self.quality}: give even pixels, 16 to 4096, and 1 to 100")

    @property
    def name(self) -> str:
        return f"Draco with colours, {self.color}"

    def encode(self, sequence: MeshSequence, _progress: Progress | None = None) -> bytes:
        """Return the stream. Raises InputError for frames without what is to be coded."""
        meshes, pictures = list[bytes](), list[np.ndarray]()
        for number, mesh in enumerate(sequence):
            points, faces, colors = mesh.vertices, mesh.faces, dict[str, Any](colors=None)
            if self.color == "vertices":
                own = mesh.colors if mesh.uv is None else None  # those of a texture as it is seen best
                own = vertex_colors(Painted(mesh), mesh) if own is None else own
                colors["colors"] = np.rint(own * ((2**self.bits - 1) / 255)).astype(np.uint8)
            else:
                points, faces, places, picture = self._textured(mesh, number)
                colors |= {"tex_coord": places, "tex_coord_quantization_bits": self.bits}
                pictures.append(picture)
            how = {"quantization_bits": self.qp, "compression_level": COMPRESSION_LEVEL}
            meshes.append(bytes(DracoPy.encode(points, faces, **how, **colors)))
        return msgspec.msgpack.encode(Frames(meshes, self._pictures(pictures)))

    def decode(self, data: bytes) -> Sequence[Mesh]:
        stream = msgspec.msgpack.decode(data, type=Frames)
        found = [(mesh, Mesh.of(mesh.points, mesh.faces)) for mesh in map(DracoPy.decode, stream.meshes)]
        if self.color == "vertices":
            scale = 255 / (2**self.bits - 1)
            return [replace(own, colors=np.rint(mesh.colors[:, :3] * scale).astype(np.uint8)) for mesh, own in found]
        textures, uvs = map(Texture.of, self._shown(stream.pictures)), (m.tex_coord[own.faces] for m, own in found)
        shown = zip((own for _, own in found), uvs, textures, strict=True)
        return [replace(own, uv=uv.astype(np.float32), texture=texture) for own, uv, texture in shown]

    def color_bytes(self, data: bytes) -> ColorBytes | None:
        """Return the sizes of the pictures; None where there are none."""
        sizes = [len(picture) for picture in msgspec.msgpack.decode(data, type=Frames).pictures]
        return ColorBytes(pictures=sizes) if sizes else None

    def _textured(self, mesh: Mesh, number: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return vertices, faces and places, one place a vertex, and the picture. InputError without a texture."""
        if mesh.uv is None or mesh.texture is None:
            raise InputError(f"frame {number} has no texture; give color vertices, or meshes with textures")
        corners = np.column_stack([mesh.faces.reshape(-1), mesh.uv.reshape(-1, 2)]).astype(np.float64)
        apart, faces = np.unique(corners, axis=0, return_inverse=True)
        picture = Image.fromarray(mesh.texture.pixels).resize((self.size, self.size), Image.Resampling.BOX)
        points = mesh.vertices[apart[:, 0].astype(np.int64)]
        return points, faces.reshape(-1, 3), np.ascontiguousarray(apart[:, 1:]), np.asarray(picture)

    def _pictures(self, pictures: Sequence[np.ndarray]) -> list[bytes]:
        if self.color == "av1":
            encoder = VideoEncoder(self.size, self.size, self.quality)
            return [*(packet for pixels in pictures for packet in encoder.add(to_i420(pixels))), *encoder.finish()]
        found = [io.BytesIO() for _ in pictures]
        for pixels, file in zip(pictures, found, strict=True):
            Image.fromarray(pixels).save(file, "AVIF", quality=self.quality, max_threads=1)
        return [file.getvalue() for file in found]

    def _shown(self, pictures: Sequence[bytes]) -> list[np.ndarray]:
        if self.color == "av1":
            decoder = VideoDecoder(self.size, self.size)
            return [from_i420(decoder.decode(packet)) for packet in pictures]
        return [np.asarray(Image.open(io.BytesIO(picture)).convert("RGB")) for picture in pictures]
