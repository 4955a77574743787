"""The corpus of the fuzzers: only FormatError, verdicts that the player must reach too, and mutants with right sums."""

import json
from random import Random

import pytest

import meshreel
from core.fuzz import verdict
from core.fuzz.mutate import assemble, change_bytes, mutate, parse
from meshreel.coding.group import payload_bytes_by_purpose
from meshreel.errors import FormatError
from tests.golden import GOLDEN

FILES = {path.name: path for path in verdict.corpus()}
GOLDEN_FILES = sorted(GOLDEN.rglob("*.reel"))


@pytest.mark.slow
def test_the_verdicts_on_the_corpus_are_those_that_are_committed():
    """If a change is meant: `.venv/bin/python core/fuzz/verdict.py` writes them anew."""
    assert verdict.verdicts() == json.loads(verdict.VERDICTS.read_text())


def test_the_corpus_is_small_and_has_files_that_decode_and_files_that_are_refused():
    verdicts = json.loads(verdict.VERDICTS.read_text())
    words = {with_all_layers for with_all_layers, _ in verdicts.values()}
    assert "refused" in words and len(words) > 20
    sizes = [path.stat().st_size for path in verdict.CORPUS.glob("*/*")]
    assert sum(sizes) < 1_000_000 and max(sizes) < 16_000


@pytest.mark.parametrize("path", GOLDEN_FILES, ids=lambda path: path.stem)
def test_a_file_that_is_taken_apart_and_put_together_is_the_same(path):
    data = path.read_bytes()
    assert assemble(*parse(data)) == data


@pytest.mark.slow
@pytest.mark.parametrize("path", GOLDEN_FILES, ids=lambda path: path.stem)
def test_most_mutants_have_right_sums_and_all_are_decoded_or_refused(path):
    data, wrong_sums = path.read_bytes(), 0
    for seed in range(12):
        mutant = mutate(data, Random(seed), change_bytes(Random(seed)), of_head=0.1)
        verdict.check(mutant)
        try:
            video = meshreel.open(mutant)
            for chunk in video.reader.chunks:
                video.reader.read_chunk(chunk.number)
        except FormatError as error:
            wrong_sums += "checksum" in str(error)
    assert wrong_sums <= 3


def test_streams_that_claim_more_bytes_than_the_payload_has_are_refused_by_what_counts_them():
    """`meshreel info` said that a group's head had fewer than no bytes."""
    reader = meshreel.open(GOLDEN / "laplacian.reel").reader
    payload = reader.read_chunk(0)
    with pytest.raises(FormatError, match="claim 26 more"):
        payload_bytes_by_purpose(payload[:-40])
