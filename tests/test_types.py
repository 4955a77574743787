"""Meshes, sequences of them, and the axis that points up."""

import os
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from PIL import Image

from meshreel.conversions import as_sequence
from meshreel.errors import InputError
from meshreel.io.write import write_mesh
from meshreel.types import UP_AXES, Mesh, MeshList, Texture, check_up, evenly, known_up, offset


@pytest.mark.parametrize(
    ("count", "most", "wanted"),
    [
        (9, 3, [0, 4, 8]),
        (6, 4, [0, 2, 3, 5]),
        (60, 2, [0, 59]),
        (3, 10, [0, 1, 2]),
        (5, 1, [0]),
        (5, 0, []),
        (0, 4, []),
    ],
)
def test_some_frames_are_evenly_spread_from_the_first_to_the_last(count, most, wanted):
    assert evenly(count, most) == wanted


@pytest.mark.parametrize("axis", UP_AXES)
def test_an_axis_that_can_point_up_is_known(axis: str) -> None:
    check_up(axis)
    assert known_up(axis) == axis
    assert np.linalg.norm(UP_AXES[known_up(axis)]) == 1.0


@pytest.mark.parametrize("axis", ["x", "", None, 1, ["z"], {"up": "z"}])
def test_an_unknown_axis_in_a_file_means_y(axis: object) -> None:
    assert known_up(axis) == "y"


def test_another_axis_is_refused() -> None:
    with pytest.raises(InputError, match="up axis 'x': give y, z, -y, -z"):
        check_up("x")


@pytest.mark.skipif(os.environ.get("MESHREEL_SHAPES") == "0", reason="shapes are not checked in this run")
@pytest.mark.parametrize("vertices", [np.zeros((1, 2)), np.zeros((1, 3), np.float32)])
def test_shapes_and_dtypes_are_checked_while_tests_run(vertices: np.ndarray) -> None:
    with pytest.raises(TypeError, match="vertices"):
        Mesh(vertices, np.zeros((0, 3), np.int32))


