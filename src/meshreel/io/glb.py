"""Surfaces of GLB files (binary glTF 2): all triangles of a scene, placed by its nodes, at rest or at a time.

Whatever would change surface or time and is not read is refused; whatever else is not read is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from typing import TypeVar

import numpy as np
from jaxtyping import Float32, Float64, Int64, UInt8

from ..types import Texture, Up
from .glb_file import PASSED_OVER, from_linear, to_linear
from .gltf import DRACO, MESHOPTS, QUANTIZED, Entry, Gltf
from .looks import Look, Part, joined, light_in_picture
from .polygons import CLOUD, Polygons, Surfaceless, Unreadable, shares_of

Matrix = Float64[np.ndarray, "4 4"]
T = TypeVar("T")

_INSTANCES, _TRANSFORM = "EXT_mesh_gpu_instancing", "KHR_texture_transform"
_SHINE = "KHR_materials_pbrSpecularGlossiness"
_KNOWN = {  # extensions, each of which is read, or changes neither surface nor time nor base colours
    *(DRACO, QUANTIZED, *MESHOPTS, _INSTANCES, _TRANSFORM, _SHINE),
    *("EXT_texture_webp", "EXT_texture_avif", "KHR_materials_unlit", "KHR_node_visibility"),
}
_FINE, _COARSE = 512, 2048  # texels of a side: light has at least, and at most, so many (guesses)
_STRIP, _FAN = 5, 6  # modes of primitives (glTF 2.0, section 5.24)
_OTHER_MODES = {0: "points", 1: "lines", 2: "lines", 3: "lines"}
_LIGHT = to_linear(np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1))[:, 0] / 65535  # of sRGB values
_SHINING = ("metallicFactor", "roughnessFactor", "metallicRoughnessTexture")
_WORDS = {  # of entries that are not read, by the ends of their names
    **dict.fromkeys(("attributes.NORMAL", "targets.NORMAL"), "normals"),
    **dict.fromkeys(("attributes.TANGENT", "targets.TANGENT"), "tangents"),
    "attributes.TEXCOORD_0": "texture coordinates",
    "nodes.camera": "cameras",
    "materials.normalTexture": "normal maps",
    **dict.fromkeys(("materials.alphaMode", "materials.alphaCutoff"), "transparency"),
    **{f"materials.{name}": f"light ({name})" for name in ("emissiveFactor", "emissiveTexture")},
    **dict.fromkeys((f"pbrMetallicRoughness.{name}" for name in _SHINING), "shine"),
}


def parse_glb(data: bytes) -> Polygons:
    """Return the surface of a GLB file that does not move."""
    scene = Scene(data)
    if scene.duration > 0:
        text = f"GLB has an animation of {scene.duration:.3g} s, and is one of several files"
        raise Unreadable(f"{text}; give it alone, to have its frames, or write each frame without animation")
    return scene.at(0.0)


@dataclass(frozen=True, slots=True)
class _Part:
    """The triangles of a primitive, where its node has them."""

    vertices: Float64[np.ndarray, "V 3"]
    faces: Int64[np.ndarray, "F 3"]
    colors: UInt8[np.ndarray, "V 3"] | None
    uv: Float32[np.ndarray, "V 2"] | None
    look: Look


class Scene:
    """The scene of a GLB file."""

    frame_rate: float | None = None  # 1/s; a GLB does not tell
    up: Up = "y"

    def __init__(self, data: bytes) -> None:
        """Raises Unreadable if the file is damaged, or needs what is not read."""
        self._named = set[str]()
        self._tinted = cache(tinted)  # the same texture in all frames, as those that are shaded
        self._shaded = dict[tuple[Texture, bytes], Texture | None]()
        self._file = _guarded(lambda: Gltf(data))
        self.duration = _guarded(self._begin)

    def at(self, time: float) -> Polygons:
        """Return the surface at a time, s. Raises Surfaceless if the file has points, and triangles nowhere."""
        return _guarded(lambda: self._joined(list(self._parts(time)) or self._no_parts()))

    def count(self, frame_rate: float) -> int:
        """Return the number of frames at a rate, 1/s; the last time of an animation of ours is the end of a frame."""
        steps = self.duration * frame_rate
        return max(1, round(steps)) if self.is_ours else int(steps + 1e-3) + 1

    def _begin(self) -> float:
        """Check what the file needs; return the duration of its animation, s."""
        tree = self._file.tree
        asset = tree.get("asset", Entry({}, "asset"))
        if str(asset.get("minVersion", "2.0")) > "2.0":
            raise Unreadable(f"GLB needs glTF {asset.get('minVersion')}, and 2.0 is read")
        asset.get("version")
        self.is_ours = asset.get("generator") == "meshreel"
        if unknown := [name for name in tree.get("extensionsRequired", []) if name not in _KNOWN]:
            names = ", ".join(map(str, unknown))
            raise Unreadable(f"GLB needs the extension {names}, which is not read; write it without")
        animations = tree.get("animations", [])
        if len(animations) > 1:
            names = ", ".join(str(one.get("name", number))[:40] for number, one in enumerate(animations))
            raise Unreadable(f"GLB has {len(animations)} animations ({names}); keep one of them")
        self._moves = dict[tuple[int, str], Callable[[float], np.ndarray]]()
        ends = [self._add_move(one, channel) for one in animations for channel in one.get("channels", [])]
        self._order = list(self._tree_order())
        return max(ends, default=0.0)

    def _add_move(self, animation: Entry, channel: Entry) -> float:
        """Learn how an animation moves a node; return when that ends, s."""
        target = channel.get("target", Entry({}, ""))
        node, path = target.get("node"), target.get("path")
        if path not in ("translation", "rotation", "scale", "weights") or "extensions" in target:
            self._named.add("animations of other than nodes")
            animation.pass_over()
            return 0.0
        samplers, number = animation.get("samplers", []), channel.whole("sampler")
        if number >= len(samplers):
            raise Unreadable(f"GLB has an animation without sampler {number}")
        sampler = samplers[number]
        times = self._file.array(sampler.whole("input")).astype(np.float64).reshape(-1)
        values = self._file.array(sampler.whole("output")).astype(np.float64)
        how = sampler.get("interpolation", "LINEAR")
        if node is None or not len(times):
            return 0.0
        if not (np.isfinite(times).all() and (np.diff(times) > 0).all()):
            raise Unreadable("GLB has an animation whose times do not rise")
        rows = values.reshape(len(times), 3 if how == "CUBICSPLINE" else 1, -1)
        self._moves[node, path] = lambda time: _between(times, rows, how, time, path == "rotation")
        return float(times[-1])

    def _tree_order(self) -> Iterator[tuple[int, int]]:
        """Yield the nodes of the scene and their parents, -1 for none, each parent before its children."""
        tree = self._file.tree
        scenes, nodes = tree.get("scenes", []), tree.get("nodes", [])
        if len(scenes) > 1:
            self._named.add("other scenes")
        if scenes:
            roots = self._file.item("scenes", tree.whole("scene", 0)).get("nodes", [])
        else:
            inner = {child for node in nodes for child in node.get("children", [])}
            roots = [number for number in range(len(nodes)) if number not in inner]
        stack, seen = [(root, -1) for root in reversed(roots)], set[int]()
        while stack:
            number, parent = stack.pop()
            if number in seen:
                raise Unreadable(f"GLB has node {number} in two places of its tree")
            seen.add(number)
            yield number, parent
            stack += [(child, number) for child in reversed(self._file.item("nodes", number).get("children", []))]

    def _moved(self, node: int, path: str, time: float, rest: np.ndarray) -> np.ndarray:
        move = self._moves.get((node, path))
        return rest if move is None else move(time)

    def _local(self, number: int, time: float) -> Matrix:
        node = self._file.item("nodes", number)
        if "matrix" in node:
            return node.numbers("matrix", (0.0,) * 16).reshape(4, 4).T
        rest = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}
        move, turn, size = (self._moved(number, path, time, node.numbers(path, none)) for path, none in rest.items())
        return _placed(move, turn, size)

    def _parts(self, time: float) -> Iterator[_Part]:
        places, hidden, total = {-1: np.eye(4)}, {-1: False}, 0
        for number, parent in self._order:
            node = self._file.item("nodes", number)
            places[number] = places[parent] @ self._local(number, time) if parent >= 0 else self._local(number, time)
            shown = node.get("extensions", Entry({}, "")).get("KHR_node_visibility", Entry({}, ""))
            hidden[number] = hidden[parent] or not shown.get("visible", True)
        for number, _ in self._order:
            node = self._file.item("nodes", number)
            # A scale of 0 hides a node until an animation shows it.
            if hidden[number] or not places[number][:3, :3].any():
                node.pass_over()
                continue
            if "mesh" not in node:
                continue
            mesh = self._file.item("meshes", node.whole("mesh"))
            shares = np.asarray(node.get("weights", mesh.get("weights", [])), np.float64)
            shares = self._moved(number, "weights", time, shares).reshape(-1)
            joints = self._joints(node, places)
            matrices = [places[number] @ one for one in self._instances(node)]
            for primitive in mesh.get("primitives", []):
                if (found := self._primitive(primitive, shares, joints)) is None:
                    continue
                for matrix in matrices if joints is None else [np.eye(4)]:
                    total += len(found.vertices)
                    if total > self._file.most:
                        text = "counted as often as they are shown"
                        raise Unreadable(f"GLB has more than {self._file.most} vertices, {text}")
                    yield _put(found, matrix)

    def _instances(self, node: Entry) -> list[Matrix]:
        """Return the places of a node's copies, relative to it (EXT_mesh_gpu_instancing)."""
        extension = node.get("extensions", Entry({}, "")).get(_INSTANCES)
        if extension is None:
            return [np.eye(4)]
        arrays = extension.get("attributes", Entry({}, ""))
        rest = {"TRANSLATION": [0.0, 0, 0], "ROTATION": [0.0, 0, 0, 1], "SCALE": [1.0, 1, 1]}
        known = {name: self._file.array(arrays.whole(name)) for name in rest if name in arrays}
        count = min(map(len, known.values()), default=0)
        columns = [np.asarray(known.get(name, np.tile(none, (count, 1))), np.float64) for name, none in rest.items()]
        return [_placed(*row) for row in zip(*columns, strict=False)]

    def _joints(self, node: Entry, places: dict[int, Matrix]) -> Float64[np.ndarray, "J 4 4"] | None:
        """Return the matrices of the joints of a node's skin; None if it has no skin."""
        if "skin" not in node:
            return None
        skin = self._file.item("skins", node.whole("skin"))
        joints = skin.get("joints", [])
        if lost := [joint for joint in joints if joint not in places]:
            raise Unreadable(f"GLB has a skin with joint {str(lost[0])[:20]}, which is not in its scene")
        matrices = np.stack([places[joint] for joint in joints])
        if "inverseBindMatrices" in skin:
            bound = self._file.array(skin.whole("inverseBindMatrices")).astype(np.float64)
            matrices = matrices @ bound[: len(joints)].reshape(-1, 4, 4).transpose(0, 2, 1)
        return matrices

    def _primitive(self, primitive: Entry, shares: np.ndarray, joints: np.ndarray | None) -> _Part | None:
        """Return a primitive's triangles in its node, deformed; None if it has none."""
        mode = primitive.whole("mode", 4)
        if mode in _OTHER_MODES:
            self._named.add(_OTHER_MODES[mode])
            primitive.pass_over()
            return None
        if mode > _FAN:
            raise Unreadable(f"GLB has a primitive of mode {mode}")
        attributes = primitive.get("attributes", Entry({}, "attributes"))
        packed = primitive.get("extensions", Entry({}, "")).get(DRACO)
        corners, arrays = None, dict[str, np.ndarray]()
        if packed is not None:
            corners, arrays = self._file.draco(packed, self._claimed(primitive, attributes))

        def read(name: str) -> np.ndarray | None:
            number = attributes.get(name)
            return arrays[name] if name in arrays else None if number is None else self._file.array(number)

        positions = read("POSITION")
        if positions is None:
            return None
        if positions.shape[1] != 3:
            raise Unreadable(f"GLB has positions of {positions.shape[1]} numbers")
        vertices, light, own = positions.astype(np.float64), read("COLOR_0"), read(PASSED_OVER)
        for values in (light, own):
            if values is not None and (len(values) != len(vertices) or values.shape[1] < 3):
                raise Unreadable(f"COLOR_0 of shape {values.shape} for {len(vertices)} vertices")
        for share, target in zip(shares, primitive.get("targets", []), strict=False):
            if share:
                vertices, light = self._morphed(target, float(share), vertices, light)
        if joints is not None:
            vertices = _skinned(vertices, joints, read)
        if corners is None:
            number = primitive.get("indices")
            corners = np.arange(len(vertices)) if number is None else self._file.array(number).reshape(-1)
        faces = _triangles(corners.astype(np.int64), mode)
        look, uv, light = self._look(primitive, read, light, faces)
        light = own[:, :3] if light is None and own is not None else light
        return _used(_Part(vertices, faces, None if light is None else from_linear(light), uv, look))

    def _claimed(self, primitive: Entry, attributes: Entry) -> int:
        """Return how many vertices and indices the accessors of a compressed primitive announce."""
        counts = [self._file.item("accessors", attributes.whole("POSITION")).whole("count")]
        if "indices" in primitive:
            counts.append(self._file.item("accessors", primitive.whole("indices")).whole("count"))
        for number in [number for _, number in attributes.items()] + [primitive.get("indices", 0)]:
            for key in ("componentType", "normalized", "byteOffset"):
                self._file.item("accessors", number).get(key)
        return min(max(counts), self._file.most)

    def _morphed(
        self, target: Entry, share: float, vertices: np.ndarray, light: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray | None]:
        """Return vertices and light with a share of a morph target's differences."""
        numbers = (target.get(name) for name in ("POSITION", "COLOR_0"))
        moved, lit = (None if number is None else self._file.array(number) for number in numbers)
        if moved is not None:
            vertices = vertices + share * moved.astype(np.float64)
        if lit is not None and light is not None:
            light = np.clip(_fractions(light) + share * _fractions(lit)[:, : light.shape[1]], 0, 1)
        return vertices, light

    def _look(
        self, primitive: Entry, read: Callable[[str], np.ndarray | None], light: np.ndarray | None, faces: np.ndarray
    ) -> tuple[Look, np.ndarray | None, np.ndarray | None]:
        """Return the look of a primitive, the places of its vertices in the picture, and their light."""
        if "material" not in primitive:
            return Look(), None, None if light is None else light[:, :3]
        material = self._file.item("materials", primitive.whole("material"))
        extensions = material.get("extensions", Entry({}, ""))
        shine, paint = material.get("pbrMetallicRoughness", Entry({}, "")), extensions.get(_SHINE)
        use, factor = shine.get("baseColorTexture"), shine.numbers("baseColorFactor", (1.0, 1.0, 1.0, 1.0))
        if paint is not None:
            self._named.add(f"shine ({_SHINE})")
            if use is None:
                use, factor = paint.get("diffuseTexture"), paint.numbers("diffuseFactor", (1.0, 1.0, 1.0, 1.0))
            paint.pass_over()
        if extensions.get("KHR_materials_unlit") is not None:
            for name in _SHINING:
                shine.get(name)
        if material.get("alphaMode", "OPAQUE") != "OPAQUE":
            self._named.add("transparency")
        tint, is_tinted = factor[:3], bool((factor[:3] != 1.0).any())
        if use is not None:
            picture, sampler, why = self._file.texture(use.whole("index"))
            uv = self._places(use, read)
            if picture is not None and uv is not None:
                wraps = {sampler.get(name, 10497) for name in ("wrapS", "wrapT")}
                if wraps != {10497} and ((uv < 0) | (uv > 1)).any():
                    self._named.add("pictures that do not repeat beyond their borders (wrapS, wrapT)")
                return self._pictured(picture, uv, tint, light, faces), uv, None
            self._named.add(why or "a texture (without places)")
        if light is not None:
            shares = _fractions(light)[:, :3]
            return Look(), None, shares * tint if is_tinted else light[:, :3]
        return Look(_bytes(tint) if is_tinted else None), None, None

    def _pictured(
        self, picture: Texture, uv: np.ndarray, tint: np.ndarray, light: np.ndarray | None, faces: np.ndarray
    ) -> Look:
        """Return the look of a picture that colours multiply."""
        shares = np.ones((0, 3)) if light is None else _fractions(light)[:, :3]
        if (shares == shares[:1]).all():
            tint = tint * shares[0] if len(shares) else tint
        elif len(faces) and faces.min() >= 0 and faces.max() < len(uv):  # checked later
            places, shares = uv[faces], shares[faces] * tint
            key = picture, sha256(places.tobytes() + shares.tobytes()).digest()
            if key not in self._shaded:
                self._shaded[key] = _shaded(picture, places, shares)
            if (shaded := self._shaded[key]) is None:
                self._named.add("colours of vertices that multiply a texture, whose texels several faces share")
            else:
                picture, tint = shaded, np.ones(3)
        return Look(None, picture if (tint == 1).all() else self._tinted(picture, *map(float, tint)))

    def _places(self, use: Entry, read: Callable[[str], np.ndarray | None]) -> Float32[np.ndarray, "V 2"] | None:
        """Return the places of vertices in a picture, as `Mesh.uv`."""
        moved = use.get("extensions", Entry({}, "")).get(_TRANSFORM)
        number = use.whole("texCoord", 0) if moved is None else moved.whole("texCoord", use.whole("texCoord", 0))
        found = read(f"TEXCOORD_{number}")
        if found is None:
            return None
        uv = found[:, :2].astype(np.float64)
        if moved is not None:
            turn, size = float(moved.get("rotation", 0.0)), moved.numbers("scale", (1.0, 1.0))
            c, s = np.cos(turn), np.sin(turn)
            uv = (uv * size) @ np.array([[c, -s], [s, c]]) + moved.numbers("offset", (0.0, 0.0))
        return np.stack([uv[:, 0], 1 - uv[:, 1]], axis=1).astype(np.float32)

    def _no_parts(self) -> list[_Part]:
        """Return an empty list, where the file is no point cloud."""
        every = [one for mesh in self._file.tree.get("meshes", []) for one in mesh.get("primitives", [])]
        modes = [one.whole("mode", 4) for one in every]
        points = [one for one, mode in zip(every, modes, strict=True) if _OTHER_MODES.get(mode) == "points"]
        places = [one.get("attributes", Entry({}, "")).get("POSITION") for one in points]
        count = sum(self._file.item("accessors", at).whole("count") for at in places if at is not None)
        if count >= CLOUD and _OTHER_MODES.keys() >= set(modes):
            raise Surfaceless(count)
        return []

    def _joined(self, parts: list[_Part]) -> Polygons:
        """Return all parts as one surface, which names what is not read."""
        found = joined([_polygons(part) for part in parts])
        named = {_WORDS.get(".".join(name.split(".")[-2:]), _plain(name)) for name in self._file.tree.unread()}
        return found.naming(named | self._named)


