"""Garbage is not looked for while a kernel is translated, and afterwards as before."""

from __future__ import annotations

import gc
import os
import signal
from collections.abc import Iterator

import pytest

from liemech.compiler.machine import gc_pause as module
from liemech.compiler.machine.gc_pause import gc_paused


@pytest.fixture(autouse=True)
def thresholds() -> Iterator[tuple[int, ...]]:
    """Those of this process, put back whatever a test does."""
    before, enabled = gc.get_threshold(), gc.isenabled()
    yield before
    gc.set_threshold(*before)
    (gc.enable if enabled else gc.disable)()


def test_the_last_to_leave_puts_back_what_the_first_found(thresholds: tuple[int, ...]) -> None:
    first, second = gc_paused(), gc_paused()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert gc.get_threshold()[0] == 0
    second.__exit__(None, None, None)
    assert gc.get_threshold() == thresholds


def test_a_translation_that_fails_puts_it_back(thresholds: tuple[int, ...]) -> None:
    with pytest.raises(ZeroDivisionError), gc_paused():
        raise ZeroDivisionError
    assert gc.get_threshold() == thresholds


@pytest.mark.parametrize("enabled", [True, False])
def test_what_the_user_says_meanwhile_counts(enabled: bool) -> None:
    (gc.disable if enabled else gc.enable)()
    with gc_paused():
        (gc.enable if enabled else gc.disable)()
        gc.set_threshold(321, 7, 5)
    assert gc.isenabled() is enabled
    assert gc.get_threshold()[:2] == (321, 7)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="has no fork")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_a_child_forked_during_a_translation_collects(thresholds: tuple[int, ...]) -> None:
    with gc_paused(), module._lock:  # as another thread may hold it
        child = os.fork()
        if child == 0:
            signal.alarm(20)
            with gc_paused():
                inside = gc.get_threshold()[0]
            os._exit(0 if inside == 0 and gc.get_threshold() == thresholds else 1)
        assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
