"""Makes the golden files of a format version: tiny .reel files and, beside each, what they must decode to, bit for bit.

`PYTHONPATH=. python conformance/make_golden.py conformance/v1` writes those that are not there. The others stay as they
are for ever, whatever today's encoder would make of them: a reader that no longer decodes them to these bits is wrong.
"""

from __future__ import annotations

import io
import json
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from scipy.spatial.transform import Rotation

from meshreel.coding.appearance.atlas import encode_atlas
from meshreel.coding.appearance.splats import encode_splats
from meshreel.coding.background import decode_background, decode_change, encode_background, encode_change
from meshreel.coding.colored import atlas_base, background_canvas, canvas_of, encode_group_colors
from meshreel.coding.group import continue_group
from meshreel.coding.layers.coder import LayerCodingOptions, LayersState, encode_layers
from meshreel.coding.layers.patches import encode_patches
from meshreel.coding.mesh import CodedReference, code_reference, encode_empty, encode_intra
from meshreel.coding.paper.displacements import DisplacementOptions, encode_laplacian
from meshreel.container.writer import Companion, ReelWriter
from meshreel.decoder.video import Video
from meshreel.decoder.video import open as open_video
from meshreel.edit.audio import packed_audio
from meshreel.edit.edits import concat, cut
from meshreel.encoder.appearance.videos import TextureOptions, Videos, layered_pictures
from meshreel.format.layout import ChunkKind, Header
from meshreel.format.records import pack
from meshreel.geometry.atlas import Layout
from meshreel.geometry.topology import concatenate
from meshreel.types import Mesh
from tests.golden import audio_record, colored_record, frame_record, planes, splats_records
from tests.spheres import deforming_sphere
from tests.splats import some_splats
from tests.tones import tone

FRAMES = 4
COLORS = 1 / 24
TEXTURES = TextureOptions(crf=50, compatible=True)
Group = tuple[int, bytes, tuple[int, ...], bool]  # frames, payload, layer ends, whether predicted from the last


def main(folder: Path) -> None:
    """Writes every golden file that is not there, and its record."""
    folder.mkdir(parents=True, exist_ok=True)
    moving, still, nothing = laplacian_group(), draco_group(), (2, encode_empty(), (), False)
    files: dict[str, tuple[Header, list[Group]]] = {
        "laplacian": (header(), [moving]),
        "draco": (header(), [still]),
        "empty": (header(), [nothing]),
        "layers": (header(), layers_groups(ball(), (1, 10, 3))),
        "layers_open": (header(), [nothing, *layers_groups(patches(), (4, 1)), *layers_groups(ball(), (2,))]),
        "layers_patched": (header(), patched_groups()),
        "layers_posed": (header(), layers_groups(patches(), (5, 3), turn=0.3)),
        "mixed": (header(intervals=(40_000, 20_000, 33_333) * 3), [nothing, moving, still, (1, *nothing[1:])]),
    }
    for name, (head, groups) in files.items():
        with golden(folder, name, head) as writer:
            for group in groups:
                add(writer, group)
    with golden(folder, "scene", header()) as writer:
        add_scene(writer)
    add_joined(folder)
    (folder / "audio").mkdir(exist_ok=True)
    heard = packed_audio(tone(0.3), -0.04, 500_000)
    with golden(folder, "audio/audio", header(intervals=(40_000, 20_000)), heard) as writer:
        add(writer, still)
    (folder / "colored").mkdir(exist_ok=True)
    with golden(folder, "colored/vertices", header()) as writer:
        painted = Painted(writer)
        for group in (*patched_groups(), moving, still):
            painted.add(group)
    with golden(folder, "colored/textures", header()) as writer:
        painted = Painted(writer)
        groups = layers_groups(ball(), (3, 2, 1))
        add_pictures(
            writer, atlas_base(groups[0][1][: groups[0][2][0]]), [painted.add(group) for group in groups], (3, 2, 1)
        )
    with golden(folder, "colored/scene", header()) as writer:
        add_colored_scene(writer)
    (folder / "splats").mkdir(exist_ok=True)
    with golden(folder, "splats/splats", header()) as writer:
        for number, group in enumerate((*patched_groups(), moving, still)):
            add(writer, group)
            if number in (0, 2):
                add_splats(writer, group[1])


