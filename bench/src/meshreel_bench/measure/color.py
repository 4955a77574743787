"""Colours of decoded frames beside pictures of the same moments and the truth, their swimming, and their bytes."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float64, Int32, Int64

from meshreel.capture.simulated.simulated_rig import SceneFrame, shade_of
from meshreel.coding.group import payload_bytes_by_purpose
from meshreel.container.reader import ReelReader
from meshreel.decoder.video import Video
from meshreel.format.layout import ChunkKind, Form, Pictures
from meshreel.format.records import unpack_all
from meshreel.geometry.closest_points import Surface
from meshreel.geometry.color_views import ColorPicture, ColorViews, Painted
from meshreel.geometry.topology import blend, border_edges, face_normals
from meshreel.metrics.color import PEAK, POINTS, TO_YUV, Colored, psnr
from meshreel.metrics.surface_samples import scatter
from meshreel.types import Mesh, MeshSequence

from ..datasets.walker import TrueLuma
from ..rows import ColorBytes

BEFORE = 0.015  # of the depth: what is nearer than what stands by more is something else (guess)
HALO = 6  # pixels around what moves that do not count as standing: its depth goes beyond its picture (living_room)
EDGE = 2  # pixels from silhouettes that do not count: pictures are registered to depth within as many (living_room)
TEXELS = 60_000  # of a frame that are compared with the truth, at most (guess)
DARK = 60  # levels of 255: what is darker at an open edge was taken from beyond it; nothing in the rooms is so dark
ALIKE = 12  # levels of 255 within which a colour is the true one: the noise of cameras and what coding loses (guess)
PLACES = 8_000  # of a frame's part that are compared with the truth, at most (guess)
AROUND = 12  # places within a pixel of one, whose colours its pixel may have (guess)
PARTS = ("picture_y_psnr", "picture_still_y_psnr", "picture_moving_y_psnr")  # all that is seen, what stands, what moves


def picture_squares(picture: ColorPicture, original: Mesh, decoded: Mesh, still: int) -> Float64[np.ndarray, "3 2"]:
    """Return sums of squared differences of luma and of pixels for each of `PARTS`; the first `still` faces stand.

    Where the original has something before what stands, the decoded mesh lacks what moves.
    """
    from scipy.ndimage import binary_dilation, binary_erosion

    shown, wanted = (Colored(mesh).look(picture.camera) for mesh in (decoded, original))
    near, far = (np.full(view.covered.shape, np.inf) for view in (wanted, shown))
    near[wanted.covered], far[shown.covered] = wanted.places.depth, shown.places.depth
    still_here = shown.covered.copy()
    still_here[still_here] = shown.places.faces < still
    still_here &= near >= (1 - BEFORE) * far
    apart = np.square(PEAK * shown.colors.astype(np.float64) @ TO_YUV[0] - picture.pixels @ TO_YUV[0])
    both = shown.covered & wanted.covered
    stands, moves = (binary_erosion(mask & both, iterations=EDGE) for mask in (still_here, ~still_here))
    stands &= ~binary_dilation(moves, iterations=EDGE + HALO)
    return np.array([[apart[mask].sum(), mask.sum()] for mask in (stands | moves, stands, moves)])


def picture_psnrs(found: Iterable[Float64[np.ndarray, "3 2"]]) -> dict[str, float]:
    """Return the PSNR of luma of each part that is seen, over all pixels of all pictures."""
    total = sum(found, np.zeros((3, 2))).tolist()
    return {name: psnr(square / count) for name, (square, count) in zip(PARTS, total, strict=True) if count}


def texel_products(truth: TrueLuma, number: int, decoded: Mesh) -> Float64[np.ndarray, " 4"]:
    """Return the number of texels of a frame that cameras see, and the sums of their luma's products with the truth's.

    These are of luma and itself, luma and truth, truth and itself. No product where the frame has no texture.
    """
    if decoded.texture is None or decoded.uv is None or decoded.is_empty:
        return np.zeros(4)
    faces, weights = _texels(decoded, TEXELS)
    true, seen = truth(number, blend(decoded.vertices, decoded.faces[faces], weights))
    shown, true = (Painted(decoded).on(faces, weights) @ TO_YUV[0])[seen], true[seen]
    return np.array([len(true), shown @ shown, shown @ true, true @ true])


def _texels(decoded: Mesh, most: int) -> tuple[Int32[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
    """Return faces and weights of places spread over a mesh, moved to the middles of their texels; where a face has no
    texel's middle, or no place in a texture beside others, none.
    """
    some = scatter(decoded, np.ones(len(decoded.faces), bool), most)
    if decoded.texture is None or decoded.uv is None:
        return some.faces.astype(np.int32), some.barycentric
    size = np.array(decoded.texture.pixels.shape[1::-1])
    corners = decoded.uv[some.faces].astype(np.float64) * size
    middles = np.floor(np.einsum("nkc,nk->nc", corners, some.barycentric)) + 0.5
    a, ab, ac = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):  # faces without a place in the texture
        area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
        v = ((middles - a)[:, 0] * ac[:, 1] - (middles - a)[:, 1] * ac[:, 0]) / area
        w = (ab[:, 0] * (middles - a)[:, 1] - ab[:, 1] * (middles - a)[:, 0]) / area
        inside = (v >= 0) & (w >= 0) & (v + w <= 1)
    v, w = v[inside], w[inside]
    return some.faces[inside].astype(np.int32), np.stack([1 - v - w, v, w], axis=1)


def texel_psnr(found: Iterable[Float64[np.ndarray, " 4"]]) -> dict[str, float]:
    """Return the PSNR of luma of all texels that are seen; how bright all cameras are together cannot be known."""
    count, shown, both, true = sum(found, np.zeros(4)).tolist()
    return {"texel_y_psnr": psnr((shown - both * both / true) / count)} if count else {}


def dark_shares(background: Mesh) -> dict[str, float]:
    """Return the shares of vertices at the open edges of a background, and of others, that are dark."""
    if background.colors is None or background.is_empty:
        return {}
    used, edge = np.zeros((2, len(background.vertices)), bool)
    used[background.faces], edge[border_edges(background)] = True, True
    dark = background.colors.max(axis=1) < DARK
    parts = {"dark_open_edges": edge, "dark_inside": used & ~edge}
    return {name: float(dark[part].mean()) for name, part in parts.items() if part.any()}


def near_truth(
    scene: SceneFrame, frame: int, pictures: Sequence[ColorPicture | None], decoded: Mesh
) -> Int64[np.ndarray, " 2"]:
    """Return how many texels of a decoded surface that a camera sees have the colour of the truth, and how many not.

    The colour is that of the truth within `ALIKE` of what the true surface has in the pixel that shows it best.
    """
    assert scene.paint is not None
    (own, weights), surface = _texels(decoded, PLACES), Surface(scene.mesh)
    hits = surface.closest(blend(decoded.vertices, decoded.faces[own], weights))
    normals, sizes = face_normals(scene.mesh)[0][hits.faces], list[np.ndarray]()
    for view in ColorViews([picture for picture in pictures if picture is not None], scene.mesh).views:
        camera = view.picture.camera
        size = np.linalg.norm(hits.points - camera.eye, axis=1, keepdims=True) / camera.focal[0]
        sizes.append(np.where(view.weights(hits.points, normals)[:, None] > 0, size, np.inf))
    pixel = np.min(sizes, axis=0)
    seen = np.isfinite(pixel[:, 0])
    along = np.cross(normals, [0.3, 0.5, 0.8])
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    ways, least, most = (along, np.cross(normals, along)), np.full((len(seen), 3), 255.0), np.zeros((len(seen), 3))
    for step in range(AROUND):
        radius, angle = np.sqrt(step / (AROUND - 1)) * np.where(seen[:, None], pixel, 0), 2.4 * step  # a spiral
        there = surface.closest(hits.points + radius * (np.cos(angle) * ways[0] + np.sin(angle) * ways[1]))
        faces = there.faces.astype(np.int64)
        colors = scene.paint(there.points, faces) * shade_of(scene.mesh, faces, frame)[:, None]
        least, most = np.minimum(least, colors), np.maximum(most, colors)
    shown = Painted(decoded).on(own, weights)
    alike = np.maximum(least - shown, shown - most).max(axis=1) <= ALIKE
    return np.array([(alike & seen).sum(), (~alike & seen).sum()])


def color_bytes(reader: ReelReader) -> ColorBytes | None:
    """Return the bytes of a file's colours and of the base meshes of independent groups; None without colours."""
    sizes, pictures = dict.fromkeys(("vertices", "atlas", "background"), 0), list[int]()
    for chunk in reader.chunks:
        if chunk.kind == ChunkKind.PICTURES and chunk.frame_count:
            pictures += map(len, unpack_all(Pictures, reader.read_chunk(chunk.number)).packets)
        elif chunk.kind in (ChunkKind.COLORS, ChunkKind.ATLAS, ChunkKind.PICTURES):
            own = "vertices" if chunk.kind == ChunkKind.COLORS else "atlas"
            sizes[own if chunk.frame_count else "background"] += chunk.size
    if not any(sizes.values()):
        return None
    first = [chunk for chunk in reader.groups if chunk.form != Form.EMPTY and reader.group_before(chunk) is None]
    parts = [payload_bytes_by_purpose(reader.read_chunk(chunk.number)) for chunk in first]
    base = sum(each.get("base mesh", 0) for each in parts)
    return ColorBytes(**sizes, pictures=pictures, base=base, chains=len(first))


