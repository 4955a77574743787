"""`meshreel encode` and `survey`: encode a mesh sequence, or survey it for encodes of its parts."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from ..encoder.file.summary import SceneSummary, Summary, warnings_of
from ..encoder.group.digests import WriteLines, machine_line
from ..encoder.rate_control import Goal, encode_to
from ..encoder.run.surveying import Excerpt, read_survey
from ..encoder.sequence import Encoder
from ..encoder.settings.options import QUALITY, EncoderOptions, as_installed
from ..encoder.settings.settings import Settings
from ..errors import InputError
from ..geometry.derived_sequences import is_colored, upright
from ..io.files import Place, located, uploaded
from ..io.sequence import SequenceOptions
from ..io.write import check_apart, replacing
from ..types import MeshSequence, Up
from .console import Common
from .sources import Hearing, Masking, Reading, open_source
from .workers import workers


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Aiming:
    """Flags for targets, which choose the quality."""

    target_psnr: float | None = None
    """Instead of a quality: the D2-PSNR (one way, mean over the frames, as `compare` prints it) to meet within 0.3 dB.
    Takes up to 8 encodes."""
    target_mbps: float | None = None
    """Instead of a quality: the rate of the file to meet within 5 %, Mbit/s. Takes up to 8 encodes. The size of a
    scene's background does not depend on the quality."""

    def goal(self, settings: Settings) -> Goal | None:
        """Return the target, None without one. Raises InputError for a target with a quality, or out of range."""
        if self.target_psnr is None and self.target_mbps is None:
            return None
        goal = Goal(self.target_psnr, self.target_mbps)
        if settings.quality is not None:
            text = f"--quality {settings.quality:g} and a target: the target chooses the quality"
            raise InputError(f"{text}, give one of both")
        return goal


@Parameter(name="*")
@dataclass(frozen=True, slots=True)
class Part:
    """Flags for a file of some frames, which `concat` joins with the others."""

    survey: str | None = None
    """The survey of the whole sequence, which `meshreel survey` wrote: with it, --frames or --part say which frames to
    encode, and `meshreel concat` joins the files without encoding them again. Not for scenes."""
    part: str | None = None
    """Which of how many parts of the sequence to encode, as 3/100; needs --survey. Parts end where frames decode alone,
    so that the joined file has the bytes of one encode of the whole."""

    def excerpt(self, sequence: MeshSequence, frames: str, options: EncoderOptions) -> Excerpt | None:
        """Return the frames to encode, None for all of a sequence without a survey. Raises InputError."""
        if self.survey is None:
            if self.part is not None:
                text = "needs the --survey that all parts share; meshreel survey writes it"
                raise InputError(f"--part {self.part}: {text}")
            return None
        whole, chosen = read_survey(located(self.survey)), SequenceOptions(frames=frames).chosen(len(sequence))
        if self.part is None:
            return Excerpt(whole, chosen)
        numbers = _PART.fullmatch(self.part)
        if numbers is None or len(chosen) < len(sequence):
            raise InputError(f"--part {self.part}: give K/N, as 3/100, and leave --frames out")
        return whole.part(int(numbers[1]), int(numbers[2]), options.recipe().longest(sequence.frame_rate))

    def check(self, goal: Goal | None, masking: Masking) -> None:
        """Raise InputError for flags that no part can have."""
        if self.survey is not None and (goal is not None or masking.wanted):
            raise InputError("--survey is for a part: give --quality in place of a target, and no masks or views")


_PART = re.compile(r"(\d{1,9})/([1-9]\d{0,8})")


