"""Laws of a head beyond its layout: each guard trips."""

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshreel.errors import FormatError
from meshreel.format.checks import (
    MOST_CHANGES,
    MOST_NESTED,
    MOST_TRACKS,
    check_file,
    check_header,
    check_index,
    parse_metadata,
)
from meshreel.format.kinds import EXACT
from meshreel.format.layout import ChunkKind, Form, Header, Index, IndexEntry, Layer
from tests.format.strategies import records

# The run-time type checker draws items of tuples at random, which hypothesis takes for the test's own doing.
pytestmark = pytest.mark.filterwarnings("ignore:Do not use the `random` module")

HEADER = Header(30.0, (0.0, 0.0, 0.0), 1.7, (-0.5, -0.5, -0.5), (0.5, 0.5, 0.5), "{}")
STATIC = IndexEntry(ChunkKind.STATIC, Form.DRACO, 0, 0, (), (Layer(9, 0),))
GROUP = IndexEntry(ChunkKind.GROUP, Form.DRACO, 5, 0, (), (Layer(9, 0),))
SECOND = replace(GROUP, track=1)
PATCH = replace(STATIC, form=Form.PATCH, depends_on=(0,))
AUDIO = IndexEntry(ChunkKind.AUDIO, Form.AUDIO_FILE, 0, 0, (), (Layer(9, 0),))


def test_written_heads_pass():
    check_header(HEADER, 10)
    check_header(replace(HEADER, intervals=(1, 2)), 3)
    check_index(Index((STATIC, replace(GROUP, depends_on=(0,)))))
    check_index(Index((AUDIO, GROUP)))
    check_index(Index((GROUP, STATIC, replace(GROUP, depends_on=(0, 1)), replace(GROUP, depends_on=(2,)))))
    check_index(
        Index((STATIC, GROUP, SECOND, PATCH, replace(GROUP, depends_on=(1, 3)), replace(SECOND, depends_on=(2,))))
    )
    assert parse_metadata('{"quality": 50}') == {"quality": 50}


@pytest.mark.parametrize(
    "change",
    [
        {"frame_rate": 0.0},
        {"frame_rate": -30.0},
        {"scale": 0.0},
        {"scale": 1e300},
        {"origin": (0.0, 1e16, 0.0)},
        {"maximum": (0.5, -0.6, 0.5)},
        {"intervals": (1, 2, 3)},
        {"intervals": (1, 0)},
    ],
)
def test_a_header_that_means_nothing_is_refused(change):
    with pytest.raises(FormatError, match=r"Header\."):
        check_header(replace(HEADER, **change), 3)


@pytest.mark.parametrize(
    ("chunks", "message"),
    [
        ((), "no frames"),
        ((STATIC,), "no frames"),
        ((replace(STATIC, frames=3),), "STATIC of 3 frames"),
        ((replace(GROUP, frames=0),), "GROUP of 0 frames"),
        ((replace(GROUP, layers=()),), "without bytes"),
        ((replace(GROUP, layers=(Layer(3, 0), Layer(0, 0))),), "without bytes"),
        ((GROUP, GROUP, replace(GROUP, depends_on=(0,))), "neither a static chunk"),
        ((GROUP, replace(STATIC, depends_on=(0,))), r"chunk 1: a static chunk of form DRACO depends on \(0,\)"),
        ((replace(GROUP, depends_on=(0,)),), "neither a static chunk"),
        ((replace(GROUP, depends_on=(1 << 60,)),), "neither a static chunk"),
        ((AUDIO, GROUP, AUDIO), "chunk 2: audio besides other audio"),
        ((GROUP, replace(AUDIO, depends_on=(0,))), "chunk 1: audio .* not on its own"),
        ((GROUP, replace(AUDIO, form=Form.DRACO)), "not on its own"),
        ((GROUP, replace(AUDIO, frames=5)), "not on its own"),
        ((GROUP, replace(AUDIO, track=1)), "not on its own"),
        ((GROUP, replace(AUDIO, layers=(Layer(1 << 29, 0), Layer(1 << 29, 0)))), "1073741824 bytes of audio, over"),
        ((AUDIO,), "no frames"),
    ],
)
def test_an_index_that_contradicts_itself_is_refused(chunks, message):
    with pytest.raises(FormatError, match=message):
        check_index(Index(chunks))


