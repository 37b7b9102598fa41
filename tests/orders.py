"""How orders are measured, and tables of them in docs/proof/measured/orders.md."""

from __future__ import annotations

import functools
import math
import sys
import warnings
import zlib
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from scenes import slope

import liemech as lm

PAGE = Path(__file__).parent.parent / "docs" / "proof" / "measured" / "orders.md"
FLOOR = 5e-14
"""Errors above this are no rounding."""


@dataclass(frozen=True)
class Problem:
    """A motion of four starts to the time t_end, where it is compared; and the fewest steps, for each order."""

    name: str
    system: lm.System
    starts: lm.State
    t_end: float
    fewest: tuple[int, ...] = ()

    def end(self, method: lm.Method, n: int, bodies: int = 4) -> list[np.ndarray]:
        """Momentum, if there is one, and attitude of the first bodies after n steps."""
        start = type(self.starts)(*(x[:bodies] for x in self.starts.parts.values()))
        run = lm.integrate(self.system, method, start, h=self.t_end / n, steps=n, every=n, progress=False)
        return [*((run.mu[-1],) if "mu" in start.parts else ()), self.seen(run.g[-1])]

    def seen(self, g: np.ndarray) -> np.ndarray:
        """What of the group elements is compared."""
        return g

    @functools.cached_property
    def exact(self) -> list[np.ndarray]:
        """Where the starts lead: in closed form, or by a method of order 8 far beyond convergence."""
        if isinstance(self.system, lm.RigidBody):
            ends = [
                self.system.exact(self.system.state(mu, g), self.t_end) for mu, g in zip(self.starts.mu, self.starts.g)
            ]
            return [np.array([end.mu for end in ends]), np.array([end.g for end in ends])]
        return self.end(lm.RKMK(order=8), round(32 * self.t_end))

    def accepts(self, method: lm.Method) -> bool:
        """Is the motion one for this method?"""
        try:
            method.require(self.system)
        except lm.errors.IncompatibleSystem:
            return False
        return True

    def errors(self, method: lm.Method, n: int, bodies: int) -> list[float]:
        """The root mean squares of the errors of momentum and attitude."""
        return [float(np.sqrt(np.mean((a - b[:bodies]) ** 2))) for a, b in zip(self.end(method, n, bodies), self.exact)]

    def slopes(self, method: lm.Method, order: int) -> list[float]:
        """The measured orders of momentum and attitude, by least squares over three steps, each half of the one before.

        Below order 4 the error of one start; from then on that of four, for one alone may have hardly any error by
        chance.  From order 5 on the three smallest steps that are not lost in rounding.
        """
        bodies, n = (1 if order < 4 else 4), self.fewest[order - 1]
        counts, found = [], []
        while len(counts) < 3 or (order >= 5 and n <= 1024):
            errors = self.errors(method, n, bodies)
            if min(errors) < FLOOR:
                break
            counts, found, n = [*counts, n], [*found, errors], 2 * n
        assert len(counts) >= 3, f"{method!r} on {self.name}: lost in rounding"
        return [slope([1 / n for n in counts[-3:]], error[-3:]) for error in np.transpose(found)]


class Rotating(Problem):
    """A problem of which the turning alone is compared."""

    def seen(self, g: np.ndarray) -> np.ndarray:
        """The rotation matrix, where there is one."""
        return g[:, :3, :3]


SMALL = {2: 3e-3, 4: 3e-5, 6: 3e-8, 8: 1e-9}
"""Errors from which on the leading term is the whole error, to a few percent."""


class Smooth(Problem):
    """A problem on which the leading term of the error shows early, so that a level of the error tells where to begin."""

    def slopes(self, method: lm.Method, order: int) -> list[float]:
        """The measured orders, by least squares over three steps from the first with a `SMALL`
        error on; at order 8 closer ones.
        """
        bodies, n, ratio = ((1 if order < 4 else 2), round(self.t_end), (2.0 if order < 8 else 2.0**0.5))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of steps too large to be made
            while not max(self.errors(method, n, bodies)) < SMALL[order]:
                n = round(n * ratio)
        counts = [round(n * ratio**i) for i in range(3)]
        found = [self.errors(method, n, bodies) for n in counts]
        assert np.min(found) > FLOOR, f"{method!r} on {self.name}: lost in rounding"
        return [slope([1 / n for n in counts], error) for error in np.transpose(found)]


