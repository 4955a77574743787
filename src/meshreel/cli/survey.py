"""`meshreel survey`: the facts about a whole sequence that encodes of its parts share."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from ..encoder.file.notices import warnings_of
from ..encoder.sequence import Encoder
from ..errors import InputError
from ..io.remote import located, uploaded
from ..io.write import check_apart
from ..types import Up
from .console import Common
from .flags import Reading
from .sources import Masking, open_source
from .workers import workers


def command(
    inputs: list[str],
    /,
    *,
    output: Annotated[str, Parameter(name=["--output", "-o"])],
    reading: Reading = Reading(),
    up: Annotated[Up | None, Parameter(allow_leading_hyphen=True)] = None,
    jobs: int = 1,
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
        Number of processes that read side by side; the file is the same.
    cluster
        Address of a Dask scheduler whose workers read, as `encode` takes it.
    """
    place = located(output)
    if place.suffix != ".json":
        raise InputError(f"{output}: the output must end in .json")
    if reading.frames != ":":
        raise InputError(f"--frames {reading.frames}: a survey is of all frames; give --frames to encode --survey")
    source = open_source(inputs, reading, common)
    sequence = Masking(up=up).upright(source)
    with uploaded(place) as path, common.stages(len(sequence)) as progress, workers(jobs, cluster) as executor:
        check_apart(path, sequence.files)
        survey = Encoder(sequence, executor, progress).survey(path)
    warnings = (*source.warnings, *warnings_of(survey))
    common.warn(warnings)
    row = {"output": str(place), "frames": len(sequence), "warnings": warnings}
    common.result(row, f"{place}: {len(sequence)} frames, {survey.diagonal:.3g} m large")
