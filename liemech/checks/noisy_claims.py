"""Observations of a method for noisy systems: the error of paths, the error of means without
statistics, and what every path keeps.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..formulas import Vec, record, vec
from ..formulas.classes.records import with_fields
from ..rooms.noise.stochastic import Stochastic
from ..rooms.noise.stochastic_steps import NoisySteps
from ..simulation.integrate import integrate
from .points.sample_states import pace
from .report import Observation

PATHS, FINEST = 400, 256
"""Paths and steps of the finest of them, from which the strong order is observed."""

OUTCOMES = 2**17
"""Outcomes that are followed at most for the weak order."""

MISSED = 0.2
"""By so much an observed order may miss the claim."""

STRONG = "sqrt(mean |mu_h - mu|^2) = O(h^p)"
WEAK = "mean mu_h - mean mu = O(h^p)"
KEPT = "C(mu_n) = C(mu_0) on every path"


@record
class Outcomes(NoisySteps):
    """The steps of a method with all outcomes of bounded increments and of a coin, by the number of the path
    in a base.
    """

    inner: Any = None  # the method
    points: int = 3  # the number of values of an increment
    coins: int = 2  # the number of values of a coin

    def random(self, system: Any, path: float, number: float) -> tuple[Vec, float]:
        """The increments and the coin that the digits of the path say."""
        count = len(system.fields)
        digits = (path // float(self.points**count * self.coins) ** number) % float(self.points**count * self.coins)
        z: list[Any] = []
        for _ in range(count):
            z, digits = [*z, digits % float(self.points)], digits // float(self.points)
        if self.points == 2:
            return vec(*[2.0 * x - 1.0 for x in z]), (digits + 0.5) / float(self.coins)
        return vec(*[3.0**0.5 * (x - 1.0) for x in z]), (digits + 0.5) / float(self.coins)

    def moved(self, system: Any, t: float, memory: Any, h: float, z: Vec, coin: float) -> Any:
        return self.inner.moved(system, t, memory, h, z, coin)


def noisy_claims(
    method: NoisySteps, system: Stochastic, start: Any, h: float | None, compiled: bool | None
) -> Iterator[Observation]:
    """The strong and the weak order over a time h, and what paths keep."""
    speed = pace(system.motion, 0.0, system.system.state(start.mu, start.g))
    strengths = [np.linalg.norm(field.gradient(start.mu)) for field in system.fields]
    noise = float(max(strengths, default=0.0))
    time = h if h is not None else 1.0 / max(speed, noise * noise, 1e-300)
    ends: dict[int, np.ndarray] = {}
    for fine in (1, 8, 32):
        steps = FINEST // fine
        starts = system.state([list(start.mu)] * PATHS)
        ends[fine] = integrate(
            system, with_fields(method, fine=fine), starts, h=time / steps, steps=steps, every=steps,
            compiled=compiled, progress=False,
        ).mu[-1]  # fmt: skip
    errors = [math.sqrt(((ends[k] - ends[1]) ** 2).sum(axis=1).mean()) for k in (8, 32)]
    yield _of_order("strong order", STRONG, errors[1], errors[0], 4.0, method.strong_order)
    yield _weak(method, system, start, time, compiled)
    casimirs = np.asarray(system.casimirs(ends[1]))
    first = np.asarray(system.casimirs(start.mu))
    for i in range(casimirs.shape[-1]):
        change = np.abs(casimirs[:, i] - first[i]).max() / (abs(first[i]) or 1.0)
        verdict = "seen" if change < 1e-12 else "not seen"
        yield Observation(f"Casimir {i + 1}", KEPT, verdict, observed=f"{change:.1e}", wanted="no claim")


def _of_order(law: str, formula: str, coarse: float, fine: float, ratio: float, claim: float) -> Observation:
    """The order that two errors show, beside the claim."""
    if not fine > 0.0:
        return Observation(law, formula, "not seen", wanted=f"{claim:g}", remark="no error is seen")
    observed = math.log(coarse / fine, ratio)
    verdict = "holds" if observed > claim - MISSED else "broken"
    return Observation(law, formula, verdict, "the start", observed=f"mu {observed:.2f}", wanted=f"{claim:g}")


def _weak(method: NoisySteps, system: Stochastic, start: Any, time: float, compiled: bool | None) -> Observation:
    """The order of the mean momentum, by all outcomes of bounded increments for 1, 2 and 4 steps."""
    points, coins = (2, 1) if method.weak_order == 1 else (3, 2)
    base = points ** len(system.fields) * coins
    if base**4 > OUTCOMES:
        return Observation(
            "weak order", WEAK, "not seen", wanted=f"{method.weak_order}",
            remark=f"{base}^4 outcomes are too many to follow; it is observed with fewer fields",
        )  # fmt: skip
    outcomes = Outcomes(method.method, inner=method, points=points, coins=coins)
    means = []
    for steps in (1, 2, 4):
        paths = np.arange(base**steps)
        starts = system.state([list(start.mu)] * len(paths), path=paths)
        mu = integrate(
            system, outcomes, starts, h=0.5 * time / steps, steps=steps, every=steps, compiled=compiled,
            progress=False,
        ).mu[-1]  # fmt: skip
        weights = np.full(len(paths), 1.0 / coins**steps)
        for k in range(steps):
            digit = (paths // base**k) % base
            for _ in system.fields:
                weights *= _PROBABILITY[points][digit % points]
                digit = digit // points
        means.append(weights @ mu)
    changes = [float(np.linalg.norm(b - a)) for a, b in itertools.pairwise(means)]
    return _of_order("weak order", WEAK, changes[0], changes[1], 2.0, method.weak_order)


_PROBABILITY = {2: np.array([0.5, 0.5]), 3: np.array([1.0, 4.0, 1.0]) / 6.0}
