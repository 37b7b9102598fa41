"""Observation of the claims of a method: its order, its symmetry, its Poisson bracket, what it
keeps, and that it sees no direction.

Each claim is observed at a step that is large enough for the claim to mean something: there the
method errs visibly.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from ..compiler import kernel
from ..errors import IntegrationFailure, InvalidInput
from ..formulas.vectors import small
from ..integrators.rkmk import RKMK
from ..rooms.constraints.constrained import ConstrainedSystem
from ..rooms.constraints.constrained_body import BoundBody, ConstrainedBody
from ..rooms.poisson.poisson import POISSON_SYSTEMS
from ..systems.cotangent import CotangentMotion
from ..systems.lie_poisson import LiePoissonMotion
from ..systems.mechanical import MechanicalSystem
from ..systems.system import small_state
from .forms_of_sites import FormsOfSites, has_forms
from .points.phase_space_charts import FREE_OF_CONSTRAINTS, BoundCharts, Charts, ConstrainedCharts
from .points.sample_points import STEP, Units, size
from .points.sample_states import CENTRAL, ended, run_of
from .reference import CLEAR, settled
from .report import ROUNDING, Observation

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

EXACT = 4096.0 * ROUNDING
"""A relative difference that is no error, of what a method keeps and of its way back."""

GROWN = 16.0
"""A defect that is not this many times as large as what another rounding makes of a run is rounding."""

BRACKET = 2.0**20 * ROUNDING
"""A relative defect that is no error of a Poisson bracket whose derivatives are differences."""

APART = 0.25 * STEP
"""How far apart the starts are whose ends give the derivative of a step, in units of the size of
the state.
"""

SOONER = 16.0
"""How much shorter a time is over which an order is observed once more."""

WAY = 12
"""Steps there, and back again."""

HALVINGS = 12
"""How often a time is halved beyond which the motion does not go."""


@dataclass(frozen=True)
class MethodTrial:
    """A method on a system from a start at t0, over a time."""

    weights: ClassVar[tuple[float, ...]] = CENTRAL

    method: Any
    system: Any
    start: Any
    time: float
    compiled: bool | None
    t0: float = 0.0

    def run(
        self,
        steps: int,
        h: float,
        start: Any = None,
        method: Any = None,
        elapsed: float = 0.0,
        compensated: bool = False,
    ) -> Any:
        """The trajectory of some steps; raises what `integrate` raises."""
        method, begin = method or self.method, self.start if start is None else start
        options = {"h": h, "steps": steps, "t0": self.t0 + elapsed, "compensated": compensated}
        return run_of(self.system, method, begin, self.compiled, **options)

    def ends(self, starts: list[dict[str, np.ndarray]]) -> list[dict[str, np.ndarray]]:
        """The states after a step from states that are given by their parts."""
        names = [*starts[0]]
        ensemble = self.system.state(**{name: np.stack([start[name] for start in starts]) for name in names})
        last = ended(self.run(1, self.h, ensemble))
        return [{name: last[name][i] for name in names} for i in range(len(starts))]

    def end(self, steps: int, method: Any = None) -> dict[str, np.ndarray]:
        """The parts of the state at the end time, after a number of steps."""
        return ended(self.run(steps, self.time / steps, method=method))

    def at(self, arrays: dict[str, np.ndarray], elapsed: float) -> Any:
        """The state with these parts so much later than the start, unchecked."""
        return self.system.vouched(small_state(type(self.start), arrays), self.t0 + elapsed)

    @cached_property
    def exact(self) -> tuple[dict[str, np.ndarray], float]:
        """The state after the motion, by RKMK of order 8, and the relative error that it may have."""
        state, doubts = settled(lambda n: self.end(n, RKMK(order=8)), 32, self.distances, 64.0 * ROUNDING)
        return state, max(*doubts.values(), 16.0 * ROUNDING)

    @property
    def within(self) -> MethodTrial:
        """The trial over a time in which the motion does not end, at a singularity or with a table."""
        trial = self
        for _ in range(HALVINGS):
            with contextlib.suppress(IntegrationFailure):
                trial.exact  # noqa: B018
                return trial
            trial = replace(trial, time=0.5 * trial.time)
        return self

    @cached_property
    def sizes(self) -> dict[str, float]:
        """The sizes of the parts at the start or the end: what begins at zero has one too."""
        last = self.end(32, RKMK(order=8))
        return {name: max(size(x), size(last[name])) for name, x in self.start.arrays.items()}

    def distances(self, a: dict[str, np.ndarray], b: dict[str, np.ndarray]) -> dict[str, float]:
        """The distances of parts of two states, relative to their size here, at the start and at the end."""
        return {name: size(a[name] - b[name]) / (max(size(b[name]), self.sizes[name]) or 1.0) for name in b}

    @cached_property
    def errors(self) -> list[tuple[int, dict[str, float]]]:
        """The errors of the parts for more and more steps, until the slope has settled or rounding
        is near.
        """
        exact, doubt = self.exact
        errors: list[tuple[int, dict[str, float]]] = []
        for n in COUNTS:
            try:
                error = self.distances(self.end(n), exact)
            except IntegrationFailure:  # the step is too large
                continue
            if not all(map(math.isfinite, error.values())):
                continue
            errors.append((n, error))
            if max(error.values()) <= CLEAR * doubt or self._settled(errors):
                break
        return errors

    def _settled(self, found: list[tuple[int, dict[str, float]]]) -> bool:
        """Whether the errors of all parts have begun to fall by one power of the step."""
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
        errors = [(n, math.hypot(*error.values()) if name == "all" else error[name]) for n, error in self.errors]
        nonsense = 0.1 if errors[-1][1] <= 0.1 else math.inf  # what does not come down to sense has its order too
        return [(n, e) for n, e in errors if CLEAR * doubt < e <= nonsense]

    def slope(self, name: str) -> float | None:
        """The observed order of a part, or of "all": infinite where all errors are rounding, None
        if too few are seen.
        """
        errors = self.visible(name) if self.errors else []
        if len(errors) < 3:
            return None if errors or not self.errors else math.inf
        return slope(errors[-3:])

    def fastest(self, name: str) -> float | None:
        """The largest order through the last two, three or four errors: one that changes its sign
        is small between.
        """
        observed = self.slope(name)
        if observed is None or math.isinf(observed):
            return observed
        return max(slope(self.visible(name)[-k:]) for k in (2, 3, 4))

    @cached_property
    def journey(self) -> tuple[float, Any, Any]:
        """The largest step with an error that is no nonsense, a run with it, and one back from its
        end.
        """
        least = self.errors[-1][0] if self.errors else COUNTS[-1]
        sensible = [n for n, e in self.errors if max(e.values()) <= VISIBLE or n == least]
        for n in [*sensible, *(n for n in COUNTS if n > least)]:
            h = self.time / n
            # the steps may leave where the system is defined
            with contextlib.suppress(IntegrationFailure, InvalidInput):
                outward = self.run(WAY, h)
                return h, outward, self.run(WAY, -h, self.at(ended(outward), WAY * h), elapsed=WAY * h)
        raise InvalidInput(f"check_method: {self.method!r} made no sensible step on {self.system!r}; give a smaller h")

    @property
    def h(self) -> float:
        """The step at which all claims but the order are looked at."""
        return self.journey[0]

    @property
    def until(self) -> float:
        """The time at the end of the step."""
        return self.t0 + self.h


def slope(errors: list[tuple[int, float]]) -> float:
    """The slope of log error over log h, by least squares."""
    n, error = np.transpose(errors)
    return float(-np.polyfit(np.log(n), np.log(error), 1)[0])


# ---------------------------------------------------------------- claims


def order(trial: MethodTrial) -> Observation:
    """The slope of the error over the step, of each part of the state and of all together.

    A motion that is slow at the start may be another one later: an order that is too low must be so
    over a shorter time too, unless all errors are rounding then.
    """
    observation = order_over(trial)
    if observation.verdict == "broken":
        sooner = replace(trial, time=trial.time / SOONER)
        over_less = order_over(sooner)
        if over_less.verdict == "holds" and sooner.slope("all") != math.inf:
            observation = over_less
    return observation


def order_over(trial: MethodTrial) -> Observation:
    """The order, observed over the time of the trial."""
    p, formula = trial.method.order, "error = O(h^p) on a nonlinear motion"
    slopes = {name: trial.slope(name) for name in trial.start.arrays}
    whole = trial.slope("all")
    text = ", ".join(f"{name} {_in_words(q)}" for name, q in slopes.items())
    if whole is None:
        too_few = "too few errors between 0.1 and rounding; give another h"
        return Observation("order", formula, "not seen", observed=text, wanted=f"{p}", remark=too_few)
    parts = [q for q in map(trial.fastest, slopes) if q is not None]
    good = whole >= p - MISSING and not any(q < p - 2.0 * MISSING for q in parts)
    return Observation("order", formula, "holds" if good else "broken", observed=text, wanted=f"{p}")


def _in_words(order: float | None) -> str:
    """An observed order as text: its number, "exact" or "not seen"."""
    if order is None:
        return "not seen"
    return "exact" if math.isinf(order) else f"{order:.2f}"


def way_back(trial: MethodTrial) -> Observation:
    """The observation of symmetry: some steps with h, as many with -h from where they lead.

    Where the motion is unstable the roundings on the way grow: a run there and back with other
    roundings tells by how much.
    """
    claimed, (h, outward, back) = trial.method.symmetric, trial.journey
    home = ended(back)
    defect = max(trial.distances(home, trial.start.arrays).values())
    if claimed and defect > EXACT:
        try:
            outward = trial.run(WAY, h, compensated=True)
            back = trial.run(WAY, -h, trial.at(ended(outward), WAY * h), elapsed=WAY * h, compensated=True)
            if defect <= GROWN * max(trial.distances(ended(back), home).values()):
                defect = 0.0
        except (IntegrationFailure, InvalidInput):
            pass
    return exactly("symmetric", "Phi_-h = Phi_h^-1: the way back", claimed, defect, EXACT)


def bracket(trial: MethodTrial, charts: Charts, name: str, formula: str, claimed: bool) -> Observation:
    """Phi' B Phi'^T - B(Phi), relative to |Phi'|^2 |B|, in units of the size of the state."""
    return exactly(name, formula, claimed, relative_defect(trial, charts, claimed), BRACKET)


