"""Shapes that animated files cannot hold are one-line errors that leave no file."""

import os
import sys
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

from meshreel.errors import InputError
from meshreel.export.animated_glb import GlbWriter, animated_glb
from meshreel.export.animated_usd import UsdWriter, animated_usd
from meshreel.export.shapes import Animation, Shape
from meshreel.types import Mesh
from tests.play_glb import PlayedGlb

WRITERS = {"glb": animated_glb, "usdc": animated_usd, "usda": animated_usd, "usdz": animated_usd}
TRIANGLE = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])


def animation(count: int = 3, origin: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Animation:
    return Animation(np.arange(count) / 10, 10.0, origin)


def shape(
    count: int = 3, vertices: np.ndarray = TRIANGLE, shown: tuple[tuple[int, int], ...] = ((0, 3),), first: int = 0
) -> Shape:
    """A triangle that rises by 1 from frame to frame."""
    faces = np.array([[0, 1, 2]], np.int32)
    frames = [Mesh(vertices + [0, 0, number], faces) for number in range(count)]
    return Shape("part", "name", faces, first, frames, shown)


@pytest.fixture(params=WRITERS)
def write(
    request: pytest.FixtureRequest, tmp_path: Path
) -> Callable[[Animation], AbstractContextManager[GlbWriter | UsdWriter]]:
    """Opens a writer of each kind on a file in an empty folder."""
    if request.param != "glb":
        pytest.importorskip("pxr")
    return lambda animation: WRITERS[request.param](tmp_path / f"a.{request.param}", animation)


def test_the_file_appears_at_the_end_alone(write, tmp_path):
    with write(animation()) as writer:
        writer.add(shape())
        assert not list(tmp_path.glob("a.*"))
    assert len(list(tmp_path.iterdir())) == len(list(tmp_path.glob("a.*"))) == 1


@pytest.mark.parametrize("far", [1e39, -1e300, np.inf, np.nan])
def test_a_vertex_that_is_too_far_is_reported(write, tmp_path, far):
    with pytest.raises(InputError, match="part, name: a vertex"), write(animation()) as writer:
        writer.add(shape(vertices=np.where(TRIANGLE == 1, far, TRIANGLE)))
    assert list(tmp_path.iterdir()) == []


def test_what_fails_in_the_block_leaves_nothing(write, tmp_path):
    with pytest.raises(KeyboardInterrupt), write(animation()) as writer:
        writer.add(shape())
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="names are Unicode on this system")
def test_a_folder_whose_name_is_no_text_is_reported_where_usd_cannot_take_it(tmp_path):
    pytest.importorskip("pxr")
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    folder.mkdir()
    with pytest.raises(InputError, match="not Unicode text"), animated_usd(folder / "a.usdc", animation()):
        pytest.fail("opened")
    with animated_glb(folder / "a.glb", animation()) as writer:
        writer.add(shape())
    assert [path.name for path in folder.iterdir()] == ["a.glb"]


def test_a_glb_that_would_be_too_long_is_reported_before_it_is(tmp_path, monkeypatch):
    with animated_glb(tmp_path / "a.glb", animation()) as writer:
        writer.add(shape())
    size = (tmp_path / "a.glb").stat().st_size
    monkeypatch.setattr("meshreel.io.glb_file.MOST_BYTES", size)
    with animated_glb(tmp_path / "a.glb", animation()) as writer:
        writer.add(shape())
    for most, what in ((size - 1, "description"), (100, "part, name")):
        monkeypatch.setattr("meshreel.io.glb_file.MOST_BYTES", most)
        told = pytest.raises(InputError, match=f"{what}.*{most} bytes.*fewer frames")
        with told, animated_glb(tmp_path / "b.glb", animation()) as writer:
            writer.add(shape())
    assert [path.name for path in tmp_path.iterdir()] == ["a.glb"]


