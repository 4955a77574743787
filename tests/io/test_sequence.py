"""Sequences from files: selection, order, laziness, warnings."""

import pickle
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.geometry.threads import mapped, threads
from meshreel.geometry.topology import weld
from meshreel.io import meshes
from meshreel.io.file_names import in_order
from meshreel.io.sequence import CAPTURED, SequenceOptions, open_sequence
from meshreel.io.write import write_mesh
from meshreel.types import Mesh

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def put(folder: Path, *names: str, text: str = TRIANGLE) -> list[Path]:
    """Files of that text; the x of the first vertex tells which one was read."""
    paths = []
    for number, name in enumerate(names):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text.replace("v 0 0 0", f"v {-number} 0 0", 1))
        paths.append(path)
    return paths


def names_of(sequence) -> list[str]:
    return [sequence.name(k).split("/")[-1].rstrip(")") for k in range(len(sequence))]


def test_frames_come_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    put(tmp_path, "mesh_10.obj", "mesh_2.obj", "mesh_1.obj")
    assert names_of(open_sequence(tmp_path)) == ["mesh_1.obj", "mesh_2.obj", "mesh_10.obj"]


def test_a_folder_whose_frames_are_in_a_folder_meshes_stands_for_it(tmp_path: Path) -> None:
    put(tmp_path, "meshes/mesh_01.obj", "meshes/mesh_00.obj", "view_00.json", "render/00_v_00.jpg")
    assert names_of(open_sequence(tmp_path)) == ["mesh_00.obj", "mesh_01.obj"]
    put(tmp_path, "own.obj")
    assert names_of(open_sequence(tmp_path)) == ["own.obj"]


def test_the_last_number_that_varies_is_the_frame_number(tmp_path: Path) -> None:
    put(tmp_path, "take2_009_v1.obj", "take2_010_v1.obj", "take2_0008_v1.obj")
    assert names_of(open_sequence(tmp_path)) == ["take2_0008_v1.obj", "take2_009_v1.obj", "take2_010_v1.obj"]


def test_numbers_of_folders_count_in_a_glob(tmp_path: Path) -> None:
    put(tmp_path, "f10/mesh.obj", "f9/mesh.obj", "notes/readme.txt")
    sequence = open_sequence(f"{tmp_path}/*/mesh.obj")
    assert [sequence[k].vertices[0, 0] for k in range(2)] == [-1.0, 0.0]


def test_two_files_with_one_frame_number_are_refused(tmp_path: Path) -> None:
    put(tmp_path, "a1_003.obj", "a2_003.obj", "a2_004.obj")
    with pytest.raises(InputError, match=r"'a1_003' and 'a2_003' both have frame number 3; give a glob"):
        open_sequence(tmp_path)
    put(tmp_path / "padded", "b_3.obj", "b_03.obj", "b_4.obj")
    for order in ("auto", "all", "last"):
        with pytest.raises(InputError, match=r"'b_03' and 'b_3' both have frame number 3; give a glob"):
            open_sequence(tmp_path / "padded", SequenceOptions(order=order))


@pytest.mark.parametrize(
    "names",
    [
        ("30-01-2024", "31-01-2024", "01-02-2024", "02-02-2024"),  # days first
        ("02_28_2023", "03_01_2023", "01_01_2024"),  # months first
        ("t0_0", "t0_033", "t0_067", "t0_1", "t0_133"),  # a point written as _
    ],
)
def test_names_that_may_be_dates_or_decimals_are_asked_about(tmp_path: Path, names: tuple[str, ...]) -> None:
    put(tmp_path, *(f"{name}.obj" for name in names))
    with pytest.raises(InputError, match=rf"may be .*{names[0]}, {names[1]}.*(--order|name them)"):
        open_sequence(tmp_path)


def test_of_a_count_and_a_time_the_count_is_the_frame_number() -> None:
    names = ["000_1700000000123", "001_1700000000156", "003_1700000000223"]
    assert in_order(Path("folder"), names) == (names, [0, 1, 3])


def test_names_of_two_patterns_are_refused(tmp_path: Path) -> None:
    put(tmp_path, "dancer_1.obj", "dancer_2.obj", "background.obj")
    with pytest.raises(InputError, match=r"2 patterns, as 'background' and 'dancer_\d'; give a glob"):
        open_sequence(tmp_path)
    assert len(open_sequence(str(tmp_path / "dancer_*"))) == 2


