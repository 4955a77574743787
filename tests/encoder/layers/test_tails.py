"""Patches are found where surface is missing or too much, and nowhere else; and only where they pay."""

from dataclasses import astuple, replace

import numpy as np
import pytest

import meshreel
from meshreel.coding.group import payload_bytes_by_purpose
from meshreel.coding.layers.patches import decode_patches
from meshreel.encoder.group.forms import Fidelity, measure
from meshreel.encoder.layers import tails
from meshreel.encoder.layers.shown_frame import shown_frames
from meshreel.encoder.layers.tails import find_tails
from meshreel.encoder.sequence import encode
from meshreel.encoder.settings.options import EncoderOptions
from meshreel.encoder.settings.settings import Settings
from meshreel.format.records import pack
from meshreel.geometry import work
from meshreel.geometry.cameras import Camera
from meshreel.geometry.depth import DepthPicture, FreeSpace
from meshreel.geometry.threads import threads
from meshreel.geometry.topology import concatenate
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList, Placement
from tests.coding.paper.test_laplacian import icosahedron
from tests.small_options import with_method

BALL = Mesh.of(0.3 * icosahedron(3).vertices, icosahedron(3).faces)
NOISE = 1e-4 * np.random.default_rng(0).normal(size=(6, *BALL.vertices.shape))
SIZE = 4000  # bytes of the layers, say


def knob(scale: float = 0.05, at: float = 0.4) -> Mesh:
    """A small ball beside the large one."""
    small = icosahedron(1)
    return Mesh.of(scale * small.vertices + [at, 0, 0], small.faces)


def noisy(mesh: Mesh, frames: int = 6) -> np.ndarray:
    """Places of a mesh that begins with the ball's vertices, a little wrong."""
    places = np.repeat(mesh.vertices[None], frames, axis=0)
    places[:, : len(BALL.vertices)] += NOISE[:frames]
    return places


def test_where_the_template_fits_there_is_no_layer() -> None:
    assert find_tails(shown_frames([BALL] * 6, meshes(noisy(BALL), BALL.faces)), SIZE, 0.0) is None


def test_a_perfect_template_has_no_tails() -> None:
    places = np.repeat(BALL.vertices[None], 2, axis=0)
    assert find_tails(shown_frames([BALL] * 2, meshes(places, BALL.faces)), SIZE, 0.0) is None


def test_surface_that_is_not_there_any_more_is_dropped() -> None:
    template = concatenate([BALL, knob()])
    frames = [template] * 3 + [BALL] * 3
    found = find_tails(shown_frames(frames, meshes(noisy(template), template.faces)), SIZE, 0.0)
    assert found is not None
    for t, frame in enumerate(found[1]):
        assert len(frame.faces) == (len(template.faces) if t < 3 else len(BALL.faces))
    assert len(pack(found[0])) < 40 and not found[0].mesh


def test_surface_that_is_new_is_added() -> None:
    frames = [BALL] * 5 + [concatenate([BALL, knob()])]
    found = find_tails(shown_frames(frames, meshes(noisy(BALL), BALL.faces)), SIZE, 0.0)
    assert found is not None
    assert [len(frame.faces) > len(BALL.faces) for frame in found[1]] == [False] * 5 + [True]
    plain = [Mesh(places, BALL.faces) for places in noisy(BALL)]
    assert measure(frames, found[1]).distance < 0.3 * measure(frames, plain).distance


