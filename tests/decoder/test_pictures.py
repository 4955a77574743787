"""Pictures of a file: the same by every way, within a bound on memory, and damage that costs colours only."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import meshreel
import meshreel.decoder.pictures as pictures
from core.fuzz.mutate import Chunk, assemble, parse
from meshreel.coding.appearance.pictures import encode_pictures
from meshreel.decoder.video import Video
from meshreel.errors import FormatError
from meshreel.format import budget
from meshreel.format.layout import ChunkKind, Pictures, VideoCodec
from meshreel.format.records import pack, unpack_all
from tests.golden import GOLDEN

pytest.importorskip("av")
TEXTURES, SCENE = ((GOLDEN / "colored" / f"{name}.reel").read_bytes() for name in ("textures", "scene"))


def changed(data: bytes, kind: ChunkKind, change: Callable[[tuple[bytes, ...]], tuple[bytes, ...]]) -> Video:
    """The video, of whose first chunk of a kind the layers are changed."""
    header, chunks = parse(data)
    at = next(k for k, chunk in enumerate(chunks) if chunk.entry.kind == kind)
    chunks[at] = Chunk(chunks[at].entry, change(chunks[at].layers))
    return meshreel.open(assemble(header, chunks))


def packets(layer: bytes) -> Pictures:
    return unpack_all(Pictures, layer)


def pixels(video: Video) -> list[np.ndarray]:
    return [mesh.texture.pixels for mesh in video]


def test_every_way_to_a_picture_gives_the_same():
    in_order = pixels(meshreel.open(TEXTURES))
    for order in ([5, 2, 4, 0], [5], [3, 3, 1]):
        video = meshreel.open(TEXTURES)
        for number in order:
            np.testing.assert_array_equal(video[number].texture.pixels, in_order[number])
    room = meshreel.open(SCENE)
    shown = {frame: room.background(frame).texture.pixels for frame in (0, 1, 127, 128, 139, 149)}
    assert (shown[0] == shown[1]).all() and (shown[139] == shown[149]).all()
    assert len({one.tobytes() for one in shown.values()}) == 4
    for frame in (149, 128, 0):
        np.testing.assert_array_equal(room.background(frame).texture.pixels, shown[frame])


def test_where_memory_is_short_one_decoder_is_left_and_the_pictures_are_the_same(monkeypatch: pytest.MonkeyPatch):
    def all_of(video: Video) -> list[np.ndarray]:
        return [
            part.texture.pixels for frame in (0, 130, 1, 151) for part in video.parts(frame).values() if part.texture
        ]

    wanted = all_of(meshreel.open(SCENE))
    monkeypatch.setattr(budget, "LIMITS", replace(budget.LIMITS, videos=0, per_byte=0, pictures=1 << 30))
    monkeypatch.setattr(pictures, "VideoDecoder", kept := Counting(pictures.VideoDecoder))
    video = meshreel.open(SCENE)
    for one, other in zip(all_of(video), wanted, strict=True):
        np.testing.assert_array_equal(one, other)
    assert len(video.tracks[0]._pictures._decoders.places) == 1 and kept.count >= 4


class Counting:
    """Makes something, and counts how often."""

    def __init__(self, make: Callable[..., object]) -> None:
        self._make, self.count = make, 0

    def __call__(self, *values: object) -> object:
        self.count += 1
        return self._make(*values)


@pytest.mark.parametrize(
    "change",
    [
        lambda layers: (layers[0][:-9],),
        lambda layers: (*layers, layers[0]),
        lambda layers: (encode_pictures(packets(layers[0]).packets[:2]),),
        lambda layers: (encode_pictures(packets(layers[0]).packets, interval=0),),
        lambda layers: (encode_pictures(packets(layers[0]).packets, interval=2),),
        lambda layers: (encode_pictures((b"", *packets(layers[0]).packets[1:])),),
        lambda layers: (encode_pictures(packets(layers[0]).packets[::-1]),),
        lambda layers: (b"".join(layers) + b"\0",),
        lambda layers: (pack(replace(packets(layers[0]), codec=VideoCodec.H264)),),
    ],
)
def test_damaged_pictures_of_a_group_cost_textures_only(change: Callable[[tuple[bytes, ...]], tuple[bytes, ...]]):
    video = changed(TEXTURES, ChunkKind.PICTURES, change)
    for frame in (5, 0):
        mesh = video[frame]
        assert mesh.colors is not None and len(mesh.faces) > 0
        with pytest.raises(FormatError, match="pictures, frames 0 to 2"):
            _ = mesh.texture.pixels


@pytest.mark.parametrize(
    ("change", "lost"),
    [
        (lambda layers: (encode_pictures(packets(layers[0]).packets[:63], interval=2), layers[1]), 0),
        (lambda layers: (layers[0], pack(replace(packets(layers[1]), packets=()))), 130),
        (lambda layers: (layers[0], layers[1][:-1]), 130),
        (lambda layers: (b"".join(layers),), 0),
        (lambda layers: (encode_pictures(packets(layers[0]).packets, interval=0), layers[1]), 0),
    ],
)
def test_damaged_pictures_of_a_background_cost_those_of_their_layer(
    change: Callable[[tuple[bytes, ...]], tuple[bytes, ...]], lost: int
):
    video = changed(SCENE, ChunkKind.PICTURES, change)
    with pytest.raises(FormatError, match=r"the background of frame|pictures"):
        _ = video.background(lost).texture.pixels
    assert len(video.at(colors=False).background(lost).faces) > 0
    if lost:
        assert video.background(0).texture.pixels.shape == (32, 32, 3)


def test_a_picture_that_was_refused_is_not_decoded_again(monkeypatch: pytest.MonkeyPatch):
    def damage(layers: tuple[bytes, ...]) -> tuple[bytes, ...]:
        first, *_, last = packets(layers[0]).packets
        return (encode_pictures([first, b"\x32\3\x10\0\0", last]),)

    video = changed(TEXTURES, ChunkKind.PICTURES, damage)
    frames = [video[number] for number in range(6)]
    whole = frames[0].texture.pixels
    for frame in frames[1:]:
        with pytest.raises(FormatError, match="pictures, frames 0 to 2"):
            _ = frame.texture.pixels
    np.testing.assert_array_equal(frames[0].texture.pixels, whole)
    monkeypatch.setattr(pictures, "VideoDecoder", lambda *_: pytest.fail("it is decoded again"))
    with pytest.raises(FormatError, match="pictures, frames 0 to 2"):
        _ = frames[4].texture.pixels


@pytest.mark.parametrize("kind", [ChunkKind.COLORS, ChunkKind.ATLAS])
def test_truncated_and_changed_colours_cost_colours_only(kind: ChunkKind):
    reader = meshreel.open(TEXTURES).reader
    size = next(chunk.size for chunk in reader.chunks if chunk.kind == kind)
    refused = 0
    for at in range(0, size, 7):
        for damage in (
            lambda data, at=at: data[:at],
            lambda data, at=at: data[:at] + bytes([data[at] ^ 255]) + data[at + 1 :],
        ):
            video = changed(TEXTURES, kind, lambda layers, damage=damage: (damage(b"".join(layers)) or b"\0",))
            try:
                assert video[5].texture.pixels.shape == (32, 64, 3)
            except FormatError:
                refused += 1
            assert len(video.at(colors=False)[5].faces) > 0
    assert refused > size // 7
