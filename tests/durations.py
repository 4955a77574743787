"""Durations of tests, recorded and used: tests that take long are slow, and the longest files run first.

Each test's CPU time, with that of the processes that it waited for, goes into the JUnit report; `scripts/durations.py`
makes `durations.json` of such reports. CPU time hardly depends on what else the machine does.
"""

import json
import os
from collections.abc import Generator
from pathlib import Path

import pytest

RECORDED = Path(__file__).with_name("durations.json")
PROPERTY = "cpu"  # s, in the report
LONGEST = 1.5  # s: tests that take longer are recorded by themselves, and slow, so that the others end within minutes
_BEGUN = pytest.StashKey[float]()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Note the CPU time before the test's fixtures are made."""
    item.stash[_BEGUN] = cpu_seconds()


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None]:
    """Add the test's CPU time to its report."""
    yield
    item.user_properties.append((PROPERTY, f"{cpu_seconds() - item.stash[_BEGUN]:.3f}"))


@pytest.hookimpl(tryfirst=True)  # before tests are chosen by their marks
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Mark tests that take long as slow, and put the longest files first; those that are not recorded count as long."""
    known, root = json.loads(RECORDED.read_text(encoding="utf-8")), config.rootpath
    for item in items:
        if item.nodeid in known["tests"]:
            item.add_marker("slow")
    items.sort(key=lambda item: -known["files"].get(item.path.relative_to(root).as_posix(), float("inf")))


def cpu_seconds() -> float:
    """Return the CPU time of this process and of all that it waited for."""
    return sum(os.times()[:4])
