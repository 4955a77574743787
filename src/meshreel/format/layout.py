"""The one definition of the bytes of a .reel file and of its payloads.

A file is `Preamble | Header | Index | Checksum | chunks`; everything before the chunks is the head. Chunks follow one
another in the order of the index, so their offsets and frame numbers are sums and cannot contradict each other
(decision 3). scripts/generate makes FORMAT.md's tables, layout.gen.ts and layout.gen.h from this module.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated

from .kinds import F32, F64, I64, U8, U16, U32, Array, Blob, Bytes, Choice, List, Rest, Text, Varint
from .records import Nested

MAGIC = b"REEL\r\n\x1a\n"  # the line ends reveal a transfer in text mode
VERSION = 1
EDITED = 1  # bit of Preamble.flags: the item `edit` of the metadata counts
LAYER_PICTURES = 64  # pictures of a background in each layer but the last: 8 s of an encoder's 8 a second (guess)


class ChunkKind(IntEnum):
    """Purpose of a chunk."""

    STATIC = 1  # a state of the background; groups refer to it
    GROUP = 2  # a group of consecutive frames of one track
    COLORS = 3  # the colours of the vertices of another chunk
    ATLAS = 4  # places of faces in a texture: of a group and those predicted from it, or of a background
    PICTURES = 5  # the textures of a group's frames, or of a background
    COMPATIBLE = 6  # the same textures in a coding that more devices support
    SPLATS = 7  # Gaussians on the faces of a group and of those predicted from it
    AUDIO = 8  # the audio file played with the frames


class Form(IntEnum):
    """Coding of a chunk, stored in its first byte."""

    LAPLACIAN = 1  # reference mesh and displacements
    LAYERS = 2  # coarse mesh and its motion, then one scalar per vertex for each level of subdivision
    DRACO = 3  # one Draco mesh per frame
    EMPTY = 4  # frames without a surface
    PATCH = 5  # a background: another background without some faces, plus a Draco mesh
    VERTEX_COLORS = 6  # colours of vertices, as fields over their connectivity
    PLACES = 7  # places of corners in a texture
    VIDEO = 8  # pictures of a video: one a frame, of a background one each `interval` frames
    GAUSSIANS = 9  # splats, the most important first
    AUDIO_FILE = 10  # an audio file, unchanged


class AnchorRule(IntEnum):
    """Rule by which encoder and decoder choose the anchors of the Laplacian coordinates."""

    SPREAD = 1  # every k-th vertex, and the first vertex of each component that has none of these
    FARTHEST = 2  # farthest points by edge hops, starting from the first vertex of each component


@dataclass(frozen=True, slots=True)
class Preamble:
    """The first bytes of a file: its signature, and the size of the head."""

    magic: Annotated[bytes, Bytes(8), "`52 45 45 4c 0d 0a 1a 0a`"]
    version: Annotated[int, U8, "version of the format, 1; a reader refuses any other"]
    flags: Annotated[int, U8, "1: the metadata has an `edit`, which counts; other bits are 0"]
    head_size: Annotated[int, U32, "size of the head, bytes: offset of the first chunk"]


@dataclass(frozen=True, slots=True)
class Header:
    """Values for all frames. Coordinates y in chunks are normalised: x = origin + scale * y is in metres."""

    frame_rate: Annotated[float, F64, "1/s, above 0"]
    origin: Annotated[tuple[float, ...], Array(3, F64), "m"]
    scale: Annotated[float, F64, "m, above 0"]
    minimum: Annotated[tuple[float, ...], Array(3, F32), "lower corner of the sequence's bounding box, normalised"]
    maximum: Annotated[tuple[float, ...], Array(3, F32), "upper corner of this box"]
    metadata: Annotated[str, Text(U16), "a JSON object, not needed for decoding: `up` (axis; y if absent), preset ..."]
    first_time: Annotated[int, I64, "time of frame 0, microseconds"] = 0
    intervals: Annotated[
        tuple[int, ...],
        List(Varint(), Varint()),
        "microseconds from each frame to the next, each above 0; "
        "if empty, frame i is at first_time + 10^6 * i / frame_rate",
    ] = ()


@dataclass(frozen=True, slots=True)
class Layer:
    """Byte range of a chunk, whose first k layers are its first bytes; the form decides which k can be decoded."""

    size: Annotated[int, Varint(), "bytes, above 0"]
    crc: Annotated[int, U32, "CRC-32 (ISO-HDLC, as in zlib) of these bytes"]


@dataclass(frozen=True, slots=True)
class IndexEntry:
    """Index entry of a chunk."""

    kind: Annotated[int, Choice(U8, ChunkKind, is_open=True), "purpose"]
    form: Annotated[int, Choice(U8, Form, is_open=True), "coding; equal to the first byte of the chunk"]
    frames: Annotated[int, U16, "number of frames; 0 if and only if STATIC, a companion of one, or AUDIO"]
    track: Annotated[int, Varint(), "number of the moving body, from 0; 0 if STATIC or AUDIO"]
    depends_on: Annotated[
        tuple[int, ...],
        List(U8, Varint()),
        "numbers of the earlier chunks that it needs: "
        "for a GROUP, the STATIC chunk it is shown with and the GROUP right before it in its track; "
        "for a STATIC of form PATCH, the STATIC chunk that it changes; "
        "for COLORS, the chunk whose vertices have them and, where they are predicted, the COLORS of the group before; "
        "for ATLAS, the GROUP whose base mesh, or the STATIC whose faces, it places; "
        "for SPLATS, the GROUP whose base mesh they are on; "
        "for PICTURES and COMPATIBLE, the GROUP, the ATLAS, and but for the first of this, that of the group before",
    ]
    layers: Annotated[tuple[Layer, ...], List(U16, Nested(Layer)), "at least one"]


@dataclass(frozen=True, slots=True)
class Index:
    """All chunks in the order of their bytes; in each track the frames of GROUP chunks follow one another from 0."""

    chunks: Annotated[tuple[IndexEntry, ...], List(U32, Nested(IndexEntry)), "chunk 0, 1 ..."]


@dataclass(frozen=True, slots=True)
class Checksum:
    """Last record of the head: its checksum."""

    crc: Annotated[int, U32, "CRC-32 of the head up to here"]


@dataclass(frozen=True, slots=True)
class LaplacianGroup:
    """The payload of a group of form LAPLACIAN."""

    form: Annotated[Form, Choice(U8, Form), "LAPLACIAN"]
    levels: Annotated[int, U8, "midpoint subdivisions of the decoded reference mesh"]
    step: Annotated[
        float, F64, "spacing of the reference's lattice, above 0: decoded vertices are rounded to multiples"
    ]
    reference: Annotated[bytes, Blob(U32), "the reference mesh, Draco"]
    displacements: Annotated[bytes, Rest(), "a DisplacementHead and its streams"]


@dataclass(frozen=True, slots=True)
class Component:
    """Direction of the basis, and sizes of the streams of its weights."""

    basis_bits: Annotated[int, U8, "b, at most 30: the direction's numbers are integers times 2^-b"]
    step_level: Annotated[int, U8, "k: the quantiser's step is 2^(-k/8)"]
    anchors_size: Annotated[int, Varint(), "bytes of its anchors' stream"]
    deltas_size: Annotated[int, Varint(), "bytes of its deltas' stream"]


@dataclass(frozen=True, slots=True)
class DisplacementHead:
    """Head of coded displacements; for each component in turn, the streams of its anchors and its deltas follow."""

    frames: Annotated[int, U16, "T, above 0"]
    anchor_rule: Annotated[AnchorRule, Choice(U8, AnchorRule), "how anchors are chosen"]
    anchor_count: Annotated[int, Varint(), "number of requested anchors; each connected component has at least one"]
    anchor_weight: Annotated[int, U8, "factor of the anchors' rows, above 0"]
    mean_bits: Annotated[int, U8, "b, at most 30: the mean's numbers are integers times 2^-b"]
    components: Annotated[tuple[Component, ...], List(U16, Nested(Component)), "strongest first, at most 3 T"]
    basis: Annotated[bytes, Blob(Varint()), "integers: 3 T of the mean, then 3 T of each component's direction"]


class SharedMotion(IntEnum):
    """Motion shared by all vertices of a mesh."""

    NONE = 0
    SHIFTS = 1
    POSES = 2


class Origin(IntEnum):
    """Prediction of a coded field."""

    ALONE = 0  # nothing outside its group
    PREVIOUS = 1  # the last frame of the previous group


@dataclass(frozen=True, slots=True)
class CodedField:
    """Trajectories in a basis: quantised weights at the vertices of a causal graph."""

    columns: Annotated[int, Varint(), "M, number of basis vectors"]
    step_level: Annotated[int, U8, "k: the quantiser's step is 2^(-k/8)"]
    basis: Annotated[bytes, Blob(Varint()), "integers: what moves all vertices alike, if anything, then the basis"]
    symbols: Annotated[bytes, Blob(Varint()), "one stream: the symbols of all columns"]


@dataclass(frozen=True, slots=True)
class LayersGroup:
    """First layer of a group of form LAYERS; a LayersLevel for each level follows."""

    form: Annotated[Form, Choice(U8, Form), "LAYERS"]
    origin: Annotated[Origin, Choice(U8, Origin), "source of the base mesh"]
    frames: Annotated[int, U8, "T, above 0"]
    levels: Annotated[int, U8, "L, midpoint subdivisions of the base mesh"]
    step: Annotated[float, F64, "spacing of the base's lattice, above 0: decoded vertices are rounded to multiples"]
    base: Annotated[bytes, Blob(Varint()), "the base mesh, Draco; no bytes where its origin is PREVIOUS"]
    shared: Annotated[SharedMotion, Choice(U8, SharedMotion), "what moves all vertices alike"]
    motion: Annotated[CodedField, Nested(CodedField), "the displacements of the base's vertices"]


@dataclass(frozen=True, slots=True)
class LayersLevel:
    """Layer of a group of form LAYERS that refines it by one level of subdivision."""

    origin: Annotated[Origin, Choice(U8, Origin), "prediction of the scalars"]
    curvature: Annotated[int, U8, "share of an edge's sagitta by which its midpoint is lifted, 64ths"]
    sibling_weight: Annotated[int, U8, "weight of the siblings' mean in a prediction, 64ths"]
    scalars: Annotated[CodedField, Nested(CodedField), "the offsets of its new vertices"]


@dataclass(frozen=True, slots=True)
class LayersPatches:
    """Optional last layer of a group of form LAYERS: corrections where frames do not follow the base mesh."""

    runs: Annotated[int, Varint(), "number of integers in `dropped`"]
    dropped: Annotated[bytes, Blob(Varint()), "integers: lengths of runs; they mark the faces that each frame lacks"]
    step_level: Annotated[int, U8, "k: the spacing of the mesh's lattice is 2^(-k/8)"]
    width: Annotated[int, Varint(), "cells along x that each frame has in the lattice"]
    mesh: Annotated[bytes, Blob(Varint()), "additional faces of all frames, Draco; no bytes: nothing"]


@dataclass(frozen=True, slots=True)
class DracoGroup:
    """The payload of a group of form DRACO."""

    form: Annotated[Form, Choice(U8, Form), "DRACO"]
    levels: Annotated[int, U8, "midpoint subdivisions of every decoded mesh"]
    step: Annotated[float, F64, "spacing of the frames' lattice, above 0: decoded vertices are rounded to multiples"]
    meshes: Annotated[tuple[bytes, ...], List(U16, Blob(U32)), "one Draco mesh per frame; no bytes: an empty frame"]


@dataclass(frozen=True, slots=True)
class StaticPatch:
    """The payload of a STATIC chunk of form PATCH: changes of the background that it depends on."""

    form: Annotated[Form, Choice(U8, Form), "PATCH"]
    step: Annotated[float, F64, "spacing of the mesh's lattice, above 0: decoded vertices are rounded to multiples"]
    runs: Annotated[int, Varint(), "number of integers in `dropped`"]
    dropped: Annotated[bytes, Blob(Varint()), "integers: lengths of runs of faces, kept and dropped in turn"]
    mesh: Annotated[bytes, Blob(Varint()), "additional faces, Draco; no bytes: nothing"]


@dataclass(frozen=True, slots=True)
class VertexColors:
    """First bytes of a chunk of form VERTEX_COLORS; for each mesh, a CodedField and a ColorsLevel a level follow."""

    form: Annotated[Form, Choice(U8, Form), "VERTEX_COLORS"]
    origin: Annotated[Origin, Choice(U8, Origin), "prediction of the values"]
    chroma: Annotated[int, U8, "what colour differences were multiplied by, 64ths, above 0"]


@dataclass(frozen=True, slots=True)
class ColorsLevel:
    """Colours of the vertices that a level of subdivision adds."""

    sibling_weight: Annotated[int, U8, "weight of the siblings' mean in a prediction, 64ths"]
    values: Annotated[CodedField, Nested(CodedField), "differences from the means of the ends of their edges"]


class VideoCodec(IntEnum):
    """Coding of pictures."""

    AV1 = 1  # a temporal unit a picture, of the low-overhead format
    H264 = 2  # an access unit a picture, with start codes (Annex B)


@dataclass(frozen=True, slots=True)
class Atlas:
    """The payload of a chunk of form PLACES: of each corner of the base mesh's faces, its place in the texture."""

    form: Annotated[Form, Choice(U8, Form), "PLACES"]
    width: Annotated[int, U16, "of the texture, texels, even, above 0"]
    height: Annotated[int, U16, "of the texture, texels, even, above 0"]
    join_count: Annotated[int, Varint(), "number of integers in `joins`"]
    start_count: Annotated[int, Varint(), "number of integers in `starts`"]
    rest_count: Annotated[int, Varint(), "number of integers in `rests`"]
    joins: Annotated[bytes, Blob(Varint()), "integers: whether faces share the places of an edge, or of a corner"]
    starts: Annotated[bytes, Blob(Varint()), "integers: places of the faces that share none with one before"]
    rests: Annotated[bytes, Blob(Varint()), "integers: differences of places from where shapes predict them"]