def test_names_without_numbers_are_taken_by_the_alphabet_and_it_is_said(tmp_path: Path) -> None:
    put(tmp_path, "b.obj", "a.obj")
    sequence = open_sequence(tmp_path)
    assert names_of(sequence) == ["a.obj", "b.obj"]
    assert "alphabetical order" in sequence.warnings[0]


def test_a_list_keeps_its_order(tmp_path: Path) -> None:
    paths = put(tmp_path, "m_3.obj", "m_1.obj")
    assert names_of(open_sequence(paths)) == ["m_3.obj", "m_1.obj"]


def test_a_folder_of_two_kinds_is_refused_and_other_files_are_passed_over(tmp_path: Path) -> None:
    put(tmp_path, "m_1.obj", "m_2.OBJ", "m_1.png", ".m_3.ply")
    assert len(open_sequence(tmp_path)) == 2
    put(tmp_path, "m_1.ply")
    with pytest.raises(InputError, match=r"several kinds of files \(2 .obj, 1 .ply\); choose one, as '.*/\*.obj'"):
        open_sequence(tmp_path)


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("missing", r"missing: no such file or folder; check the path"),
        ("missing_*.obj", r"missing_\*.obj: no mesh file fits this pattern; check it"),
        ("", r"holds 0 mesh files; give a folder with \.obj"),
    ],
)
def test_a_source_without_frames_is_refused(tmp_path: Path, source: str, words: str) -> None:
    with pytest.raises(InputError, match=words):
        open_sequence(str(tmp_path / source))
    with pytest.raises(InputError, match="0 frames; give at least one"):
        open_sequence([])


def test_one_file_is_a_sequence_of_one_frame(tmp_path: Path) -> None:
    sequence = open_sequence(put(tmp_path, "m.obj")[0])
    assert len(sequence) == 1
    assert sequence[-1].faces.tolist() == [[0, 1, 2]]
    with pytest.raises(IndexError):
        sequence[1]


@pytest.mark.parametrize(("frames", "kept"), [(":", [0, 1, 2, 3]), ("1:3", [1, 2]), ("2:", [2, 3]), (":-3", [0])])
def test_frames_are_chosen_as_python_slices(tmp_path: Path, frames: str, kept: list[int]) -> None:
    put(tmp_path, *(f"m_{k}.obj" for k in range(4)))
    sequence = open_sequence(tmp_path, SequenceOptions(frames=frames))
    assert [-int(mesh.vertices[0, 0]) for mesh in sequence] == kept
    assert sequence.name(0).startswith(f"frame {kept[0]} (")


def test_a_choice_of_no_frames_is_refused(tmp_path: Path) -> None:
    put(tmp_path, "m_1.obj", "m_2.obj")
    with pytest.raises(InputError, match=r"frames '5:9' of 2 frames leave 0; choose at least one"):
        open_sequence(tmp_path, SequenceOptions(frames="5:9"))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"frames": "1:2:3"}, r"frames '1:2:3' is not a range; give A:B"),
        ({"frame_rate": 0.0}, r"frame rate 0.0 is not between"),
        ({"scale": float("nan")}, r"scale nan is not between"),
    ],
)
def test_impossible_options_are_refused(options: dict, words: str) -> None:
    with pytest.raises(InputError, match=words):
        SequenceOptions(**options)


def test_only_the_frame_that_is_asked_for_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    put(tmp_path, *(f"m_{k}.obj" for k in range(5)))
    read, parse = [], meshes._PARSERS[".obj"]
    monkeypatch.setitem(meshes._PARSERS, ".obj", lambda data: (read.append(data), parse(data))[1])
    sequence = open_sequence(tmp_path)
    assert (len(sequence), sequence.frame_rate, read) == (5, 30.0, [])
    assert sequence[3].vertices[0, 0] == -3
    assert len(read) == 1
    next(iter(sequence))
    assert len(read) == 2


def test_scale_multiplies_coordinates(tmp_path: Path) -> None:
    path = put(tmp_path, "m.obj")[0]
    assert open_sequence(path, SequenceOptions(scale=0.5))[0].vertices[1].tolist() == [0.5, 0, 0]


