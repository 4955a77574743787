"""Presets: one name and one quality from 0 to 100 set every option of the encoder.

In -> out: what a user chooses -> EncoderOptions. The curves were fitted to rate-distortion points of a captured dancer
(decision 9); docs/results.md has the rates they lead to.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...analysis.appearance.splat_fit import FitSplatsOptions
from ...analysis.follow.embedded import Stage
from ...analysis.follow.template import TemplateOptions
from ...analysis.reference.extraction import ReferenceOptions
from ...analysis.reference.fuse import FuseOptions
from ...analysis.reference.track import TrackOptions
from ...analysis.scene.background import BackgroundOptions
from ...coding.appearance.colors import ColorCodingOptions
from ...coding.appearance.pictures import VideoOptions
from ...coding.layers.coder import LayerCodingOptions
from ...coding.paper.displacements import DisplacementOptions
from ...errors import InputError
from ...geometry.strict import rounded
from ..appearance.options import AppearanceOptions, SplatOptions, TextureOptions
from ..group.draco import IntraOptions
from ..group.target import Fidelity
from ..layers.options import LayersOptions
from ..paper.options import PaperOptions
from .options import EncoderOptions, SceneOptions

LITERAL_DEPTH = 9  # of Poisson reconstruction (paper, section 3.3.2)
KNEE = 85.0  # quality above which steps are halved every 8 points: the curve ended for want of steps (decision 33)
DENSEST = 95.0  # quality from which the template is as it is: a denser one's normals are worse (decision 33)
EXACT = 99.0  # quality from which layers that miss the target give way to Draco in every frame (decision 33)
EXACT_DISTANCE = (0.5, 0.43)  # of the motion's step, RMS, that such frames have at most, at EXACT and at 100
EXACT_ANGLE = (1.95, 1.85)  # degrees that they have at most: pictures show normals more than distances
# Candidates of these frames: where few vertices are lost, a coarser lattice costs less than it spoils.
EXACT_INTRA = IntraOptions(
    fractions=(0.04, 0.08, 0.15, 0.25, 0.35, 0.4, 0.45, 0.475, 0.5, 0.525, 0.55, 0.575, 0.6, 0.65, 0.7, 1.0),
    steps=(4.5, 3.7, 3.0, 2.4, 2.0, 1.7, 1.4, 1.2, 1.0, 0.8, 0.5),
    finer=True,
)
LITERAL_ANCHORS = 400  # anchors of a reference in `paper-literal`: the paper gives no number (guess)
PRESETS = ("best", "paper", "paper-literal")
COLORS = ("auto", "texture", "vertices", "none")
EFFORTS = ("fast", "normal", "thorough")


def preset_options(
    preset: str = "best",
    quality: float = 50.0,
    basis_size: int | None = None,
    group_size: int | None = None,
    centers: int | None = None,
    key_interval: float | None = None,
    effort: str = "normal",
    color: str = "auto",
    color_quality: float | None = None,
    texture: int | None = None,
    compatible: bool = False,
    splats: int | None = None,
) -> EncoderOptions:
    """Return the encoder's options for a preset at a quality; `basis_size` fixes the components of a group.

    `effort` is how long the preset `best` searches: see `EFFORTS`. `color` is one of `COLORS`: textures where the
    frames have pictures, textures always, colours of vertices only, or none; `color_quality` is that of colours, by
    default `quality`; `texture` is the width of textures, texels; `compatible` adds them as H.264; `splats` is
    how many splats a chain of groups has, none if not given. Raises InputError for an unknown preset or values out of
    range.
    """
    if preset not in PRESETS:
        raise InputError(f"no preset is called {preset!r}; known: {', '.join(PRESETS)}")
    if not 0 <= quality <= 100:
        raise InputError(f"quality must be in 0 to 100, got {quality:g}")
    if preset == "best" and basis_size is not None:
        raise InputError(f"basis size {basis_size}: preset `best` chooses the components; use preset `paper`")
    if preset == "best" and centers is not None:
        raise InputError(f"centers {centers}: preset `best` tracks none; use preset `paper`")
    if effort not in EFFORTS:
        raise InputError(f"no effort is called {effort!r}; known: {', '.join(EFFORTS)}")
    if preset != "best" and effort != "normal":
        raise InputError(f"effort {effort}: preset `{preset}` has one effort; use preset `best`")
    if preset != "best" and key_interval is not None:
        raise InputError(f"key interval {key_interval:g}: groups of preset `{preset}` all decode on their own")
    method = (
        layers_options(float(quality), effort)
        if preset == "best"
        else paper_options(float(quality), centers, basis_size, preset == "paper-literal")
    )
    if group_size is not None:
        method = replace(method, group_size=group_size)
    appearance = appearance_options(
        float(quality if color_quality is None else color_quality), color, texture, compatible, splats
    )
    scene = SceneOptions(background=_background(float(quality)))
    options = EncoderOptions(method, scene, appearance, quality=float(quality))
    return options if key_interval is None else replace(options, key_interval=key_interval)


def paper_options(
    quality: float = 50.0, centers: int | None = None, basis_size: int | None = None, literal: bool = False
) -> PaperOptions:
    """Return the options of the paper's recipe at a quality; `literal`: without what is better than the paper's words.

    What the paper leaves open is then as in its release: vertices are displaced to the nearest of a frame's.
    """
    step = displacement_step(quality)
    centers = 2000 if centers is None else centers
    options = PaperOptions(
        track=TrackOptions(centers=centers, samples=max(45_000, 4 * centers)),
        target=Fidelity(distance=0.5 * step + 0.0001, angle=7.0, worst=step),
        reference=ReferenceOptions(vertices=reference_vertices(quality)),
        displacements=DisplacementOptions(step=step, basis_size=basis_size),
    )
    if not literal:
        return options
    anchored = replace(options.displacements, anchor_count=LITERAL_ANCHORS)
    reference = replace(options.reference, fuse=FuseOptions(poisson=LITERAL_DEPTH))
    return replace(
        options,
        reference=reference,
        pose="mds",
        fit="nearest",
        rounding="plain",
        steps="uniform",
        cuts=False,
        displacements=anchored,
    )


def layers_options(quality: float = 50.0, effort: str = "normal") -> LayersOptions:
    """Return the options of the recipe of layers at a quality."""
    step, coarser = motion_step(quality), _step(quality)
    options = LayersOptions(
        target=Fidelity(distance=0.2 * coarser + 0.00005, angle=7.0, worst=coarser),  # what templates reach
        template=TemplateOptions(error=rounded(0.00088 * (motion_step(min(quality, DENSEST)) / 0.0012) ** 0.55)),
        layers=LayerCodingOptions(step=step),
        tolerance=tolerance(quality),
    )
    if quality >= EXACT:
        share, angle = (rounded(np.interp(quality, (EXACT, 100.0), ends)) for ends in (EXACT_DISTANCE, EXACT_ANGLE))
        target = Fidelity(distance=share * step, angle=angle, worst=step)
        options = replace(options, target=target, flat=1.0, intra=EXACT_INTRA)
    if effort == "fast":
        return _fast(options)
    if effort == "thorough":  # more keys, tried also where a plan is good already, and more templates (decision 24)
        plan = replace(options.plan, keys=8, misses=3, settled=0.25, gain=0.05)
        return replace(options, plan=plan, errors=(0.8, 1.25))
    return options


def tolerance(quality: float) -> float:
    """RMS noise of a recording, times which nothing is coded: 1 at 50, halved every 32 points (decision 28)."""
    return rounded(2 ** ((50 - quality) / 32))


def _background(quality: float) -> BackgroundOptions:
    usual, times = BackgroundOptions(), tolerance(quality)
    return replace(usual, coarse=rounded(usual.coarse * times), lattice=rounded(usual.lattice * times))


def _fast(options: LayersOptions) -> LayersOptions:
    """Return options with fewer keys, rounds, nodes and samples, and without patches (decision 24)."""
    coarse = Stage(150, (0.1, 0.045, 0.024), (10.0, 1.0, 0.1))
    fine = Stage(600, (0.024, 0.012), (0.3, 0.05))
    rounds = replace(options.fit, gates=(0.018, 0.012), smoothing=(2.0, 0.4), strides=(4, 1))
    return replace(
        options,
        embedded=replace(options.embedded, coarse=coarse, fine=fine, samples=3000),
        fit=replace(rounds, iterations=20, tolerance=3e-3),
        plan=replace(options.plan, keys=2, misses=1),
        tails=None,
        measured=4,
        floor=False,
    )


def motion_step(quality: float) -> float:
    """Quantiser step of the base's motion as a fraction of the diagonal: .0018 at 50, halved every 25 points.

    Above the knee every 8 points.
    """
    return rounded(0.0018 * 2 ** ((50 - min(quality, KNEE)) / 25 - max(quality - KNEE, 0.0) / 8))


def _step(quality: float) -> float:
    """The same without a knee."""
    return rounded(0.0018 * 2 ** ((50 - quality) / 25))


def appearance_options(
    quality: float = 50.0,
    color: str = "auto",
    texture: int | None = None,
    compatible: bool = False,
    splats: int | None = None,
) -> AppearanceOptions | None:
    """Return the options of colours at a quality; None for no colours. Raises InputError for values out of range."""
    if color not in COLORS:
        raise InputError(f"color must be one of {', '.join(COLORS)}, got {color!r}")
    if not 0 <= quality <= 100:
        raise InputError(f"color quality must be in 0 to 100, got {quality:g}")
    if (texture is not None or compatible) and color in ("vertices", "none"):
        given = f"texture {texture}" if texture is not None else "compatible"
        raise InputError(f"{given} and color {color!r}: there are no textures; leave one of both out")
    if color == "none":
        if splats is not None:
            raise InputError(f"{splats} splats and color 'none': splats are fitted to colours; leave one of both out")
        return None
    drawn = None if splats is None else SplatOptions(FitSplatsOptions(splats))
    vertices, video = ColorCodingOptions(step=color_step(quality)), VideoOptions(crf=rate_factor(quality))
    if color == "vertices":
        return AppearanceOptions(vertices, None, splats=drawn)
    return AppearanceOptions(vertices, TextureOptions(texture, video, color == "texture", compatible), splats=drawn)


def rate_factor(quality: float) -> int:
    """Constant rate factor of textures' video: 42 at 50, 54 at 20, 30 at 80."""
    return round(62 - 0.4 * quality)


def color_step(quality: float) -> float:
    """Quantiser step of colours of vertices as a share of their range: .0909 at 50, halved every 35 points."""
    return rounded(0.0909 * 2 ** ((50 - quality) / 35))


def displacement_step(quality: float) -> float:
    """Quantiser step of the displacements as a fraction of the diagonal: .0008 at 50, halved every 25 points."""
    return rounded(0.0008 * 2 ** ((50 - quality) / 25))


def reference_vertices(quality: float) -> int:
    """Number of vertices of the reference mesh: 800 at 0, 2000 at 50, 5000 at 100."""
    return round(2000 * 2.5 ** ((quality - 50) / 50))
