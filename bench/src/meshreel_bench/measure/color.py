"""Colours of decoded frames beside pictures of the same moments, and how much textures swim.

In: pictures that cameras took, original and decoded frames; a .reel file. Out: PSNRs in dB. What stands still and what
moves are told apart by the faces of the file's background.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from meshreel.coding.group import payload_bytes_by_purpose
from meshreel.container.reader import ReelReader
from meshreel.decoder.video import Video
from meshreel.format.layout import ChunkKind, Form, Pictures
from meshreel.format.records import unpack_all
from meshreel.geometry.color_views import ColorPicture
from meshreel.metrics.color import PEAK, TO_YUV, psnr
from meshreel.metrics.color_render import Colored
from meshreel.metrics.render import Crop, Pixels
from meshreel.types import Mesh

from ..rows import ColorBytes

EDGE = 2  # pixels from silhouettes that do not count: pictures are registered to depth within as many (living_room)
Squares = dict[str, np.ndarray]  # sums of squared differences of luma and numbers of pixels, by what is seen


def picture_squares(picture: ColorPicture, original: Mesh, decoded: Mesh, still: int) -> Squares:
    """Return how far what a camera shows of a decoded frame, whose first `still` faces stand still, is from a picture.

    Pixels count where both frames are seen. The camera's lens must not bend.
    """
    from scipy.ndimage import binary_erosion

    camera = picture.camera
    pixels = Pixels(camera, Crop(0, camera.height, 0, camera.width))
    shown, both = Colored(decoded).look(pixels), Colored(original).look(pixels).covered
    apart = np.square(PEAK * shown.colors.astype(np.float64) @ TO_YUV[0] - picture.pixels @ TO_YUV[0])
    parts = {"still": shown.covered & (shown.faces < still), "moving": shown.faces >= still}
    inside = {part: binary_erosion(mask & both, iterations=EDGE) for part, mask in parts.items()}
    inside["seen"] = inside["still"] | inside["moving"]
    return {part: np.array([apart[mask].sum(), mask.sum()]) for part, mask in inside.items()}


def picture_psnrs(found: Iterable[Squares]) -> dict[str, float]:
    """Return PSNRs of luma over all pixels of all pictures: `picture_y_psnr`, and that of each part that is seen."""
    total: Squares = {}
    for squares in found:
        total = {part: total.get(part, np.zeros(2)) + square for part, square in squares.items()}
    names = {"seen": "picture_y_psnr", "still": "picture_still_y_psnr", "moving": "picture_moving_y_psnr"}
    return {names[part]: psnr(square / count) for part, (square, count) in total.items() if count}


def color_bytes(reader: ReelReader) -> ColorBytes | None:
    """Return what the colours of a file take, and the base meshes of groups that need no other; None: no colours."""
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


def swimming(video: Video) -> dict[str, float]:
    """Return the mean PSNR of successive textures of one atlas, red, green and blue; nothing where there are none."""
    found, reader = list[float](), video.reader
    for number, track in enumerate(video.tracks):
        before: np.ndarray | None = None
        for frame, mesh in enumerate(track):
            chunk = reader.chunk_of_frame(frame, number)
            is_new = frame == chunk.first_frame and reader.group_before(chunk) is None
            pixels = None if mesh.texture is None else mesh.texture.pixels.astype(np.float32)
            if not is_new and before is not None and pixels is not None:
                found.append(psnr(float(np.mean(np.square(pixels - before)))))
            before = pixels
    return {"swimming_psnr": float(np.mean(found))} if found else {}
