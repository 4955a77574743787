"""KLT of TSDF blocks (Tang et al. 2018, "Real-time Compression and Streaming of 4D Performances"): "KLT" in the paper.

Each frame becomes signed distances on a sparse regular grid, `cells` along the diagonal of the sequence's box, and is
coded by itself: the blocks of 8^3 cells that hold surface; for each the weights of `basis` principal components, learned
offline on other shapes, quantised at `step` and range coded; marching cubes at the decoder. Beyond truncation a distance
counts only as large and on its side, so that few components do. The signs are those of what is decoded: unlike the same
group's later work (Tang et al. 2020) nothing codes them apart, and a fold thinner than a voxel may close. The decoder
moves weights within their quantisation step until neighbouring blocks agree: the publication's deblocking.

The rate has everything: the first `basis` components and the mean travel in each stream (about 20 bytes a component).
With `basis_in="codec"` they are taken for tables that every decoder has, as a standard's, and left out.

Differs from the publication:
- Blocks share a layer of voxels, so that each holds whole cells; discontinuity is what they disagree by there.
- The basis is described by discrete Legendre polynomials, under the symmetries of the cube (`basis`): its bytes count
  here. It is learned on procedural bodies and simple shapes.
- Distances come from meshes, not from depth: closest points with pseudonormals (`grid`). Where the decoded surface lies
  past the border of an open one, or far from any, a bit for each crossed cell leaves it out.
- Weights are fitted by weighted least squares in closed form, and quantised one after the other (`weights`).
- Entropy coding has contexts from neighbouring blocks and, of block positions, from the frame before; `group` frames
  share adaptive models. Nothing else crosses frames.
- Geometry alone: no texture.
"""

from .codec import KltTsdfCodec

__all__ = ["KltTsdfCodec"]
