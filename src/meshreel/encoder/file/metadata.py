"""Metadata of an encoded file: the options that made it, and its errors as the encoder measured them.

In: options, the groups of a file. Out: values for a JSON object. Decoding needs none of them, but the rate includes
them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ...edit.metadata import CANONICAL, KEYS, PART, Totals, rounded, upright
from ...types import Up
from ..settings.options import EncoderOptions
from .summary import GroupSummary


def metadata_of(
    options: EncoderOptions, groups: Sequence[GroupSummary], up: Up, part: tuple[int, int] | None = None
) -> dict[str, Any]:
    """Return the metadata of a file that is no scene; a `part` is its first frame, and the frames of the whole."""
    totals, keys = totals_of(groups), sorted({group.key for group in groups if group.key is not None})
    found = {**chosen_options(options, groups), KEYS: keys, **totals.means}
    if part is None:
        return found | upright(up)
    digest = hashlib.sha256(repr(asdict(options)).encode()).hexdigest()[:16]
    place = {"first_frame": part[0], "of": part[1]}
    return found | upright(up) | {PART: place | {"totals": totals.exact, "options": digest}}


def chosen_options(options: EncoderOptions, groups: Sequence[GroupSummary]) -> dict[str, Any]:
    """Return the preset and the quality; of the paper's recipe also how many references lie in the pose of eq. 5."""
    found = {"preset": options.preset, "quality": rounded(options.quality)}
    return found | ({} if options.preset == "best" else {CANONICAL: sum(group.canonical for group in groups)})


def totals_of(groups: Sequence[GroupSummary]) -> Totals:
    """Return the totals of the groups of a file; bodies count by their share of the vertices."""
    return Totals.added(
        [
            Totals(
                group.frame_count if group.track == 0 else 0,
                (count := group.share * group.frame_count) * group.fidelity.distance**2,
                group.fidelity.worst,
                count * group.fidelity.psnr,
                count * group.fidelity.angle,
            )
            for group in groups
        ]
    )
