"""Colours and textures of mesh files: what is read, what comes back after writing, and errors for bad pictures."""

import io
import json
from base64 import b64encode
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image

from meshreel.errors import InputError
from meshreel.geometry.color_views import Painted
from meshreel.geometry.topology import clean, concatenate, part_of, weld
from meshreel.io.glb_file import from_linear, to_linear
from meshreel.io.meshes import read_mesh
from meshreel.io.pictures import pack_picture, read_picture
from meshreel.io.polygons import eight_bits
from meshreel.io.sequence import open_sequence
from meshreel.io.write import write_mesh
from meshreel.types import GREY, Mesh, Texture, cut_at_seams
from tests.gltf_validator import validate

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


def put_ply(folder: Path, kind: str, rows: str) -> None:
    names = "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
    head = f"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n{names}"
    face = "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (folder / "m.ply").write_text(f"{head}{face}{rows}3 0 1 2\n")


@pytest.mark.parametrize("extension", ["ply", "obj", "glb", "npz"])
def test_colors_of_vertices_come_back(tmp_path: Path, extension: str) -> None:
    write_mesh(PAINTED, tmp_path / f"m.{extension}")
    sequence = open_sequence(tmp_path / f"m.{extension}")
    np.testing.assert_array_equal(sequence[0].colors, PAINTED.colors)
    assert sequence.warnings == ()
    write_mesh(replace(PAINTED, colors=None), tmp_path / f"n.{extension}")
    assert open_sequence(tmp_path / f"n.{extension}")[0].colors is None


def patched(mesh: Mesh = PAINTED) -> Mesh:
    """The ball with a texture, which some of its faces have no place in, and others have one outside of 0 to 1."""
    uv = RNG.random((len(mesh.faces), 3, 2)).astype(np.float32)
    uv[:5], uv[5] = np.nan, [[-0.5, 2], [1.5, 3.25], [0, 0]]
    uv[10:20] = 0.25  # many corners of a vertex at one place
    return replace(mesh, uv=uv, texture=Texture.of(PICTURE))


@pytest.mark.parametrize("extension", ["obj", "glb", "npz"])
@pytest.mark.parametrize("colored", [True, False])
def test_a_texture_comes_back_with_faces_that_have_no_place_in_it(
    tmp_path: Path, extension: str, colored: bool
) -> None:
    mesh = patched() if colored else replace(patched(), colors=None)
    write_mesh(mesh, tmp_path / f"m.{extension}")
    sequence = open_sequence(tmp_path / f"m.{extension}")
    again = sequence[0]
    assert sequence.warnings == ()
    np.testing.assert_array_equal(again.texture.pixels, PICTURE)
    wanted, found = sorted_faces(mesh), sorted_faces(again)
    np.testing.assert_allclose(found, wanted, atol=1e-6)
    assert (again.colors is None) != colored


def sorted_faces(mesh: Mesh) -> np.ndarray:
    """All that is known of each corner of each face, in the order of their places in space."""
    colors = mesh.vertices * 0 if mesh.colors is None else mesh.colors.astype(np.float64)
    rows = np.concatenate([mesh.vertices[mesh.faces], mesh.uv, colors[mesh.faces]], axis=2)
    return rows[np.lexsort(np.rint(rows[:, :, :3].sum(axis=1) * 1e4).T)]


def test_a_textured_obj_has_its_picture_beside_it_and_ply_has_none(tmp_path: Path) -> None:
    write_mesh(patched(), tmp_path / "my m.obj")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my m.mtl", "my m.obj", "my m.png"]
    assert (tmp_path / "my m.mtl").read_text() == "newmtl surface\nKd 1 1 1\nmap_Kd my m.png\n"
    np.testing.assert_array_equal(read_mesh(tmp_path / "my m.obj").mesh.texture.pixels, PICTURE)
    write_mesh(patched(), tmp_path / "m.ply")
    assert read_mesh(tmp_path / "m.ply").mesh.texture is None


