from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.metrics.error_sheet import SheetOptions, _rows, error_at_pixels, write_sheet
from meshreel.metrics.render import look
from meshreel.metrics.viewpoints import Box, ViewOptions, views_around
from meshreel.types import Mesh, MeshList

from .shapes import moved, noisy, sphere

BODY = sphere(levels=3)


def test_the_error_of_a_pixel_is_the_distance_of_what_it_sees():
    fine = sphere(levels=5)
    camera = views_around(Box.of([fine]), ViewOptions(64, 64))[0]
    view = look(fine, camera)
    errors = error_at_pixels(view, moved(sphere(1.1, 5), (0, 0, 0)))
    assert np.allclose(errors, 0.1, atol=3e-3) and len(errors) == view.covered.sum() > 500
    offset = (1e6, 1e6, -1e6)
    far = look(moved(fine, offset), views_around(Box.of([moved(fine, offset)]), ViewOptions(64, 64))[0])
    assert np.allclose(error_at_pixels(far, moved(sphere(1.1, 5), offset)), 0.1, atol=3e-3)
    assert np.isinf(error_at_pixels(view, Mesh.empty())).all()


@pytest.mark.parametrize("unit", ["percent", "mm"])
def test_a_sheet_is_a_png_with_a_line_for_each_frame(tmp_path: Path, unit: str):
    image = pytest.importorskip("matplotlib.image")
    decoded = MeshList(tuple(noisy(BODY, 0.02, i) for i in range(4)))
    options = SheetOptions(frames=(1, 3), height=64, unit=unit)
    path = tmp_path / "sheet.png"
    write_sheet(MeshList((BODY,) * 4), decoded, path, options)
    assert [p.name for p in tmp_path.iterdir()] == ["sheet.png"]
    picture = image.imread(path)
    assert picture.shape[0] > 2 * 64 and picture.shape[1] > 3 * 64
    assert picture[..., :3].std() > 0.02


def test_frames_have_the_numbers_of_the_sequence_that_they_are_of_and_their_colours():
    red, plain = (replace(BODY, colors=np.tile(np.uint8([255, 0, 0]), (len(BODY.vertices), 1))), BODY)
    options = SheetOptions(frames=(12,), first=10, height=64)
    (row,) = _rows(MeshList((plain, plain, red)), MeshList((plain, plain, red)), options)
    assert row.label.startswith("frame 12\n")
    for picture in row.pictures:
        assert np.array_equal(np.unique(picture[row.original.covered], axis=0), [[1, 0, 0]])
    (row,) = _rows(MeshList((red,) * 3), MeshList((plain,) * 3), options)
    assert np.array_equal(row.pictures[0], row.original.colors)
    with pytest.raises(InputError, match="frames 10 to 12"):
        list(_rows(MeshList((red,) * 3), MeshList((plain,) * 3), SheetOptions(frames=(0,), first=10)))


def test_a_sheet_is_seen_from_the_cameras_that_are_given(tmp_path: Path):
    image = pytest.importorskip("matplotlib.image")
    cameras = tuple(views_around(Box.of([BODY]), ViewOptions(96, 64)))
    write_sheet(MeshList((BODY,)), MeshList((BODY,)), tmp_path / "sheet.png", SheetOptions(cameras=cameras[:3]))
    picture = image.imread(tmp_path / "sheet.png")
    assert 3 * 64 < picture.shape[0] < 4 * 64 and 3 * 96 < picture.shape[1] < 3 * 96 + 300
    with pytest.raises(InputError, match="one size"):
        SheetOptions(cameras=(cameras[0], views_around(Box.of([BODY]), ViewOptions(32, 32))[0]))


@pytest.mark.parametrize(
    "pair", [(BODY, Mesh.empty()), (Mesh.empty(), BODY), (Mesh.empty(), Mesh.empty()), (BODY, BODY)]
)
def test_empty_and_identical_frames_can_be_drawn(tmp_path: Path, pair: tuple[Mesh, Mesh]):
    write_sheet(MeshList(pair[:1]), MeshList(pair[1:]), tmp_path / "sheet.png", SheetOptions(height=48))
    assert (tmp_path / "sheet.png").stat().st_size > 1000


def test_missing_frames_are_refused(tmp_path: Path):
    one, two = MeshList((BODY,)), MeshList((BODY, BODY))
    with pytest.raises(InputError, match="0 to 0"):
        write_sheet(one, one, tmp_path / "sheet.png", SheetOptions(frames=(1,)))
    with pytest.raises(InputError, match="1 and 2"):
        write_sheet(two, one, tmp_path / "sheet.png")
    assert not list(tmp_path.iterdir())
