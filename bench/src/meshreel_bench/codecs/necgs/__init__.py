"""NeCGS (Ren et al. 2025, "Neural Compression for 3D Geometry Sets"), a baseline of the paper (section 4.2).

Each frame becomes a TSDF-Def volume, signed distances and deformations on a regular grid (`grid`, `fit`). One
auto-decoder network, trained on all of them with rounded numbers (`network`, `train`), makes the volumes from small
embedded features; features and network are entropy-coded (`stream`). The decoder extracts the surfaces by deformable
marching cubes (`cubes`). Frames are a set: none is predicted from another.

Differs from the publication:
- The fit of a volume (eq. 1) measures distances between the two surfaces, both ways; the authors compare pictures of
  depth and silhouette, whose renderer needs a GPU.
- Entropy coding is the adaptive range coder of `coding.entropy`; the authors propose Huffman coding or better.
- Each frame has a grid around it, moved by whole cells; the authors scale meshes to a cube. Open surfaces are coded,
  too: a sheet has an inside behind its faces, and flips of sign far from any surface are left out (`grid`).
- Training starts from weights that preserve the size of values and from an empty volume; with PyTorch's own rule values
  fade.
- Networks narrow as the authors' do, in proportion to `channels`; no head layer, no grids of 256. The defaults are a
  quarter as wide with fewer, faster steps, and weight the structural similarities 1 instead of 10. The publication's
  point, for a GPU: `necgs:full`.
Where the publication is silent, the authors' code decides: truncation at 2 cells, a deformation of 1 is half a cell,
windows of 11 points for the structural similarity, a rise of the learning rate over a fifth of the epochs.
"""

from __future__ import annotations

from .codec import QUICK, NecgsCodec

__all__ = ["QUICK", "NecgsCodec"]
