"""Work beside the caller's comes to the same as work one after the other."""

import multiprocessing
import sys
import threading

import pytest

from semrl.core import beside
from semrl.core.beside import Started, alone, in_turn


@pytest.fixture(params=[1, 2])
def processors(request, monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: request.param)
    return request.param


def test_each_call_is_made_once_and_told_as_it_went(processors):
    calls = []
    started = [Started(lambda i=i: calls.append(i) or i * i) for i in range(20)]
    assert [one.result() for one in reversed(started)] == [i * i for i in range(19, -1, -1)]
    assert sorted(calls) == list(range(20))


def test_an_error_is_raised_where_the_result_is_wanted(processors):
    with pytest.raises(ZeroDivisionError):
        Started(lambda: 1 / 0).result()


def test_with_a_second_processor_both_go_on_at_once(monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 2)
    met = threading.Barrier(2, timeout=20)
    other = Started(met.wait)
    places = met.wait(), other.result()  # the barrier breaks after 20 seconds if one waits for the other
    assert sorted(places) == [0, 1]


def test_a_process_that_is_to_work_alone_does_all_on_one_thread(monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 2)
    with alone():
        assert Started(threading.get_ident).result() == threading.get_ident()


def test_what_has_not_begun_is_done_by_whoever_wants_it(monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 2)
    begun, go_on = threading.Event(), threading.Event()
    busy = Started(lambda: begun.set() or go_on.wait(20))
    begun.wait(20)
    assert Started(threading.get_ident).result() == threading.get_ident()
    go_on.set()
    assert busy.result()


def _squared(answers):
    answers.put(Started(lambda: 49).result())


@pytest.mark.skipif(sys.platform == "win32", reason="Windows does not fork")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_a_forked_process_has_a_thread_of_its_own(monkeypatch):
    monkeypatch.setattr(beside, "processors", lambda: 2)
    Started(lambda: 1).result()
    context = multiprocessing.get_context("fork")
    answers = context.Queue()
    child = context.Process(target=_squared, args=(answers,))
    child.start()
    assert answers.get(timeout=20) == 49
    child.join(20)


def test_calls_are_made_in_turn_elsewhere_and_all_by_the_end():
    calls, threads = [], set()
    with in_turn(3) as later:
        for i in range(20):
            later(lambda i=i: calls.append(i) or threads.add(threading.get_ident()))
            assert len(calls) >= i + 1 - 4  # three may wait while one is made
    assert calls == list(range(20))
    assert threading.get_ident() not in threads and len(threads) == 1


def test_what_fails_in_turn_is_raised_by_the_end_at_the_latest():
    with pytest.raises(ZeroDivisionError), in_turn(3) as later:
        later(lambda: 1 / 0)
