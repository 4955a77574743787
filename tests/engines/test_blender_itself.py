"""The add-on in Blender itself, PyPI's `bpy`, which runs in a process of its own: its NumPy may be another."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.edit import tag
from meshreel.types import Mesh, MeshList
from tests.golden import GOLDEN
from tests.metrics.shapes import sphere

PYTHON = os.environ.get("MESHREEL_BLENDER") or sys.executable  # an interpreter that has bpy and meshreel
HAS_BPY = "MESHREEL_BLENDER" in os.environ or importlib.util.find_spec("bpy") is not None
pytestmark = pytest.mark.skipif(
    not HAS_BPY, reason="needs bpy: pip install bpy, or MESHREEL_BLENDER=PYTHON that has it"
)
SCRIPT = Path(__file__).parent / "in_blender.py"


def in_blender(name: str, *arguments: str | Path) -> dict:
    """Return what a function of in_blender.py finds."""
    command = [PYTHON, "-B", str(SCRIPT), name, *map(str, arguments)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def turned(vertices: np.ndarray) -> np.ndarray:
    return vertices[:, [0, 2, 1]] * [1, -1, 1]


@pytest.fixture(scope="module")
def heard(tmp_path_factory) -> Path:
    """Return a file with textures and audio, the latter from -0.04 s on."""
    path = tmp_path_factory.mktemp("heard") / "heard.reel"
    audio = meshreel.open(GOLDEN / "audio/audio.reel").audio
    tag(GOLDEN / "colored/textures.reel", path, audio=audio.data, audio_start=0.5)
    return path


def test_an_imported_file_has_its_meshes_uvs_pictures_and_audio_at_their_frames(heard):
    found = in_blender("imported", heard)
    video = meshreel.open(heard)
    assert [each["name"] for each in found["objects"]] == ["heard track 0"]
    assert found["end"] == 10 + round(24 * video.duration) - 1
    for shown in found["frames"]:
        number = shown["number"]
        seconds = (shown["frame"] - 10) / 24 + 1e-5
        assert number == max(sum(t - video.timestamps[0] <= seconds for t in video.timestamps) - 1, 0)
        mesh = video.parts(number)["track 0"]
        np.testing.assert_allclose(np.reshape(shown["places"], (-1, 3)), turned(mesh.vertices), atol=1e-5)
        np.testing.assert_array_equal(np.reshape(shown["faces"], (-1, 3)), mesh.faces)
        np.testing.assert_allclose(np.reshape(shown["uv"], (-1, 3, 2)), np.nan_to_num(mesh.uv, nan=-1), atol=1e-6)
        colors = np.reshape(shown["colors"], (-1, 4))[:, :3]
        np.testing.assert_array_equal(np.round(255 * colors), mesh.colors)
        assert shown["picture"] == number
    pictures = sorted((heard.parent / "heard_textures").iterdir())
    assert [path.name for path in pictures] == [f"track_0_{number:05}.png" for number in range(len(video))]
    from PIL import Image

    for number, path in enumerate(pictures):
        np.testing.assert_array_equal(np.asarray(Image.open(path)), video.parts(number)["track 0"].texture.pixels)
    audio = heard.with_name("heard_audio.ogg")
    assert audio.read_bytes() == video.audio.data
    assert found["strips"] == ([["SOUND", str(audio), 1, 10 + 12]] if found["hears"] else [])


def test_rendered_faces_show_the_picture_of_their_frame(heard):
    found = in_blender("rendered", heard)
    video = meshreel.open(heard)
    textures = [video.parts(number)["track 0"].texture.pixels / 255 for number in range(len(video))]
    known = [np.where(t <= 0.04045, t / 12.92, ((t + 0.055) / 1.055) ** 2.4) for t in textures]
    assert found["numbers"] == [0, 2, 4]
    for number, shown in zip(found["numbers"], found["pictures"], strict=True):
        errors = [np.abs(np.array(shown) - each).mean() for each in known]
        assert np.argmin(errors) == number and errors[number] < 0.3 * min(np.delete(errors, number)), errors


def test_a_scene_is_exported_as_it_moves_and_comes_back(tmp_path):
    path = tmp_path / "out.reel"
    found = in_blender("exported", path)
    video = meshreel.open(path)
    assert (len(video), video.frame_rate, video.up) == (5, 12.0, "z")
    for number, mesh in enumerate(video):
        low, high = np.array(found["boxes"][number]).reshape(2, 3)
        np.testing.assert_allclose(mesh.vertices.min(axis=0), low, atol=0.01)
        np.testing.assert_allclose(mesh.vertices.max(axis=0), high, atol=0.01)
        assert np.linalg.det(mesh.vertices[mesh.faces] - mesh.vertices.mean(axis=0)).sum() > 0
    assert np.abs(np.array(found["boxes"][0]) - found["boxes"][4]).max() > 0.5
    assert found["frame"] == 3  # the scene stays where it was
    assert found["refused"] == "no mesh is selected: select the objects that the file is to have"
    colors = np.median(video[0].colors, axis=0)
    np.testing.assert_allclose(colors, [255, 128, 0], atol=3)


def test_a_file_that_cannot_be_read_is_reported(tmp_path):
    path = tmp_path / "none.reel"
    assert "none.reel" in in_blender("refused", path)["error"]


def test_what_is_written_by_hand_is_read_in_blender_whichever_axis_is_up(tmp_path):
    for up, above in {"y": [0, 1, 0], "z": [0, 0, 1], "-y": [0, -1, 0], "-z": [0, 0, -1]}.items():
        ball = sphere(levels=2)
        path = tmp_path / f"up{up}.reel"
        mesh = Mesh.of(ball.vertices + np.array(above) * 5, ball.faces)
        meshreel.encode(MeshList((mesh,), up=up), path)
        places = np.reshape(in_blender("imported", path)["frames"][0]["places"], (-1, 3))
        np.testing.assert_allclose(places.mean(axis=0), [0, 0, 5], atol=0.05)
