"""A formula that runs once for all sites: implicit Euler steps along a chain, by elimination from site to site."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from liemech.compiler import kernel
from liemech.compiler.driver import accepted, attempt, itself, write
from liemech.compiler.sites import site_calls
from liemech.compiler.sites.planes import Planes, columns, each
from liemech.errors import InvalidInput, NoConvergence, NotCompilable
from liemech.formulas import vec
from liemech.formulas.classes.layouts import layout_of, vector
from liemech.formulas.sites import meet, once, present_site, total

N, TURNS = 13, 3
NUMBER, PAIR = layout_of(0.0), vector(2)
native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")


def places(sites: Any) -> Any:
    """The columns of the sites: y, and what elimination works with."""
    return columns(sites, y=PAIR, right_side=PAIR, solution=PAIR, pivot=NUMBER, last=NUMBER)


def solved(sites: Any, h: float) -> None:
    """(1 + h L) x = b, with L the second difference along the chain: two loops from site to site, a pivot each."""
    of = places(sites)
    each(sites, begun, h, of)
    for i in range(1, N):
        factor = -h / of.pivot.at(i - 1)
        of.pivot.put(i, of.pivot.at(i) + h * factor)
        of.right_side.put(i, of.right_side.at(i) - factor * of.right_side.at(i - 1))
    for i in range(N - 1, -1, -1):
        pivot = of.pivot.at(i)
        if not pivot > 0.0:
            raise NoConvergence("a pivot is not positive")
        beyond = of.solution.at(i + 1) if i + 1 < N else vec(0.0, 0.0)
        of.solution.put(i, (1.0 / pivot) * (of.right_side.at(i) + h * beyond))


def begun(h: float, of: Any) -> None:
    """The diagonal."""
    of.pivot.save(1.0 + (2.0 - of.last.load()) * h)


def stepped(sites: Any, h: float) -> None:
    """Steps of several lengths, in which every site keeps what it had before."""
    of = places(sites)
    start = y = of.y.load()
    for k in range(TURNS):
        before = 0.5 * start + 0.5 * y
        y = once(solved, of.right_side, y, of.solution, sites, (1.0 + k) * h) + 0.1 * before
    of.y.save(y + total(y) * (1.0 / N))


def driver(sites: Any, h: float, done: Any) -> None:
    trial = attempt(each, sites, stepped, sites, h)
    if accepted(trial, itself):
        write(done, 0, 1.0, NUMBER)


def filled() -> Planes:
    sites, numbers = Planes.of_rows(2 * 3 + 2, N), np.random.default_rng(3).normal(size=(N, 2))
    of = places(sites)
    for i, row in enumerate(numbers.tolist()):
        of.y.put(i, vec(*row))
        of.last.put(i, float(i in (0, N - 1)))
    return sites


def y_of(sites: Planes) -> np.ndarray:
    return np.array([[*places(sites).y.at(i)] for i in range(N)])


def run(h: float, lanes: int) -> tuple[np.ndarray, bool]:
    """y of all sites after the steps, in plain Python if `lanes` is 0; did they succeed?"""
    sites, done = filled(), np.zeros(1)
    arguments = sites, h, kernel.Shared(done)
    if lanes:
        site_calls.SiteCalls(kernel.kernel(driver, *arguments, lanes=lanes), N)(*arguments)
    else:
        driver(sites, h, done)
    return y_of(sites), bool(done[0])


def test_it_is_the_solution_of_the_equation_of_all_sites() -> None:
    y = start = y_of(filled())
    L = 2.0 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
    L[0, 0] = L[-1, -1] = 1.0
    for k in range(TURNS):
        before = 0.5 * (start + y)
        y = np.linalg.solve(np.eye(N) + 0.3 * (1 + k) * L, y) + 0.1 * before
    found, done = run(0.3, 0)
    assert done and np.abs(found - (y + y.mean(axis=0))).max() < 1e-14


@native
@pytest.mark.slow
def test_native_code_has_its_bits_and_makes_it_once() -> None:
    plain, _ = run(0.3, 0)
    for lanes in (1, 8, 16):
        found, done = run(0.3, lanes)
        assert done and np.array_equal(found, plain), lanes
    text = kernel.translated(driver, filled(), 0.3, kernel.Shared(np.zeros(1)))
    made = [line for line in text.splitlines() if line.startswith("define") and '"solved.' in line]
    calls = [line for line in text.splitlines() if "call" in line and '"solved.' in line]
    assert len(made) == 1 and len(calls) == TURNS


@native
@pytest.mark.slow
def test_where_it_fails_no_site_goes_on() -> None:
    """Backwards in time a pivot is lost."""
    for lanes in (0, 8):
        found, done = run(-0.3, lanes)
        assert not done and np.array_equal(found, y_of(filled())), lanes


@native
@pytest.mark.slow
def test_one_thread_makes_such_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many are asked for, and however much there is to do; other loops are shared."""

    def shared(sites: Any, h: float) -> None:
        each(sites, begun, h, places(sites))

    monkeypatch.setattr(site_calls, "SHARE", 1)
    monkeypatch.setattr(site_calls.guard_words, "ON", False)
    alone = kernel.kernel(driver, filled(), 0.3, kernel.Shared(np.zeros(1)), lanes=8)
    assert len(site_calls.SiteCalls(alone, 100, workers=3).shares) == 1
    assert len(site_calls.SiteCalls(kernel.kernel(shared, filled(), 0.3, lanes=8), 100, workers=3).shares) == 3


def after_saving(sites: Any) -> None:
    of = places(sites)
    of.y.save(of.y.load())
    of.y.save(once(solved, of.right_side, of.y.load(), of.solution, sites, 0.1))


def of_what_was_published(sites: Any) -> None:
    of = places(sites)
    met = meet(2.0 * of.last.load())
    y = once(solved, of.right_side, of.y.load(), of.solution, sites, 0.1)
    of.y.save(met.at(0) * y)


def of_a_function(sites: Any) -> None:
    of = places(sites)
    of.y.save(once(solved_with, of.right_side, of.y.load(), of.solution, sites, of))


def solved_with(sites: Any, of: Any) -> None:
    solved(sites, 0.1)


def test_sites_ask_alike() -> None:
    def some_ask(sites: Any) -> None:
        if present_site() > 3:
            once(solved, places(sites).right_side, vec(0.0, 0.0), places(sites).solution, sites, 0.1)

    with pytest.raises(InvalidInput, match="once"):
        each(filled(), some_ask, filled())


@native
@pytest.mark.parametrize(
    ("formula", "words"),
    [
        (after_saving, "saved"),
        (of_what_was_published, "before they meet again"),
        (of_a_function, "no number, record or place of sites"),
    ],
)
def test_what_native_code_refuses(formula: Any, words: str) -> None:
    def refused(sites: Any) -> None:
        each(sites, formula, sites)

    with pytest.raises(NotCompilable, match=words):
        kernel.translated(refused, filled())