def encode(
    inputs: list[str],
    /,
    *,
    output: Annotated[str, Parameter(name=["--output", "-o"])],
    settings: Annotated[Settings, Parameter(name="*", negative="")] = Settings(),
    aiming: Aiming = Aiming(),
    reading: Reading = Reading(),
    masking: Masking = Masking(),
    part: Part = Part(),
    hearing: Hearing = Hearing(),
    jobs: int | None = None,
    cluster: str | None = None,
    resume: bool | None = None,
    debug_digests: Path | None = None,
    common: Common = Common(),
) -> None:
    """Encode a sequence of meshes into one .reel file.

    Parameters
    ----------
    inputs
        A directory, a glob, mesh files (OBJ, PLY, GLB, STL, OFF) or an .npz of vertices (T x V x 3) and faces (F x 3).
        Vertices that repeat a position are welded. Or the folder of a rig or recordings, as `capture` takes them, fused
        with the defaults of `capture`; the background is better than that of the meshes that `capture` writes, because
        it is fused from the depth itself. A sequence that mostly stands still is a scene: the file holds its background
        once, and a track for each moving body.
    output
        The .reel file to write; it appears only when it is complete. Inputs and output may be URLs, as s3://bucket/scan;
        inputs also https:// (extra `remote`).
    jobs
        Number of cores to use, in place of all that this process may use; the file is the same.
    cluster
        Address of a Dask scheduler, as tcp://10.0.0.7:8786, whose workers encode in place of this machine (extra
        `cluster`). They read the inputs by the same paths or URLs; the file is the same.
    resume
        Continue an encode that was stopped, from the intervals that OUTPUT.part has: give the same inputs and options.
        --no-resume starts over. By default, what could be continued is an error.
    debug_digests
        A text file to write: digests of what each stage computed. Where two machines write different files, the first
        line in which theirs differ says where the difference starts. Not with --resume, nor with a target.
    """
    place = located(output)
    if place.suffix != ".reel":
        raise InputError(f"{output}: the output must end in .reel")
    if settings.dynamic_only and masking.wanted:
        raise InputError("--dynamic-only looks for no background: leave masks and views out")
    goal, quality = aiming.goal(settings), QUALITY if settings.quality is None else settings.quality
    if debug_digests is not None and (resume or goal is not None):
        raise InputError("--debug-digests describes one whole encode: leave out --resume and targets")
    part.check(goal, masking)
    sound = hearing.payload()
    cameras = masking.cameras

    def options_at(quality: float) -> EncoderOptions:
        options = replace(settings, quality=quality).resolved()
        return options if options.scene is None else replace(options, scene=replace(options.scene, cameras=cameras))

    options = options_at(quality)
    lacking = as_installed(options)[1]  # raises InputError before recordings are read
    source = open_source(inputs, reading if part.survey is None else replace(reading, frames=":"), common)
    sequence, masker = upright(source.sequence, masking.up), masking.masker(len(source.sequence))
    excerpt = part.excerpt(sequence, reading.frames, options)
    early = lacking if sequence.colors is not None or (lacking and is_colored(sequence)) else ()
    common.warn(early)  # now, not after minutes
    with (
        common.stages() as progress,
        workers(jobs, cluster) as executor,
        _lines(debug_digests, place, sequence.files) as digests,
    ):
        encoder = Encoder(sequence, executor, progress.encode, masker, digests, excerpt, jobs)
        encoder.audio = sound
        if goal is None:
            summary = encoder.encode(place, options, resume)
        else:
            summary, quality = encode_to(encoder, place, goal, options_at, resume)
    warnings = (*source.warnings, *getattr(masker, "remarks", ()), *summary.warnings)
    if summary.scene is None and settings.background_refresh is not None:
        warnings += ("no background was found that could be sent again: --background-refresh does nothing",)
    if settings.close_planes and (summary.scene is None or not summary.scene.guessed):
        why = "no hole in a plane that no depth camera saw into"
        why = "it needs a rig of depth cameras" if sequence.depth is None else why
        warnings += (f"--close-planes closes nothing: {why}",)
    common.warn(text for text in warnings if text not in early)
    row = summary_row(summary, sequence.frame_rate) | {"quality": quality}
    common.result({"output": str(place), "warnings": warnings} | row, f"{place}: {describe(row)}; {_reached(row)}")


@contextmanager
def _lines(path: Path | None, output: Place, inputs: Iterable[Path]) -> Iterator[WriteLines | None]:
    """Yield a writer of lines for the file of digests, which appears after the encode; None without a path."""
    if path is None:
        yield None
        return
    check_apart(path, inputs)
    if path.absolute() == output.absolute():
        raise InputError(f"{path}: is the output, too; give another --debug-digests")
    with replacing(path) as file:
        file.write(machine_line().encode())
        yield lambda lines: file.write(lines.encode())


def summary_row(summary: Summary, frame_rate: float) -> dict[str, Any]:
    """Return rate, quality and groups of an encode, ready for JSON."""
    return {
        "bytes": summary.size,
        "frames": summary.frame_count,
        "continued": summary.continued,
        "mbps": _mbps(summary.size, summary, frame_rate),
        "d2_psnr_paper": summary.psnr if math.isfinite(summary.psnr) else None,
        "scene": None if summary.scene is None else _scene_row(summary, summary.scene, frame_rate),
        "audio_bytes": summary.audio,
        "work": summary.work,
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
                "least_covered": group.fidelity.covered if math.isfinite(group.fidelity.covered) else None,
                "least_covered_frame": round(group.fidelity.least),
                "encoded_again": group.mended,
            }
            for group in summary.groups
        ],
    }


