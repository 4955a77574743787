"""Surfaces of GLB files by exact values: quantised, sparse, deformed, animated, compressed, and their colours."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.errors import InputError
from meshreel.io.looks import light_in_picture
from meshreel.io.meshes import read_mesh
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.types import Mesh, MeshList
from tests.io.specifications import FACES, GLTF, LIGHT, PIXELS, PLACES, POINTS, Glb, png

F4 = np.float32


def read(folder: Path, glb: Glb, change: Callable[[Glb], object] = lambda _: None) -> Mesh:
    change(glb)
    (folder / "m.glb").write_bytes(glb.pack())
    return read_mesh(folder / "m.glb").mesh


def by_feature(folder: Path, name: str) -> np.ndarray:
    """The vertices of the plain file with one feature."""
    return read(folder, Glb(), GLTF[name]).vertices


@pytest.mark.parametrize(
    ("feature", "wanted"),
    [
        ("accessor.byteOffset, bufferView.byteStride", 2 * POINTS),
        ("accessor.sparse", np.concatenate([POINTS[:3], [[2, 2, 2]]])),
        ("accessor without a buffer view", 0 * POINTS),
        ("mesh.weights, primitive.targets", POINTS + 0.5 * (POINTS + 1)),
        ("primitive.targets without weights", POINTS),
        ("node.weights", POINTS + (POINTS + 1)),
        ("node.rotation", POINTS * [-1, -1, 1]),
        ("node.skin", POINTS + [0, 0, 3]),
        ("EXT_mesh_gpu_instancing", np.concatenate([POINTS + [0, 0, 1], POINTS + [0, 0, 2]])),
        ("EXT_meshopt_compression", POINTS + 1),
    ],
)
def test_positions_are_those_of_the_specification(tmp_path: Path, feature: str, wanted: np.ndarray) -> None:
    np.testing.assert_allclose(by_feature(tmp_path, feature), wanted, atol=1e-6)


def test_normalized_positions_are_fractions_of_the_largest_number(tmp_path: Path) -> None:
    found = by_feature(tmp_path, "accessor.normalized, KHR_mesh_quantization")
    np.testing.assert_allclose(found[:3], POINTS[:3], atol=1e-9)
    assert found[3, 0] == pytest.approx(30000 / 32767) and found[3, 2] == pytest.approx(16383 / 32767)


@pytest.mark.parametrize(
    ("mode", "wanted"),
    [(4, [[0, 1, 3]]), (5, [[0, 1, 3], [3, 1, 2]]), (6, [[0, 1, 3], [0, 3, 2]])],
)
def test_lists_strips_and_fans_keep_their_orientation(tmp_path: Path, mode: int, wanted: list[list[int]]) -> None:
    mesh = read(tmp_path, Glb(), GLTF[f"primitive.mode {mode}"])
    np.testing.assert_array_equal(mesh.vertices[mesh.faces], POINTS[np.array(wanted)])


def test_a_part_beyond_another_parts_vertices_is_placed_and_turned(tmp_path: Path) -> None:
    glb = Glb(pictured=False)
    glb.tree["nodes"] = [{"children": [1, 2], "translation": [1, 0, 0]}, {"mesh": 0}, {"mesh": 0, "scale": [-1, 1, 1]}]
    mesh = read(tmp_path, glb)
    np.testing.assert_allclose(mesh.vertices, np.concatenate([POINTS + [1, 0, 0], POINTS * [-1, 1, 1] + [1, 0, 0]]))
    np.testing.assert_array_equal(mesh.faces[2:], FACES[:, ::-1].astype(int) + 4)


def test_a_transform_of_a_texture_is_scale_then_rotation_then_offset(tmp_path: Path) -> None:
    glb, transform = Glb(), {"offset": [0.25, 0.5], "rotation": np.pi / 2, "scale": [2, 1]}
    glb.material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"] = {"KHR_texture_transform": transform}
    u, v = PLACES.T  # from the upper left corner; counter-clockwise by a right angle: (u, v) -> (v, -u)
    wanted = np.stack([v + 0.25, 1 - (-2 * u + 0.5)], axis=1)
    np.testing.assert_allclose(read(tmp_path, glb).uv, wanted[FACES], atol=1e-6)


def test_a_factor_and_one_colour_of_vertices_multiply_the_picture_in_linear_light(tmp_path: Path) -> None:
    glb = Glb()
    glb.material["pbrMetallicRoughness"]["baseColorFactor"] = [0.5, 1, 1, 1]
    glb.primitive["attributes"]["COLOR_0"] = glb.add(np.tile(np.array([[1, 0, 1]], F4), (4, 1)))
    found = read(tmp_path, glb).texture.pixels
    share = PIXELS[..., 0] / 255
    light = 0.5 * np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    red = 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)
    np.testing.assert_allclose(found[..., 0], red, atol=0.51)
    assert (found[..., 1] == 0).all() and (found[..., 2] == PIXELS[..., 2]).all()


def from_light(light: np.ndarray) -> np.ndarray:
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


def test_colours_of_vertices_multiply_the_picture_texel_by_texel(tmp_path: Path) -> None:
    glb = Glb()
    glb.tree["images"][0] = {"bufferView": glb.view(png(np.full((300, 700, 3), 255, np.uint8)))}
    glb.material["pbrMetallicRoughness"]["baseColorFactor"] = [1, 0.5, 1, 1]
    mesh = read(tmp_path, glb, GLTF["attribute COLOR_0 with a texture"])
    pixels, light = mesh.texture.pixels, LIGHT * [1, 0.5, 1]
    assert pixels.shape == (300, 700, 3)
    for shares in ([1 / 3, 1 / 3, 1 / 3], [0.8, 0.1, 0.1], [0.1, 0.2, 0.7]):
        for face, places in zip(FACES, mesh.uv, strict=True):
            u, v = shares @ places
            row, column = int((1 - v) * 300), int(u * 700)
            np.testing.assert_allclose(pixels[row, column], from_light(shares @ light[face]), atol=2.5)


def test_light_beside_faces_is_that_of_the_nearest_texel_and_no_picture_has_two_lights() -> None:
    places, white = np.array([[[0, 0], [0.5, 0], [0, 0.5]]], F4), np.ones((1, 3, 3))
    light = light_in_picture(places, white * 0.25, 8, 8)
    assert (light == 0.25).all()
    twice = np.repeat(places, 2, axis=0)
    assert light_in_picture(twice, np.concatenate([white, white]), 8, 8) is not None
    assert light_in_picture(twice, np.concatenate([white, 0.5 * white]), 8, 8) is None
    moved = twice + np.array([[[0, 0]], [[3, -1]]], F4)  # repeated, but within one copy
    assert light_in_picture(moved, np.concatenate([white, white]), 8, 8) is not None
    for odd in (places * 3, places * np.nan, places[:0], np.zeros((1, 3, 2), F4), np.repeat(places * 2, 64, axis=0)):
        assert light_in_picture(odd, np.ones((len(odd), 3, 3)), 8, 8) is None


def test_a_large_picture_is_lit_by_few_texels(tmp_path: Path) -> None:
    glb = Glb()
    glb.tree["images"][0] = {"bufferView": glb.view(png(np.full((2, 9000, 3), 255, np.uint8)))}
    pixels = read(tmp_path, glb, GLTF["attribute COLOR_0 with a texture"]).texture.pixels
    assert pixels.shape == (2, 9000, 3)
    assert (np.diff(pixels[1].astype(int), axis=0).any(axis=1)).sum() < 2048  # light has 2048 columns at most


def test_colours_of_vertices_on_texels_of_several_faces_are_named(tmp_path: Path) -> None:
    glb = Glb()
    read(tmp_path, glb, GLTF["attribute COLOR_0 with a texture whose texels faces share"])
    assert any("multiply a texture" in name for name in read_mesh(tmp_path / "m.glb").dropped)


def test_factors_of_materials_are_colours_of_vertices_and_multiply_them(tmp_path: Path) -> None:
    glb = Glb(pictured=False)
    glb.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [0.5, 0.5, 1, 1]}}, {}]
    glb.primitive |= {"material": 0}
    other = {"attributes": glb.primitive["attributes"] | {"COLOR_0": glb.add(LIGHT)}, "indices": 1, "material": 0}
    glb.tree["meshes"][0]["primitives"].append(other)
    colors = read(tmp_path, glb).colors
    assert colors[:4].tolist() == [[188, 188, 255]] * 4
    assert colors[4:].tolist() == [[188, 0, 0], [0, 188, 0], [0, 0, 255], [188, 188, 0]]


def test_a_part_without_a_material_is_white_beside_colours(tmp_path: Path) -> None:
    glb = Glb(pictured=False)
    glb.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}]
    glb.primitive |= {"material": 0}
    plain = {key: value for key, value in glb.primitive.items() if key != "material"}
    glb.tree["meshes"][0]["primitives"].append(plain)
    assert read(tmp_path, glb).colors.tolist() == [[255, 0, 0]] * 4 + [[255, 255, 255]] * 4


def test_one_grey_of_all_faces_is_no_colour_and_is_named(tmp_path: Path) -> None:
    glb = Glb(pictured=False)
    glb.tree["materials"] = [{"pbrMetallicRoughness": {"baseColorFactor": [0.8, 0.8, 0.8, 1]}}]
    glb.primitive |= {"material": 0}
    assert read(tmp_path, glb).colors is None
    assert read_mesh(tmp_path / "m.glb").dropped == {"the one grey of all faces"}


def test_pictures_of_several_materials_become_one_with_every_place_in_its_own(tmp_path: Path) -> None:
    glb, other = Glb(), np.full((2, 2, 3), 77, np.uint8)
    glb.tree["images"].append({"bufferView": glb.view(png(other))})
    glb.tree["textures"].append({"source": 1})
    glb.tree["materials"].append({"pbrMetallicRoughness": {"baseColorTexture": {"index": 1}}})
    glb.tree["meshes"][0]["primitives"].append(glb.primitive | {"material": 1})
    mesh = read(tmp_path, glb)
    pixels = mesh.texture.pixels
    rows, columns = pixels.shape[:2]
    for face, wanted in ((0, PIXELS), (2, other)):
        column, row = (mesh.uv[face, 1] * [columns, rows]).astype(int)
        u, v = PLACES[FACES[0, 1]]
        height, width = wanted.shape[:2]
        nearest = wanted[int(v * height), int(u * width)].astype(int)
        assert abs(pixels[rows - 1 - row, column].astype(int) - nearest).max() <= 1


def test_an_animated_file_is_a_sequence_sampled_at_the_frame_rate(tmp_path: Path) -> None:
    glb = Glb(pictured=False)
    times, places = np.array([0, 0.5, 1], F4), np.array([[0, 0, 0], [1, 0, 0], [1, 2, 0]], F4)
    channel = {"sampler": 0, "target": {"node": 0, "path": "translation"}}
    sampler = {"input": glb.add(times), "output": glb.add(places), "interpolation": "LINEAR"}
    glb.tree["animations"] = [{"channels": [channel], "samplers": [sampler]}]
    (tmp_path / "m.glb").write_bytes(glb.pack())
    sequence = open_sequence(tmp_path / "m.glb", SequenceOptions(frame_rate=4))
    moves = [mesh.vertices[0].tolist() for mesh in sequence]
    assert (len(sequence), sequence.frame_rate) == (5, 4.0) and sequence.warnings == ()
    np.testing.assert_allclose(moves, [[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [1, 1, 0], [1, 2, 0]], atol=1e-6)
    assert sequence.name(1).endswith("m.glb at 0.25 s)")
    (tmp_path / "n.glb").write_bytes(glb.pack())
    with pytest.raises(InputError, match=r"frame 0 \(.*m.glb\): GLB has an animation of 1 s.*give it alone"):
        open_sequence(tmp_path, SequenceOptions(order="name"))[0]


@pytest.mark.parametrize("how", ["STEP", "LINEAR", "CUBICSPLINE"])
def test_rotations_turn_evenly_between_their_keys(tmp_path: Path, how: str) -> None:
    glb, half = Glb(pictured=False), np.sqrt(0.5)
    turns = np.array([[0, 0, 0, 1], [0, 0, half, half]], F4)
    if how == "CUBICSPLINE":
        none = np.zeros((1, 4), F4)
        turns = np.concatenate([none, turns[:1], none, none, turns[1:], none])
    sampler = {"input": glb.add(np.array([0, 1], F4)), "output": glb.add(turns), "interpolation": how}
    glb.tree["animations"] = [
        {"channels": [{"sampler": 0, "target": {"node": 0, "path": "rotation"}}], "samplers": [sampler]}
    ]
    (tmp_path / "m.glb").write_bytes(glb.pack())
    middle = open_sequence(tmp_path / "m.glb", SequenceOptions(frame_rate=2))[1].vertices[1]
    angle = np.degrees(np.arctan2(middle[1], middle[0]))
    assert angle == pytest.approx(0 if how == "STEP" else 45, abs=0.01) and np.linalg.norm(middle) == pytest.approx(1)


@pytest.mark.parametrize("compressed", [False, True])
def test_what_export_writes_is_read_as_the_frames_that_it_was_made_of(tmp_path: Path, compressed: bool) -> None:
    if compressed:
        pytest.importorskip("meshoptimizer", reason="needs the extra glb")
    from meshreel.cli import main

    ball = Mesh.of(POINTS, FACES)
    frames = [replace(ball, vertices=ball.vertices + [0.1 * k, 0, 0]) for k in range(5)]
    meshreel.encode(MeshList(tuple(frames), 10.0), tmp_path / "a.reel", dynamic_only=True)
    flags = ["--compress"] if compressed else []
    assert main(["export", str(tmp_path / "a.reel"), "-o", str(tmp_path / "a.glb"), "--quiet", *flags]) == 0
    back = open_sequence(tmp_path / "a.glb", SequenceOptions(frame_rate=10))
    decoded = meshreel.open(tmp_path / "a.reel")
    assert len(back) == 5
    for mine, theirs in zip(decoded, back, strict=True):
        assert abs(np.sort(mine.vertices, axis=0) - np.sort(theirs.vertices, axis=0)).max() < 1e-3


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda glb: glb.tree["nodes"][0].update(children=[0]), "node 0 in two places"),
        (lambda glb: glb.tree["accessors"][0].update(count=99), "99 rows beyond the 48 bytes"),
        (lambda glb: glb.tree["accessors"][0].update(byteOffset=2**62), "beyond the 48 bytes"),
        (lambda glb: glb.tree["bufferViews"][0].update(byteOffset=-36), "byteOffset '-36'"),
        (lambda glb: glb.tree["bufferViews"][0].update(byteStride=2**40), "beyond the 48 bytes"),
        (lambda glb: glb.tree["nodes"][0].update(mesh=7), "entry 7 of its meshes, which is not there"),
        (lambda glb: glb.tree["nodes"][0].update(scale=[1, 2]), "3 numbers expected in nodes.scale"),
        (lambda glb: glb.tree["nodes"][0].update(rotation="x"), "GLB cannot be read"),
        (lambda glb: glb.primitive.update(mode=9), "mode 9"),
    ],
)
def test_damaged_descriptions_are_refused(tmp_path: Path, change: Callable[[Glb], object], words: str) -> None:
    with pytest.raises(InputError, match=words):
        read(tmp_path, Glb(), change)
