"""Playing on a browser that is slowed down, in the place of a headset (the paper's figure 9)."""

from __future__ import annotations

from itertools import product

from ..datasets import WITH_CRANE
from ..rows import Options
from .study import HEADSET, Measure, Study, Sweep

ENCODED: Options = {"preset": "best", "quality": 50.0}  # the file that is played
AARCH64 = "aarch64"
SEQUENCES, LEVELS = ("dancer", WITH_CRANE, "room2"), (0, 1, 2)
THROTTLES, RATES = (1, 4, 6), (24, 30, 72)
FILM, MORE = 24, (2, 10)  # Hz, and throttles at that rate alone: up to where it is not held
HOLDS = 0.95  # of the pictures that a display asks for; the rest may be lost to neighbours on the machine (guess)
CASES = [(level, k, rate) for level, rate, k in product(LEVELS, RATES, THROTTLES)]
CASES += [(level, k, FILM) for level, k in product(LEVELS, MORE)]
VARIED = dict(zip(("level", "throttle", "rate"), zip(*CASES, strict=True), strict=True))
STUDY = Study(
    title="Playing in a browser that is slowed down",
    sequences=SEQUENCES,
    sweeps=(Sweep(HEADSET, VARIED), Sweep(HEADSET, {}, {"machine": AARCH64})),
    measures=(
        Measure("main_ms", "main thread a picture", " ms", -1),
        Measure("fps", "pictures shown a second"),
        Measure("main_99_ms", "99 % of them below", " ms", -1),
        Measure("decode_group_ms", "decoding a group", " ms", -1),
        Measure("decode_load", "its load", sign=-1),
        Measure("dropped", "dropped", sign=-1),
        Measure("shown_share", "shown of those asked for"),
        Measure("heap_mb", "heap", " MB", -1),
        Measure("upload_mb_s", "uploads", " MB/s", -1),
        Measure("triangles", "triangles"),
    ),
    rate="throttle",
    over="times slower",
    notes=(
        "This is no headset: headless Chromium with the player's `?bench` page, 320 x 240 pixels, slowed down so many",
        "times. DevTools slow down the main thread (`Emulation.setCPUThrottlingRate`), and refuse to slow down workers",
        "(*Operation is only supported for pages, not workers*); a script before that of a decoding worker holds each",
        "answer back until so many times of what it took has passed, which its times include. The compositor, the",
        "network and what draws keep their speed. A display asks for pictures 24, 30 or 72 times a second.",
        "Without a GPU SwiftShader draws in software, beside the page on the same cores: its times, and pictures lost",
        "to it, are not a headset's. JavaScript of a picture, uploads and decoding are the player's own.",
        "",
        "The recording is joined to itself until it lasts six seconds, so that its groups are decoded and uploaded as",
        "it plays. *Main thread* is JavaScript of a picture; *its load* decoding time of a worker over playing time;",
        "*heap* the page's, without the workers'; Mbps are of the levels played. Other jobs of a machine show in all;",
        "a point that loses one picture in twenty is measured twice, and the try that shows more counts.",
        "How strong a throttle still holds 24 pictures a second is in [reproducing.md](../reproducing.md).",
        "",
        "Points with `machine aarch64` compare all decoded frames with those of the decoder compiled for aarch64 under",
        "QEMU (`scripts/aarch64 FILE`; without a file it compares the conformance files).",
    ),
)