def test_without_shares_nothing_is_added(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshreel.encoder.layers.tails.SHARES", ())
    frames = [BALL] * 5 + [concatenate([BALL, knob()])]
    assert find_tails(shown_frames(frames, meshes(noisy(BALL), BALL.faces)), SIZE, 0.0) is None


def test_where_bytes_are_dear_nothing_is_sent(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("meshreel.encoder.layers.tails.EXCHANGE", 1e9)
    frames = [BALL] * 5 + [concatenate([BALL, knob(0.004, 0.32)])]
    assert find_tails(shown_frames(frames, meshes(noisy(BALL), BALL.faces)), SIZE, 0.0) is None


def sheet(step: float = 0.05) -> Mesh:
    """A flat square."""
    x, z = (c.reshape(-1) for c in np.meshgrid(np.arange(-0.3, 0.31, step), np.arange(-0.3, 0.31, step)))
    side = round(len(x) ** 0.5)
    corner = (np.arange(side - 1)[:, None] * side + np.arange(side - 1)).reshape(-1)
    halves = ((corner, corner + 1, corner + side + 1), (corner, corner + side + 1, corner + side))
    return Mesh.of(np.stack([x, 0 * x, z], axis=1), np.concatenate([np.stack(half, axis=1) for half in halves]))


@pytest.mark.parametrize("axes", [[0, 1, 2], [1, 0, 2]], ids=["along x", "along y"])
@pytest.mark.parametrize("noise", [1e-9, 3e-7, 2e-6])
def test_patches_on_an_almost_exact_template_are_close_to_the_frame(noise: float, axes) -> None:
    flat = Mesh.of(sheet().vertices[:, axes], sheet().faces)
    frames = [flat] * 3 + [concatenate([flat, knob(at=0.45)])]
    places = np.repeat(flat.vertices[None], 4, axis=0)
    places = places + noise * np.random.default_rng(0).normal(size=places.shape)
    found = find_tails(shown_frames(frames, meshes(places, flat.faces)), SIZE, 0.0)
    assert (found is None) == (noise == 1e-9)  # there a byte is worth nothing
    if found is not None:
        decoded = decode_patches(found[0], 4, len(flat.faces)).apply(places, flat.faces)
        assert measure(frames[3:], decoded[3:]).distance < 0.005 and len(decoded[0].faces) == len(flat.faces)


def test_a_mask_that_pays_is_kept_where_a_patch_beside_it_does_not(monkeypatch: pytest.MonkeyPatch) -> None:
    template = concatenate([BALL, knob(0.012)])
    frames = [concatenate([BALL, knob(0.012, at=-0.4)]), template, BALL]
    places = noisy(template, 3)
    monkeypatch.setattr(tails._Search, "holds", lambda _, tried: all(mesh.is_empty for mesh in tried.parts.meshes))
    found = find_tails(shown_frames(frames, meshes(places, template.faces)), SIZE, 0.0)
    assert found is not None and found[0].dropped and not found[0].mesh


@pytest.mark.parametrize("size", [300, 30_000])
@pytest.mark.parametrize("scale", [0.01, 0.05])
def test_tails_remove_the_error_that_their_bytes_are_worth(size: int, scale: float) -> None:
    template = concatenate([BALL, knob(scale)])
    frames = [concatenate([BALL, knob(scale, -0.4)])] * 2 + [template] * 4
    places = noisy(template)
    found = find_tails(shown_frames(frames, meshes(places, template.faces)), size, 0.0)
    assert found is not None
    before = measure(frames, [Mesh(p, template.faces) for p in places]).distance ** 2
    after = measure(frames, found[1]).distance ** 2
    body = 6 * measure([BALL] * 6, [Mesh(p, BALL.faces) for p in noisy(BALL)]).distance ** 2
    assert (
        6 * (before - after) > 0.5 * body * len(pack(found[0])) / size
    )  # half: the search counts the body a little less


def test_the_frames_are_those_that_the_record_decodes_to() -> None:
    template = concatenate([BALL, knob()])
    frames = [concatenate([BALL, knob(at=-0.4)]), template, BALL]
    places = noisy(template, 3)
    found = find_tails(shown_frames(frames, meshes(places, template.faces)), SIZE, 0.0)
    assert found is not None and found[0].mesh and found[0].dropped
    decoded = decode_patches(found[0], 3, len(template.faces)).apply(places, template.faces)
    for mine, theirs in zip(decoded, found[1], strict=True):
        np.testing.assert_array_equal(mine.vertices, theirs.vertices)
        np.testing.assert_array_equal(mine.faces, theirs.faces)
    assert find_tails(shown_frames(frames, meshes(places, template.faces)), SIZE, 0.0)[0] == found[0]  # type: ignore[index]


def test_closest_points_of_shown_frames_are_those_that_a_measure_asks_for():
    """With faces dropped and surface patched: the errors are the same, and nothing is asked again."""
    ball = Mesh.of(0.3 * icosahedron(5).vertices, icosahedron(5).faces)
    template, frame = concatenate([ball, knob(0.02)]), concatenate([ball, knob(0.02, -0.4)])
    decoded = Mesh(template.vertices + 1e-4 * np.sin(7 * template.vertices), template.faces)
    found = find_tails(shown_frames([frame] * 2, [decoded] * 2), SIZE, 0.0)
    assert found is not None and len(template.faces) > len(found[1][0].faces) > len(ball.faces)
    before = work.so_far()
    known = surface_errors(frame, found[1][0], found[2][0])
    assert not work.since(before)
    measured = surface_errors(frame, found[1][0])
    assert work.since(before)["closest points"] > 2 * len(ball.faces)
    for each in ("forward", "backward"):
        one, other = astuple(getattr(known, each)), astuple(getattr(measured, each))
        assert one == pytest.approx(other, rel=1e-3)  # the tree decides in float32


def test_frames_that_share_a_tree_are_as_frames_alone_however_far_apart():
    places = [BALL.vertices + [x, 0, 0] for x in (0.0, 40.0, -3.0)]
    frames, decoded = meshes(places, BALL.faces), meshes([p + 1e-3 * np.sin(9 * p) for p in places], BALL.faces)
    gone = np.arange(len(BALL.faces)) < 30
    with threads(2):
        together = shown_frames(frames, decoded)
    for shown, frame, mesh in zip(together, frames, decoded, strict=True):
        (alone,) = shown_frames([frame], [mesh])
        assert np.allclose(shown.squared, alone.squared, rtol=1e-3, atol=1e-12)
        assert np.allclose(shown.left(gone), alone.left(gone), rtol=1e-3, atol=1e-12)


def test_where_every_face_is_dropped_the_patch_is_closest_to_all():
    frame, patch = concatenate([BALL, knob()]), knob()
    shown = shown_frames([frame], [BALL])[0]
    (faces, _), (back, _) = shown.closest_with(np.ones(len(BALL.faces), bool), patch)
    assert faces.min() >= 0 and set(faces) <= set(range(len(patch.faces)))
    assert len(back) == len(patch.vertices) + len(patch.faces)
    none, few = shown.closest_with(np.zeros(len(BALL.faces), bool), Mesh.empty()), np.arange(len(BALL.faces)) < 3
    assert all((one == other).all() for one, other in zip(none[0] + none[1], sum(shown.closest, ()), strict=True))
    assert shown.closest_with(few, Mesh.empty())[0][0].max() == len(BALL.faces) - 4


def meshes(positions: np.ndarray, faces: np.ndarray) -> list[Mesh]:
    return [Mesh(places, faces) for places in positions]


def options(**changes: object) -> EncoderOptions:
    """`best`, all frames in one group."""
    best = Settings("best", 40.0, group_size=4).resolved()
    plan = replace(best.method.plan, limit=1e6, worth=1e6)
    return with_method(best, plan=plan, target=Fidelity(0.01, 90.0, 0.01), **changes)


@pytest.fixture(scope="module")
def sequence() -> MeshList:
    """A ball that grows; beside it, in the first frame only, a knob."""
    frames = [Mesh.of((1 + 0.02 * t) * BALL.vertices, BALL.faces) for t in range(4)]
    return MeshList((concatenate([frames[0], knob()]), *frames[1:]))


def test_a_file_has_the_layer_where_it_pays_and_plays_without_it(sequence: MeshList, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("meshreel.analysis.follow.embedded.LOST", 1.0)  # else the frame with the knob is alone
    monkeypatch.setattr("meshreel.analysis.fit.frame.WRONG", 1.0)
    monkeypatch.setattr("meshreel.encoder.run.judge.INVENTED", (1.0, 1.0))  # the knob pulls at the template
    encode(sequence, tmp_path / "with.reel", options=options())
    patched = meshreel.open(tmp_path / "with.reel")
    assert payload_bytes_by_purpose(patched.reader.read_chunk(0))["patches"] > 0
    levels = len(patched.reader.chunks[0].layers) - 2
    plain = patched.at(levels)
    assert len({len(mesh.faces) for mesh in plain}) == 1
    assert len(patched[0].faces) > len(plain[0].faces)
    assert len(patched.at(levels + 1)[0].faces) == len(patched[0].faces)
    assert measure(list(sequence), list(patched)).distance < 0.5 * measure(list(sequence), list(plain)).distance


def test_tails_can_be_switched_off(sequence: MeshList, tmp_path) -> None:
    encode(sequence, tmp_path / "without.reel", options=options(tails=False))
    assert "patches" not in payload_bytes_by_purpose(meshreel.open(tmp_path / "without.reel").reader.read_chunk(0))


def test_surface_that_a_frame_lacks_stays_unless_a_camera_saw_through_it():
    more = concatenate([BALL, knob()])
    camera = Camera.of(64, 64, np.array([[60.0, 0, 32], [0, 60.0, 32], [0, 0, 1]]), np.eye(4))
    away = DepthPicture(camera, np.full((64, 64), 9.0, np.float32), 1.0, 10.0)  # nothing up to nine metres
    place = Placement(1.0, (0.0, 0.0, 3.0))
    frames, shown = [Mesh(BALL.vertices + NOISE[0], BALL.faces)] * 2, [more] * 2
    seen, blind = FreeSpace.of([away], place), FreeSpace.of([], place)
    dropped = find_tails(shown_frames(frames, shown, [seen] * 2), SIZE, 1e-3)
    assert dropped is not None and all(len(mesh.faces) < len(more.faces) for mesh in dropped[1])
    assert find_tails(shown_frames(frames, shown, [blind] * 2), SIZE, 1e-3) is None


@pytest.mark.parametrize(("measured", "stays"), [(0, False), (2, True)])
def test_surface_that_cameras_face_and_hardly_ever_measure_goes(measured: int, stays: bool) -> None:
    more, bare = concatenate([BALL, knob()]), Mesh(BALL.vertices + NOISE[0], BALL.faces)
    camera = Camera.of(64, 64, np.array([[60.0, 0, 32], [0, 60.0, 32], [0, 0, 1]]), np.eye(4))
    dark = DepthPicture(camera, np.zeros((64, 64), np.float32), 1.0, 10.0)
    free = [FreeSpace.of([dark], Placement(1.0, (0.0, 0.0, 3.0)))] * 4
    frames = [concatenate([bare, knob()])] * measured + [bare] * (4 - measured)
    found = find_tails(shown_frames(frames, [more] * 4, free), SIZE, 1e-3)
    faces = len(more.faces) if found is None else len(found[1][-1].faces)
    assert (faces == len(more.faces)) == stays


def test_holes_of_noisy_bodies_are_patched_at_any_price():
    frame = concatenate([Mesh(BALL.vertices + NOISE[0], BALL.faces), knob()])
    found = find_tails(shown_frames([frame] * 2, [BALL] * 2), 10, 1e-3)  # a byte costs more than the knob
    assert found is not None and all(len(mesh.faces) > len(BALL.faces) for mesh in found[1])
