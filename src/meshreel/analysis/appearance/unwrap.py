"""Unwrap a base mesh onto a texture: charts by xatlas (extra `color`), packed with room around each.

In: a base mesh as decoded, and the size of the texture. Out: the places of its faces' corners, in whole texels.
"""

from __future__ import annotations

import numpy as np

from ...coding.appearance.atlas import Layout
from ...errors import InputError
from ...types import Mesh

GUTTERS = 128  # in the width of a texture; 8 texels of 1024 keep charts apart in three mip levels
ROUNDS = 8  # of packing, with the texels of a metre corrected after each (guess)
MARGIN = 0.995  # of the size that would just fit: packing is not quite in proportion (guess)
BLOCK = 16  # texels: the height of the texture is a multiple, as video has blocks


def unwrap(base: Mesh, size: int) -> Layout:
    """Return places for all corners of a base mesh in a texture `size` texels wide and at most so high.

    Raises InputError where xatlas is missing, or finds no places.
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
