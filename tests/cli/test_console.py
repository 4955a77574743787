"""Progress on standard error: lines outside a terminal, and the time that is left."""

import time

import pytest
from rich.progress import Progress as RichProgress

from meshreel.cli import console, shown
from meshreel.cli.console import Common, StageBars, line_of
from meshreel.encoder.group.progress import Progress


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def staged():
    """Stages without a display, and the clock that they go by."""
    clock = Clock()
    return StageBars(RichProgress(disable=True, get_time=clock)), clock


def test_the_time_left_is_that_of_the_frames_so_far(staged):
    progress, clock = staged
    progress("fuse", 20, 100)  # of an earlier run
    assert "left" not in line_of(progress.bars.tasks)
    for clock.now, done in ((30.0, 21), (80.0, 40)):
        progress("fuse", done, 100)
    assert line_of(progress.bars.tasks).endswith("fuse 40 of 100 frames; 0:01:20 so far, about 0:04:00 left")


def test_a_line_tells_of_the_first_stage_that_is_not_done(staged):
    progress, clock = staged
    assert line_of(progress.bars.tasks) == ""
    progress("read", 100, 100)
    clock.now = 30.0
    assert line_of(progress.bars.tasks).startswith("meshreel: read 100 of 100 frames; 0:00:30 so far")
    progress("compare", 0, 100)
    clock.now = 80.0
    progress("compare", 20, 100)
    line = line_of(progress.bars.tasks)
    assert line == "meshreel: compare 20 of 100 frames; 0:01:20 so far, about 0:03:20 left"


def test_an_encode_is_one_bar_with_the_share_of_the_whole_and_the_stage(staged):
    progress, clock = staged
    progress.encode(Progress("survey", 3, 10, 0.01, None))
    clock.now = 20.0
    assert line_of(progress.bars.tasks) == "meshreel: encode 1 %, survey; 0:00:20 so far"
    progress.encode(Progress("track", 1, 10, 0.25, 59.8))
    assert line_of(progress.bars.tasks) == "meshreel: encode 25 %, track; 0:00:20 so far, about 0:01:00 left"
    assert len(progress.bars.tasks) == 1 and progress.bars.tasks[0].percentage == 25


@pytest.mark.parametrize("quiet", [False, True])
def test_outside_a_terminal_lines_come_as_long_as_it_lasts(monkeypatch, capsys, quiet):
    monkeypatch.setattr(console, "EVERY", 0.02)
    said, patience = "", 10 if quiet else 3000
    with Common(quiet=quiet).stages() as progress:
        progress("code", 3, 8)
        while said.count("\n") < 3 and (patience := patience - 1):
            time.sleep(0.02)
            said += capsys.readouterr().err
    lines = (said + capsys.readouterr().err).splitlines()
    time.sleep(0.1)
    assert capsys.readouterr().err == ""
    assert (len(lines) > 2 and lines[0].startswith("meshreel: code 3 of 8 frames; ")) != quiet
    assert not quiet or not lines


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a\x1b[2Jb", r"a\x1b[2Jb"),
        ("\x07\x00\x9b", r"\x07\x00\x9b"),
        ("\u202eply", r"\u202eply"),
        ("né\t北\n", "né\t北\n"),
    ],
)
def test_texts_of_strangers_command_no_terminal(text, wanted):
    assert shown(text) == wanted


def test_tables_and_warnings_show_the_commands_of_strangers(capsys):
    from rich.table import Table

    table = Table("name")
    table.add_row("a\x1b[2J")
    Common().result({}, table, "b\x1b]0;c")
    Common().warn(["d\x1b[m"])
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err and r"a\x1b" in said.out and r"d\x1b" in said.err
