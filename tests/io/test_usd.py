"""Surfaces of USD files by exact values, written by USD's own package, and what cannot be read."""

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.errors import InputError
from meshreel.export.animated_file import ExportOptions, export
from meshreel.io import usd
from meshreel.io.sequence import FileSequence, SequenceOptions, open_sequence
from meshreel.io.write import write_picture
from tests.colored_body import BODY, textured, written

pxr = pytest.importorskip("pxr")
from pxr import Gf, Sdf, Usd, UsdGeom, UsdShade, UsdSkel, Vt  # noqa: E402

SQUARE = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]


def test_without_the_package_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.usda").write_text("#usda 1.0")
    monkeypatch.setitem(sys.modules, "pxr", None)
    with pytest.raises(InputError, match=r"a\.usda: USD needs the extra usd: pip install 'meshreel\[usd\]'"):
        open_sequence(tmp_path / "a.usda")[0]


def stage(path: Path, *, end: float | None = None, up: str = "Y", unit: float = 1.0) -> Any:
    made = Usd.Stage.CreateNew(str(path))
    UsdGeom.SetStageUpAxis(made, up)
    UsdGeom.SetStageMetersPerUnit(made, unit)
    made.SetTimeCodesPerSecond(24)
    made.SetFramesPerSecond(24)
    if end is not None:
        made.SetStartTimeCode(1)
        made.SetEndTimeCode(end)
    return made


def square(made: Any, name: str = "/square", points: Any = SQUARE, faces: Any = ((0, 1, 2, 3),)) -> Any:
    mesh = UsdGeom.Mesh.Define(made, name)
    mesh.CreateSubdivisionSchemeAttr("none")
    mesh.CreatePointsAttr(points)
    mesh.CreateFaceVertexCountsAttr([len(face) for face in faces])
    mesh.CreateFaceVertexIndicesAttr([corner for face in faces for corner in face])
    return mesh


def saved(made: Any) -> FileSequence:
    made.Save()
    return open_sequence(Path(made.GetRootLayer().realPath))


@pytest.mark.parametrize("kind", ["usda", "usdc"])
def test_topology_changes_in_time_at_the_rate_of_the_stage(kind: str, tmp_path: Path) -> None:
    made = stage(tmp_path / f"a.{kind}", end=4)
    mesh = square(made)
    for code, (points, counts, corners) in {
        1: (SQUARE, [4], [0, 1, 2, 3]),
        2: (SQUARE[:3], [3], [0, 1, 2]),
        4: ([(0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)], [3, 3], [0, 1, 2, 0, 2, 3]),
    }.items():
        mesh.GetPointsAttr().Set(points, code)
        mesh.GetFaceVertexCountsAttr().Set(counts, code)
        mesh.GetFaceVertexIndicesAttr().Set(corners, code)
    frames = saved(made)
    assert (len(frames), frames.frame_rate, frames.up) == (4, 24.0, "y")
    assert [len(mesh.faces) for mesh in frames] == [2, 1, 1, 2]
    assert frames[3].vertices[:, 2].tolist() == [1.0] * 4 and frames.warnings == ()
    slow = open_sequence(tmp_path / f"a.{kind}", SequenceOptions(frame_rate=8.0))
    assert len(slow) == 2 and slow.frame_rate == 8.0 and slow[1].vertices[0, 2] == 1.0


@pytest.mark.parametrize("rate", [25.0, 30.0, 24000 / 1001])
def test_no_frame_has_the_sample_before_by_rounding(rate: float, tmp_path: Path) -> None:
    made = stage(tmp_path / "a.usda")
    made.SetTimeCodesPerSecond(rate)
    made.SetFramesPerSecond(rate)
    mesh = square(made)
    for code in range(150):
        mesh.GetPointsAttr().Set([*SQUARE, (0, 0, code)], code)
        mesh.GetFaceVertexCountsAttr().Set([3] if code % 2 else [4], code)
        mesh.GetFaceVertexIndicesAttr().Set([0, 1, 4] if code % 2 else [0, 1, 2, 4], code)
    frames = saved(made)
    assert len(frames) == 150 and frames.frame_rate == pytest.approx(rate)
    for number in range(150):
        assert (len(frames[number].faces), frames[number].vertices[:, 2].max()) == (2 - number % 2, number)


def test_time_codes_a_second_are_the_rate_where_no_other_is_named(tmp_path: Path) -> None:
    made = Usd.Stage.CreateNew(str(tmp_path / "a.usda"))
    UsdGeom.SetStageMetersPerUnit(made, 1)
    made.SetTimeCodesPerSecond(60)
    mesh = square(made)
    for code in range(6):
        mesh.GetPointsAttr().Set(np.array(SQUARE) + [0, 0, float(code)], code)
    frames = saved(made)
    assert frames.frame_rate == 60.0 and [mesh.vertices[0, 2] for mesh in frames] == list(range(6))


