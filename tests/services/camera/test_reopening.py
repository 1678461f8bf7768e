"""When a source is opened again."""

from __future__ import annotations

from types import SimpleNamespace

from services.camera.reopening import LEAVE_S, Reopening


def test_the_delay_doubles_up_to_the_most_until_a_picture_comes():
    reopening = Reopening()
    assert [reopening.plan(0.0, 1.0, 5.0) for _ in range(5)] == [1.0, 2.0, 4.0, 5.0, 5.0]
    reopening.succeeded()
    assert reopening.plan(0.0, 1.0, 5.0) == 1.0


def test_it_is_due_after_the_delay_and_not_before():
    reopening = Reopening()
    assert not reopening.planned
    reopening.plan(10.0, 1.5, 5.0)
    assert reopening.planned
    assert [reopening.due(now_s) for now_s in (10.0, 11.4, 11.5)] == [False, False, True]
    reopening.begun()
    assert not reopening.due(20.0)


def test_after_a_change_it_is_due_at_once_and_then_after_the_first_delay():
    reopening = Reopening()
    reopening.plan(0.0, 1.0, 5.0)
    reopening.plan_at_once(0.5, SimpleNamespace(gone=True))
    assert reopening.due(0.5)
    reopening.begun()
    assert reopening.plan(0.5, 1.0, 5.0) == 1.0


def test_one_that_is_still_being_closed_is_waited_for_but_not_for_ever():
    reopening, leaving = Reopening(), SimpleNamespace(gone=False)
    reopening.plan_at_once(0.0, leaving)
    assert [reopening.due(now_s) for now_s in (0.0, LEAVE_S)] == [False, True]
    leaving.gone = True
    assert reopening.due(0.1)
