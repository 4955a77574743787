"""Counts of work: of a thread, by kind, since a moment."""

import threading

from meshreel.geometry import work


def test_counts_are_those_since_a_moment() -> None:
    work.count("decimations")
    before = work.so_far()
    assert work.since(before) == {}
    work.count("frames read", 3)
    work.count("decimations")
    assert work.since(before) == {"decimations": 1, "frames read": 3}


def test_another_thread_counts_on_its_own_until_its_work_is_added() -> None:
    before, found = work.so_far(), list[work.Work]()

    def other() -> None:
        start = work.so_far()
        work.count("closest points", 7)
        found.append(work.since(start))

    thread = threading.Thread(target=other)
    thread.start()
    thread.join()
    assert work.since(before) == {}
    work.add(found[0])
    assert work.since(before) == {"closest points": 7}
