"""The C library decodes what the Python decoder decodes, bit for bit, and refuses what that refuses."""

import io
import json
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from zlib import crc32

import numpy as np
import pytest

import meshreel
from meshreel.coding.appearance.pictures import decode_pictures
from meshreel.container.writer import ReelWriter, pack_head
from meshreel.errors import FormatError
from meshreel.format.layout import (
    MEDIA_TYPES,
    AudioFile,
    AudioType,
    ChunkKind,
    DracoGroup,
    Form,
    Header,
    Index,
    IndexEntry,
    Layer,
    Preamble,
)
from meshreel.format.records import pack, unpack, unpack_all
from meshreel.types import Mesh
from tests.coding.draco_mutants import mutant, surface, valid_meshes
from tests.decoder.c_abi import (
    AV1,
    BACKGROUND,
    BAD_ARGUMENT,
    DAMAGED,
    H264,
    ROOT,
    UNREADABLE,
    WHOLE,
    CError,
    CVideo,
    configure,
    library,
    run,
)
from tests.golden import GOLDEN

pytestmark = pytest.mark.skipif(shutil.which("cmake") is None, reason="needs CMake, of the extra dev")
PLAIN = sorted([*GOLDEN.glob("*.reel"), *GOLDEN.glob("audio/*.reel")])
GEOMETRY = sorted([*PLAIN, *GOLDEN.glob("splats/*.reel")])
COLORED = sorted(GOLDEN.glob("colored/*.reel"))
EXACT = Header(30.0, (0.0, 0.0, 0.0), 1.0, (-1.0, -1.0, -1.0), (1.0, 1.0, 1.0), "{}")
named = {"ids": lambda path: path.stem}


def part_of(name: str) -> int:
    return BACKGROUND if name == "background" else int(name.split()[1])


@pytest.mark.parametrize("path", GEOMETRY + COLORED, **named)
def test_every_part_of_every_frame_is_that_of_python(path: Path):
    known = meshreel.open(path)
    for layers in (None, 0, 2):
        shown = known.at(layers)
        with CVideo(path.read_bytes()) as video:
            video.set_layers(-1 if layers is None else layers)
            for frame in [*range(min(len(shown), 20)), *range(len(shown) - 1, max(len(shown) - 5, -1), -1)]:
                for name, mesh in shown.parts(frame).items():
                    check_same(mesh, video.decode(frame, part_of(name)))
                whole = video.decode(frame, WHOLE)
                check_same(replace(shown[frame], uv=None), whole)
                about = whole["vertices"] - np.array(shown.reader.header.origin)
                np.testing.assert_array_equal(about.astype(np.float32), whole["singles"])


def check_same(mesh: Mesh, found: dict) -> None:
    np.testing.assert_array_equal(mesh.vertices, found["vertices"])
    np.testing.assert_array_equal(mesh.faces, found["faces"])
    for wanted, own in ((mesh.colors, found["colors"]), (mesh.uv, found["uv"])):
        if len(mesh.vertices):
            assert (wanted is None) == (own is None)
            if wanted is not None:
                np.testing.assert_array_equal(wanted, own)


@pytest.mark.parametrize("path", GEOMETRY + COLORED, **named)
def test_a_file_is_described_as_by_python(path: Path):
    known = meshreel.open(path)
    reader, header = known.reader, known.reader.header
    with CVideo(path.read_bytes()) as video:
        info = video.info
        assert (info.frames, info.tracks, info.up) == (len(known), len(known.tracks), 0)
        assert info.duration == pytest.approx(known.duration, abs=1e-12)
        assert json.loads(video.metadata) == known.metadata
        assert (tuple(info.origin), info.scale) == (header.origin, header.scale)
        np.testing.assert_array_equal((info.minimum, info.maximum), known.box)
        has = reader.has_background, reader.is_colored, reader.has_textures, reader.has_splats
        assert (info.has_background, info.has_colors, info.has_textures, info.has_splats) == has
        assert info.layers == max(len(group.layers) for group in reader.groups) - 1


@pytest.mark.parametrize(
    ("text", "up"), [('{"up":"z"}', 1), ('{"a":{"up":"z"},"up" : "-y"}', 2), ('{"b":"up","up":"-z"}', 3), ("{}", 0)]
)
def test_the_axis_that_points_up_is_told(text: str, up: int):
    with CVideo(one_mesh(b"", replace(EXACT, metadata=text))) as video:
        assert video.info.up == up


def test_splats_are_those_of_python():
    path = GOLDEN / "splats/splats.reel"
    for layers in (None, 0):
        known, counts = meshreel.open(path).at(layers), list[int]()
        with CVideo(path.read_bytes()) as video:
            video.set_layers(-1 if layers is None else layers)
            for frame in range(len(known)):
                wanted, found = known.splats(frame), video.splats(frame, 0)
                assert (wanted is None) == (found is None)
                counts.append(0 if found is None else len(found["opacities"]))
                for name, array in (found or {}).items():
                    np.testing.assert_allclose(array, getattr(wanted, name), rtol=0, atol=1e-9)
        assert max(counts) > 0 == min(counts)