TRIANGLE = Mesh.of([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def test_a_sequence_is_returned_as_it_is():
    sequence = MeshList((TRIANGLE,), frame_rate=12.0)
    assert as_sequence(sequence) is sequence


@pytest.mark.parametrize(
    "item",
    [
        TRIANGLE,
        TRIANGLE.to_trimesh(),
        (TRIANGLE.vertices, TRIANGLE.faces),
        [TRIANGLE.vertices.tolist(), TRIANGLE.faces.tolist()],
        TRIANGLE.to_open3d(),
    ],
    ids=["mesh", "trimesh", "pair of arrays", "pair of lists", "open3d"],
)
def test_meshes_of_other_libraries_and_pairs_of_arrays_are_frames(item: object):
    sequence = as_sequence([item, TRIANGLE], frame_rate=25.0)
    assert (len(sequence), sequence.frame_rate) == (2, 25.0)
    assert sequence[0].faces.tolist() == [[0, 1, 2]] and sequence[0].faces.dtype == np.int32
    assert sequence[0].vertices.tolist() == TRIANGLE.vertices.tolist() and sequence[0].vertices.dtype == np.float64


def test_an_iterator_of_meshes_and_a_frame_without_faces_are_a_sequence():
    sequence = as_sequence(pair for pair in [(np.zeros((0, 3)), []), ([[0, 0, 1]], [])])
    assert [len(mesh.vertices) for mesh in sequence] == [0, 1] and all(mesh.is_empty for mesh in sequence)


@pytest.mark.parametrize("value", ["scan", 3, TRIANGLE, None])
def test_a_value_that_is_no_sequence_of_meshes_is_refused(value: object):
    with pytest.raises(InputError, match="is no sequence of meshes; give a list of meshes, or"):
        as_sequence(value)


@pytest.mark.parametrize(
    ("item", "text"),
    [
        (7, "frame 1: int '7' is no mesh; give a Mesh"),
        (TRIANGLE.vertices, "frame 1: ndarray .* is no mesh"),
        ((TRIANGLE.vertices,), "frame 1: tuple .* is no mesh"),
        (([[0, 0]], [[0, 0, 0]]), r"frame 1: vertices are int64 of shape \(1, 2\); give N x 3 numbers"),
        (([["a", "b", "c"]], [[0, 0, 0]]), "frame 1: vertices are <U1"),
        ((TRIANGLE.vertices, [[0, 1, 2, 0]]), r"frame 1: faces are int64 of shape \(1, 4\)"),
        ((TRIANGLE.vertices, [[0, 1], [2]]), "frame 1: faces are no array"),
        ((np.eye(4, 3), np.zeros((0, 3))), "frame 1: 4 vertices and no faces: only surface is coded; .meshreel"),
        (Mesh.of(np.eye(4, 3), []), "frame 1: 4 vertices and no faces"),
        (trimesh.Scene([trimesh.PointCloud(np.eye(4, 3))]), "frame 1: 4 vertices and no faces"),
        ((TRIANGLE.vertices, [[0.0, 1.0, 2.0]]), "frame 1: faces are float64; give integers"),
        ((TRIANGLE.vertices, [[0, 1, 3]]), r"frame 1: a face refers to vertex 3, but there are 3 \(from 0\)"),
        ((TRIANGLE.vertices, [[0, -1, 2]]), "frame 1: a face refers to vertex -1"),
        ((TRIANGLE.vertices, np.array([[0, 1, 1 << 40]])), f"frame 1: a face refers to vertex {1 << 40}"),
    ],
)
def test_a_frame_that_is_no_mesh_is_named(item: object, text: str):
    with pytest.raises(InputError, match=text):
        as_sequence([TRIANGLE, item])


def test_copies_and_meshes_of_other_libraries_may_be_written_to():
    vertices = TRIANGLE.vertices.copy()
    vertices.flags.writeable = False
    mesh = Mesh(vertices, TRIANGLE.faces)
    for other in (mesh.copy(), mesh.to_trimesh()):
        assert np.array_equal(other.vertices, mesh.vertices) and np.array_equal(other.faces, mesh.faces)
        other.vertices[0] = 5
    assert mesh.vertices[0].tolist() == [0, 0, 0]
    assert np.asarray(mesh.to_open3d().triangles).tolist() == [[0, 1, 2]]


COLORED = replace(TRIANGLE, colors=np.array([[255, 0, 0], [0, 255, 0], [10, 20, 30]], np.uint8))


def to_trimesh(mesh: Mesh) -> object:
    return mesh.to_trimesh()


def to_scene(mesh: Mesh) -> object:
    """A scene of trimesh in which the mesh has a place of its own."""
    trimesh = pytest.importorskip("trimesh")
    scene = trimesh.Scene()
    placed = mesh.at(mesh.vertices - 1).to_trimesh()
    scene.add_geometry(placed, transform=trimesh.transformations.translation_matrix([1, 1, 1]))
    return scene


def to_open3d(mesh: Mesh) -> object:
    pytest.importorskip("open3d", reason="needs the extra open3d")
    return mesh.to_open3d()


def to_open4d(mesh: Mesh) -> object:
    """What a frame of Open4D has: `geometry` with `positions`, `triangles` and colours as fractions of 1."""
    colors = None if mesh.colors is None else (mesh.colors / 255).astype(np.float32)
    geometry = SimpleNamespace(positions=mesh.vertices.astype(np.float32), triangles=mesh.faces.astype(np.uint32))
    geometry.colors = colors
    return SimpleNamespace(frame_index=0, timestamp=0.0, geometry=geometry)


@pytest.mark.parametrize("mesh", [TRIANGLE, COLORED])
@pytest.mark.parametrize("convert", [to_trimesh, to_scene, to_open3d, to_open4d])
def test_meshes_of_other_libraries_come_back_as_they_went(convert, mesh: Mesh):
    (back,) = as_sequence([convert(mesh)])
    assert back.vertices.tolist() == mesh.vertices.tolist() and back.faces.tolist() == mesh.faces.tolist()
    assert back.vertices.dtype == np.float64 and back.faces.dtype == np.int32
    assert (back.colors is None) == (mesh.colors is None)
    if mesh.colors is not None:
        assert np.array_equal(back.colors, mesh.colors) and back.colors.dtype == np.uint8


PIXELS = np.arange(4 * 6 * 3, dtype=np.uint8).reshape(4, 6, 3) * 3
PLACES = np.array([[[0, 0.25], [1, 0.5], [0.125, 1]]], np.float32)
TEXTURED = replace(TRIANGLE, uv=PLACES, texture=Texture.of(PIXELS))


@pytest.mark.parametrize("convert", [to_trimesh, to_scene, to_open3d])
def test_textures_of_other_libraries_come_back_as_they_went(convert):
    (back,) = as_sequence([convert(TEXTURED)])
    assert np.array_equal(back.vertices[back.faces], TRIANGLE.vertices[TRIANGLE.faces])
    assert np.array_equal(back.uv, PLACES) and np.array_equal(back.texture.pixels, PIXELS)


def test_pictures_have_their_upper_row_where_other_libraries_have_it(tmp_path):
    """Open3D reads what we write as we hand it over, and trimesh, too."""
    open3d = pytest.importorskip("open3d", reason="needs the extra open3d")
    trimesh = pytest.importorskip("trimesh")
    write_mesh(TEXTURED, tmp_path / "m.obj")
    (theirs,) = as_sequence([open3d.io.read_triangle_mesh(str(tmp_path / "m.obj"), True)])
    assert np.array_equal(theirs.texture.pixels, PIXELS) and np.allclose(theirs.uv, PLACES)
    (theirs,) = as_sequence([trimesh.load(tmp_path / "m.obj", process=False)])
    assert np.array_equal(theirs.texture.pixels, PIXELS) and np.allclose(theirs.uv, PLACES)


def test_colors_of_faces_are_those_of_their_vertices_in_the_mean():
    trimesh = pytest.importorskip("trimesh")
    square = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [2, 1, 3]], process=False)
    square.visual.face_colors = [[255, 0, 0, 255], [0, 0, 255, 255]]
    (found,) = as_sequence([square])
    assert found.colors.tolist() == [[255, 0, 0], [128, 0, 128], [128, 0, 128], [0, 0, 255]]


