"""TVMC*: displacements come back in order, frames from the bytes alone, and damaged bytes are told."""

import zlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from meshreel_bench.codecs import make_codec
from meshreel_bench.codecs.tvmc import Tracked, TvmcCodec, quality_of_vertices, track_sequence
from meshreel_bench.codecs.tvmc.stream import (
    MOST_CELLS,
    Kind,
    TvmcVideo,
    decode_cloud,
    decode_tracked,
    encode_cloud,
    encode_tracked,
    surface_order,
    unpack_stream,
)

from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.coding.mesh import code_reference
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import reference_vertices
from meshreel.errors import FormatError, InputError, NoReferenceError
from meshreel.geometry.closest_points import distances
from meshreel.geometry.topology import concatenate
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList
from tests.scenes import CELL, NOISE, ball, of_body, room, with_room
from tests.small_options import resolve_small
from tests.spheres import deforming_sphere, sliding_sphere

SMALL = TvmcCodec(qp=8, vertices=150, group_size=3, centers=150)
BALL = sliding_sphere(1, levels=2)[0]
BODY = MeshList(tuple(soft_bodies(SoftBodiesOptions(frames=4, people=1, spacing=0.04))))


@pytest.fixture(autouse=True)
def quick_analysis(monkeypatch):
    resolve_small(monkeypatch.setattr)


@pytest.fixture(scope="module")
def tracking():
    """A walking body, tracked in two groups."""
    return tracked(BODY, replace(SMALL, group_size=2))


@pytest.fixture(scope="module")
def stream(tracking):
    return SMALL.pack(tracking)


def tracked(sequence, codec=SMALL):
    with pytest.MonkeyPatch.context() as patch:
        resolve_small(patch.setattr)
        return track_sequence(Encoder(sequence), codec.encoder_options)


def percent(original, found):
    """Symmetric RMS distance, % of the original's diagonal."""
    return 100 * surface_errors(original, found).symmetric_rms / original.diagonal


def kinds(data):
    return [(group.first_frame, group.frame_count, group.kind) for group in unpack_stream(data).groups]


@pytest.mark.parametrize("step", [1e-2, 1e-4])
def test_a_group_decodes_to_the_fitted_vertices_within_half_a_step(tracking, step):
    group = tracking.groups[0]
    frames = decode_tracked(encode_tracked(group.reference, group.field, step), step)
    for number, frame in enumerate(frames):
        wanted = group.reference.base.vertices + group.field[:, number]
        assert np.abs(frame.vertices - wanted).max() <= step / 2 * (1 + 1e-9)
        assert np.array_equal(frame.faces, group.reference.base.faces)


def test_a_moving_body_comes_back(stream):
    assert kinds(stream) == [(0, 2, Kind.TRACKED), (2, 2, Kind.TRACKED)]
    video = SMALL.decode(stream)
    assert len(video) == 4
    assert max(percent(a, b) for a, b in zip(BODY, video, strict=True)) < 0.6
    assert np.array_equal(video[0].faces, video[1].faces)  # one connectivity a group, whatever the input's
    assert np.array_equal(video[-1].vertices, list(video)[3].vertices) and len(video[1:3]) == 2


@pytest.mark.slow
def test_quality_rises_with_the_rate(tracking):
    found = []
    for qp in (3, 5, 7, 9):
        data = replace(SMALL, qp=qp).pack(tracking)
        errors = [percent(a, b) for a, b in zip(BODY, SMALL.decode(data), strict=True)]
        found.append((len(data), float(np.mean(errors))))
    sizes, errors = zip(*found, strict=True)
    assert list(sizes) == sorted(sizes) and list(errors) == sorted(errors, reverse=True)
    assert sizes[-1] > 2 * sizes[0] and errors[0] > 2 * errors[-1]


def test_no_frame_takes_more_than_its_bits_and_all_have_one_step(tracking):
    groups = [group for group in tracking.groups if isinstance(group, Tracked)]
    step = SMALL.step(tracking)
    widths = [np.ptp(np.rint(group.field / step), axis=0).max() for group in groups]
    assert 2**7 < max(widths) <= 2**8 and unpack_stream(SMALL.pack(tracking)).step == step


def test_the_same_input_gives_the_same_bytes_and_tells_its_stages():
    last: dict[str, int] = {}
    sequence = deforming_sphere(3, levels=2)
    data = SMALL.encode(sequence, lambda stage, done, _: last.update({stage: done}))
    assert SMALL.encode(sequence) == data
    assert [last[stage] for stage in ("survey", "track", "reference", "fit", "code")] == 5 * [3]
    assert max(percent(a, b) for a, b in zip(sequence, SMALL.decode(data), strict=True)) < 1


def test_empty_frames_are_legal_and_stay_in_their_places():
    frames = (Mesh.empty(), BALL, Mesh.empty(), Mesh.of(np.zeros((3, 3)), []))
    data = SMALL.encode(MeshList(frames))
    assert kinds(data) == [(1, 1, Kind.DRACO)]
    assert [mesh.is_empty for mesh in SMALL.decode(data)] == [True, False, True, True]
    nothing = SMALL.decode(SMALL.encode(MeshList((Mesh.empty(),) * 3)))
    assert [len(mesh.vertices) for mesh in nothing] == [0, 0, 0]
    with pytest.raises(InputError, match="no frames"):
        SMALL.encode(MeshList(()))


