"""KLT of TSDF blocks (Tang et al. 2018, "Real-time Compression and Streaming of 4D Performances"): "KLT" in the paper.

Each frame becomes signed distances on a sparse regular grid, `cells` along the diagonal of the sequence's box, and is
coded by itself: the blocks of 8^3 cells that hold surface; for each the weights of `basis` principal components that
were learned offline on other shapes, quantised at `step` and range coded; marching cubes at the decoder. Beyond
truncation a distance counts only as large and on its side, so that few components do. Signs are those of what is
decoded: nothing codes them apart, as later work of that group does (Tang et al. 2020, "Deep Implicit Volume
Compression"), so what is thinner than a voxel may close, or vanish.

The rate has everything: the mean and the first `basis` components travel in each stream, about 20 bytes a component.
With `basis_in="codec"` they are taken for tables that every decoder has, as a standard's, and left out.

Differs from the publication:

- Blocks share a layer of voxels, so that each holds whole cells, and the mean is taken of what they say there. The
  publication's deblocking, which moves weights within their quantisation step until blocks agree, is there
  (`deblocking` rounds) but off: with the quantisation below it costs 0.7 dB.
- Weights are fitted by weighted least squares in closed form, and quantised one after the other (`weights`).
- The basis is described by discrete Legendre polynomials, under the symmetries of the cube (`basis`), because its bytes
  count. It is learned on procedural bodies and simple shapes (`train`).
- Distances come from meshes, not from depth: closest points with pseudonormals (`grid`). Where decoded surface lies
  past the border of an open one, or far from any, a bit for each crossed cell leaves it out (`frames`).
- Contexts of the entropy coder come from neighbouring blocks and, for the blocks' positions, from the frame before;
  `group` frames share its adaptive models. Nothing else crosses frames.
- Geometry alone: no texture.
"""

from .codec import KltTsdfCodec

__all__ = ["KltTsdfCodec"]
