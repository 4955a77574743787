"""The notebooks and scripts of docs/examples run as they stand; notebooks are kept without outputs."""

import importlib
import io
import json
import runpy
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import meshreel
from tests.golden import GOLDEN

FOLDER = Path(__file__).resolve().parents[1] / "docs" / "examples"
EXAMPLES = sorted(FOLDER.glob("*.ipynb"))
SCENE, TEXTURES = GOLDEN / "scene.reel", GOLDEN / "colored" / "textures.reel"


def test_there_are_examples_and_each_is_linked():
    page = (FOLDER / "index.md").read_text(encoding="utf-8")
    files = [*EXAMPLES, *FOLDER.glob("*.py")]
    assert [path.name for path in files if f"({path.name})" not in page] == [] and len(EXAMPLES) >= 3


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_runs(path, tmp_path):
    nbformat, nbclient = pytest.importorskip("nbformat"), pytest.importorskip("nbclient")
    assert all(not cell["outputs"] for cell in json.loads(path.read_text())["cells"] if cell["cell_type"] == "code")
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources=resources).execute()
    outputs = [cell["outputs"] for cell in notebook["cells"] if cell["cell_type"] == "code"]
    assert any(outputs) and not any(one["output_type"] == "error" for some in outputs for one in some)
    assert list(tmp_path.glob("*.reel"))


def needs(package: str) -> None:
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed: MESHREEL_VIEWERS=1 ./scripts/setup")


def run(name: str, *arguments: object, folder: Path) -> str:
    """Return what a script prints, run as from the command line."""
    command = [sys.executable, FOLDER / name, *map(str, arguments)]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_rerun_has_every_part_when_it_changes(tmp_path):
    needs("rerun")
    from rerun.chunk import RrdReader

    run("rerun_log.py", SCENE, folder=tmp_path)
    meshes = {}
    for chunk in RrdReader(tmp_path / "scene.rrd").stream():
        batch = chunk.to_record_batch()
        if "Mesh3D:vertex_positions" in batch.schema.names:
            rows = meshes.setdefault(chunk.entity_path.strip("/").replace("\\", ""), {})
            times = [value.total_seconds() for value in batch.column("video").to_pylist()]
            positions, faces = (
                batch.column(f"Mesh3D:{name}").to_pylist() for name in ("vertex_positions", "triangle_indices")
            )
            rows |= dict(zip(np.round(times, 6).tolist(), zip(positions, faces, strict=True), strict=True))
    video = meshreel.open(SCENE)
    assert set(meshes) == {"background", "track 0", "track 1"}
    assert [len(meshes[name]) for name in ("background", "track 0", "track 1")] == [2, 14, 7]  # as seldom as it changes
    for frame in (0, 5, 13):
        for name, mesh in video.parts(frame).items():
            last = max(at for at in meshes[name] if at <= video.timestamps[frame] + 1e-6)
            positions, faces = meshes[name][last]
            shown = np.array(positions, np.float32).reshape(-1, 3)
            np.testing.assert_array_equal(shown, mesh.vertices.astype(np.float32))
            np.testing.assert_array_equal(np.array(faces).reshape(-1, 3), mesh.faces)


@pytest.mark.parametrize("path", [SCENE, TEXTURES], ids=lambda path: path.stem)
def test_viser_shows_the_frame_that_its_slider_chooses(path):
    needs("viser")
    import trimesh

    script, video = runpy.run_path(str(FOLDER / "viser_play.py")), meshreel.open(path)
    server, slider = script["serve"](video)
    try:
        for frame in (0, 5):
            slider.value = frame
            for name, mesh in video.parts(frame).items():
                handle = server.scene.get_handle_by_name(name)
                until = time.monotonic() + 20
                while not (same := _shows(handle, mesh, trimesh)) and time.monotonic() < until:
                    time.sleep(0.01)
                    handle = server.scene.get_handle_by_name(name)
                assert same, f"frame {frame}: {name}"
    finally:
        server.stop()


def _shows(handle, mesh, trimesh) -> bool:
    if mesh.is_empty:
        return not handle.visible
    shown = trimesh.load_mesh(io.BytesIO(handle.glb_data), file_type="glb", process=False)
    wanted = mesh.to_trimesh()
    is_like = shown.vertices.shape == wanted.vertices.shape and shown.visual.kind == wanted.visual.kind
    return handle.visible and is_like and np.allclose(shown.vertices, wanted.vertices, atol=1e-6)


def test_torch_gets_windows_in_tensors_that_were_decoded_into(tmp_path, monkeypatch):
    torch = pytest.importorskip("torch")
    windows = runpy.run_path(str(FOLDER / "torch_windows.py"))["Windows"](str(SCENE), length=5, track=1)
    video, given = meshreel.open(SCENE), []
    vertices = type(video.tracks[0]).vertices
    monkeypatch.setattr(type(video.tracks[0]), "vertices", lambda *all: given.append(all[3]) or vertices(*all))
    assert len(windows) == 1  # the body is there in frames 4 to 8
    positions, faces = windows[0]
    assert positions.dtype == torch.float32 and faces.dtype == torch.int32
    assert given[0].ctypes.data == positions.data_ptr()
    run_of_body = video.tracks[1].topology[1]
    np.testing.assert_array_equal(positions.numpy(), np.float32(vertices(video.tracks[1], 4, 9)))
    np.testing.assert_array_equal(faces.numpy(), run_of_body.faces)
    assert run("torch_windows.py", SCENE, folder=tmp_path) == "(4, 242, 3) (400, 3)\n" * 3  # by a worker


def test_trimesh_loads_frames_with_their_parts_colours_and_textures():
    trimesh = pytest.importorskip("trimesh")
    loaders = trimesh.exchange.load.mesh_loaders
    with pytest.raises(NotImplementedError, match="'reel' not supported"):
        trimesh.load(SCENE)
    try:
        runpy.run_path(str(FOLDER / "trimesh_load.py"))
        assert "reel" in trimesh.available_formats()
        scene, parts = trimesh.load(SCENE, frame=5), meshreel.open(SCENE).parts(5)
        assert set(scene.geometry) == set(parts)
        for name, mesh in parts.items():
            np.testing.assert_array_equal(scene.geometry[name].vertices, mesh.vertices)
            np.testing.assert_array_equal(scene.geometry[name].faces, mesh.faces)
        assert set(trimesh.load_scene(SCENE).geometry) == {"background", "track 0"}  # of frame 0
        textured = trimesh.load_mesh(TEXTURES, frame=2)
        pixels = meshreel.open(TEXTURES)[2].texture.pixels
        np.testing.assert_array_equal(np.asarray(textured.visual.material.baseColorTexture), pixels)
    finally:
        loaders.pop("reel", None)
