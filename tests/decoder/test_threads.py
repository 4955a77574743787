"""Threads that share a Video: each read of any file, with all that belongs to a frame, is what one thread reads."""

import hashlib
import random
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import meshreel
from meshreel.decoder.cache import CachedGroups
from meshreel.decoder.pictures import Decoders, TrackPictures
from meshreel.decoder.tracks import Background
from meshreel.decoder.video import Video
from tests.golden import GOLDEN

THREADS, READS = 4, 40
FILES = sorted(GOLDEN.rglob("*.reel"))
CACHES = [(CachedGroups, "by_track"), (Background, "_last"), (Decoders, "splats")]
CACHES += [(TrackPictures, "_layouts"), (TrackPictures, "_background")]


def shown(video: Video, frame: int) -> str:
    """A digest of all that a frame has."""
    found, splats = hashlib.blake2b(), video.splats(frame)
    arrays = [] if splats is None else [splats.means, splats.opacities, splats.colors]
    for mesh in (*video.parts(frame).values(), video.background(frame)):
        arrays += [mesh.vertices, mesh.faces, mesh.colors, mesh.uv, mesh.texture and mesh.texture.pixels]
    for array in arrays:
        found.update(b"-" if array is None else array.tobytes())
    return found.hexdigest()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.stem)
def test_each_thread_gets_the_frame_that_it_asked_for(path: Path) -> None:
    alone = meshreel.open(path)
    wanted = [shown(alone, frame) for frame in range(len(alone))]
    shared = meshreel.open(path)

    def read(seed: int) -> list[int]:
        chosen = random.Random(seed)
        frames = [chosen.randrange(len(shared)) for _ in range(READS)]
        return [frame for frame in frames if shown(shared, frame) != wanted[frame]]

    with ThreadPoolExecutor(THREADS) as threads:
        assert [*threads.map(read, range(THREADS))] == [[]] * THREADS


class Contended:
    """A cache as a thread sees it beside another, which always has just replaced what it stored by something older."""

    def __init__(self) -> None:
        self.stored = dict[int, list[object]]()  # by object

    def __get__(self, owner: object, kind: type) -> object:
        seen = self.stored[id(owner)]
        return random.Random(len(seen)).choice(seen)

    def __set__(self, owner: object, value: object) -> None:
        self.stored.setdefault(id(owner), []).append(value)


@pytest.mark.parametrize(("of", "name"), CACHES, ids=lambda value: getattr(value, "__name__", value))
def test_a_cache_that_another_thread_replaced_is_used_only_where_it_is_right(
    of: type, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in FILES:
        alone = meshreel.open(path)
        wanted = [shown(alone, frame) for frame in range(len(alone))]
        with monkeypatch.context() as contended:
            contended.setattr(of, name, Contended(), raising=False)
            shared = meshreel.open(path)
            for frame in (*range(len(shared)), *reversed(range(len(shared)))):
                assert shown(shared, frame) == wanted[frame], f"{path.name}, frame {frame}"
