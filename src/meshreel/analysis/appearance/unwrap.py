"""Unwrap a mesh onto a texture: by xatlas (extra `color`), with room around each chart, or by projection to cameras.

In: a decoded mesh, and the size of the texture or the cameras. Out: texture coordinates of its faces' corners, texels.
"""

from __future__ import annotations

import numpy as np

from ...errors import InputError
from ...geometry.atlas import MOST_SIDE, Layout
from ...geometry.color_views import ColorViews
from ...geometry.topology import face_normals
from ...types import Mesh

GUTTERS = 128  # in the width of a texture; 8 texels of 1024 keep charts apart in three mip levels
ROUNDS = 8  # of packing, with texels per metre corrected after each (guess)
MARGIN = 0.995  # of the size that would just fit: packing is not quite proportional (guess)
ENLARGED = 3.0  # largest number of texels along a pixel: 39 dB of living_room; with 2: 38, with 1: 36, at similar rates
USUAL_SIDE = 1024  # texels, side up to which small pictures are enlarged (guess)
BLOCK = 16  # texels: the height of the texture is a multiple, as video has blocks


def unwrap(base: Mesh, size: int) -> Layout:
    """Return places of all corners of a base mesh in a texture `size` texels wide and at most as high.

    Raises InputError if xatlas is missing, or cannot fit the mesh.
    """
    try:
        import xatlas
    except ImportError:
        remedy = "pip install 'meshreel[color]', or give --color vertices"
        raise InputError(f"textures need the extra `color`: {remedy}") from None
    density = 0.0
    for _ in range(ROUNDS):
        atlas = xatlas.Atlas()
        atlas.add_mesh(base.vertices.astype(np.float32), base.faces.astype(np.uint32))
        options = xatlas.PackOptions()
        options.padding, options.texels_per_unit = size // GUTTERS, density
        options.resolution = 0 if density else size  # with both, it would begin another texture
        atlas.generate(xatlas.ChartOptions(), options)
        widest = max(atlas.width, atlas.height)
        if widest <= size and density:
            break
        density = atlas.texels_per_unit * MARGIN * size / max(widest, 1)
    else:
        raise InputError(
            f"a base of {len(base.faces)} faces does not fit a texture of {size} texels; give a larger one"
        )
    _, corners, uv = atlas[0]
    places = np.rint(uv.astype(np.float64) * [atlas.width, atlas.height]).astype(np.int32)[corners]
    height = -(-int(places[..., 1].max(initial=1)) // BLOCK) * BLOCK
    return Layout(size, min(height, size), np.ascontiguousarray(places))


def projected(mesh: Mesh, views: ColorViews) -> tuple[Layout, float]:
    """Return the faces' places in the cameras' pictures, laid side by side, and the texels along a pixel.

    A face is in the picture that sees it most frontally; a face that no picture has entirely has no place. Small
    pictures are enlarged, because corners are on whole texels, and large ones are reduced to fit a texture.
    """
    normals, middles = face_normals(mesh)[0], mesh.vertices[mesh.faces].mean(axis=1)
    best, weight = np.full(len(mesh.faces), -1), np.zeros(len(mesh.faces))
    places, left, height = np.zeros((len(mesh.faces), 3, 2)), 0, 0
    for number, view in enumerate(views.views):
        weights, camera = view.weights(middles, normals, at_step=0.1), view.picture.camera
        corners = view.picture.project(mesh.vertices)[0][mesh.faces]
        size = [camera.width, camera.height]
        with np.errstate(invalid="ignore"):
            whole = ((corners >= 0) & (corners <= size)).all(axis=(1, 2))
        better = whole & (weights > weight)
        best[better], weight[better] = number, weights[better]
        places[better] = corners[better] + [left, 0]
        left, height = left + camera.width, max(height, camera.height)
    side = max(left, height)
    scale = min(ENLARGED, max(1.0, USUAL_SIDE / side), MOST_SIDE / side)
    scaled = np.where(best[:, None, None] < 0, 0.0, places * scale)
    sides = [max(2, -(-round(side * scale) // BLOCK) * BLOCK) for side in (left, height)]
    return Layout(sides[0], sides[1], np.ascontiguousarray(np.rint(scaled).astype(np.int32))), scale