def relative_defect(trial: Any, charts: Any, claimed: bool) -> float:
    """The relative defect of a bracket along steps, 0 if they keep it.

    A defect that is claimed not to be there is looked at again with closer and closer starts: what
    was the error of the differences goes with a high power of their distance.
    """
    defects = [charts.defect(trial, APART)]
    for step in (APART / 8.0, APART / 64.0):
        for closer in (charts, replace(charts, reach=4.0)):
            if claimed and min(defects) > BRACKET:
                defects.append(closer.defect(trial, step))
        if min(defects) > defects[0] / 64.0:  # it is none of theirs
            break
    return min(defects)


def kept(trial: MethodTrial, keeps: tuple[str, ...]) -> Iterator[Observation]:
    """The changes of the constants that the system names, along some steps."""
    drift = trial.journey[1].drift()
    claims = [*keeps, *("Casimir" for _ in range(trial.method.symplectic))]
    for constant in drift.kept:
        claimed = any(constant.name.startswith(claim) for claim in claims)
        yield exactly(constant.name, "constant along the steps", claimed, constant.largest, EXACT)
    for name in keeps:
        if not any(constant.name.startswith(name) for constant in drift.kept):
            names = ", ".join(constant.name for constant in drift.kept) or "none"
            raise InvalidInput(
                f"check_method: keeps names {name!r}, which is no constant of this motion; known are: {names}"
            )


