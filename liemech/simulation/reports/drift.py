"""The structure report of a run: how well the constants of the motion were kept."""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import InvalidInput
from ...formulas.classes.frozen import frozen
from ...systems.system import System
from .written_tables import WrittenTable, html_table

EXACT = 1e-12
"""Part of a quantity up to which a change is rounding: what 2 10^7 steps come to that round at random."""

FEW = 20
"""Samples below which nothing is said of a trend: a dozen steps show neither a bound nor a drift."""


COLUMN = 18
"""How wide the names are printed, at least."""


SMALL = 0.1
"""A constant smaller than this part of its terms owes its size to their cancelling; its changes are
told beside the terms.
"""


LOST = 0.1
"""Part of a quantity by which it must not differ from its start in the mean square."""


@frozen
class Kept:
    """How well one quantity was kept: its size, the largest change, that at the end, the root mean
    square of all, the trend, and how sure the trend is.

    size : at the start.  scale : what changes are divided by: the size, or that of the terms the
    quantity is the sum of where these nearly cancel at the start; 0 if changes are absolute, because
    everything is zero there.
    """

    name: str
    size: float
    scale: float
    largest: float
    slope: float
    spread: float
    duration: float
    samples: int
    last: float
    typical: float

    @property
    def verdict(self) -> str:
        """The verdict on the quantity:

        `exact` (rounding only), `bounded` (oscillates), `drifting` (the trend dominates), `lost`
        (the typical change is a tenth of the quantity itself or more, or the run ends with one as
        large as the quantity, and no trend explains it: the step is too large), or `changed` (too
        few samples to tell).
        """
        if self.largest <= (EXACT if self.scale else 0.0):  # beside no size no change is rounding
            return "exact"
        left = bool(self.scale) and self.largest >= 1.0 and self.last >= 0.5 * self.largest
        if self.samples < FEW:
            return "lost" if left else "changed"
        if abs(self.slope) * self.duration > 4.0 * self.spread:
            return "drifting"
        return "lost" if left or (self.scale and self.typical >= LOST) else "bounded"

    @property
    def measure(self) -> str:
        """Whether changes are relative, and to what, or absolute."""
        if not self.scale:
            return "absolute"
        cancelling = "" if self.scale == self.size else f", the size of its terms; it is {self.size:.1e}"
        return f"relative to {self.scale:.6g}{cancelling}"

    @property
    def trend(self) -> str:
        """The slope of a drift; why nothing is said of one."""
        trends = {"drifting": f"{self.slope:+.1e} per unit time", "changed": "too few samples for a trend"}
        return trends.get(self.verdict, "")

    def __str__(self) -> str:
        change = f"largest change {self.largest:.1e} ({self.measure}){self.trend and '; '}{self.trend}"
        return f"{self.name:<{COLUMN}}{self.verdict:<10}{change}"


RECORDED = ("energy", "casimirs", "spatial_momentum")
"""Quantities that a run may record instead of the state, and that stay constant in a free motion."""


@frozen
class Drift:
    """The structure report of a run; `print` it."""

    kept: tuple[Kept, ...]

    @classmethod
    def of(cls, system: System, t: np.ndarray, states: dict[str, np.ndarray], bodies: int | None = None) -> Drift:
        """Measure what the system names as constant, of a body energy, Casimirs and spatial
        momentum, along samples of a motion.

        t : (n,), or of bodies with times of their own (n, bodies).
        states : the parts of the state by name, (n, ...), of an ensemble (n, bodies, ...).
        """
        series, terms = constants_and_terms(system, states, len(t)) if len(t) > 1 else ({}, {})
        return cls.recorded(series, t, bodies, terms)

    @classmethod
    def recorded(
        cls, series: dict[str, np.ndarray], t: np.ndarray, bodies: int | None = None, terms: Any = None
    ) -> Drift:
        """Drift of quantities whose values were recorded, (n, ...), without the state.  terms : the sizes of what they
        are sums of, by name.
        """
        if len(t) < 2:
            raise InvalidInput("Trajectory.drift needs at least two samples")
        axes, terms, kept = 1 + (bodies is not None), terms or series, []
        for name, values in series.items():
            flat, sizes = (x.reshape(*x.shape[:axes], -1) for x in (values, terms[name]))
            kept.append(_kept(name, t, flat, np.abs(sizes)[_some(len(sizes))]))
        return cls(tuple(kept))

    def __getitem__(self, name: str) -> Kept:
        for constant in self.kept:
            if constant.name == name:
                return constant
        names = ", ".join(k.name for k in self.kept) or "none"
        raise InvalidInput(f"Drift: {name!r} is no constant of this motion; known are: {names}")

    def __iter__(self) -> Iterator[str]:
        """Iterate over the names of the constants."""
        return iter([constant.name for constant in self.kept])

    def __len__(self) -> int:
        return len(self.kept)

    def __contains__(self, name: object) -> bool:
        return any(constant.name == name for constant in self.kept)

    def __str__(self) -> str:
        wide = max([COLUMN, *(len(constant.name) + 2 for constant in self.kept)])
        lines = [constant.name.ljust(wide) + str(constant)[max(COLUMN, len(constant.name)) :] for constant in self.kept]
        return "\n".join(lines) or "no constants of the motion are known"

    def _repr_html_(self) -> str:
        rows = [(k.name, k.verdict, f"{k.largest:.1e}", k.measure, k.trend) for k in self.kept]
        return html_table("", ("constant", "verdict", "largest change", "", ""), rows)

    @property
    def table(self) -> WrittenTable:
        """A row for each constant: name, verdict, largest change, what it is relative to (0 for an
        absolute change), slope in unit time.
        """
        rows = [(k.name, k.verdict, k.largest, k.scale, k.slope) for k in self.kept]
        return WrittenTable(("constant", "verdict", "largest change", "relative to", "slope"), tuple(rows))

    def to_csv(self, path: str | os.PathLike[str] | None = None) -> str | None:
        """The report as comma-separated values: the text, or written to a file."""
        return self.table.to_csv(path)

    def to_latex(self, path: str | os.PathLike[str] | None = None) -> str | None:
        """The report as a tabular for LaTeX: the text, or written to a file."""
        return self.table.to_latex(path)


