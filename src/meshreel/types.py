"""The vocabulary of the package: meshes, sequences of meshes, placements and up axes.

Coordinates are float64 in memory, so that geo-referenced captures (around 1e6) keep their millimetres.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, get_args, runtime_checkable

import numpy as np

from .errors import InputError
from .shapes import Bool, Float32, Float64, Int32, Int64, UInt8

if TYPE_CHECKING:
    import trimesh

Up = Literal["y", "z", "-y", "-z"]  # the axis of a recording that points up
UPS: tuple[Up, ...] = get_args(Up)
UP_AXES = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0), "-y": (0.0, -1.0, 0.0), "-z": (0.0, 0.0, -1.0)}
UPRIGHT: dict[Up, list[list[int]]] = {  # rotations that turn an axis to +y
    "y": [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    "z": [[1, 0, 0], [0, 0, 1], [0, -1, 0]],
    "-y": [[1, 0, 0], [0, -1, 0], [0, 0, -1]],
    "-z": [[1, 0, 0], [0, 0, -1], [0, 1, 0]],
}
LUMA = (0.2126, 0.7152, 0.0722)  # of red, green and blue (ITU-R BT.709)
GREY = 128  # red, green and blue of a surface without colours beside one with colours


@dataclass(frozen=True, slots=True)
class Texture:
    """A picture in sRGB, decoded when its pixels are read, which raises InputError if its file cannot be used."""

    read: Callable[[], UInt8[np.ndarray, "H W 3"]] = field(repr=False)
    size: tuple[int, int] | None = None  # rows and columns, if known before the picture is decoded

    @staticmethod
    def of(pixels: UInt8[np.ndarray, "H W 3"]) -> Texture:
        """Return the texture of a picture in memory."""
        return Texture(partial(np.asarray, pixels), (pixels.shape[0], pixels.shape[1]))

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the picture."""
        if self.size is not None:
            return self.size
        rows, columns = self.pixels.shape[:2]
        return rows, columns

    @property
    def pixels(self) -> UInt8[np.ndarray, "H W 3"]:
        """The picture, top row first."""
        return self.read()


@dataclass(frozen=True, slots=True)
class Audio:
    """An audio file that belongs to frames, unchanged."""

    data: bytes = field(repr=False)
    media_type: str  # as audio/ogg
    start: float  # s after the first frame; below 0: its beginning is skipped