@pytest.mark.parametrize("mesh", [TRIANGLE, COLORED])
def test_pyvista_gets_vertices_faces_and_colors(mesh: Mesh):
    pytest.importorskip("pyvista", reason="pyvista is not installed")
    found = mesh.to_pyvista()
    assert np.asarray(found.points).tolist() == mesh.vertices.tolist()
    assert found.regular_faces.tolist() == mesh.faces.tolist()
    assert ("RGB" in found.point_data) == (mesh.colors is not None)
    found.points[0] = 9
    assert mesh.vertices[0].tolist() == [0, 0, 0]
    assert mesh.colors is None or np.array_equal(found.point_data["RGB"], mesh.colors)


def test_a_sequence_that_knows_its_frame_rate_keeps_it():
    class Frames(list):
        fps = 24.0

    assert as_sequence(Frames([to_open4d(TRIANGLE)])).frame_rate == 24
    assert as_sequence(Frames([TRIANGLE]), 10.0).frame_rate == 10
    assert as_sequence([TRIANGLE]).frame_rate == 30


def test_colors_that_are_not_those_of_the_vertices_are_refused():
    wrong = to_open4d(TRIANGLE)
    wrong.geometry.colors = np.zeros((2, 3))
    with pytest.raises(InputError, match=r"frame 0: colours of shape \(2, 3\); give 3 x 3"):
        as_sequence([wrong])


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -2.0, 255.0, 300])
def test_a_colour_that_is_none_is_refused(value: float):
    wrong = to_open4d(TRIANGLE)
    wrong.geometry.colors = np.array([[1, 0, 0], [0, value, 0], [0, 0, 1]]) * (2 if value == 300 else 1)
    with pytest.raises(InputError, match=r"frame 0: a colour has the value"):
        as_sequence([wrong])


