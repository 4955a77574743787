"""Folders of Unity's player of geometry sequences: `sequence.json`, PLY in left-handed axes, textures of the frames."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshreel.capture.clouds import open_clouds, read_cloud
from meshreel.errors import InputError
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.types import Mesh
from tests.spheres import sliding_sphere

PIL = pytest.importorskip("PIL.Image")
COLORS = ((200, 40, 40), (40, 200, 40), (40, 40, 200))
PLAIN, SHORT = "property ", ""  # in headers; some exports leave the word out


def put(folder: Path, kind: Any = 1, word: str = PLAIN, uv: bool = False, **record: Any) -> list[Mesh]:
    """Write three frames as the player has them; return their meshes: x mirrored, faces the other way, and s, t."""
    folder.mkdir(parents=True, exist_ok=True)
    frames = sliding_sphere(3, levels=1)
    for number, mesh in enumerate(frames):
        columns = [mesh.vertices * (-1, 1, 1), *([mesh.vertices[:, :2] / 4 + 0.5] if uv else [])]
        header = "".join(f"{word}float {name}\n" for name in ("x", "y", "z", *(("s", "t") if uv else ())))
        head = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(mesh.vertices)}\n{header}"
        faces = np.zeros(len(mesh.faces) if kind else 0, [("n", "u1"), ("v", "<u4", 3)])
        faces["n"], faces["v"] = 3, mesh.faces[:, ::-1] if kind else 0
        head += f"element face {len(faces)}\n{word}list uchar uint vertex_indices\n" if kind else ""
        body = np.concatenate(columns, axis=1).astype("<f4").tobytes() + faces.tobytes()
        (folder / f"frame_{number}.ply").write_bytes(head.encode() + b"end_header\n" + body)
    (folder / "sequence.json").write_text(json.dumps({"geometryType": kind} | record), encoding="utf-8")
    return frames


def paint(folder: Path, count: int, extension: str) -> None:
    """Write pictures of one colour each, beside the frames; of DDS as the player's converter packs them."""
    for number, color in enumerate(COLORS[:count]):
        packed = {"pixel_format": "DXT1"} if extension == "dds" else {}
        PIL.new("RGB", (8, 8), color).save(folder / f"texture_{number}.{extension}", **packed)


def volume(mesh: Mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float((np.cross(a, b) * c).sum()) / 6


@pytest.mark.parametrize("word", [PLAIN, SHORT])
def test_frames_are_not_mirrored_and_face_outside(tmp_path: Path, word: str) -> None:
    frames = put(tmp_path, word=word)
    read = open_sequence(tmp_path)
    assert len(read) == 3 and read.frame_rate == 30 and read.warnings == ()
    for frame, mesh in zip(frames, read, strict=True):
        assert np.allclose(mesh.vertices, frame.vertices, atol=1e-6)
        assert volume(mesh) == pytest.approx(volume(frame), rel=1e-5) and volume(mesh) > 0


def test_a_pattern_and_a_list_have_the_axes_of_their_folder(tmp_path: Path) -> None:
    frames = put(tmp_path)
    for read in (open_sequence(f"{tmp_path}/frame_*.ply"), open_sequence([tmp_path / "frame_0.ply"])):
        assert np.allclose(read[0].vertices, frames[0].vertices, atol=1e-6)


def test_the_rate_is_that_of_the_record_unless_one_is_given(tmp_path: Path) -> None:
    put(tmp_path, fps=12.5)
    assert open_sequence(tmp_path).frame_rate == 12.5
    assert open_sequence(tmp_path, SequenceOptions(frame_rate=24)).frame_rate == 24


@pytest.mark.parametrize(("count", "extension"), [(3, "png"), (3, "dds"), (1, "dds")])
def test_each_frame_has_its_texture_or_that_of_all(tmp_path: Path, count: int, extension: str) -> None:
    frames = put(tmp_path, 2, uv=True)
    paint(tmp_path, count, extension)
    read = open_sequence(tmp_path, SequenceOptions(frames="1:"))
    for number, mesh in enumerate(read.only([0, 1]), 1):
        assert mesh.texture is not None and mesh.uv is not None
        assert np.abs(mesh.texture.pixels[0, 0] - np.array(COLORS[number % count])).max() <= 8  # DXT1 has 5 bits
        assert np.allclose(mesh.uv, (frames[number].vertices[:, :2] / 4 + 0.5)[mesh.faces], atol=1e-6)
    assert read.warnings == ()


def test_textures_that_cannot_be_read_are_named_with_a_remedy(tmp_path: Path) -> None:
    put(tmp_path, 2, uv=True)
    (tmp_path / "texture_0.astc").write_bytes(b"\x13\xab\xa1\x5c")
    read = open_sequence(tmp_path)
    assert "texture_0.astc: ASTC is not read" in read.warnings[0] and "astcenc -ds" in read.warnings[0]
    assert read[0].texture is None
    paint(tmp_path, 2, "dds")
    assert "has 2 textures for 3 frames" in open_sequence(tmp_path).warnings[0]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('{"geometryType": 3}', "geometryType 3; give 0 for points"),
        ('{"geometryType": 1, "fps": -3}', "fps -3; give frames a second"),
        ('{"geometryType": 1, "fps": 1e999}', "sequence.json: "),
        ('{"geometryType": 1, "fps": "30"}', "fps '30'"),
        ('{"geometryType": 1, "fps": true}', "fps True"),
        ('{"geometryType"', "copy it again"),
        ("[1]", "is not a JSON object"),
        ("[" * 100_000, "copy it again"),
    ],
)
def test_wrong_records_are_refused_by_name(tmp_path: Path, text: str, words: str) -> None:
    put(tmp_path)
    (tmp_path / "sequence.json").write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as refused:
        open_sequence(tmp_path)
    assert "sequence.json" in str(refused.value) and words in str(refused.value)


def test_damaged_frames_and_textures_are_input_errors(tmp_path: Path) -> None:
    put(tmp_path, 2, uv=True)
    paint(tmp_path, 3, "dds")
    whole, picture = tmp_path / "frame_1.ply", tmp_path / "texture_0.dds"
    whole.write_bytes(whole.read_bytes()[:-1])
    with pytest.raises(InputError, match=r"frame 1 .*too short"):
        open_sequence(tmp_path)[1]
    data = picture.read_bytes()
    for size in range(0, len(data), 7):
        picture.write_bytes(data[:size])
        with pytest.raises(InputError, match=r"texture_0\.dds"):
            assert open_sequence(tmp_path)[0].texture.pixels is None


def test_a_record_of_another_kind_leaves_frames_as_they_are(tmp_path: Path) -> None:
    put(tmp_path, fps=12)
    (tmp_path / "sequence.json").write_text('{"geometryType": "esriGeometryPoint", "fps": 12}', encoding="utf-8")
    read = open_sequence(tmp_path)
    assert read.frame_rate == 30 and np.allclose(read[0].vertices[:, 0], -sliding_sphere(1, levels=1)[0].vertices[:, 0])


def test_points_are_captured_at_their_rate_and_not_mirrored(tmp_path: Path) -> None:
    frames = put(tmp_path, 0, fps=15)
    with pytest.raises(InputError, match="meshreel capture"):
        open_sequence(tmp_path)[0]
    assert np.allclose(read_cloud(tmp_path / "frame_2.ply").points, frames[2].vertices, atol=1e-6)
    clouds, _ = open_clouds([tmp_path])
    assert clouds.frame_rate == 15