@dataclass(frozen=True, slots=True, repr=False)
class Mesh:
    """A triangle mesh, which may have no faces and no vertices (an empty frame), and may have colours.

    The arrays of the parts of a decoded frame are read-only; those of whole frames and of `copy()` are not.
    """

    vertices: Float64[np.ndarray, "V 3"]  # m, right-handed
    faces: Int32[np.ndarray, "F 3"]  # counter-clockwise from outside
    colors: UInt8[np.ndarray, "V 3"] | None = None  # red, green, blue of the vertices, sRGB
    # Places of the faces' corners in the texture, whose lower left corner is (0, 0) and upper right one (1, 1).
    uv: Float32[np.ndarray, "F 3 2"] | None = None
    texture: Texture | None = None

    _repr_png_: ClassVar[Callable[[Mesh], bytes | None]]  # for notebooks; the package sets it

    @staticmethod
    def of(vertices: object, faces: object) -> Mesh:
        """Return a mesh of array-likes, converted to contiguous arrays of the annotated dtypes."""
        v = np.ascontiguousarray(np.asarray(vertices, dtype=np.float64).reshape(-1, 3))
        f = np.ascontiguousarray(np.asarray(faces, dtype=np.int32).reshape(-1, 3))
        return Mesh(v, f)

    @staticmethod
    def empty() -> Mesh:
        """Return a mesh with no vertices and no faces."""
        return Mesh.of(np.zeros((0, 3)), np.zeros((0, 3)))

    @property
    def is_colored(self) -> bool:
        """True if the mesh has colours of its vertices or a texture."""
        return self.colors is not None or (self.uv is not None and self.texture is not None)

    def at(self, vertices: Float64[np.ndarray, "V 3"]) -> Mesh:
        """Return the same surface, colours included, with new positions of its vertices."""
        return replace(self, vertices=vertices)

    def left(
        self,
        vertices: Float64[np.ndarray, "W 3"],
        faces: Int32[np.ndarray, "G 3"],
        vertex_origins: Int32[np.ndarray, " W"],
        face_origins: Int32[np.ndarray, " G"],
    ) -> Mesh:
        """Return a reduced mesh with this mesh's colours; `*_origins` are its vertices' and faces' numbers here."""
        colors = None if self.colors is None else self.colors[vertex_origins]
        uv = None if self.uv is None else self.uv[face_origins]
        return Mesh(vertices, faces, colors, uv, self.texture)

    def with_faces(self, chosen: Bool[np.ndarray, " F"]) -> Mesh:
        """Return the mesh with the chosen faces only, and all its vertices."""
        return replace(self, faces=self.faces[chosen], uv=None if self.uv is None else self.uv[chosen])

    @property
    def is_empty(self) -> bool:
        """True if the mesh has no faces."""
        return len(self.faces) == 0

    @property
    def diagonal(self) -> float:
        """Length of the diagonal of the bounding box, m; 0 for a mesh without vertices."""
        if len(self.vertices) == 0:
            return 0.0
        low, high = self.box
        return float(np.sqrt(np.square(high - low).sum()))  # not BLAS, whose bits vary

    @property
    def box(self) -> tuple[Float64[np.ndarray, "3"], Float64[np.ndarray, "3"]]:
        """Lower and upper corner of the bounding box, m, of a mesh with vertices."""
        axes = self.vertices.T  # axis by axis: NumPy takes ten times as long for rows of 3
        return np.array([axis.min() for axis in axes]), np.array([axis.max() for axis in axes])

    @property
    def middle(self) -> Float64[np.ndarray, "3"]:
        """Middle of the bounding box, m; 0 for a mesh without vertices."""
        if len(self.vertices) == 0:
            return np.zeros(3)
        low, high = self.box
        return (low + high) / 2

    def copy(self) -> Mesh:
        """Return the same mesh in new, writable arrays."""
        colors = None if self.colors is None else self.colors.copy()
        uv = None if self.uv is None else self.uv.copy()
        return Mesh(self.vertices.copy(), self.faces.copy(), colors, uv, self.texture)

    def __repr__(self) -> str:
        facts = [f"{len(self.vertices)} vertices", f"{len(self.faces)} faces"]
        if len(self.vertices):
            low, high = self.box
            facts += [" x ".join(f"{size:.3g}" for size in high - low) + " m"]
        facts += [name for name, given in (("colours", self.colors), ("texture", self.texture)) if given is not None]
        return f"<meshreel.Mesh: {', '.join(facts)}>"

    def to_trimesh(self) -> trimesh.Trimesh:
        """Return a copy as a `trimesh.Trimesh` with its colours, or its texture.

        It has the same vertices in the same order; with a texture, one for each place that a vertex has in it. Raises
        ImportError without trimesh.
        """
        try:
            import trimesh
        except ImportError as error:
            raise ImportError("Mesh.to_trimesh needs the extra `encode`: pip install 'meshreel[encode]'") from error
        mesh = self.copy()
        if mesh.uv is None or mesh.texture is None:
            return trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colors, process=False)
        from PIL import Image

        origins, faces, uv = cut_at_seams(mesh.faces, mesh.uv)
        material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(mesh.texture.pixels))
        visual = trimesh.visual.TextureVisuals(uv=np.nan_to_num(uv), material=material)
        return trimesh.Trimesh(mesh.vertices[origins], faces, visual=visual, process=False)

    def to_pyvista(self) -> Any:
        """Return a copy as a `pyvista.PolyData`: its colours as the point data `RGB`, or places in its texture.

        The texture is `pyvista.Texture(mesh.texture.pixels)`; a vertex is then there for each of its places. Raises
        ImportError without pyvista.
        """
        try:
            import pyvista
        except ImportError as error:
            raise ImportError("Mesh.to_pyvista needs the package pyvista: pip install pyvista") from error
        mesh = self.copy()
        if mesh.uv is not None and mesh.texture is not None:
            origins, faces, uv = cut_at_seams(mesh.faces, mesh.uv)
            surface = pyvista.PolyData.from_regular_faces(mesh.vertices[origins], faces)
            surface.active_texture_coordinates = np.nan_to_num(uv)
            return surface
        surface = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
        if mesh.colors is not None:
            surface.point_data["RGB"] = mesh.colors
        return surface

    def to_open3d(self) -> Any:
        """Return a copy as an `open3d.geometry.TriangleMesh` with its colours and texture.

        Raises ImportError without Open3D.
        """
        try:
            import open3d
        except ImportError as error:
            raise ImportError("Mesh.to_open3d needs the extra `open3d`: pip install 'meshreel[open3d]'") from error
        mesh, utility = self.copy(), open3d.utility  # it refuses read-only arrays
        surface = open3d.geometry.TriangleMesh(
            utility.Vector3dVector(mesh.vertices), utility.Vector3iVector(mesh.faces)
        )
        if mesh.colors is not None:
            surface.vertex_colors = utility.Vector3dVector(mesh.colors / 255.0)
        if mesh.uv is not None and mesh.texture is not None:
            surface.triangle_uvs = utility.Vector2dVector(np.nan_to_num(mesh.uv).astype(np.float64).reshape(-1, 2))
            surface.triangle_material_ids = utility.IntVector(np.zeros(len(mesh.faces), np.int32))
            # It has the lowest row of a picture first.
            rows: Any = np.ascontiguousarray(mesh.texture.pixels[::-1])
            surface.textures = [open3d.geometry.Image(rows)]
        return surface


