"""RKMK and commutator-free methods of linkages in given motions and with rotors, by the reduced equation in memory."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from test_links_in_memory import needs_compiler

import liemech as lm
from liemech.joints import Damper, Linkage, Mimic, Shaking, chain
from liemech.simulation.runs.carry import SiteCarry

T_END = 0.2


def shaken() -> tuple[Any, Any]:
    """Three rods: a shaken support, a damper, and an angle that follows a parabola."""
    rods = chain(3, axis=[0.0, 1.0, 0.0])
    path = lm.PiecewisePolynomial([0.0, 1.0], [[0.2, 0.5, 0.3]])
    motions = {0: Shaking([0.1, 0.0, 0.3], 7.0, 0.4), 2: path}
    made = Linkage(rods.links, rods.joints, forces=[Damper(1, 0.1)], motions=motions)
    return made, made.state(angles={0: 0.3, 1: 0.2}, rates={0: 0.5})


def geared() -> tuple[Any, Any]:
    """Three rods with rotors, of which one turns with two of them."""
    rods = chain(3, axis=[0.0, 1.0, 0.0])
    joints = [replace(joint, armature=0.3) for joint in rods.joints]
    made = Linkage(rods.links, joints, forces=[Damper(1, 0.1)], mimics=[Mimic(2, 1, 0.5)])
    return made, made.state(angles={0: 0.3, 1: 0.2}, rates={0: 0.5, 1: 0.4})


def end(made: Any, method: Any, steps: int, compiled: bool = False) -> Any:
    return lm.integrate(made[0], method, made[1], h=T_END / steps, steps=steps, compiled=compiled, progress=False)


@functools.cache
def by_rattle(mechanism: Any) -> Any:
    """Where it leads, by the method that keeps conditions."""
    return end(mechanism(), lm.Composition(lm.LieRATTLE(), order=6), 8)


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.CommutatorFree(order=4)], ids=repr)
@pytest.mark.parametrize("mechanism", [shaken, geared])
def test_their_orders_beside_the_method_that_keeps_conditions(mechanism: Any, method: Any) -> None:
    """And conditions drift by the error of the method."""
    made, exact = mechanism(), by_rattle(mechanism)
    runs = [end(made, method, steps) for steps in (4, 8)]
    assert isinstance(runs[0].carry, SiteCarry)
    errors = [np.abs(run.g[-1] - exact.g[-1]).max() + np.abs(run.mu[-1] - exact.mu[-1]).max() for run in runs]
    assert 3.5 < np.log2(errors[0] / errors[1]) < 4.8
    off, rates = made[0].conditions_at(runs[1].mu[-1], runs[1].g[-1], T_END)
    assert np.abs(off).max() < errors[1] and np.abs(rates).max() < 10.0 * errors[1]


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("mechanism", [shaken, geared])
def test_native_steps_have_the_bits_of_plain_ones(mechanism: Any) -> None:
    """Of fixed steps; and adaptive ones come as close as they are asked to."""
    made, method = mechanism(), lm.RKMK(order=5)
    plain, native = (end(made, method, 4, compiled) for compiled in (False, True))
    assert native.compiled and np.array_equal(plain.mu, native.mu) and np.array_equal(plain.g, native.g)
    found = lm.Plan(made[0], method, rtol=1e-9, atol=1e-9, compiled=True).run(made[1], t_end=T_END)
    assert np.abs(found.g[-1] - end(made, method, 200, True).g[-1]).max() < 1e-8


@needs_compiler
@pytest.mark.slow
def test_implicit_stages_settle_for_all_bodies_together() -> None:
    """The midpoint rule, natively with the bits of plain Python."""
    made, method = geared(), lm.RKMK(tableau=lm.tableaus.gauss(1))
    plain, native = (end(made, method, 3, compiled) for compiled in (False, True))
    assert native.compiled and np.array_equal(plain.mu, native.mu) and np.array_equal(plain.g, native.g)
