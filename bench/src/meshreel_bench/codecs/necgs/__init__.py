"""NeCGS (Ren et al. 2025, "Neural Compression for 3D Geometry Sets"), a baseline of the paper (section 4.2).

Every frame becomes a TSDF-Def volume, signed distances and deformations on a regular grid (`grid`, `fit`); one
auto-decoder network, trained on all of them while its numbers are rounded (`network`, `train`), makes the volumes of
small embedded features; features and network are entropy-coded (`stream`). The decoder runs the network and extracts
the surfaces by deformable marching cubes (`cubes`). Frames are a set: nothing is predicted from one to the next.

Differs from the publication:
- The fit of a volume (eq. 1) measures distances between the two surfaces, both ways, where the authors compare pictures
  of depth and silhouette, whose renderer needs a GPU. As in theirs, the deformations' size counts too.
- Entropy coding is the adaptive range coder of `coding.entropy`, where the authors name Huffman's and anything better.
- A frame's grid is around that frame and of one size for all, moved by whole cells; the authors scale every mesh of a
  set into a cube, or a sequence as a whole.
- Open surfaces: the authors take closed ones. Here a sheet has an inside behind its faces, and the decoder leaves out
  where the sign flips far from any surface (`grid`).
- Training starts from weights that keep the size of values from module to module, and from an empty volume: the last
  convolution makes the distance of a point far outside, and no deformation. With PyTorch's own rule, the authors',
  values fade on their way, and the thousand steps that a core affords go into unlearning the noise of deformations.
  `encode` refuses a set of which a frame has lost its body in training.
- Sizes: the network narrows as the authors' does (64, 48, 32, 24, 16), all in proportion to `channels`, without the
  head layer that their configuration leaves out, and without their grids of 256. `SMALL`, the default, is a quarter as
  wide on a grid of 64 with fewer, faster steps, and its loss counts the structural similarities once (`structure`), not
  10 times: ten frames afford no 1.5 MB. `QUICK` is smaller still, for tests. `FULL` has the authors' numbers.
What the publication leaves open is as in the authors' code: distances end at 2 cells, a deformation of 1 is half a
cell, windows of 11 points for the structural similarity, a rise of the learning rate over a fifth of the epochs.
"""

from .codec import FULL, QUICK, SMALL, NecgsCodec

__all__ = ["FULL", "QUICK", "SMALL", "NecgsCodec"]
