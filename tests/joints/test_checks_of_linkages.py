"""`check_system` on linkages with rotors and in given motions: their energy and conditions are those of the whole."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import liemech as lm
from liemech.checks.check import members
from liemech.checks.local_claims import off_constraint
from liemech.checks.method_claims import MethodTrial, kept_brackets
from liemech.checks.points.places import CheckPlace, places
from liemech.formulas import cos, mat, record, sin, vec
from liemech.joints import Damper, Link, Linkage, MovingSupport, PrismaticJoint, RevoluteJoint, Shaking, chain

ROD = chain(1, axis=[0.0, 1.0, 0.0])


@pytest.mark.slow
@pytest.mark.parametrize("damping", [0.0, 0.3])
def test_a_damped_hinge_with_a_rotor_breaks_no_law(damping):
    """d/dt (H + A q'^2/2) = -c q'^2."""
    joints = [replace(ROD.joints[0], armature=0.4)]
    system = Linkage(ROD.links, joints, forces=[Damper(0, damping)])
    report = lm.check_system(system, system.state(angles={0: 0.4}, rates={0: 0.7}))
    assert {row.verdict for row in report.findings if row.law in ("load", "constraints stay")} == {"holds"}


@pytest.mark.slow
@pytest.mark.parametrize("rate", [0.0, 1e-4, 1e-2])
def test_a_hinge_that_hardly_moves_breaks_no_law(rate):
    """Its places are some tenths of a metre, of which conditions are differences, however slow it is."""
    axis = [0.74, 0.67, -0.09]
    hinge = RevoluteJoint(0, None, [-0.14, -0.2, 0.8], [-0.056, 0.0016, 0.021], axis, axis)
    system = Linkage([Link(1.5, [0.17, 0.2, 0.22])], [hinge], forces=[Damper(0, 0.2)])
    report = lm.check_system(system, system.state(angles={0: 0.35}, rates={0: rate}))
    assert {row.verdict for row in report.findings if row.law == "constraints stay"} == {"holds"}


def test_what_moves_with_time_is_not_looked_at():
    system = Linkage(ROD.links, ROD.joints, motions={0: Shaking([0.0, 0.0, 0.1], 6.0, 1.0)})
    report = lm.check_system(system, system.state(angles={0: 1.0}))
    told = {row.law: row.verdict for row in report.findings}
    assert told["rows of the constraint"] == "holds" and told["constraints stay"] == "not there"


@pytest.mark.parametrize("turn", [0.0, 1e-33, 1e-3, 1.0])
def test_a_turn_of_a_slider_is_measured_beside_velocities_of_its_energy(turn):
    """With momentum p along the axis and L about another one it is off by L / sqrt(J E), E = p^2/m + L^2/J: a body that
    does not turn but for rounding was told to be off by 1.
    """
    m, J, p = 2.0, 0.3, 1.2
    slider = PrismaticJoint(0, None, [0.1, -0.2, 0.4], [0.0, 0.0, 0.1], [1.0, 0.0, 0.0])
    system = Linkage([Link(m, [J, 0.4, 0.5])], [slider], gravity=0.0)
    start = system.state(angles={0: 0.1}, rates={0: p / m})
    state = type(start)(mu=lm.vec(turn, 0.0, 0.0, *start.mu[3:]), g=start.g)
    off = dict(off_constraint(system, [state], [0.0]))
    assert off["hidden constraint"] == pytest.approx(turn / np.sqrt(J * (p**2 / m + turn**2 / J)), rel=1e-12)
    assert off["constraint"] < 1e-15


def test_conditions_of_a_driven_arm_are_those_of_its_time():
    motion = Shaking([0.0, 0.0, 0.1], 6.0, 1.0)
    system = Linkage(ROD.links, ROD.joints, motions={0: motion})
    starts = [system.state(angles={0: 1.0}, rates={0: 0.4}, t=t) for t in (0.0, 0.2)]
    assert max(dict(off_constraint(system, starts, [0.0, 0.2])).values()) < 4.0 * np.finfo(float).eps
    early = dict(off_constraint(system, starts[:1], [0.2]))
    assert min(early.values()) > 1e-3  # centimetres and decimetres a second


@pytest.mark.slow
def test_the_power_of_a_load_is_that_of_the_whole():
    """A rotor that the energy forgets is found: dE/dt = <F, xi> fails by its part."""

    @lm.record
    class Forgets(Linkage):
        def energy(self, mu, g):
            return self.body.energy(mu, g)

    joints = [replace(ROD.joints[0], armature=0.4)]
    system = Forgets(ROD.links, joints, forces=[Damper(0, 0.3)])
    with pytest.raises(lm.errors.LawViolation, match="load"):
        lm.check_system(system, system.state(angles={0: 0.4}, rates={0: 0.7}))


@record
class Turntable(MovingSupport):
    """A place 0.4 m from the axis of a table that turns about e3."""

    rate: float

    def pose(self, t):
        c, s = cos(self.rate * t), sin(self.rate * t)
        rows = vec(c, -s, 0.0, 0.4 * c), vec(s, c, 0.0, 0.4 * s), vec(0.0, 0.0, 1.0, 0.0), vec(0.0, 0.0, 0.0, 1.0)
        return mat(*rows)


def on_a_turntable():
    system = Linkage(ROD.links, ROD.joints, motions={0: Turntable(1.3)})
    return system, system.state(angles={0: 1.0}, rates={0: 0.4})


@pytest.mark.slow
def test_a_step_under_conditions_that_turn_is_symplectic():
    """From the tangent space of the conditions at its begin to that at its end: with those at t = 0 it was off by 0.0016."""
    system, start = on_a_turntable()
    trial = MethodTrial(lm.LieRATTLE(), system, members(start)[0], 0.05, False)
    vars(trial)["journey"] = 0.05, None, None
    (_, _, claimed, charts), *_ = kept_brackets(system, trial.start, trial.method)
    assert claimed and charts.defect(trial, 0.02) < 1e-12


@pytest.mark.slow
def test_other_starts_of_a_driven_arm_are_on_its_conditions():
    """Starts that are consistent at t = 0 were tried at t = 7.3, and the method blamed."""
    system, start = on_a_turntable()
    first = CheckPlace("the start", lm.LieRATTLE(), system, members(start)[0], 0.0, False)
    tried = [*places(first)]
    assert len(tried) == 6
    assert max(max(dict(off_constraint(system, [p.start], [p.t0])).values()) for p in tried) < 1e-13
