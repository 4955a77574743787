"""`meshreel encode`: a mesh sequence becomes one .reel file."""

from __future__ import annotations

import math
import multiprocessing
import signal
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from ..analysis.scene.segmentation import SegmentOptions
from ..encoder.options import EncoderOptions
from ..encoder.presets import preset_options
from ..encoder.quality import Goal, encode_to
from ..encoder.sequence import Encoder
from ..encoder.summary import SceneSummary, Summary
from ..errors import InputError
from .console import Common
from .flags import Reading
from .sources import Masking, open_source

DEFAULT_QUALITY = preset_options().quality


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Coding:
    """How meshes are coded: what `preset_options` takes."""

    preset: Literal["best", "paper"] = "best"
    """How to code: `best` is what measures best, `paper` is section 3 of the TSMC paper."""
    quality: float | None = None
    """0 (small) to 100 (fine); 50 where neither it nor a target is given."""
    target_psnr: float | None = None
    """Instead of a quality: the D2-PSNR (one way, mean over the frames, as `compare` prints it) to meet within 0.3 dB.
    Takes some encodes, 8 at most."""
    target_mbps: float | None = None
    """Instead of a quality: the rate of the file to meet within 5 %, Mbit/s. Takes some encodes, 8 at most. No quality
    changes the size of a scene's background."""
    basis_size: int | None = None
    """Exactly this many KLT components per group, and no per-frame Draco where that is cheaper; both by
    rate-distortion where it is not given. Preset `paper` only."""
    centers: int | None = None
    """Volume centers to track, the paper's K (2000). Preset `paper` only."""
    group_size: int | None = None
    """Most frames in a group, the paper's GoF (16; `paper`: 10)."""
    keyint: float | None = None
    """Seconds, at most, from one frame that decodes on its own to the next (4). Preset `best` only."""

    def goal(self) -> Goal | None:
        """What is to be met; None: a quality. Raises InputError where both are given, or a target cannot be."""
        if self.target_psnr is None and self.target_mbps is None:
            return None
        goal = Goal(self.target_psnr, self.target_mbps)
        if self.quality is not None:
            text = f"--quality {self.quality:g} and a target: the target chooses the quality"
            raise InputError(f"{text}, give one of both")
        return goal

    def options(self, quality: float) -> EncoderOptions:
        """The encoder's options at a quality. Raises InputError where a value is out of range, or not of the preset."""
        return preset_options(
            self.preset, quality, self.basis_size, self.group_size, self.centers, key_interval=self.keyint
        )


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Parting:
    """What of a sequence is background."""

    dynamic_only: Annotated[bool, Parameter(negative="")] = False
    """No background is looked for: all may move, and is coded in every frame."""
    background_refresh: float | None = None
    """Seconds from one copy of a scene's background in the file to the next, for who joins late. One copy for all
    frames where it is not given."""

    def __post_init__(self) -> None:
        if self.background_refresh is not None and not 0 < self.background_refresh < math.inf:
            raise InputError(f"--background-refresh {self.background_refresh:g}: give seconds above 0")

    def check(self, masking: Masking) -> None:
        """Raises InputError where one flag excludes another."""
        if self.dynamic_only and (self.background_refresh is not None or masking.wanted):
            raise InputError("--dynamic-only looks for no background: leave out --background-refresh, masks and views")

    def options(self, options: EncoderOptions, segment: SegmentOptions) -> EncoderOptions:
        """The same for a sequence that is taken apart so."""
        background = replace(options.background, refresh=self.background_refresh)
        return replace(options, background=background, segment=segment, dynamic_only=self.dynamic_only)


def command(
    inputs: list[str],
    /,
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"])],
    coding: Coding = Coding(),
    reading: Reading = Reading(),
    parting: Parting = Parting(),
    masking: Masking = Masking(),
    jobs: int = 1,
    common: Common = Common(),
) -> None:
    """Encode a sequence of meshes into one .reel file.

    Parameters
    ----------
    inputs
        A directory, a glob, mesh files (OBJ, PLY, GLB, STL, OFF) or an .npz of vertices (T x V x 3) and faces (F x 3).
        Vertices that repeat a position are welded. Or the folder of a rig, as `capture` takes it, with its defaults,
        which gives a better background than the meshes that `capture` writes: it is fused from the depth itself. A
        scene, of which most stands still, is taken apart: its background is in the file once, each moving body has its
        own track.
    output
        The .reel file to write; it appears only when it is complete.
    jobs
        Runs of frames that need no other to encode side by side (groups, or what `keyint` cuts); the file is the same.
    """
    if output.suffix != ".reel":
        raise InputError(f"{output}: the output must end in .reel")
    if jobs < 1:
        raise InputError(f"--jobs must be at least 1, got {jobs}")
    parting.check(masking)
    source = open_source(inputs, reading)
    segment = masking.options(preset_options().segment, source)

    def options_at(quality: float) -> EncoderOptions:
        return parting.options(coding.options(quality), segment)

    goal, quality = coding.goal(), DEFAULT_QUALITY if coding.quality is None else coding.quality
    options = options_at(quality)
    sequence, masker = source.sequence, masking.masker(len(source.sequence))
    with common.stages(len(sequence)) as progress, workers(jobs) as executor:
        encoder = Encoder(sequence, executor, progress, masker)
        if goal is None:
            summary = encoder.encode(output, options)
        else:
            summary, quality = encode_to(encoder, output, goal, options_at)
    warnings = (*source.warnings, *getattr(masker, "remarks", ()), *summary.warnings)
    if summary.scene is None and parting.background_refresh is not None:
        warnings += ("no background was found that could be sent again: --background-refresh does nothing",)
    common.warn(warnings)
    row = summary_row(summary, sequence.frame_rate) | {"quality": quality}
    common.result({"output": str(output), "warnings": warnings} | row, f"{output}: {describe(row)}; {_reached(row)}")


