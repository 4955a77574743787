import threading
import time

import pytest

from meshreel.geometry import threads as sides
from meshreel.geometry import work
from meshreel.geometry.threads import ahead, cores, mapped, mapped_until, threads


def slowly(number: int, factor: int = 2) -> int:
    time.sleep(0.002 * (5 - number % 5))
    return factor * number


@pytest.mark.parametrize("count", [1, 2, 5])
def test_results_are_in_the_order_of_the_arguments(count):
    with threads(count):
        assert mapped(slowly, range(12)) == [2 * k for k in range(12)]
        assert mapped(slowly, range(3), [1, 3, 5]) == [0, 3, 10]
        assert mapped(slowly, []) == []
        with pytest.raises(ValueError, match="of different lengths"):
            mapped(slowly, range(3), [1, 3])


def test_calls_wait_for_each_other_in_no_more_threads_than_are_wanted():
    seen, lock, most = set[int](), threading.Lock(), [0, 0]
    all_three = threading.Barrier(3)

    def call(number: int) -> None:
        with lock:
            most[0] += 1
            most[1] = max(most)
        seen.add(threading.get_ident())
        if number < 3:
            all_three.wait()  # however late another thread comes
        time.sleep(0.01)
        with lock:
            most[0] -= 1

    with threads(3):
        mapped(call, range(12))
    assert len(seen) == most[1] == 3 and threading.get_ident() in seen
    seen.clear()
    mapped(lambda _: seen.add(threading.get_ident()), range(4))
    assert seen == {threading.get_ident()}  # outside of the block


def test_calls_within_calls_end_though_every_thread_waits():
    with threads(2):
        assert mapped(lambda a: sum(mapped(lambda b: slowly(a * b), range(6))), range(6)) == [30 * a for a in range(6)]


@pytest.mark.parametrize("count", [1, 4])
def test_the_first_call_that_fails_is_told_of(count, monkeypatch):
    begun, stopped, stop = list[int](), threading.Event(), sides._Calls.stop
    monkeypatch.setattr(sides._Calls, "stop", lambda calls: (stop(calls), stopped.set()))

    def fails(number: int) -> int:
        begun.append(number)
        if number in (3, 4):
            time.sleep(0.02 if number == 3 else 0.0)
            raise ValueError(f"call {number}")
        if number > 4:  # another thread than the one that fails
            stopped.wait()
        return number

    with threads(count), pytest.raises(ValueError, match="call 3"):
        mapped(fails, range(100))
    assert len(begun) <= 5 + count


@pytest.mark.parametrize("count", [1, 4])
def test_calls_after_one_that_is_enough_do_not_count(count):
    with threads(count):
        assert mapped_until(lambda found: found >= 6, slowly, range(50)) == [0, 2, 4, 6]
        assert mapped_until(lambda found: found > 50, slowly, range(5)) == [0, 2, 4, 6, 8]


@pytest.mark.parametrize(("count", "most", "together"), [(1, 9, 1), (4, 9, 4), (4, 2, 2)])
def test_no_more_results_wait_than_there_are_threads(count, most, together):
    begun = list[int]()
    with threads(count):
        for number, found in enumerate(ahead(lambda k: (begun.append(k), slowly(k))[1], iter(range(10)), most)):
            assert found == 2 * number and len(begun) <= number + together
    assert sorted(begun) == list(range(10))


def test_other_threads_go_on_while_a_result_is_used():
    begun = [threading.Event() for _ in range(4)]
    with threads(2):
        for number in ahead(lambda k: (begun[k].set(), k)[1], range(4)):
            assert number == 3 or begun[number + 1].wait(10)


def test_an_error_is_raised_in_its_turn_and_no_call_goes_on_afterwards():
    done = list[int]()

    def call(number: int) -> int:
        slowly(number)
        done.append(number)
        return 1 // (number - 2)

    with threads(3):
        found = list[int]()
        with pytest.raises(ZeroDivisionError):
            for result in ahead(call, range(100)):
                found.append(result)
        assert found == [-1, -1] and len(done) <= 5
        before = len(done)
        time.sleep(0.05)
        assert len(done) == before
        with pytest.raises(StopIteration):
            next(ahead(call, []))


def test_what_stops_the_program_stops_calls_at_once():
    begun = list[int]()

    def call(number: int) -> int:
        begun.append(number)
        if threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt
        time.sleep(0.05)
        return number

    with threads(2), pytest.raises(KeyboardInterrupt):
        for _ in range(3):  # until this thread takes a call
            list(ahead(call, range(20)))
    assert len(begun) <= 4


def test_what_stops_the_program_counts_though_an_earlier_call_was_enough():
    both = threading.Barrier(2)

    def call(number: int) -> int:
        both.wait(10)
        if threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt
        return number

    with threads(2), pytest.raises(KeyboardInterrupt):
        mapped_until(lambda _: True, call, range(2))


def test_work_done_ahead_is_counted_and_reported_once():
    told = list[int]()
    with threads(3), work.reporting(lambda _, number: told.append(number)):
        before = work.so_far()
        for _ in ahead(lambda number: (slowly(number), work.count("frames fitted", number)), range(8)):
            pass
        assert work.since(before) == {"frames fitted": 28} and sum(told) == 28


def test_work_of_all_threads_is_counted_and_reported_once():
    told = list[int]()
    with threads(3), work.reporting(lambda _, number: told.append(number)):
        before = work.so_far()
        mapped(lambda number: (slowly(number), work.count("frames fitted", number)), range(8))
        assert work.since(before) == {"frames fitted": 28} and sum(told) == 28


@pytest.mark.parametrize(("quota", "count"), [("200000 100000", 2), ("50000 100000", 1), ("max 100000", 64), ("?", 64)])
def test_cores_are_those_of_the_process_within_the_quota_of_its_container(monkeypatch, tmp_path, quota, count):
    (tmp_path / "cpu.max").write_text(quota)
    monkeypatch.setattr(sides, "_QUOTA", str(tmp_path / "cpu.max"))
    monkeypatch.setattr("os.sched_getaffinity", lambda _: set(range(64)), raising=False)
    monkeypatch.setattr("os.cpu_count", lambda: 64)
    assert cores() == count