def swimming(video: Video, originals: MeshSequence) -> dict[str, float]:
    """Return mean PSNRs of red, green and blue from one frame to the next of a chain of groups.

    `swimming_psnr`: what coloured originals show at the same places of the tracked surface; `texture_psnr`: textures as
    decoded, which a coarse quantiser keeps from changing.
    """
    found, reader = {"swimming_psnr": list[float](), "texture_psnr": list[float]()}, video.reader
    is_colored = len(originals) > 0 and originals[0].is_colored
    for number, track in enumerate(video.tracks):
        for frame, mesh in enumerate(track):
            chunk, now = reader.chunk_of_frame(frame, number), dict[str, np.ndarray]()
            if frame == chunk.first_frame and reader.group_before(chunk) is None:
                first, before, places = mesh, dict(now), scatter(mesh, np.ones(len(mesh.faces), bool), POINTS)
            if mesh.texture is not None:
                now["texture_psnr"] = mesh.texture.pixels.astype(np.float32)
            if is_colored and not mesh.is_empty:
                corners = first.faces[places.faces]
                there = np.isin(_as_rows(corners), _as_rows(mesh.faces))  # others are covered by patches in this frame
                points = blend(mesh.vertices, corners[there], places.barycentric[there])
                now["swimming_psnr"] = np.full((len(there), 3), np.nan)
                now["swimming_psnr"][there] = Painted(originals[frame]).at(points, points)[0]
            for name in now.keys() & before.keys():
                found[name].append(psnr(float(np.nanmean(np.square(now[name] - before[name])))))
            before = now
    return {name: float(np.mean(values)) for name, values in found.items() if values}


def _as_rows(faces: Int32[np.ndarray, "F 3"]) -> Int64[np.ndarray, " F"]:
    """Return a number for each face that is that of an equal one."""
    a, b, c = faces.astype(np.int64).T
    return (a << 42) + (b << 21) + c