@pytest.mark.parametrize(
    ("chunks", "message"),
    [
        ((SECOND,), "chunk 0: track 1 after 0"),
        ((GROUP, replace(GROUP, track=2)), "chunk 1: track 2 after 1"),
        ((replace(GROUP, track=1 << 63),), "at most 256"),
        ((GROUP, GROUP, SECOND), "chunk 2: track 1 from frame 0 behind track 0 from frame 5"),
        ((GROUP, SECOND, SECOND, GROUP), "chunk 3: track 0 from frame 5 behind track 1 from frame 5"),
        ((GROUP, SECOND, replace(SECOND, frames=3), replace(GROUP, frames=4)), "chunk 3: track 0 from frame 5 behind"),
        ((GROUP, replace(SECOND, frames=4)), "track 1 has 4 frames, track 0 has 5"),
        ((GROUP, SECOND, GROUP), "track 1 has 5 frames, track 0 has 10"),
        ((GROUP, replace(SECOND, depends_on=(0,))), "nor the last group of its track"),
        ((GROUP, SECOND, replace(GROUP, depends_on=(1,))), "nor the last group of its track"),
        ((GROUP, replace(GROUP, depends_on=(0, 0))), "twice"),
        ((STATIC, STATIC, replace(GROUP, depends_on=(0, 1))), "several static chunks"),
        ((replace(GROUP, form=Form.PATCH),), "a group of form PATCH"),
    ],
)
def test_tracks_that_cannot_be_played_while_they_arrive_are_refused(chunks, message):
    with pytest.raises(FormatError, match=message):
        check_index(Index(chunks))


@pytest.mark.parametrize(
    ("chunks", "message"),
    [
        ((replace(PATCH, depends_on=()),), r"chunk 0: .* of form PATCH depends on \(\)"),
        ((PATCH,), "depends on 0, which is no static chunk before it"),
        ((STATIC, replace(PATCH, depends_on=(1,))), "depends on 1, which is no static chunk before it"),
        ((STATIC, replace(PATCH, depends_on=(2,)), replace(PATCH, depends_on=(1,))), "depends on 2"),
        ((STATIC, replace(PATCH, depends_on=(1 << 60,))), "no static chunk before it"),
        ((GROUP, PATCH), "depends on 0, which is no static chunk before it"),
        ((STATIC, STATIC, replace(PATCH, depends_on=(0, 1))), r"depends on \(0, 1\)"),
        ((STATIC, STATIC, replace(STATIC, depends_on=(1,))), r"of form DRACO depends on \(1,\)"),
        ((replace(STATIC, form=Form.LAYERS),), "static chunk of form LAYERS"),
        ((replace(STATIC, form=Form.EMPTY),), "static chunk of form EMPTY"),
        ((replace(STATIC, track=1),), "and track 1"),
    ],
)
def test_a_background_that_leads_to_no_mesh_is_refused(chunks, message):
    with pytest.raises(FormatError, match=message):
        check_index(Index((*chunks, GROUP)))


def test_the_largest_numbers_of_tracks_and_patches_pass_and_larger_ones_are_refused():
    tracks = [replace(GROUP, track=number) for number in range(MOST_TRACKS + 1)]
    check_index(Index(tuple(tracks[:-1])))
    with pytest.raises(FormatError, match=f"track {MOST_TRACKS} after {MOST_TRACKS}"):
        check_index(Index(tuple(tracks)))
    chain = [STATIC, *(replace(PATCH, depends_on=(number,)) for number in range(MOST_CHANGES + 1))]
    check_index(Index((*chain[:-1], GROUP)))
    check_index(Index((*chain[:-1], STATIC, replace(PATCH, depends_on=(len(chain) - 1,)), GROUP)))
    with pytest.raises(FormatError, match=f"patch {MOST_CHANGES + 1} of one background"):
        check_index(Index((*chain, GROUP)))


@given(st.lists(st.lists(st.integers(1, 9), min_size=1, max_size=6), min_size=1, max_size=5), st.randoms())
def test_groups_of_any_tracks_of_one_length_pass_in_one_order_only(tracks, random):
    length = max(map(sum, tracks))
    placed = []
    for track, sizes in enumerate(tracks):
        sizes = [*sizes, length - sum(sizes)] if sum(sizes) < length else sizes
        starts = [sum(sizes[:k]) for k in range(len(sizes))]
        placed += [(start, track, size) for start, size in zip(starts, sizes, strict=True)]
    placed.sort()
    in_order = [replace(GROUP, track=track, frames=size) for _, track, size in placed]
    check_index(Index(tuple(in_order)))
    turns = [group.track for group in in_order]
    random.shuffle(turns)
    waiting = [iter([group for group in in_order if group.track == track]) for track in range(len(tracks))]
    shuffled = [next(waiting[track]) for track in turns]
    if shuffled != in_order:
        with pytest.raises(FormatError):
            check_index(Index(tuple(shuffled)))


@given(records(Index))
def test_any_index_passes_or_is_refused_and_what_passes_leads_somewhere(index):
    try:
        check_index(index)
    except FormatError:
        return
    for number, entry in enumerate(index.chunks):
        assert all(other < number for other in entry.depends_on)


DEEPEST = '{"a":' + "[" * (MOST_NESTED - 1) + '"[["' + "]" * (MOST_NESTED - 1) + "}"
NO_OBJECTS = ["", "[]", "{", "NaN", '{"a": Infinity}', '{"a": 1e999}', '{"a": "\\ud800"}', "[" * 60000, "1" * 60000]
NO_OBJECTS += [DEEPEST.replace('"[["', "[]"), '{"a":["\\ud800"],"a":1}', '{"a":1e999,"a":1}', f'{{"a":{"1" * 310}}}']