def _scene_row(summary: Summary, scene: SceneSummary, frame_rate: float) -> dict[str, Any]:
    """Return the bytes of a scene by content; `other` is header and index."""
    sizes = {"background": scene.background}
    for track in range(scene.tracks):
        sizes[f"track {track}"] = sum(group.size + group.colors for group in summary.groups if group.track == track)
    if summary.audio:
        sizes["audio"] = summary.audio
    sizes["other"] = summary.size - sum(sizes.values())
    return {
        "tracks": scene.tracks,
        "background_bytes": scene.background,
        "background_faces": scene.faces,
        "noise_m": scene.noise,
        "guessed_m2": scene.guessed,
        "measured_frames": list(scene.measured),
        "bytes_by_content": sizes,
        "mbps_by_content": {name: _mbps(size, summary, frame_rate) for name, size in sizes.items()},
    }


def _mbps(size: int, summary: Summary, frame_rate: float) -> float:
    return size * 8 * frame_rate / summary.frame_count / 1e6


def _describe_scene(row: dict[str, Any]) -> str:
    """Describe background and tracks in a part of a line."""
    rates = row["mbps_by_content"]
    moving = sum(rate for name, rate in rates.items() if name.startswith("track"))
    background = f"background {row['background_bytes']} bytes ({rates['background']:.3f} Mbps)"
    tracks = "1 track" if row["tracks"] == 1 else f"{row['tracks']} tracks"
    guessed = f"{row['guessed_m2']:.2g} m2 of it guessed, " if row["guessed_m2"] else ""
    return f"{background}, {guessed}{tracks} ({moving:.3f} Mbps), noise {1000 * row['noise_m']:.2g} mm, "


def describe(row: dict[str, Any]) -> str:
    """Describe a row in one line: frames, bytes, rate and forms."""
    forms = [group["form"] for group in row["groups"]]
    counts = [(forms.count(form), form) for form in sorted(set(forms))]
    counted = ", ".join(f"{count} {'group' if count == 1 else 'groups'} of form {form}" for count, form in counts)
    tracks = 1 + max(group["track"] for group in row["groups"])
    scene = ("" if tracks == 1 else f"{tracks} tracks, ") if row["scene"] is None else _describe_scene(row["scene"])
    scene += f"audio {row['audio_bytes']} bytes, " if row["audio_bytes"] else ""
    before = f", {row['continued']} intervals from before" if row["continued"] else ""
    return f"{row['frames']} frames, {row['bytes']} bytes, {row['mbps']:.3f} Mbps, {scene}{counted}{before}"


def _reached(row: dict[str, Any]) -> str:
    psnr = row["d2_psnr_paper"]
    if psnr is None:
        return f"quality {row['quality']:g}"
    measured = "" if row["scene"] is None else f" in {len(row['scene']['measured_frames'])} frames"
    return f"quality {row['quality']:g}, D2-PSNR {psnr:.2f} dB{measured}"


def survey(
    inputs: list[str],
    /,
    *,
    output: Annotated[str, Parameter(name=["--output", "-o"])],
    reading: Reading = Reading(),
    up: Annotated[Up | None, Parameter(allow_leading_hyphen=True)] = None,
    jobs: int | None = None,
    cluster: str | None = None,
    common: Common = Common(),
) -> None:
    """Read all frames of a sequence once, and write the facts about the whole that encodes of its parts need.

    Parameters
    ----------
    inputs
        The meshes, as `encode` takes them.
    output
        The .json file to write: box, size and digest of the frames. Give it to `encode --survey`. It may be a URL, as
        the inputs may (extra `remote`).
    up
        Axis that points up, as `encode` takes it.
    jobs
        Number of cores to use, as `encode` takes it.
    cluster
        Address of a Dask scheduler whose workers read, as `encode` takes it.
    """
    place = located(output)
    if place.suffix != ".json":
        raise InputError(f"{output}: the output must end in .json")
    if reading.frames != ":":
        raise InputError(f"--frames {reading.frames}: a survey is of all frames; give --frames to encode --survey")
    source = open_source(inputs, reading, common)
    sequence = upright(source.sequence, up)
    with uploaded(place) as path, common.stages() as progress, workers(jobs, cluster) as executor:
        check_apart(path, sequence.files)
        facts = Encoder(sequence, executor, partial(progress.encode, name="survey"), jobs=jobs).survey(path)
    warnings = (*source.warnings, *warnings_of(facts))
    common.warn(warnings)
    row = {"output": str(place), "frames": len(sequence), "warnings": warnings}
    common.result(row, f"{place}: {len(sequence)} frames, {facts.diagonal:.3g} m large")
