"""Is a motion chaotic?  Lyapunov exponents and MEGNO, along a run and its tangent map.

A disturbance z of the start grows as |z(t)| ~ exp(lambda t) in chaos and as t in regular motion.  With the gains
a_k = ln |z_k|/|z_{k-1}| from sample to sample

    lambda(t) = 1/t sum a_k,     Y(t) = 2/t sum t_k a_k,     <Y>(t) = 1/t sum Y(t_k) (t_k - t_{k-1}),

where <Y> tends to 2 in regular motion and grows as lambda t/2 in chaos.  z is that of the discrete motion, left-
trivialised, and measured beside the sizes of the state.

Source: Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980), part 2; Cincotta, Giordano, Simo, Phase space
structure of multi-dimensional systems by means of the mean exponential growth factor of nearby orbits, Physica D 182
(2003), equations (8) and (9).
"""

from __future__ import annotations

from contextlib import suppress
from typing import Any

import numpy as np

from ...errors import IncompatibleSystem, InvalidInput
from ...formulas.classes.frozen import frozen
from ...simulation import arguments
from .near_a_state import FAINT, largest_of_blocks, states_near
from .symmetries import nonzero

STEPS_AT_ONCE = 100
"""Steps after which the disturbances are made orthonormal again; a hundredth of the time with adaptive steps."""

REGULAR, CHAOTIC = (1.5, 2.5), 4.0
"""What <Y> is of a motion that is called regular, and beyond what it is called chaotic."""

SETTLED = 1.2
"""How much <Y> of a regular motion grows at most in the second half of the time; in chaos it doubles, on its way past 2 too."""


@frozen
class Lyapunov:
    """Lyapunov exponents and MEGNO of a motion; `print` it.

    t : the times of the samples after the start, (n,).  exponents : (k,), in 1/s, descending, at the last of them; of a run
    backwards too they tell how disturbances grow on the way.
    history : (n,), the first exponent up to each of them.  megno, mean_megno : Y and <Y>, (n,).
    last : the state at the end.
    """

    t: np.ndarray
    exponents: np.ndarray
    history: np.ndarray
    megno: np.ndarray
    mean_megno: np.ndarray
    last: Any

    @property
    def verdict(self) -> str:
        """`regular`, `chaotic`, or `undecided`, if the run is too short to tell: by <Y> at the end and at half the time."""
        at_end, at_half = self.mean_megno[-1], np.interp(0.5, self.t / self.t[-1], self.mean_megno)
        if at_end > CHAOTIC:
            return "chaotic"
        return "regular" if REGULAR[0] <= at_end <= min(REGULAR[1], SETTLED * at_half) else "undecided"

    def __repr__(self) -> str:
        exponents = ", ".join(f"{x:.4g}" for x in self.exponents)
        return (
            f"{self.verdict}: mean MEGNO {self.mean_megno[-1]:.3g} at t = {self.t[-1]:.6g} (2 if regular)\n"
            f"Lyapunov exponents {exponents} per unit time"
        )


def lyapunov(
    plan: Any, start: Any, *, steps: int | None = None, t_end: float | None = None, exponents: int = 1, seed: int = 0
) -> Lyapunov:
    """The largest Lyapunov exponents of a motion, and its MEGNO.

    plan : how steps are made, `lm.Plan(system, method, h=...)`; any with a tangent map, of many sites too.
    start : of one body.  steps : with fixed steps; t_end : with adaptive ones.  exponents : how many; of a Hamiltonian
    system all 2n come in pairs +-lambda.  seed : of the first disturbances, which are random.

    Returns a Lyapunov.  Raises InvalidInput for an ensemble and for counts that are none, IncompatibleSystem for steps in
    fictive time, for noise and for methods without a tangent map.

    Source: Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980), part 2; Cincotta, Giordano, Simo, Physica D 182
    (2003).
    """
    if plan.fictive or plan._first_of("method").noisy:
        raise IncompatibleSystem("lyapunov: of steps in time, without noise, which would repeat in every piece")
    if start.bodies is not None and not hasattr(start, "in_a_row"):
        raise InvalidInput(f"lyapunov: start is the state of one body; got an ensemble of {start.bodies}")
    if plan.adaptive == (t_end is None) or plan.adaptive != (steps is None):
        raise InvalidInput(
            f"lyapunov: give {'t_end with adaptive' if plan.adaptive else 'steps with fixed'} steps, alone"
        )
    plan, pieces = plan.replace(record=None), _pieces(steps, t_end)
    sizes = _sizes(plan.system, plan.run(start, **pieces[0]), start)
    if not (type(exponents) is int and 1 <= exponents <= len(sizes)):
        raise InvalidInput(
            f"lyapunov: exponents is from 1 to {len(sizes)}, the components of the state; got {exponents}"
        )
    directions = np.linalg.qr(np.random.default_rng(seed).normal(size=(len(sizes), exponents)))[0]
    times, gains, sums, t, state = [], [], np.zeros(exponents), 0.0, start
    for piece in pieces:
        run = plan.tangent(state, t0=t, along=directions * sizes[:, None], **piece)
        along = run.tangent["along"].reshape(len(run.t), len(sizes), exponents) / sizes[:, None]
        directions, R = np.linalg.qr(along[-1])
        gains.append(np.diff(np.log(np.linalg.norm(along[:, :, 0], axis=1))))
        sums += np.log(np.abs(np.diagonal(R)))
        times.append(run.t[1:])
        t, state = float(run.t[-1]), run.last
    at, gain = np.concatenate(times), np.concatenate(gains)
    megno = 2.0 * np.cumsum(at * gain) / at
    mean = np.cumsum(megno * np.diff(at, prepend=0.0)) / at
    return Lyapunov(at, np.sort(sums / abs(t))[::-1], np.cumsum(gain) / abs(at), megno, mean, state)


def _pieces(steps: int | None, t_end: float | None) -> list[dict[str, Any]]:
    """The arguments of the runs between which disturbances are made orthonormal."""
    if t_end is not None:
        t_end = arguments.real(t_end, "t_end")
        if t_end <= 0.0:
            raise InvalidInput(f"lyapunov: t_end is later than the start, t = 0; got {t_end}")
        return [{"t_end": float(x)} for x in np.linspace(0.0, t_end, STEPS_AT_ONCE + 1)[1:]]
    pieces, remainder = divmod(arguments.count(steps, "steps", 1), STEPS_AT_ONCE)
    return [{"steps": n} for n in [STEPS_AT_ONCE] * pieces + [remainder] * (remainder > 0)]


def _sizes(system: Any, run: Any, start: Any) -> np.ndarray:
    """The sizes of the components of a state along a run: by parts, in those of one unit, the largest number, and where
    elements are the displacements that count as large.  What is faint, as momenta at an equilibrium, has the size that
    counts near the start.
    """
    sizes = {}
    group = getattr(system, "configurations", system.group)
    for name in start.arrays:
        samples = np.asarray(getattr(run, name))
        numbers = np.abs(group._scales(samples) if name == "g" else samples.reshape(len(samples), -1)).max(axis=0)
        blocks = group.unit_blocks if len(numbers) == sum(group.unit_blocks) else (len(numbers),)
        sizes[name] = np.repeat(nonzero(largest_of_blocks(numbers, blocks)), blocks)
    with suppress(IncompatibleSystem):
        place, momentum = np.split(states_near("lyapunov", system, start).sizes(), 2)
        for name, near in {"q": place, "g": place, "p": momentum, "mu": momentum}.items():
            if name in sizes:
                sizes[name] = np.where(sizes[name] > FAINT * near, sizes[name], near)
    return np.concatenate([*sizes.values()])