def test_welding_is_reported_and_counts_a_frame_once(tmp_path: Path) -> None:
    seam = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 4 6 5\nf 2 4 6\n"
    path = put(tmp_path, "m.obj", text=seam)[0]
    assert len(open_sequence(path)[0].vertices) == 6
    sequence = open_sequence(path, SequenceOptions(weld=weld))
    for _ in range(2):
        assert len(sequence[0].vertices) == 4
    said = "welded 2 of 6 vertices that repeat a position, and 1 faces that collapsed with them, in 1 frames"
    assert sequence.warnings == (said,)


def test_what_is_dropped_is_said_once_for_the_sequence(tmp_path: Path) -> None:
    text = TRIANGLE.replace("v 0 1 0\n", "v 0 1 0\nvt 0 0\nvn 0 0 1\nusemtl skin\n")
    put(tmp_path, "m_1.obj")
    put(tmp_path, "m_2.obj", "m_3.obj", text=text)
    sequence = open_sequence(tmp_path)
    assert sequence.warnings == ()
    for mesh in sequence:
        assert mesh.faces.shape == (1, 3)
    told = "not kept: material 'skin' (no file describes it), normals (first in frame 1, m_2.obj)"
    assert sequence.warnings == (f"{told}; bake what should be seen into colours or one texture",)


def test_frames_of_very_different_scale_are_read_and_pointed_out(tmp_path: Path) -> None:
    put(tmp_path, "m_1.obj")
    put(tmp_path, "m_2.obj", text="v 0 0 0\nv 1000 0 0\nv 0 1000 0\nf 1 2 3\n")
    sequence = open_sequence(tmp_path)
    assert [round(mesh.diagonal) for mesh in sequence] == [1, 1414]
    assert sequence.warnings == ("frame 1 is 1e+03 times as large as frame 0: are they in the same unit?",)


def test_a_frame_without_faces_is_empty_and_its_vertices_are_mentioned(tmp_path: Path) -> None:
    put(tmp_path, "m_1.obj", "m_2.obj", text="# nothing\n")
    put(tmp_path, "m_2.obj", text="v 1 2 3\n")
    sequence = open_sequence(tmp_path)
    assert [mesh.is_empty for mesh in sequence] == [True, True]
    assert len(sequence[1].vertices) == 0
    assert "frame 1 has vertices but no faces" in sequence.warnings[0]


def save(path: Path, vertices: object, faces: object, compressed: bool = False) -> Path:
    (np.savez_compressed if compressed else np.savez)(path, vertices=vertices, faces=faces)
    return path


@pytest.mark.parametrize("compressed", [False, True])
def test_an_archive_is_read_in_any_order(tmp_path: Path, compressed: bool) -> None:
    vertices = np.random.default_rng(0).normal(size=(5, 4, 3)).astype(np.float32)
    path = save(tmp_path / "body.npz", vertices, np.array([[0, 1, 2, 3]]), compressed)
    sequence = open_sequence(path, SequenceOptions(frames="1:"))
    for k in (3, 0, 2, 2):
        assert np.array_equal(sequence[k].vertices, vertices[k + 1])
        assert sequence[k].faces.shape == (2, 3)
    copy = pickle.loads(pickle.dumps(sequence))
    assert np.array_equal(copy[1].vertices, vertices[2])


def test_an_archive_is_not_held_in_memory(tmp_path: Path) -> None:
    path = save(tmp_path / "body.npz", np.zeros((200, 2000, 3)), np.array([[0, 1, 2]]))  # 9.6 MB
    tracemalloc.start()
    for _ in open_sequence(path):
        pass
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        (np.zeros((0, 4, 3)), [[0, 1, 2]], r"has 0 frames"),
        (np.zeros((4, 3)), [[0, 1, 2]], r"'vertices' is float64 \(4, 3\); it must be numbers T x V x 3"),
        (np.zeros((2, 4, 3)), [[0.0, 1, 2]], r"'faces' is float64 \(1, 3\); it must be integers F x 3"),
        (np.zeros((2, 4, 3)), [[0, 1, 4]], r"frame 0 \(.*body.npz\[0\]\): face 0 refers to vertex 4, but there are 4"),
        (np.full((2, 4, 3), np.nan), [[0, 1, 2]], r"frame 0 .*vertex 0 is at \(nan, nan, nan\)"),
    ],
)
def test_a_bad_archive_is_refused(tmp_path: Path, vertices: np.ndarray, faces: list, words: str) -> None:
    path = save(tmp_path / "body.npz", vertices, np.array(faces))
    with pytest.raises(InputError, match=words):
        open_sequence(path)[0]


