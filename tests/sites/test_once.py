"""`once`: a formula that runs for all sites together, between two meetings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hand_made import ring

from liemech.compiler import kernel
from liemech.compiler.driver import accepted, attempt, itself, write
from liemech.compiler.sites.planes import Planes, each, load, save
from liemech.compiler.sites.site_calls import SiteCalls
from liemech.errors import InvalidInput, NoConvergence, NotCompilable
from liemech.formulas import sqrt, vec
from liemech.formulas.classes.layouts import layout_of
from liemech.formulas.sites import SiteTable, TooManySites, meet, once, one_site, repeated, rows_of, total

NUMBER = layout_of(0.0)
native = pytest.mark.skipif(kernel.available() is not None, reason="needs llvmlite")


def eliminated(diagonal: Any, x: Any, others: Any, count: float) -> None:
    """The equations d_i x_i - b_i (x_i-1 + x_i+1) = r_i, from the first to the last and back; b is published."""
    for i in range(1, int(count)):
        ratio = others.at(i)[0] / diagonal.at(i - 1)
        diagonal.put(i, diagonal.at(i) - ratio * others.at(i - 1)[0])
        x.put(i, x.at(i) + ratio * x.at(i - 1))
    last = int(count) - 1
    x.put(last, x.at(last) / diagonal.at(last))
    for k in range(last):
        i = last - 1 - k
        x.put(i, (x.at(i) + others.at(i)[0] * x.at(i + 1)) / diagonal.at(i))
    if abs(x.at(0)) > 1e3:
        raise NoConvergence("large")


def relaxed(sites: Any, near: SiteTable, count: float) -> None:
    """A number kept across, a question before and after, another meeting behind, and sweeps of all that."""
    d, b, r = (load(sites, k, NUMBER) for k in range(3))
    kept = sqrt(d)
    mean = total(r) / count
    others = meet(vec(b, r))
    beside = others.of(near, 0)[1]
    _, x = once(eliminated, (d, r - mean), others, count)
    behind = others.of(near, 1)[1]
    y = meet(x).of(near, 0)

    def sweep(z: Any) -> Any:
        those = meet(vec(b, z))
        _, new = once(eliminated, (d + kept, r + 0.1 * z), those, count)
        moved = new - z
        return new + 0.0 * those.of(near, 0)[1], moved * moved

    z, _ = repeated(sweep, x, lambda turn, off: (turn + 1.0, off < 1e-30), 0.0, 40)
    for k, value in enumerate((x, y, kept * beside + behind, z)):
        save(sites, 3 + k, value, NUMBER)


def driver(sites: Any, near: SiteTable, count: float, done: Any) -> None:
    """One loop over sites."""
    if accepted(attempt(each, sites, relaxed, sites, near, count), itself):
        write(done, 0, 1.0, NUMBER)


def made(n: int, large: float = 1.0) -> tuple[np.ndarray, Any]:
    rng = np.random.default_rng(4)
    numbers = np.zeros((7, n))
    numbers[0], numbers[1], numbers[2] = rng.uniform(3.0, 4.0, n), rng.uniform(0.5, 1.0, n), rng.normal(size=n)
    numbers[2, 0] *= large
    return numbers, ring(n)


def run(n: int, lanes: int, workers: int = 1, large: float = 1.0) -> np.ndarray | None:
    """The numbers of all sites; None if the step was given up."""
    numbers, near = made(n, large)
    sites, done = Planes(rows_of(numbers), n), np.zeros(1)
    if lanes:
        arguments = sites, near, float(n), kernel.Shared(done)
        SiteCalls(kernel.kernel(driver, *arguments, lanes=lanes), n, workers)(*arguments)
    else:
        driver(sites, near, float(n), done)
    return sites.array[:, :n] if done[0] else None


def matrix(numbers: np.ndarray) -> np.ndarray:
    d, b, _ = numbers[:3]
    return np.diag(d) - np.diag(b[:-1], 1) - np.diag(b[1:], -1)


@pytest.mark.parametrize("n", [1, 2, 13])
def test_all_sites_are_eliminated_together(n: int) -> None:
    found: Any = run(n, 0)
    d, _, r, x, y, across, z = found
    i = np.arange(n)
    np.testing.assert_allclose(x, np.linalg.solve(matrix(found), r - r.mean()), rtol=1e-13)
    assert np.array_equal(y, x[(i + 1) % n])
    assert np.array_equal(across, np.sqrt(d) * r[(i + 1) % n] + r[(i - 1) % n])
    whole = matrix(found) + np.diag(np.sqrt(d)) - 0.1 * np.eye(n)
    np.testing.assert_allclose(z, np.linalg.solve(whole, r), rtol=1e-13)


@native
@pytest.mark.parametrize("n", [1, 13, 77])
def test_native_code_and_any_lanes_give_the_bits_of_plain_python(n: int) -> None:
    plain = run(n, 0)
    for lanes in (1, 8, 16):
        assert np.array_equal(run(n, lanes), plain), lanes


@native
def test_one_of_several_threads_runs_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("liemech.compiler.sites.site_calls.SHARE", 8)
    plain = run(100, 0)
    for workers in (2, 3):
        for _ in range(20):
            assert np.array_equal(run(100, 8, workers), plain), workers


@native
def test_it_may_give_the_step_up(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("liemech.compiler.sites.site_calls.SHARE", 8)
    assert [run(40, lanes, workers, 1e9) for lanes, workers in ((0, 1), (1, 1), (8, 1), (8, 2))] == [None] * 4


def test_it_is_asked_by_all_sites_and_for_all() -> None:
    with pytest.raises(InvalidInput, match="there is no site here"):
        once(eliminated, (1.0,), 0.0)
    with pytest.raises(TooManySites):
        one_site(5, 2, lambda: once(lambda x: None, (1.0,)))


def number(sites: Any) -> float:
    return load(sites, 0, NUMBER)


def loads(sites: Any) -> None:
    (y,) = once(lambda column: column.put(0, number(sites)), (number(sites),))
    save(sites, 1, y, NUMBER)


def sums(sites: Any) -> None:
    (y,) = once(lambda column: column.put(0, total(1.0)), (number(sites),))
    save(sites, 1, y, NUMBER)


def saves(sites: Any) -> None:
    save(sites, 1, number(sites), NUMBER)
    once(lambda column: None, (1.0,))


def asks(sites: Any) -> None:
    (y,) = once(lambda column, x: column.put(0, x), (1.0,), number(sites))
    save(sites, 1, y, NUMBER)


def alone(sites: Any, formula: Any, done: Any) -> None:
    if accepted(attempt(each, sites, formula, sites), itself):
        write(done, 0, 1.0, NUMBER)


@native
@pytest.mark.parametrize(
    ("formula", "why"),
    [(loads, "it is for one site"), (sums, "it is for one site"), (saves, "were saved"), (asks, "of one site")],
)
def test_refusals(formula: Any, why: str) -> None:
    sites = Planes.of_rows(2, 5)
    with pytest.raises(NotCompilable, match=why):
        kernel.kernel(alone, sites, formula, kernel.Shared(np.zeros(1)), lanes=8)