@dataclass(frozen=True, slots=True)
class Pictures:
    """The payload of a chunk of form VIDEO: the textures of a group's frames; of a background, each of its layers."""

    form: Annotated[Form, Choice(U8, Form), "VIDEO"]
    codec: Annotated[VideoCodec, Choice(U8, VideoCodec), "coding of the pictures"]
    interval: Annotated[int, Varint(), "frames from one picture to the next, above 0; 1 of a GROUP"]
    packets: Annotated[tuple[bytes, ...], List(U16, Blob(Varint())), "one a picture, in their order"]


@dataclass(frozen=True, slots=True)
class Gaussians:
    """First bytes of a chunk of form GAUSSIANS; a GaussiansLayer follows for each of its layers."""

    form: Annotated[Form, Choice(U8, Form), "GAUSSIANS"]
    place_bits: Annotated[int, U8, "b, 1 to 14: weights of a face's corners are integers times 2^-b"]
    turn_bits: Annotated[int, U8, "b, 1 to 14: angles are integers times pi 2^-b"]
    opacity_bits: Annotated[int, U8, "b, 1 to 14: opacities are integers times 2^-b"]
    color_bits: Annotated[int, U8, "b, 1 to 14: lumas and colour differences are integers times 2^-b"]
    offset_level: Annotated[int, U8, "k: offsets along the normal are integers times 2^(-k/8)"]
    scale_level: Annotated[int, U8, "k, which levels of scales are counted from"]
    count: Annotated[int, Varint(), "N, splats of all layers"]