def test_an_archive_with_other_names_or_cut_short_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "other.npz", points=np.zeros(3))
    with pytest.raises(InputError, match=r"other.npz: has points; save it as 'vertices' and 'faces'"):
        open_sequence(tmp_path / "other.npz")
    path = save(tmp_path / "body.npz", np.zeros((2, 4, 3)), np.array([[0, 1, 2]]))
    data = path.read_bytes()
    for length in range(0, len(data), 37):
        path.write_bytes(data[:length])
        with pytest.raises(InputError, match=r"body.npz"):
            list(open_sequence(path))


@pytest.mark.parametrize(
    ("record", "up"), [('{"up": "-z"}', "-z"), ('{"up": "x"}', "y"), ("[]", "y"), ("{", "y"), (None, "y")]
)
def test_the_up_axis_is_the_one_that_capture_recorded(tmp_path, record, up):
    write_mesh(Mesh.of(np.eye(3), [[0, 1, 2]]), tmp_path / "frame_00000.ply")
    if record is not None:
        (tmp_path / CAPTURED).write_text(record)
    assert open_sequence(tmp_path).up == up
    assert open_sequence([tmp_path / "frame_00000.ply"]).up == "y"


def warnings_of(folder, *meshes, names=None, **options):
    """Warnings of a folder of meshes, all of which are read."""
    folder.mkdir(exist_ok=True)
    for number, mesh in enumerate(meshes):
        write_mesh(mesh, folder / f"frame_{names[number] if names else number:03}.ply")
    sequence = open_sequence(folder, SequenceOptions(**options))
    for _ in sequence:
        pass
    return sequence.warnings


def test_a_person_900_m_tall_and_one_of_a_millimetre_are_pointed_out_and_the_scale_mends_it(tmp_path):
    tall = Mesh.of([[0, 0, 0], [0, 900, 0], [300, 0, 0]], [[0, 1, 2]])
    (warning,) = warnings_of(tmp_path, tall, tall)
    assert "is 949 m from corner to corner" in warning
    assert "--scale 0.001 if it is in millimetres" in warning
    assert warnings_of(tmp_path, tall, tall, scale=0.001) == ()
    (small,) = warnings_of(tmp_path, tall, tall, scale=1e-6)
    assert "is 0.000949 m from corner to corner" in small and small.endswith("twice") and "give --scale 1000" in small


def test_gaps_in_the_numbers_and_empty_frames_are_pointed_out(tmp_path):
    mesh = Mesh.of([[0, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 1, 2]])
    gaps, empty = warnings_of(tmp_path, mesh, mesh, Mesh.empty(), mesh, Mesh.empty(), names=[3, 4, 5, 6, 11])
    assert "4 frames are missing between the file names, the first between 6 and 11" in gaps
    assert empty == "2 frames are empty (the first: frame 2): nothing is shown there"
    (empty,) = warnings_of(tmp_path / "one", mesh, Mesh.empty())
    assert empty == "1 frame is empty (the first: frame 1): nothing is shown there"


@pytest.mark.parametrize(
    ("names", "lost"),
    [
        ([0, 33333, 66667, 100000, 133333, 166667], 0),  # microseconds of 30 frames/s
        ([0, 3, 6, 10, 13], 0),
        ([0, 3, 6, 9], 0),
        ([0, 1, 5, 6, 12], 0),  # no step is the usual one
        ([0, 2, 4, 6, 12], 2),
    ],
)
def test_only_steps_of_twice_the_usual_one_are_gaps(tmp_path, names, lost):
    mesh = Mesh.of([[0, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 1, 2]])
    found = warnings_of(tmp_path, *[mesh] * len(names), names=names)
    assert found == () if lost == 0 else f"{lost} frames are missing" in found[0]


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_threads_read_an_archive_in_any_order(save, tmp_path):
    vertices = np.random.default_rng(0).random((24, 50, 3))
    save(tmp_path / "a.npz", vertices=vertices, faces=np.arange(48).reshape(16, 3))
    frames = open_sequence(tmp_path / "a.npz")
    order = np.random.default_rng(1).permutation(24).tolist() + [1, 0, 3, 2, 5, 4, 9, 8, 23, 0]
    with threads(4):
        found = mapped(lambda number: frames[number].vertices, order)
    assert all(np.array_equal(mesh, vertices[number]) for mesh, number in zip(found, order, strict=True))