def test_packets_are_those_of_the_file_in_their_order():
    known = meshreel.open(GOLDEN / "colored/textures.reel").reader
    with CVideo((GOLDEN / "colored/textures.reel").read_bytes()) as video:
        for codec, kind in ((AV1, ChunkKind.PICTURES), (H264, ChunkKind.COMPATIBLE)):
            chunks = [chunk for chunk in known.chunks if chunk.kind == kind]
            records = [decode_pictures(known.read_chunk(c.number), c.frame_count, 64 * 32) for c in chunks]
            wanted = [packet for record in records for packet in record.packets]
            found = [video.picture(frame, 0, codec) for frame in range(known.frame_count)]
            assert [picture[0] for picture in found if picture] == wanted
            assert [picture[1].number for picture in found if picture] == list(range(known.frame_count))
            assert {(p[1].width, p[1].height) for p in found if p} == {(64, 32)}
            assert len({p[1].stream for p in found if p}) == 1


def test_pictures_of_a_background_stay_for_their_interval_and_begin_anew_in_each_layer():
    with CVideo((GOLDEN / "colored/scene.reel").read_bytes()) as video:
        found = [video.picture(frame, BACKGROUND, AV1) for frame in range(150)]
        places = [(picture[1].stream, picture[1].number) for picture in found if picture]
        assert places[0] == places[1] != places[2]
        assert [number for _, number in places[::2]] == [*range(64), *range(6), 5, 5, 5, 5, 5]
        assert len({stream for stream, _ in places}) == 2
        with pytest.raises(CError) as error:
            video.picture(0, WHOLE, AV1)
        assert error.value.status == BAD_ARGUMENT


def test_the_audio_file_is_that_of_python_and_its_damage_is_refused():
    data = (GOLDEN / "audio/audio.reel").read_bytes()
    known = meshreel.open(data)
    with CVideo(data) as video, CVideo((GOLDEN / "layers.reel").read_bytes()) as silent:
        kept, start, kind = video.audio() or pytest.fail("no audio")
        assert (kept, start, MEDIA_TYPES[AudioType(kind)]) == (
            known.audio.data,
            known.audio.start,
            known.audio.media_type,
        )
        assert silent.audio() is None
    broken, chunk = bytearray(data), known.reader.audio
    broken[chunk.offset + 20] ^= 1
    with CVideo(bytes(broken)) as video, pytest.raises(CError, match="checksum") as error:
        video.audio()
    assert error.value.status == DAMAGED


@pytest.mark.parametrize(("start", "sound"), [(10**15 + 1, b"a"), (-(10**15) - 1, b"a"), (0, b"")])
def test_audio_that_python_refuses_is_refused(start: int, sound: bytes):
    file = io.BytesIO()
    with ReelWriter(file, EXACT, audio=pack(AudioFile(Form.AUDIO_FILE, AudioType.OGG, start, sound))) as writer:
        writer.add_group(0, 1, pack(DracoGroup(Form.DRACO, 0, 0.02, (valid_meshes(0)[0],))))
    with pytest.raises(FormatError):
        _ = meshreel.open(file.getvalue()).audio
    with CVideo(file.getvalue()) as video:
        with pytest.raises(CError, match="audio") as error:
            video.audio()
        assert error.value.status == DAMAGED
        assert len(video.decode(0)["vertices"])  # the frame does not need it


def test_faces_that_stay_keep_their_identity():
    with CVideo((GOLDEN / "layers.reel").read_bytes()) as video:
        found = [video.decode(frame, 0) for frame in range(video.info.frames)]
        assert len({part["identity"] for part in found}) == 1
    with CVideo((GOLDEN / "layers_patched.reel").read_bytes()) as video:
        assert len({video.decode(frame, 0)["identity"] for frame in range(3)}) == 3


def test_a_file_is_read_by_ranges_and_a_source_that_fails_may_recover():
    data = (GOLDEN / "layers_open.reel").read_bytes()
    asked, fails = list[int](), [False]

    def read(offset: int, length: int) -> bytes:
        asked.append(length)
        return b"" if fails[0] else data[offset : offset + length]

    with CVideo(data, read) as video:
        assert asked == [min(16384, len(data))]
        fails[0] = True
        with pytest.raises(CError, match="could not be read") as error:
            video.decode(5)
        assert error.value.status == UNREADABLE
        fails[0] = False
        check_same(meshreel.open(data)[5], video.decode(5))
        before = len(asked)
        video.decode(5)
        assert len(asked) == before


def test_what_a_truncated_file_has_left_is_decoded():
    data = (GOLDEN / "mixed.reel").read_bytes()
    with CVideo(data[:-1]) as video:
        check_same(meshreel.open(data)[2], video.decode(2))
        with pytest.raises(CError, match="truncated") as error:
            video.decode(int(video.info.frames) - 1)
        assert error.value.status == UNREADABLE


def one_mesh(draco: bytes, header: Header = EXACT, step: float = 0.02) -> bytes:
    """Return a file of one frame, of which `draco` are the bytes."""
    file = io.BytesIO()
    with ReelWriter(file, header) as writer:
        writer.add_group(0, 1, pack(DracoGroup(Form.DRACO, 0, step, (draco,))))
    return file.getvalue()