def equivariance(trial: MethodTrial) -> Observation:
    """The steps from k g: the momentum must be that of the steps from g, and the element k g."""
    group, g = trial.system.group, trial.start.g
    units = Units(group)
    k = group.exp(units.of_unit_length(np.cos(1.0 + np.arange(group.dim))))
    turned = trial.system.state(np.asarray(trial.start.mu), np.asarray(group.compose(k, small(np.asarray(g)))))
    a, b = trial.journey[1], trial.run(WAY, trial.h, turned)
    last = ended(a)
    expected = {"mu": last["mu"], "g": np.asarray(group.compose(k, small(last["g"])))}
    defect = max(trial.distances(ended(b), expected).values()) / (1.0 + size(k))
    return exactly("equivariance", "from k g it goes to k g', with the same mu", True, defect, EXACT)


def native_code(trial: MethodTrial) -> Observation:
    """A few steps in native code and in plain Python."""
    reason = kernel.available()
    formula = "the same bits as plain Python"
    if reason:
        return Observation("native code", formula, "not there", remark=reason)
    runs = [replace(trial, compiled=compiled).run(3, trial.h) for compiled in (True, False)]
    a, b = (ended(run) for run in runs)
    equal = all(np.array_equal(a[name], b[name]) for name in a)
    observed = "the same" if equal else f"different by {max(trial.distances(a, b).values()):.1e}"
    return Observation("native code", formula, "holds" if equal else "broken", observed=observed, wanted="the same")