def summary_row(summary: Summary, frame_rate: float) -> dict[str, Any]:
    """Rate, quality and forms of an encode, ready for JSON."""
    return {
        "bytes": summary.size,
        "frames": summary.frame_count,
        "mbps": _mbps(summary.size, summary, frame_rate),
        "d2_psnr_paper": summary.psnr if math.isfinite(summary.psnr) else None,
        "scene": None if summary.scene is None else _scene_row(summary, summary.scene, frame_rate),
        "groups": [
            {
                "track": group.track,
                "form": group.form.name.lower(),
                "frames": group.frame_count,
                "bytes": group.size,
                "predicted": group.predicted,
                "rms_m": group.fidelity.distance,
                "worst_rms_m": group.fidelity.worst,
                "normal_error_deg": group.fidelity.angle,
            }
            for group in summary.groups
        ],
    }


def _scene_row(summary: Summary, scene: SceneSummary, frame_rate: float) -> dict[str, Any]:
    """What a scene's parts take; `other` is header and index."""
    parts = {"background": scene.background}
    for track in range(scene.tracks):
        parts[f"track {track}"] = sum(group.size for group in summary.groups if group.track == track)
    parts["other"] = summary.size - sum(parts.values())
    return {
        "tracks": scene.tracks,
        "background_bytes": scene.background,
        "background_faces": scene.faces,
        "noise_m": scene.noise,
        "measured_frames": list(scene.measured),
        "parts_bytes": parts,
        "parts_mbps": {name: _mbps(size, summary, frame_rate) for name, size in parts.items()},
    }


def _mbps(size: int, summary: Summary, frame_rate: float) -> float:
    return size * 8 * frame_rate / summary.frame_count / 1e6


def _describe_scene(row: dict[str, Any]) -> str:
    """What stands still and what moves, as a part of a line."""
    rates = row["parts_mbps"]
    moving = sum(rate for name, rate in rates.items() if name.startswith("track"))
    background = f"background {row['background_bytes']} bytes ({rates['background']:.3f} Mbps)"
    return f"{background}, {row['tracks']} tracks ({moving:.3f} Mbps), noise {1000 * row['noise_m']:.2g} mm, "


def describe(row: dict[str, Any]) -> str:
    """One line: frames, bytes, rate and forms."""
    forms = [group["form"] for group in row["groups"]]
    counted = ", ".join(_count_groups(forms.count(form), form) for form in sorted(set(forms)))
    scene = "" if row["scene"] is None else _describe_scene(row["scene"])
    return f"{row['frames']} frames, {row['bytes']} bytes, {row['mbps']:.3f} Mbps, {scene}{counted}"


def _count_groups(count: int, form: str) -> str:
    return f"{count} {'group' if count == 1 else 'groups'} of form {form}"


def _reached(row: dict[str, Any]) -> str:
    psnr = row["d2_psnr_paper"]
    if psnr is None:
        return f"quality {row['quality']:g}"
    some = "" if row["scene"] is None else f" in {len(row['scene']['measured_frames'])} frames"
    return f"quality {row['quality']:g}, D2-PSNR {psnr:.2f} dB{some}"


@contextmanager
def workers(jobs: int) -> Iterator[Executor | None]:
    """Processes for `jobs` windows at a time, none for one; an interrupt ends them at once."""
    if jobs == 1:
        yield None
        return
    # Spawned, not forked: the progress display and Open3D have threads, which a fork would lose.
    context = multiprocessing.get_context("spawn")
    executor = ProcessPoolExecutor(jobs, mp_context=context, initializer=_leave_interrupts)
    try:
        yield executor
    except BaseException:
        executor.shutdown(wait=False, cancel_futures=True)
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    executor.shutdown()


def _leave_interrupts() -> None:
    """In a worker: Ctrl-C is the parent's affair, and SIGTERM ends the worker without a word."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
