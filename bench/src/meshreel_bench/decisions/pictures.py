"""The pictures of docs/pipeline.md, one a stage, and that of docs/tutorial.md, from procedural data only.

`python -m meshreel_bench.decisions.pictures [FOLDER]` draws all into docs/pictures, in some two minutes.
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import matplotlib
import numpy as np
from jaxtyping import Float64

from meshreel.analysis.fit.surface_fit import Fit, FitOptions, fit_frames
from meshreel.analysis.reference.centers import bind, center_motions, largest_distances, move
from meshreel.analysis.reference.centers import reference_centers as spread_apart
from meshreel.analysis.reference.extraction import MDS, Reference, extract_reference, predict
from meshreel.analysis.reference.track import track_centers
from meshreel.analysis.survey import survey_sequence
from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.coding import klt
from meshreel.coding.group import decode_group, payload_bytes_by_purpose
from meshreel.coding.mesh import CodedReference, code_reference
from meshreel.coding.paper.displacements import encode_laplacian
from meshreel.encoder.paper.recipe import LEVELS, REFERENCE_BITS, PaperOptions
from meshreel.geometry.topology import components as connected
from meshreel.geometry.topology import vertex_normals
from meshreel.metrics.error_sheet import SheetOptions, write_sheet
from meshreel.metrics.viewpoints import Box
from meshreel.types import Centers, Mesh, MeshList

from . import drawing
from .drawing import BODIES, Sheet, camera_for, draw_edges, draw_points, normal_colored, shaded

FIRST, COUNT = 27, 10  # of the story's 90 frames: the hands meet on the way
CONTACT = 5  # of these: the two surfaces are melted into one


@dataclass(frozen=True, slots=True)
class Stages:
    """Results of every stage on one group; coordinates are normalised: the sequence's diagonal is 1."""

    frames: tuple[Mesh, ...]
    centers: Centers
    spread: Float64[np.ndarray, "K 3"]  # centers in the pose of eq. 5
    reference: Reference
    moved: list[tuple[Mesh, Float64[np.ndarray, "V 3"]]]  # the frames in the pose of eq. 5, RGB by their own normals
    coded: CodedReference
    predictions: Float64[np.ndarray, "T V 3"]
    fit: Fit
    basis: klt.Basis
    payload: bytes
    components: int