def add_joined(folder: Path) -> None:
    """Cuts of the scene, the later one first: frames are hidden in the middle of the file that joins them."""
    path = folder / "joined.reel"
    if path.exists():
        return
    with TemporaryDirectory() as place:
        cuts = [f"{place}/{frames.replace(':', '_')}.reel" for frames in ("8:13", "2:12")]
        for name, frames in zip(cuts, ("8:13", "2:12"), strict=True):
            cut(folder / "scene.reel", name, frames)
        concat(cuts, path)
    path.with_suffix(".json").write_text(json.dumps(record(open_video(path)), indent=1) + "\n")


@contextmanager
def golden(folder: Path, name: str, head: Header, audio: bytes = b"") -> Iterator[ReelWriter]:
    """A writer of a file and then of what it must decode to; of nothing where the file is there."""
    path = folder / f"{name}.reel"
    kept = path.exists()
    with ReelWriter(io.BytesIO() if kept else path, head, audio=audio) as writer:
        yield writer
    if not kept:
        path.with_suffix(".json").write_text(json.dumps(record(open_video(path)), indent=1) + "\n")


def add(writer: ReelWriter, group: Group, track: int = 0, background: tuple[int, ...] = ()) -> None:
    """The next group of a track, shown with the background."""
    frames, payload, layers, predicted = group
    last = writer.last_of(track)
    before = (last,) if predicted and last is not None else ()
    writer.add_group(writer.frames_of(track), frames, payload, layers, (*background, *before), track)


def add_scene(writer: ReelWriter) -> None:
    """A floor with a box that goes and a ball that comes, a body that is always there, and one that comes and leaves.

    The second body's middle group already shows the change, while the first body's still names the floor before it.
    """
    reference = patches()
    always = layers_groups(reference, (6, 4, 4))
    floor, box = Mesh.of(8 * reference.mesh.vertices, reference.mesh.faces), deforming_sphere(1, levels=1)[0]
    whole = concatenate([floor, Mesh.of(0.5 * box.vertices + [1.0, 1.5, 0.5], box.faces)])
    step = 0.01
    before = encode_background(whole, step)
    decoded = decode_background(before)
    dropped = (decoded.vertices[decoded.faces][:, :, 2] > 0.4).any(axis=1)
    change = encode_change(decoded, dropped, Mesh.of(0.3 * box.vertices - [1.0, 0.5, 0.0], box.faces), step)
    first = writer.add_static(before)
    shown = (first,)
    add(writer, always[0], 0, shown)
    add(writer, (4, encode_empty(), (), False), 1, shown)
    second = writer.add_static(change, depends_on=(first,))
    visiting = patched_groups()
    add(writer, visiting[0], 1, (second,))
    add(writer, always[1], 0, (second,))
    add(writer, visiting[1], 1, (second,))
    add(writer, (5, encode_empty(), (), False), 1, (second,))
    add(writer, always[2], 0, (second,))


class Painted:
    """The groups of a track, and the colours of their vertices."""

    def __init__(self, writer: ReelWriter) -> None:
        self._writer = writer
        self._state: LayersState | None = None

    def add(self, group: Group, background: tuple[int, ...] = ()) -> int:
        """The number of the next group, shown with the background; its colours are predicted where it is."""
        frames, payload, _, predicted = group
        writer, before, state = self._writer, self._writer.last_of(0), self._state if predicted else None
        first = writer.frames_of(0)
        add(writer, group, 0, background)
        meshes, after = continue_group(payload, frames, None, state)
        canvas = canvas_of(payload, [len(mesh.vertices) for mesh in meshes], None, state)
        colors = [waves(mesh, first + t) for t, mesh in enumerate(meshes)]
        coded = encode_group_colors(canvas, colors, COLORS, None if state is None else state.colors)
        number, known = writer.last_of(0), writer.companion_of(before, ChunkKind.COLORS) if predicted else None
        needed = (number,) if known is None else (number, known)
        writer.add_companion(Companion(ChunkKind.COLORS, coded.payload, coded.layers), needed)
        self._state = None if after is None else replace(after, colors=coded.state)
        return number


def waves(mesh: Mesh, frame: int) -> np.ndarray:
    """Colours that move over a mesh."""
    return (128 + 100 * np.sin(9 * mesh.vertices + [0, 1, 2 + frame / 4])).astype(np.uint8)


