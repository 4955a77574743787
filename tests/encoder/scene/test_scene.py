"""A scene in a file: round trips of its parts, tracks over key intervals, and warnings about lost surface."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

import meshreel
import meshreel.encoder.scene.scene as scene
from meshreel.analysis.scene.cut import Rest
from meshreel.analysis.scene.labelling import ByPlace
from meshreel.analysis.scene.segmentation import scene_views
from meshreel.analysis.scene.standing import LocalNoise
from meshreel.analysis.survey import survey_sequence
from meshreel.coding.background import decode_background
from meshreel.coding.mesh import decode_intra, encode_empty, encode_intra
from meshreel.encoder.group.forms import NO_ERROR, EncodedGroup, target_of
from meshreel.encoder.group.progress import Stages
from meshreel.encoder.run.interval_files import IntervalFiles
from meshreel.encoder.run.schedule import Job
from meshreel.encoder.scene.parts import Parts, take_apart
from meshreel.encoder.scene.scene import encode_bodies
from meshreel.encoder.scene.static import LEAST_NOISE, Look, encode_static
from meshreel.encoder.scene.tracks import TrackGroup
from meshreel.encoder.sequence import Encoder, encode
from meshreel.encoder.settings.options import EncoderOptions, SceneOptions
from meshreel.errors import InputError
from meshreel.format.checks import MOST_TRACKS
from meshreel.format.layout import Form
from meshreel.geometry.cameras import CameraPose
from meshreel.geometry.closest_points import distances
from meshreel.geometry.derived_sequences import captured
from meshreel.geometry.topology import concatenate
from meshreel.geometry.voxels import Lattice
from meshreel.types import Mesh, MeshList, Placement
from tests import small_scene
from tests.metrics.shapes import moved, plane, sphere
from tests.scenes import CELL, NOISE, RADIUS, SIDE, ball, room, with_room
from tests.small_options import quick

NONE = Mesh.empty()
BODIES = [ball(0.5 + 0.35 * t) for t in range(4)]
ROLLING = with_room(BODIES)
OPTIONS = quick(group_size=3)
FAR = np.array([1e6, -1e6, 2e6])


def in_scene(options, **changes):
    """The options with other values of how a scene is taken apart."""
    return replace(options, scene=replace(options.scene, **changes))


def encoded(frames, path, options=OPTIONS, rate=30.0, **more):
    """The frames that come back and the summary."""
    sequence = MeshList(tuple(frames), rate)
    summary = encode(sequence, path, options=options, **more)
    video = meshreel.open(path)
    assert len(video) == len(frames) == summary.frame_count and path.stat().st_size == summary.size
    return video, summary


def statics(video) -> set[int]:
    """Numbers of the chunks that frames are shown with."""
    found = (video.reader.static_of_frame(frame) for frame in range(len(video)))
    return {chunk.offset for chunk in found if chunk is not None}


def rms(points, mesh) -> float:
    return float(np.sqrt((distances(points, mesh) ** 2).mean()))


def assert_rolls(video, offset=(0.0, 0.0, 0.0)):
    """Each frame is the room and the ball where it is, within the noise or so."""
    for number, body in enumerate(BODIES[: len(video)]):
        found, clean = video[number], moved(concatenate([room(), body]), offset)
        assert rms(clean.vertices, found) < 2.5 * NOISE
        high = found.vertices[(found.vertices - offset > 0.15).all(axis=1)]  # what is not at the floor or the walls
        assert len(high) > 100 and rms(high, clean) < 2.5 * NOISE


@pytest.fixture
def plainly(monkeypatch):
    """Bodies coded frame by frame, where it does not matter how: a fraction of the time."""

    def coded(recipe, interval):
        del recipe
        frames = interval.frames
        if frames[0].is_empty:
            return [EncodedGroup(Form.EMPTY, len(frames), encode_empty(), (), NO_ERROR)]
        assert not any(mesh.is_empty for mesh in frames)
        return [EncodedGroup(Form.DRACO, len(frames), encode_intra(list(frames), 1e-3, 0), (), NO_ERROR)]

    monkeypatch.setattr("meshreel.encoder.layers.recipe.LayersRecipe.encode", coded)


@pytest.fixture(scope="module")
def rolling(tmp_path_factory):
    path = tmp_path_factory.mktemp("rolling") / "a.reel"
    return path, *encoded(ROLLING, path)


def noise_of(deviation: float) -> LocalNoise:
    """The same noise everywhere, m."""
    return LocalNoise(np.zeros((1, 3)), *np.full((2, 1), deviation))


def test_a_scene_comes_back_as_it_was_without_its_noise(rolling):
    _, video, summary = rolling
    assert_rolls(video)
    assert summary.scene is not None and summary.scene.tracks == 1 and summary.warnings == ()
    assert 0.5 * NOISE < summary.scene.noise < 3 * NOISE  # borders and the floor under the ball count, too
    assert summary.psnr > 20 * np.log10(4 / NOISE) - 8


def test_the_background_is_in_the_file_once_and_shared_by_all_frames(rolling):
    _, video, summary = rolling
    faces = summary.scene.faces
    assert 0 < summary.scene.background < summary.size and len(statics(video)) == 1
    first = video[0]
    for mesh in video:
        assert np.array_equal(mesh.vertices[mesh.faces[:faces]], first.vertices[first.faces[:faces]])


def test_the_unit_is_the_size_of_what_moves(rolling):
    _, video, _ = rolling
    assert video.reader.header.scale == pytest.approx(2 * np.sqrt(3) * RADIUS, rel=0.1)


@pytest.mark.slow
@pytest.mark.usefixtures("plainly")
def test_the_same_scene_gives_the_same_bytes_with_an_executor_too(tmp_path):
    stages: dict[str, list[int]] = {}
    encoded(ROLLING, tmp_path / "a.reel")
    with ThreadPoolExecutor(2) as executor:
        record = lambda now: stages.setdefault(now.stage, []).append(now.done)  # noqa: E731
        encoded(ROLLING, tmp_path / "b.reel", executor=executor, progress=record)
    assert (tmp_path / "b.reel").read_bytes() == (tmp_path / "a.reel").read_bytes()
    ends = [stages[each][-1] for each in ("survey", "observe", "background", "noise", "bodies", "code", "track", "fit")]
    assert ends == 8 * [4]
    for stage in ("observe", "background"):  # frame by frame, and not all at the end
        assert sorted(stages[stage]) == stages[stage] and len(set(stages[stage])) > 2


@pytest.mark.slow
@pytest.mark.usefixtures("plainly")
def test_a_scene_that_is_encoded_again_is_taken_apart_once(tmp_path, monkeypatch):
    count = []
    monkeypatch.setattr("meshreel.encoder.sequence.take_apart", lambda *args: count.append(1) or take_apart(*args))
    encoder = Encoder(MeshList(tuple(ROLLING), 4.0))
    for quality in (30, 60):
        encoder.encode(tmp_path / f"{quality}.reel", quick(quality=quality))
    assert len(count) == 1
    encoded(ROLLING, tmp_path / "alone.reel", quick(quality=60), rate=4.0)
    assert (tmp_path / "alone.reel").read_bytes() == (tmp_path / "60.reel").read_bytes()
    other = quick(quality=60)
    encoder.encode(tmp_path / "other.reel", in_scene(other, from_depth=False))
    assert len(count) == 3
    for _ in range(2):  # cameras of the same numbers, made anew
        views = scene_views(MeshList(tuple(ROLLING), 4.0))
        cameras = tuple(replace(view, pose=CameraPose.of_world(view.extrinsic.copy())) for view in views)
        encoder.encode(tmp_path / "given.reel", in_scene(other, cameras=cameras))
    assert len(count) == 4


@pytest.mark.parametrize("preset", ["paper", "best"])
def test_bodies_need_not_be_nearer_to_noisy_frames_than_the_truth_is(preset, monkeypatch, tmp_path):
    noises, coded = [], scene.encode_intervals
    monkeypatch.setattr(
        scene, "encode_intervals", lambda job, some: coded(job, (noises.append(i.noise) or i for i in some))
    )
    video, summary = encoded(ROLLING, tmp_path / "a.reel", quick(preset=preset, group_size=1))
    assert_rolls(video)
    assert summary.scene is not None and noises
    target = quick(preset=preset).method.target
    for noise in noises:
        # Less than all: what a place is off as a whole is left out.
        assert 0.4 * NOISE < noise * video.reader.header.scale < 3 * NOISE
        clean = target_of(ROLLING, target, 0.0).distance
        assert target_of(ROLLING, target, noise).distance == pytest.approx(np.hypot(clean, noise))


def test_where_everything_may_move_no_background_is_looked_for(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.encoder.sequence.scene_standing", None)
    small = [Mesh.of(plane(1.0, 6).vertices, plane(1.0, 6).faces)] * 2
    options = replace(quick(preset="paper", group_size=1), scene=None)
    video, summary = encoded(small, tmp_path / "a.reel", options)
    assert summary.scene is None and not statics(video) and rms(small[1].vertices, video[1]) < 0.01


@pytest.mark.usefixtures("plainly")
def test_where_nothing_moves_the_file_is_a_background(tmp_path):
    video, summary = encoded(with_room([ball(1.2)] * 4), tmp_path / "a.reel")
    assert [group.form for group in summary.groups] == [Form.EMPTY] and summary.scene.tracks == 1
    assert rms(concatenate([room(), ball(1.2)]).vertices, video[3]) < 2.5 * NOISE
    assert summary.scene.background > 0.7 * summary.size


def test_where_all_moves_there_is_no_scene(tmp_path):
    frames = [moved(plane(1.0, 6), (0.4 * t, 0.3 * t, 0.5 * t)) for t in range(2)]
    video, summary = encoded(frames, tmp_path / "a.reel", quick(preset="paper", group_size=1))
    assert summary.scene is None and rms(frames[1].vertices, video[1]) < 0.01


@pytest.mark.usefixtures("plainly")
def test_a_clean_scene_needs_few_faces_for_its_flat_walls(tmp_path):
    video, summary = encoded(with_room([NONE] * 3, sigma=0.0), tmp_path / "a.reel")
    assert summary.scene.faces < 0.3 * len(room().faces)
    inner = room().vertices[room().vertices.max(axis=1) < SIDE - 1.5 * CELL]  # at a border, up to a cell is missing
    assert rms(inner, video[0]) < 0.1 * CELL


@pytest.mark.usefixtures("plainly")
def test_a_frame_without_surface_stays_without(tmp_path):
    frames = [NONE, NONE, *ROLLING[:2], NONE, *ROLLING[2:]]
    video, summary = encoded(frames, tmp_path / "a.reel")
    assert [mesh.is_empty for mesh in video] == [True, True, False, False, True, False, False]
    assert summary.scene is not None and len(statics(video)) == 1
    assert rms(ROLLING[2].vertices, video[5]) < 3 * NOISE and summary.psnr > 30


@pytest.mark.usefixtures("plainly")
def test_a_scene_far_from_the_origin_keeps_its_millimetres(tmp_path, rolling):
    video, summary = encoded([moved(mesh, FAR) for mesh in ROLLING], tmp_path / "a.reel")
    assert_rolls(video, FAR)
    assert summary.scene.noise == pytest.approx(rolling[2].scene.noise, rel=0.5)  # its cells are in other places
    assert summary.psnr > rolling[2].psnr - 1.0


@pytest.mark.usefixtures("plainly")
def test_a_vertex_that_no_face_has_does_not_make_the_scene_larger(tmp_path):
    stray = [Mesh.of([*mesh.vertices, [1e7, 0, 0]], mesh.faces) for mesh in ROLLING[:3]]
    video, summary = encoded(stray, tmp_path / "a.reel")
    assert max(video.reader.header.maximum) < 10 and summary.psnr > 30


@pytest.mark.usefixtures("plainly")
def test_the_background_may_be_sent_again(tmp_path):
    options = in_scene(OPTIONS, refresh=0.2)
    video, summary = encoded(ROLLING, tmp_path / "a.reel", options, rate=10.0)
    assert len(statics(video)) == 2
    assert_rolls(video)
    firsts = [group for group in summary.groups if not group.predicted]
    assert len(firsts) >= 2  # who joins at the second needs nothing before


@pytest.mark.usefixtures("plainly")
def test_bits_that_are_dropped_are_counted_for_the_user(tmp_path):
    """Where the ball was, a bit is left in one frame, far from where it is now."""
    bit = moved(sphere(0.05, 2), (0.5, 1.2, 2 * RADIUS + 0.5 * CELL))
    frames = with_room([*BODIES[:3], concatenate([BODIES[3], bit])])
    _, summary = encoded(frames, tmp_path / "a.reel")
    assert summary.warnings == (
        f"{len(bit.faces)} faces of bits that move or that the room lacks, far from all bodies, are not kept: they are "
        "small, or there only for a moment; to keep all, encode with --dynamic-only",
    )


# tracks over segments, with a segmentation that is known


class AllMoves(ByPlace):
    """Everything moves, whatever it is."""

    def moving(self, frame, mesh):
        del frame
        return np.ones(len(mesh.faces), bool)


ALL = AllMoves(CELL, Lattice(np.zeros(3), CELL), np.zeros(0, np.int64), np.zeros(0, bool), Rest.none(0), 0.0)


def tracks(frames: list[Mesh], interval: int = 2) -> list[str]:
    """Return which frames of each track have a body, where key intervals have `interval` frames."""
    sequence = MeshList(tuple(frames), 1.0)
    survey = replace(survey_sequence(sequence), scale=1.0)
    parts = Parts(survey, ALL, NONE, [], noise_of(0.0))
    options = replace(OPTIONS, key_interval=float(interval))
    groups, dropped = bodies_of(sequence, options, parts)
    assert dropped == 0
    assert groups == sorted(groups, key=lambda each: (each.first_frame, each.track))
    count = max(each.track for each in groups) + 1
    return [shown(groups, track, len(frames)) for track in range(count)]


def bodies_of(sequence: MeshList, options: EncoderOptions, parts: Parts) -> tuple[list[TrackGroup], int]:
    """Return the groups of a scene as encoded, with their payloads in memory, and the faces that are in none."""
    stages, recipe = Stages(None, len(sequence)), options.recipe()
    with TemporaryDirectory() as folder, IntervalFiles(Path(folder, "a.reel")) as files:
        groups, tracks = encode_bodies(Job(captured(sequence), options, None, stages, recipe, files), parts)
        loaded = [(e, e.group.stored.read() if e.group.stored else e.group.payload) for e in groups]
        return [replace(e, group=replace(e.group, payload=data)) for e, data in loaded], tracks.dropped


def shown(groups: list[TrackGroup], track: int, frames: int) -> str:
    """Of each frame of a track, whether it has a group with surface (x) or one without (.); each exactly one."""
    found = [""] * frames
    for each in groups:
        if each.track == track:
            for frame in range(each.first_frame, each.first_frame + each.group.frame_count):
                found[frame] += "." if each.group.form == Form.EMPTY else "x"
    return "".join(found)


SMALL = sphere(0.3, 2)


def at(*places: float) -> Mesh:
    return concatenate([moved(SMALL, (x, 0, 0)) for x in places]) if places else NONE


@pytest.mark.usefixtures("plainly")
@pytest.mark.parametrize(
    ("frames", "found"),
    [
        pytest.param([at(0.1 * t) for t in range(4)], ["xxxx"], id="one body"),
        pytest.param([*[at(0)] * 4, *[at(0, 3)] * 2], ["xxxxxx", "....xx"], id="one enters late"),
        pytest.param([at(0), *[at(0, 3)] * 3], ["xxxx", ".xxx"], id="one enters within an interval"),
        pytest.param([*[at(0, 3)] * 2, *[at(0)] * 4], ["xxxxxx", "xx...."], id="one leaves"),
        pytest.param(
            [*[at(0, 3)] * 2, *[at(0)] * 2, *[at(0, 6)] * 2], ["xxxxxx", "xx..xx"], id="another takes its track"
        ),
        pytest.param([at()] * 4, ["...."], id="no body"),
        pytest.param([*[at(0)] * 2, *[at()] * 2, *[at(0)] * 2], ["xx..xx"], id="all leave and one comes"),
        pytest.param([*[at(1.3, 1.7)] * 2, *[at(1.0, 2.0)] * 2], ["xxxx", "..xx"], id="bodies part"),
        pytest.param([*[at(0, 3)] * 2, *[at(3, 0)] * 2], ["xxxx", "xxxx"], id="whatever the order of faces"),
    ],
)
def test_a_body_keeps_its_track_and_leaves_it_to_others(frames, found):
    assert tracks(frames) == found


@pytest.mark.usefixtures("plainly")
def test_bodies_that_meet_go_on_in_one_track():
    meeting = [at(0, 1.5), at(0.3, 1.2), at(0.46, 1.04), at(0.5, 1.0)]
    assert sorted(tracks(meeting)) == ["xx..", "xxxx"]


@pytest.mark.usefixtures("plainly")
def test_a_body_with_a_frame_of_faces_without_area_is_coded_as_not_there():
    flat = Mesh.of(np.zeros((3, 3)), [[0, 1, 2]])
    assert tracks([at(0), flat, at(0), at(0)], interval=4) == ["x.xx"]


@pytest.mark.usefixtures("plainly")
def test_more_bodies_than_a_file_has_tracks_share_some():
    plate = plane(0.5, 1)
    many = concatenate([moved(plate, (k % 17, k // 17, 0)) for k in range(MOST_TRACKS + 20)])
    sequence = MeshList((many, many), 1.0)
    survey = replace(survey_sequence(sequence), scale=1.0)
    groups, dropped = bodies_of(sequence, OPTIONS, Parts(survey, ALL, NONE, [], noise_of(CELL)))
    assert {each.track for each in groups} == set(range(MOST_TRACKS)) and dropped == 0
    faces = [len(decode_intra(each.group.payload)[0].faces) for each in groups if each.first_frame == 0]
    assert sum(faces) == len(many.faces)


@pytest.mark.usefixtures("plainly")
def test_a_background_is_no_finer_than_its_noise_asks_for():
    survey = replace(survey_sequence(MeshList((room(),))), scale=1.0)
    sizes = []
    for noise in (0.0, 0.002, 0.01):
        parts, options = Parts(survey, ALL, with_room([NONE], sigma=0.002)[0], [], noise_of(noise)), SceneOptions()
        payload = encode_static(parts, 1, 30.0, options, Look(is_flat=False))[0].payload
        place = Placement(1.0, tuple(survey.center))
        away = rms(parts.background.vertices, place.of(decode_background(payload)))
        assert away <= options.coarse * max(noise, LEAST_NOISE)
        sizes.append(len(payload))
    assert sizes[0] > sizes[1] > sizes[2]


def test_a_noisy_room_lies_on_planes_in_fewer_bytes_and_is_as_near_to_the_truth():
    survey = replace(survey_sequence(MeshList((room(),))), scale=1.0)
    true, place = with_room([NONE], sigma=0.0)[0], Placement(1.0, tuple(survey.center))
    found = []
    for look in (Look(is_flat=False), Look()):
        parts = Parts(survey, ALL, with_room([NONE], sigma=0.002)[0], [], noise_of(0.004))
        payload = encode_static(parts, 1, 30.0, SceneOptions(), look)[0].payload
        found.append((len(payload), rms(true.vertices, place.of(decode_background(payload)))))
    (plain, plain_off), (flat, flat_off) = found
    assert flat < 0.8 * plain and flat_off < 1.02 * plain_off


@pytest.mark.usefixtures("plainly")
def test_a_scene_in_which_nothing_is_found_to_move_gives_a_warning(tmp_path):
    _, summary = encoded(small_scene.scene(4, moving=False), tmp_path / "a.reel")
    (warning,) = summary.warnings
    assert warning.startswith("nothing moves by more than 0.16 m") and "--dynamic-only" in warning


def test_a_scene_in_which_something_moves_by_less_than_two_cells_is_encoded_as_bodies(tmp_path):
    _, summary = encoded(small_scene.scene(2), tmp_path / "a.reel")
    (warning,) = summary.warnings
    assert "seems to stand still moves" in warning and summary.scene is None


@pytest.mark.usefixtures("plainly")
def test_still_surface_that_is_in_no_part_of_the_file_gives_a_warning(tmp_path):
    """Of twenty-five still leaves, each too small for the background, those far from the ball are dropped."""
    leaf = Mesh.of(0.1 * np.eye(3) + 0.9, [[0, 1, 2]])
    leaves = concatenate([moved(leaf, (0.25 * k, 0.25 * j, 0)) for k in range(5) for j in range(5)])
    frames = [concatenate([frame, leaves]) for frame in ROLLING]
    _, summary = encoded(frames, tmp_path / "a.reel")
    (warning,) = [line for line in summary.warnings if "that the room lacks" in line]
    assert (
        0 < int(warning.split()[0]) < 25 * len(frames) and "--dynamic-only" in warning
    )  # beside the ball they are kept


def test_a_scene_that_is_not_in_metres_is_encoded_as_bodies_and_says_so(tmp_path):
    small = MeshList(tuple(Mesh(mesh.vertices * 1e-3, mesh.faces) for mesh in small_scene.scene(4)), 10.0)
    with pytest.warns(UserWarning, match=r"faces of frame 0, which is 0\.00\d+ m large.*too small.*encoded as bodies"):
        summary = encode(small, tmp_path / "a.reel", options=quick())
    assert summary.scene is None


def test_a_frame_in_another_unit_is_refused_by_its_number(tmp_path):
    frames = list(small_scene.scene(12))
    frames[2] = Mesh(frames[2].vertices * 1000, frames[2].faces)
    with pytest.raises(
        InputError, match=r"frame 2 is 3\.\d+e\+03 m large, half of the frames at most 3\.\d+ m; correct its unit"
    ):
        encode(MeshList(tuple(frames), 10.0), tmp_path / "a.reel", options=quick())
    assert list(tmp_path.iterdir()) == []
