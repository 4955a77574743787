"""The Unity package: its decoder under Mono against Python's, and its component in a stand-in for Unity."""

import importlib
import io
import json
import os
import re
import shutil
import struct
import subprocess
import tarfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from zlib import crc32

import av
import numpy as np
import pytest

import meshreel
from meshreel.container.writer import pack_head
from meshreel.edit import cut, retime, tag
from meshreel.format.layout import Header, Index, Layer, Preamble
from meshreel.format.records import unpack, unpack_all
from meshreel.types import UP_AXES, Mesh, MeshList
from tests.decoder.c_abi import AV1, BACKGROUND, H264, ROOT, WHOLE, CVideo, library, run
from tests.golden import GOLDEN
from tests.metrics.shapes import sphere

PACKAGE, TOOLS = ROOT / "engines/unity", Path(__file__).parent / "unity"
needs_mono = pytest.mark.skipif(
    not (shutil.which("mcs") and shutil.which("mono") and shutil.which("cmake")),
    reason="needs Mono (apt install mono-mcs mono-runtime) and CMake, of the extra dev",
)
FILES = sorted([*GOLDEN.glob("*.reel"), *GOLDEN.glob("colored/*.reel"), *GOLDEN.glob("audio/*.reel")])


@pytest.fixture(scope="module")
def programs(tmp_path_factory) -> Path:
    """Return the folder of the package's assemblies, and of the programs that call them, as Mono compiles them."""
    folder = tmp_path_factory.mktemp("mono")
    library()
    [native] = [*(ROOT / "build/decoder").glob("libmeshreel.so"), *(ROOT / "build/decoder").glob("libmeshreel.dylib")]
    shutil.copy(native, folder)

    def compiled(name: str, sources: Iterator[Path], *references: str) -> None:
        kind = "library" if name.endswith(".dll") else "exe"
        linked = [f"-r:{folder / reference}" for reference in references]
        options = ["-unsafe", "-warnaserror", f"-target:{kind}", f"-out:{folder / name}", *linked]
        run("mcs", *options, *sorted(sources))

    decoder, stand_in, player = "Meshreel.Decoder.dll", "UnityEngine.dll", "Meshreel.Player.dll"
    compiled(decoder, (PACKAGE / "Runtime/Decoder").glob("*.cs"))
    compiled(stand_in, TOOLS.glob("UnityEngine.cs"))
    compiled(player, (PACKAGE / "Runtime/Player").glob("*.cs"), decoder, stand_in)
    compiled("Dump.exe", TOOLS.glob("Dump.cs"), decoder)
    compiled("Play.exe", TOOLS.glob("Play.cs"), decoder, stand_in, player)
    return folder


def called(programs: Path, program: str, *arguments: str | Path) -> list[str]:
    """Return the lines that a program prints under Mono; -1: it fails, and has said why."""
    done = subprocess.run(
        ["mono", programs / f"{program}.exe", *map(str, arguments)],
        capture_output=True,
        text=True,
        check=False,
        env={
            "PATH": os.environ["PATH"],
            "LANG": "C.UTF-8",
            "LD_LIBRARY_PATH": str(programs),
            "DYLD_LIBRARY_PATH": str(programs),
        },
    )
    assert not done.stderr and done.returncode in (0, 1), done.stdout + done.stderr
    return done.stdout.splitlines()


