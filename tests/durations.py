"""Durations of tests, recorded and used: files that take longest run first, so that no worker waits at the end.

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


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put files that took longest first; those that are not recorded are taken for long."""
    known = json.loads(RECORDED.read_text(encoding="utf-8"))["files"]
    root = config.rootpath
    items.sort(key=lambda item: -known.get(item.path.relative_to(root).as_posix(), float("inf")))


def cpu_seconds() -> float:
    """Return the CPU time of this process and of all that it waited for."""
    return sum(os.times()[:4])
