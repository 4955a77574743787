"""meshreel itself, by the functions that its users call. In -> out: a sequence <-> a .reel file."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path
from typing import TypeVar

import numpy as np
from threadpoolctl import threadpool_limits

from meshreel.encoder.group.interval import Interval
from meshreel.encoder.group.progress import IntervalStages
from meshreel.encoder.layers.options import LayersOptions
from meshreel.encoder.paper.recipe import Fitted, FoundGroup, PaperOptions, find_groups
from meshreel.encoder.sequence import Encoder
from meshreel.encoder.settings.options import EncoderOptions, SceneOptions, plain_displacements
from meshreel.encoder.settings.settings import Settings
from meshreel.errors import InputError
from meshreel.geometry.work import reporting
from meshreel.types import MeshSequence

from ..codec import Progress, TwoSteps, of_encoder
from .broken import STAGES, BrokenOptions


class Prepared(TwoSteps):
    """A codec that first prepares an encoder of meshreel."""

    __slots__ = ()

    @property
    def encoder_options(self) -> EncoderOptions:
        """Options of the encoder."""
        raise NotImplementedError

    @property
    def analysis_key(self) -> str:
        """Equal for options with which `prepare` finds the same."""
        return repr(shared_options(self.encoder_options))

    def analyse(self, sequence: MeshSequence, progress: Progress | None = None) -> Encoder:
        """Return an encoder that has found what operating points share. Raises InputError for unusable frames."""
        encoder = Encoder(sequence, progress=of_encoder(progress))
        prepare(encoder, self.encoder_options)
        return encoder


@dataclass(frozen=True, slots=True)
class MeshreelCodec(Prepared):
    """A preset at a quality; options that are None keep the preset's values; `basis_size` is m; see `.variants`."""

    preset: str = "paper"
    quality: float = 50.0  # 0 to 100
    basis_size: int | None = None
    group_size: int | None = None
    centers: int | None = None
    color: str = "none"  # studies of geometry compare with codecs that have no colours
    color_quality: float | None = None
    texture: int | None = None
    key_interval: float | None = None  # s
    variant: str | None = None

    def __post_init__(self) -> None:
        find_variant(self.variant)

    @property
    def name(self) -> str:
        """The name in rows and plots; colours, their own quality, keys, a fixed m or a variant make another curve."""
        colored = "" if self.color == "none" else f", {self.color}"
        if self.color_quality is not None:
            colored += f", geometry at {self.quality:g}"
        if self.key_interval is not None:
            colored += f", keys each {self.key_interval:g} s"
        changed = "" if self.variant is None else f", {self.variant}"
        return f"meshreel {self.preset}{colored}{changed}" + ("" if self.basis_size is None else " m")

    @property
    def encoder_options(self) -> EncoderOptions:
        chosen = {name: value for name, value in asdict(self).items() if value is not None and name != "variant"}
        return find_variant(self.variant)(Settings(**chosen).resolved())

    def code(self, analysis: Encoder, progress: Progress | None = None) -> bytes:
        analysis.progress = of_encoder(progress)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "video.reel"
            analysis.encode(path, self.encoder_options)
            return path.read_bytes()


Found = tuple[tuple[int, Fitted | None], ...]  # of each group its number of frames, and the reference that follows them


class GroupStore:
    """Groups by interval and options, each found once. It keeps references and positions, but no frames."""

    def __init__(self) -> None:
        self._known: dict[bytes, Found] = {}

    def find(self, interval: Interval, options: PaperOptions) -> list[FoundGroup]:
        """Return the groups of `paper.find_groups`."""
        if (key := _key(interval, options)) not in self._known:
            found = find_groups(interval, options)
            self._known[key] = tuple((len(group.frames), group.fitted) for group in found)
        frames = iter(interval.frames)
        return [FoundGroup(list(islice(frames, count)), fitted) for count, fitted in self._known[key]]


@threadpool_limits.wrap(limits=1)
def prepare(encoder: Encoder, options: EncoderOptions) -> None:
    """Find in advance what `encode` finds before a rate is chosen; raises what `encode` raises.

    These are the parts of a scene and, for the paper's recipe, its groups for any size of the basis. They take a few
    hundred kB a frame, as long as the encoder lives.
    """
    encoder.parts(options)
    if isinstance(options.method, PaperOptions):
        store, whole = GroupStore(), encoder.stages()
        encoder.find = store.find
        whole.expect("paper")
        for interval in encoder.intervals(options):
            stages = IntervalStages(whole.passed, len(interval.frames), options.method.group_size, interval.weight)
            if not interval.frames[0].is_empty:
                with reporting(stages.passed):
                    store.find(interval, options.method)
            stages.reach("refine", len(interval.frames))