def test_a_file_that_changed_is_read_again_and_one_that_does_not_move_is_a_frame(tmp_path: Path) -> None:
    made = stage(tmp_path / "a.usda", end=240)
    mesh = square(made)
    assert len(saved(made)) == 1 and saved(made)[0].vertices[0, 2] == 0.0
    text = (tmp_path / "a.usda").read_text()
    assert mesh
    (tmp_path / "a.usda").write_text(text.replace("(0, 0, 0)", "(0, 0, 7)"))
    assert open_sequence(tmp_path / "a.usda")[0].vertices[:, 2].max() == 7.0


def test_a_folder_has_the_axis_up_of_its_stages(tmp_path: Path) -> None:
    for number in range(2):
        made = stage(tmp_path / f"{number}.usda", up="Z")
        square(made)
        made.Save()
    assert open_sequence(tmp_path).up == "z"


def test_what_is_missing_is_refused_and_prototypes_are_nowhere(tmp_path: Path) -> None:
    (tmp_path / "a.usda").write_text('#usda 1.0\ndef "r" (references = @./none.usda@</x>) {}\n')
    with pytest.raises(InputError, match=r"a\.usda.*refers to what cannot be read.*none\.usda"):
        open_sequence(tmp_path / "a.usda")[0]
    made = stage(tmp_path / "b.usda")
    square(made)
    instancer = UsdGeom.PointInstancer.Define(made, "/many")
    square(made, "/many/prototype", np.array(SQUARE) + 5.0)
    instancer.CreatePrototypesRel().SetTargets(["/many/prototype"])
    frames = saved(made)
    assert len(frames[0].faces) == 2 and "prims of type PointInstancer" in frames.warnings[0]


@pytest.mark.parametrize("scope", ["uniform", "vertex"])
def test_colours_of_a_tetrahedron_are_whose_the_file_says(scope: str, tmp_path: Path) -> None:
    """It has as many faces as vertices."""
    faces = ((0, 1, 2), (0, 2, 3), (0, 3, 1), (1, 3, 2))
    made = stage(tmp_path / "a.usda")
    mesh = square(made, points=[(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], faces=faces)
    mesh.CreateDisplayColorAttr([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)])
    mesh.GetDisplayColorPrimvar().SetInterpolation(scope)
    colors = saved(made)[0].colors
    assert colors is not None
    wanted = {"uniform": [85, 85, 0], "vertex": [0, 0, 0]}[scope]  # of vertex 0: the mean of three faces, or its own
    assert np.abs(colors[0].astype(int) - wanted).max() <= 1


def test_places_of_vertices_are_not_those_of_corners(tmp_path: Path) -> None:
    write_picture(np.zeros((4, 4, 3), np.uint8), tmp_path / "skin.png")
    made = stage(tmp_path / "a.usda")
    mesh = square(made, faces=((3, 2, 1, 0),))
    pictured(made, mesh, "./skin.png")
    places = UsdGeom.PrimvarsAPI(mesh).GetPrimvar("places")
    places.SetInterpolation("vertex")
    places.Set(Vt.Vec2fArray([(point[0], point[1]) for point in SQUARE]))
    found = saved(made)[0]
    assert found.uv is not None and np.array_equal(found.uv, found.vertices[found.faces][..., :2].astype(np.float32))


def test_places_are_in_metres_and_the_stage_names_the_axis_up(tmp_path: Path) -> None:
    made = stage(tmp_path / "a.usda", up="Z", unit=0.01)
    outer = UsdGeom.Xform.Define(made, "/outer")
    outer.AddTranslateOp().Set(Gf.Vec3d(100, 0, 0))
    outer.AddScaleOp().Set(Gf.Vec3f(-200, 100, 100))  # which turns faces over
    square(made, "/outer/square")
    frames = saved(made)
    assert frames.up == "z" and len(frames) == 1
    assert frames[0].vertices.min(axis=0).tolist() == [-1.0, 0.0, 0.0]
    assert frames[0].vertices.max(axis=0).tolist() == [1.0, 1.0, 0.0]
    assert facing(frames[0]) == 1.0


def facing(mesh: meshreel.Mesh) -> float:
    a, b, c = mesh.vertices[mesh.faces[0]]
    return float(np.sign(np.cross(b - a, c - a)[2]))


def test_faces_of_the_left_hand_are_turned(tmp_path: Path) -> None:
    made = stage(tmp_path / "a.usda")
    square(made).CreateOrientationAttr("leftHanded")
    mesh = saved(made)[0]
    assert len(mesh.faces) == 2 and facing(mesh) == -1.0