def test_others_read_the_texture_that_we_write(tmp_path: Path) -> None:
    mesh = replace(PAINTED, colors=None, uv=RNG.random((len(PAINTED.faces), 3, 2)).astype(np.float32))
    for extension in ("obj", "glb"):
        write_mesh(replace(mesh, texture=Texture.of(PICTURE)), tmp_path / f"m.{extension}")
        other = trimesh.load_mesh(tmp_path / f"m.{extension}", process=False)
        np.testing.assert_allclose(other.visual.uv[other.faces], mesh.uv, atol=1e-6)
        material = other.visual.material
        shown = material.image if extension == "obj" else material.baseColorTexture
        np.testing.assert_array_equal(np.asarray(shown.convert("RGB")), PICTURE)


def test_khronos_finds_nothing_wrong_with_a_texture(tmp_path: Path) -> None:
    write_mesh(patched(), tmp_path / "m.glb")
    assert validate(tmp_path / "m.glb")[0]["messages"] == []


@pytest.mark.parametrize(
    "kind, one",
    [("uchar", "255"), ("ushort", "65535"), ("int", "255"), *(("float", one) for one in ("1.0", "1.02", "255.0"))],
)
def test_ply_colors_of_all_kinds_are_8_bits(tmp_path: Path, kind: str, one: str) -> None:
    put_ply(tmp_path, kind, f"0 0 0 {one} 0 0\n1 0 0 0 {one} 0\n0 1 0 0 0 {one}\n")
    assert read_mesh(tmp_path / "m.ply").mesh.colors.tolist() == [[255, 0, 0], [0, 255, 0], [0, 0, 255]]


@pytest.mark.parametrize(
    ("kind", "row", "told"),
    [
        ("float", "0 nan 0", r"vertex 1 has the colour \(0, nan, 0\), and 1 in all are not within 0 to 1"),
        ("float", "inf 0 0", r"colour \(inf, 0, 0\)"),
        ("float", "0 -7 0", r"colour \(0, -7, 0\)"),
        ("float", "0 0 1e6", r"colour \(0, 0, 1e\+06\), and 1 in all are not within 0 to 255"),
        ("int", "0 90000 0", r"colour \(0, 90000, 0\)"),
        ("uchar", "0 nan 0", r"colour \(0, nan, 0\)"),
    ],
)
def test_a_colour_that_is_none_is_refused_with_file_vertex_and_value(
    tmp_path: Path, kind: str, row: str, told: str
) -> None:
    put_ply(tmp_path, kind, f"0 0 0 1 0 0\n1 0 0 {row}\n0 1 0 0 0 1\n")
    with pytest.raises(InputError, match=rf"m.ply: .*{told}"):
        read_mesh(tmp_path / "m.ply")


@pytest.mark.parametrize("extension", ["obj", "npz", "glb"])
def test_a_colour_that_is_no_number_is_refused_in_every_format(tmp_path: Path, extension: str) -> None:
    path, colors = tmp_path / f"m.{extension}", np.full((3, 3), 0.5, np.float32)
    colors[1, 0] = np.nan
    corner = np.eye(3)
    if extension == "obj":
        path.write_text("v 0 0 0 1 0 0\nv 1 0 0 nan 0 0\nv 0 1 0 1 0 0\nf 1 2 3\n")
    elif extension == "npz":
        np.savez(path, vertices=corner[None], faces=[[0, 1, 2]], colors=colors)
    else:
        write_mesh(replace(Mesh.of(corner, [[0, 1, 2]]), colors=np.full((3, 3), 255, np.uint8)), path)
        data = path.read_bytes()
        at = data.rindex(np.ones(9, "<f4").tobytes()) + 12
        path.write_bytes(data[:at] + np.array([np.nan], "<f4").tobytes() + data[at + 4 :])
    with pytest.raises(InputError, match=rf"m.{extension}.*vertex 1 has the colour \(nan, "):
        open_sequence(path)[0]


