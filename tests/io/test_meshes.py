"""Mesh files: the contents of each format, and the error for each kind of damage."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from meshreel.errors import InputError
from meshreel.geometry.topology import weld
from meshreel.io.meshes import read_mesh
from meshreel.io.obj import parse_obj
from meshreel.io.polygons import Polygons, triangulate
from tests.shared_data import performer

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def read(folder: Path, name: str, data: str | bytes):
    path = folder / name
    path.write_bytes(data.encode() if isinstance(data, str) else data)
    return read_mesh(path)


def area(mesh) -> float:
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


OBJ_FORMS = {
    "corner_forms": "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\nf 1/1 2/1/1 3//1\n",
    "negative_indices": "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 5 5\n",
    "windows_newlines": TRIANGLE.replace("\n", "\r\n"),
    "old_mac_newlines": TRIANGLE.replace("\n", "\r"),
    "slash_and_nothing": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/ 2/// 3/x /9\n",
    "vertical_tabs": "\v\fv 0\v0\f0\nv 1 0 0\nv 0 1 0\nf 1\v2\f3\n",
    "comments": "# a\nv 0 0 0 # b\n\n  v 1 0 0\nv 0 1 0\n  # c\nf 1 2 3 # d",
    "exponents_and_tabs": "v\t0e0 -0 +0.\nv\t1E0  0\t0\nv .0 1.0e+00 0  \ng a b\ns off\nf  1 2 3 \n",
    "continued_lines": "v 0 0 \\\n0\nv 1 0 0\nv 0 1 0\nf 1 \\\r\n2 3\n",
    "colors_and_weights": "v 0 0 0 1 0 0\nv 1 0 0 1\nv 0 1 0 .5 .5 .5\nf 1 2 3\n",
}


@pytest.mark.parametrize("form", OBJ_FORMS)
def test_obj_is_read_in_all_its_forms(tmp_path: Path, form: str) -> None:
    mesh = read(tmp_path, "m.obj", OBJ_FORMS[form]).mesh
    assert mesh.vertices[mesh.faces[0]].tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_dropped_data_of_obj_files_is_named(tmp_path: Path) -> None:
    assert read(tmp_path, "m.obj", OBJ_FORMS["corner_forms"]).dropped == {"normals", "texture coordinates"}
    assert read(tmp_path, "m.obj", TRIANGLE).dropped == frozenset()


BAD_OBJ = {
    "nan": (TRIANGLE.replace("v 1 0 0", "v 1 nan 0"), r"vertex 1 is at \(1, nan, 0\), and 1 in all are not"),
    "infinite": (TRIANGLE.replace("v 1 0 0", "v 1e999 0 0"), r"vertex 1 is at \(inf, 0, 0\)"),
    "index_too_large": (TRIANGLE.replace("f 1 2 3", "f 1 2 4"), r"line 4 .* vertex 4, but the file has 3 vertices"),
    "index_zero": (TRIANGLE.replace("f 1 2 3", "f 0 1 2"), r"line 4 \('f 0 1 2'\) refers to vertex 0"),
    "index_negative": (TRIANGLE.replace("f 1 2 3", "f 1 2 -4"), r"refers to vertex -4"),
    "index_before_the_first": ("v 0 0 0\nf 1 -2 3\nv 1 0 0\nv 0 1 0\n", r"face 0 refers to vertex -1"),
    "index_fraction": (TRIANGLE.replace("f 1 2 3", "f 1 2 2.5"), r"refers to vertex 2.5"),
    "index_huge": (TRIANGLE.replace("f 1 2 3", "f 1 2 99999999999999999999"), r"refers to vertex 1e\+20"),
    "junk_coordinate": (TRIANGLE.replace("v 1 0 0", "v 1 zero 0"), r"line 2 .* has 'zero' where a number must be"),
    "decimal_comma": (TRIANGLE.replace("v 1 0 0", "v 1,5 0 0"), r"line 2 .* has '1,5' where a number"),
    "two_points": (TRIANGLE.replace("v 1 0 0", "v 1.0.5 0 0"), r"'1.0.5' where a number"),
    "short_vertex": (TRIANGLE.replace("v 1 0 0", "v 1 0"), r"line 2 \('v 1 0'\) has 2 coordinates instead of 3"),
    "short_face": (TRIANGLE.replace("f 1 2 3", "f 1 2"), r"line 4 \('f 1 2'\) has 2 corners instead of 3 or more"),
    "junk_statement": (TRIANGLE + "hello world\n", r"line 5 \('hello world'\) begins with no OBJ keyword"),
    "overflowing": (TRIANGLE.replace("v 1 0 0", "v 1e200 0 0"), r"vertex 1 is at \(1e\+200, 0, 0\)"),
    "nothing": ("", r"has 0 bytes"),
    "bytes": (bytes(range(256)), r"begins with no OBJ keyword"),
}


@pytest.mark.parametrize("case", BAD_OBJ)
def test_a_bad_obj_is_refused_with_the_place_and_a_remedy(tmp_path: Path, case: str) -> None:
    data, words = BAD_OBJ[case]
    with pytest.raises(InputError, match=words) as caught:
        read(tmp_path, "m.obj", data)
    assert str(caught.value).startswith(f"{tmp_path}/m.obj: ")
    assert "leave it out with --frames" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_a_folder_and_a_foreign_extension_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"gone.obj: cannot be read \(No such file or directory\); check the path"):
        read_mesh(tmp_path / "gone.obj")
    (tmp_path / "d.obj").mkdir()
    with pytest.raises(InputError, match=r"d.obj: cannot be read \(Is a directory\)"):
        read_mesh(tmp_path / "d.obj")
    with pytest.raises(InputError, match=r"m.fbx: .fbx extension is not one of .obj, .ply"):
        read(tmp_path, "m.fbx", "x")


def test_odd_but_legal_surfaces_are_kept_as_they_are(tmp_path: Path) -> None:
    text = (
        TRIANGLE + "v 7 7 7\nf 1 2 3\nf 1 1 2\nf 1 2 3\nv 1 1 1\nv 5 5 5\nv 5 6 5\nv 6 5 5\nf 2 1 5\nf 1 2 5\nf 6 7 8\n"
    )
    mesh = read(tmp_path, "m.obj", text).mesh
    assert (len(mesh.vertices), len(mesh.faces)) == (8, 7)


def test_far_coordinates_keep_their_digits(tmp_path: Path) -> None:
    mesh = read(tmp_path, "m.obj", TRIANGLE.replace("v 1 0 0", "v 1000000.00012 -2000000.34567 0")).mesh
    assert mesh.vertices[1].tolist() == [1000000.00012, -2000000.34567, 0]


@pytest.mark.parametrize(
    "outline",
    [
        [(0, 0), (1, 0), (1, 1), (0, 1)],
        [(0, 0), (4, 0), (1, 1), (0, 4)],  # concave at its third corner: only one diagonal is inside
        [(1, 1), (0, 4), (0, 0), (4, 0)],
        [(0, 0), (3, 0), (3, 3), (2, 1), (1, 1), (0, 3)],
        [(2, 1), (1, 1), (0, 3), (0, 0), (3, 0), (3, 3)],
        [(0, 0), (1, 0), (1, 0), (1, 1), (0, 1)],
    ],
)
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_polygons_are_cut_without_folding(outline: list, axis: int) -> None:
    flat = np.array(outline, dtype=np.float64)
    vertices = np.insert(flat, axis, 1e6, axis=1)
    n = len(outline)
    faces = triangulate(Polygons(vertices, np.arange(n), np.array([n])))
    x, y = flat.T
    shoelace = (x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2
    a, b, c = (flat[faces[:, k]] - flat[0] for k in range(3))
    signed = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    assert faces.shape == (n - 2, 3)
    assert (signed >= 0).all()
    assert signed.sum() / 2 == pytest.approx(shoelace)


def test_a_polygon_of_thousands_of_corners_is_cut_and_one_of_more_is_refused(tmp_path: Path) -> None:
    def spiral(corners: int) -> str:
        turns = 6 * np.pi * np.arange(corners // 2) / (corners // 2)
        inner, outer = (np.stack([np.cos(turns), np.sin(turns)], axis=1) * (turns + r)[:, None] for r in (1, 1.5))
        points = np.concatenate([inner, outer[::-1]])
        text = "".join(f"v {x} {y} 0\n" for x, y in points)
        return f"{text}f {' '.join(str(k + 1) for k in range(len(points)))}\n"

    mesh = read(tmp_path, "m.obj", spiral(1000)).mesh
    a, b, c = (mesh.vertices[mesh.faces[:, k], :2] for k in range(3))
    areas = ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2
    x, y = mesh.vertices[:, 0], mesh.vertices[:, 1]
    assert len(mesh.faces) == 998 and (areas <= 1e-9).all()
    assert areas.sum() == pytest.approx((x * np.roll(y, -1) - y * np.roll(x, -1)).sum() / 2)
    with pytest.raises(InputError, match="not convex has 5000 corners, of at most 4096"):
        read(tmp_path, "m.obj", spiral(5000))


def test_polygons_of_many_sizes_keep_the_order_of_the_file() -> None:
    vertices = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 1.5, 0]])
    corners = np.array([0, 1, 2, 0, 1, 2, 4, 3, 0, 1, 2, 3, 2, 4, 3])
    faces = corners[triangulate(Polygons(vertices, corners, np.array([3, 5, 4, 3])))]
    assert faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 4], [0, 4, 3], [0, 1, 2], [0, 2, 3], [2, 4, 3]]


PLY_TEXT = """ply
format ascii 1.0
comment polygons, # of all sizes
element vertex 5
property double x
property double y
property double z
property uchar red
property uchar green
property uchar blue
element face 3
property list uchar int vertex_indices
property int flags
end_header
1000000.00012 0 0 1 2 3
1000001 0 0 1 2 3
1000001 1 0 1 2 3
1000000 1 0 1 2 3
1000000.5 1.5 0 1 2 3
3 0 1 2 7
4 0 1 2 3 7
5 0 1 2 4 3 7
"""


def binary_ply(order: str) -> bytes:
    head, body = PLY_TEXT.split("end_header\n")
    head = head.replace("ascii", "binary_little_endian" if order == "<" else "binary_big_endian")
    rows = [[float(word) for word in line.split()] for line in body.splitlines()]
    data = b"".join(np.array(r[:3], order + "f8").tobytes() + bytes(map(int, r[3:])) for r in rows[:5])
    data += b"".join(bytes([int(r[0])]) + np.array(r[1:], order + "i4").tobytes() for r in rows[5:])
    return f"{head}end_header\n".encode() + data


@pytest.mark.parametrize("data", [PLY_TEXT.encode(), binary_ply("<"), binary_ply(">")], ids=["text", "little", "big"])
def test_ply_is_read_in_its_three_encodings(tmp_path: Path, data: bytes) -> None:
    loaded = read(tmp_path, "m.ply", data)
    assert loaded.mesh.faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 1, 2], [0, 2, 4], [0, 4, 3]]
    assert loaded.mesh.vertices[0].tolist() == [1000000.00012, 0, 0]
    assert loaded.dropped == {"property 'flags' of face"} and loaded.mesh.colors.tolist() == [[1, 2, 3]] * 5


@pytest.mark.parametrize("data", [PLY_TEXT.encode(), binary_ply("<"), binary_ply(">")], ids=["text", "little", "big"])
def test_a_ply_cut_anywhere_is_refused(tmp_path: Path, data: bytes) -> None:
    for length in range(len(data) - 2):  # text may lose its last newline
        with pytest.raises(InputError, match=r"m.ply"):
            read(tmp_path, "m.ply", data[:length])


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("element vertex 5", "element vertex 999999999999", r"announces 999999999999 vertex rows but"),
        ("list uchar int", "list uchar text", r"PLY header has 'property list uchar text"),
        ("5 0 1 2 4 3 7", "5 0 1 2 4 9 7", r"face 2 refers to vertex 9, but there are 5"),
        ("3 0 1 2 7", "2 0 1 7", r"face 0 has 2 corners"),
        ("3 0 1 2 7", "3 0 1 1.5 7", r"PLY index is 1.5 where a whole number must be"),
        ("3 0 1 2 7", "nan 0 1 2 7", r"PLY list length is nan"),
        ("3 0 1 2 7", "-3 0 1 2 7", r"face 0 is too short"),
        ("1 1 0 1 2 3\n1000000 1", "1 1 0 1 2 3\none 1", r"line 4 .*'one' where a number"),
        ("property double z\n", "", r"no x, y, z"),
        ("vertex_indices", "corners", r"no list called vertex_indices"),
    ],
)
def test_a_bad_ply_is_refused(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        read(tmp_path, "m.ply", PLY_TEXT.replace(old, new, 1))


def test_lists_before_and_behind_the_faces_of_a_binary_ply_are_skipped(tmp_path: Path) -> None:
    head = "ply\nformat binary_big_endian 1.0\nelement strip 2\nproperty list ushort double weights\nelement vertex 4\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += "element face 2\nproperty list uchar float uv\nproperty list uint ushort vertex_index\nend_header\n"
    strips = b"".join(len(row).to_bytes(2, "big") + np.array(row, ">f8").tobytes() for row in ([], [0.5, 0.25]))
    corners = [[0, 1, 2], [0, 1, 2, 3]]
    faces = b"".join(
        bytes([k]) + np.zeros(k, ">f4").tobytes() + len(row).to_bytes(4, "big") + np.array(row, ">u2").tobytes()
        for k, row in enumerate(corners)
    )
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], ">f4").tobytes()
    mesh = read(tmp_path, "m.ply", head.encode() + strips + square + faces).mesh
    assert mesh.faces.tolist() == [[0, 1, 2], [0, 1, 2], [0, 2, 3]]
    with pytest.raises(InputError, match="face 1 is too short"):
        read(tmp_path, "m.ply", (head.encode() + strips + square + faces)[:-1])


def test_absurd_sizes_are_refused_before_memory_is_taken(tmp_path: Path) -> None:
    huge = binary_ply("<").replace(b"element vertex 5", b"element vertex 99999999999999")
    with pytest.raises(InputError, match=r"99999999999999 vertex rows but the file is too short"):
        read(tmp_path, "m.ply", huge)


def test_a_point_cloud_is_refused_with_what_makes_surface_of_it(tmp_path: Path) -> None:
    head, body = PLY_TEXT.replace("element face 3", "element face 0").split("3 0 1 2 7")[0].split("end_header\n")
    with pytest.raises(InputError, match=r"m\.ply: 5 vertices and no faces: only surface is coded; `meshreel capture"):
        read(tmp_path, "m.ply", f"{head}end_header\n{body}")


def test_a_glb_file_of_points_is_refused_too(tmp_path: Path) -> None:
    data = trimesh.PointCloud(np.random.default_rng(1).normal(size=(50, 3))).export(file_type="glb")
    with pytest.raises(InputError, match=r"m\.glb: 50 vertices and no faces: only surface is coded"):
        read(tmp_path, "m.glb", data)


def test_points_beside_a_mesh_that_is_hidden_in_a_frame_do_not_make_it_a_cloud(tmp_path: Path) -> None:
    scene = trimesh.Scene([trimesh.PointCloud(np.eye(50, 3))])
    scene.add_geometry(trimesh.creation.box(), transform=np.diag([0.0, 0, 0, 1]))
    loaded = read(tmp_path, "m.glb", scene.export(file_type="glb"))
    assert loaded.mesh.is_empty and "points" in loaded.dropped


def test_a_few_points_without_faces_mark_an_empty_frame(tmp_path: Path) -> None:
    loaded = read(tmp_path, "m.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\np 1 2 3\n")
    assert loaded.mesh.is_empty
    assert "vertices without faces" in loaded.dropped


@pytest.mark.parametrize("extension", ["ply", "stl", "off", "glb", "obj"])
def test_what_trimesh_writes_is_read_and_every_cut_is_refused(tmp_path: Path, extension: str) -> None:
    ball = trimesh.creation.icosphere(subdivisions=1)
    data = ball.export(file_type=extension)
    data = data.encode() if isinstance(data, str) else data
    mesh = weld(read(tmp_path, f"m.{extension}", data).mesh)
    assert (len(mesh.vertices), len(mesh.faces)) == (42, 80)
    assert area(mesh) == pytest.approx(ball.area, rel=1e-6)
    if extension == "obj":
        return  # text without a count: a cut at a line's end cannot be seen
    for length in range(0, len(data) - 4, 41):
        with pytest.raises(InputError, match=rf"m.{extension}"):
            read(tmp_path, f"m.{extension}", data[:length])


def test_stl_text_is_read(tmp_path: Path) -> None:
    text = "solid a\nfacet normal 0 0 1\nouter loop\n"
    text += "vertex 0 0 0\nvertex 1 0 0\nvertex 0 1e0 0\nendloop\nendfacet\nendsolid a\n"
    assert read(tmp_path, "m.stl", text).mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    with pytest.raises(InputError, match=r"no 'endsolid' \(truncated\?\)"):
        read(tmp_path, "m.stl", text[:90])
    with pytest.raises(InputError, match=r"could not convert string to float: b?'x'"):
        read(tmp_path, "m.stl", text.replace("1e0", "x"))


@pytest.mark.parametrize("extension", ["obj", "ply", "stl", "off", "glb"])
@pytest.mark.parametrize(
    ("data", "kind"),
    [
        (b"\x89PNG\r\n\x1a\n" + bytes(range(200)), "a PNG picture"),
        (b"PK\x03\x04" + bytes(range(200)), "a ZIP archive"),
        (b"\x1f\x8b\x08" + bytes(range(200)), "compressed by gzip"),
        (b"\n<!DOCTYPE html><html>" + b" 404" * 60, "HTML or XML"),
        (b'{"asset": {"version": "2.0"}, "meshes": []}' + b" " * 99, "JSON"),
        (b"Kaydara FBX Binary  \0" + bytes(range(200)), "an FBX file"),
    ],
)
def test_a_file_of_another_kind_is_called_so(tmp_path: Path, extension: str, data: bytes, kind: str) -> None:
    with pytest.raises(InputError, match=rf"m.{extension}: is {kind}.*put a {extension.upper()} file there"):
        read(tmp_path, f"m.{extension}", data)


def test_no_stl_file_is_blamed_for_triangles_that_other_bytes_seem_to_announce(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"no text \('solid'\) of STL.*it was cut, or is no STL file"):
        read(tmp_path, "m.stl", b"LFSsomething" * 10)


def test_off_variants_are_read(tmp_path: Path) -> None:
    text = (
        "# c\nCOFF\n4 1 0 # counts\n0 0 0 1 0 0 1\n1 0 0 1 0 0 1\n\n1 1 0 1 0 0 1\n0 1 0 1 0 0 1\n4 0 1 2 3 255 0 0\n"
    )
    loaded = read(tmp_path, "m.off", text)
    assert loaded.mesh.faces.tolist() == [[0, 1, 2], [0, 2, 3]]
    assert loaded.dropped == frozenset() and loaded.mesh.colors.tolist() == [[255, 0, 0]] * 4
    with pytest.raises(InputError, match=r"announces 4 corners but has 3"):
        read(tmp_path, "m.off", text.replace("4 0 1 2 3 255 0 0", "4 0 1 2"))
    with pytest.raises(InputError, match=r"OFF header expected, found b'hello'"):
        read(tmp_path, "m.off", "hello")
    with pytest.raises(InputError, match=r"OFF counts expected"):
        read(tmp_path, "m.off", "OFF\n-1 2 0\n")


def test_a_glb_scene_is_placed_by_its_nodes(tmp_path: Path) -> None:
    scene, move = trimesh.Scene(), np.eye(4)
    move[:3, 3] = [1e6 + 0.125, 0, 3.0000123]
    box = trimesh.creation.box()
    scene.add_geometry(box, transform=move)
    move[0, 0] = -1  # mirrored: faces must be turned round
    scene.add_geometry(box, transform=move)
    mesh = read(tmp_path, "m.glb", scene.export(file_type="glb")).mesh
    assert mesh.vertices.mean(axis=0) == pytest.approx([1e6 + 0.125, 0, 3.0000123], abs=1e-4)
    local = mesh.vertices - mesh.vertices.mean(axis=0)
    a, b, c = (local[mesh.faces[:, k]] for k in range(3))
    assert np.einsum("fd,fd->", np.cross(a, b), c) / 6 == pytest.approx(2.0, abs=1e-3)


def test_obj_agrees_with_trimesh_on_a_captured_frame() -> None:
    path = sorted(performer("dancer").glob("*.obj"))[0]
    other = trimesh.load(path, process=False)
    polygons = parse_obj(path.read_bytes())
    assert np.array_equal(polygons.vertices, other.vertices)
    assert np.array_equal(polygons.corners.reshape(-1, 3), other.faces)


@pytest.mark.parametrize("name", ["m.obj", "text.ply", "binary.ply", "m.stl", "m.off", "m.glb"])
def test_damaged_bytes_give_a_mesh_or_an_input_error_and_nothing_else(tmp_path: Path, name: str) -> None:
    extension, random = name.split(".")[1], np.random.default_rng(7)
    data = {"text.ply": PLY_TEXT.encode(), "binary.ply": binary_ply(">")}.get(name)
    if data is None:
        data = trimesh.creation.box().export(file_type=extension)
        data = data.encode() if isinstance(data, str) else data
    for _ in range(150):
        bad = bytearray(data)
        for place in random.integers(0, len(bad), 3):
            bad[place] = random.integers(0, 256)
        try:
            mesh = read(tmp_path, name, bytes(bad)).mesh
        except InputError:
            continue
        assert np.isfinite(mesh.vertices).all()
        assert mesh.is_empty or (mesh.faces.min() >= 0 and mesh.faces.max() < len(mesh.vertices))


def test_a_glb_compressed_by_draco_is_read_unless_it_claims_more_than_it_says(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    data = box.export(file_type="glb", extension_draco=True)
    mesh = read(tmp_path, "m.glb", data).mesh
    assert mesh.to_trimesh().volume == pytest.approx(box.volume, rel=1e-3) and len(mesh.faces) == 12
    at = data.index(b"DRACO")
    for claim in (b"\xff\xff\xff\x7f", b"\xff\xff\xff\xff\xff\x7f"):
        bad = data[: at + 12] + claim + data[at + 12 + len(claim) :]
        with pytest.raises(InputError, match="Draco stream"):
            read(tmp_path, "m.glb", bad)


def test_a_glb_of_absurd_size_is_refused_before_memory_is_taken(tmp_path: Path) -> None:
    shown = b'{"nodes":[{"mesh":0}],"meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],'
    text = shown + b'"accessors":[{"count":99999999999,"componentType":5126,"type":"VEC3"}]}  '
    words = np.array([2, 20 + len(text), len(text)], "<u4").tobytes()
    with pytest.raises(InputError, match=r"announces 99999999999 values in \d+ bytes"):
        read(tmp_path, "m.glb", b"glTF" + words + b"JSON" + text)
