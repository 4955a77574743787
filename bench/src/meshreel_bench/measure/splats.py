"""Table 3: splats on decoded meshes, judged by renders from cameras and in frames that they were not fitted to.

Pictures are cut to the body; the rate is that of a set of splats for each chain of groups that share a base mesh, or
for each frame.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from meshreel.analysis.appearance.splat_fit import GOLDEN, SplatFrame, SplatView, fit_splats, rendered, ring
from meshreel.cli.compare import ASIDE, errors
from meshreel.coding.appearance.splats import decode_splats, encode_splats
from meshreel.errors import InputError
from meshreel.export.frames import write_splats
from meshreel.format.layout import MAGIC
from meshreel.geometry.splats import Bound, Carrier, bind
from meshreel.types import Mesh, evenly

from ..datasets import Dataset
from ..datasets.solid import Chain, chains_of

COUNT, SIZE = 8000, 256  # splats, and pixels of the longer side of the body
FITTED, VIEWS, VIEWS_ALONE = 16, 6, 16  # frames of a chain, cameras of each, and of a frame with splats of its own
STEPS, STEPS_ALONE = 900, 200
JUDGED = 4  # frames of those that were fitted to, and as many between these
HELD = 4  # cameras of each
PATH = "splat-transform"  # of npm: PlayCanvas' converter, which writes SPZ and SOG
FLOATS = 14  # numbers of a splat with harmonics of degree 0: place 3, scale 3, rotation 4, opacity, colour 3
# Squared errors of pictures against the originals, scores, and sizes, counts and times of sets of splats, by name.
_Found = defaultdict[str, list[float]]


def splat_values(
    known: Dataset, painted: Callable[[int], Mesh], decoded: Sequence[Mesh], numbers: Sequence[int], data: bytes
) -> dict[str, float]:
    """Return quality and rate of splats on decoded frames; `painted` returns a frame in colour."""
    count, unit = len(known.sequence), known.sequence[0].diagonal  # splats are in units of it, as in a file
    alone = ([(k, Carrier(mesh.vertices, mesh.faces, 0))] for k, mesh in zip(numbers, decoded, strict=True))
    chains = chains_of(data) if data.startswith(MAGIC) else list(alone)
    chains = [[(k, replace(c, vertices=c.vertices / unit)) for k, c in chain] for chain in chains]
    of_frame = {number: chain for chain in chains for number, _ in chain}
    wanted = [k for k in evenly(count, JUDGED) if k in of_frame]
    found, alone_each = _Found(list), _Found(list)
    last: Bound | None = None
    of_unit = lambda k: (mesh := painted(k)).at(mesh.vertices / unit)  # noqa: E731
    for chain in {id(of_frame[k]): of_frame[k] for k in wanted}.values():
        last = _judge(chain, [k for k in wanted if k in dict(chain)], of_unit, found)
        for k in (k for k in wanted if k in dict(chain) and len(chain) > 1):
            _judge([(k, dict(chain)[k])], [k], of_unit, alone_each)
    rate = known.sequence.frame_rate
    whole = _values(found, len(chains), count, rate)
    own = _values(alone_each, count, count, rate) if alone_each else whole  # where all frames are alone
    return whole | {f"splats_own_{name}": own[f"splats_{name}"] for name in ("psnr", "ssim")} | _anchors(last, rate)


def _judge(chain: Chain, wanted: Sequence[int], painted: Callable[[int], Mesh], found: _Found) -> Bound:
    """Fit the splats of a chain to every second frame, and judge them in some of these and in the frames after."""
    some = chain[::2] if len(chain) > 1 else chain
    chosen = [some[k] for k in evenly(len(some), FITTED)]
    views, steps = (VIEWS, STEPS) if len(chosen) > 1 else (VIEWS_ALONE, STEPS_ALONE)
    frames = [SplatFrame(carrier, _rendered(painted(k), views, GOLDEN * k)) for k, carrier in chosen]
    start = time.process_time()
    splats, importance = fit_splats(frames, COUNT, steps)
    found["seconds"].append(time.process_time() - start)
    payload, _ = encode_splats(splats, importance)
    coded, carriers, last = decode_splats(payload, 1 + int(splats.faces.max())), dict(chain), None
    found["size"].append(len(payload))
    found["count"].append(len(splats))
    known = np.array([k for k, _ in chosen])
    fitted = {int(known[np.abs(known - k).argmin()]) for k in wanted}
    between = {k + 1 for k in fitted} & carriers.keys()
    for number in sorted(fitted | between):
        for view in _rendered(painted(number), HELD, GOLDEN * number + ASIDE):
            last = bind(coded, carriers[number])
            square, score = errors(last, view)
            for name in ("whole", "fitted" if number in fitted else "between"):
                found[name].append(square)
            found["ssim"].append(score)
            found["exact"].append(errors(bind(splats, carriers[number]), view)[0])
    assert last is not None
    return last


def _rendered(mesh: Mesh, views: int, turn: float) -> tuple[SplatView, ...]:
    return rendered(mesh, ring(mesh, views, SIZE, turn))


def _values(found: _Found, sets: int, frames: int, rate: float) -> dict[str, float]:
    means = {name: float(np.mean(values)) for name, values in found.items()}
    db = {name: -10 * float(np.log10(means[name])) for name in ("whole", "exact", "fitted", "between") if name in means}
    size = means["size"]
    return {
        "splats_psnr": db["whole"],
        "splats_ssim": means["ssim"],
        "splats_lost_db": db["exact"] - db["whole"],
        "splats_fitted_psnr": db["fitted"],
        **({"splats_between_psnr": db["between"]} if "between" in db else {}),
        "splats_set_bytes": size,
        "splats_sets": sets,
        "splats_count": means["count"],
        "splats_mbps": 8 * size * sets * rate / frames / 1e6,
        "splats_per_frame_mbps": 8 * size * rate / 1e6,
        "splats_fit_s": means["seconds"],
    }


def _anchors(bound: Bound | None, rate: float) -> dict[str, float]:
    """Return the rates of the same splats, a frame each: raw, and as SPZ and SOG where their converter is installed."""
    assert bound is not None
    found = {"splats_raw_mbps": 8 * 4 * FLOATS * len(bound.means) * rate / 1e6}
    if shutil.which(PATH) is None:
        return found
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "frame.ply")
        write_splats(bound, source)
        for ending in ("spz", "sog"):
            path = Path(folder, f"frame.{ending}")
            done = subprocess.run([PATH, "-q", "-w", "-g", "cpu", source, path], capture_output=True, check=False)
            if done.returncode or not path.exists():
                raise InputError(f"{PATH} cannot write {ending}: {done.stderr.decode()[-200:]}")
            found[f"splats_{ending}_mbps"] = 8 * path.stat().st_size * rate / 1e6
    return found