@dataclass(frozen=True, slots=True)
class GaussiansLayer:
    """Splats of a layer, in the order of their faces."""

    count: Annotated[int, Varint(), "n, above 0"]
    faces: Annotated[bytes, Blob(Varint()), "n integers: how many faces of the base mesh lie between it and the last"]
    places: Annotated[bytes, Blob(Varint()), "2 n integers: weights of the second corners, then of the third ones"]
    offsets: Annotated[bytes, Blob(Varint()), "n integers: offsets along the normal"]
    turns: Annotated[bytes, Blob(Varint()), "n integers: angles of the longer axes"]
    scales: Annotated[bytes, Blob(Varint()), "2 n integers: levels of longer scales, then how many the shorter add"]
    opacities: Annotated[bytes, Blob(Varint()), "n integers: opacities"]
    colors: Annotated[bytes, Blob(Varint()), "3 n integers: lumas, then both differences, each less the splat before"]


class AudioType(IntEnum):
    """Container and coding of an audio file."""

    OGG = 1  # Opus in Ogg: audio/ogg
    WEBM = 2  # Opus in WebM: audio/webm
    MP4 = 3  # AAC in MP4 (.m4a): audio/mp4
    ADTS = 4  # AAC in ADTS: audio/aac
    MPEG = 5  # MP3: audio/mpeg


