"""`--quality` from 0 to 100: more costs more and is better by every metric, on a captured body and on a made one."""

from dataclasses import replace
from itertools import pairwise

import pytest

from meshreel.capture.simulated.procedural import SoftBodiesOptions, soft_bodies
from meshreel.decoder.video import open as open_video
from meshreel.encoder.group.forms import IntraOptions
from meshreel.encoder.paper.recipe import PaperOptions
from meshreel.encoder.sequence import encode
from meshreel.encoder.settings.options import EncoderOptions
from meshreel.encoder.settings.settings import Settings
from meshreel.geometry.decimate import decimate
from meshreel.geometry.topology import weld
from meshreel.io.sequence import SequenceOptions, open_sequence
from meshreel.metrics.comparison import ComparisonOptions, compare_sequences
from meshreel.metrics.viewpoints import ViewOptions
from meshreel.types import MeshList
from tests.shared_data import performer

QUALITIES = (0, 50, 100)  # few: every encode is one from the start
BETTER = ("d2_psnr_paper", "d1_psnr", "d2_psnr", "symmetric_psnr", "ssim_masked")
WORSE = ("normal_error_deg", "normal_error_at_vertices_deg")
LOOK = ComparisonOptions(views=ViewOptions(512, 512))  # of 128 x 128 pixels, SSIM is noise above .99


def quicker(options: EncoderOptions) -> EncoderOptions:
    """Few centers and few trials of the per-frame form; nothing that follows the quality is changed."""
    method = replace(options.method, intra=IntraOptions(fractions=(0.5, 1.0)))
    if isinstance(method, PaperOptions):
        method = replace(method, track=replace(method.track, centers=150, samples=3000))
    return replace(options, method=method)


def walker() -> MeshList:
    return MeshList(tuple(soft_bodies(SoftBodiesOptions(frames=2, people=1, spacing=0.06))))


def dancer() -> MeshList:
    frames = open_sequence(performer("dancer"), SequenceOptions(frames="4:6", weld=weld))
    return MeshList(tuple(decimate(mesh, 1500) for mesh in frames))


@pytest.mark.slow
@pytest.mark.parametrize("make", [walker, dancer], ids=["made", "captured"])
@pytest.mark.parametrize("preset", ["paper", "best"])
def test_quality_is_monotone(preset, make, tmp_path):
    body, rows = make(), []
    for quality in QUALITIES:
        path = tmp_path / f"{quality}.reel"
        size = encode(body, path, options=quicker(Settings(preset, quality).resolved())).size
        rows.append({"bytes": size} | compare_sequences(body, open_video(path), LOOK).to_row())
    for (a, low), (b, high) in pairwise(zip(QUALITIES, rows, strict=True)):
        between = f"from quality {a} to {b}"
        assert low["bytes"] < high["bytes"], between
        for metric in BETTER:
            assert low[metric] < high[metric], (metric, between)
        for metric in WORSE:
            assert low[metric] > high[metric], (metric, between)
