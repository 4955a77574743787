"""Rows and pictures made up, for the tests of the report."""

from __future__ import annotations

from types import ModuleType

import numpy as np
from meshreel_bench.row_form import FAILED
from PIL import Image

from meshreel.metrics.comparison import ComparisonOptions

SIZE = 100  # pixels of a side


def row(sequence, codec, mbps, db, **changed):
    """A measured point whose other qualities follow from its dB."""
    base = {
        "point": f"{sequence} {codec} {mbps} {db}",
        "kind": "quality",
        "experiment": "made up",
        "sequence": sequence,
        "codec": codec,
        "options": {"quality": 50.0},
        "frames": 10,
        "mbps": mbps,
        "d2_psnr_paper": db,
        "symmetric_psnr": db - 2,
        "normal_error_deg": (90 - db) / 5,
        "ssim": 0.9 + db / 1000,
        "ssim_masked": db / 100,
        "encode_s": 7.0,
        "decode": {"frame_ms": mbps + 1, "peak_rss_mb": 90.0},
        "per_frame": [{"d2_psnr_paper": db}] * 10,
    }
    return base | changed


def failed(sequence, codec, reason):
    """A point of which nothing was measured."""
    base = {"point": f"{sequence} {codec}", "kind": "quality", "experiment": "made up", "sequence": sequence}
    return base | {"codec": codec, "options": {"qp": 9}, FAILED: reason}


def experiment(sections=()):
    """One that promises nothing; its sections are given."""
    chosen = ModuleType("made_up")
    chosen.COMPARISON = ComparisonOptions()
    chosen.points = lambda _small: iter(())
    chosen.references = lambda _sequence: {}
    chosen.promises = lambda _rows: []
    chosen.comparisons = lambda _rows: iter(())
    chosen.shown = list
    chosen.sections = lambda _rows: iter(sections)
    return {"made up": chosen}


def body(detail=(60, 20), size=SIZE):
    """A gray shape on white, that fills the middle; noise of colors where the detail is: top and left of 20 pixels."""
    picture = np.full((size, size, 3), 255, dtype=np.uint8)
    picture[10:90, 15:85] = 128
    top, left = detail
    picture[top : top + 20, left : left + 20] = np.random.default_rng(1).integers(0, 250, (20, 20, 3))
    return picture


def save(path, picture):
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture).save(path)


def pictured(folder, made, picture=None, limit=0.5, frame=5):
    """The row with pictures, which are written into the folder, and the original of its sequence."""
    name = f"{made['codec']}-{made['mbps']}".replace(" ", "_")
    picture = body() if picture is None else picture
    save(folder / f"{made['sequence']}-original.png", body() if picture.shape == body().shape else picture)
    save(folder / f"{name}.png", picture)
    save(folder / f"{name}-errors.png", np.where(picture == 255, 255, 40).astype(np.uint8))
    named = {"normals": f"{name}.png", "errors": f"{name}-errors.png", "frame": frame, "limit_percent": limit}
    return made | {"pictures": named}