def _polygons(part: _Part) -> Part:
    corners, sizes = part.faces.reshape(-1), np.full(len(part.faces), 3, np.int64)
    valid = (corners >= 0) & (corners < len(part.vertices))  # `checked` refuses others
    uv = None if part.uv is None else part.uv[np.where(valid, corners, 0)]
    return Part(part.vertices, corners, sizes, part.colors, uv, part.look)


def _plain(name: str) -> str:
    """Return the name of an entry that is not read, with the list that it stands in."""
    return " of ".join(reversed(name.replace("pbrMetallicRoughness.", "").replace("extensions.", "").rsplit(".", 1)))


def _guarded(act: Callable[[], T]) -> T:
    """Turn what damaged entries raise into Unreadable."""
    try:
        return act()
    except Unreadable:
        raise
    except (TypeError, ValueError, AttributeError, LookupError, ArithmeticError, RuntimeError, MemoryError) as error:
        raise Unreadable(f"GLB cannot be read ({type(error).__name__}: {error})") from None


def _fractions(values: np.ndarray) -> np.ndarray:
    """Return colours as fractions of full light."""
    return shares_of(values, np.iinfo(values.dtype).max if values.dtype.kind in "iu" else 1.0)


def _bytes(light: np.ndarray) -> tuple[int, int, int]:
    red, green, blue = from_linear(light[None])[0].tolist()
    return red, green, blue