def surfaces(data: bytes) -> Iterator[tuple[np.ndarray, np.ndarray, np.ndarray | None, np.ndarray | None, bool]]:
    """Yield the positions, indices, colours and places of each surface in a dump, and if it is new."""
    at = 0

    def take(kind: type, width: int, count: int) -> np.ndarray:
        nonlocal at
        values = np.frombuffer(data, kind, width * count, at).reshape(count, width)
        at += values.nbytes
        return values

    while at < len(data):
        vertices, indices, has_colors, has_uv, is_new = take(np.int32, 5, 1)[0]
        points, faces = take(np.float32, 3, vertices), take(np.int32, 3, indices // 3)
        colors = take(np.uint8, 4, vertices) if has_colors else None
        yield points, faces, colors, take(np.float32, 2, vertices) if has_uv else None, bool(is_new)


@needs_mono
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
@pytest.mark.parametrize("layers", [None, 0])
def test_surfaces_are_the_meshes_of_python_in_the_axes_of_unity(programs, tmp_path, path, layers):
    called(programs, "Dump", "surfaces", path, tmp_path / "out", -1 if layers is None else layers)
    known = meshreel.open(path).at(layers)
    origin = np.array(known.reader.header.origin)
    found = surfaces((tmp_path / "out").read_bytes())
    for part in range(BACKGROUND, len(known.tracks)):
        before = None
        for frame in range(len(known)):
            name = "background" if part == BACKGROUND else f"track {part}"
            whole = part == WHOLE
            mesh = known[frame] if whole else known.parts(frame).get(name, Mesh.empty())
            uv = None if whole else mesh.uv
            points, faces, colors, places, is_new = next(found)
            corners = mesh.faces[:, [0, 2, 1]]  # clockwise
            wanted = (mesh.vertices - origin).astype(np.float32) * np.float32([-1, 1, 1])
            if uv is None or not len(mesh.vertices):
                assert places is None
                np.testing.assert_array_equal(points, wanted)
                np.testing.assert_array_equal(faces, corners)
            else:
                turned = np.nan_to_num(uv[:, [0, 2, 1]], nan=-1)
                np.testing.assert_array_equal(points[faces], wanted[corners])
                np.testing.assert_array_equal(places[faces], turned)
                rows = np.concatenate([corners.reshape(-1, 1), turned.reshape(-1, 2)], axis=1)
                assert len(points) == len(np.unique(rows, axis=0))
            if len(mesh.vertices):
                assert (colors is None) == (mesh.colors is None)
            if colors is not None:
                np.testing.assert_array_equal(colors[faces, :3], mesh.colors[corners])
                assert (colors[:, 3] == 255).all()
            if not is_new:  # what Unity keeps is right
                assert before is not None
                np.testing.assert_array_equal(faces, before[0])
                assert places is None or np.array_equal(places, before[1])
            before = faces, places
    assert next(found, None) is None


@needs_mono
def test_faces_that_stay_are_not_sent_again_and_such_frames_take_no_memory(programs, tmp_path):
    called(programs, "Dump", "surfaces", GOLDEN / "layers.reel", tmp_path / "out", -1)
    fresh = [is_new for *_, is_new in surfaces((tmp_path / "out").read_bytes())][-14:]
    assert fresh == [True] + [False] * 13
    assert called(programs, "Dump", "memory", GOLDEN / "layers.reel") == ["0"]


@needs_mono
@pytest.mark.parametrize("up", UP_AXES)
def test_up_is_unitys_y_and_solids_keep_their_outside(programs, tmp_path, up):
    path = tmp_path / "up.reel"
    meshreel.encode(MeshList((sphere(levels=2),), up=up), path)
    called(programs, "Dump", "surfaces", path, tmp_path / "out", -1)
    [_, (points, faces, *_), *_] = surfaces((tmp_path / "out").read_bytes())  # background, whole, track 0
    video = meshreel.open(path)
    mesh = video[0]
    about = mesh.vertices - np.array(video.reader.header.origin)
    np.testing.assert_array_equal(points[:, 1], (about @ np.array(UP_AXES[up])).astype(np.float32))
    np.testing.assert_array_equal(points[:, 0], -about[:, 0].astype(np.float32))
    turn = np.linalg.lstsq(about, points.astype(np.float64), rcond=None)[0]
    assert np.linalg.det(turn) == pytest.approx(-1, abs=1e-4)  # another hand
    volume, kept = (np.linalg.det(v[f]).sum() for v, f in ((about, mesh.faces), (points, faces)))
    assert volume > 1 and kept == pytest.approx(volume, rel=1e-4)


@needs_mono
@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_a_file_is_described_as_by_python(programs, path):
    known = meshreel.open(path)
    first, second, metadata, *times = called(programs, "Dump", "facts", path)
    layers = max(len(group.layers) for group in known.reader.groups) - 1
    numbers = [float(number) for number in first.split()]
    assert numbers == pytest.approx([len(known), known.frame_rate, known.duration, len(known.tracks), layers, 0])
    reader = known.reader
    has = [reader.has_background, reader.is_colored, reader.has_textures, reader.has_splats]
    assert second.split()[:4] == [str(each) for each in has]
    assert tuple(map(float, second.split()[4:])) == reader.header.origin
    assert metadata == reader.header.metadata
    stamps = np.array(known.timestamps) - known.timestamps[0]
    for frame, row in enumerate(times):
        time, *frames = row.split()
        assert float(time) == pytest.approx(stamps[frame], abs=1e-9)
        assert [int(number) for number in frames] == [frame, max(frame - 1, 0), frame, frame]
    assert len(times) == len(known)


@needs_mono
def test_a_frame_is_found_by_its_time_as_a_texture_file_rounds_it(programs, tmp_path):
    path = tmp_path / "odd.reel"
    retime(GOLDEN / "layers.reel", path, frame_rate=61)
    found = [row.split()[-1] for row in called(programs, "Dump", "facts", path)[3:]]
    assert found == [str(frame) for frame in range(14)]


@needs_mono
def test_the_audio_file_and_splats_and_pictures_are_those_of_the_c_library(programs, tmp_path):
    out = tmp_path / "out"
    audio = meshreel.open(GOLDEN / "audio/audio.reel").audio
    assert called(programs, "Dump", "audio", GOLDEN / "audio/audio.reel", out) == [f"Ogg {audio.start!r}"]
    assert out.read_bytes() == audio.data
    assert called(programs, "Dump", "audio", GOLDEN / "layers.reel", out) == []
    with CVideo((GOLDEN / "splats/splats.reel").read_bytes()) as video:
        for frame in range(video.info.frames):
            called(programs, "Dump", "splats", GOLDEN / "splats/splats.reel", out, frame)
            wanted = video.splats(frame, 0) or {}
            assert out.read_bytes() == b"".join(array.tobytes() for array in wanted.values())
    path = GOLDEN / "colored/textures.reel"
    with CVideo(path.read_bytes()) as video:
        for codec in (AV1, H264):
            told = called(programs, "Dump", "picture", path, out, 3, 0, codec)
            data, packet = video.picture(3, 0, codec)
            assert told == [f"{packet.number} {packet.width} {packet.height}"] and out.read_bytes() == data


def pictures_of(path: Path, part: int) -> list[tuple[float, np.ndarray]]:
    """Return the pictures in H.264 of a part, decoded packet by packet, and when each is first shown, s."""
    found, last, decoder = [], (None, None), None
    with CVideo(path.read_bytes()) as video:
        for frame in range(video.info.frames):
            data, packet = video.picture(frame, part, H264)
            if (packet.stream, packet.number) == last:
                continue
            if packet.stream != last[0]:
                decoder = av.CodecContext.create("h264", "r")
                decoder.options = {"flags": "low_delay"}
                decoder.thread_type = "NONE"
            last = packet.stream, packet.number
            [picture] = decoder.decode(av.Packet(data))
            found.append((video.time(frame) - video.time(0), picture.to_ndarray()))
    return found


@needs_mono
@pytest.mark.parametrize(("name", "part", "streams"), [("textures", 0, 1), ("scene", BACKGROUND, 2)])
def test_the_texture_file_has_all_pictures_at_the_times_of_their_frames(programs, tmp_path, name, part, streams):
    path, out = GOLDEN / f"colored/{name}.reel", tmp_path / "texture.mp4"
    assert called(programs, "Dump", "texture", path, out, part) == ["True"]
    wanted = pictures_of(path, part)
    with av.open(out) as file:
        stream = file.streams.video[0]
        found = [(float(frame.time), frame.to_ndarray()) for frame in file.decode(stream)]
        assert float(stream.duration * stream.time_base) == pytest.approx(meshreel.open(path).duration, abs=1e-4)
        keys = sum(packet.is_keyframe for packet in _packets(out))
    assert len(found) == len(wanted) and keys >= streams
    for (time, picture), (shown, other) in zip(found, wanted, strict=True):
        assert time == pytest.approx(shown, abs=1e-4)
        np.testing.assert_array_equal(picture, other)


def _packets(path: Path) -> list[av.Packet]:
    with av.open(path) as file:
        return [packet for packet in file.demux(file.streams.video[0]) if packet.size]


@needs_mono
def test_a_part_without_h264_has_no_texture_file(programs, tmp_path):
    assert called(programs, "Dump", "texture", GOLDEN / "layers.reel", tmp_path / "out", 0) == ["False"]
    assert (tmp_path / "out").read_bytes() == b""


@needs_mono
@pytest.mark.parametrize("mark", [b"\0\0\x01\x67", b"\0\0\x01\x68"])  # of the parameter sets
def test_pictures_without_parameter_sets_are_damage(programs, tmp_path, mark):
    data, path = (GOLDEN / "colored/textures.reel").read_bytes(), tmp_path / "damaged.reel"
    preamble, start = unpack(Preamble, data)
    header, start = unpack(Header, data, start)
    index = unpack_all(Index, data[start : preamble.head_size - 4])
    body, at, chunks = data[preamble.head_size :].replace(mark, mark[:3] + b"\x66"), 0, []
    for chunk in index.chunks:
        layers = []
        for layer in chunk.layers:
            layers.append(Layer(layer.size, crc32(body[at : at + layer.size])))
            at += layer.size
        chunks.append(replace(chunk, layers=tuple(layers)))
    path.write_bytes(pack_head(header, Index(tuple(chunks))) + body)
    [told] = called(programs, "Dump", "texture", path, tmp_path / "out", 0)
    assert told == f"damaged: {path}: pictures of H.264 without parameter sets"


@needs_mono
def test_a_cut_texture_is_refused_by_its_frame(programs, tmp_path):
    path = tmp_path / "cut.reel"
    cut(GOLDEN / "colored/textures.reel", path, "1:3")
    [told] = called(programs, "Dump", "texture", path, tmp_path / "out", 0)
    assert told.startswith(f"{path}: the texture of frame 0 needs pictures of frames that are hidden")


@needs_mono
def test_errors_are_exceptions_that_name_the_file(programs):
    path = GOLDEN / "layers.reel"
    early, late, frame, part, layers, bytes_, none, stream, closed = called(programs, "Dump", "errors", path)
    assert early == late and early.startswith("InvalidOperationException: the surface is gone")
    assert frame.startswith(f"MeshreelException: {path}: a frame that") and f"{path}: a part that" in part
    assert f"{path}: fewer layers" in layers and "two bytes: not a .reel file" in bytes_
    assert none.startswith("FileNotFoundException") and closed.startswith("ObjectDisposedException")
    assert re.search(r"MeshreelException: a stream: .*could not be read: the disk is gone", stream)


@needs_mono
def test_damage_is_told_from_other_failures(programs, tmp_path):
    data = bytearray((GOLDEN / "layers.reel").read_bytes())
    data[-20] ^= 1
    path = tmp_path / "damaged ü.reel"
    path.write_bytes(data)
    [told] = called(programs, "Dump", "surfaces", path, tmp_path / "out", -1)
    assert told.startswith(f"damaged: {path}: ") and "checksum" in told


def played(programs: Path, path: Path, folder: Path, *steps: float, loop: str = "loop") -> tuple[list[str], list]:
    """Return the lines of a play, and the positions and indices after each step."""
    (folder / "cache").mkdir()
    lines = called(programs, "Play", path, folder / "cache", loop, folder / "out", *map(str, steps))
    data, found, at = (folder / "out").read_bytes(), [], 0
    while at < len(data):
        vertices, indices = np.frombuffer(data, np.int32, 2, at)
        points = np.frombuffer(data, np.float32, 3 * vertices, at + 8).reshape(-1, 3)
        found.append((points, np.frombuffer(data, np.int32, indices, at + 8 + points.nbytes).reshape(-1, 3)))
        at += 8 + points.nbytes + 4 * indices
    return lines, found


@needs_mono
@pytest.mark.parametrize("ending", ["", ".bytes"])
def test_the_component_shows_the_frame_of_its_time_and_leaves_no_files(programs, tmp_path, ending):
    path = tmp_path / f"scene.reel{ending}"
    shutil.copy(GOLDEN / "scene.reel", path)
    lines, found = played(programs, path, tmp_path, 0.01, 0.1, 0.5)
    known = meshreel.open(GOLDEN / "scene.reel")
    frames = [0, 2, 1]  # 25 a second, 0.56 s: the last step goes around
    assert lines == [*(f"frame {frame}" for frame in frames), "material 0 0", "left 0"]
    for frame, (points, faces) in zip(frames, found, strict=True):
        mesh = known[frame]
        wanted = (mesh.vertices - np.array(known.reader.header.origin)).astype(np.float32) * np.float32([-1, 1, 1])
        np.testing.assert_array_equal(points, wanted)
        np.testing.assert_array_equal(faces, mesh.faces[:, [0, 2, 1]])


@needs_mono
def test_the_component_follows_its_texture_and_says_which_audio_it_cannot_play(programs, tmp_path):
    lines, _ = played(programs, GOLDEN / "colored/textures.reel", tmp_path, 0.05, 0.05)
    assert lines == ["texture True", "frame 1", "frame 2", "material 1 1", "left 0"]
    (tmp_path / "other").mkdir()
    lines, _ = played(programs, GOLDEN / "audio/audio.reel", tmp_path / "other", 0.5, loop="once")
    assert lines[:3] == ["frame 2", "material 0 0", "left 0"]
    assert lines[3].startswith("warning: ") and "Ogg" in lines[3] and "MP3" in lines[3]


@needs_mono
def test_the_component_plays_mp3_from_where_it_begins(programs, tmp_path):
    file = io.BytesIO()
    with av.open(file, "w", format="mp3") as out:
        stream = out.add_stream("mp3", rate=44100, layout="mono")
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 44100), np.int16), "s16p", "mono")
        sound.sample_rate = 44100
        out.mux([*stream.encode(sound), *stream.encode(None)])
    path = tmp_path / "heard.reel"
    tag(GOLDEN / "layers.reel", path, audio=file.getvalue())
    lines, _ = played(programs, path, tmp_path, 0.3)
    assert lines[1] == "audio True 0.3"


