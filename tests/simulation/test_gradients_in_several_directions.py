"""Derivatives along several directions at once, which share the values; of bodies with steps of their
own; by the values of tables, forwards.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from simulation.test_gradient import AT_REST, BODY, KNOTS, START, VALUES, driven, loss

import liemech as lm
from liemech import errors
from liemech.formulas import derivative, where
from liemech.formulas.functions import RULES
from liemech.formulas.numbers.dual import Dual
from liemech.rooms.derivatives import through_blocks
from liemech.rooms.derivatives.through_blocks import side_by_side

LEVEL = 0.5

SHORT = 2500
"""Instructions of a step of Cayley's RKMK4 with numbers that carry nothing, and some more."""


@pytest.mark.parametrize("name", sorted(RULES))
def test_every_function_has_the_slopes_of_each_direction(name: str) -> None:
    """Slopes along three directions are those of each alone, to the bit; alone, and in derivatives that formulas take."""
    function = getattr(lm.formulas, name, None) or getattr(math, name)
    x, y = (1.25, 0.5) if name == "acosh" else (0.25, 0.5)
    directions = [(1.0, 0.0), (0.0, 1.0), (-0.3, 2.0)]

    def asked(a: Any, b: Any) -> Any:
        two = name in ("atan2", "copysign", "pow")
        inner = derivative(lambda u: function(u, b * u) if two else function(u * b + a), a)
        return where(a > 0.1, inner * a / b, 0.0) + (a**3 if a > b else a**b)

    together = asked(*(Dual(z, lm.Vec(*d), LEVEL) for z, d in zip((x, y), zip(*directions))))
    for k, (dx, dy) in enumerate(directions):
        alone = asked(Dual(x, dx, LEVEL), Dual(y, dy, LEVEL))
        assert together.value == alone.value and together.slope[k] == alone.slope


def test_how_many_directions_share_a_value() -> None:
    """None is left over where that is possible, and states of many numbers have one at a time."""
    assert [side_by_side(n, n) for n in (1, 2, 3, 6, 9)] == [1, 2, 3, 3, 3]
    assert side_by_side(20, 20) in (4, 5)
    assert side_by_side(24, 44) == 1


@pytest.mark.slow
@pytest.mark.compiled
def test_code_that_is_too_long_goes_direction_by_direction(monkeypatch: Any) -> None:
    """One that fits only where a number carries one derivative."""
    from liemech.compiler.translation import instructions

    plan = lm.Plan(BODY, lm.RKMK(order=4, retraction=lm.Cayley()), h=0.05, compiled=True)
    wanted = plan.replace(compiled=False).pullback(np.arange(6.0), START, steps=200)["start"]
    seen: Any = []
    made: Any = through_blocks.Blocks

    def blocks(way: Any, directions: Any, start: Any) -> Any:
        seen.append(directions.side)
        return made(way, directions, start)

    monkeypatch.setattr(through_blocks, "Blocks", blocks)
    monkeypatch.setattr(instructions, "LIMIT", SHORT)
    monkeypatch.setattr(instructions, "WITH_SLOPES", 4)
    found = plan.pullback(np.arange(6.0), START, steps=200)["start"]
    assert np.abs(found - wanted).max() < 1e-13 * np.abs(wanted).max()
    assert seen == [3, 1]


@pytest.mark.slow
def test_bodies_with_steps_of_their_own_have_the_gradients_of_each() -> None:
    """An ensemble by an error estimate; by parameters of one system the sum."""
    others = [BODY, lm.RigidBody([1.1, 1.6, 2.5])]
    mu = np.array([[0.5, 0.1, 0.8], [0.2, 0.3, 0.4]])
    starts = BODY.state(mu=mu, g=np.tile(np.eye(3), (2, 1, 1)))
    words: Any = {"by": ["start", "inertia"], "along": lambda t, s: t * s.mu[0], "every": 3}
    step: Any = {"rtol": 1e-4, "compiled": False}
    each = [loss, lambda s: 2.0 * s.mu[0]]
    for systems in (BODY, others):
        plan: Any = lm.Plan(systems, lm.RKMK(order=5), **step)
        found = plan.gradient(each, starts, t_end=[1.0, 1.5], **words)
        ones: Any = [
            lm.Plan(systems if systems is BODY else others[i], lm.RKMK(order=5), **step).gradient(
                each[i], BODY.state(mu=mu[i], g=np.eye(3)), t_end=1.0 + 0.5 * i, **words
            )
            for i in range(2)
        ]
        assert found.value == math.fsum(one.value for one in ones)
        assert (found["start"] == [one["start"] for one in ones]).all()
        rows = np.array([one["inertia"] for one in ones])
        assert (found["inertia"] == (rows.sum(axis=0) if systems is BODY else rows)).all()
        assert (found.run.last.mu == [one.run.last.mu for one in ones]).all()
    with pytest.raises(errors.IncompatibleSystem, match="samples of its own"):
        plan.pullback({"mu": mu}, starts, t_end=1.0, every=2)
    with pytest.raises(errors.InvalidInput, match="leading axis of 2 bodies"):
        plan.pullback({"mu": mu[0]}, starts, t_end=1.0)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["linear", "constant"])
@pytest.mark.parametrize("step", [{"h": 0.13}, {"rtol": 1e-3}])
def test_tangent_maps_by_the_values_of_a_table(kind: str, step: dict[str, float]) -> None:
    """The pullback, which goes backwards through parts of the table, is the product with them."""
    table = getattr(lm.PiecewisePolynomial, kind)
    values = VALUES[:-1] if kind == "constant" else VALUES
    whole, method = driven(table(KNOTS, values, outside="repeat")), lm.RKMK(order=5)
    plan = lm.Plan(whole, method, compiled=False, **step)  # type: ignore[arg-type]
    by = ["torque.values", "torque.coefficients"]
    length: Any = {"t_end": 1.3}
    tangent = plan.tangent(AT_REST, by=by, **length).tangent
    w = np.sin(1.0 + np.arange(6.0))
    found = plan.pullback(w, AT_REST, by=by, **length)
    for name in by:
        assert np.abs(w @ tangent[name][-1] - found[name].ravel()).max() < 1e-14


@pytest.mark.slow
def test_a_delayed_table_has_a_tangent_map() -> None:
    """Forwards, where a table is asked does not matter; against differences of order 4."""

    def made(values: Any) -> Any:
        table = lm.PiecewisePolynomial.linear(KNOTS, values, outside="hold")
        return lm.Plan(driven(table, 0.35), lm.RKMK(order=4), h=0.1, compiled=False)

    tangent = made(VALUES).tangent(AT_REST, steps=8, by="torque.values").tangent["torque.values"]
    ends = []
    for x in (1e-3, -1e-3, 2e-3, -2e-3):
        moved = VALUES.copy()
        moved[1, 2] += x
        ends.append(np.asarray(made(moved).run(AT_REST, steps=8).last.mu))
    wanted = (8.0 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / 12e-3
    assert np.abs(tangent[-1][:3, 5] - wanted).max() < 1e-10


def test_a_table_in_fictive_time_is_refused() -> None:
    clock = lm.ReversibleController(lm.StormerVerlet(), sigma=lm.time_scales.DistancePower(1.4))
    plan = lm.Plan(lm.Kepler(), clock, h=0.05)
    with pytest.raises(errors.LiemechError, match="no parameter"):
        plan.tangent(lm.Kepler().state(q=[0.6, 0.0], p=[0.0, 1.4]), steps=3, by="torque.values")
