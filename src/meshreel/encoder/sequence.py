"""Encoding of a mesh sequence: survey it, take a scene apart, encode its intervals, and write the file.

In: a sequence, options. Out: a .reel file and a Summary. An interval needs no other frames, so intervals can be spread
over processes, and memory does not grow with the length of the sequence.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from concurrent.futures import Executor
from dataclasses import replace
from numbers import Integral
from pathlib import Path
from typing import BinaryIO

from threadpoolctl import threadpool_limits

from ..analysis.scene.masks import Masker
from ..analysis.scene.segmentation import Cameras
from ..analysis.scene.standing import Standing, scene_standing
from ..analysis.survey import Survey
from ..coding.background import decode_background
from ..container.writer import ReelWriter
from ..conversions import as_sequence
from ..edit.audio import Given, packed_audio
from ..edit.metadata import GUESSED, shortened, up_metadata
from ..errors import InputError
from ..format.layout import Form
from ..geometry.derived_sequences import captured, is_colored, unchanging, uncolored, welded
from ..geometry.threads import cores, threads
from ..geometry.topology import face_normals
from ..geometry.work import reporting, since, so_far
from ..io.files import Place, located
from ..types import MeshSequence, evenly
from .appearance.videos import TextureSize
from .file.first_view import first_view
from .file.summary import (
    GroupSummary,
    SceneSummary,
    Summary,
    chosen_options,
    make_header,
    mean_psnr,
    metadata_of,
    warnings_of,
    warnings_of_colors,
    warnings_of_groups,
    warnings_of_scene,
    write_in_order,
    write_tracked,
)
from .group.digests import WriteLines, note, noted
from .group.interval import Interval
from .group.progress import Report, Stages
from .paper.recipe import FindGroups, find_groups
from .run.interval_files import IntervalFiles, made_of, opened_output
from .run.schedule import Job
from .run.surveying import Excerpt, facts_of, survey_from_facts, survey_job, write_survey
from .scene.parts import NoRoom, Parts, pack_parts, take_apart, unpack_parts
from .scene.scene import Tracks, encode_bodies, scene_intervals
from .scene.static import colored_states
from .scene.tracks import encode_tracked, intervals_of, tracked_bodies
from .settings.options import EncoderOptions, as_installed
from .settings.settings import Color, Effort, Preset, Settings

MEASURED = 4  # frames of a scene that are compared with the decoded ones (guess)


def encode(
    sequence: MeshSequence | Iterable[object],
    path: str | Path,
    quality: float | None = None,
    preset: Preset = "best",
    *,
    effort: Effort = "normal",
    basis_size: int | None = None,
    centers: int | None = None,
    group_size: int | None = None,
    key_interval: float | None = None,
    color: Color = "auto",
    color_quality: float | None = None,
    texture: TextureSize | None = None,
    compatible: bool = False,
    splats: int | None = None,
    dynamic_only: bool = False,
    background_refresh: float | None = None,
    close_planes: bool = False,
    options: EncoderOptions | Settings | None = None,
    executor: Executor | None = None,
    jobs: int | None = None,
    progress: Report | None = None,
    resume: bool | None = None,
    audio: Given | None = None,
    audio_start: float = 0.0,
) -> Summary:
    """Encode meshes as a .reel file at `path`, also a URL (extra `remote`); it appears only when it is complete.

    `sequence` is a MeshSequence or an iterable of meshes (`as_sequence`, which also takes a frame rate); vertices
    at equal positions are welded. The keywords from `quality` to `close_planes` are the fields of `Settings`,
    which say when to touch them; `options` replace them all. Most of a scene stands still: it becomes a background and
    bodies. Bodies that never touch are coded apart in any sequence. Warns of surface that the file lacks.
    `jobs` is the number of cores to use, by default all that the process may use: threads share the frames of a group.
    An executor's workers encode long intervals side by side; memory then holds an interval for each worker and one
    more. The bytes are the same.
    `audio` is a path, a URL or the bytes of an audio file (Opus, AAC, MP3), kept as it is, which begins `audio_start`
    seconds after the first frame. Raises InputError for frames or audio that cannot be used, before anything is
    encoded.

    The intervals that are done are kept in `NAME.part` beside the output until it is complete. After an encode that was
    stopped, `resume=True` continues with the next interval, to the same bytes; False starts over; None raises
    InputError where there is something to continue.
    """
    settings = Settings(
        preset=preset,
        quality=quality,
        effort=effort,
        basis_size=basis_size,
        centers=centers,
        group_size=group_size,
        key_interval=key_interval,
        color=color,
        color_quality=color_quality,
        texture=texture,
        compatible=compatible,
        splats=splats,
        dynamic_only=dynamic_only,
        background_refresh=background_refresh,
        close_planes=close_planes,
    )
    if options is not None and settings != Settings():
        raise InputError("options and settings: leave the settings out, or give Settings(...) as options")
    encoder, output = Encoder(welded(as_sequence(sequence)), executor, progress, jobs=jobs), located(path)
    encoder.audio = b"" if audio is None else packed_audio(audio, audio_start)
    chosen = options or settings
    summary = encoder.encode(output, chosen.resolved() if isinstance(chosen, Settings) else chosen, resume)
    for text in summary.warnings:
        warnings.warn(text, stacklevel=2)
    return summary


class Encoder:
    """Encoder of one sequence at one or several rates; analyses that do not depend on the rate are done once."""

    def __init__(
        self,
        sequence: MeshSequence,
        executor: Executor | None = None,
        progress: Report | None = None,
        masker: Masker | None = None,
        digests: WriteLines | None = None,
        excerpt: Excerpt | None = None,
        jobs: int | None = None,
    ) -> None:
        """Take executor and progress as `encode` does; with a `masker`, whose masks mark moving pixels, it is a scene.

        `digests` takes lines of JSON, one for each stage. Of an `excerpt`, only its frames are encoded. The attributes
        `progress`, `audio` and `find`, which finds the groups of the paper's recipe, may be replaced between encodes.
        Raises InputError for `jobs` below 1.
        """
        if jobs is not None and not (isinstance(jobs, Integral) and jobs >= 1):
            raise InputError(f"jobs must be a whole number, at least 1, got {jobs!r}")
        self._cores = cores() if jobs is None else jobs
        self.sequence = unchanging(
            uncolored(captured(sequence))
        )  # colours are asked of the pictures, where they are known
        self._executor, self._masker = executor, masker
        self.progress, self.digests, self._excerpt = progress, digests, excerpt
        self.find: FindGroups = find_groups
        self.audio = b""  # payload of `packed_audio` that files get
        self._scene: tuple[tuple[Cameras, bool, bool], Parts] | None = None
        self._stands: bool | None = masker is not None or None  # most stands still; None: unknown yet
        self._standing: Standing | None = None
        self._moves: tuple[str, ...] = ()  # why a sequence that seemed to be a scene is none

    def intervals(self, options: EncoderOptions) -> Iterator[Interval]:
        """Yield the intervals that `encode` encodes, of all tracks of a scene."""
        job, parts = self._job(options), self.parts(options)
        if parts is None:
            with reporting(job.stages.passed):
                survey = survey_job(job)
            return intervals_of(job, survey, tracked_bodies(job, survey)[0])
        return scene_intervals(job, parts, Tracks(parts.segmentation, job.scene.near))

    def parts(self, options: EncoderOptions) -> Parts | None:
        """Return the parts of the scene; None where the sequence is no scene, or `options.scene` is None."""
        job = self._job(options)
        with reporting(job.stages.passed):
            return self._parts(job) if self._is_scene(job) else None

    def encode(self, path: str | Place, options: EncoderOptions, resume: bool | None = None) -> Summary:
        """Encode the sequence as the function `encode` does, with the same errors."""
        stages = self.stages()
        with opened_output(path, self.sequence.files, resume) as (file, files):
            summary = self.encode_into(file, options, files, stages)
        stages.finish()
        return summary

    def stages(self, trials: float = 0) -> Stages:
        """Return the counter of an encode's frames, for its progress; so many `trials` are expected after it."""
        frames = range(len(self.sequence)) if self._excerpt is None else self._excerpt.frames
        return Stages(self.progress, len(frames), trials)

    def encode_into(self, file: BinaryIO, options: EncoderOptions, files: IntervalFiles, stages: Stages) -> Summary:
        """Encode the sequence into an open, empty file; its groups wait in the files of their intervals."""
        # Idle threads of BLAS would take a third of the processor's time.
        with threadpool_limits(1), threads(self._cores), reporting(stages.passed):
            return self._encoded(file, options, files, stages)

    def _encoded(self, file: BinaryIO, options: EncoderOptions, files: IntervalFiles, stages: Stages) -> Summary:
        if options.scene is None and self._masker is not None:
            raise InputError("masks for a sequence that is not taken apart (scene=None): give one of both")
        before, excerpt = so_far(), self._excerpt
        options, lacking = as_installed(options)
        drawn = options.appearance is not None and options.appearance.splats is not None
        if drawn and self.sequence.colors is None and not is_colored(self.sequence):
            raise InputError("splats need colours, and no frame has any: give colour cameras or coloured meshes")
        job, made = self._job(options, stages), made_of(self.sequence, options, self._masker)
        if excerpt is not None:
            excerpt.whole.check(self.sequence)
            if self._is_scene(job):
                text = "a scene has one background for all frames, and is not encoded in parts"
                raise InputError(f"{text}; encode it in one run, with --cluster perhaps, or with --dynamic-only")
        files.check(made)
        survey, parts = self._whole(job, files)
        made |= {"surfaces": self.sequence.digests} | ({} if excerpt is None else {"part": str(excerpt.frames)})
        lasts = files.lasting and excerpt is None
        scene = pack_parts(parts) if lasts and parts is not None and files.scene is None else None
        encode = files.begin(made, facts_of(self.sequence, survey) if lasts else {}, scene)
        job = replace(job, files=files, head=make_header(self.sequence.frame_rate, survey, {"encode": encode}))
        writer = ReelWriter(file, make_header(self.sequence.frame_rate, survey, {}), str(files.output), self.audio)
        with noted(self.digests):
            summary = _encode_tracked(job, writer, survey) if parts is None else _encode_scene(job, file, writer, parts)
        texts = (*(self._moves if options.scene is not None else ()), *summary.warnings)
        texts += lacking if any(group.colors for group in summary.groups) else ()
        return replace(summary, work=since(before), warnings=texts, continued=files.continued, audio=len(self.audio))

    def survey(self, path: Path) -> Survey:
        """Survey the sequence, and write a file of it for encodes of its parts."""
        job = self._job(EncoderOptions())
        job.stages.expect("survey")
        with threads(self._cores), reporting(job.stages.passed):
            survey = survey_job(job)
        job.stages.finish()
        write_survey(survey, self.sequence, path)
        return survey

    def _job(self, options: EncoderOptions, stages: Stages | None = None) -> Job:
        job = Job(self.sequence, options, self._executor, stages or self.stages(), options.recipe(self.find))
        self._expect(job)
        return replace(job, chosen=None if self._excerpt is None else self._excerpt.frames)

    def _expect(self, job: Job) -> None:
        """Let progress expect the stages that are ahead."""
        scene = ("segment", "background", "room") if job.options.scene is not None and self._stands is not False else ()
        color = ("color",) if job.options.appearance is not None and self.sequence.colors is not None else ()
        job.stages.expect("look", "survey", *scene, *color, job.recipe.name.partition("-")[0])

    def _is_scene(self, job: Job) -> bool:
        if job.options.scene is None or not len(self.sequence):
            return False
        if self._stands is None:
            self._standing = scene_standing(self.sequence)
            self._stands = self._standing is not None
            self._expect(job)
        return self._stands

    def _whole(self, job: Job, files: IntervalFiles) -> tuple[Survey, Parts | None]:
        """Return the survey, and the parts of a scene: those that an earlier run wrote, where its frames are these.

        Raises InputError where it had others.
        """
        if self._excerpt is not None:
            return self._excerpt.whole.survey, None
        survey = None if files.whole is None else survey_from_facts(self.sequence, files.whole)
        if self._is_scene(job) and (parts := self._parts(job, files, survey)) is not None:
            return parts.survey, parts
        return survey_job(job) if survey is None or not survey.pieces else survey, None

    def _parts(self, job: Job, files: IntervalFiles | None = None, survey: Survey | None = None) -> Parts | None:
        """Return the parts of the scene: those that an earlier encode of it had, here or in files, where it had any.

        None where its background does not hold, so that it is none after all.
        """
        how = (job.scene.cameras, job.scene.from_depth, job.scene.close_planes)
        if self._scene is None or self._scene[0] != how:
            survey = survey_job(job, cleaned=False) if survey is None else survey
            parts = None
            if files is not None:
                files.check({"surfaces": self.sequence.digests})
                parts = None if files.scene is None else unpack_parts(files.scene, job.sequence, survey)
            try:
                made = job.sequence, survey, job.scene, self._masker, self._standing
                self._scene = (how, parts or take_apart(*made))
            except NoRoom as reason:
                if self._masker is not None:
                    raise InputError(f"{reason}: the masks call it still; look at them, or encode without") from None
                remedy = "a room in another unit than metres needs --scale"
                self._stands, self._moves = False, (f"{reason}: encoded as bodies, without a background; {remedy}",)
                self._expect(job)
                return None
        return self._scene[1]


