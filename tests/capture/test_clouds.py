"""Point clouds: every format gives the points that were written, damage is named, and a folder becomes frames."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshreel.capture.clouds import are_clouds, read_cloud
from meshreel.errors import InputError
from meshreel.io.write import write_mesh
from tests.geometry.test_points import ball
from tests.spheres import deforming_sphere

POINTS = (ball(3000) + [0.5, 1.0, -2.0]).astype(np.float32).astype(np.float64)
NORMALS = (POINTS - [0.5, 1.0, -2.0]).astype(np.float32).astype(np.float64)
COLORS = np.random.default_rng(0).integers(0, 256, (3000, 3)).astype(np.uint8)
PROPERTIES = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("nx", "f4"), ("ny", "f4"), ("nz", "f4")]
BYTES = [("red", "u1"), ("green", "u1"), ("blue", "u1")]


def rows(kinds: list[tuple[str, str]], *columns: np.ndarray) -> np.ndarray:
    """Rows of fields, as a binary file has them."""
    found = np.empty(len(columns[0]), [(name, "<" + kind) for name, kind in kinds])
    for (name, _), column in zip(kinds, np.concatenate(columns, axis=1).T, strict=True):
        found[name] = column
    return found


def ply(path: Path, points: np.ndarray = POINTS, *, text: bool = False, faces: int = 0) -> Path:
    words = {"f4": "float", "u1": "uchar"}
    table = rows([*PROPERTIES, *BYTES], points, NORMALS[: len(points)], COLORS[: len(points)])
    lines = ["ply", f"format {'ascii' if text else 'binary_little_endian'} 1.0", f"element vertex {len(points)}"]
    lines += [f"property {words[kind]} {name}" for name, kind in [*PROPERTIES, *BYTES]]
    lines += [f"element face {faces}", "property list uchar int vertex_indices", "end_header", ""]
    body = "".join(" ".join(map(repr, row)) + "\n" for row in table.tolist()).encode() if text else table.tobytes()
    path.write_bytes("\n".join(lines).encode() + body + (b"\x03" + bytes(12)) * faces)
    return path


def lzf(data: bytes) -> bytes:
    """Pack with runs of bytes, copies of earlier ones, and copies of what they write themselves."""
    packed, at = bytearray(), 0
    while at < len(data):
        length = next((n for n in (264, 9, 3) if at >= 7 and data[at : at + n] == (data[at - 7 : at] * n)[:n]), 0)
        if length:
            size = length - 2
            packed += bytes([min(size, 7) << 5, *([size - 7] if size >= 7 else []), 6])
            at += length
        else:
            run = data[at : at + 32] if at % 3 else data[at : at + 1]
            packed += bytes([len(run) - 1]) + run
            at += len(run)
    return bytes(packed)


def pcd(path: Path, form: str, view: str = "0 0 0 1 0 0 0") -> Path:
    packed = (COLORS.astype(np.uint32) @ [65536, 256, 1]).astype(np.uint32).view(np.float32)
    kinds = [("x", "f4"), ("y", "f4"), ("z", "f4"), ("rgb", "f4"), ("normal_x", "f4"), ("normal_y", "f4")]
    kinds += [("normal_z", "f4"), ("ring", "u2")]
    table = rows(kinds, POINTS, packed[:, None], NORMALS, np.full((3000, 1), 7))
    head = ["# .PCD v0.7 - Point Cloud Data file format", "VERSION 0.7"]
    head += ["FIELDS x y z rgb normal_x normal_y normal_z ring", "SIZE 4 4 4 4 4 4 4 2", "TYPE F F F F F F F U"]
    head += ["COUNT 1 1 1 1 1 1 1 1", "WIDTH 3000", "HEIGHT 1", f"VIEWPOINT {view}", "POINTS 3000", f"DATA {form}", ""]
    body = table.tobytes()
    if form == "ascii":
        body = "".join(" ".join(repr(float(v)) for v in row) + "\n" for row in table.tolist()).encode()
    elif form == "binary_compressed":
        whole = b"".join(np.ascontiguousarray(table[name]).tobytes() for name in table.dtype.names or ())
        body = lzf(whole)
        body = len(body).to_bytes(4, "little") + len(whole).to_bytes(4, "little") + body
    path.write_bytes("\n".join(head).encode() + body)
    return path


def npz(path: Path) -> Path:
    np.savez(path, points=POINTS, normals=NORMALS, colors=COLORS)
    return path


def las(path: Path) -> Path:
    laspy = pytest.importorskip("laspy")
    found = laspy.create(point_format=3, file_version="1.2")
    found.header.scales, found.header.offsets = np.full(3, 1e-6), np.array([0.5, 1.0, -2.0])
    found.x, found.y, found.z = POINTS.T
    found.red, found.green, found.blue = COLORS.astype(np.uint16).T * 257
    found.write(path)
    return path


WRITERS = {
    "text.ply": lambda path: ply(path, text=True),
    "binary.ply": ply,
    "text.pcd": lambda path: pcd(path, "ascii"),
    "binary.pcd": lambda path: pcd(path, "binary"),
    "packed.pcd": lambda path: pcd(path, "binary_compressed"),
    "points.npz": npz,
    "points.las": las,
    "points.laz": las,
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_points_that_were_written(name: str, tmp_path: Path) -> None:
    cloud = read_cloud(WRITERS[name](tmp_path / name))
    near = 1e-6 if ".la" in name else 0.0
    assert np.abs(cloud.points - POINTS).max() <= near
    assert cloud.colors is not None and np.array_equal(cloud.colors, COLORS)
    if ".la" not in name:
        assert cloud.normals is not None and np.array_equal(cloud.normals, NORMALS)


@pytest.mark.parametrize("name", ["a.ply", "a.pcd", "b.pcd"])
def test_clouds_of_open3d_are_read(name: str, tmp_path: Path) -> None:
    o3d = pytest.importorskip("open3d")
    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    cloud.normals, cloud.colors = o3d.utility.Vector3dVector(NORMALS), o3d.utility.Vector3dVector(COLORS / 255)
    o3d.io.write_point_cloud(str(tmp_path / name), cloud, compressed=name == "b.pcd")
    found = read_cloud(tmp_path / name)
    assert np.abs(found.points - POINTS).max() < 1e-6
    assert found.normals is not None and np.abs(found.normals - NORMALS).max() < 1e-6
    assert found.colors is not None and np.array_equal(found.colors, COLORS)


def test_points_without_a_place_are_left_out_and_normals_of_zeros_are_none(tmp_path: Path) -> None:
    points = POINTS.copy()
    points[::10] = np.nan
    assert len(read_cloud(ply(tmp_path / "some.ply", points)).points) == 2700
    np.savez(tmp_path / "zeros.npz", points=POINTS, normals=np.zeros_like(POINTS))
    assert read_cloud(tmp_path / "zeros.npz").normals is None


def test_a_cloud_is_in_metres_and_knows_its_sensor(tmp_path: Path) -> None:
    cloud = read_cloud(pcd(tmp_path / "a.pcd", "binary", "0 200 0 1 0 0 0"), 0.01)
    assert np.allclose(cloud.points, POINTS / 100) and cloud.eye is not None
    assert np.allclose(cloud.eye, [0, 2.0, 0])


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.ply", b"ply\nformat ascii 1.0\nelement face 0\nend_header\n", "PLY has no vertices"),
        ("a.ply", b"plywood", "header"),
        ("a.pcd", b"VERSION 0.7\n", "no line DATA"),
        ("a.pcd", b"FIELDS x y z\nSIZE 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n", "no matching FIELDS"),
        ("a.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 2\nDATA ascii\n1 2 3\n", "announces 2 points"),
        ("a.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 zwei\n", "not of numbers"),
        ("a.pcd", b"FIELDS x y\nSIZE 4 4\nTYPE F F\nPOINTS 1\nDATA ascii\n1 2\n", "x, y and z are missing"),
        ("a.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 9000000000000\nDATA binary\n123", "truncated"),
        ("a.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA binary_packed\n", "write ascii"),
        ("a.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nVIEWPOINT a b c\nDATA ascii\n1 2 3\n", "VIEWPOINT"),
        ("a.pcd", b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 0\nPOINTS 1\nDATA ascii\n1 2 3\n", "no matching"),
        ("a.pcd", b"FIELDS x y z\nSIZE 8 8 8\nTYPE C C C\nPOINTS 1\nDATA ascii\n1 2 3\n", "no matching"),
        (
            "a.pcd",
            b"FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA binary_compressed\n\x03\0\0\0\xff\xff\0\0\xe0\xff\0",
            "for points of 12",
        ),
        ("a.npz", b"PK", "cannot be read as .npz"),
        ("a.las", b"LASF" + bytes(300), "cannot be read as LAS"),
        ("a.ply", b"", "header"),
    ],
)
def test_damage_is_named(name: str, data: bytes, message: str, tmp_path: Path) -> None:
    if name.endswith(".las"):
        pytest.importorskip("laspy")
    (tmp_path / name).write_bytes(data)
    with pytest.raises(InputError, match=rf"{name}.*{message}"):
        read_cloud(tmp_path / name)


def test_arrays_of_other_shapes_are_refused(tmp_path: Path) -> None:
    for arrays, message in (
        ({"places": POINTS}, r"has places; points are an array 'points', N x 3"),
        ({"points": POINTS, "colors": COLORS[:-1]}, r"'colors' is uint8 \(2999, 3\), and 'points' \(3000, 3\)"),
    ):
        np.savez(tmp_path / "a.npz", **arrays)
        with pytest.raises(InputError, match=message):
            read_cloud(tmp_path / "a.npz")


def test_a_las_file_that_lacks_points_or_announces_records_without_end_is_refused(tmp_path: Path) -> None:
    whole = las(tmp_path / "a.las").read_bytes()
    for data, message in (
        (whole[: -34 * 100], "announces 3000 points but has 2900"),
        (whole[:100] + b"\xff" * 4 + whole[104:], "announces 4294967295 records"),
    ):
        (tmp_path / "b.las").write_bytes(data)
        with pytest.raises(InputError, match=rf"b\.las.*{message}"):
            read_cloud(tmp_path / "b.las")


def test_a_mesh_is_no_cloud(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"mesh.ply: has 2 faces.*what `meshreel encode` takes"):
        read_cloud(ply(tmp_path / "mesh.ply", faces=2))


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_changed_bytes_are_an_input_error_or_other_points(data: st.DataObject) -> None:
    name = data.draw(st.sampled_from(["binary.ply", "text.pcd", "packed.pcd", "points.npz"]))
    file = SMALL / name
    whole = bytearray(file.read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        whole[data.draw(st.integers(0, min(len(whole) - 1, 600)))] = data.draw(st.integers(0, 255))
    changed = SMALL / f"changed-{name}"
    changed.write_bytes(whole[: data.draw(st.integers(1, len(whole)))])
    try:
        cloud = read_cloud(changed)
    except InputError as error:
        assert changed.name in str(error)
    else:
        assert np.isfinite(cloud.points).all()


@pytest.fixture(autouse=True, scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> None:
    global SMALL
    SMALL = tmp_path_factory.mktemp("small")
    for name in ("binary.ply", "text.pcd", "packed.pcd", "points.npz"):
        WRITERS[name](SMALL / name)


def test_other_files_are_no_clouds(tmp_path: Path) -> None:
    write_mesh(deforming_sphere(2)[0], tmp_path / "a.obj")
    assert not are_clouds([tmp_path]) and not are_clouds([tmp_path / "a.obj"]) and are_clouds([tmp_path / "a.ply"])
