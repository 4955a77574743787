"""Materials of OBJ files: colours, pictures and their options, and where their files are looked for."""

from pathlib import Path

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.io.meshes import Loaded, read_mesh
from tests.io.specifications import PIXELS, png

POINTS = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 1 1\n"
FACES = "usemtl a\nf 1/1 2/2 3/3\nusemtl b\nf 3/3 2/2 4/4\n"
ONE = POINTS + FACES.replace("usemtl b\n", "")


def put(folder: Path, obj: str = ONE, mtl: str = "newmtl a\nmap_Kd t.png\n", library: str = "m.mtl") -> Loaded:
    (folder / "m.obj").write_text(f"mtllib {library}\n{obj}")
    (folder / "m.mtl").write_text(mtl)
    (folder / "t.png").write_bytes(png())
    return read_mesh(folder / "m.obj")


def shown(loaded: Loaded) -> bool:
    """True if the faces have the picture."""
    mesh = loaded.mesh
    return mesh.texture is not None and np.array_equal(mesh.texture.pixels, PIXELS) and bool(np.isfinite(mesh.uv).all())


@pytest.mark.parametrize(
    "name",
    [
        "t.png",
        "T.PNG",
        '"t.png"',
        "./t.png",
        "sub/../t.png",
        "t.png # skin",
        "C:\\Users\\x\\t.png",
        "/home/x/t.png",
        "../x/t.png",
    ],
)
def test_a_picture_is_found_beside_the_mesh_however_it_is_spelled(tmp_path: Path, name: str) -> None:
    loaded = put(tmp_path, mtl=f"newmtl a\nmap_Kd {name}\n")
    assert shown(loaded) and loaded.dropped == frozenset()


@pytest.mark.parametrize("name", ["skin # 1.png", "my skin.png", "a#b.png"])
def test_names_may_have_blanks_and_signs_of_comments(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_bytes(png(255 - PIXELS))
    assert np.array_equal(put(tmp_path, mtl=f"newmtl a\nmap_Kd {name}\n").mesh.texture.pixels, 255 - PIXELS)


@pytest.mark.parametrize("name", ["../out.png", "/tmp/out.png", "..\\out.png", "C:\\out.png"])
def test_a_picture_outside_the_folder_is_never_read_and_refused_by_name(tmp_path: Path, name: str) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "out.png").write_bytes(png())
    texture = put(tmp_path / "in", mtl=f"newmtl a\nmap_Kd {name}\n").mesh.texture
    with pytest.raises(
        InputError, match=r"m.obj: its picture .*out.png is outside the folder of the mesh.*copy it beside"
    ):
        _ = texture.pixels


def test_a_picture_is_looked_for_beside_its_library_first(tmp_path: Path) -> None:
    (tmp_path / "mat").mkdir()
    (tmp_path / "mat" / "s.mtl").write_text("newmtl a\nmap_Kd t.png\n")
    (tmp_path / "mat" / "t.png").write_bytes(png(255 - PIXELS))
    assert np.array_equal(put(tmp_path, library="mat/s.mtl").mesh.texture.pixels, 255 - PIXELS)
    (tmp_path / "mat" / "t.png").unlink()
    assert shown(put(tmp_path, library="mat/s.mtl"))


@pytest.mark.parametrize("folder", ["mat", ".mat"])
def test_a_mesh_of_the_working_directory_has_pictures_beside_its_library(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: str
) -> None:
    (tmp_path / folder).mkdir()
    (tmp_path / folder / "s.mtl").write_text("newmtl a\nmap_Kd skin.png\n")
    (tmp_path / folder / "skin.png").write_bytes(png())
    monkeypatch.chdir(tmp_path)
    assert shown(put(Path(), library=f"{folder}/s.mtl"))


@pytest.mark.parametrize("library", ["m.mtl b.mtl", "M.MTL", '"m.mtl"', "c:\\x\\m.mtl", "m.mtl # by hand"])
def test_libraries_are_found_one_or_several(tmp_path: Path, library: str) -> None:
    (tmp_path / "b.mtl").write_text("newmtl b\n")
    assert shown(put(tmp_path, library=library))


def test_colors_of_materials_are_those_of_vertices_and_their_mean_where_faces_meet(tmp_path: Path) -> None:
    loaded = put(
        tmp_path,
        POINTS.split("vt")[0] + "usemtl a\nf 1 2 3\nusemtl b\nf 3 2 4\n",
        "newmtl a\nKd 1 0 0\nnewmtl b\nKd 0 0 1\n",
    )
    assert loaded.mesh.colors.tolist() == [[255, 0, 0], [128, 0, 128], [128, 0, 128], [0, 0, 255]]
    assert loaded.dropped == frozenset()


def test_one_vertex_without_a_colour_does_not_cost_the_others_theirs(tmp_path: Path) -> None:
    text = "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0 0 0 1\nf 1 2 3\n"
    (tmp_path / "m.obj").write_text(text)
    assert read_mesh(tmp_path / "m.obj").mesh.colors.tolist() == [[255, 0, 0], [128, 128, 128], [0, 0, 255]]


def test_materials_that_no_face_has_do_not_count(tmp_path: Path) -> None:
    other = "newmtl b\nmap_Kd nowhere.png\nKs 1 1 1\n"
    assert shown(put(tmp_path, "usemtl b\n" + ONE, "newmtl a\nmap_Kd t.png\n" + other))
    assert put(tmp_path, ONE, "newmtl a\nmap_Kd t.png\n" + other).dropped == frozenset()


def test_a_face_before_any_material_has_none(tmp_path: Path) -> None:
    mesh = put(tmp_path, POINTS + "f 1/1 2/2 3/3\nusemtl a\nf 3/3 2/2 4/4\n").mesh
    assert np.isnan(mesh.uv[0]).all() and np.isfinite(mesh.uv[1]).all()


@pytest.mark.parametrize(
    ("option", "wanted"),
    [("-s 2 3 1", [2, 3]), ("-o .25 .5", [1.25, 1.5]), ("-s 2 2 -o 1", [3, 2]), ("-clamp off", [1, 1])],
)
def test_options_of_a_picture_move_the_places(tmp_path: Path, option: str, wanted: list[float]) -> None:
    loaded = put(tmp_path, mtl=f"newmtl a\nmap_Kd {option} t.png\n")
    assert loaded.mesh.uv[1, 2].tolist() == wanted and loaded.dropped == frozenset()