def constants_and_terms(
    system: System, states: dict[str, np.ndarray], n: int
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """The constants at all n samples; how large their terms are, sum_i |x_i dC/dx_i|, at the start,
    half-way and at the end.

    All are computed at once, for the samples and for some with one coordinate varied.  Of many
    coordinates all are varied at once, with random signs: the root of the sum of the squares of the
    terms, about, instead of their sum.
    """
    bit, looks = 2.0**-20, _some(n)
    varied: list[tuple[str, Any]] = [(part, i) for part in system.coordinates for i in range(states[part].shape[-1])]
    at_once = len(varied) > SEPARATE
    if at_once:
        rng, parts = np.random.default_rng(1), system.coordinates
        signs = {part: rng.choice([-1.0, 1.0], (CHANCES, states[part].shape[-1])) for part in parts}
        varied = [(part, sign) for part in parts for sign in signs[part]]
    longer: dict[str, np.ndarray] = {}
    for name, values in states.items():
        shape, rows = values.shape[1:], n + len(varied) * len(looks)
        longer[name] = whole = np.empty((rows, *shape), values.dtype)
        whole[:n], variations = values, whole[n:].reshape(len(varied), len(looks), *shape)
        variations[:] = values[looks]
        for row, (part, i) in zip(variations, varied, strict=True):
            if part == name and at_once:
                row *= 1.0 + bit * i
            elif part == name:
                row[..., i] *= 1.0 + bit
    series, terms = {}, {}
    for name, values in system.constants(longer).items():
        unvaried = values[:n][looks]
        changes = np.abs(values[n:].reshape(len(varied), *unvaried.shape) - unvaried)
        sums = changes.max(axis=0) if at_once else changes.sum(axis=0)
        series[name], terms[name] = values[:n], np.maximum(np.abs(unvaried), sums / bit)
    return series, terms


SEPARATE, CHANCES = 512, 16
"""Coordinates that are varied one by one; of more of them, how often all are together."""


def _some(samples: int) -> list[int]:
    """The samples at which the terms are looked at."""
    return [0, samples // 2, -1]


def _lengths(vectors: np.ndarray) -> Any:
    """The norms of vectors, (..., n), whose squares neither under- nor overflow."""
    largest = np.abs(vectors).max(axis=-1)
    unit = np.where((largest > 0.0) & (largest < np.inf), largest, 1.0)
    return unit * np.sqrt(((vectors / unit[..., None]) ** 2).sum(axis=-1))


def _kept(name: str, t: np.ndarray, values: np.ndarray, terms: np.ndarray) -> Kept:
    """The change of a vector quantity along a run: its largest norm, and by least squares a
    straight line through it.
    """
    size, sums = _lengths(values[0]), _lengths(terms)
    changes = _lengths(values[_some(len(t))] - values[0])
    # of a start without terms, such as one at rest, those of later samples where the motion has
    # not been left
    later = np.where(changes <= SMALL * sums, sums, 0.0).max(axis=0)
    sum_of_terms = np.where(sums[0] > 0.0, sums[0], later)
    scale = np.where(size > SMALL * sum_of_terms, size, sum_of_terms)
    unit = np.where(scale > 0.0, scale, 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        change = (values - values[0]) / unit[..., None]
        largest = _lengths(change)
        worst = np.unravel_index(largest.argmax(), largest.shape)[1:]
        norms = largest[(slice(None), *worst)]
        last, top = float(norms[-1]), float(norms.max())
        typical = top * float(np.mean((norms / top) ** 2)) ** 0.5 if 0.0 < top < np.inf else top
        series = change[(slice(None), *worst)]
        component = np.ascontiguousarray(series[:, np.abs(series[-1]).argmax()])
        if t.ndim == 2:
            t = t[:, worst[0]]
        time = t - t.sum() / len(t)
        squares = float(time @ time)
        slope = float(time @ component / squares) if squares else 0.0  # 0: a body that has no time
        residual = component - slope * time
        residual -= residual.sum() / len(t)
        spread = float(residual @ residual / len(t)) ** 0.5
    return Kept(
        name,
        float(size[worst]),
        float(scale[worst]),
        top,
        slope,
        spread,
        float(abs(t[-1] - t[0])),
        len(t),
        last,
        typical,
    )