@needs_mono
def test_a_file_that_cannot_be_read_is_told_and_shows_nothing(programs, tmp_path):
    path = tmp_path / "broken.reel.bytes"
    path.write_bytes(b"nothing")
    lines, found = played(programs, path, tmp_path, 0.1)
    assert "frame -1" in lines and found == [] and "left 0" in lines
    assert any(line.startswith("error: asset: ") for line in lines)


def test_the_wrapper_has_the_calls_of_the_header():
    header = (ROOT / "core/include/meshreel/decoder.h").read_text()
    wrapper = (PACKAGE / "Runtime/Decoder/Native.cs").read_text()

    def calls(text: str, before: str) -> dict[str, int]:
        found = re.findall(before + r"[^;]*?(meshreel_\w+)\(([^)]*)\);", text)
        return {name: 0 if arguments in ("", "void") else arguments.count(",") + 1 for name, arguments in found}

    assert calls(header, "MESHREEL_API ") == calls(wrapper, "static extern ")
    assert len(calls(header, "MESHREEL_API ")) == 14
    version = re.search(r"MESHREEL_ABI_VERSION (\d+)", header)[1]
    assert f"AbiVersion = {version};" in wrapper


@needs_mono
def test_the_example_of_the_docs_compiles(programs, tmp_path):
    docs = (ROOT / "docs/engines.md").read_text(encoding="utf-8")
    [example] = re.findall(r"```csharp\n(.*?)```", docs, re.DOTALL)
    (tmp_path / "Example.cs").write_text(f"class Example {{ void Run() {{ {example} }} }}")
    decoder = programs / "Meshreel.Decoder.dll"
    run(
        "mcs",
        "-unsafe",
        "-target:library",
        f"-r:{decoder}",
        f"-out:{tmp_path / 'Example.dll'}",
        tmp_path / "Example.cs",
    )


