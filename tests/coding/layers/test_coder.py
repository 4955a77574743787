import dataclasses
from dataclasses import replace

import numpy as np
import pytest

from meshreel.coding.group import continue_group, decode_group, payload_bytes_by_purpose
from meshreel.coding.layers import coder
from meshreel.coding.layers.coder import EncodedLayers, LayerCodingOptions, encode_layers
from meshreel.coding.mesh import CodedReference, code_reference
from meshreel.errors import FormatError, InputError
from meshreel.format.budget import LIMITS
from meshreel.format.layout import LayersGroup, LayersLevel, Origin
from meshreel.format.records import pack, unpack
from meshreel.geometry.topology import heights, refine, subdivide, subdivide_midpoint
from meshreel.types import Mesh

from ..bodies import ball, moving, sheet
from ..decoded_layers import decode_layers

BALL = ball()
WANTED = moving(BALL, 4)
CODED = encode_layers(BALL, WANTED)


def assert_exact(coded: EncodedLayers, previous: coder.LayersState | None = None) -> None:
    """Decoding gives what the encoder saw, to the bit."""
    faces, positions, state = decode_layers(coded.payload, None, previous)
    np.testing.assert_array_equal(positions, coded.positions)
    np.testing.assert_array_equal(state.base, coded.state.base)
    for mine, other in zip(state.scalars, coded.state.scalars, strict=True):
        np.testing.assert_array_equal(mine, other)
    assert len(faces) == 0 or faces.max() < positions.shape[1]
    assert coded.layers[-1] == len(coded.payload)


def error(positions: np.ndarray, wanted: np.ndarray) -> float:
    return float(np.sqrt(((positions - wanted) ** 2).sum(axis=2).mean()))


@pytest.mark.parametrize("reference", [BALL, sheet(), ball(0), ball(3)], ids=["ball", "sheet", "flat", "deep"])
@pytest.mark.parametrize("frames", [1, 2, 10])
def test_decoding_gives_the_encoders_places_to_the_bit(reference: CodedReference, frames: int) -> None:
    wanted = moving(reference, frames)
    coded = encode_layers(reference, wanted)
    assert_exact(coded)
    assert coded.positions.shape == wanted.shape
    assert error(coded.positions, wanted) < 3e-3
    np.testing.assert_array_equal(decode_layers(coded.payload)[0], reference.base.faces)


def test_a_finer_step_costs_more_and_errs_less() -> None:
    made = [encode_layers(BALL, WANTED, LayerCodingOptions(step=step)) for step in (8e-3, 4e-3, 2e-3, 1e-3, 5e-4)]
    sizes = [len(coded.payload) for coded in made]
    errors = [error(coded.positions, WANTED) for coded in made]
    assert sizes == sorted(sizes) and errors == sorted(errors, reverse=True)


def test_every_prefix_of_layers_decodes_to_a_coarser_mesh() -> None:
    whole = CODED.positions
    assert len(CODED.layers) == BALL.levels + 1
    for level, end in enumerate(CODED.layers):
        mesh = subdivide_midpoint(BALL.mesh, level)
        faces, positions, state = decode_layers(CODED.payload[:end], level)
        np.testing.assert_array_equal(faces, mesh.faces)
        np.testing.assert_array_equal(positions, whole[:, : len(mesh.vertices)])
        assert len(state.scalars) == level
        assert len(decode_group(CODED.payload[:end], 4, level)) == 4
        if level < BALL.levels:
            with pytest.raises(FormatError):
                decode_layers(CODED.payload[:end])
    np.testing.assert_array_equal(decode_layers(CODED.payload, 99)[1], whole)


def test_a_group_predicted_from_the_one_before_is_smaller_and_exact() -> None:
    following = moving(BALL, 4, 4)
    alone, after = encode_layers(BALL, following), encode_layers(BALL, following, previous=CODED.state)
    origins = [unpack(LayersGroup, group.payload)[0].origin for group in (after, alone)]
    assert origins == [Origin.PREVIOUS, Origin.ALONE]
    assert len(after.payload) < 0.8 * len(alone.payload)
    assert_exact(after, CODED.state)
    state = None
    for coded in (CODED, after):
        meshes, state = continue_group(coded.payload, 4, None, state)
        np.testing.assert_array_equal([mesh.vertices for mesh in meshes], coded.positions)
    with pytest.raises(FormatError, match="not at hand"):
        decode_group(after.payload, 4)


def test_a_predicted_group_decodes_at_each_level_from_the_one_before_at_that_level() -> None:
    after = encode_layers(BALL, moving(BALL, 3, 4), previous=CODED.state)
    for level in range(3):
        state = decode_layers(CODED.payload, level)[2]
        positions = decode_layers(after.payload, level, state)[1]
        np.testing.assert_array_equal(positions, after.positions[:, : positions.shape[1]])
    assert unpack(LayersLevel, after.payload, after.layers[0])[0].origin == Origin.PREVIOUS
    with pytest.raises(FormatError, match="not to this level"):
        decode_layers(after.payload, 1, decode_layers(CODED.payload, 0)[2])