def test_a_usdz_that_would_be_too_long_is_reported(tmp_path, monkeypatch):
    pytest.importorskip("pxr")
    monkeypatch.setattr("meshreel.export.animated_usd._MOST_PACKED", 100)
    told = pytest.raises(InputError, match=r"a.usdz: more than the 100 bytes")
    with told, animated_usd(tmp_path / "a.usdz", animation()) as writer:
        writer.add(shape())
    assert list(tmp_path.iterdir()) == []


def test_times_that_float32_cannot_distinguish_are_reported(tmp_path):
    times = np.array([0.0, 100.0, 100.000001])
    with pytest.raises(InputError, match=r"frame 1 .* 100 s"), animated_glb(tmp_path / "a.glb", Animation(times, 10)):
        pytest.fail("opened")
    assert list(tmp_path.iterdir()) == []


def test_usd_counts_in_frames_but_keeps_times_apart(tmp_path):
    Usd = pytest.importorskip("pxr.Usd")
    rounded, close = np.array([0, 0.033333, 0.066667, 0.11]), np.array([0, 1e-7, 2e-7, 3e-7])
    for number, (times, codes) in enumerate(((rounded, [0, 1, 2, 3.3]), (close, [0, 3e-6, 6e-6, 9e-6]))):
        with animated_usd(tmp_path / f"{number}.usdc", Animation(times, 30.0)) as writer:
            writer.add(shape(4, shown=((0, 4),)))
        stage = Usd.Stage.Open(str(tmp_path / f"{number}.usdc"))
        assert stage.GetPrimAtPath("/scene/part/name").GetAttribute("points").GetTimeSamples() == pytest.approx(
            codes, abs=1e-12
        )


def test_usd_is_saved_piece_by_piece_and_whole_all_the_same(tmp_path, monkeypatch):
    Usd = pytest.importorskip("pxr.Usd")
    monkeypatch.setattr("meshreel.export.animated_usd._MOST_UNSAVED", 100)
    with animated_usd(tmp_path / "a.usdc", animation()) as writer:
        sizes = []
        for number in range(3):
            writer.add(Shape("part", f"name {number}", *_rest(shape())))
            sizes.append(next(tmp_path.glob(".*/scene.usdc")).stat().st_size)
    assert sizes == sorted(set(sizes))
    stage = Usd.Stage.Open(str(tmp_path / "a.usdc"))
    prims = stage.GetPrimAtPath("/scene/part").GetChildren()
    assert [prim.GetName() for prim in prims] == ["name_0", "name_1", "name_2"]
    assert all(len(prim.GetAttribute("points").GetTimeSamples()) == 3 for prim in prims)


def _rest(made: Shape) -> tuple[object, ...]:
    return made.faces, made.first, made.frames, made.shown


def test_a_still_shape_comes_and_goes_in_a_glb(tmp_path):
    with animated_glb(tmp_path / "a.glb", animation(6)) as writer:
        writer.add(shape(1, shown=((1, 2), (4, 6)), first=1))
    played = PlayedGlb(tmp_path / "a.glb")
    seen = [len(played.shown(time)["part"]) for time in (0, 0.1, 0.15, 0.2, 0.35, 0.4, 0.55)]
    assert seen == [0, 1, 1, 0, 0, 1, 1]
    assert played.key_times[-1] == pytest.approx(0.6)


@pytest.mark.parametrize(("count", "dtype"), [(65535, 5123), (65536, 5125)])
def test_indices_have_16_bits_where_that_is_enough(tmp_path, count, dtype):
    """The greatest number of 16 bits is no index of glTF."""
    faces = np.array([[0, 1, count - 1]], np.int32)
    points = Mesh(np.arange(3.0 * count).reshape(-1, 3) / count, faces)
    with animated_glb(tmp_path / "a.glb", animation(1)) as writer:
        writer.add(Shape("part", "name", faces, 0, [points], ((0, 1),)))
    played = PlayedGlb(tmp_path / "a.glb")
    assert (
        played.tree["accessors"][-1]["componentType"] == dtype or played.tree["accessors"][0]["componentType"] == dtype
    )
    ((mesh, _),) = played.shown(0)["part"]
    assert np.array_equal(mesh.faces, faces)
