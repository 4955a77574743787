"""The chain of preset `paper` on small bodies: what goes in comes out, whatever it is, and the same bytes each time."""

import subprocess
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import meshreel
from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.encoder.group.forms import IntraOptions
from meshreel.encoder.sequence import encode
from meshreel.errors import InputError
from meshreel.format.layout import Form
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.metrics.distance import surface_errors
from meshreel.types import Mesh, MeshList
from tests.metrics.shapes import plane
from tests.small_options import quick, with_method
from tests.spheres import sliding_sphere

paper = partial(quick, "paper")
BODY = SoftBodiesOptions(frames=6, people=1, spacing=0.035)
BALL = sliding_sphere(1, levels=2)[0]
NONE = Mesh.empty()


@pytest.fixture(scope="module")
def body(tmp_path_factory):
    """A walking body in two groups: the sequence, the file and the summary."""
    sequence = MeshList(tuple(soft_bodies(BODY)))
    path = tmp_path_factory.mktemp("body") / "body.reel"
    return sequence, path, encode(sequence, path, options=paper(group_size=3))


def decoded(sequence, path, options=None):
    """The frames that come back, each within reach of the original."""
    summary = encode(sequence, path, options=options or paper())
    video = meshreel.open(path)
    assert len(video) == len(sequence) == summary.frame_count
    assert path.stat().st_size == summary.size
    return video, summary


def percent(original, found):
    """Symmetric RMS distance, % of the original's diagonal."""
    return 100 * surface_errors(original, found).symmetric_rms / original.diagonal


def test_a_moving_body_is_coded_by_a_reference_and_its_displacements(body):
    sequence, path, summary = body
    assert [group.form for group in summary.groups] == [Form.LAPLACIAN, Form.LAPLACIAN]
    video = meshreel.open(path)
    assert [group.frame_count for group in video.reader.groups] == [3, 3]
    assert max(percent(a, b) for a, b in zip(sequence, video, strict=True)) < 0.6
    assert len(video[0].faces) == len(video[2].faces)  # one connectivity a group, whatever the input's


def test_the_literal_preset_keeps_one_group_in_the_mds_pose_where_ours_cuts(tmp_path):
    one, other = sliding_sphere(2, levels=2), [Mesh.of(BALL.vertices * [1, 0.2, 3] + [0, 4, 0], BALL.faces)] * 2
    _, summary = decoded(MeshList((*one, *other)), tmp_path / "a.reel", quick("paper-literal"))
    assert [(group.form, group.frame_count, group.canonical) for group in summary.groups] == [(Form.LAPLACIAN, 4, True)]
    metadata = meshreel.open(tmp_path / "a.reel").reader.metadata
    assert (metadata["preset"], metadata["canonical_references"]) == ("paper-literal", 1)


def test_what_the_summary_says_of_a_group_is_what_the_file_gives(body):
    sequence, path, summary = body
    video = meshreel.open(path)
    pairs = zip(sequence.meshes[:3], video[:3], strict=True)
    distances = [surface_errors(a, b).symmetric_rms for a, b in pairs]
    assert np.sqrt(np.mean(np.square(distances))) == pytest.approx(summary.groups[0].fidelity.distance, rel=1e-3)
    assert video.reader.metadata["preset"] == "paper"
    assert video.reader.metadata["rms_m"] > 0


def test_draco_takes_a_group_that_costs_less_that_way(tmp_path):
    coarse = sliding_sphere(2, levels=1)  # 18 vertices: any reference costs more
    options = with_method(paper(), intra=IntraOptions((1.0,), (2.0, 1.0, 0.7, 0.5)))
    video, summary = decoded(coarse, tmp_path / "a.reel", options)
    assert {group.form for group in summary.groups} == {Form.DRACO}
    assert len(video[0].faces) == len(coarse[0].faces)


def test_a_group_is_cut_where_one_reference_cannot_follow(tmp_path, monkeypatch):
    monkeypatch.setattr("meshreel.analysis.reference.extraction.KEYS", 1)
    monkeypatch.setattr("meshreel.analysis.reference.extraction.TRIAL_VERTICES", 150)
    monkeypatch.setattr("meshreel.analysis.reference.extraction.VOXEL", 1.0)
    one, other = sliding_sphere(2, levels=2), [Mesh.of(BALL.vertices * [1, 0.2, 3] + [0, 1, 0], BALL.faces)] * 2
    video, summary = decoded(MeshList((*one, *other)), tmp_path / "a.reel")
    assert len(summary.groups) > 1
    assert summary.groups[0].frame_count == 2 and sum(group.frame_count for group in summary.groups) == 4
    assert max(percent(a, b) for a, b in zip((*one, *other), video, strict=True)) < 2


