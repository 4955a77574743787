"""Damaged and hostile mesh files: each is an InputError that names the file."""

import io
import os
import zipfile
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.io.meshes import read_mesh
from meshreel.io.sequence import open_sequence


def read(folder: Path, name: str, data: str | bytes):
    (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)
    return read_mesh(folder / name)


def glb_of(text: str) -> bytes:
    """A GLB whose scene description is this text."""
    data = text.encode() + b" " * (-len(text) % 4)
    sizes = np.array([2, 20 + len(data), len(data)], dtype="<u4").tobytes()
    return b"glTF" + sizes + b"JSON" + data


SHOWN = '{"nodes": [{"mesh": 0}], "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}], '
BAD_HEADERS = {
    "endless_number.ply": "ply\nformat ascii 1.0\nelement vertex " + "9" * 5000 + "\nend_header\n",
    "deep.glb": glb_of("[" * 100_000),
    "word_for_a_count.glb": glb_of(SHOWN + '"accessors": [{"count": "x"}]}'),
    "number_for_a_list.glb": glb_of(SHOWN + '"accessors": 5}'),
}


@pytest.mark.parametrize("name", BAD_HEADERS)
def test_headers_that_no_parser_survives_are_refused_by_name(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=name):
        read(tmp_path, name, BAD_HEADERS[name])


PLACES, PLACE_ROWS = (
    "element vertex 3\n" + "".join(f"property float {axis}\n" for axis in "xyz"),
    "0 0 0\n1 0 0\n0 1 0\n",
)
LISTS = "element face 1\nproperty list uchar int vertex_indices\n"
RED = "".join(f"property uchar {color}\n" for color in ("red", "green", "blue"))
STRIPS = "element tristrips 1\nproperty list uchar int vertex_indices\n"


@pytest.mark.parametrize(
    ("elements", "rows", "said"),
    [
        (PLACES + PLACES + LISTS, PLACE_ROWS + PLACE_ROWS + "3 0 1 2\n", "several elements called vertex"),
        (PLACES + LISTS + RED + LISTS, PLACE_ROWS + "3 0 1 2 9 9 9\n3 0 1 2\n", "several elements called face"),
        (PLACES + LISTS + RED + STRIPS, PLACE_ROWS + "3 0 1 2 9 9 9\n3 2 1 0\n", "strips of triangles beside faces"),
        (PLACES + STRIPS + LISTS + RED, PLACE_ROWS + "3 2 1 0\n3 0 1 2 9 9 9\n", "strips of triangles beside faces"),
    ],
)
def test_ply_elements_that_do_not_go_together_are_refused(tmp_path: Path, elements: str, rows: str, said: str) -> None:
    with pytest.raises(InputError, match=rf"a.ply: PLY has .*{said}"):
        read(tmp_path, "a.ply", f"ply\nformat ascii 1.0\n{elements}end_header\n{rows}")


@pytest.mark.parametrize("elements", [LISTS + STRIPS, STRIPS + LISTS])
def test_ply_faces_and_strips_make_one_surface(tmp_path: Path, elements: str) -> None:
    text = f"ply\nformat ascii 1.0\n{PLACES}{elements}end_header\n{PLACE_ROWS}3 0 1 2\n3 0 1 2\n"
    assert read(tmp_path, "a.ply", text).mesh.faces.tolist() == [[0, 1, 2], [0, 1, 2]]


def test_ply_elements_without_properties_take_no_bytes(tmp_path: Path) -> None:
    head = "ply\nformat binary_little_endian 1.0\nelement nothing " + "9" * 18 + "\nelement vertex 0\nend_header\n"
    assert read(tmp_path, "m.ply", head.replace("element vertex 0\n", "")).mesh.is_empty


def test_a_pipe_is_refused_before_it_blocks(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "m.ply")
    with pytest.raises(InputError, match=r"m\.ply.*pipe"):
        read_mesh(tmp_path / "m.ply")


@pytest.mark.parametrize("source", ["a**/*.ply", "n" * 300 + ".ply"])
def test_a_path_that_cannot_be_one_is_refused(tmp_path: Path, source: str) -> None:
    with pytest.raises(InputError, match=r"pattern|cannot be read"):
        open_sequence(tmp_path / source)


def packed(folder: Path, members: dict[str, bytes], kind: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(folder / "a.npz", "w", kind) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return folder / "a.npz"


def array_bytes(array: np.ndarray, shape: str | None = None) -> bytes:
    """The .npy file of an array; its header names another shape where one is given."""
    file = io.BytesIO()
    np.save(file, array)
    own, other = (str(name).encode() + b", }" for name in (array.shape, shape or array.shape))
    return file.getvalue().replace(own + b" " * (len(other) - len(own)), other, 1)


VERTICES, FACES = np.zeros((2, 3, 3)), np.array([[0, 1, 2]])
BAD_MEMBERS = {
    "other_endings": {"vertices.txt": b"x", "faces.npy": array_bytes(FACES)},
    "a_folder": {"d/vertices.npy": array_bytes(VERTICES), "d/faces.npy": array_bytes(FACES)},
    "negative_size": {"vertices.npy": array_bytes(np.zeros((22, 3, 3)), "(-2, 3, 3)"), "faces.npy": array_bytes(FACES)},
    "faces_beyond_memory": {
        "vertices.npy": array_bytes(VERTICES),
        "faces.npy": array_bytes(FACES, "(100000000000, 3)"),
    },
    "open_bracket": {"vertices.npy": b"\x93NUMPY\x01\x00\xff\xff" + b"[" * 65535, "faces.npy": array_bytes(FACES)},
    "unclosed_header": {"vertices.npy": b"\x93NUMPY\x01\x00\x10\x00" + b"(" * 16, "faces.npy": array_bytes(FACES)},
}


@pytest.mark.parametrize("members", BAD_MEMBERS.values(), ids=BAD_MEMBERS)
def test_an_archive_of_damaged_members_is_refused(tmp_path: Path, members: dict[str, bytes]) -> None:
    with pytest.raises(InputError, match=r"a\.npz"):
        open_sequence(packed(tmp_path, members))


def test_an_archive_with_a_flipped_byte_anywhere_is_read_or_refused(tmp_path: Path) -> None:
    vertices = np.random.default_rng(0).random((2, 40, 3))
    path = packed(
        tmp_path, {"vertices.npy": array_bytes(vertices), "faces.npy": array_bytes(FACES)}, zipfile.ZIP_DEFLATED
    )
    data = path.read_bytes()
    for at in range(0, len(data), 7):
        path.write_bytes(data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :])
        with suppress(InputError):
            list(open_sequence(path))


@pytest.mark.parametrize(
    ("kind", "alphas", "dropped"),
    [
        ("uchar", "255 255 255", set()),
        ("float", "1 1 1", set()),
        ("uchar", "255 254 255", {"transparency"}),
    ],
)
def test_ply_transparency_is_named_where_a_vertex_is_not_opaque(tmp_path: Path, kind, alphas, dropped) -> None:
    places = (*zip(PLACE_ROWS.splitlines(), alphas.split(), strict=True),)
    rows = "".join(f"{place} {alpha}\n" for place, alpha in places)
    text = f"ply\nformat ascii 1.0\n{PLACES}property {kind} alpha\n{LISTS}end_header\n{rows}3 0 1 2\n"
    assert read(tmp_path, "a.ply", text).dropped == dropped
