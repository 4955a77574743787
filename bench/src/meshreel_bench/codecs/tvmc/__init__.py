"""TVMC*: each group as one tracked reference and its displacements, both coded by Draco. A sequence <-> bytes.

The baseline of the TSMC paper (section 4.2), after "TVMC: Time-Varying Mesh Compression Using Volume-Tracked Reference
Meshes" (Chen, Hácha, Váša and Dasari, MMSys 2025). References and displacements are those of preset `paper`.

Differs from the publication:
- It decodes without the originals, where the published code looks displacements up: they keep their order, which costs
  bytes. Vertices are ordered along the reference's surface, so that Draco predicts each from a neighbour: fewer bytes.
- One quantization step in metres for all groups, with `qp` bits for the widest frame; there each frame has its own.
- Vertices are fitted to the surface with a smooth field; there each jumps to the nearest vertex of the frame.
- Groups are cut, and frames become Draco meshes, where no reference follows them, as in preset `paper`. The quality of
  these meshes follows from the number of vertices, not from `qp`; Draco meshes are never chosen for their size.
- Each body of a scene has its own references, so that curves differ from preset `paper` by the coding alone.
"""

from __future__ import annotations

from .codec import TvmcCodec

__all__ = ["TvmcCodec"]