@pytest.fixture
def unity(monkeypatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "scripts")
    return importlib.import_module("unity")


def test_the_package_is_a_tarball_whose_files_have_numbers_of_their_own(unity):
    names = [*unity.LIBRARIES]
    built = {name: name.encode() for name in names}
    data = unity.package(built)
    assert data == unity.package(built)
    with tarfile.open(fileobj=io.BytesIO(data)) as tar:
        files = {member.name: tar.extractfile(member).read() for member in tar.getmembers()}
    assert all(name.startswith("package/") for name in files)
    plain = {name for name in files if not name.endswith(".meta")}
    folders = {parent.as_posix() for name in plain for parent in Path(name).parents}
    hidden = {".", "package", "package/Samples~"}
    assert {name for name in files if name.endswith(".meta")} == {f"{name}.meta" for name in plain | folders - hidden}
    guids = {name: re.search(rb"^guid: ([0-9a-f]{32})$", files[name], re.M)[1] for name in files if name not in plain}
    assert len(set(guids.values())) == len(guids)
    scene = files["package/Samples~/Play/Play.unity"]
    used = re.findall(rb"guid: ([0-9a-f]{32})", scene)
    shown = ("Runtime/Player/MeshreelPlayer.cs", "Samples~/Play/recording.bytes")
    assert used == [guids[f"package/{name}.meta"] for name in shown]
    manifest = json.loads(files["package/package.json"])
    assert manifest["version"] == meshreel.__version__ and len(manifest["samples"]) == 1
    assert files["package/Samples~/Play/recording.bytes"] == unity.RECORDING.read_bytes()
    for name in names:
        assert files[f"package/{name}"] == name.encode()
    [windows] = [files[f"package/{name}.meta"].decode() for name in names if name.endswith(".dll")]
    assert "Standalone: Win64\n    second:\n      enabled: 1" in windows and "OS: Windows" in windows
    assert "Any: \n    second:\n      enabled: 0" in windows


