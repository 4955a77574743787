"""Masks: object numbers from all kinds of PNG, and errors for missing files."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from meshreel.errors import InputError
from meshreel.io.pictures import find_masks, read_mask
from meshreel.io.write import write_picture

NUMBERS = np.array([[0, 1, 2, 255], [0, 0, 7, 7]], np.uint8)


def test_gray_and_palette_and_black_and_white_pictures_give_their_numbers(tmp_path: Path):
    write_picture(NUMBERS, tmp_path / "gray.png")
    assert np.array_equal(read_mask(tmp_path / "gray.png"), NUMBERS)
    colored = Image.fromarray(NUMBERS)
    colored.putpalette(list(range(255, -1, -1)) * 3)
    colored.save(tmp_path / "palette.png")
    assert np.array_equal(read_mask(tmp_path / "palette.png"), NUMBERS)
    Image.fromarray(NUMBERS > 0).save(tmp_path / "two.png")
    assert np.array_equal(read_mask(tmp_path / "two.png") > 0, NUMBERS > 0)


@pytest.mark.parametrize(
    ("picture", "told"), [(np.zeros((4, 4, 3), np.uint8), "mode RGB"), (np.zeros((4, 4), np.uint16), "mode I")]
)
def test_pictures_of_other_kinds_are_refused(tmp_path: Path, picture: np.ndarray, told: str):
    Image.fromarray(picture).save(tmp_path / "other.png")
    with pytest.raises(InputError, match=rf"other\.png.*{told}.*8-bit gray"):
        read_mask(tmp_path / "other.png")


def test_every_damage_is_an_input_error_or_changes_nothing_but_pixels(tmp_path: Path):
    write_picture(NUMBERS, tmp_path / "whole.png")
    data = (tmp_path / "whole.png").read_bytes()
    path = tmp_path / "hurt.png"
    hurts = [data[:size] for size in range(0, len(data), 5)]
    hurts += [data[:k] + bytes([data[k] ^ 0xFF]) + data[k + 1 :] for k in range(0, len(data), 3)]
    for hurt in [*hurts, b"", b"mask"]:
        path.write_bytes(hurt)
        try:
            assert read_mask(path).dtype == np.uint8
        except InputError as error:
            assert "hurt.png" in str(error)
    with pytest.raises(InputError, match=r"none\.png"):
        read_mask(tmp_path / "none.png")


def folder(root: Path, names: list[str]) -> Path:
    for name in names:
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        write_picture(NUMBERS, root / name)
    return root


@pytest.mark.parametrize("style", ["view{0:02}/frame_{1:05}.png", "view_{0}/{1:03}.PNG", "{0}/mask2_{1}.png"])
def test_views_and_frames_are_found_by_the_last_numbers_of_their_names(tmp_path: Path, style: str):
    names = [style.format(view, frame) for view in range(2) for frame in range(11)]
    found = find_masks(folder(tmp_path, [*names, "other/7.png", "view00/notes.png"][: len(names)]), 2, 11)
    assert [[path.relative_to(tmp_path).as_posix() for path in files] for files in found] == [names[:11], names[11:]]


def test_what_is_missing_or_there_twice_is_reported(tmp_path: Path):
    root = folder(tmp_path, ["view00/frame_00000.png", "view00/frame_00002.png", "view01/frame_00000.png"])
    with pytest.raises(InputError, match=r"view00.*no mask of frame 1 \(1 of 3 are missing\).*a black one"):
        find_masks(root, 2, 3)
    with pytest.raises(InputError, match="no folder of view 2 of 3; name folders view00"):
        find_masks(root, 3, 1)
    folder(root, ["view00/again_0.png"])
    with pytest.raises(InputError, match=r"again_0\.png and frame_00000\.png are both frame 0; keep one"):
        find_masks(root, 2, 1)
    folder(root, ["1/frame_00000.png"])
    with pytest.raises(InputError, match="are both view 1"):
        find_masks(root, 2, 1)
    with pytest.raises(InputError, match="nowhere"):
        find_masks(root / "nowhere", 2, 1)