@pytest.mark.parametrize("order", "<>")
def test_colors_of_16_bits_have_the_same_scale_in_either_byte_order(order: str) -> None:
    assert eight_bits(np.array([[0, 300, 65535]], f"{order}u2")).tolist() == [[0, 1, 255]]


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
    assert loaded.dropped == {"a texture (coat.png is not there)", "normal maps", "transparency"}
    assert np.isfinite(loaded.mesh.uv[0]).all() and np.isnan(loaded.mesh.uv[1]).all()
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
    light = to_linear(PICTURE.reshape(-1, 3)).astype(float) / 65535 * 0.4  # trimesh's colour of a material without one
    np.testing.assert_allclose(mesh.texture.pixels.reshape(-1, 3), from_linear(light), atol=1)
    np.testing.assert_allclose(mesh.vertices[mesh.faces], obj.vertices[obj.faces])
    np.testing.assert_allclose(mesh.uv, obj.visual.uv[obj.faces], atol=1e-6)


def rewritten(data: bytes, change: Callable[[dict[str, Any]], None]) -> bytes:
    """A GLB with another description of its scene."""
    size = int.from_bytes(data[12:16], "little")
    tree = json.loads(data[20 : 20 + size])
    change(tree)
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    total = len(data) - size + len(text)
    return (
        data[:8]
        + total.to_bytes(4, "little")
        + len(text).to_bytes(4, "little")
        + data[16:20]
        + text
        + data[20 + size :]
    )


@pytest.mark.parametrize(
    "change",
    [
        lambda tree: tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"].update(texCoord=1),
        lambda tree: tree["textures"][0].pop("source"),
    ],
)
def test_a_texture_that_would_lie_elsewhere_is_named_and_left_out(
    tmp_path: Path, change: Callable[[dict[str, Any]], None]
) -> None:
    trimesh.load(put(tmp_path, mtl=SKIN.replace("-s 1 1 1 ", "")), process=False).export(tmp_path / "m.glb")
    (tmp_path / "m.glb").write_bytes(rewritten((tmp_path / "m.glb").read_bytes(), change))
    found = read_mesh(tmp_path / "m.glb")
    assert found.mesh.texture is None and any("a texture" in words for words in found.dropped)


