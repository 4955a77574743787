"""Titles of curves: known ones, their variants, and those of others."""

from __future__ import annotations

from meshreel_bench.names import TSMC, TUNED, TVMC, title


def test_a_variant_has_the_title_of_what_it_varies() -> None:
    assert title(TVMC) == "TVMC*"
    assert title(f"{TSMC}, centers 1000") == f"{title(TSMC)}, centers 1000"
    assert title(f"{TUNED}, quality 20") == f"{title(TUNED)}, quality 20"


def test_a_name_that_only_begins_alike_is_another_one() -> None:
    assert title("tvmc2") == "tvmc2"
    assert title("draco_of_theirs, qp 9") == "draco_of_theirs, qp 9"