def test_a_list_of_foreign_meshes_gives_the_bytes_of_the_same_sequence(tmp_path):
    encode(MeshList((BALL, BALL)), tmp_path / "a.reel", options=paper())
    encode([BALL.to_trimesh(), (BALL.vertices, BALL.faces)], tmp_path / "b.reel", options=paper())
    assert (tmp_path / "a.reel").read_bytes() == (tmp_path / "b.reel").read_bytes()


def moving(mesh: Mesh, count: int = 3) -> list[Mesh]:
    return [Mesh(mesh.vertices + [0.1 * k, 0, 0], mesh.faces) for k in range(count)]


@pytest.mark.parametrize(
    ("frames", "forms"),
    [
        pytest.param([NONE, BALL, NONE, Mesh.of(BALL.vertices, np.zeros((0, 3)))], "EDE", id="frames without faces"),
        pytest.param([NONE] * 3, "E", id="nothing at all"),
        pytest.param([BALL], "D", id="one frame"),
        pytest.param([Mesh.of(np.diag([1, 1 + t, 1]), [[0, 1, 2]]) for t in range(3)], None, id="meshes of one face"),
        pytest.param(moving(plane(1.0, 8)), None, id="a flat open sheet"),
        pytest.param([BALL, Mesh(1000 * BALL.vertices, BALL.faces)], None, id="different scales"),
    ],
)
def test_sequences_at_the_edges_come_back(frames, forms, tmp_path):
    video, summary = decoded(MeshList(tuple(frames), 12.5), tmp_path / "a.reel")
    assert forms in (None, "".join(group.form.name[0] for group in summary.groups))
    assert video.frame_rate == 12.5 and video.timestamps == pytest.approx(np.arange(len(frames)) / 12.5)
    for original, found in zip(frames, video, strict=True):
        assert found.is_empty == (len(original.faces) == 0)
        assert len(found.faces) == 1 or len(original.faces) != 1
        assert found.is_empty or percent(original, found) < 1


def degenerate(mesh):
    """Zero-area and duplicate faces."""
    flat = [[0, 0, 1], [2, 2, 2]]
    needle = len(mesh.vertices) + np.array([[0, 1, 2]])
    points = np.concatenate([mesh.vertices, [mesh.vertices[0]] * 2, [mesh.vertices[1]]])
    return Mesh.of(points, np.concatenate([mesh.faces, flat, needle, mesh.faces[:5]]))


def non_manifold(mesh):
    """A fin on an edge that two faces share already."""
    a, b, _ = mesh.faces[0]
    return Mesh.of([*mesh.vertices, 1.2 * mesh.vertices[a]], [*mesh.faces, [a, b, len(mesh.vertices)]])


def unreferenced(mesh):
    """Vertices that no face uses, one of them absurdly far away."""
    return Mesh.of([*mesh.vertices, [1e7, 0, 0], [0, 0, 0]], mesh.faces)


def isolated(mesh):
    """A speck apart from the body."""
    speck = np.array([[0, 0, 0], [0.02, 0, 0], [0, 0.02, 0]]) + [1.6, 0, 0]
    return Mesh.of([*mesh.vertices, *speck], [*mesh.faces, len(mesh.vertices) + np.arange(3)])


@pytest.mark.parametrize("spoil", [degenerate, non_manifold, unreferenced, isolated])
@pytest.mark.parametrize("count", [1, 2])
def test_meshes_that_are_not_clean_are_coded_all_the_same(spoil, count, tmp_path):
    frames = tuple(spoil(mesh) for mesh in sliding_sphere(count, levels=2))
    video, _ = decoded(MeshList(frames), tmp_path / "a.reel")
    for original, found in zip(sliding_sphere(count, levels=2), video, strict=True):
        forward = surface_errors(original, found).forward
        assert 100 * forward.rms / original.diagonal < 1  # the body is there, whatever became of the rest