# ---------------------------------------------------------------- tables


@dataclass(frozen=True)
class Table:
    """A table of the page: its first line, its rows of names, methods and orders, and a column for each problem.

    A column has one problem or several of the same motion, of which the first is taken that the method accepts.
    """

    head: str
    rows: dict[str, tuple[lm.Method, int]]
    columns: Callable[[], tuple[tuple[Problem, ...], ...]]

    def measured(self, name: str, half: int | None = None) -> list[float | None]:
        """The slopes of a row: None where a method does not apply.

        half : 0 for every other problem, which of them the name decides; 1 for the rest; nan in the place
        of what is not measured.
        """
        method, order = self.rows[name]
        found: list[float | None] = []
        number = zlib.crc32(name.encode())
        for column in self.columns():
            problem = next((p for p in column if p.accepts(method)), None)
            if problem and half is not None and number % 2 != half:
                found += [math.nan] * len(column[0].exact)
            else:
                found += problem.slopes(method, order) if problem else [None] * len(column[0].exact)
            number += problem is not None
        if any(p is not None for p in found) and all(p is None or math.isnan(p) for p in found):
            return self.measured(name)  # its only problem is in the other half
        return found

    def line(self, name: str, slopes: list[float | None]) -> str:
        """A row of the table; a star marks a slope above the order."""
        order = self.rows[name][1]
        cells = ["" if p is None else f"{p:.2f}{'*' if p > order + 0.1 else ''}" for p in slopes]
        return f"| {' | '.join((name, str(order), *cells))} |"

    def text(self, kept: dict[str, str]) -> str:
        """All rows, measured now but for those that are kept."""
        names = [name for name in self.rows if name not in kept]
        with ProcessPoolExecutor() as pool:
            measured = {name: self.line(name, slopes) for name, slopes in zip(names, pool.map(self.measured, names))}
        lines = [kept.get(name) or measured[name] for name in self.rows]
        return "\n".join((self.head, "| --- " * (self.head.count("|") - 1) + "|", *lines))

    def printed(self) -> dict[str, str]:
        """The lines of the table in the page, by their first cells."""
        lines = PAGE.read_text(encoding="utf-8").partition(self.head)[2].partition("\n\n")[0].splitlines()[2:]
        return {text.split("|")[1].strip(): text for text in lines}

    def is_printed(self, file: str) -> None:
        """Assert that the page has these rows, in their order.  file : which writes them."""
        printed, command = list(self.printed()), f"PYTHONPATH=tests:. python {Path(file).relative_to(PAGE.parents[3])}"
        assert printed == list(self.rows), (
            f"{sorted({*printed} ^ {*self.rows})} are rows of the table or of {PAGE} alone, or their order differs: "
            f"run {command} --write --new, which measures the new ones"
        )

    def agrees(self, name: str, slopes: list[float | None]) -> None:
        """Assert that the page has these slopes, to 0.05, and stars where they are due; nan is what was not measured."""
        cells = [cell.strip() for cell in self.printed()[name].split("|")[3:-1]]
        for cell, p in zip(cells, slopes, strict=True):
            if p is not None and math.isnan(p):
                continue
            assert cell.strip("*") == "" if p is None else float(cell.strip("*")) == pytest.approx(p, abs=0.05)
            assert cell.endswith("*") == (p is not None and p > self.rows[name][1] + 0.1)

    def main(self) -> None:
        """Print the table; with --write, put it into the page, in the place of the old one; with --new, measure only
        rows that are not in the page.
        """
        text = self.text(self.printed() if "--new" in sys.argv else {})
        print(text)
        if "--write" in sys.argv:
            replace(self.head, text)


def replace(head: str, text: str) -> None:
    """Put a table into the page, in the place of the one that begins with this line."""
    page = PAGE.read_text(encoding="utf-8")
    start = page.index(head)
    PAGE.write_text(page[:start] + text + page[page.index("\n\n", start) :], encoding="utf-8")
