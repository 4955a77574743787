"""Progress on standard error: lines outside a terminal, and the time that is left."""

import time

import pytest
from rich.progress import Progress

from meshreel.cli import console, shown
from meshreel.cli.console import Common, StageBars, left, line_of


class Clock:
    now = 0.0

    def __call__(self):
        return self.now


@pytest.fixture
def staged():
    """Stages without a display, and the clock that they go by."""
    clock = Clock()
    return StageBars(Progress(disable=True, get_time=clock), 100), clock


def test_the_time_left_is_that_of_the_frames_so_far(staged):
    progress, clock = staged
    progress("code", 20, 100)  # of an earlier run
    (task,) = progress.bars.tasks
    assert left(task) is None
    for clock.now, done in ((30.0, 21), (80.0, 40)):
        progress("code", done, 100)
    assert left(task) == 80.0 * 60 / 20


def test_a_line_tells_of_all_stages_that_are_not_done(staged):
    progress, clock = staged
    assert line_of(progress.bars.tasks) == ""
    progress("survey", 100, 100)
    clock.now = 30.0
    assert line_of(progress.bars.tasks) == "meshreel: survey is done; 0:00:30 so far"
    for stage, done in (("code", 0), ("track", 1)):
        progress(stage, done, 100)
    clock.now = 120.0
    assert line_of(progress.bars.tasks) == "meshreel: code 0, track 1 of 100 frames; 0:02:00 so far"
    progress("code", 10, 100)
    assert line_of(progress.bars.tasks).endswith("code 10, track 1 of 100 frames; 0:02:00 so far, about 0:13:30 left")


def test_a_stage_that_begins_again_counts_its_time_anew(staged):
    progress, clock = staged
    progress("code", 0, 100)
    clock.now = 1000.0
    progress("code", 100, 100)
    (task,) = progress.bars.tasks
    assert task.finished
    progress("code", 0, 100)
    clock.now = 1010.0
    progress("code", 10, 100)
    assert not task.finished and left(task) == 90.0


@pytest.mark.parametrize("quiet", [False, True])
def test_outside_a_terminal_lines_come_as_long_as_it_lasts(monkeypatch, capsys, quiet):
    monkeypatch.setattr(console, "EVERY", 0.02)
    said, patience = "", 10 if quiet else 3000
    with Common(quiet=quiet).stages(8) as progress:
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