def test_what_is_hidden_is_not_read_and_what_is_seen_and_no_mesh_is_named(tmp_path: Path) -> None:
    made = stage(tmp_path / "a.usda", end=2)
    square(made, "/a")
    blinking = square(made, "/b", np.array(SQUARE) + 5.0)
    blinking.CreateVisibilityAttr().Set("invisible", 1)
    blinking.GetVisibilityAttr().Set("inherited", 2)
    square(made, "/guide").CreatePurposeAttr("guide")
    UsdGeom.Sphere.Define(made, "/ball")
    square(made, "/smooth", np.array(SQUARE) + 9.0).GetSubdivisionSchemeAttr().Set("catmullClark")
    frames = saved(made)
    assert [len(mesh.faces) for mesh in frames] == [4, 6]
    [said] = frames.warnings
    assert "prims of type Sphere" in said and "smooth subdivision (the cage is taken)" in said


@pytest.mark.parametrize(
    ("values", "interpolation", "wanted"),
    [
        ([(1, 0, 0)], "constant", [[255, 0, 0]] * 4),
        ([(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.2140411, 0.2140411, 0.2140411)], "vertex", None),
        ([(1, 0, 0)] * 2, "uniform", [[255, 0, 0]] * 4),
        ([(0, 0, 1)] * 6, "faceVarying", [[0, 0, 255]] * 4),
    ],
)
def test_colours_are_of_meshes_faces_vertices_or_corners(
    values: Any, interpolation: str, wanted: Any, tmp_path: Path
) -> None:
    made = stage(tmp_path / "a.usda")
    mesh = square(made, faces=((0, 1, 2), (0, 2, 3)))
    mesh.CreateDisplayColorAttr(values)
    mesh.GetDisplayColorPrimvar().SetInterpolation(interpolation)
    colors = saved(made)[0].colors
    assert colors is not None
    own = [[255, 0, 0], [0, 255, 0], [0, 0, 255], [127, 127, 127]] if wanted is None else wanted
    assert np.abs(colors.astype(int) - own).max() <= 1


def pictured(made: Any, mesh: Any, path: str, name: str = "map") -> None:
    material = UsdShade.Material.Define(made, f"/{name}")
    surface, picture, reader = (UsdShade.Shader.Define(made, f"/{name}/{k}") for k in ("surface", "picture", "reader"))
    surface.CreateIdAttr("UsdPreviewSurface")
    picture.CreateIdAttr("UsdUVTexture")
    reader.CreateIdAttr("UsdPrimvarReader_float2")
    reader.CreateInput("varname", Sdf.ValueTypeNames.String).Set("places")
    picture.CreateInput("file", Sdf.ValueTypeNames.Asset).Set(Sdf.AssetPath(path))
    result = reader.CreateOutput("result", Sdf.ValueTypeNames.Float2)
    picture.CreateInput("st", Sdf.ValueTypeNames.Float2).ConnectToSource(result)
    rgb = picture.CreateOutput("rgb", Sdf.ValueTypeNames.Float3)
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).ConnectToSource(rgb)
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    places = UsdGeom.PrimvarsAPI(mesh).CreatePrimvar("places", Sdf.ValueTypeNames.TexCoord2fArray, "faceVarying")
    places.Set(Vt.Vec2fArray([(0, 0), (1, 0), (1, 1), (0, 1)]))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)


def test_a_picture_is_where_the_material_says(tmp_path: Path) -> None:
    pixels = np.arange(48, dtype=np.uint8).reshape(4, 4, 3)
    write_picture(pixels, tmp_path / "skin.png")
    made = stage(tmp_path / "a.usda")
    pictured(made, square(made), "./skin.png")
    mesh = saved(made)[0]
    assert mesh.texture is not None and np.array_equal(mesh.texture.pixels, pixels)
    assert mesh.uv is not None and sorted({*map(tuple, mesh.uv.reshape(-1, 2).tolist())}) == [
        (0.0, 0.0),
        (0.0, 1.0),
        (1.0, 0.0),
        (1.0, 1.0),
    ]
    (tmp_path / "skin.png").unlink()
    usd._picture.cache_clear()
    with pytest.raises(InputError, match=r"skin.png.*missing"):
        open_sequence(tmp_path / "a.usda")[0].texture.pixels  # noqa: B018