def _encode_tracked(job: Job, writer: ReelWriter, survey: Survey) -> Summary:
    """Encode a sequence in which everything may move."""
    sequence, options = job.sequence, job.options
    groups: list[GroupSummary] = []
    note("survey", survey.low, survey.high, survey.diagonals, survey.dropped, survey.pieces)
    with writer:
        for encoded in encode_tracked(job, survey):
            groups += [write_tracked(writer, each, [], survey.diagonal) for each in encoded]
        part = None if job.chosen is None else (job.chosen.start, len(sequence))
        metadata = metadata_of(options, groups, sequence.up, part) | first_view(job, survey)
        writer.header = make_header(sequence.frame_rate, survey, metadata)
    texts = warnings_of(survey) if job.chosen is None else ()  # the survey told of them
    return Summary(writer.size, tuple(groups), (*texts, *warnings_of_groups(groups), *warnings_of_colors(groups)))


def _encode_scene(job: Job, file: BinaryIO, writer: ReelWriter, parts: Parts) -> Summary:
    """Encode a scene with a background into the file of a writer."""
    sequence, options, survey = job.sequence, job.options, parts.survey
    note("survey", survey.low, survey.high, survey.diagonals, survey.unit)
    note(
        "background and noise",
        parts.background.vertices,
        parts.background.faces,
        parts.noise.places,
        parts.noise.rms,
        parts.noise.off,
    )
    states = colored_states(sequence, parts, job.scene, options.appearance)
    guessed = float(face_normals(parts.guessed)[1].sum())
    note("background, coded", *(state.payload for state in states))
    with writer:
        coded, tracks = encode_bodies(job, parts)
        groups = write_in_order(writer, coded, states, survey)
        metadata = {
            **chosen_options(options, groups),
            "noise_m": shortened(parts.noise.mean),
            **({GUESSED: shortened(guessed)} if guessed else {}),
            **up_metadata(sequence.up),
            **first_view(job, survey, tracks.seen, parts.background),
        }
        writer.header = make_header(sequence.frame_rate, survey, metadata)
    measured = evenly(len(sequence), MEASURED)
    psnr = mean_psnr(sequence, file, survey.diagonal, measured)
    size, count = sum(map(len, states)), 1 + max(group.track for group in groups)
    faces = len(decode_background(states[0].payload).faces) if states else 0
    scene = SceneSummary(size, faces, parts.noise.mean, psnr, tuple(measured), count, guessed)
    moves = any(group.form != Form.EMPTY for group in groups)
    lost = (*warnings_of_scene(parts, moves, tracks.dropped), *warnings_of_groups(groups))
    texts = (*warnings_of(survey), *lost, *warnings_of_colors(groups, states))
    return Summary(writer.size, tuple(groups), texts, scene)