def exactly(law: str, formula: str, claimed: bool, defect: float, bound: float, where: str = "") -> Observation:
    """The verdict on something that is exact or not."""
    good = defect <= bound
    verdict = ("holds" if good else "broken") if claimed else ("seen" if good else "not seen")
    claim = f"below {bound:.1e}" if claimed else "no claim"
    return Observation(law, formula, verdict, where, observed=f"{defect:.1e}", wanted=claim)


def kept_brackets(system: Any, start: Any, method: Any) -> Iterator[tuple[str, str, bool, Charts]]:
    """The brackets that a method may keep on a system: the law, its formula, whether it is claimed,
    and coordinates.
    """
    symplectic = method.symplectic and not is_loaded(system)
    if isinstance(system, LiePoissonMotion):
        formula = "Phi' B(mu) Phi'^T = B(Phi(mu)) for the momenta"
        yield "Poisson", formula, symplectic, Charts(system, start, False)
    if isinstance(system, (LiePoissonMotion, CotangentMotion)) and start.g is not None:
        claimed = symplectic and isinstance(system, CotangentMotion)
        formula = "the same on T*G, with the elements"
        yield "symplectic", formula, claimed, Charts(system, start, True)
    if isinstance(system, FREE_OF_CONSTRAINTS):
        yield "symplectic", "Phi' J Phi'^T = J", symplectic, Charts(system, start, True)
    if isinstance(system, POISSON_SYSTEMS):
        yield "Poisson", "Phi' B(y) Phi'^T = B(Phi(y))", symplectic, Charts(system, start, False)
    if isinstance(system, ConstrainedSystem):
        formula = "dq dp on the constraints is kept: Phi' B Phi'^T = B(Phi)"
        yield "symplectic", formula, symplectic, ConstrainedCharts(system, start, True)
    if isinstance(system, ConstrainedBody):
        formula = "the two-form of T*G on the constraints is kept: Phi' B Phi'^T = B(Phi)"
        yield "symplectic", formula, symplectic, BoundCharts(system, start, True)


def is_loaded(system: Any) -> bool:
    """Whether there is a force without a potential, under which the motion itself keeps no bracket."""
    body = system.body if isinstance(system, BoundBody) else system
    return isinstance(body, MechanicalSystem) and body.load is not None


def claims(trial: MethodTrial, keeps: tuple[str, ...], native: bool) -> Iterator[Observation]:
    """The observations of all claims, law by law."""
    system, start = trial.system, trial.start
    yield order(trial)
    yield way_back(trial)
    for law, formula, claimed, charts in kept_brackets(system, start, trial.method):
        yield bracket(trial, charts, law, formula, claimed)
    if has_forms(system, trial.method):
        formula = "d om_i = (h/2) (kappa_i + kappa_i'), of each site the two-form and what flows to it"
        yield bracket(trial, FormsOfSites(system, start, True), "multisymplectic", formula, trial.method.symplectic)
    if isinstance(system, ConstrainedSystem) and trial.method.symplectic:
        keeps = (*keeps, "constraint", "hidden constraint")
    yield from kept(trial, keeps)
    if isinstance(system, LiePoissonMotion) and start.g is not None:
        yield equivariance(trial)
    if native:
        yield native_code(trial)