def test_metadata_may_have_as_many_lists_in_each_other_as_every_reader_reads():
    assert parse_metadata(DEEPEST).keys() == {"a"}


def test_times_and_sizes_that_are_no_doubles_are_refused():
    header = Header(30.0, (0.0, 0.0, 0.0), 1.0, (-1.0,) * 3, (1.0,) * 3, "{}", EXACT - 5, (5,))
    two = replace(GROUP, frames=2)
    check_file(header, Index((two,)), 0, 100)
    for wrong in (replace(header, first_time=EXACT - 4), replace(header, first_time=-EXACT - 1)):
        with pytest.raises(FormatError, match=r"Header\.first_time: times .* are beyond 53 bits"):
            check_file(wrong, Index((two,)), 0, 100)
    with pytest.raises(FormatError, match=r"Index\.chunks: a file of \d+ bytes, beyond 53 bits"):
        check_file(header, Index((replace(two, layers=(Layer(EXACT, 0),)),)), 0, 100)


@pytest.mark.parametrize("text", NO_OBJECTS)
def test_metadata_that_is_no_json_object_is_refused(text):
    with pytest.raises(FormatError, match=r"Header\.metadata"):
        parse_metadata(text)


LAYERED = replace(GROUP, form=Form.LAYERS)
COLORS = replace(GROUP, kind=ChunkKind.COLORS, form=Form.VERTEX_COLORS, depends_on=(0,))
ATLAS = replace(COLORS, kind=ChunkKind.ATLAS, form=Form.PLACES)
PICTURES = replace(COLORS, kind=ChunkKind.PICTURES, form=Form.VIDEO, depends_on=(0, 2))
COMPATIBLE = replace(PICTURES, kind=ChunkKind.COMPATIBLE)
FIRST = (LAYERED, COLORS, ATLAS, PICTURES, COMPATIBLE)
NEXT = (*FIRST, replace(LAYERED, depends_on=(0,)))  # chunk 5


def after(companion: IndexEntry, *depends_on: int) -> IndexEntry:
    return replace(companion, depends_on=depends_on)


def test_groups_and_backgrounds_have_companions():
    others = after(COLORS, 5, 1), after(PICTURES, 5, 2, 3), after(COMPATIBLE, 5, 2, 4)
    for order in (others, others[::-1], others[:1], (after(COLORS, 5),)):
        check_index(Index((*NEXT, *order)))
    still = [replace(one, frames=0) for one in FIRST[1:]]
    check_index(Index((STATIC, *still, PATCH, replace(still[0], depends_on=(5,)), GROUP)))
    check_index(Index((*FIRST, replace(COLORS, kind=77, form=99, frames=3, depends_on=(9,)))))  # of a later version


@pytest.mark.parametrize(
    "chunks",
    [
        (COLORS, LAYERED),
        (LAYERED, COLORS, COLORS),
        (*FIRST, after(PICTURES, 0, 2)),
        (LAYERED, after(COLORS, 1)),
        (LAYERED, COLORS, after(COLORS, 1)),
        (LAYERED, after(COLORS)),
        (LAYERED, after(COLORS, 1 << 60)),
        (LAYERED, replace(COLORS, frames=4)),
        (LAYERED, replace(COLORS, frames=0)),
        (LAYERED, replace(COLORS, track=1)),
        (LAYERED, replace(COLORS, form=Form.VIDEO)),
        (LAYERED, replace(ATLAS, form=Form.VERTEX_COLORS)),
        (LAYERED, COLORS, replace(PICTURES, depends_on=(0,))),
        (LAYERED, COLORS, after(PICTURES, 0, 1)),
        (LAYERED, COLORS, LAYERED, after(COLORS, 2, 1)),  # of a group that is not predicted
        (GROUP, COLORS, ATLAS),  # of a form without a base mesh
        (*NEXT, after(ATLAS, 5)),
        (*NEXT, after(COLORS, 5, 3)),
        (*NEXT, after(PICTURES, 5, 2)),
        (*NEXT, after(PICTURES, 5, 2, 4)),  # of the other coding
        (*NEXT, after(PICTURES, 5, 3, 2)),
        (*NEXT, after(PICTURES, 5, 2, 3, 4)),
        (*NEXT[:3], replace(NEXT[5]), after(PICTURES, 3, 2)),  # where the group before has none
        (STATIC, PATCH, replace(ATLAS, frames=0, depends_on=(1,)), GROUP),
        (STATIC, ATLAS, GROUP),
    ],
)
def test_companions_of_other_chunks_or_in_another_order_are_refused(chunks):
    with pytest.raises(FormatError, match=r"chunk \d: "):
        check_index(Index(chunks))