def shared_options(options: EncoderOptions) -> EncoderOptions:
    """Return the options with defaults for all that encodes at several rates need not share.

    The paper's recipe shares all but the coding of displacements; that of layers only how a scene is taken apart.
    """
    if isinstance(options.method, PaperOptions):
        return replace(options, method=_shared(options.method), quality=EncoderOptions().quality)
    return EncoderOptions(scene=options.scene)


def _shared(options: PaperOptions) -> PaperOptions:
    return replace(options, displacements=PaperOptions().displacements)


def _key(interval: Interval, options: PaperOptions) -> bytes:
    """Return a key that is equal where the groups are."""
    digest = hashlib.sha256(repr((_shared(options), interval.noise)).encode())
    for frame in interval.frames:
        for array in (frame.vertices, frame.faces):
            digest.update(repr((array.shape, array.dtype)).encode())
            digest.update(np.ascontiguousarray(array).data)
    return digest.digest()


UNIFORM, IN_MDS_POSE, BOTH = "one step, plain rounding", "MDS pose, no cuts", "MDS pose, no cuts, one step"
RELEASED, LARGER = "the release's step", "reference of 5000 vertices"
TOGETHER, FROM_MESHES = "one sequence", "background from meshes"  # of a scene
RELEASED_STEP = 5e-5  # of a diagonal: the release has 1e-4 m, and people's diagonals are about 2 m
Change = Callable[[EncoderOptions], EncoderOptions]
Method = TypeVar("Method", LayersOptions, PaperOptions)


def _method(kind: type[Method], text: str, change: Callable[[Method], Method]) -> Change:
    """Return a change of one method; `text` names the method and its presets in errors."""

    def changed(options: EncoderOptions) -> EncoderOptions:
        if not isinstance(options.method, kind):
            raise InputError(f"this variant changes {text}")
        return replace(options, method=change(options.method))

    return changed


_layers = partial(_method, LayersOptions, "the recipe of layers; use preset `best`")
_paper = partial(_method, PaperOptions, "the paper's recipe; use preset `paper` or `paper-literal`")


def _plain(options: PaperOptions) -> PaperOptions:
    """One step, plain rounding, and as many anchors as `paper-literal` has."""
    return replace(options, displacements=plain_displacements(options.displacements))


def _scene(change: Callable[[SceneOptions], SceneOptions]) -> Change:
    return lambda options: replace(options, scene=change(options.scene or SceneOptions()))


PARTS: dict[str, Change] = {  # of preset `best`, switched off
    "no shared detail": _layers(lambda o: replace(o, fit=replace(o.fit, components=0))),
    "middle key, no cuts": _layers(lambda o: replace(o, plan=replace(o.plan, keys=1, limit=1e9, worth=1e9))),
    "flat midpoints": _layers(lambda o: replace(o, layers=replace(o.layers, curvatures=(0,)))),
    "plain rounding": _layers(lambda o: replace(o, layers=replace(o.layers, price=0.0))),
    "errors along the surface count": _layers(lambda o: replace(o, layers=replace(o.layers, tangential=1.0))),
    "no tails": _layers(lambda o: replace(o, tails=False)),
}
VARIANTS: dict[str, Change] = {
    "fast": lambda options: Settings(options.preset, options.quality, "fast").resolved(),  # type: ignore[arg-type]
    **PARTS,
    "groups alone": _layers(lambda o: replace(o, predict=False)),
    UNIFORM: _paper(_plain),
    IN_MDS_POSE: _paper(lambda o: replace(o, pose="mds", cuts=False)),
    BOTH: _paper(lambda o: replace(_plain(o), pose="mds", cuts=False)),
    RELEASED: _paper(lambda o: replace(o, displacements=replace(o.displacements, step=RELEASED_STEP))),
    LARGER: _paper(lambda o: replace(o, reference=replace(o.reference, vertices=5000))),
    FROM_MESHES: _scene(lambda o: replace(o, from_depth=False)),
    TOGETHER: _scene(lambda o: replace(o, near=1e4)),  # all pieces are near each other
    **{stage: partial(BrokenOptions.of, stage=stage) for stage in STAGES},
}


def find_variant(name: str | None) -> Change:
    """The change called `name`; None changes nothing. Raises InputError for an unknown one."""
    if name is None:
        return lambda options: options
    if name not in VARIANTS:
        raise InputError(f"no variant is called {name!r}; known: {', '.join(sorted(VARIANTS))}")
    return VARIANTS[name]