@pytest.mark.parametrize(("module", "words"), [("pyvista", "pip install pyvista"), ("open3d", r"meshreel\[open3d\]")])
def test_a_library_that_is_missing_is_named(monkeypatch: pytest.MonkeyPatch, module: str, words: str):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(ImportError, match=words):
        getattr(TRIANGLE, f"to_{module}")()


def test_the_box_of_a_mesh_has_its_diagonal_and_middle():
    mesh = Mesh.of([[-1, 0, 2], [1, 4, 2], [0, 1, 6]], [[0, 1, 2]])
    low, high = mesh.box
    assert low.tolist() == [-1, 0, 2] and high.tolist() == [1, 4, 6]
    assert mesh.diagonal == 6 and mesh.middle.tolist() == [0, 2, 4]
    assert Mesh.empty().diagonal == 0 and Mesh.empty().middle.tolist() == [0, 0, 0]


def textured_box(material, with_places=True):
    trimesh = pytest.importorskip("trimesh")
    box = trimesh.creation.box()
    places = np.linspace(0, 1, 16).reshape(8, 2) if with_places else None
    box.visual = trimesh.visual.TextureVisuals(uv=places, material=material)
    return box


def test_factors_and_materials_of_trimesh_are_kept():
    material = pytest.importorskip("trimesh").visual.material
    picture = Image.new("RGB", (4, 4), (255, 255, 255))
    red = [material.PBRMaterial(baseColorFactor=[255, 0, 0, 255]), material.SimpleMaterial(diffuse=[255, 0, 0, 255])]
    for one in red:
        assert (as_sequence([textured_box(one, False)])[0].colors == [255, 0, 0]).all()
    dark = material.PBRMaterial(baseColorTexture=picture, baseColorFactor=[128, 128, 128, 255])
    assert (as_sequence([textured_box(dark)])[0].texture.pixels == 188).all()  # linear light
    assert (as_sequence([textured_box(material.SimpleMaterial(image=picture))])[0].texture.pixels == 255).all()
    assert as_sequence([textured_box(material.PBRMaterial(), False)])[0].colors is None


def test_a_scene_of_trimesh_keeps_pictures_and_colours_apart():
    trimesh = pytest.importorskip("trimesh")
    picture = Image.new("RGB", (4, 4), (0, 0, 255))
    pictured = textured_box(trimesh.visual.material.PBRMaterial(baseColorTexture=picture))
    red = trimesh.creation.box().apply_translation([3, 0, 0])
    red.visual.vertex_colors = [[255, 0, 0, 255]] * 8
    mesh = as_sequence([trimesh.Scene([pictured, red])])[0]
    is_red = mesh.vertices[:, 0] > 2
    assert (mesh.colors[is_red] == [255, 0, 0]).all() and (mesh.texture.pixels == [0, 0, 255]).all()
    assert np.isfinite(mesh.uv[~is_red[mesh.faces].any(axis=1)]).all()
    assert np.isnan(mesh.uv[is_red[mesh.faces].all(axis=1)]).all()


def test_a_frame_outside_a_range_has_no_offset():
    assert [offset(number, range(3, 6)) for number in (3, 5)] == [0, 2]
    for number in (2, 6, -1):
        with pytest.raises(IndexError, match=f"frame {number}: there are frames 3 to 5"):
            offset(number, range(3, 6))