def test_colors_of_a_glb_that_are_not_of_its_vertices_are_an_error(tmp_path: Path) -> None:
    colors = np.zeros(BALL.vertices.shape, np.uint8)
    write_mesh(Mesh(np.array(BALL.vertices), np.array(BALL.faces, np.int32), colors), tmp_path / "m.glb")

    def fewer(tree: dict[str, Any]) -> None:
        at = tree["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]
        tree["accessors"][at]["count"] -= 2

    (tmp_path / "m.glb").write_bytes(rewritten((tmp_path / "m.glb").read_bytes(), fewer))
    with pytest.raises(InputError, match="COLOR_0 of shape"):
        read_mesh(tmp_path / "m.glb")


@pytest.mark.parametrize("uri", ["data", "file"])
def test_the_texture_of_a_glb_may_be_text_but_not_another_file(tmp_path: Path, uri: str) -> None:
    write_mesh(patched(), tmp_path / "m.glb")
    inline = f"data:image/png;base64,{b64encode(pack_picture(PICTURE)).decode()}"
    images = [{"uri": inline if uri == "data" else "skin.png"}]
    data = rewritten((tmp_path / "m.glb").read_bytes(), lambda tree: tree.update(images=images))
    (tmp_path / "m.glb").write_bytes(data)
    loaded = read_mesh(tmp_path / "m.glb")
    if uri == "data":
        np.testing.assert_array_equal(loaded.mesh.texture.pixels, PICTURE)
    else:
        assert loaded.mesh.texture is None and loaded.dropped == {"a texture (it is in another file)"}


def test_a_damaged_picture_in_a_glb_is_told_when_it_is_asked_for(tmp_path: Path) -> None:
    write_mesh(patched(), tmp_path / "m.glb")
    data = bytearray((tmp_path / "m.glb").read_bytes())
    begin = data.index(b"IHDR")
    for damage, message in ((b"NOPE", "cannot be read"), (b"IHDR\0\1\0\0\0\1\0\0", "more than 8192 x 8192")):
        data[begin : begin + len(damage)] = damage
        (tmp_path / "m.glb").write_bytes(data)
        mesh = read_mesh(tmp_path / "m.glb").mesh
        with pytest.raises(InputError, match=f"the texture of a GLB: .*({message}|is no picture)"):
            _ = mesh.texture.pixels


def test_a_vertex_is_repeated_for_each_of_its_places_and_no_more() -> None:
    mesh = patched()
    origins, corners, places = cut_at_seams(mesh.faces, mesh.uv)
    np.testing.assert_array_equal(origins[corners], mesh.faces)
    np.testing.assert_array_equal(places[corners], mesh.uv)
    known = {(int(v), *uv.view(np.uint32)) for v, uv in zip(origins, places, strict=True)}
    assert len(known) == len(origins) < mesh.faces.size
    whole = cut_at_seams(BALL.faces.astype(np.int32), np.zeros((len(BALL.faces), 3, 2), np.float32))
    np.testing.assert_array_equal(whole[1], BALL.faces)  # no seam: the vertices that there were, in their order


def test_places_that_are_no_numbers_are_none(tmp_path: Path) -> None:
    mesh = read_mesh(put(tmp_path, QUAD.replace("vt 1 1", "vt nan inf").replace("vt 0 1", "vt 1e99 0"))).mesh
    assert np.isnan(mesh.uv[0, 2]).all() and np.isfinite(mesh.uv[0, :2]).all()
    known = Painted(replace(mesh, colors=np.zeros((4, 3), np.uint8)))
    assert known.on(np.array([0], np.int32), np.ones((1, 3)) / 3).tolist() == [[0, 0, 0]]


ARRAYS = {
    "vertices": np.stack([PAINTED.vertices, PAINTED.vertices + 1]),
    "faces": PAINTED.faces,
    "colors": np.stack([PAINTED.colors, 255 - PAINTED.colors]),
    "uv": patched().uv,
    "texture": np.stack([PICTURE, PICTURE[::-1]]),
}


def test_an_npz_has_colors_and_textures_of_all_frames_or_of_each(tmp_path: Path) -> None:
    np.savez_compressed(tmp_path / "each.npz", **ARRAYS)
    one = {name: array[0] for name, array in ARRAYS.items() if name in ("colors", "texture")}
    np.savez(tmp_path / "all.npz", **ARRAYS | one)
    for frame in (1, 0):
        each, same = open_sequence(tmp_path / "each.npz")[frame], open_sequence(tmp_path / "all.npz")[frame]
        np.testing.assert_array_equal(each.colors, ARRAYS["colors"][frame])
        np.testing.assert_array_equal(each.uv, ARRAYS["uv"])
        np.testing.assert_array_equal(each.texture.pixels, ARRAYS["texture"][frame])
        np.testing.assert_array_equal(same.colors, PAINTED.colors)
        np.testing.assert_array_equal(same.texture.pixels, PICTURE)
    np.savez(tmp_path / "no_places.npz", **{name: array for name, array in ARRAYS.items() if name != "uv"})
    loose = open_sequence(tmp_path / "no_places.npz")
    assert loose[0].texture is None and "not kept: a texture (without uv) (first in frame 0" in loose.warnings[0]


@pytest.mark.parametrize(
    ("name", "array", "message"),
    [
        ("colors", PAINTED.colors[:-1], "V x 3"),
        ("colors", np.stack([PAINTED.colors] * 3), "T x V x 3"),
        ("colors", np.full(PAINTED.colors.shape, "red"), "must be numbers"),
        ("uv", patched().uv[:, :2], "two for each corner"),
        ("uv", patched().uv[:-1], "two for each corner"),
        ("texture", PICTURE.astype(np.uint16), "must be uint8"),
        ("texture", PICTURE[..., 0], "H x W x 3"),
        ("texture", PICTURE[:0], "H x W x 3"),
        ("texture", np.stack([PICTURE] * 3), "T x H x W x 3"),
        ("texture", np.zeros((8192, 8193, 3), np.uint8), "8192 x 8192"),
    ],
)
def test_arrays_of_an_npz_that_do_not_fit_its_frames_are_refused(
    tmp_path: Path, name: str, array: np.ndarray, message: str
) -> None:
    np.savez_compressed(tmp_path / "m.npz", **ARRAYS | {name: array})
    with pytest.raises(InputError, match=rf"m.npz: '{name}' is .*{message}"):
        open_sequence(tmp_path / "m.npz")


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