def distinct_places(uv: Float32[np.ndarray, "F 3 2"]) -> tuple[Float32[np.ndarray, "P 2"], Int64[np.ndarray, "F 3"]]:
    """Return the distinct places in a texture, and the number of each corner's place; NaN is a place, too."""
    pairs = np.ascontiguousarray(uv).reshape(-1, 2).view(np.int64)  # places with equal bits are equal
    places, numbers = np.unique(pairs, return_inverse=True)
    return places.view(np.float32).reshape(-1, 2), numbers.reshape(-1, 3).astype(np.int64)


def cut_at_seams(
    faces: Int32[np.ndarray, "F 3"], uv: Float32[np.ndarray, "F 3 2"]
) -> tuple[Int64[np.ndarray, " W"], Int32[np.ndarray, "F 3"], Float32[np.ndarray, "W 2"]]:
    """Return vertices' numbers, faces, and one texture coordinate for each vertex, as GPUs need them.

    A vertex is repeated for each place of its corners; a vertex without a face is left out.
    """
    places, numbers = distinct_places(uv)
    codes, corners = np.unique(faces * np.int64(len(places)) + numbers, return_inverse=True)
    origins, place = np.divmod(codes, max(len(places), 1))
    return origins, corners.reshape(-1, 3).astype(np.int32), places[place]


@dataclass(frozen=True, slots=True)
class Placement:
    """Map from normalised coordinates to metres: origin + scale x coordinate."""

    scale: float  # m
    origin: tuple[float, ...]  # m, three

    def of(self, mesh: Mesh) -> Mesh:
        """Return a mesh of normalised coordinates in metres."""
        return mesh.at(np.asarray(self.origin) + self.scale * mesh.vertices)


@runtime_checkable
class Frames(Protocol):
    """Meshes by frame number: a list, or an object that reads or computes each mesh on access.

    Classes that inherit from it get iteration from `len` and `frames[i]`.
    """

    def __len__(self) -> int: ...

    def __getitem__(self, index: int) -> Mesh: ...

    def __iter__(self) -> Iterator[Mesh]:
        return (self[index] for index in range(len(self)))


def offset(number: int, numbers: range) -> int:
    """Return the offset of a frame in a range. Raises IndexError outside it, where a list would take -1 as its last."""
    if not numbers.start <= number < numbers.stop:
        raise IndexError(f"frame {number}: there are frames {numbers.start} to {numbers.stop - 1}")
    return number - numbers.start


def evenly(count: int, most: int) -> list[int]:
    """Return at most `most` of the frame numbers 0 to `count` - 1, in order, evenly spread from first to last."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, most))})


@runtime_checkable
class MeshSequence(Frames, Protocol):
    """Frames with a frame rate, accessed one at a time, so that they need not all be in memory."""

    @property
    def frame_rate(self) -> float:
        """Frames per second, 1/s."""

    def __repr__(self) -> str:
        return f"<meshreel.{type(self).__name__}: {len(self)} frames, {self.frame_rate:g} frames/s>"


@dataclass(frozen=True, slots=True, repr=False)
class MeshList(MeshSequence):
    """A MeshSequence of meshes in memory."""

    is_shared: ClassVar[bool] = True  # threads may read it at the same time

    meshes: tuple[Mesh, ...]
    frame_rate: float = 30.0  # 1/s
    up: Up = "y"  # the axis that points up

    def __len__(self) -> int:
        return len(self.meshes)

    def __getitem__(self, index: int) -> Mesh:
        return self.meshes[index]


@dataclass(frozen=True, slots=True)
class Centers:
    """Tracked volume centers of a group of frames (paper, section 3.1)."""

    positions: Float64[np.ndarray, "T K 3"]  # in units of the sequence's bounding-box diagonal
    bodies: Int32[np.ndarray, " K"]  # number of each center's connected body in the first frame

    def __len__(self) -> int:
        return len(self.positions)


def check_up(axis: str) -> None:
    """Raise InputError if `axis` is not in UP_AXES."""
    if axis not in UP_AXES:
        raise InputError(f"up axis {axis!r}: give {', '.join(UP_AXES)}")


def known_up(axis: object) -> Up:
    """Return `axis` if it is in UP_AXES, otherwise y, the default of players and of glTF."""
    return next((up for up in UPS if up == axis), "y")
