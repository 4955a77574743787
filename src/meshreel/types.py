"""The vocabulary of the package: meshes, sequences of meshes, placements and up axes.

Coordinates are float64 in memory, so that geo-referenced captures (around 1e6) keep their millimetres.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, get_args, runtime_checkable

import numpy as np

from .errors import InputError
from .shapes import Bool, Float32, Float64, Int32, UInt8

if TYPE_CHECKING:
    import trimesh

Up = Literal["y", "z", "-y", "-z"]  # the axis of a recording that points up
UPS: tuple[Up, ...] = get_args(Up)
UP_AXES = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0), "-y": (0.0, -1.0, 0.0), "-z": (0.0, 0.0, -1.0)}
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
        """Return a copy as a `trimesh.Trimesh`, with the same vertices in the same order and their colours.

        Raises ImportError without trimesh.
        """
        try:
            import trimesh
        except ImportError as error:
            raise ImportError("Mesh.to_trimesh needs the extra `encode`: pip install 'meshreel[encode]'") from error
        mesh = self.copy()
        return trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colors, process=False)

    def to_pyvista(self) -> Any:
        """Return a copy as a `pyvista.PolyData`, its colours as the point data `RGB`. Raises ImportError without it."""
        try:
            import pyvista
        except ImportError as error:
            raise ImportError("Mesh.to_pyvista needs the package pyvista: pip install pyvista") from error
        mesh = self.copy()
        surface = pyvista.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
        if mesh.colors is not None:
            surface.point_data["RGB"] = mesh.colors
        return surface

    def to_open3d(self) -> Any:
        """Return a copy as an `open3d.geometry.TriangleMesh`. Raises ImportError without Open3D."""
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
        return surface


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

    meshes: tuple[Mesh, ...]
    frame_rate: float = 30.0  # 1/s
    up: Up = "y"  # the axis that points up

    def __len__(self) -> int:
        return len(self.meshes)

    def __getitem__(self, index: int) -> Mesh:
        return self.meshes[index]


def as_sequence(value: object, frame_rate: float | None = None) -> MeshSequence:
    """Return `value` if it is a MeshSequence, otherwise a MeshList of its items at `frame_rate` (1/s).

    An item is a Mesh, a mesh or scene of trimesh, a mesh of Open3D, a frame of Open4D, or a pair of arrays (vertices,
    faces). Colours of vertices are kept. The default of `frame_rate` is the attribute `fps` of `value`, which Open4D's
    sequences have, or 30. Raises InputError for any other value; the message names the frame.
    """
    if isinstance(value, MeshSequence):
        return value
    if isinstance(value, str | bytes) or not isinstance(value, Iterable):
        remedy = "give a list of meshes, or meshreel.open_sequence(path)"
        raise InputError(f"{type(value).__name__} {str(value)[:60]!r} is no sequence of meshes; {remedy}")
    rate = float(getattr(value, "fps", None) or 30.0) if frame_rate is None else frame_rate
    return MeshList(tuple(_as_mesh(item, f"frame {number}") for number, item in enumerate(value)), rate)


def _as_mesh(item: object, where: str) -> Mesh:
    if isinstance(item, Mesh):
        return item
    if hasattr(item, "to_mesh"):  # a scene of trimesh: all its meshes, in their places
        item = item.to_mesh()
    item = getattr(item, "geometry", item)  # of a frame of Open4D
    faces = getattr(item, "faces", getattr(item, "triangles", None))
    vertices = getattr(item, "vertices", getattr(item, "positions", None))
    pair = item if isinstance(item, tuple | list) else (vertices, faces)
    if len(pair) != 2 or pair[0] is None or pair[1] is None:
        remedy = "give a Mesh, a trimesh or Open3D mesh, or a pair (vertices, faces)"
        raise InputError(f"{where}: {type(item).__name__} {str(item)[:60]!r} is no mesh; {remedy}")
    vertices, corners = _rows_of_three(pair[0], f"{where}: vertices"), _rows_of_three(pair[1], f"{where}: faces")
    if corners.size and corners.dtype.kind not in "iu":
        raise InputError(f"{where}: faces are {corners.dtype}; give integers, the numbers of vertices")
    if corners.size and not 0 <= corners.min() <= corners.max() < len(vertices):
        wrong = corners.min() if corners.min() < 0 else corners.max()
        raise InputError(f"{where}: a face refers to vertex {wrong}, but there are {len(vertices)} (from 0)")
    return replace(Mesh.of(vertices, corners), colors=_colors_of(item, len(vertices), where))


def _colors_of(item: object, count: int, where: str) -> UInt8[np.ndarray, "V 3"] | None:
    """Return colours of vertices: those of trimesh are bytes, those of Open3D and Open4D fractions of 1."""
    visual = getattr(item, "visual", None)
    attribute = getattr(item, "vertex_colors", getattr(item, "colors", ()))
    colors = np.asarray(attribute if visual is None else visual.vertex_colors if visual.kind == "vertex" else ())
    if colors.size == 0 or colors.dtype == object:
        return None
    if colors.ndim != 2 or colors.shape[0] != count or colors.shape[1] not in (3, 4):
        raise InputError(f"{where}: colours of shape {colors.shape}; give {count} x 3, one of each vertex")
    colors, most = colors[:, :3], 1 if colors.dtype.kind == "f" else 255
    if not (valid := (colors >= -most) & (colors <= 2 * most)).all():  # blended colours exceed the range a little
        raise InputError(f"{where}: a colour has the value {colors[~valid][0]:g}; give fractions of 1, or bytes")
    return np.ascontiguousarray((np.clip(colors, 0, most) * (255 / most)).round(), np.uint8)


def _rows_of_three(values: object, what: str) -> np.ndarray:
    try:
        array = np.asarray(values)
    except ValueError as error:
        raise InputError(f"{what} are no array ({error}); give one of N x 3 numbers") from None
    if array.size and (array.ndim != 2 or array.shape[1] != 3 or array.dtype.kind not in "fiu"):
        raise InputError(f"{what} are {array.dtype} of shape {array.shape}; give N x 3 numbers")
    return array.reshape(-1, 3)


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