@pytest.mark.slow
def test_what_no_reference_follows_is_cut_or_coded_frame_by_frame(monkeypatch):
    other = Mesh.of(BALL.vertices * [1, 0.2, 3] + [0, 4, 0], BALL.faces)
    frames = MeshList((BALL, BALL, other))
    cut = SMALL.encode(frames)
    assert kinds(cut) == [(0, 2, Kind.TRACKED), (2, 1, Kind.DRACO)]

    def none(*_):
        raise NoReferenceError("none")

    monkeypatch.setattr("meshreel.encoder.paper.recipe.analyze", none)
    plain = SMALL.encode(frames)
    assert kinds(plain) == [(0, 3, Kind.DRACO)]
    for data in (cut, plain):
        assert max(percent(a, b) for a, b in zip(frames, SMALL.decode(data), strict=True)) < 1


@pytest.mark.slow
def test_coordinates_around_a_million_keep_their_millimetres():
    far, balls = np.array([4.5e6, 1.2e2, 5.1e6]), sliding_sphere(2, levels=2)
    video = SMALL.decode(SMALL.encode(MeshList(tuple(Mesh.of(b.vertices + far, b.faces) for b in balls))))
    for mesh, found in zip(balls, video, strict=True):
        assert percent(mesh, Mesh.of(found.vertices - far, found.faces)) < 1


@pytest.mark.parametrize(
    ("options", "words"),
    [({"qp": 1}, "qp 1"), ({"qp": 17}, "qp 17"), ({"group_size": 0}, "group size"), ({"centers": 0}, "centers")],
)
def test_options_out_of_range_are_refused(options, words):
    with pytest.raises(InputError, match=words):
        make_codec("tvmc", options)


def test_a_reference_has_the_quality_of_its_vertices():
    counts = [800, 1300, 2000, 5000]
    assert [reference_vertices(quality_of_vertices(count)) for count in counts] == counts
    assert (quality_of_vertices(4), quality_of_vertices(10**6)) == (0, 100)


ROLLING = with_room([ball(0.5 + 0.35 * t) for t in range(4)])


@pytest.fixture(scope="module")
def rolling():
    return tracked(MeshList((Mesh.empty(), *ROLLING)), replace(SMALL, group_size=4))


@pytest.mark.slow
def test_a_scene_has_its_background_once_and_its_body_tracked(rolling):
    data = SMALL.pack(rolling)
    stream = unpack_stream(data)
    assert len(stream.states) == 1 and kinds(data) == [(1, 4, Kind.TRACKED)]
    assert stream.scale == pytest.approx(2 * np.sqrt(3) * 0.3, rel=0.1)  # m, the ball's diagonal
    frames = list(SMALL.decode(data))
    assert frames[0].is_empty  # bare: without the room, too
    still = len(SMALL.decode(data)[1].faces) - len(rolling.groups[0].reference.base.faces)
    for number, (found, frame) in enumerate(zip(frames[1:], ROLLING, strict=True)):
        assert np.array_equal(found.vertices[found.faces[:still]], frames[1].vertices[frames[1].faces[:still]])
        clean = concatenate([room(), ball(0.5 + 0.35 * number)])
        assert np.sqrt((distances(clean.vertices, found) ** 2).mean()) < 2.5 * NOISE
        assert of_body(frame).sum() > 0 and found.diagonal == pytest.approx(clean.diagonal, abs=CELL)


def test_every_truncation_and_every_flipped_byte_is_told(stream):
    places = np.unique(np.linspace(0, len(stream) - 1, 400).astype(int))
    for place in places:
        with pytest.raises(FormatError):
            TvmcVideo(stream[:place])
        damaged = bytearray(stream)
        damaged[place] ^= 0x41
        with pytest.raises(FormatError):
            TvmcVideo(bytes(damaged))
    with pytest.raises(FormatError):
        TvmcVideo(stream + b"\0")


def test_another_version_is_told_as_one_and_frames_beyond_the_end_are_no_frames(stream):
    other = stream[:4] + bytes([9]) + stream[5:-4]
    with pytest.raises(FormatError, match="version"):
        TvmcVideo(other + zlib.crc32(other).to_bytes(4, "little"))
    with pytest.raises(IndexError):
        TvmcVideo(stream)[4]


@settings(max_examples=60)
@given(
    count=st.integers(1, 300),
    spread=st.sampled_from([0, 1, 15, 16383]),
    offset=st.sampled_from([0.0, -3.7, 1e4]),
    seed=st.integers(0, 1000),
)
def test_points_come_back_in_their_order_to_within_half_a_step(count, spread, offset, seed):
    random, step = np.random.default_rng(seed), 3e-4
    points = step * (offset + spread * random.random((count, 3)))
    points[random.integers(0, count, count // 2)] = points[0]  # what a k-d tree or a table of points would merge
    found = decode_cloud(encode_cloud(points, step), step)
    assert np.abs(found - points).max() <= step / 2 * (1 + 1e-9)
    assert np.array_equal(found, np.rint(points / step) * step)  # to the bit, on every platform


def test_the_surface_order_names_every_vertex_once_neighbours_together():
    mesh = Mesh.of(np.zeros((6, 3)), [[4, 2, 0], [2, 3, 4]])  # 1 and 5 are in no face
    assert surface_order(mesh).tolist() == [4, 2, 0, 3, 1, 5]


def test_along_the_surface_displacements_take_fewer_bytes():
    reference = code_reference(sliding_sphere(1, levels=3)[0], 14, 1)
    field = 0.1 * np.sin(3 * reference.base.vertices)
    along = field[surface_order(reference.base)]
    assert len(encode_cloud(along, 1e-3)) < 0.85 * len(encode_cloud(field, 1e-3))


@pytest.mark.parametrize("points", [np.full((3, 3), np.nan), np.full((3, 3), 2.0 * MOST_CELLS)])
def test_points_that_no_lattice_holds_are_refused(points):
    with pytest.raises(InputError, match="steps"):
        encode_cloud(points, 1.0)