def tinted(picture: Texture, *tint: float) -> Texture:
    """Return a picture times a colour in linear light."""
    table = np.stack([from_linear(np.repeat(_LIGHT[:, None] * share, 3, axis=1))[:, 0] for share in tint])
    return Texture(lambda: np.stack([table[k][picture.pixels[..., k]] for k in range(3)], axis=-1), picture.size)


def _shaded(
    picture: Texture, places: Float32[np.ndarray, "F 3 2"], light: Float64[np.ndarray, "F 3 3"]
) -> Texture | None:
    """Return a picture times the light of corners; None where faces of other light share its texels."""
    from PIL import Image

    height, width = (side * max(1, _FINE // max(picture.shape)) for side in picture.shape)
    rows, columns = min(height, _COARSE), min(width, _COARSE)
    shade = light_in_picture(places, light, rows, columns)
    if shade is None:
        return None

    def pixels() -> UInt8[np.ndarray, "H W 3"]:
        image = Image.fromarray(np.ascontiguousarray(picture.pixels)).resize((width, height), Image.Resampling.BILINEAR)
        lit = shade[:, np.arange(width) * columns // width]
        return np.stack([from_linear(_LIGHT[row] * lit[k * rows // height]) for k, row in enumerate(np.asarray(image))])

    return Texture(pixels, (height, width))


def _triangles(corners: Int64[np.ndarray, " C"], mode: int) -> Int64[np.ndarray, "F 3"]:
    """Return the triangles of a list, a strip or a fan of corners (glTF 2.0, section 3.7.2.1)."""
    if mode == _STRIP:
        count = max(0, len(corners) - 2)
        strip = np.stack([corners[k : k + count] for k in range(3)], axis=1)
        strip[1::2, :2] = strip[1::2, 1::-1]
        return strip
    if mode == _FAN:
        return np.stack([np.repeat(corners[:1], max(0, len(corners) - 2)), corners[1:-1], corners[2:]], axis=1)
    return corners[: len(corners) // 3 * 3].reshape(-1, 3)


def _placed(move: np.ndarray, turn: np.ndarray, size: np.ndarray) -> Matrix:
    """Return the matrix of a translation, a rotation (a quaternion x, y, z, w) and a scale."""
    x, y, z, w = turn / (np.linalg.norm(turn) or 1.0)
    matrix = np.eye(4)
    matrix[:3, 3] = move
    matrix[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    matrix[:3, :3] *= size
    return matrix


def _put(part: _Part, matrix: Matrix) -> _Part:
    """Return a part in its place; one without rotation or scale is moved without a matrix product."""
    turn = matrix[:3, :3]
    local = part.vertices if np.array_equal(turn, np.eye(3)) else part.vertices @ turn.T
    faces = part.faces[:, ::-1] if np.linalg.det(turn) < 0 else part.faces
    return _Part(local + matrix[:3, 3], faces, part.colors, part.uv, part.look)


def _used(part: _Part) -> _Part:
    """Return a part without vertices that its faces do not use: those of primitives that share an array."""
    count = len(part.vertices)
    chosen = np.zeros(count, bool)
    chosen[part.faces[(part.faces >= 0) & (part.faces < count)]] = True
    if chosen.all() or not len(part.faces) or (part.faces >= count).any():  # which `checked` refuses
        return part
    colors, uv = (None if values is None else values[chosen] for values in (part.colors, part.uv))
    return _Part(part.vertices[chosen], (np.cumsum(chosen) - 1)[part.faces], colors, uv, part.look)


def _skinned(
    vertices: Float64[np.ndarray, "V 3"], joints: Float64[np.ndarray, "J 4 4"], read: Callable[[str], np.ndarray | None]
) -> Float64[np.ndarray, "V 3"]:
    """Return vertices as their joints move them (glTF 2.0, section 3.7.3.3)."""
    moved, total, number = np.zeros_like(vertices), np.zeros(len(vertices)), 0
    whole = np.concatenate([vertices, np.ones((len(vertices), 1))], axis=1)
    while (at := read(f"JOINTS_{number}")) is not None and (shares := read(f"WEIGHTS_{number}")) is not None:
        for joint, share in zip(at.T.astype(np.int64), shares.T.astype(np.float64), strict=True):
            total += share
            moved += share[:, None] * np.einsum("vij,vj->vi", joints[joint, :3], whole)
        number += 1
    return np.where(total[:, None] > 0, moved / np.maximum(total, 1e-30)[:, None], vertices)


def _between(times: np.ndarray, rows: np.ndarray, how: str, time: float, is_turn: bool) -> np.ndarray:
    """Return the value of an animation at a time (glTF 2.0, appendix C)."""
    time = float(np.float32(time))  # as times of keys are
    k = int(np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 1))
    middle = rows.shape[1] // 2  # of a spline, between its tangents
    if k == len(times) - 1 or time <= times[k] or how == "STEP":
        return rows[k, middle]
    step = times[k + 1] - times[k]
    share = (time - times[k]) / step
    before, after = rows[k, middle], rows[k + 1, middle]
    if how == "CUBICSPLINE":
        t, t2, t3 = share, share**2, share**3
        value = (2 * t3 - 3 * t2 + 1) * before + (t3 - 2 * t2 + t) * step * rows[k, 2]
        return value + (3 * t2 - 2 * t3) * after + (t3 - t2) * step * rows[k + 1, 0]
    if is_turn:
        cosine = float(before @ after)
        after, angle = (after, np.arccos(min(cosine, 1.0))) if cosine >= 0 else (-after, np.arccos(min(-cosine, 1.0)))
        if angle > 1e-6:
            return (np.sin((1 - share) * angle) * before + np.sin(share * angle) * after) / np.sin(angle)
    return before + share * (after - before)