def compute(sequence: MeshList, options: PaperOptions) -> Stages:
    """The stages of a sequence that is one group."""
    survey = survey_sequence(sequence)
    frames = tuple(survey.normalise(mesh) for mesh in sequence)
    centers = track_centers(frames, options.track)
    middle = centers.positions[len(frames) // 2]
    spread = spread_apart(largest_distances(centers), middle)
    reference = extract_reference(frames, centers, options.reference)
    coded = code_reference(reference.mesh, REFERENCE_BITS, LEVELS)
    predictions = predict(reference, coded.base, centers)
    fit = fit_frames(coded.base.faces, predictions, frames, FitOptions(), reference.key)
    field = np.moveaxis(fit.positions, 0, 1) - coded.base.vertices[:, None]
    payload, layers = encode_laplacian(coded, field, options.displacements)
    moved = list[tuple[Mesh, np.ndarray]]()
    for frame, own in zip(frames, centers.positions, strict=True):
        binding = bind(frame, own, reference.neighbours)
        motions = center_motions(own, spread, reference.neighbours)
        vertices = move(frame.vertices, binding, motions, reference.neighbours)
        moved.append((Mesh(vertices, frame.faces), (vertex_normals(frame) + 1) / 2))
    sent = klt.fit(field), payload, len(layers) - 1
    return Stages(frames, centers, spread, reference, moved, coded, predictions, fit, *sent)


def main(folder: Path = Path("docs/pictures")) -> None:
    """Draw every picture into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    matplotlib.rcParams["font.family"] = "DejaVu Sans"  # comes with matplotlib: the same letters everywhere
    drawing.draw_room(folder / "room.png")
    people = soft_bodies(SoftBodiesOptions())
    stages = compute(MeshList(tuple(people[FIRST + t] for t in range(COUNT)), people.frame_rate), PaperOptions())
    for draw in PICTURES:
        draw(stages, path := folder / f"{draw.__name__.replace('_', '-')}.png")
        print(path)


def frames(stages: Stages, path: Path) -> None:
    """Frames as they come, and the connectivity of one spot in two of them."""
    sheet = Sheet(5, 250)
    camera = camera_for(list(stages.frames), 250)
    for panel, t in enumerate((0, CONTACT, len(stages.frames) - 1)):
        mesh = stages.frames[t]
        title = f"frame {FIRST + t}: {len(mesh.vertices)} vertices, {_parts(mesh)}"
        sheet.image(panel, title, normal_colored(mesh, camera))
    for panel, t in ((3, CONTACT - 1), (4, CONTACT)):
        box, vertices = Box.of(stages.frames), stages.frames[t].vertices
        middle = box.center + [0, 0.14 * box.size[1], 0]  # between the two people
        spot = Mesh.of(vertices[np.linalg.norm(vertices[:, :2] - middle[:2], axis=1) < 0.08], [])
        title = f"frame {FIRST + t}, the hands"
        draw_edges(sheet.axes[panel], title, stages.frames[t], camera_for([spot], 250), 0.5)
    drawing.write_figure(sheet.figure, path)


def centers(stages: Stages, path: Path) -> None:
    """Centers by body, by place in the first frame, and their trajectories."""
    sheet = Sheet(3, 320)
    camera = camera_for(list(stages.frames), 320)
    positions = stages.centers.positions
    by_body = f"{positions.shape[1]} centers by body"
    draw_points(sheet.axes[0], by_body, positions[-1], camera, BODIES[stages.centers.bodies % 3])
    low, high = positions[0].min(axis=0), positions[0].max(axis=0)
    share = (positions[0] - low) / (high - low)
    colors = matplotlib.colormaps["turbo"]((3.2 * share[:, 1] + 0.5 * share[:, 0]) % 1.0)[:, :3]
    for panel, t in ((1, 0), (2, len(positions) - 1)):
        draw_points(sheet.axes[panel], f"frame {FIRST + t}: one color, one trajectory", positions[t], camera, colors)
    tracks = np.stack([camera.project(drawing.placed(p, camera)) for p in positions])
    for k in range(0, tracks.shape[1], 3):
        sheet.axes[2].plot(*tracks[:, k].T, color=colors[k], linewidth=0.7, zorder=0)
    drawing.write_figure(sheet.figure, path)


def reference_centers(stages: Stages, path: Path) -> None:
    """A frame's centers beside those of eq. 5, from the front and from the side."""
    sheet = Sheet(4, 300)
    poses = (stages.centers.positions[CONTACT], stages.spread)
    box = [Mesh.of(pose, np.zeros((0, 3))) for pose in poses]
    distances = largest_distances(stages.centers)  # of eq. 5, whose two sums count every pair twice
    current = np.linalg.norm(stages.spread[:, None] - stages.spread[None], axis=2)
    stress = np.linalg.norm(distances - current) / np.linalg.norm(distances)
    names = (f"frame {FIRST + CONTACT}", f"reference (stress {stress:.3f})")
    for panel in range(4):
        pose, view = poses[panel % 2], panel // 2
        title, colors = f"{names[panel % 2]}, {('front', 'right')[view]}", BODIES[stages.centers.bodies % 3]
        draw_points(sheet.axes[panel], title, pose, camera_for(box, 300, view), colors)
    drawing.write_figure(sheet.figure, path)


def deformed(stages: Stages, path: Path) -> None:
    """Frames in the pose of the reference centers, in the colors that their normals had in the frame."""
    sheet = Sheet(4, 300)
    camera = camera_for([mesh for mesh, _ in stages.moved], 300)
    last = len(stages.frames) - 1
    for panel, t in enumerate((0, CONTACT, last)):
        mesh, normals = stages.moved[t]
        sheet.image(panel, f"frame {FIRST + t}, moved", shaded(mesh, camera, normals))
    together = [stages.moved[t][0].vertices for t in (0, CONTACT, last)]
    colors = np.repeat(BODIES, [len(points) for points in together], axis=0)
    title = "points of the three, laid together"
    draw_points(sheet.axes[3], title, np.concatenate(together), camera, colors, 1.0)
    drawing.write_figure(sheet.figure, path)


def reference(stages: Stages, path: Path) -> None:
    """The reference mesh as decoded, then subdivided; and closer."""
    sheet = Sheet(3, 340)
    base = stages.coded.base
    camera = camera_for([base], 340)
    coarse = stages.reference.mesh
    pose = "MDS" if stages.reference.frame == MDS else f"frame {FIRST + stages.reference.frame}"
    sheet.image(0, f"{len(coarse.vertices)} vertices, {_parts(coarse)}, pose of {pose}", shaded(base, camera))
    low, size = coarse.vertices.min(axis=0), np.ptp(coarse.vertices, axis=0)
    for panel, (mesh, name) in enumerate(((coarse, "before subdivision"), (base, "after it")), 1):
        inside = (mesh.vertices >= size * [0, 0.68, 0] + low) & (mesh.vertices <= size * [0.45, 1, 1] + low)
        top = Mesh.of(mesh.vertices[inside.all(axis=1)], [])
        draw_edges(sheet.axes[panel], f"{name}: {len(mesh.faces)} faces", mesh, camera_for([top], 340), 0.4)
    drawing.write_figure(sheet.figure, path)


def fit(stages: Stages, path: Path) -> None:
    """Distance of the reference from a frame: deformed only, then fitted."""
    sheet = Sheet(4, 260, bar=True)
    last = len(stages.frames) - 1
    frame, faces = stages.frames[last], stages.coded.base.faces
    camera = camera_for([frame], 260)
    shapes = {"deformed": Mesh(stages.predictions[last], faces), "fitted": Mesh(stages.fit.positions[last], faces)}
    image = None
    for panel, (name, mesh) in enumerate(shapes.items()):
        sheet.image(2 * panel, f"reference {name}", shaded(mesh, camera))
        errors = 100 * drawing.heat(frame, camera, mesh)
        image = sheet.axes[2 * panel + 1].imshow(errors, cmap="viridis", vmin=0, vmax=0.3, interpolation="nearest")
        rms = float(np.sqrt(np.mean(np.square(errors.compressed()))))
        sheet.axes[2 * panel + 1].set_title(f"RMS {rms:.3f} %", fontsize=9)
    sheet.bar(image, f"distance of frame {FIRST + last}, % of the diagonal")
    drawing.write_figure(sheet.figure, path)


def components(stages: Stages, path: Path) -> None:
    """The energy of each KLT component, as many in color as are sent, and the quantiser's base step."""
    figure, axes = drawing.chart(8, 3)
    deviations = 100 * np.sqrt(stages.basis.energies)
    numbers = np.arange(len(deviations)) + 1
    kept = numbers <= stages.components
    axes.bar(numbers[kept], deviations[kept], color=BODIES[1], label=f"as many as are sent: {stages.components}")
    axes.bar(numbers[~kept], deviations[~kept], color="lightgrey", label="the others")
    step = 100 * PaperOptions().displacements.step
    axes.axhline(step, color=BODIES[0], linewidth=1, label=f"base step of the quantiser: {step:.2f} %")
    axes.set(yscale="log", xlabel="component", ylabel="RMS of its weights,\n% of the diagonal")
    axes.set_xlim(0, len(numbers) + 1)
    axes.legend(frameon=False, fontsize=8)
    drawing.write_figure(figure, path)


def decoded(stages: Stages, path: Path) -> None:
    """Original, decoded and error, as `meshreel compare --sheet` draws them."""
    count = len(stages.frames)
    pictures = MeshList(stages.frames), MeshList(tuple(decode_group(stages.payload, count)))
    write_sheet(*pictures, path, SheetOptions(frames=(0, count - 1), height=340))
    drawing.write_small(path, path)


def parts(stages: Stages, path: Path) -> None:
    """The payload's bytes by what they are for."""
    figure, axes = drawing.chart(8, 1.5)
    start = 0
    for number, (name, size) in enumerate(payload_bytes_by_purpose(stages.payload).items()):
        axes.barh(0, size, left=start, label=f"{name}: {size}", color=f"C{number}")
        start += size
    axes.set(yticks=[], xlim=(0, start), xlabel=f"bytes of the group: {start}, for {len(stages.frames)} frames")
    axes.legend(frameon=False, fontsize=8, ncols=4, loc="lower center", bbox_to_anchor=(0.5, 1.0))
    drawing.write_figure(figure, path)


PICTURES = (frames, centers, reference_centers, deformed, reference, fit, components, decoded, parts)  # by their names


def _parts(mesh: Mesh) -> str:
    count = len(np.unique(connected(mesh.faces, len(mesh.vertices))))
    return f"{count} part" + "s" * (count != 1)


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
