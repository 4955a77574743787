"""Alembic files by exact values, written by the format's own package: read, and written by export."""

import shutil
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import meshreel
from meshreel.errors import InputError
from meshreel.export.animated_abc import animated_abc
from meshreel.export.animated_file import ExportOptions, export
from meshreel.export.shapes import Animation, Shape
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.types import Mesh
from tests.colored_body import BODY, textured, written

pytest.importorskip("alembic3d")
import imath
from alembic3d import Abc, AbcCoreAbstract, AbcGeom

SQUARE = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)], np.float32)
SCOPES = AbcGeom.GeometryScope


def sample(points: Any = SQUARE, sizes: Any = (4,), corners: Any = (3, 2, 1, 0)) -> Any:
    """Polygons, clockwise as the format has them."""
    numbers = [imath.IntArrayFromBuffer(np.array(values, np.int32)) for values in (corners, sizes)]
    return AbcGeom.OPolyMeshSchemaSample(imath.V3fArrayFromBuffer(np.array(points, np.float32)), *numbers)


class Made:
    """A new archive with a node that is placed, and the sampling of its meshes."""

    def __init__(self, path: Path, matrix: Any = np.eye(4)) -> None:
        self.archive = Abc.OArchive(str(path))
        self.times = self.archive.addTimeSampling(AbcCoreAbstract.TimeSampling(0.04, 2.0))
        self.node = AbcGeom.OXform(self.archive.getTop(), "node")
        place = AbcGeom.XformSample()
        place.setMatrix(imath.M44d(*np.asarray(matrix, float).reshape(-1).tolist()))
        self.node.getSchema().set(place)

    def mesh(self, name: str = "mesh") -> Any:
        self.last = AbcGeom.OPolyMesh(self.node, name, self.times)
        return self.last.getSchema()

    def close(self) -> None:
        self.last = self.node = self.archive = None


def facing(mesh: Mesh) -> float:
    a, b, c = mesh.vertices[mesh.faces[0]]
    return float(np.sign(np.cross(b - a, c - a)[2]))


def test_topology_changes_from_sample_to_sample(tmp_path: Path) -> None:
    made = Made(tmp_path / "a.abc")
    schema = made.mesh()
    for one in (sample(), sample(SQUARE[:3], (3,), (2, 1, 0)), sample(SQUARE + [0, 0, 1])):
        schema.set(one)
    del schema
    made.close()
    frames = open_sequence(tmp_path / "a.abc")
    assert (len(frames), frames.frame_rate, frames.up) == (3, 25.0, "y")
    assert [len(mesh.faces) for mesh in frames] == [2, 1, 2] and [facing(mesh) for mesh in frames] == [1.0] * 3
    assert frames[2].vertices[:, 2].tolist() == [1.0] * 4 and frames.warnings == ()
    fine = open_sequence(tmp_path / "a.abc", SequenceOptions(frame_rate=50.0))
    assert [len(mesh.faces) for mesh in fine] == [2, 2, 1, 1, 2]  # between samples the one before holds


def test_nodes_place_meshes_and_mirrors_do_not_turn_them(tmp_path: Path) -> None:
    matrix = np.diag([-2.0, 2.0, 2.0, 1.0])
    matrix[3, :3] = (5, 0, 0)
    made = Made(tmp_path / "a.abc", matrix=matrix)
    made.mesh().set(sample())
    made.close()
    mesh = open_sequence(tmp_path / "a.abc")[0]
    assert mesh.vertices.min(axis=0).tolist() == [3.0, 0.0, 0.0] and mesh.vertices.max(axis=0).tolist() == [5, 2, 0]
    assert facing(mesh) == 1.0


@pytest.mark.parametrize(("count", "scope"), [(4, "kVertexScope"), (6, "kFacevaryingScope"), (2, "kUniformScope")])
def test_colours_are_of_vertices_corners_or_faces(count: int, scope: str, tmp_path: Path) -> None:
    made = Made(tmp_path / "a.abc")
    schema = made.mesh()
    schema.set(sample(sizes=(3, 3), corners=(2, 1, 0, 3, 2, 0)))
    about = schema.getArbGeomParams(), "Cs", False, getattr(SCOPES, scope), 1, made.times
    colors = imath.C3fArray(imath.V3fArrayFromBuffer(np.tile(np.float32([0, 0.2140411, 1]), (count, 1))))
    params = AbcGeom.OC3fGeomParam(*about)
    params.set(AbcGeom.OC3fGeomParamSample(colors, getattr(SCOPES, scope)))
    del schema, about, params
    made.close()
    found = open_sequence(tmp_path / "a.abc")[0].colors
    assert found is not None and np.abs(found.astype(int) - [0, 127, 255]).max() <= 1


def test_what_export_writes_comes_back_with_its_colours_and_pictures(tmp_path: Path) -> None:
    for name in ("av", "xatlas"):
        pytest.importorskip(name)
    with meshreel.open(written([textured(mesh) for mesh in BODY[:3]])) as video:
        export(video.reader, tmp_path / "a.abc", None, ExportOptions(texture=True))
        frames = open_sequence(tmp_path / "a.abc")
        assert len(frames) == len(video) and frames.frame_rate == pytest.approx(video.frame_rate)
        for mesh, own in zip(frames, (video[number] for number in range(3)), strict=True):
            assert np.array_equal(mesh.vertices.astype(np.float32), own.vertices.astype(np.float32))
            assert {*map(tuple, np.sort(mesh.faces))} == {*map(tuple, np.sort(own.faces))}
            assert own.colors is not None and mesh.colors is not None
            assert np.abs(mesh.colors.astype(int) - own.colors).max() <= 1
    assert [path.name for path in sorted((tmp_path / "a_textures").iterdir())] == [
        f"track_0_{number:05}.png" for number in range(3)
    ]
    schema = AbcGeom.IPolyMesh(Abc.IArchive(str(tmp_path / "a.abc")).getTop().children[0], "track_0").getSchema()
    value = schema.getValue(Abc.ISampleSelector(1))
    assert len(schema.getUVsParam().getExpandedValue(Abc.ISampleSelector(1)).getVals()) == len(value.getFaceIndices())


