"""Types of the compiled core (core/python/bind_*.cpp)."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Float, Float32, Float64, Int32, Int64, UInt8

# bind_decoder.cpp

Arrays: TypeAlias = tuple[
    Float64[np.ndarray, "V 3"],
    Int32[np.ndarray, "F 3"],
    UInt8[np.ndarray, "V 3"] | None,
    Float32[np.ndarray, "F 3 2"] | None,
]  # vertices, faces, colours and places of a mesh, read-only
Place: TypeAlias = tuple[float, tuple[float, float, float]]  # scale and origin

class GroupState:
    @property
    def levels(self) -> int: ...
    def nbytes_beyond(self, before: GroupState | None) -> int: ...

class AtlasLayout:
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...

class Group:
    def __init__(
        self,
        data: bytes,
        frames: int,
        layers: int | None,
        previous: GroupState | None,
        place: Place,
        shown: bool = True,
    ) -> None: ...
    @property
    def state(self) -> GroupState | None: ...
    @property
    def nbytes(self) -> int: ...
    @property
    def vertices(self) -> int: ...
    def paint(self, data: bytes) -> None: ...
    def place(self, layout: AtlasLayout) -> None: ...
    def turn(self, rotation: Sequence[float], origin: Sequence[float]) -> None: ...
    def frames(self) -> list[Arrays]: ...

class Background:
    def __init__(self, data: bytes, before: Background | None, place: Place) -> None: ...
    def paint(self, data: bytes) -> None: ...
    def place(self, layout: AtlasLayout) -> None: ...
    def arrays(self) -> Arrays: ...

class Splats:
    def bind(
        self, group: Group, frame: int, unit: float
    ) -> (
        tuple[
            Float64[np.ndarray, "N 3"],
            Float64[np.ndarray, "N 3 3"],
            Float64[np.ndarray, "N 3"],
            Float64[np.ndarray, " N"],
            Float64[np.ndarray, "N 3"],
        ]
        | None
    ): ...

def read_atlas(data: bytes, owner: bytes) -> AtlasLayout: ...
def read_splats(data: bytes, owner: bytes) -> Splats: ...

# bind_draco.cpp

def check_draco(meshes: list[bytes]) -> None: ...

# bind_dense.cpp

def products(a: Float64[np.ndarray, "N r k"], b: Float64[np.ndarray, "N k c"]) -> Float64[np.ndarray, "N r c"]: ...
def inverses(matrices: Float64[np.ndarray, "N n n"]) -> Float64[np.ndarray, "N n n"]: ...
def eigen(
    matrices: Float64[np.ndarray, "N n n"],
) -> tuple[Float64[np.ndarray, "N n"], Float64[np.ndarray, "N n n"]]: ...
def exp(x: Float64[np.ndarray, " N"]) -> Float64[np.ndarray, " N"]: ...
def log2(x: Float64[np.ndarray, " N"]) -> Float64[np.ndarray, " N"]: ...
def angle(y: Float64[np.ndarray, " N"], x: Float64[np.ndarray, " N"]) -> Float64[np.ndarray, " N"]: ...

# bind_entropy.cpp

def encode_weights(
    columns: Int32[np.ndarray, "C V"], starts: Int64[np.ndarray, " V+1"], indices: Int32[np.ndarray, " N"]
) -> list[bytes]: ...
def decode_weights(
    data: bytes,
    sizes: Int64[np.ndarray, " C"],
    columns: Int32[np.ndarray, "C V"],
    starts: Int64[np.ndarray, " V+1"],
    indices: Int32[np.ndarray, " N"],
) -> int: ...
def weight_contexts(
    columns: Int32[np.ndarray, "C V"],
    starts: Int64[np.ndarray, " V+1"],
    indices: Int32[np.ndarray, " N"],
    classes: UInt8[np.ndarray, "C V"],
    signs: UInt8[np.ndarray, "C V"],
) -> None: ...
def encode_integers(values: Int32[np.ndarray, " N"]) -> bytes: ...
def decode_integers(data: bytes, values: Int32[np.ndarray, " N"]) -> bool: ...

# bind_laplacian.cpp

class Laplacian:
    def __init__(
        self,
        vertices: Float64[np.ndarray, "V 3"],
        faces: Int32[np.ndarray, "F 3"],
        anchors: Int32[np.ndarray, " A"],
        anchor_weight: float,
    ) -> None: ...
    def weights(
        self,
    ) -> tuple[Int32[np.ndarray, " N"], Int32[np.ndarray, " N"], Float64[np.ndarray, " N"]]: ...
    def forward(self, weights: Float64[np.ndarray, "V M"]) -> Float64[np.ndarray, "V+A M"]: ...
    def inverse(self, deltas: Float64[np.ndarray, "V+A M"]) -> Float64[np.ndarray, "V M"]: ...
    def quantize(
        self,
        deltas: Float64[np.ndarray, "V+A M"],
        steps: Float64[np.ndarray, " M"],
        prices: Float64[np.ndarray, " M"],
    ) -> Int32[np.ndarray, "V+A M"]: ...

def farthest_anchors(faces: Int32[np.ndarray, "F 3"], vertices: int, count: int) -> Int32[np.ndarray, " A"]: ...
def klt_inverse(
    weights: Float64[np.ndarray, "V M"], vectors: Float64[np.ndarray, "M 3T"], mean: Float64[np.ndarray, " 3T"]
) -> Float64[np.ndarray, "V 3T"]: ...

# bind_reading.cpp

def split_lines(
    text: UInt8[np.ndarray, " B"], comment: str
) -> tuple[Int64[np.ndarray, " N"], Int64[np.ndarray, " N"]]: ...
def read_numbers(
    text: UInt8[np.ndarray, " B"], starts: Int64[np.ndarray, " N"], ends: Int64[np.ndarray, " N"], stop: str, field: int
) -> tuple[Float64[np.ndarray, " M"], Int32[np.ndarray, " N"], int]: ...
def read_lists(
    data: UInt8[np.ndarray, " B"], fields: Int64[np.ndarray, "P 2"], count: int, wanted: int, big_endian: bool
) -> tuple[UInt8[np.ndarray, " M"], Int64[np.ndarray, " N"], int, int]: ...

# bind_topology.cpp

_Rest: TypeAlias = tuple[
    Float64[np.ndarray, "W 3"], Int32[np.ndarray, "G 3"], Int32[np.ndarray, " W"], Int32[np.ndarray, " G"]
]  # vertices and faces that are left, and the number that each had

def weld(vertices: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"]) -> _Rest: ...
def clean(vertices: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"]) -> _Rest: ...
def drop_unreferenced(vertices: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"]) -> _Rest: ...
def decimate(
    vertices: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"], wanted: int, border: float
) -> tuple[Float64[np.ndarray, "W 3"], Int32[np.ndarray, "G 3"]]: ...
def components(faces: Int32[np.ndarray, "F 3"], vertices: int) -> Int32[np.ndarray, " V"]: ...
def blend(
    values: Float64[np.ndarray, "V 3"], corners: Int32[np.ndarray, "N 3"], weights: Float64[np.ndarray, "N 3"] | None
) -> Float64[np.ndarray, "N 3"]: ...
def face_normals(
    vertices: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"]
) -> tuple[Float64[np.ndarray, "F 3"], Float64[np.ndarray, " F"]]: ...
def vertex_normals(
    vertices: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"]
) -> Float64[np.ndarray, "V 3"]: ...
def spread(
    vertices: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"], spacing: float, most: int
) -> tuple[Float64[np.ndarray, "N 3"], Int64[np.ndarray, " N"]]: ...

# bind_tracking.cpp

def spread_centers(
    samples: Float64[np.ndarray, "N 3"],
    centers: Float64[np.ndarray, "K 3"],
    owners: Int32[np.ndarray, " N"],
    tolerance: float,
    max_rounds: int,
) -> tuple[float, int]: ...
def follow_centers(
    samples: Float64[np.ndarray, "N 3"],
    previous: Float64[np.ndarray, "K 3"],
    offsets: Int32[np.ndarray, " K+1"],
    indices: Int32[np.ndarray, " P"],
    weights: Float64[np.ndarray, " P"],
    centers: Float64[np.ndarray, "K 3"],
    rotations: Float64[np.ndarray, "K 9"],
    owners: Int32[np.ndarray, " N"],
    spread: float,
    rigidity: float,
    tolerance: float,
    max_rounds: int,
) -> tuple[float, int]: ...
def motion_differences(
    offsets: Int32[np.ndarray, " K+1"],
    indices: Int32[np.ndarray, " P"],
    rotations: Float64[np.ndarray, "K 9"],
    shifts: Float64[np.ndarray, "K 3"],
    means: Float64[np.ndarray, "K 3"],
    covariances: Float64[np.ndarray, "K 9"],
    out: Float64[np.ndarray, " P"],
) -> None: ...

# bind_layers.cpp

_Place: TypeAlias = tuple[float, tuple[float, ...]]  # scale and origin, three numbers

class Graph:
    def __init__(
        self,
        starts: Int64[np.ndarray, " V+1"],
        near: Int32[np.ndarray, " N"],
        weights: Float64[np.ndarray, " N"],
    ) -> None: ...

class Surface:
    def __init__(
        self, vectors: Float64[np.ndarray, "M C"], normals: Float64[np.ndarray, "V C"], tangential: float
    ) -> None: ...

class Level:
    def __init__(
        self,
        faces: Int32[np.ndarray, "F 3"],
        edges: Int32[np.ndarray, "E 2"],
        starts: Int64[np.ndarray, " E+1"],
        near: Int32[np.ndarray, " N"],
    ) -> None: ...

def hierarchy(
    positions: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"]
) -> tuple[Int32[np.ndarray, " V"], Int64[np.ndarray, " V+1"], Int32[np.ndarray, " N"], Float64[np.ndarray, " N"]]: ...
def predict_forward(
    values: Float64[np.ndarray, "M V"], graph: Graph, step: float, price: float
) -> tuple[Int32[np.ndarray, "M V"], Float64[np.ndarray, "M V"]]: ...
def predict_surface(
    values: Float64[np.ndarray, "M V"], graph: Graph, surface: Surface, step: float, price: float
) -> tuple[Int32[np.ndarray, "M V"], Float64[np.ndarray, "M V"]]: ...
def encode_field(symbols: Int32[np.ndarray, "M V"], graph: Graph) -> tuple[bytes, Int64[np.ndarray, " M"]]: ...
def decode_field(record: bytes, graph: Graph, width: int, head: int) -> Float64[np.ndarray, "V C"]: ...
def decode_motion(
    record: bytes, positions: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"], frames: int
) -> Float64[np.ndarray, "V 3 T"]: ...
def orthonormal_inverse(symbols: Int32[np.ndarray, " N"], count: int, width: int) -> Float64[np.ndarray, "M C"]: ...
def subdivide(
    faces: Int32[np.ndarray, "F 3"], vertices: int
) -> tuple[Int32[np.ndarray, "E 2"], Int32[np.ndarray, "4F 3"]]: ...
def siblings(
    finer: Int32[np.ndarray, "4F 3"], vertices: int, edge_count: int
) -> tuple[Int64[np.ndarray, " E+1"], Int32[np.ndarray, " N"]]: ...
def edge_frames(
    positions: Float64[np.ndarray, "V 3"],
    faces: Int32[np.ndarray, "F 3"],
    edges: Int32[np.ndarray, "E 2"],
    curvature: int,
) -> tuple[Float64[np.ndarray, "E 3"], Float64[np.ndarray, "E 3"]]: ...
def refine(
    rows: Float64[np.ndarray, "V 3 T"],
    faces: Int32[np.ndarray, "F 3"],
    edges: Int32[np.ndarray, "E 2"],
    scalars: Float64[np.ndarray, "E T"],
    curvature: int,
) -> Float64[np.ndarray, "T W 3"]: ...
def decode_level(
    record: bytes,
    level: Level,
    rows: Float64[np.ndarray, "V 3 T"],
    previous: Float64[np.ndarray, " E"] | None,
) -> tuple[Float64[np.ndarray, "W 3 T"], Float64[np.ndarray, " E"]]: ...
def decode_last_level(
    record: bytes,
    level: Level,
    rows: Float64[np.ndarray, "V 3 T"],
    previous: Float64[np.ndarray, " E"] | None,
    place: _Place | None,
    positions: Float[np.ndarray, "T W 3"],
) -> Float64[np.ndarray, " E"]: ...
def decode_colors(
    records: bytes,
    vertices: Float64[np.ndarray, "B 3"],
    faces: Int32[np.ndarray, "F 3"],
    levels: int,
    count: int,
    frames: int,
    chroma: float,
    before: Float64[np.ndarray, "V 3"] | None,
) -> tuple[UInt8[np.ndarray, "T V 3"], Float64[np.ndarray, "V 3"]]: ...
def encode_places(
    vertices: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"], places: Int32[np.ndarray, "F 3 2"]
) -> tuple[Int32[np.ndarray, " J"], Int32[np.ndarray, " S"], Int32[np.ndarray, " R"]]: ...
def decode_places(
    vertices: Float64[np.ndarray, "V 3"],
    faces: Int32[np.ndarray, "F 3"],
    joins: Int32[np.ndarray, " J"],
    starts: Int32[np.ndarray, " S"],
    rests: Int32[np.ndarray, " R"],
) -> Int32[np.ndarray, "F 3 2"]: ...
def color_values(colors: UInt8[np.ndarray, "N 3"], chroma: float) -> Float64[np.ndarray, "N 3"]: ...
def keep_faces(
    faces: Int32[np.ndarray, "F 3"], dropped: UInt8[np.ndarray, " F"], room: Int32[np.ndarray, "N 3"]
) -> int: ...

# bind_fit.cpp

class SurfaceTree:
    def __init__(self, positions: Float64[np.ndarray, "V 3"], faces: Int32[np.ndarray, "F 3"]) -> None: ...
    def move(self, positions: Float64[np.ndarray, "V 3"]) -> None: ...
    def closest(
        self,
        queries: Float64[np.ndarray, "N 3"],
        reach: float,
        guesses: Int32[np.ndarray, " N"] | None = None,
        gone: UInt8[np.ndarray, " F"] | None = None,
    ) -> tuple[Int32[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]: ...
    def cast(
        self, origins: Float64[np.ndarray, "M 3"], ways: Float64[np.ndarray, "N 3"], weighted: bool
    ) -> tuple[Int32[np.ndarray, " N"], Float64[np.ndarray, " N"], Float64[np.ndarray, "K 3"]]: ...

def draw(
    positions: Float64[np.ndarray, "V 3"],
    faces: Int32[np.ndarray, "F 3"],
    turn: Float64[np.ndarray, "3 3"],
    shift: Float64[np.ndarray, " 3"],
    lens: Float64[np.ndarray, " 4"],
    parallel: bool,
    crop: Int32[np.ndarray, " 4"],
    weighted: bool,
) -> tuple[Int32[np.ndarray, "H W"], Float64[np.ndarray, "H W"], Float64[np.ndarray, "N 3"] | None]: ...
def add_view(
    turn: Float64[np.ndarray, "3 3"],
    shift: Float64[np.ndarray, " 3"],
    eye: Float64[np.ndarray, " 3"],
    lens: Float64[np.ndarray, " 4"],
    bend: Float64[np.ndarray, " K"],
    size: Int32[np.ndarray, " 3"],
    depth: Float32[np.ndarray, "H W"],
    from_step: UInt8[np.ndarray, "H W"],
    limits: Float64[np.ndarray, " 4"],
    pixels: UInt8[np.ndarray, "R C 3"] | None,
    gains: Float64[np.ndarray, " 3"],
    points: Float64[np.ndarray, "N 3"],
    normals: Float64[np.ndarray, "N 3"],
    sums: Float64[np.ndarray, "N 3"],
    weights: Float64[np.ndarray, " N"],
) -> None: ...

class FitTarget:
    def __init__(
        self,
        tree: SurfaceTree,
        positions: Float64[np.ndarray, "V 3"],
        faces: Int32[np.ndarray, "F 3"],
        normals: Float64[np.ndarray, "V 3"],
        inside: UInt8[np.ndarray, " V"],
        points: Float64[np.ndarray, "N 3"],
        point_normals: Float64[np.ndarray, "N 3"],
        outward: Float64[np.ndarray, "N 3"],
    ) -> None: ...

class FitTemplate:
    def __init__(self, faces: Int32[np.ndarray, "F 3"], vertices: int) -> None: ...
    def fit(
        self,
        target: FitTarget,
        rest: Float64[np.ndarray, "V 3"],
        place: Float64[np.ndarray, "V 3"],
        start: Float64[np.ndarray, "V 3"],
        gates: Float64[np.ndarray, " R"],
        smoothing: Float64[np.ndarray, " R"],
        strides: Int32[np.ndarray, " R"],
        agreement: float,
        anchor: float,
        tolerance: float,
        iterations: int,
        turn: bool,
    ) -> Float64[np.ndarray, "V 3"]: ...
    def turned_laplacian(
        self, rest: Float64[np.ndarray, "V 3"], now: Float64[np.ndarray, "V 3"]
    ) -> Float64[np.ndarray, "V 3"]: ...

# bind_deform.cpp

class DeformTarget:
    def __init__(
        self,
        tree: SurfaceTree,
        positions: Float64[np.ndarray, "V 3"],
        faces: Int32[np.ndarray, "F 3"],
        normals: Float64[np.ndarray, "V 3"],
        inside: UInt8[np.ndarray, " V"],
        points: Float64[np.ndarray, "N 3"],
        point_normals: Float64[np.ndarray, "N 3"],
        spacing: float,
    ) -> None: ...

class Deformation:
    def __init__(
        self,
        nodes: Float64[np.ndarray, "N 3"],
        edges: Int32[np.ndarray, "E 2"],
        held: Float64[np.ndarray, " E"],
        points: Float64[np.ndarray, "S 3"],
        normals: Float64[np.ndarray, "S 3"],
        bound: Int32[np.ndarray, "S k"],
        weights: Float64[np.ndarray, "S k"],
    ) -> None: ...
    def deform(
        self,
        frame: DeformTarget,
        rotations: Float64[np.ndarray, "N 3 3"],
        positions: Float64[np.ndarray, "N 3"],
        gates: Float64[np.ndarray, " R"],
        rigidity: Float64[np.ndarray, " R"],
        torn: float,
        place: float,
        agreement: float,
        tolerance: float,
        iterations: int,
    ) -> tuple[Float64[np.ndarray, "N 3 3"], Float64[np.ndarray, "N 3"]]: ...
    def matched(
        self,
        frame: DeformTarget,
        rotations: Float64[np.ndarray, "N 3 3"],
        positions: Float64[np.ndarray, "N 3"],
        gate: float,
        agreement: float,
    ) -> float: ...
    def holds(
        self, rotations: Float64[np.ndarray, "N 3 3"], positions: Float64[np.ndarray, "N 3"], torn: float
    ) -> Float64[np.ndarray, " E"]: ...

def touched_blocks(
    depths: Float32[np.ndarray, "H W"],
    projection: Float64[np.ndarray, "3 4"],
    ways: Float64[np.ndarray, "3 3"],
    eye: Float64[np.ndarray, " 3"],
    voxel: float,
    reach: float,
) -> Int32[np.ndarray, "B 3"]: ...
def integrate(
    depths: Float32[np.ndarray, "H W"],
    projection: Float64[np.ndarray, "3 4"],
    ways: Float64[np.ndarray, "3 3"],
    eye: Float64[np.ndarray, " 3"],
    voxel: float,
    reach: float,
    blocks: Int32[np.ndarray, "B 3"],
    distances: Float32[np.ndarray, "B 8 8 8"],
    weights: Float32[np.ndarray, "B 8 8 8"],
) -> None: ...
def point_distances(
    points: Float64[np.ndarray, "N 3"],
    normals: Float64[np.ndarray, "N 3"],
    voxel: float,
    radius: float,
    past: float,
    blocks: Int32[np.ndarray, "B 3"],
    distances: Float32[np.ndarray, "B 8 8 8"],
    weights: Float32[np.ndarray, "B 8 8 8"],
) -> None: ...
def zero_level(
    blocks: Int32[np.ndarray, "B 3"],
    distances: Float32[np.ndarray, "B 8 8 8"],
    weights: Float32[np.ndarray, "B 8 8 8"],
    voxel: float,
    least: float,
) -> tuple[Float64[np.ndarray, "V 3"], Int32[np.ndarray, "F 3"]]: ...