def test_a_level_may_not_be_predicted_in_a_group_that_is_not() -> None:
    record, end = unpack(LayersLevel, CODED.payload, CODED.layers[0])
    level = pack(dataclasses.replace(record, origin=Origin.PREVIOUS))
    with pytest.raises(FormatError, match="not at hand"):
        decode_layers(CODED.payload[: CODED.layers[0]] + level + CODED.payload[end:], None, CODED.state)


ODD = {
    "triangle": Mesh.of(0.2 * np.eye(3), [[0, 1, 2]]),
    "two apart": Mesh.of(0.2 * np.concatenate([np.eye(3), np.eye(3) + 1]), [[0, 1, 2], [3, 4, 5]]),
    "three on an edge": Mesh.of(0.1 * np.random.default_rng(0).normal(size=(5, 3)), [[0, 1, 2], [0, 1, 3], [0, 1, 4]]),
}


@pytest.mark.parametrize("mesh", ODD.values(), ids=ODD.keys())
@pytest.mark.parametrize("frames", [1, 3])
def test_odd_meshes_are_exact(mesh: Mesh, frames: int) -> None:
    reference = code_reference(mesh, 8, 2)
    assert_exact(encode_layers(reference, moving(reference, frames, noise=5e-3)))


def test_isolated_vertices_and_degenerate_faces_are_exact() -> None:
    points = 0.1 * np.random.default_rng(1).normal(size=(9, 3))
    points[7] = points[6]
    faces = np.array([[0, 1, 2], [2, 1, 3], [4, 4, 5], [6, 7, 6], [3, 3, 3], [6, 7, 0]], np.int32)
    state = coder.LayersState(faces, points, ())  # Draco keeps no such faces: they come from a group before
    levels = subdivide_midpoint(Mesh(points, faces), 2)
    reference = CodedReference(b"", 1.0, 2, Mesh.empty(), levels)
    assert_exact(encode_layers(reference, moving(reference, 3, noise=5e-3), previous=state), state)


def test_levels_without_anything_to_say_cost_a_few_bytes_and_still_subdivide() -> None:
    coded = encode_layers(
        BALL, np.repeat(BALL.base.vertices[None], 3, axis=0), LayerCodingOptions(step=0.05, curvatures=(0,))
    )
    np.testing.assert_array_equal(coded.positions[0], BALL.base.vertices)
    assert coded.layers[2] - coded.layers[0] < 16


def test_scalars_aim_at_the_tangent_plane_of_the_wanted_surface() -> None:
    level = subdivide(BALL.mesh.faces, len(BALL.mesh.vertices))
    coarse = BALL.mesh.vertices[None]
    finer = subdivide_midpoint(BALL.mesh).vertices
    radius = float(np.linalg.norm(coarse[0], axis=1).max())
    round_ball = finer * (radius / np.linalg.norm(finer, axis=1))[:, None]
    scalars = heights(round_ball[None], coarse, level, 0)
    lifted = radius - np.linalg.norm(finer[len(coarse[0]) :], axis=1)
    np.testing.assert_allclose(scalars[0], lifted, atol=1e-3)


def test_midpoints_curve_as_the_normals_say() -> None:
    level = subdivide(BALL.mesh.faces, len(BALL.mesh.vertices))
    coarse = BALL.mesh.vertices[None]
    radii = [np.linalg.norm(refine(coarse, level, np.zeros((1, len(level.edges))), k)[0], axis=1) for k in (0, 64)]
    flat, curved = (abs(np.median(radius[level.vertices :]) - np.median(radius[: level.vertices])) for radius in radii)
    assert curved < flat / 4


@pytest.mark.parametrize("change", [{"frames": 0}, {"levels": 255}, {"step": 0.0}, {"origin": Origin.PREVIOUS}])
def test_absurd_heads_are_refused(change: dict[str, object]) -> None:
    head, offset = unpack(LayersGroup, CODED.payload)
    with pytest.raises(FormatError):
        decode_layers(pack(dataclasses.replace(head, **change)) + CODED.payload[offset:], None, CODED.state)


def test_frames_of_absurd_size_are_refused_before_memory_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coder, "LIMITS", replace(LIMITS, numbers=WANTED.size - 1))
    with pytest.raises(FormatError, match="exceed"):
        decode_layers(CODED.payload)


def test_vertices_that_are_not_finite_are_refused() -> None:
    after = encode_layers(BALL, moving(BALL, 2, 4), previous=CODED.state)
    huge = dataclasses.replace(CODED.state, base=CODED.state.base * 1e308 * 10)
    with pytest.raises(FormatError), np.errstate(all="ignore"):
        decode_layers(after.payload, None, huge)


def test_places_that_do_not_fit_are_refused() -> None:
    for bad in (WANTED * np.nan, WANTED * 1e6, WANTED[:0], WANTED[:, :20], WANTED[:, :-1]):
        with pytest.raises(InputError):
            encode_layers(BALL, bad)


def test_the_bytes_of_a_payload_are_listed_by_purpose() -> None:
    parts = payload_bytes_by_purpose(CODED.payload)
    assert list(parts) == ["base mesh", "base motion", "level 1", "level 2", "group head"]
    assert sum(parts.values()) == len(CODED.payload)
    assert parts["base mesh"] == len(BALL.data) and parts["level 2"] == CODED.layers[2] - CODED.layers[1]
