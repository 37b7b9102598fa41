"""The constants of a motion, over time: how far it is from what it was, beside what rounding alone does."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..errors import InvalidInput
from ..formulas.arrays import Array
from ..formulas.numbers.sizes import EPSILON
from .style import GREY, Axes, legend, look, named_runs, needs_run, plane_axes, time_label

WIDE = (6.6, 3.4)
"""Inches, with room for a legend beside the curves."""
LEAST = 0.1 * EPSILON
"""The height at which a change of zero is drawn."""
BINS = 400
"""Of more samples the largest in each of so many stretches of time is drawn."""


def invariants(
    run: Any, names: Sequence[str] | None = None, *, ax: Axes | None = None, title: str | None = None
) -> Axes:
    """Draw how far the constants of a motion have moved: |C(t) - C(0)| over the size of C, and the
    noise floor.

    run : what `integrate` returns; of an ensemble the largest change among the bodies is drawn.
    names : of the constants, as in `run.drift()`; all of them if not given.

    The grey band is what rounding alone does: n steps with an error of one rounding each walk
    sqrt(n) roundings at random. The scale is that of `run.drift()`: the size of the constant, or of
    its terms where they cancel. Of more than 400 samples the largest in each of 400 stretches of
    time is drawn, which is their envelope. A constant that never changes is drawn at a tenth of a
    rounding. Returns the axes. Raises InvalidInput for names that are no constants, and for motions without any.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., VIII.5 (Brouwer's
    law).
    """
    needs_run(run, "plots.invariants")
    chosen = _names(run, names)
    ax = plane_axes(ax, title, _label(run), "relative change", WIDE)
    if len(run.t) < 2:
        raise InvalidInput("plots.invariants needs at least two samples")
    t, floor = _time(run)[1:], noise(run)[1:]
    starts = np.arange(0, len(t), max(1, -(-len(t) // BINS)))
    ends = np.append(starts[1:], len(t)) - 1
    for k, name in enumerate(chosen):
        highest = np.maximum.reduceat(changes(run, name)[1:], starts)
        if (highest > LEAST).any():  # not to be seen: no change at all among others
            highest = np.where(highest > LEAST, highest, np.nan)
        ax.semilogy(t[ends], highest, label=name, **look(k))
    ax.fill_between(t[ends], LEAST, floor[ends], color="#e9ebef", zorder=0.5, linewidth=0, label="rounding")
    ax.set_ylim(bottom=LEAST)
    legend(ax, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def drift(runs: Any, name: str = "energy", *, ax: Axes | None = None, title: str | None = None) -> Axes:
    """Draw the largest change of one constant so far, over time, both logarithmic: who drifts, and
    how.

    runs : a run, or several by name, {"RKMK4": run, ...}.
    name : of the constant, as in `run.drift()`.

    A straight drift has slope 1, a random walk 1/2, a bounded error 0. The dotted line is the noise
    floor, rounding that walks at random. Returns the axes. Raises InvalidInput for names that are
    no constants.

    Source: Hairer, Lubich, Wanner, Geometric Numerical Integration, 2nd ed., IX.8 (long-time energy
    conservation) and VIII.5.
    """
    by_name = named_runs(runs, "plots.drift")
    words = _label(next(iter(by_name.values()))), f"{name}:\nlargest change so far"
    ax = plane_axes(ax, title, *words, WIDE)
    for k, (label, run) in enumerate(by_name.items()):
        (name,) = _names(run, (name,))
        if len(run.t) < 2:
            raise InvalidInput("plots.drift needs at least two samples")
        passed = np.abs(_time(run) - _time(run)[0])[1:]
        highest = np.maximum.accumulate(changes(run, name))[1:]
        samples = np.unique(np.geomspace(1, len(passed), min(len(passed), 800)).round().astype(int)) - 1
        ax.loglog(passed[samples], highest[samples], label=label or None, **look(k))
        floor = {"color": GREY, "linestyle": ":", "linewidth": 0.9, "zorder": 0.5}
        floor_label = "rounding" if k == len(by_name) - 1 else None
        ax.loglog(passed[samples], noise(run)[1:][samples], label=floor_label, **floor)
    legend(ax, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return ax


def changes(run: Any, name: str) -> Array:
    """The relative change of a constant since the start, (n,); of an ensemble the largest among the bodies."""
    values = np.asarray(run._constants[name])
    axes = 1 if run.bodies is None else 2
    values = values.reshape(*values.shape[:axes], -1)
    change = np.linalg.norm(values - values[0], axis=-1)
    change = change if run.bodies is None else change.max(axis=1)
    scale = run.drift()[name].scale if len(run.t) > 1 else 0.0
    return np.maximum(change / (scale or 1.0), LEAST)


def noise(run: Any) -> Array:
    """The change of a constant by rounding alone until each sample, (n,): EPSILON sqrt(steps)."""
    passed = np.abs(_time(run) - _time(run)[0])
    return EPSILON * np.sqrt(1.0 + run.steps * passed / (passed[-1] or 1.0))


def _time(run: Any) -> Array:
    """Time, (n,); of an ensemble in fictive time that, which its members share; of bodies with
    steps of their own the samples.
    """
    return run.t if run.t.ndim == 1 else run.tau if "tau" in vars(run) else np.arange(float(len(run.t)))


def _label(run: Any) -> str:
    """The name of the axis of `_time`."""
    return time_label(run) if run.t.ndim == 1 else r"fictive time $\tau$" if "tau" in vars(run) else "sample"


def _names(run: Any, names: Sequence[str] | None) -> list[str]:
    constants = list(run._constants)
    if not constants:
        raise InvalidInput(
            f"plots: no constants of the motion of {run.system!r} are known; it may name them in `constants`"
        )
    for name in names or ():
        if name not in constants:
            raise InvalidInput(f"plots: {name!r} is no constant of this motion; known are: {', '.join(constants)}")
    return constants if names is None else list(names)
