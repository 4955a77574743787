"""KLT of TSDF blocks (Tang et al. 2018, "Real-time Compression and Streaming of 4D Performances"): "KLT" in the paper.

Each frame becomes signed distances on a sparse regular grid, `cells` along the diagonal of the sequence's box, and is
coded by itself: the blocks of 8^3 cells that hold surface; for each the weights of `basis` principal components that
were learned offline on procedural bodies and simple shapes, quantised at `step` and range coded; marching cubes at the
decoder. Beyond truncation only a distance's sign and that it is large count. Signs are those of the decoded distances,
so parts thinner than a voxel may close or vanish. The rate counts everything: the mean and the first `basis` components
are in each stream, about 20 bytes per component.

Differs from the publication:
- Blocks share a layer of voxels, so that each holds whole cells; the decoder averages their values there. Deblocking,
  which moves weights within their step until blocks agree, is left out: with the quantisation below it cost 0.7 dB.
- Weights are fitted by weighted least squares (`weights`). The basis is made of discrete Legendre polynomials.
- Distances come from meshes, not from depth (`grid`). Decoded surface past borders is left out by bits (`frames`).
- Contexts come from neighbouring blocks and, for positions, from the frame before; `group` frames share adaptive
  models. Nothing else crosses frames. Geometry alone: no texture.
"""

from .codec import KltTsdfCodec

__all__ = ["KltTsdfCodec"]
