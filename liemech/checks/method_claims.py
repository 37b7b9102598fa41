"""What a method claims, observed: its order, its symmetry, its Poisson bracket, what it keeps, and
that it sees no direction.

Each claim is observed at a step that is large enough for the claim to mean something: there the
method errs visibly.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..compiler import kernel
from ..errors import IntegrationFailure, InvalidInput
from ..formulas.broadcasting import small
from ..integrators.rkmk import RKMK
from ..simulation.integrate import integrate
from ..systems.canonical import HamiltonianSystem, PhaseSpace
from ..systems.driven import DrivenHamiltonianSystem
from ..systems.lie_poisson import LiePoissonMotion
from ..systems.mechanical import MechanicalSystem
from ..systems.poisson import PoissonSystem
from .report import ROUNDING, Observation
from .sample_points import STEP, Units, flat, size
from .sample_states import CENTRAL, pace

COUNTS = 1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256
"""Numbers of steps over the same time."""

SETTLED = 0.1
"""An order is told by three errors when the slope through them is this close to the one before."""

MISSING = 0.5
"""An observed order may be this much below the claim, that of one part of the state, whose leading
term may be small, twice.
"""

VISIBLE = 0.05
"""The relative error up to which a step is one at which the other claims are looked at."""

EXACT = 4096.0
"""Roundings that are no error, of what a method keeps and of its way back."""

BRACKET = 2.0**20
"""Roundings that are no error of a Poisson bracket whose derivatives are differences."""

APART = 0.25 * STEP
"""How far apart the starts are whose ends give the derivative of a step, in units of the size of
the state.
"""

WAY = 12
"""Steps there, and back again."""


@dataclass(frozen=True)
class Trial:
    """A method on a system from a start, over a time."""

    method: Any
    system: Any
    start: Any
    time: float
    compiled: bool | None

    def run(
        self, steps: int, h: float, start: Any = None, method: Any = None, t0: float = 0.0
    ) -> Any:
        """The trajectory of some steps; raises what `integrate` raises."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return integrate(
                self.system,
                method or self.method,
                self.start if start is None else start,
                h=h,
                steps=steps,
                t0=t0,
                compiled=self.compiled,
                compensated=False,
                progress=False,
            )

    def end(self, steps: int, method: Any = None) -> dict[str, np.ndarray]:
        """The parts of the state after the time, made in so many steps."""
        return ended(self.run(steps, self.time / steps, method=method))

    def at(self, arrays: dict[str, np.ndarray]) -> Any:
        """The state with these parts, taken as it is."""
        parts = {name: small(arrays[name]) if name in arrays else None for name in self.start.parts}
        return self.system.vouched(type(self.start)(**parts))

    @cached_property
    def exact(self) -> tuple[dict[str, np.ndarray], float]:
        """Where the motion leads, by RKMK of order 8, and the relative error that this may have."""
        before, n = self.end(32, RKMK(order=8)), 48
        while True:
            found = self.end(n, RKMK(order=8))
            doubt = max(self.distances(before, found).values())
            if doubt <= 64.0 * ROUNDING or n > 500:
                return found, max(doubt, 16.0 * ROUNDING)
            before, n = found, 2 * n

    def distances(self, a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> dict[str, float]:
        """How far parts of two states differ, relative to their size here and at the start."""
        first = self.start.arrays
        return {
            name: size(a[name] - b[name]) / (max(size(b[name]), size(first[name])) or 1.0)
            for name in b
        }

    @cached_property
    def errors(self) -> list[tuple[int, dict[str, float]]]:
        """The errors of the parts for more and more steps, until the slope has settled or rounding
        is near.
        """
        exact, doubt = self.exact
        found: list[tuple[int, dict[str, float]]] = []
        for n in COUNTS:
            try:
                error = self.distances(self.end(n), exact)
            except IntegrationFailure:  # the step is too large
                continue
            if not all(map(math.isfinite, error.values())):
                continue
            found.append((n, error))
            if max(error.values()) <= 30.0 * doubt or self._settled(found):
                break
        return found

    def _settled(self, found: list[tuple[int, dict[str, float]]]) -> bool:
        """Have the errors of all parts begun to fall by one power of the step?"""
        if (
            len(found) < 5
            or max(found[-1][1].values()) > 1e-3
            or min(min(error.values()) for _, error in found[-4:]) == 0.0
        ):
            return False
        series = [[(n, error[name]) for n, error in found[-4:]] for name in found[-1][1]]
        return all(abs(slope(errors[1:]) - slope(errors[:-1])) <= SETTLED for errors in series)

    def visible(self, name: str) -> list[tuple[int, float]]:
        """Numbers of steps and errors of a part, or of "all", between nonsense and rounding."""
        doubt = self.exact[1]
        found = [
            (n, math.hypot(*error.values()) if name == "all" else error[name])
            for n, error in self.errors
        ]
        nonsense = (
            0.1 if found[-1][1] <= 0.1 else math.inf
        )  # what does not come down to sense has its order too
        return [(n, e) for n, e in found if 30.0 * doubt < e <= nonsense]

    def slope(self, name: str) -> float | None:
        """The observed order of a part, or of "all": infinite where all errors are rounding, None
        if too few are seen.
        """
        errors = self.visible(name) if self.errors else []
        if len(errors) < 3:
            return None if errors or not self.errors else math.inf
        return slope(errors[-3:])

    @cached_property
    def journey(self) -> tuple[float, Any, Any]:
        """The largest step with an error that is no nonsense, a run with it, and one back from its
        end.
        """
        for n, error in self.errors:
            h = self.time / n
            if max(error.values()) <= VISIBLE or n == self.errors[-1][0]:
                try:
                    there = self.run(WAY, h)
                    return h, there, self.run(WAY, -h, self.at(ended(there)), t0=WAY * h)
                # the step left where the system is defined
                except (IntegrationFailure, InvalidInput):
                    continue
        raise InvalidInput(
            f"check_method: {self.method!r} made no sensible step "
            f"on {self.system!r}; give a smaller h"
        )

    @property
    def h(self) -> float:
        """The step at which all claims but the order are looked at."""
        return self.journey[0]


def ended(run: Any) -> dict[str, np.ndarray]:
    """The last sample as it is: of a method that leaves a manifold it is no state to begin with."""
    return {name: np.asarray(array[-1]) for name, array in run.states.items()}


def slope(errors: list[tuple[int, float]]) -> float:
    """The slope of log error over log h, by least squares."""
    n, error = np.transpose(errors)
    return float(-np.polyfit(np.log(n), np.log(error), 1)[0])


# ---------------------------------------------------------------- claims


def order(trial: Trial) -> Observation:
    """The slope of the error over the step, of each part of the state and of all together."""
    p, formula = trial.method.order, "error = O(h^p) on a nonlinear motion"
    found = {name: trial.slope(name) for name in trial.start.arrays}
    whole = trial.slope("all")
    text = ", ".join(f"{name} {_in_words(q)}" for name, q in found.items())
    if whole is None:
        few = "too few errors between 0.1 and rounding; give another h"
        return Observation("order", formula, "not seen", observed=text, wanted=f"{p}", remark=few)
    parts = [q for q in found.values() if q is not None]
    good = whole >= p - MISSING and not any(q < p - 2.0 * MISSING for q in parts)
    return Observation(
        "order", formula, "holds" if good else "broken", observed=text, wanted=f"{p}"
    )


def _in_words(order: float | None) -> str:
    """An observed order."""
    if order is None:
        return "not seen"
    return "exact" if math.isinf(order) else f"{order:.2f}"


def way_back(trial: Trial) -> Observation:
    """Some steps with h, as many with -h from where they lead."""
    home = ended(trial.journey[2])
    defect = max(trial.distances(home, trial.start.arrays).values())
    return _exactly(
        "symmetric", "Phi_-h = Phi_h^-1: the way back", trial.method.symmetric, defect, EXACT
    )


def bracket(trial: Trial, charts: Charts, name: str, formula: str, claimed: bool) -> Observation:
    """Phi' B Phi'^T - B(Phi), relative to |Phi'|^2 |B|, in units of the size of the state.

    A defect that is claimed not to be there is looked at once more with closer starts: what was the
    error of the differences goes with the eighth power of their distance.
    """
    defect = charts.defect(trial, APART)
    if claimed and defect > BRACKET * ROUNDING:
        defect = min(defect, charts.defect(trial, APART / 8.0))
    return _exactly(name, formula, claimed, defect, BRACKET)


def kept(trial: Trial, keeps: tuple[str, ...]) -> Iterator[Observation]:
    """What the system names as constant, along some steps."""
    drift = trial.journey[1].drift()
    claims = [*keeps, *("Casimir" for _ in range(trial.method.symplectic))]
    for constant in drift.kept:
        claimed = any(constant.name.startswith(claim) for claim in claims)
        yield _exactly(constant.name, "constant along the steps", claimed, constant.largest, EXACT)
    for name in keeps:
        if not any(constant.name.startswith(name) for constant in drift.kept):
            known = ", ".join(constant.name for constant in drift.kept) or "none"
            raise InvalidInput(
                f"check_method: keeps names {name!r}, which is no "
                f"constant of this motion; known are: {known}"
            )


def equivariance(trial: Trial) -> Observation:
    """The same steps from k g: the momentum must be the same, and the element k g."""
    group, g = trial.system.group, trial.start.g
    units = Units(group)
    k = group.exp(units.of_length(np.cos(1.0 + np.arange(group.dim)), 1.0))
    turned = trial.system.state(
        np.asarray(trial.start.mu), np.asarray(group.compose(k, small(np.asarray(g))))
    )
    a, b = trial.journey[1], trial.run(WAY, trial.h, turned)
    wanted = {
        "mu": np.asarray(a.last.mu),
        "g": np.asarray(group.compose(k, small(np.asarray(a.last.g)))),
    }
    defect = max(trial.distances(b.last.arrays, wanted).values()) / (1.0 + size(k))
    return _exactly(
        "equivariance", "from k g it goes to k g', with the same mu", True, defect, EXACT
    )


def native_code(trial: Trial) -> Observation:
    """A few steps in native code and in plain Python."""
    reason = kernel.available()
    formula = "the same bits as plain Python"
    if reason:
        return Observation("native code", formula, "not there", remark=reason)
    runs = [
        Trial(trial.method, trial.system, trial.start, trial.time, compiled).run(3, trial.h)
        for compiled in (True, False)
    ]
    a, b = (ended(run) for run in runs)
    same = all(np.array_equal(a[name], b[name]) for name in a)
    observed = "the same" if same else f"different by {max(trial.distances(a, b).values()):.1e}"
    return Observation(
        "native code", formula, "holds" if same else "broken", observed=observed, wanted="the same"
    )


def _exactly(law: str, formula: str, claimed: bool, defect: float, roundings: float) -> Observation:
    """The verdict on something that is exact or not."""
    bound = roundings * ROUNDING
    good = defect <= bound
    verdict = ("holds" if good else "broken") if claimed else ("seen" if good else "not seen")
    return Observation(
        law,
        formula,
        verdict,
        observed=f"{defect:.1e}",
        wanted=f"below {bound:.1e}" if claimed else "no claim",
    )


# ---------------------------------------------------------------- coordinates of phase space


FREE_OF_CONSTRAINTS = HamiltonianSystem, DrivenHamiltonianSystem
"""Systems whose phase space is all of R^2n."""


@dataclass(frozen=True)
class Charts:
    """Coordinates about the states of a system with a Poisson structure, in units of their size.

    whole : of a free body, is the group element a coordinate too?  On T*G coordinates are
    displacements xi of g, by g exp(xi), and changes of mu, and the structure is {xi_i,
    mu_j} = delta_ij with that of the dual of the algebra for the momenta.
    """

    system: Any
    begin: Any
    whole: bool

    @cached_property
    def units(self) -> np.ndarray:
        """What counts as a unit of each coordinate."""
        if isinstance(self.system, PhaseSpace):
            n, rate = self.system.degrees, flat(self.system.rate(0.0, self.begin))
            v, f = size(rate[:n]), size(rate[n:])
            q, p, speed = size(self.begin.q), size(self.begin.p), pace(self.system, 0.0, self.begin)
            return np.repeat([max(q, v / speed), max(p, f / speed)], n)
        if isinstance(self.system, PoissonSystem):
            y = np.abs(flat(self.begin.y))
            return np.where(y > 0.1 * size(y), y, size(y) or 1.0)
        momenta = np.full(len(self.begin.mu), size(self.begin.mu))
        if not self.whole:
            return momenta
        group = self.group
        return np.concatenate([[1.0 / Units(group).length(e) for e in Units(group).axes], momenta])

    @property
    def group(self) -> Any:
        """The configurations."""
        return (
            self.system.configurations
            if isinstance(self.system, MechanicalSystem)
            else self.system.group
        )

    def displaced(self, x: np.ndarray) -> dict[str, np.ndarray]:
        """The state with these coordinates about the start."""
        x = x * self.units
        first = self.begin.arrays
        n = len(x) // 2
        if isinstance(self.system, FREE_OF_CONSTRAINTS):
            return {"q": first["q"] + x[:n], "p": first["p"] + x[n:]}
        if isinstance(self.system, PoissonSystem):
            return {"y": first["y"] + x}
        if not self.whole:
            return {"mu": first["mu"] + x}
        g = self.group.compose(self.begin.g, self.group.exp(small(x[:n])))
        return {"mu": first["mu"] + x[n:], "g": np.asarray(g)}

    def coordinates(self, about: Any, state: dict[str, np.ndarray]) -> np.ndarray:
        """The coordinates of a state about another one."""
        if isinstance(self.system, FREE_OF_CONSTRAINTS):
            return (
                np.concatenate([state["q"] - flat(about.q), state["p"] - flat(about.p)])
                / self.units
            )
        if isinstance(self.system, PoissonSystem):
            return (state["y"] - flat(about.y)) / self.units
        change = state["mu"] - flat(about.mu)
        if not self.whole:
            return change / self.units
        g = self.group.log(self.group.compose(self.group.inverse(about.g), small(state["g"])))
        return np.concatenate([flat(g), change]) / self.units

    def structure(self, at: Any) -> np.ndarray:
        """The Poisson structure at a state, in these units."""
        if isinstance(self.system, FREE_OF_CONSTRAINTS):
            n = self.system.degrees
            whole = np.block([[np.zeros((n, n)), np.eye(n)], [-np.eye(n), np.zeros((n, n))]])
        elif isinstance(self.system, PoissonSystem):
            whole = np.asarray(self.system.structure.matrix(at.y))
        else:
            momenta = np.asarray(self.group.algebra.poisson_structure(at.mu))
            one = np.eye(len(momenta))
            whole = np.block([[0.0 * one, one], [-one, momenta]]) if self.whole else momenta
        return whole / np.outer(self.units, self.units)

    def defect(self, trial: Trial, apart: float) -> float:
        """|Phi' B Phi'^T - B(Phi)| beside |Phi'|^2 |B| + |B(Phi)|."""
        B, (end, D) = self.structure(self.begin), self.moved(trial, apart)
        left, right = D @ B @ D.T, self.structure(end)
        scale = np.abs(D).max() ** 2 * np.abs(B).max() + np.abs(right).max()
        return float(np.abs(left - right).max() / scale)

    def moved(self, trial: Trial, apart: float) -> tuple[Any, np.ndarray]:
        """Where a step leads, and its derivative by differences of order eight."""
        n = len(self.units)
        shifts = [k * apart * e for e in np.eye(n) for k in range(-4, 5)]
        starts = [self.displaced(x) for x in shifts]
        names = [*starts[0]]
        many = self.system.state(
            **{name: np.stack([start[name] for start in starts]) for name in names}
        )
        last = ended(trial.run(1, trial.h, many))
        end = type(self.begin)(
            **{name: small(last[name][4]) for name in names}
        )  # 4: the middle of the first nine, no shift
        found = [
            self.coordinates(end, {name: last[name][i] for name in names})
            for i in range(len(starts))
        ]
        columns = [
            sum(w * found[9 * j + k] for k, w in enumerate(CENTRAL)) / apart for j in range(n)
        ]
        return end, np.stack(columns, axis=1)


def claims(trial: Trial, keeps: tuple[str, ...], native: bool) -> Iterator[Observation]:
    """All claims in turn."""
    system, start, symplectic = trial.system, trial.start, trial.method.symplectic
    yield order(trial)
    yield way_back(trial)
    if isinstance(system, LiePoissonMotion):
        formula = "Phi' B(mu) Phi'^T = B(Phi(mu)) for the momenta"
        yield bracket(trial, Charts(system, start, False), "Poisson", formula, symplectic)
    if isinstance(system, (LiePoissonMotion, MechanicalSystem)) and start.g is not None:
        claimed = symplectic and isinstance(system, MechanicalSystem)
        yield bracket(
            trial,
            Charts(system, start, True),
            "symplectic",
            "the same on T*G, with the elements",
            claimed,
        )
    if isinstance(system, FREE_OF_CONSTRAINTS):
        yield bracket(
            trial, Charts(system, start, True), "symplectic", "Phi' J Phi'^T = J", symplectic
        )
    if isinstance(system, PoissonSystem):
        formula = "Phi' B(y) Phi'^T = B(Phi(y))"
        yield bracket(trial, Charts(system, start, False), "Poisson", formula, symplectic)
    yield from kept(trial, keeps)
    if isinstance(system, LiePoissonMotion) and start.g is not None:
        yield equivariance(trial)
    if native:
        yield native_code(trial)
