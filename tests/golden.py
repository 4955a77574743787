"""Golden record of a decoded frame: counts, digests of all bits, and the first vertices for a reader.

Of pictures the I420 planes are recorded, never sRGB, which is a matter of the reader.
"""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from meshreel.coding.appearance.pictures import VideoDecoder, decode_pictures
from meshreel.container.reader import ReelReader
from meshreel.decoder.video import Video
from meshreel.format.layout import Atlas, ChunkKind
from meshreel.format.records import unpack_all
from meshreel.geometry.splats import Bound
from meshreel.types import Mesh

GOLDEN = Path(__file__).resolve().parents[1] / "conformance" / "v1"


def frame_record(mesh: Mesh) -> dict[str, object]:
    """Digests are SHA-256 of little-endian float64 positions and int32 faces, row by row."""
    return {
        "vertices": len(mesh.vertices),
        "faces": len(mesh.faces),
        "vertices_sha256": hashlib.sha256(mesh.vertices.astype("<f8").tobytes()).hexdigest(),
        "faces_sha256": hashlib.sha256(mesh.faces.astype("<i4").tobytes()).hexdigest(),
        "first_vertices": [[x.hex() for x in row] for row in mesh.vertices[:2].tolist()],
    }


def audio_record(video: Video) -> dict[str, object]:
    """What is heard; nothing where nothing is."""
    if (audio := video.audio) is None:
        return {}
    found = {"type": audio.media_type, "start": audio.start, "sha256": hashlib.sha256(audio.data).hexdigest()}
    return {"audio": found}


def colored_record(video: Video, frame: int) -> dict[str, dict[str, object]]:
    """Of each part of a frame its colours, and the places of its corners, of which NaN is stored as -1."""
    found = dict[str, dict[str, object]]()
    for name, mesh in video.parts(frame).items():
        found[name] = frame_record(mesh) | {"colors_sha256": None, "uv_sha256": None}
        if mesh.colors is not None:
            found[name]["colors_sha256"] = hashlib.sha256(mesh.colors.tobytes()).hexdigest()
        if mesh.uv is not None:
            places = np.nan_to_num(mesh.uv, nan=-1.0).astype("<f4")
            found[name]["uv_sha256"] = hashlib.sha256(places.tobytes()).hexdigest()
    return found


def splats_records(video: Video) -> list[list[dict[str, object]] | None]:
    """Of each frame every 50th splat as it is bound, about the file's origin; None where it has none."""
    found, origin = list[list[dict[str, object]] | None](), np.array(video.reader.header.origin)
    for frame in range(len(video)):
        bound = video.splats(frame)
        if bound is None:
            found.append(None)
            continue
        shown = replace(bound, means=bound.means - origin)
        rows = range(0, len(bound.opacities), 50)
        found.append([{name: getattr(shown, name)[row].tolist() for name in Bound.__slots__} for row in rows])
    return found


def planes(reader: ReelReader) -> dict[str, list[str]]:
    """Digests of the planes of each picture, by the number of its chunk."""
    decoders, found = dict[int, VideoDecoder](), dict[str, list[str]]()
    for chunk in reader.chunks:
        if chunk.kind not in (ChunkKind.PICTURES, ChunkKind.COMPATIBLE):
            continue
        atlas = unpack_all(Atlas, reader.read_chunk(chunk.depends_on[1]))
        digests = found[str(chunk.number)] = list[str]()
        for layer in range(len(chunk.layers)):
            data = reader.read_layer(chunk.number, layer)
            record = decode_pictures(data, chunk.frame_count, atlas.width * atlas.height)
            before = decoders.get(chunk.depends_on[2]) if len(chunk.depends_on) > 2 else None
            decoder = before or VideoDecoder(atlas.width, atlas.height, record.codec)
            digests += [hashlib.sha256(decoder.decode(one).tobytes()).hexdigest() for one in record.packets]
            decoders[chunk.number] = decoder
    return found
