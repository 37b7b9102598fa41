"""Laws: two sides that must be equal to rounding, at every point.

Each comparison names the size to which its rounding errors are relative: the product of the norms
and condition numbers that enter.  A law holds while the defect is below `slack` roundings of that
size per dimension.  No bound has a unit.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem, LiemechError
from ...formulas.classes.signatures import bare
from ..points.sample_points import flat
from ..report import ROUNDING, Finding

SLACK = 16.0
"""Roundings per dimension (counted as 3 at least) that a good formula needs; on SO(3) the worst
needs one.
"""


@dataclass(frozen=True)
class Same:
    """Two values that ought to be equal, the size of their rounding, and what a wrong one may be
    instead.
    """

    left: Any
    right: Any
    size: float = 1.0
    instead: Callable[[], dict[str, Any]] = dict

    @property
    def defect(self) -> float:
        """The largest difference, in roundings of the size."""
        left, right = flat(self.left), flat(self.right)
        difference = float(np.abs(left - right).max(initial=0.0)) if left.size == right.size else math.inf
        if not difference:
            return 0.0
        return difference / (ROUNDING * self.size) if math.isfinite(difference) and self.size > 0.0 else math.inf

    def slips(self, allowed: float) -> str:
        """Which of the usual slips give this left side; of no numbers, that they are none."""
        if not all(np.isfinite(flat(side)).all() for side in (self.left, self.right)):
            return "a formula gives nan or infinity here, whatever the law"
        fit = (
            slip for slip, value in self.instead().items() if dataclasses.replace(self, right=value).defect <= allowed
        )
        return "; or ".join(fit)


@dataclass(frozen=True)
class Told(Same):
    """A comparison with a remark on what is wrong."""

    told: str = ""

    def slips(self, allowed: float) -> str:
        return self.told


def vanishes(x: Any, size: float = 1.0) -> Same:
    """The law x = 0, to roundings of a size."""
    return Same(x, 0.0 * x, size)


def shaped(x: np.ndarray, shape: tuple[int, ...]) -> Iterator[Same]:
    """An array of this shape, of finite numbers."""
    yield Same(np.array([x.ndim, *x.shape]), np.array([len(shape), *shape]))
    yield vanishes(x - x)


def factors(right: Any) -> dict[str, Any]:
    """The commonest slips: a wrong sign, a factor 2 or 1/2."""
    return {"a wrong sign": -right, "a factor 2 too many": 2.0 * right, "a factor 1/2 too many": 0.5 * right}


def cases(f: Callable[[Any], Any], slips: dict[str, Any]) -> dict[str, Any]:
    """The values of a function at slips of its argument."""
    return {slip: f(x) for slip, x in slips.items()}


@dataclass(frozen=True)
class Law:
    """An axiom: its name, its formula, the function that compares both sides, and the methods it is
    about.
    """

    name: str
    formula: str
    sides: Callable[[Any, Any], Iterable[Same]]
    # of interest only if the class has its own version of one of these
    closed: tuple[str, ...] = ()
    optional: bool = False  # about methods that a class need not have
    once: bool = False  # says nothing about a point
    slack: float = SLACK


def axiom(table: list[Law], name: str, formula: str, *closed: str, **options: Any) -> Callable[[Any], Any]:
    """Enter a function that compares both sides into a table of laws."""

    def enter(sides: Callable[[Any, Any], Iterable[Same]]) -> Callable[[Any, Any], Iterable[Same]]:
        table.append(Law(name, formula, sides, closed, **options))
        return sides

    return enter


def replaced(thing: Any, base: type, name: str) -> bool:
    """Whether the class of a thing has its own version of a method of the base."""
    return bare(getattr(type(thing), name, None)) is not bare(getattr(base, name, None))


def verdicts(laws: Iterable[Law], subject: Any, where: Sequence[Any], own: Callable[[str], bool]) -> Iterator[Finding]:
    """The laws in their order; those about methods that the class leaves to its base follow from
    the others.
    """
    for law in laws:
        if law.closed and not any(map(own, law.closed)):
            yield Finding(law.name, law.formula, "follows")
        else:
            yield judge(law, subject, where)


def judge(law: Law, subject: Any, where: Sequence[Any]) -> Finding:
    """The worst of all points; a slip that explains one of them is kept."""
    worst = Finding(law.name, law.formula, "not there")
    for at in [where[len(where) // 2]] if law.once else where:
        bound = law.slack * max(3, at.dim)
        try:
            with np.errstate(all="ignore"):
                for same in law.sides(subject, at):
                    defect = same.defect
                    remark = worst.remark or (same.slips(bound) if defect > bound else "")
                    if defect > worst.defect or not worst.bound:
                        verdict = "holds" if defect <= bound else "broken"
                        worst = Finding(law.name, law.formula, verdict, str(at), defect, bound, same.size, remark)
                    elif remark:
                        worst = dataclasses.replace(worst, remark=remark)
        except (NotImplementedError, IncompatibleSystem) as missing:
            return Finding(law.name, law.formula, "not there" if law.optional else "broken", remark=str(missing))
        except (ArithmeticError, ValueError, TypeError, LookupError, AttributeError, LiemechError) as error:
            remark = f"it raises {type(error).__name__}: {error}"
            return Finding(law.name, law.formula, "broken", str(at), remark=remark)
    return worst