@pytest.mark.parametrize(
    ("frames", "words"),
    [
        ([], "no frames"),
        *(([BALL, Mesh.of([*BALL.vertices[1:], [bad, 0, 0]], BALL.faces)], "frame 1: vertex 65 .*finite")
          for bad in (np.nan, np.inf)),
        *(([BALL, Mesh.of(BALL.vertices, [*BALL.faces, [0, 1, k]])], f"frame 1: .*vertex {k}") for k in (-1, 66)),
    ],
)  # fmt: skip
def test_frames_that_cannot_be_coded_are_refused_with_their_number(frames, words, tmp_path):
    with pytest.raises(InputError, match=words):
        encode(MeshList(tuple(frames)), tmp_path / "a.reel", options=paper())
    assert list(tmp_path.iterdir()) == []


def test_a_bad_file_is_named_with_its_frame_before_anything_is_coded(tmp_path):
    for number, bad in enumerate(("0", "0", "nan")):
        (tmp_path / f"f{number}.obj").write_text(f"v 0 0 {bad}\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InputError, match=r"frame 2 \(.*f2\.obj\)"):
        encode(open_sequence(tmp_path, SequenceOptions()), tmp_path / "a.reel", options=paper())
    assert not (tmp_path / "a.reel").exists()


def test_options_and_a_quality_or_preset_are_one_too_many(tmp_path):
    for given in ({"quality": 60}, {"preset": "paper"}, {"effort": "fast"}):
        with pytest.raises(InputError, match="leave the settings out"):
            encode(MeshList((BALL,)), tmp_path / "a.reel", options=paper(), **given)


def test_settings_are_options_too(tmp_path):
    encode(MeshList((BALL,)), tmp_path / "a.reel", quality=20.0)
    encode(MeshList((BALL,)), tmp_path / "b.reel", options=meshreel.Settings(quality=20.0))
    assert (tmp_path / "a.reel").read_bytes() == (tmp_path / "b.reel").read_bytes()


def test_absurd_options_are_refused():
    with pytest.raises(InputError, match="101"):
        replace(paper(), quality=101.0)
    for size in (0, 65):
        with pytest.raises(InputError, match=str(size)):
            with_method(paper(), group_size=size)
    with pytest.raises(InputError, match="unknown"):
        meshreel.Settings("unknown")


def test_a_path_that_cannot_be_written_is_refused_before_anything_is_read(tmp_path: Path) -> None:
    class Unread(MeshList):
        def __getitem__(self, index: int) -> Mesh:
            raise AssertionError("read")

    for path in (tmp_path / "nowhere" / "x.reel", tmp_path):
        with pytest.raises(InputError, match="cannot be written"):
            encode(Unread((NONE,) * 3), path)


def test_vertices_that_repeat_a_position_are_welded_as_the_command_line_does(tmp_path):
    soup = Mesh.of(BALL.vertices[BALL.faces].reshape(-1, 3), np.arange(3 * len(BALL.faces)).reshape(-1, 3))
    for name, mesh in (("whole", BALL), ("soup", soup)):
        encode([mesh] * 2, tmp_path / f"{name}.reel", options=paper())
    with meshreel.open(tmp_path / "soup.reel") as video, meshreel.open(tmp_path / "whole.reel") as whole:
        assert [group.form for group in video.reader.groups] == [group.form for group in whole.reader.groups]
        assert video.background(0).is_empty and surface_errors(BALL, video[0]).symmetric_rms < 0.01 * BALL.diagonal


def test_warnings_of_an_encode_reach_a_python_user(tmp_path):
    repeated = Mesh.of(BALL.vertices, [*BALL.faces, BALL.faces[0]])
    with pytest.warns(UserWarning, match="1 faces|2 faces"):
        summary = encode([repeated] * 2, tmp_path / "a.reel", options=paper())
    assert summary.warnings


@pytest.mark.parametrize("wrong", ["method='paper'", "scene=False"])
def test_options_of_other_types_are_refused_at_once(wrong):
    """In a process of its own, whose arguments no test's type checker looks at first."""
    script = f"import meshreel; meshreel.EncoderOptions({wrong})"
    said = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert said.returncode == 1 and f"InputError: {wrong.replace('=', ' ')}: give" in said.stderr