def test_a_package_without_android_has_no_place_for_it(unity):
    built = {name: b"" for name in unity.LIBRARIES if "Android" not in name}
    with tarfile.open(fileobj=io.BytesIO(unity.package(built))) as tar:
        assert not [name for name in tar.getnames() if "Android" in name]


@pytest.mark.skipif(os.name == "nt", reason="the stand-in for a compiler is a script of sh")
def test_the_library_of_android_is_made_by_the_ndk(unity, monkeypatch, tmp_path):
    compiler = tmp_path / "ndk/toolchains/llvm/prebuilt/linux-x86_64/bin/aarch64-linux-android24-clang++"
    android = [*unity.LIBRARIES][-1]
    monkeypatch.setattr(unity, "LIBRARIES", {android: unity.LIBRARIES[android]})
    monkeypatch.setenv("ANDROID_NDK_HOME", str(tmp_path / "ndk"))
    with pytest.raises(SystemExit, match=r"ANDROID_NDK_HOME .*: no toolchains"):
        unity.libraries(tmp_path)
    compiler.parent.mkdir(parents=True)
    compiler.write_text('#!/bin/sh\necho "$@" >"$(echo "$@" | sed "s/.* -o //")"\n')
    compiler.chmod(0o755)
    [(name, library)] = unity.libraries(tmp_path).items()
    assert name == android and b"-static-libstdc++" in library and b"file/api.cpp" in library
    monkeypatch.delenv("ANDROID_NDK_HOME")
    assert unity.libraries(tmp_path) == {}


def test_libraries_of_two_processors_become_one_file(unity):
    heads = [struct.pack("<III", 0xFEEDFACF, 0x01000007, 3), struct.pack("<III", 0xFEEDFACF, 0x0100000C, 0)]
    whole = [heads[0] + b"first", heads[1] + b"second"]
    fat = unity.universal(whole)
    magic, count = struct.unpack(">II", fat[:8])
    assert (magic, count) == (0xCAFEBABE, 2)
    for k, part in enumerate(whole):
        kind, variant, offset, size, align = struct.unpack(">IIIII", fat[8 + 20 * k : 28 + 20 * k])
        assert struct.pack("<II", kind, variant) == part[4:12] and offset % (1 << align) == 0
        assert fat[offset : offset + size] == part
