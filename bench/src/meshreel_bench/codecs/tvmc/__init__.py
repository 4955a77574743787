"""TVMC*: one tracked reference a group and its displacements, both by Draco. In -> out: a sequence <-> bytes.

The baseline of the TSMC paper (section 4.2) after "TVMC: Time-Varying Mesh Compression Using Volume-Tracked Reference
Meshes" (Chen, Hácha, Váša and Dasari, MMSys 2025). Reference and displacements are those of preset `paper`.

Differs from the publication:
- It decodes. In the code published with TVMC a frame's displacements are a Draco cloud in the order of a k-d tree, and
  the evaluation looks each up among the originals; here they keep their order, which costs bytes, and need no original.
- Points follow the reference's surface, face by face, so that Draco predicts each from a neighbour: fewer bytes.
- One lattice for all groups and frames: `qp` bits for the widest frame, a step in metres. There each frame has its own.
- Vertices are fitted to the surface with a smooth field; there each jumps to the nearest vertex of the frame.
- Groups are cut where no reference follows, and frames that none follows are Draco meshes, as in preset `paper`, at the
  quality that goes with the reference's vertices, whatever `qp`. No group is Draco's because that were cheaper.
- In a scene each body has references of its own, as in preset `paper`, so that curves differ by the coding alone and
  a body that comes or goes cuts no other's groups; the paper has one reference of all that moves.
"""

from __future__ import annotations

from .codec import TvmcCodec

__all__ = ["TvmcCodec"]
