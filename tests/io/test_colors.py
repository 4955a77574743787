"""Colours and textures of mesh files: what is read, what comes back after writing, and errors for bad pictures."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image

from meshreel.errors import InputError
from meshreel.geometry.topology import clean, concatenate, part_of, weld
from meshreel.io.color import from_linear, to_linear
from meshreel.io.meshes import read_mesh
from meshreel.io.pictures import read_picture
from meshreel.io.write import write_mesh
from meshreel.types import GREY, Mesh, Texture

RNG = np.random.default_rng(5)
BALL = trimesh.creation.icosphere(2)
PAINTED = replace(Mesh.of(BALL.vertices, BALL.faces), colors=RNG.integers(0, 256, BALL.vertices.shape).astype(np.uint8))
PICTURE = RNG.integers(0, 256, (8, 16, 3)).astype(np.uint8)
SQUARE = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl skin\n"
QUAD = SQUARE + "f 1/1 2/2 3/3 4/4\n"
SKIN = "newmtl skin\nmap_Kd -s 1 1 1 skin.png\n"


def put(folder: Path, obj: str = QUAD, mtl: str = SKIN, picture: bytes | None = None) -> Path:
    (folder / "m.obj").write_text(obj)
    (folder / "m.mtl").write_text(mtl)
    if picture is None:
        Image.fromarray(PICTURE).save(folder / "skin.png")
    else:
        (folder / "skin.png").write_bytes(picture)
    return folder / "m.obj"


@pytest.mark.parametrize("extension", ["ply", "obj", "glb"])
def test_colors_of_vertices_come_back(tmp_path: Path, extension: str) -> None:
    write_mesh(PAINTED, tmp_path / f"m.{extension}")
    loaded = read_mesh(tmp_path / f"m.{extension}")
    assert loaded.mesh.colors is not None and loaded.dropped == frozenset()
    np.testing.assert_array_equal(loaded.mesh.colors, PAINTED.colors)
    write_mesh(replace(PAINTED, colors=None), tmp_path / f"n.{extension}")
    assert read_mesh(tmp_path / f"n.{extension}").mesh.colors is None


@pytest.mark.parametrize("kind, one", [("uchar", "255"), ("ushort", "65535"), ("float", "1.0"), ("float", "255.0")])
def test_ply_colors_of_all_kinds_are_8_bits(tmp_path: Path, kind: str, one: str) -> None:
    names = "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
    head = f"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{names}"
    rows = f"0 0 0 {one} 0 0\n1 0 0 0 {one} 0\n0 1 0 0 0 {one}\n3 0 1 2\n"
    text = f"{head}element face 1\nproperty list uchar int vertex_indices\nend_header\n{rows}"
    (tmp_path / "m.ply").write_text(text)
    assert read_mesh(tmp_path / "m.ply").mesh.colors.tolist() == [[255, 0, 0], [0, 255, 0], [0, 0, 255]]


def test_linear_light_of_gltf_and_srgb_are_inverses() -> None:
    all_of_them = np.arange(256, dtype=np.uint8)[:, None].repeat(3, axis=1)
    np.testing.assert_array_equal(from_linear(to_linear(all_of_them)), all_of_them)
    assert to_linear(np.full((1, 3), 188, np.uint8))[0, 0] == round(65535 * ((188 / 255 + 0.055) / 1.055) ** 2.4)
    assert from_linear(np.array([[1.0, 0.5, -1.0]])).tolist() == [[255, 188, 0]]


def test_an_obj_has_the_texture_of_its_material(tmp_path: Path) -> None:
    loaded = read_mesh(put(tmp_path))
    assert loaded.dropped == frozenset() and loaded.mesh.uv.tolist() == [
        [[0, 0], [1, 0], [1, 1]],
        [[0, 0], [1, 1], [0, 1]],
    ]
    np.testing.assert_array_equal(loaded.mesh.texture.pixels, PICTURE)
    negative = read_mesh(put(tmp_path, SQUARE + "f -4/-4 -3/-3 -2/-2 -1/-1\n")).mesh
    np.testing.assert_array_equal(negative.uv, loaded.mesh.uv)


def test_corners_without_a_place_in_the_texture_have_none(tmp_path: Path) -> None:
    mesh = read_mesh(put(tmp_path, SQUARE + "f 1 2 3\nf 1/9 3//1 4/4\n")).mesh
    assert np.isnan(mesh.uv[0]).all() and np.isnan(mesh.uv[1, :2]).all() and mesh.uv[1, 2].tolist() == [0, 1]


def test_what_is_dropped_of_materials_is_named(tmp_path: Path) -> None:
    two = SQUARE + "f 1/1 2/2 3/3\nusemtl coat\nf 1/1 3/3 4/4\n"
    other = SKIN + "newmtl coat\nmap_Kd coat.png\nnorm n.png\nmap_d d.png\n"
    loaded = read_mesh(put(tmp_path, two, other))
    assert loaded.dropped == {"several materials", "normal maps", "transparency", "texture coordinates"}
    assert loaded.mesh.texture is None
    (put(tmp_path).parent / "skin.png").unlink()
    assert "a texture (skin.png is not there)" in read_mesh(tmp_path / "m.obj").dropped
    (tmp_path / "m.mtl").unlink()
    assert "materials (m.mtl cannot be read)" in read_mesh(tmp_path / "m.obj").dropped


def packed(image: Image.Image, kind: str = "PNG") -> bytes:
    data = io.BytesIO()
    image.save(data, format=kind)
    return data.getvalue()


GOOD = {
    "grey": packed(Image.fromarray(PICTURE[..., 0])),
    "palette": packed(Image.fromarray(PICTURE).convert("P")),
    "transparent": packed(Image.fromarray(PICTURE).convert("RGBA")),
    "deep": packed(Image.fromarray(PICTURE[..., 0].astype(np.uint16) * 257)),
    "jpeg": packed(Image.fromarray(PICTURE), "JPEG"),
    "cmyk": packed(Image.fromarray(PICTURE).convert("CMYK"), "JPEG"),
}


@pytest.mark.parametrize("kind", GOOD)
def test_pictures_of_all_kinds_are_read_as_srgb(tmp_path: Path, kind: str) -> None:
    pixels = read_mesh(put(tmp_path, picture=GOOD[kind])).mesh.texture.pixels
    assert pixels.shape == PICTURE.shape and pixels.dtype == np.uint8
    if kind in ("grey", "deep"):
        np.testing.assert_array_equal(pixels, PICTURE[..., :1].repeat(3, axis=2))


BAD = {
    "truncated": (GOOD["transparent"][:-40], "cannot be read"),
    "no_picture": (b"hello", "is no picture"),
    "empty": (b"", "is no picture"),
    "too_large": (packed(Image.new("1", (16384, 16384))), "has more than 8192 x 8192 pixels"),
}


@pytest.mark.parametrize("kind", BAD)
def test_bad_pictures_have_clear_errors(tmp_path: Path, kind: str) -> None:
    data, message = BAD[kind]
    texture = read_mesh(put(tmp_path, picture=data)).mesh.texture
    with pytest.raises(InputError, match=rf"skin.png: {message}"):
        _ = texture.pixels


def test_a_picture_that_changed_is_read_again(tmp_path: Path) -> None:
    path = put(tmp_path).parent / "skin.png"
    assert read_picture(path).shape == (8, 16, 3)
    Image.fromarray(PICTURE[:4]).save(path)
    assert read_picture(path).shape == (4, 16, 3)


def test_a_glb_has_its_texture(tmp_path: Path) -> None:
    obj = trimesh.load(put(tmp_path, mtl=SKIN.replace("-s 1 1 1 ", "")), process=False)
    obj.export(tmp_path / "m.glb")
    mesh = read_mesh(tmp_path / "m.glb").mesh
    np.testing.assert_array_equal(mesh.texture.pixels, PICTURE)
    np.testing.assert_allclose(mesh.vertices[mesh.faces], obj.vertices[obj.faces])
    np.testing.assert_allclose(mesh.uv, obj.visual.uv[obj.faces], atol=1e-6)


def test_cleaning_welding_and_cutting_keep_colors_and_places() -> None:
    doubled = concatenate([PAINTED, PAINTED])
    assert len(doubled.colors) == 2 * len(PAINTED.colors)
    places = RNG.random((len(doubled.faces), 3, 2)).astype(np.float32)
    doubled = replace(doubled, uv=places, texture=Texture.of(PICTURE))
    whole = clean(weld(doubled))  # the second ball is the first one again
    np.testing.assert_array_equal(whole.colors, PAINTED.colors)
    np.testing.assert_array_equal(whole.uv, places[: len(PAINTED.faces)])
    chosen = np.arange(len(whole.faces)) % 3 == 0
    part = part_of(whole, chosen)
    np.testing.assert_array_equal(part.uv, whole.uv[chosen])
    np.testing.assert_array_equal(part.colors[part.faces], whole.colors[whole.faces[chosen]])
    bare = replace(PAINTED, colors=None)
    assert (concatenate([PAINTED, bare]).colors[len(PAINTED.colors) :] == GREY).all()
    copy = whole.copy()
    copy.colors[:] = 0
    assert whole.colors.any() and copy.texture is whole.texture
