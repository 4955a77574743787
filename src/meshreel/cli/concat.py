"""`meshreel concat`: join .reel files that are parts of one sequence."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from ..encoder.concat import concat
from ..errors import InputError
from ..io.remote import located
from .console import Common


def command(
    inputs: list[str],
    /,
    *,
    output: Annotated[str, Parameter(name=["--output", "-o"])],
    common: Common = Common(),
) -> None:
    """Join .reel files one after the other; nothing is encoded again.

    Parameters
    ----------
    inputs
        The files in the order of their frames, encoded with one --survey and the same options. Scenes cannot be joined:
        each has a background of its own.
    output
        The .reel file to write; it appears only when it is complete. All may be URLs (extra `remote`).
    """
    place = located(output)
    if place.suffix != ".reel":
        raise InputError(f"{output}: the output must end in .reel")
    joined = concat([located(path) for path in inputs], place)
    if joined.missing:
        whole = joined.frames + joined.missing
        common.warn((f"{place}: {joined.missing} of the sequence's {whole} frames are in none of the files",))
    row = {"output": str(place), "frames": joined.frames, "bytes": joined.size, "files": len(inputs)}
    common.result(row, f"{place}: {joined.frames} frames of {len(inputs)} files, {joined.size} bytes")