def layout_of(base: Mesh, width: int, height: int) -> Layout:
    """A mesh seen from two sides, beside each other."""
    corners = base.vertices[base.faces]
    behind = corners[..., 2].mean(axis=1, keepdims=True) < 0
    low, high = base.vertices.min(axis=0), base.vertices.max(axis=0)
    x, y = ((corners[..., k] - low[k]) / (high[k] - low[k]) for k in range(2))
    places = np.stack([(x + behind) * (width // 2), y * height], axis=2)
    return Layout(width, height, np.rint(places).astype(np.int32))


def picture(layout: Layout, frame: int) -> np.ndarray:
    """A picture in which light moves."""
    y, x = np.indices((layout.height, layout.width))
    waves = [np.sin(x / 5 + frame / 9), np.cos(y / 4), np.sin((x + y) / 7 - frame / 5)]
    return np.stack([128 + 90 * wave for wave in waves], axis=2).astype(np.uint8)


def add_pictures(writer: ReelWriter, base: Mesh, groups: Sequence[int], counts: Sequence[int]) -> None:
    """The atlas and the pictures of groups that are predicted one from the other, in both codings."""
    layout = layout_of(base, 64, 32)
    atlas = writer.add_companion(Companion(ChunkKind.ATLAS, encode_atlas(base, layout)), (groups[0],))
    videos, last = Videos(layout, TEXTURES), dict[ChunkKind, int]()
    for frame in range(sum(counts)):
        videos.add(picture(layout, frame))
    for group, own in zip(groups, videos.finish(counts), strict=True):
        for companion in own:
            before = (last[companion.kind],) if companion.kind in last else ()
            last[companion.kind] = writer.add_companion(companion, (group, atlas, *before))


def add_splats(writer: ReelWriter, payload: bytes) -> None:
    """Splats of all sizes on the faces of the last group's base mesh, which the groups predicted from it have, too."""
    number = writer.last_of(0)
    splats = some_splats(300, len(atlas_base(payload).faces), seed=number)
    data, layers = encode_splats(splats, splats.opacities)
    writer.add_companion(Companion(ChunkKind.SPLATS, data, layers), (number,))


def add_colored_scene(writer: ReelWriter) -> None:
    """A floor under light that moves, in more pictures than a layer has; then it changes, and a ball comes."""
    squares, knob = patches().mesh, deforming_sphere(1, levels=1)[0]
    before = encode_background(Mesh.of(4 * squares.vertices, squares.faces), 0.01)
    floor = decode_background(before)
    change = encode_change(floor, np.arange(len(floor.faces)) < 9, Mesh.of(0.3 * knob.vertices, knob.faces), 0.01)
    first = writer.add_static(before)
    add_background_colors(writer, first, before, floor)
    layout = layout_of(floor, 32, 32)
    atlas = writer.add_companion(Companion(ChunkKind.ATLAS, encode_atlas(floor, layout)), (first,))
    for companion in layered_pictures(layout, range(0, 140, 2), lambda frame: picture(layout, frame), TEXTURES):
        writer.add_companion(companion, (first, atlas))
    painted = Painted(writer)
    add(writer, (150, encode_empty(), (), False), 0, (first,))
    second = writer.add_static(change, depends_on=(first,))
    add_background_colors(writer, second, change, decode_change(change, floor))
    groups = layers_groups(ball(), (2, 1))
    numbers = [painted.add(group, (second,)) for group in groups]
    add_pictures(writer, atlas_base(groups[0][1][: groups[0][2][0]]), numbers, (2, 1))


def add_background_colors(writer: ReelWriter, number: int, payload: bytes, mesh: Mesh) -> None:
    """The colours of a background, or of what a change of it adds, which is its end."""
    canvas = background_canvas(payload)
    colors = waves(mesh, 0)[len(mesh.vertices) - canvas.meshes[0].vertices :]
    coded = encode_group_colors(canvas, [colors], COLORS, None)
    writer.add_companion(Companion(ChunkKind.COLORS, coded.payload), (number,))


def header(intervals: tuple[int, ...] = ()) -> Header:
    """Far from the origin, so that a reader in single precision is found out."""
    corner = (0.5, 0.5, 0.5)
    return Header(
        frame_rate=25.0,
        origin=(1e6 + 0.125, -2.5, 0.1),
        scale=1.7,
        minimum=tuple(-x for x in corner),
        maximum=corner,
        metadata='{"preset":"golden"}',
        first_time=500_000 if intervals else 0,
        intervals=intervals,
    )


def laplacian_group() -> Group:
    """A ball that stretches, with ripples, on a subdivided reference."""
    ball = deforming_sphere(1, levels=1)[0]
    reference = code_reference(Mesh.of(0.25 * ball.vertices, ball.faces), 10, 1)
    points = reference.base.vertices
    time = np.arange(FRAMES)
    ripple = np.sin(20 * points[:, None, :] + time[None, :, None])
    field = 0.01 * ripple + 0.1 * points[:, None, :] * time[None, :, None] / FRAMES
    payload, layers = encode_laplacian(reference, field, DisplacementOptions(step=0.002))
    return FRAMES, payload, layers, False


def ball() -> CodedReference:
    """A ball that is subdivided twice."""
    mesh = deforming_sphere(1, levels=1)[0]
    return code_reference(Mesh.of(0.25 * mesh.vertices, mesh.faces), 10, 2)


def patches() -> CodedReference:
    """Two bent squares with open borders, subdivided once."""
    side = 6
    x, y = (axis.reshape(-1) / side for axis in np.meshgrid(np.arange(side), np.arange(side)))
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1)
    halves = ((corner, corner + 1, corner + side), (corner + 1, corner + side + 1, corner + side))
    faces = np.concatenate([np.stack(half, axis=1) for half in halves])
    points = 0.4 * np.stack([x, y, x * y], axis=1)
    both = np.concatenate([points, points[:, [1, 2, 0]] - 0.3])
    return code_reference(Mesh.of(both, np.concatenate([faces, faces + side * side])), 9, 1)


def layers_groups(reference: CodedReference, sizes: tuple[int, ...], turn: float = 0.0) -> list[Group]:
    """Groups of so many frames of a mesh that stretches and ripples, each after the first predicted from the last.

    It turns by an angle a frame, rad, about an axis.
    """
    points, groups, first = reference.base.vertices, list[Group](), 0
    state: LayersState | None = None
    for frames in sizes:
        time = (first + np.arange(frames))[:, None, None]
        turns = Rotation.from_rotvec(turn * time[:, :, 0] * np.array([0.6, 0.0, 0.8])).as_matrix()
        wanted = points * (1 + 0.01 * time) + 0.004 * np.sin(30 * points[:, [1, 2, 0]] + 0.2 * time)
        wanted = np.einsum("tij,tvj->tvi", turns, wanted) if turn else wanted
        coded = encode_layers(
            reference, wanted, LayerCodingOptions(step=0.001, detail_ratios=(0.8, 1.1), price=0.12), state
        )
        groups.append((frames, coded.payload, coded.layers, state is not None))
        state, first = coded.state, first + frames
    return groups


def patched_groups() -> list[Group]:
    """Two groups, the second predicted from the first, with faces that go and come, and meshes beside them."""
    groups = list[Group]()
    knob = deforming_sphere(1, levels=1)[0]
    for number, (frames, payload, layers, predicted) in enumerate(layers_groups(ball(), (3, 2))):
        dropped = np.zeros((frames, len(ball().base.faces)), bool)
        dropped[0, 40 + number : 90] = True
        dropped[1:, 60:130] = True
        beside = [Mesh.of(0.05 * knob.vertices + [0.3 - 0.6 * t, 0, 0], knob.faces) for t in range(frames)]
        record, _ = encode_patches(dropped, [*beside[:-1], Mesh.empty()], 70)
        payload += pack(record)
        groups.append((frames, payload, (*layers, len(payload)), predicted))
    return groups


def draco_group() -> Group:
    """A ball, nothing, and a larger ball: one subdivision in the decoder."""
    ball = deforming_sphere(1, levels=1)[0]
    meshes = [Mesh.of(0.2 * ball.vertices, ball.faces), Mesh.empty(), Mesh.of(0.3 * ball.vertices, ball.faces)]
    return 3, encode_intra(meshes, 0.001, 1), (), False


def record(video: Video) -> dict[str, object]:
    """What a reader must find in a file."""
    if video.reader.has_splats:
        return {"frames": splats_records(video), "frames_of_first_layers": splats_records(video.at(0))}
    if video.reader.is_colored:
        shown = sorted({*range(min(len(video), 12)), *range(0, len(video), 49), *range(len(video) - 4, len(video))})
        return {"parts": {str(frame): colored_record(video, frame) for frame in shown}, "planes": planes(video.reader)}
    return audio_record(video) | {
        "frame_rate": video.frame_rate,
        "timestamps": video.timestamps,
        "frames": [frame_record(mesh) for mesh in video],
        "frames_with_one_component": [frame_record(mesh) for mesh in video.at(1)],
    }


if __name__ == "__main__":
    main(Path(sys.argv[1]))
