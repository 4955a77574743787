"""Written meshes: read back as they were, or not there at all."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from meshreel.errors import InputError
from meshreel.io import write
from meshreel.io.sequence import open_sequence
from meshreel.io.write import replacing, write_colored, write_mesh
from meshreel.types import Mesh

EXTENSIONS = ("ply", "obj", "glb")


def body(origin: float = 0.0) -> Mesh:
    random = np.random.default_rng(1)
    return Mesh.of(random.normal(size=(50, 3)) + origin, random.integers(0, 50, (80, 3)))


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("origin", [0.0, 1e6])
def test_a_written_mesh_is_read_back(tmp_path: Path, extension: str, origin: float) -> None:
    mesh, path = body(origin), tmp_path / f"m.{extension}"
    write_mesh(mesh, path)
    sequence = open_sequence(path)
    again = sequence[0]
    assert np.array_equal(again.faces, mesh.faces)
    assert np.abs(again.vertices - mesh.vertices).max() <= 1.01e-6 * mesh.diagonal  # 1e-5 m, 1000 km away
    assert sequence.warnings == ()


@pytest.mark.parametrize("extension", EXTENSIONS)
@pytest.mark.parametrize("mesh", [Mesh.empty(), Mesh.of([[1.0, 2.0, 3.0]], [])], ids=["nothing", "a loose vertex"])
def test_an_empty_mesh_is_read_back_empty(tmp_path: Path, extension: str, mesh: Mesh) -> None:
    path = tmp_path / f"m.{extension}"
    write_mesh(mesh, path)
    if path.stat().st_size:
        assert open_sequence(path)[0].is_empty


@pytest.mark.parametrize("extension", EXTENSIONS)
def test_others_read_what_we_write(tmp_path: Path, extension: str) -> None:
    path = tmp_path / f"m.{extension}"
    write_mesh(body(), path)
    other = trimesh.load_mesh(path, process=False)
    assert np.array_equal(other.faces, body().faces)
    assert np.abs(other.vertices - body().vertices).max() < 1e-6


def test_float32_is_used_where_it_suffices(tmp_path: Path) -> None:
    for origin, kind in ((0.0, b"property float x"), (1e6, b"property double x")):
        write_mesh(body(origin), tmp_path / "m.ply")
        assert kind in (tmp_path / "m.ply").read_bytes()


def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "m.ply"
    write_mesh(body(), path)
    before = path.read_bytes()
    words = r"m.ply: cannot be written \(No space left on device\); free space"
    with pytest.raises(InputError, match=words), replacing(path) as file:
        file.write(b"half")
        raise OSError(28, "No space left on device")
    with pytest.raises(KeyboardInterrupt), replacing(path) as file:
        file.write(b"half")
        raise KeyboardInterrupt
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["m.ply"]


def test_a_folder_that_is_not_there_and_a_foreign_extension_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"m.ply: cannot be written \(No such file or directory\)"):
        write_mesh(body(), tmp_path / "gone" / "m.ply")
    with pytest.raises(InputError, match=rf"m.fbx: .fbx extension is not one of {', '.join(write._FORMATS)}; choose"):
        write_mesh(body(), tmp_path / "m.fbx")


def test_each_face_has_its_color_and_shares_no_corner_with_one_of_another(tmp_path: Path) -> None:
    square = Mesh.of([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3], [0, 1, 3]])
    colors = np.array([[255, 0, 7], [0, 9, 255], [255, 0, 7]], np.uint8)
    write_colored(square, colors, tmp_path / "a.ply")
    shown = trimesh.load(tmp_path / "a.ply", process=False)
    assert len(shown.vertices) == 4 + 3  # 0, 1, 2, 3 of one color; 0, 2, 3 of the other
    assert np.array_equal(shown.triangles, square.vertices[square.faces])
    assert np.array_equal(shown.visual.vertex_colors[shown.faces][..., :3], np.repeat(colors[:, None], 3, axis=1))
    write_colored(Mesh.empty(), colors[:0], tmp_path / "none.ply")
    assert open_sequence(tmp_path / "none.ply")[0].is_empty
