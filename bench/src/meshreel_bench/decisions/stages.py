"""One group of procedural frames taken through every stage of preset `paper`, for the pictures of docs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float64

from meshreel.analysis.fit.surface_fit import Fit, FitOptions, Guides, fit_frames
from meshreel.analysis.reference.centers import largest_distances, reference_centers
from meshreel.analysis.reference.deform import bind, center_motions, move
from meshreel.analysis.reference.extraction import Reference, extract_reference, predict
from meshreel.analysis.reference.track import track_centers
from meshreel.analysis.survey import survey
from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.coding import klt
from meshreel.coding.group import decode_group, payload_bytes_by_purpose
from meshreel.coding.paper.group import encode_laplacian
from meshreel.coding.reference_mesh import CodedReference, code_reference
from meshreel.encoder.paper.options import PaperOptions
from meshreel.encoder.paper.recipe import LEVELS, REFERENCE_BITS
from meshreel.geometry.topology import vertex_normals
from meshreel.types import Centers, Mesh, MeshList

FIRST, COUNT = 27, 10  # of the story's 90 frames: the hands meet on the way
CONTACT = 5  # of these: the two surfaces are melted into one


@dataclass(frozen=True, slots=True)
class Moved:
    """A frame in another pose, colored by the normals of its own pose."""

    mesh: Mesh
    colors: Float64[np.ndarray, "V 3"]  # RGB, 0 to 1


@dataclass(frozen=True, slots=True)
class Stages:
    """Results of every stage on one group; coordinates are normalised: the sequence's diagonal is 1."""

    frames: tuple[Mesh, ...]
    centers: Centers
    spread: Float64[np.ndarray, "K 3"]  # the reference centers of eq. 5
    stress: float
    reference: Reference
    moved: tuple[Moved, ...]  # the frames in the pose of eq. 5
    coded: CodedReference
    predictions: Float64[np.ndarray, "T V 3"]
    fit: Fit
    basis: klt.Basis
    payload: bytes
    components: int
    decoded: tuple[Mesh, ...]

    @property
    def parts(self) -> dict[str, int]:
        """Bytes of the group's payload by purpose."""
        return payload_bytes_by_purpose(self.payload)


def story() -> MeshList:
    """Frames of the procedural story, in metres."""
    people = soft_bodies(SoftBodiesOptions())
    return MeshList(tuple(people[FIRST + t] for t in range(COUNT)), people.frame_rate)


def compute(sequence: MeshList, options: PaperOptions) -> Stages:
    """The stages of a sequence that is one group."""
    seen = survey(sequence)
    frames = tuple(seen.normalise(mesh) for mesh in sequence)
    centers = track_centers(frames, options.track)
    middle = centers.positions[len(frames) // 2]
    spread = reference_centers(largest_distances(centers), middle)
    reference = extract_reference(frames, centers, options.reference)
    coded = code_reference(reference.mesh, REFERENCE_BITS, LEVELS)
    predictions = predict(reference, coded.base, centers)
    fit = fit_frames(coded.base.faces, predictions, frames, FitOptions(), Guides(key=reference.key))
    field = np.moveaxis(fit.positions, 0, 1) - coded.base.vertices[:, None]
    payload, layers = encode_laplacian(coded, field, options.displacements)
    moved = tuple(
        _moved(frame, own, spread.positions, reference) for frame, own in zip(frames, centers.positions, strict=True)
    )
    return Stages(
        frames=frames,
        centers=centers,
        spread=spread.positions,
        stress=spread.stress,
        reference=reference,
        moved=moved,
        coded=coded,
        predictions=predictions,
        fit=fit,
        basis=klt.fit(field),
        payload=payload,
        components=len(layers) - 1,
        decoded=tuple(decode_group(payload, len(frames))),
    )


def _moved(
    frame: Mesh,
    own: Float64[np.ndarray, "K 3"],
    pose: Float64[np.ndarray, "K 3"],
    reference: Reference,
) -> Moved:
    binding = bind(frame, own, reference.neighbours)
    motions = center_motions(own, pose, reference.neighbours)
    vertices = move(frame.vertices, binding, motions, reference.neighbours)
    return Moved(Mesh(vertices, frame.faces), (vertex_normals(frame) + 1) / 2)