def body(places: float, count: int = 3) -> Mesh:
    return Mesh.of(SQUARE[:count] + [0, 0, places], [(0, 1, 2)] if count == 3 else [(0, 1, 2), (0, 2, 3)])


def test_parts_that_come_late_or_go_are_empty_and_states_of_a_room_follow_in_time(tmp_path: Path) -> None:
    animation = Animation(np.array([0.0, 0.1, 0.3, 0.4]), 10.0)  # times that are not even
    first, second, moving = body(1.0), body(2.0, 4), [body(5.0, 4), body(6.0, 4)]
    with animated_abc(tmp_path / "a.abc", animation) as writer:
        writer.add(Shape("background", "state_0", first.faces, 0, [first], ((0, 1), (3, 4))))
        writer.add(Shape("background", "state_1", second.faces, 1, [second], ((1, 3),)))
        writer.add(Shape("track_0", "late", moving[0].faces, 1, moving, ((1, 3),)))
    schema = AbcGeom.IPolyMesh(Abc.IArchive(str(tmp_path / "a.abc")).getTop().children[0], "track_0").getSchema()
    times = schema.getTimeSampling()
    assert [round(times.getSampleTime(k), 6) for k in range(schema.getNumSamples())] == [0.0, 0.1, 0.3, 0.4]
    frames = open_sequence(tmp_path / "a.abc", SequenceOptions(frame_rate=10.0))
    assert [len(mesh.faces) for mesh in frames] == [1, 4, 4, 4, 1]
    assert [sorted({*mesh.vertices[:, 2].tolist()}) for mesh in frames] == [[1], [2, 5], [2, 5], [2, 6], [1]]


@pytest.mark.parametrize(
    ("made", "message"),
    [
        (sample(sizes=(5,)), "has 4 corners, and its polygons 5"),
        (sample(corners=(3, 2, 1, 9)), "refers to point 9, and has 4"),
        (sample(SQUARE * np.float32(np.nan)), "not within"),
    ],
)
def test_meshes_that_break_the_rules_are_named(made: Any, message: str, tmp_path: Path) -> None:
    archive = Made(tmp_path / "a.abc")
    archive.mesh().set(made)
    archive.close()
    with pytest.raises(InputError, match=rf"a\.abc.*{message}"):
        open_sequence(tmp_path / "a.abc")[0]


def test_files_that_are_none_or_cut_off_are_named(tmp_path: Path) -> None:
    made = Made(tmp_path / "a.abc")
    made.mesh().set(sample())
    made.close()
    whole = (tmp_path / "a.abc").read_bytes()
    for name, data in (("cut.abc", whole[: len(whole) // 2]), ("text.abc", b"no Alembic"), ("empty.abc", b"")):
        (tmp_path / name).write_bytes(data)
        with pytest.raises(InputError, match=name):
            open_sequence(tmp_path / name)[0]


def test_no_module_of_the_current_folder_is_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made = Made(tmp_path / "a.abc")
    made.mesh().set(sample())
    made.close()
    (tmp_path / "numpy.py").write_text("open('run', 'w')")
    monkeypatch.chdir(tmp_path)
    assert len(open_sequence("a.abc")[0].faces) == 2 and not (tmp_path / "run").exists()


def test_a_file_that_crashes_the_package_is_named_whatever_frame_does(tmp_path: Path) -> None:
    made = Made(tmp_path / "a.abc")
    schema = made.mesh()
    schema.set(sample(corners=(3, 2, 1, 9)))  # which the reader refuses itself
    schema.set(sample(SQUARE + 1))
    del schema
    made.close()
    data = bytearray((tmp_path / "a.abc").read_bytes())
    for at in range(0, len(data) - 8, 97):
        changed = data[:at] + (16).to_bytes(8, "little") + data[at + 8 :]
        (tmp_path / "b.abc").write_bytes(changed)
        try:
            open_sequence(tmp_path / "b.abc", SequenceOptions(frames=":1"))[0]
        except InputError as error:
            assert "b.abc" in str(error)


def test_a_full_disk_is_an_error_and_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    usage = shutil.disk_usage(tmp_path)
    monkeypatch.setattr(shutil, "disk_usage", lambda _: usage._replace(free=1 << 20))
    mesh, animation = body(1.0), Animation(np.zeros(1), 10.0)
    with (
        pytest.raises(InputError, match=r"a\.abc: cannot be written"),
        animated_abc(tmp_path / "a.abc", animation) as file,
    ):
        file.add(Shape("track_0", "all", mesh.faces, 0, [mesh], ((0, 1),)))
    assert list(tmp_path.iterdir()) == []


def test_without_the_package_the_extra_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.abc").write_bytes(b"Ogawa")
    monkeypatch.setitem(sys.modules, "alembic3d", None)
    with pytest.raises(InputError, match=r"Alembic needs the extra alembic: pip install 'meshreel\[alembic\]'"):
        open_sequence(tmp_path / "a.abc")[0]
    with (
        pytest.raises(InputError, match=r"pip install 'meshreel\[alembic\]'"),
        animated_abc(tmp_path / "b.abc", Animation(np.zeros(1), 10.0)),
    ):
        pass
    assert not (tmp_path / "b.abc").exists()
