"""The order of frames whose names have several numbers, fractions, clocks and counts; where it is not clear, none."""

from pathlib import Path

import pytest

from meshreel.errors import InputError
from meshreel.io.file_names import in_order
from meshreel.io.sequence import SequenceOptions, open_sequence

HERE = Path("takes")
CLEAR = {
    "padded": ["m_001", "m_002", "m_010"],
    "not padded": ["m_1", "m_2", "m_10"],
    "seconds": [f"m_{k / 30:.3f}" for k in range(27, 36)],
    "Unix time with microseconds": [f"scan_{1305031102.9 + k / 30:.6f}" for k in range(8)],
    "Unix time, in two numbers": [f"scan_{1305031102 + k // 30}_{k % 30 * 33333:06}" for k in range(20, 45)],
    "nanoseconds": [f"{1305031102900000000 + k * 33333333}" for k in range(5)],
    "date and clock": [
        f"2024-05-{1 + k // 86400:02}_{k // 3600 % 24:02}-{k // 60 % 60:02}-{k % 60:02}" for k in range(86380, 86420)
    ],
    "a count behind": [f"frame_{k:03}_{count}verts" for k, count in enumerate((5021, 5003, 5017, 4999))],
    "a constant before": [f"take2_cam7_{k}" for k in (8, 9, 10)],
    "a point before the number": [f"walk.{k:04}" for k in range(3)],
    "a version with a point": [f"v1.2_{k:03}" for k in range(3)],
    "folders": [f"{k:02}/mesh_{k:02}" for k in range(3)],
}


@pytest.mark.parametrize("kind", CLEAR)
def test_names_of_which_all_readings_agree_are_in_the_order_of_their_numbers(kind: str) -> None:
    names = CLEAR[kind]
    assert in_order(HERE, names[::-1])[0] == names == in_order(HERE, names)[0]


UNCLEAR = {
    "a count before": [f"{count}verts_frame_{k:03}" for k, count in enumerate((5021, 5003, 5017, 4999))],
    "two cameras": [f"cam{camera}_{k:06}" for camera in (1, 2) for k in range(3)],
    "sections or fractions": ["scan_1.9", "scan_1.10", "scan_2.1"],
}


@pytest.mark.parametrize("kind", UNCLEAR)
def test_names_of_which_readings_differ_are_refused_with_both_orders_and_the_flag(kind: str) -> None:
    with pytest.raises(InputError, match=r"^takes: .*--order all.*") as told:
        in_order(HERE, UNCLEAR[kind])
    assert "frame number" in str(told.value) or "say which" in str(told.value)


def test_the_flag_chooses() -> None:
    names = UNCLEAR["a count before"]
    assert in_order(HERE, names, "last")[0] == names
    assert in_order(HERE, names, "all")[0] == [names[k] for k in (3, 1, 2, 0)]
    assert in_order(HERE, names, "name")[0] == sorted(names)
    assert in_order(HERE, UNCLEAR["two cameras"], "all")[0] == UNCLEAR["two cameras"]


def test_a_sequence_is_read_in_the_order_that_is_chosen(tmp_path: Path) -> None:
    for k, name in enumerate(UNCLEAR["a count before"]):
        (tmp_path / f"{name}.obj").write_text(f"v {k} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(InputError, match="--order last"):
        open_sequence(tmp_path)
    frames = open_sequence(tmp_path, SequenceOptions(order="last"))
    assert [mesh.vertices[0, 0] for mesh in frames] == [0, 1, 2, 3]


def test_a_folder_with_brackets_in_its_name_may_stand_before_a_pattern(tmp_path: Path) -> None:
    (tmp_path / "take [final]").mkdir()
    for k in range(3):
        (tmp_path / "take [final]" / f"m_{k}.obj").write_text(f"v {k} 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    frames = open_sequence(tmp_path / "take [final]" / "m_*.obj")
    assert [mesh.vertices[0, 0] for mesh in frames] == [0, 1, 2]
