"""Declarations of experiments: sweeps over sequences, measures to compare by, promises. `report` judges and renders."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from ..rows import Metrics, Option, Point

SMALL_SEQUENCE, SMALL_FRAMES = "demo", 3  # procedural: `--small` needs no data
Values = Mapping[str, Sequence[Option]]  # options that are varied together, by name


@dataclass(frozen=True, slots=True)
class Measure:
    """A quality that curves are compared by."""

    key: str  # name of a row's value (`report.values`)
    name: str
    unit: str = ""
    sign: int = 1  # -1 where smaller is better
    least: float = 0.0  # an overlap of two curves below which they are not compared

    @property
    def label(self) -> str:
        """Name with unit."""
        return f"{self.name} ({self.unit.strip()})" if self.unit else self.name

    def shown(self, quality: float) -> str:
        """Return a quality of a curve as text, with its unit and its own sign."""
        return f"{self.sign * quality:.4g}{self.unit}"


D2 = Measure("d2_psnr_paper", "D2, paper form", " dB", least=0.5)
MASKED = Measure("ssim_masked", "masked SSIM", least=0.01)
SSIM = Measure("ssim", "SSIM", least=0.005)
NORMALS = Measure("normal_error_deg", "normal error", " degrees", -1, least=0.3)
VIEWS = (D2, MASKED, SSIM, NORMALS)
SYMMETRIC = Measure("symmetric_psnr", "symmetric D2", " dB", least=0.5)
KEYLESS = Measure("ssim_masked_without_keys", "masked SSIM without key frames", least=0.01)


@dataclass(frozen=True, slots=True)
class Bound:
    """Bound that a value of a row has to keep; beyond the noise floor's value where `over_floor`."""

    key: str
    limit: float
    unit: str = ""
    least: bool = True  # False: at most
    over_floor: bool = False


def at_most(key: str, limit: float, unit: str = "") -> Bound:
    """Return the bound of a value that must not be larger."""
    return Bound(key, limit, unit, least=False)


@dataclass(frozen=True, slots=True)
class Which:
    """Rows that a promise is about: a sequence, a curve, and options."""

    sequence: str
    curve: str
    options: Mapping[str, Option] = field(default_factory=dict)
    metrics: Metrics | None = None


@dataclass(frozen=True, slots=True)
class Reaches:
    """Promise that one row keeps all bounds."""

    text: str
    which: Which
    bounds: tuple[Bound, ...]
    aim: str = ""


@dataclass(frozen=True, slots=True)
class Needs:
    """Promise that a curve, interpolated, has a quality at a rate, Mbps, or at a share of what another one needs."""

    text: str
    which: Which
    bound: Bound  # of the quality
    rate: str  # name of a row's value
    most: float
    than: Which | None = None
    aim: str = ""


@dataclass(frozen=True, slots=True)
class Always:
    """Promise that every row keeps a bound; on every sequence where `which.sequence` is empty."""

    text: str
    which: Which
    bound: Bound


@dataclass(frozen=True, slots=True)
class Gains:
    """Promise that a curve needs so much less rate than the hull of others, by every measure."""

    sequence: str
    curve: str
    anchors: tuple[str, ...]
    measures: tuple[Measure, ...]
    most: float  # %, of the change of rate
    below_floor: bool = False  # qualities beyond the noise floor do not count
    ends_past: Bound | None = None  # quality up to which there is a gain


@dataclass(frozen=True, slots=True)
class LeastRate:
    """Promise that a curve needs less rate than every other one wherever both reach a quality."""

    curve: str
    measures: tuple[Measure, ...]


@dataclass(frozen=True, slots=True)
class Rises:
    """Promise that more rate is more quality, on every sequence."""

    curve: str
    measure: Measure


@dataclass(frozen=True, slots=True)
class Flat:
    """Promise that the longest encode needs no more memory, or time a frame, than the shortest."""

    which: Which
    within: float = 0.1
    key: str = "encode_mb"  # of what is measured


@dataclass(frozen=True, slots=True)
class NoMore:
    """Promise that a value is at most so many times the sum of what others have, one row each."""

    text: str
    which: Which
    key: str
    factor: float
    than: tuple[Which, ...]


Promise = Reaches | Needs | Always | Gains | LeastRate | Rises | Flat | NoMore


@dataclass(frozen=True, slots=True)
class Sweep:
    """A codec over operating points: one for each of the values, or the fixed one where there are none."""

    codec: str
    values: Values = field(default_factory=dict)
    fixed: Mapping[str, Option] = field(default_factory=dict)
    on: Mapping[str, Values] = field(default_factory=dict)  # other values on these sequences
    only: Sequence[str] = ()  # sequences; none: on all
    small: Mapping[str, Option] = field(default_factory=dict)  # what `--small` changes of its one point
    sampled: Sequence[str] = ()  # sequences of which it is given some frames only
    frames: int | None = None  # instead of the study's
    metrics: Metrics | None = None  # instead of the study's

    def points(self, sequence: str, frames: int | None, metrics: Metrics) -> Iterator[Point]:
        """Yield its points on a sequence."""
        if self.only and sequence not in self.only:
            return
        values, sampled = self.on.get(sequence, self.values), sequence in self.sampled
        for point in zip(*values.values(), strict=True) if values else [()]:
            options = {**self.fixed, **dict(zip(values, point, strict=True))}
            yield Point(sequence, self.codec, options, self.frames or frames, sampled, self.metrics or metrics)

    def small_point(self) -> Point:
        """Return the point in the middle, as `--small` has it."""
        middle = {name: several[len(several) // 2] for name, several in self.values.items()}
        return Point(SMALL_SEQUENCE, self.codec, {**self.fixed, **middle, **self.small}, SMALL_FRAMES)


@dataclass(frozen=True, slots=True)
class Study:
    """Experiment: sweeps over sequences, and what is compared and promised of their rows."""

    title: str
    sequences: Sequence[str]
    sweeps: Sequence[Sweep]
    metrics: Metrics = "views"
    measures: Sequence[Measure] = VIEWS  # of tables and plots, the first two of rates
    best: str | None = None  # curve that is compared with every other one
    anchor: str | None = None  # curve that every other one is compared with
    promises: Sequence[Promise] = ()
    floors: Sequence[str] = ()  # sequences of which the truth itself is measured
    frames: Mapping[str, int] = field(default_factory=dict)  # the first ones of a sequence; none given: all
    rate: str = "mbps"  # of plots: name of a row's value
    over: str = "rate (Mbps)"  # what that is
    notes: Sequence[str] = ()  # Markdown, before the tables

    def points(self, small: bool = False) -> Iterator[Point]:
        """Yield all points, sequence by sequence; where `small`, one of each sweep on a few procedural frames."""
        if small:
            own = {sweep.small_point().key: sweep.small_point() for sweep in self.sweeps if sweep.codec not in INSTEAD}
            yield from own.values()
            return
        for sequence in self.sequences:
            frames = self.frames.get(sequence)
            if sequence in self.floors:
                yield Point(sequence, FLOOR, {}, frames, metrics=self.metrics)
            for sweep in self.sweeps:
                yield from sweep.points(sequence, frames, self.metrics)


# In a codec's place: the truth itself, labels of what moves, tracked centers, and playing.
FLOOR, FOUND, TRACKER, HEADSET = INSTEAD = "captured", "segmentation", "tracker", "headset"