def test_the_colour_of_a_material_counts_and_bones_move_points(tmp_path: Path) -> None:
    made = stage(tmp_path / "a.usda", end=2)
    UsdSkel.Root.Define(made, "/root")
    skeleton = UsdSkel.Skeleton.Define(made, "/root/bones")
    skeleton.CreateJointsAttr(["bone"])
    skeleton.CreateBindTransformsAttr([Gf.Matrix4d(1)])
    skeleton.CreateRestTransformsAttr([Gf.Matrix4d(1)])
    moves = UsdSkel.Animation.Define(made, "/root/moves")
    moves.CreateJointsAttr(["bone"])
    moves.CreateRotationsAttr([Gf.Quatf(1)])
    moves.CreateScalesAttr([Gf.Vec3h(1)])
    for code in (1, 2):
        moves.CreateTranslationsAttr().Set([Gf.Vec3f(0, 0, code)], code)
    mesh = square(made, "/root/square")
    bound = UsdSkel.BindingAPI.Apply(mesh.GetPrim())
    bound.CreateSkeletonRel().SetTargets([skeleton.GetPath()])
    bound.CreateJointIndicesPrimvar(False, 1).Set([0] * 4)
    bound.CreateJointWeightsPrimvar(False, 1).Set([1.0] * 4)
    UsdSkel.BindingAPI.Apply(skeleton.GetPrim()).CreateAnimationSourceRel().SetTargets([moves.GetPath()])
    material = UsdShade.Material.Define(made, "/red")
    surface = UsdShade.Shader.Define(made, "/red/surface")
    surface.CreateIdAttr("UsdPreviewSurface")
    surface.CreateInput("diffuseColor", Sdf.ValueTypeNames.Color3f).Set((1, 0, 0))
    material.CreateSurfaceOutput().ConnectToSource(surface.CreateOutput("surface", Sdf.ValueTypeNames.Token))
    UsdShade.MaterialBindingAPI.Apply(mesh.GetPrim()).Bind(material)
    frames = saved(made)
    assert [mesh.vertices[:, 2].tolist() for mesh in frames] == [[1.0] * 4, [2.0] * 4]
    assert frames[0].colors is not None and frames[0].colors.tolist() == [[255, 0, 0]] * 4


@pytest.mark.parametrize("kind", ["usdc", "usdz"])
def test_what_export_writes_comes_back(kind: str, tmp_path: Path) -> None:
    for name in ("av", "xatlas"):
        pytest.importorskip(name)
    with meshreel.open(written([textured(mesh) for mesh in BODY[:3]])) as video:
        export(video.reader, tmp_path / f"a.{kind}", None, ExportOptions(texture=True))
        frames = open_sequence(tmp_path / f"a.{kind}")
        assert len(frames) == len(video) and frames.frame_rate == pytest.approx(video.frame_rate)
        for number, mesh in enumerate(frames):
            own = video[number]
            found, wanted = (each.vertices[each.faces].reshape(-1, 9) for each in (mesh, own))
            found, wanted = (np.round(each, 4)[np.lexsort(np.round(each, 4).T)] for each in (found, wanted))
            assert np.abs(found - wanted).max() < 2e-4
            assert (mesh.texture is None) == (own.texture is None)


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda mesh: mesh.GetFaceVertexCountsAttr().Set([5]), "has 4 corners, and its polygons 5"),
        (lambda mesh: mesh.GetFaceVertexIndicesAttr().Set([0, 1, 2, 9]), "refers to point 9, and has 4"),
        (lambda mesh: mesh.GetPointsAttr().Set([(np.nan, 0, 0), *SQUARE[1:]]), "not within"),
    ],
)
def test_meshes_that_break_the_rules_are_named(damage: Callable[[Any], Any], message: str, tmp_path: Path) -> None:
    made = stage(tmp_path / "a.usda")
    damage(square(made))
    with pytest.raises(InputError, match=rf"a\.usda.*{message}"):
        saved(made)[0]


def test_files_that_are_no_usd_or_are_cut_off_are_named(tmp_path: Path) -> None:
    made = stage(tmp_path / "a.usdc")
    square(made)
    made.Save()
    whole = (tmp_path / "a.usdc").read_bytes()
    for name, data in (("cut.usdc", whole[: len(whole) // 2]), ("text.usda", b"no usd"), ("empty.usd", b"")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=name):
            open_sequence(tmp_path / name)[0]


def test_a_folder_has_a_file_for_each_frame_and_none_that_moves(tmp_path: Path) -> None:
    for number in range(3):
        made = stage(tmp_path / f"{number}.usda")
        square(made, points=np.array(SQUARE) + [0, 0, float(number)])
        made.Save()
    frames = open_sequence(tmp_path)
    assert [mesh.vertices[0, 2] for mesh in frames] == [0.0, 1.0, 2.0]
    moving = stage(tmp_path / "3.usda", end=5)
    square(moving).GetPointsAttr().Set(SQUARE, 2)
    moving.Save()
    with pytest.raises(InputError, match=r"3\.usda.*it has an animation, and is one of several files"):
        open_sequence(tmp_path)[3]