@pytest.mark.parametrize("seed", range(3))
def test_draco_meshes_with_holes_and_handles_are_as_draco_decodes_them(seed: int):
    for draco in valid_meshes(seed):
        check_as_python(one_mesh(draco))


def test_damaged_draco_meshes_are_refused_where_draco_refuses_them():
    numbers, valid = np.random.default_rng(7), valid_meshes(0)
    makers: tuple[Callable[[], bytes], ...] = (lambda: mutant(numbers, valid), lambda: surface(numbers))
    verdicts = [check_as_python(one_mesh(makers[k % 2]())) for k in range(300)]
    assert 30 < sum(verdicts) < 270


def check_as_python(data: bytes) -> bool:
    """Check that a file of one frame decodes to the same, or is refused, in both; return whether it decodes."""
    with CVideo(data) as video:
        try:
            wanted = meshreel.open(data)[0]
        except FormatError as error:
            with pytest.raises(CError) as found:
                video.decode(0)
            assert found.value.status == DAMAGED, error
            return False
        check_same(wanted, video.decode(0))
        return True


def damaged(data: bytes, numbers: np.random.Generator) -> bytes:
    """Return a file with a bit of a layer changed, and checksums that match it."""
    preamble, start = unpack(Preamble, data)
    header, start = unpack(Header, data, start)
    end = preamble.head_size - 4
    entries = list(unpack_all(Index, data[start:end]).chunks)
    body, at = bytearray(data[preamble.head_size :]), 0
    target = int(numbers.integers(sum(len(entry.layers) for entry in entries)))
    for number, entry in enumerate(entries):
        layers = list[Layer]()
        for layer in entry.layers:
            target -= 1
            if target == -1:
                body[at + int(numbers.integers(layer.size))] ^= 1 << int(numbers.integers(8))
            layers.append(Layer(layer.size, crc32(body[at : at + layer.size])))
            at += layer.size
        entries[number] = IndexEntry(entry.kind, entry.form, entry.frames, entry.track, entry.depends_on, tuple(layers))
    return pack_head(header, Index(tuple(entries))) + bytes(body)


@pytest.mark.parametrize("path", GEOMETRY, **named)
def test_damaged_chunks_are_refused_where_python_refuses_them(path: Path):
    numbers, verdicts = np.random.default_rng(3), set[bool]()
    for _ in range(40):
        data = damaged(path.read_bytes(), numbers)
        known = meshreel.open(data)
        with CVideo(data) as video:
            for frame in range(len(known)):
                try:
                    wanted = known[frame]
                except FormatError:
                    verdicts.add(False)
                    with pytest.raises(CError):
                        video.decode(frame)
                else:
                    verdicts.add(True)
                    check_same(wanted, video.decode(frame))
    assert verdicts == ({False} if path.stem == "empty" else {True, False})


def test_colours_that_are_damaged_are_left_out_and_told_of():
    data = bytearray((GOLDEN / "colored/textures.reel").read_bytes())
    known = meshreel.open(bytes(data))
    [colors, *_] = [chunk for chunk in known.reader.chunks if chunk.kind == ChunkKind.COLORS]
    data[colors.offset + 5] ^= 1
    with CVideo(bytes(data)) as video:
        found = video.decode(0, 0)
        assert "checksum" in video.message and found["colors"] is None
        check_same(known.at(colors=False).parts(0)["track 0"], found | {"uv": None})


def test_the_header_is_c_and_the_installed_package_is_found(tmp_path: Path):
    library()
    header = tmp_path / "header.c"
    header.write_text('#include "meshreel/decoder.h"\nint main(void) { return MESHREEL_ABI_VERSION == 0; }\n')
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    assert compiler
    run(
        compiler,
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-pedantic",
        "-Werror",
        "-fsyntax-only",
        f"-I{ROOT / 'core/include'}",
        header,
    )
    run("cmake", "--install", ROOT / "build/decoder", "--prefix", tmp_path / "installed")
    configure("core/examples", tmp_path / "examples", f"-DCMAKE_PREFIX_PATH={tmp_path / 'installed'}")
    run("cmake", "--build", tmp_path / "examples")
    path, obj = GOLDEN / "scene.reel", tmp_path / "frame.obj"
    printed = run(tmp_path / "examples/frames", path, "7", obj)
    mesh = meshreel.open(path)[7]
    assert f"frame 7 at 0.280 s: {len(mesh.vertices)} vertices, {len(mesh.faces)} faces\n" in printed
    lines = obj.read_text().splitlines()
    points = np.array([line.split()[1:] for line in lines if line.startswith("v ")], dtype=np.float32)
    about = np.array(meshreel.open(path).reader.header.origin)
    np.testing.assert_array_equal(points, (mesh.vertices - about).astype(np.float32))
    assert sum(line.startswith("f ") for line in lines) == len(mesh.faces)
    refused = subprocess.run([tmp_path / "examples/frames", obj], capture_output=True, text=True, check=False)
    assert refused.returncode == 1 and "not a .reel file" in refused.stderr