MEDIA_TYPES = dict(zip(AudioType, ("audio/ogg", "audio/webm", "audio/mp4", "audio/aac", "audio/mpeg"), strict=True))


@dataclass(frozen=True, slots=True)
class AudioFile:
    """The payload of a chunk of form AUDIO_FILE; its layers are pieces of it."""

    form: Annotated[Form, Choice(U8, Form), "AUDIO_FILE"]
    type: Annotated[AudioType, Choice(U8, AudioType), "what the file is"]
    start: Annotated[int, I64, "when it begins, microseconds of the clock that first_time is of"]
    data: Annotated[bytes, Rest(), "the file, at least one byte"]


@dataclass(frozen=True, slots=True)
class EmptyGroup:
    """The payload of a group of form EMPTY."""

    form: Annotated[Form, Choice(U8, Form), "EMPTY"]


RECORDS = (Preamble, Header, Index, IndexEntry, Layer, Checksum)
PAYLOADS = (
    LaplacianGroup,
    DisplacementHead,
    Component,
    LayersGroup,
    LayersLevel,
    CodedField,
    LayersPatches,
    DracoGroup,
    EmptyGroup,
    StaticPatch,
    VertexColors,
    ColorsLevel,
    Atlas,
    Pictures,
    Gaussians,
    GaussiansLayer,
    AudioFile,
)
