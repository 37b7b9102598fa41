"""Joints in a given motion: shaken supports, turning ones, joints that follow a path, beside DOP853 in
minimal coordinates.
"""

from dataclasses import replace

import numpy as np
import pytest
from orders import slope
from scipy.integrate import solve_ivp

import liemech as lm
from liemech.formulas import cos, mat, sin, vec
from liemech.joints import Damper, JointPath, MovingSupport, Shaking, Spring

TURN, GRAVITY = [0.0, 1.0, 0.0], 9.80665


@lm.record
class Swing(JointPath):
    """An angle that swings."""

    amplitude: float
    frequency: float

    def coordinates(self, t):
        """amplitude sin(frequency t)."""
        return self.amplitude * sin(self.frequency * t)


@lm.record
class Turntable(MovingSupport):
    """A place on a table that turns about e3."""

    rate: float
    radius: float

    def pose(self, t):
        """At the angle rate t."""
        c, s = cos(self.rate * t), sin(self.rate * t)
        return mat(
            vec(c, -s, 0.0, self.radius * c),
            vec(s, c, 0.0, self.radius * s),
            vec(0.0, 0.0, 1.0, 0.0),
            vec(0.0, 0.0, 0.0, 1.0),
        )


def exact(rate, start, t_end):
    return solve_ivp(rate, [0.0, t_end], start, method="DOP853", rtol=1e-12, atol=1e-12).y[:, -1]


def ends(linkage, method, start, steps, t_end, compiled=True):
    return lm.integrate(linkage, method, start, h=t_end / steps, steps=steps, compiled=compiled)


def kapitza(amplitude, frequency, phase=0.0):
    one = lm.joints.chain(1, axis=TURN)
    shaken = Shaking([0.0, 0.0, amplitude], frequency, phase)
    return lm.joints.Linkage(one.links, one.joints, motions={0: shaken})


@pytest.mark.slow
def test_kapitza():
    a, w = 0.1, 60.0
    shaken = kapitza(a, w)
    moment = shaken.links[0].inertia[0] + 0.25

    def rate(t, x):
        return x[1], -0.5 / moment * (GRAVITY - a * w * w * np.sin(w * t)) * np.sin(x[0])

    start, t_end = shaken.state(angles={0: 2.8}, rates={0: 0.3}), 0.1
    reference = exact(rate, [2.8, 0.3], t_end)
    errors, runs = [], []
    for steps in (16, 32, 64):
        run = ends(shaken, lm.LieRATTLE(), start, steps, t_end)
        runs.append(run)
        found = run.joint(0)
        errors.append(np.hypot(found.angle[-1] - reference[0], found.rate[-1] - reference[1]))
    assert slope([16, 32, 64], errors) == pytest.approx(-2.0, abs=0.1)
    c, rates = shaken.conditions_at(run.mu, run.g, run.t)
    assert np.abs(c).max() < 1e-15 and np.abs(rates).max() < 1e-13 * a * w
    balance = [r.energy[-1] - r.energy[0] - r.joint(0).given_work[-1] for r in runs]
    assert abs(balance[-1]) < 1e-3 * np.ptp(run.energy)
    assert abs(balance[-2] / balance[-1]) > 3.5
    # the force of the joint carries weight and inertia
    q, rate_of = run.joint(0).angle, run.joint(0).rate
    bend = np.array([rate(t, (x, y))[1] for t, x, y in zip(run.t, q, rate_of)])
    lift = GRAVITY - a * w * w * np.sin(w * run.t)
    lift = lift + 0.5 * (np.sin(q) * bend + np.cos(q) * rate_of**2)
    assert np.allclose(run.joint(0).reaction[:, 2], lift, rtol=1e-11)


@pytest.mark.slow
def test_upside_down():
    """Fast shaking holds a pendulum upright: a w > sqrt(2 g l), of a rod l = 2/3 of its length."""
    for frequency, stays in ((60.0, True), (25.0, False)):
        start = (shaken := kapitza(0.1, frequency, np.pi / 2)).state(angles={0: 3.0})
        run = ends(shaken, lm.LieRATTLE(), start, 1200, 3.0)
        assert bool(np.abs(run.joint(0).angle - np.pi).max() < 1.0) is stays


@pytest.mark.slow
def test_path():
    """The first of two rods follows an angle; its torque is that of inverse dynamics."""
    A, W = 0.7, 3.0
    rods = lm.joints.chain(2, axis=TURN)
    driven = lm.joints.Linkage(
        rods.links, rods.joints, motions={0: Swing(A, W)}, forces=[Damper(1, 0.2), Spring(1, 1.5)]
    )
    moment = rods.links[0].inertia[0] + 0.25

    def all_of(t, x):
        q, rate, _ = x
        p, pd, pdd = A * np.sin(W * t), A * W * np.cos(W * t), -A * W * W * np.sin(W * t)
        own = -0.2 * rate - 1.5 * q
        bend = -0.5 * (np.cos(q) * pdd + np.sin(q) * pd**2) - 0.5 * GRAVITY * np.sin(p + q) + own
        bend = bend / moment
        torque = (moment + 1.0) * pdd + 1.5 * GRAVITY * np.sin(p) + own
        torque = torque + 0.5 * (np.cos(q) * bend - np.sin(q) * (pd + rate) ** 2)
        return (rate, bend - pdd, torque * pd), torque

    start, t_end = driven.state(angles={1: 0.4}), 0.5
    w = driven.state(angles={1: 0.4}, rates={1: 0.0})
    assert np.array_equal(start.mu, w.mu) and np.any(start.mu)
    reference = exact(lambda t, x: all_of(t, x)[0], [0.4, 0.0, 0.0], t_end)
    wanted, errors = [*reference, all_of(t_end, reference)[1]], []
    for steps in (10, 20, 40):
        run = ends(driven, lm.Composition(lm.LieRATTLE(), order=4), start, steps, t_end)
        first, second = run.joint(0), run.joint(1)
        found = [second.angle[-1], second.rate[-1], first.given_work[-1], first.drive[-1]]
        errors.append(np.abs(np.subtract(found, wanted)))
    assert errors[-1][:2].max() < 1e-7 and errors[-1][3] < 1e-6 and errors[-1][2] < 2e-6
    assert slope([10, 20, 40], np.array(errors)[:, 0]) == pytest.approx(-4.0, abs=0.3)
    assert np.allclose(first.angle, A * np.sin(W * run.t), atol=1e-14)
    lost = first.given_work[-1] + second.only(Damper).work[-1]
    assert run.energy[-1] - run.energy[0] == pytest.approx(lost, abs=5e-6)
    with pytest.raises(lm.errors.InvalidInput, match="follows a path"):
        driven.state(angles={0: 0.1})
    with pytest.raises(lm.errors.InvalidInput, match="follows no path"):
        _ = second.drive


@pytest.mark.slow
def test_ground_that_turns():
    """A pendulum at the rim of a turntable, with a damper at its hinge: the rates that forces see are
    those against the table.
    """
    table, radius, c = 4.0, 0.3, 0.5
    one = lm.joints.chain(1, axis=TURN)
    turned = lm.joints.Linkage(one.links, one.joints, motions={None: Turntable(table, radius)}, forces=[Damper(0, c)])
    moment, thin = one.links[0].inertia[0] + 0.25, one.links[0].inertia[2]

    def rate(t, x):
        q, w = x
        spun = table**2 * ((moment - thin) * np.sin(q) * np.cos(q) - 0.5 * radius * np.cos(q))
        return w, (spun - 0.5 * GRAVITY * np.sin(q) - c * w) / moment

    start = turned.state(angles={0: 0.3}, rates={0: 1.0})
    run = ends(turned, lm.Composition(lm.LieRATTLE(), order=4), start, 40, 0.5)
    assert [run.joint(0).angle[-1], run.joint(0).rate[-1]] == pytest.approx(exact(rate, [0.3, 1.0], 0.5), abs=2e-6)
    lost = run.joint(0).given_work[-1] + run.joint(0).work[-1]
    assert run.energy[-1] - run.energy[0] == pytest.approx(lost, abs=1e-5)


@pytest.mark.slow
def test_table_and_start_later():
    """A motion by a table begins at the time that is given, and backwards leads back."""
    plan = lm.PiecewisePolynomial.cubic([0.0, 0.5, 1.0], [0.0, 0.8, 0.3], outside="hold")
    rods = lm.joints.chain(2, axis=TURN)
    driven = lm.joints.Linkage(rods.links, rods.joints, motions={0: plan})
    start = driven.state(angles={1: 0.4}, t=0.25)
    there = lm.Plan(driven, lm.LieRATTLE(), h=0.01, compiled=False).run(start, t0=0.25, steps=6)
    assert there.joint(0).angle == pytest.approx([plan(t) for t in there.t], abs=1e-14)
    end = driven.state(there.mu[-1], there.g[-1], t=float(there.t[-1]))
    back = lm.Plan(driven, lm.LieRATTLE(), h=-0.01, compiled=False).run(end, t0=0.31, steps=6)
    assert np.abs(back.g[-1] - there.g[0]).max() < 1e-13
    with pytest.raises(lm.errors.InconsistentState):
        driven.state(there.mu[-1], there.g[-1])


def test_welds_carry():
    """Two rods welded in one line are one rod of twice the length."""
    rod = lm.joints.Link.rod(1.0, 1.0, 0.02)
    up, down = [0.0, 0.0, 0.5], [0.0, 0.0, -0.5]
    hinge = lm.joints.RevoluteJoint(0, None, up, [0.0] * 3, TURN, TURN, name="hinge")
    two = lm.joints.Linkage([rod, rod], [hinge, lm.joints.FixedJoint(1, 0, up, down, name="weld")])
    across = 2.0 * (rod.inertia[0] + 0.25)
    whole = lm.joints.Link(2.0, [across, across, 2.0 * rod.inertia[2]])
    top = lm.joints.RevoluteJoint(0, None, [0.0, 0.0, 1.0], [0.0] * 3, TURN, TURN, name="hinge")
    one = lm.joints.Linkage([whole], [top])
    runs = [
        lm.integrate(x, lm.LieRATTLE(), x.state(angles={"hinge": 1.0}), h=0.01, steps=5, compiled=False)
        for x in (two, one)
    ]
    a, b = (run.joint("hinge") for run in runs)
    assert np.allclose(a.angle, b.angle, atol=1e-12) and np.allclose(a.reaction, b.reaction, atol=1e-9)
    assert runs[0].joint("weld").moment.any()


def test_refusals():
    rods = lm.joints.chain(2, axis=TURN)
    make = lambda motions: lm.joints.Linkage(rods.links, rods.joints, motions=motions)  # noqa: E731
    shaken = Shaking([0.0, 0.0, 0.1], 9.0)
    for wrong, told in (
        ({0: 3.0}, "is a MovingSupport such as Shaking"),
        ([shaken], "given by joint"),
        ({7: shaken}, "no joint 7"),
        ({None: Swing(0.1, 2.0)}, "the ground moves by a MovingSupport"),
        ({None: shaken, 0: shaken}, "two motions are given for joint 0"),
    ):
        with pytest.raises(lm.errors.LiemechError, match=told):
            make(wrong)
    balls = lm.joints.chain(1)
    with pytest.raises(lm.errors.InvalidInput, match="leaves 3 free"):
        lm.joints.Linkage(balls.links, balls.joints, motions={0: Swing(0.1, 2.0)})
    moved = make({0: shaken})
    with pytest.raises(lm.errors.IncompatibleSystem, match="given motion"):
        plan = lm.Plan(moved, lm.LieRATTLE(), h=0.01, compiled=False)
        plan.tangent(moved.state(angles={}), steps=1)


@pytest.mark.slow
def test_compiled_is_plain():
    shaken = kapitza(0.1, 60.0)
    start = shaken.state(angles={0: 2.8}, rates={0: 0.3})
    other = ends(shaken, lm.RKMK(order=4), start, 100, 0.1, compiled=False)
    near = ends(shaken, lm.Composition(lm.LieRATTLE(), order=4), start, 100, 0.1)
    assert np.abs(other.g[-1] - near.g[-1]).max() < 1e-8  # multipliers of conditions that change
    plain, native = (ends(shaken, lm.LieRATTLE(), start, 20, 0.1, mode) for mode in (False, True))
    assert np.array_equal(plain.g, native.g) and np.array_equal(plain.mu, native.mu)


def test_starts_of_trees_hang_from_the_ground():
    """Angles of a tree are what was asked for, however many bodies and however far they turn."""
    rng = np.random.default_rng(3)
    for links, joints in (
        ((balls := lm.joints.chain(40)).links, balls.joints),
        ((hinges := lm.joints.chain(40, axis=TURN)).links, hinges.joints),
    ):
        tree = lm.joints.Linkage(links, joints)
        free = joints[0].freedoms
        q = {k: rng.uniform(-3.0, 3.0, free) for k in range(40)}
        rates = {k: rng.normal(size=free) for k in range(40)}
        start = tree.state(angles=q, rates=rates)
        c, slips = tree.conditions_at(start.mu, start.g)
        assert np.abs(c).max() < 1e-13 and np.abs(slips).max() < 1e-12
        found = [tree.motion_at(None, k).at.rates(0.0, start.g, tree.velocity(start.mu)) for k in q]
        assert np.allclose(np.array(found), [rates[k] for k in q], atol=1e-11)


@pytest.mark.slow
def test_the_report_has_lines_for_joints_in_given_motions() -> None:
    rods = lm.joints.chain(2, axis=[0.0, 1.0, 0.0])
    motions = {0: lm.joints.Shaking([0.0, 0.0, 0.1], 60.0)}
    shaken = lm.joints.Linkage(rods.links, rods.joints, motions=motions)
    start = shaken.state(angles={0: 3.0, 1: 0.4})
    run = lm.integrate(shaken, lm.LieRATTLE(), start, h=2e-3, steps=30, compiled=False)
    assert set(run.drift()) == {f"joint {k}: {what}" for k in range(2) for what in ("position", "rate")}
    assert str(run.drift()).count("exact") == 4
    off = lm.joints.Linkage(rods.links, rods.joints)  # which does not know of the motion
    assert np.abs(np.array(off.conditions_at(run.mu[-1], run.g[-1])[0])).max() > 1e-3


@pytest.mark.slow
def test_a_given_motion_brings_energy_to_rotors_too():
    """The multipliers of a linkage with rotors see the motion: energy grows by its work, to h^2."""
    rods = lm.joints.chain(3, axis=TURN)
    geared = [*rods.joints[:2], replace(rods.joints[2], armature=0.3)]
    linkage = lm.joints.Linkage(rods.links, geared, motions={0: Swing(0.7, 3.0)})
    start = linkage.state(angles={1: 0.4}, rates={2: 1.0})
    off = []
    for steps in (20, 40):
        run = lm.integrate(linkage, lm.LieRATTLE(), start, h=0.2 / steps, steps=steps, compiled=False)
        off.append(run.energy[-1] - run.energy[0] - run.joint(0).given_work[-1])
    assert abs(off[1]) < 1e-3 and off[0] / off[1] == pytest.approx(4.0, abs=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.LieRATTLE()])
def test_a_damper_at_a_shaken_slider_sees_the_pace_of_its_support(method):
    """A slider on a place that shakes along it: m x'' = -c (x' - a w cos w t), whose solution is closed."""
    m, c, a, w, t_end = 2.0, 3.0, 0.4, 5.0, 0.7
    along = lm.joints.PrismaticJoint(0, None, axis=[1.0, 0.0, 0.0], name="slider")
    system = lm.joints.Linkage(
        [lm.joints.Link(m, [0.1] * 3)],
        [along],
        gravity=0.0,
        forces=[Damper("slider", c)],
        motions={"slider": Shaking([a, 0.0, 0.0], w)},
    )
    k, begun = c / m, 0.2

    def rate(t):
        driven = a * w * k * (k * np.cos(w * t) + w * np.sin(w * t)) / (k * k + w * w)
        return driven + (a * w + begun - a * w * k * k / (k * k + w * w)) * np.exp(-k * t)

    start = system.state(angles={}, rates={"slider": begun})
    errors = []
    for steps in (8, 16):
        run = ends(system, method, start, steps, t_end, compiled=False)
        errors.append(abs(run.mu[-1][3] / m - rate(t_end)))
        told = run.joint("slider")
        assert told.torque == pytest.approx(-c * (run.mu[:, 3] / m - a * w * np.cos(w * run.t)), rel=1e-12)
    assert slope([t_end / 8, t_end / 16], errors) == pytest.approx(method.order, abs=0.3)
    # mu' behind xi, along the slider
    state = system.state(angles={}, rates={"slider": begun}, t=0.11)
    force = float(np.array(system.rate(0.11, state))[6 + 3])
    assert force == pytest.approx(-c * begun, rel=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("h", [0.02, -0.02])
def test_bodies_under_drag_that_follow_a_path(h):
    """A damper at a joint on a path has its work and no say: the motion is that without it, to rounding."""

    @lm.record
    class Drag(lm.Force):
        c: float

        def covector(self, t, xi, g):
            return -self.c * xi

    arm = lm.joints.chain(3, axis=TURN)
    swing, start = {1: Swing(0.4, 3.0)}, {"angles": {0: 0.5, 2: -0.7}, "rates": {0: 1.0, 2: -0.5}}
    ends_at = []
    for forces in ([], [Damper(1, 0.3)]):
        system = lm.joints.Linkage(
            arm.links, arm.joints, forces=forces, load={b: Drag(0.1 * (1 + b)) for b in range(3)}, motions=swing
        )
        run = lm.integrate(system, lm.LieRATTLE(), system.state(**start), h=h, steps=20, compiled=False)
        ends_at.append(run.g[-1])
    assert np.abs(ends_at[0] - ends_at[1]).max() < 1e-12


def test_a_support_works_against_the_motor_of_its_joint():
    """A motor of force F on a slider whose support moves along it by u(t): the support brings in F u'."""
    slider = lm.joints.PrismaticJoint(0, None, axis=[0.0, 0.0, 1.0])
    forces, motions = [lm.joints.Motor(0, 1.5)], {0: Shaking([0.0, 0.0, 0.2], 3.0)}
    led = lm.joints.Linkage([lm.joints.Link(2.0, [0.1, 0.1, 0.1])], [slider], 0.0, forces, motions=motions)
    run = lm.integrate(led, lm.LieRATTLE(), led.state(angles={}), h=0.02, steps=5, compiled=False)
    motion = run.joint(0)
    assert np.allclose(motion.given_power, 1.5 * 0.6 * np.cos(3.0 * run.t), rtol=1e-12)
    assert np.allclose(run.energy - run.energy[0], motion.work + motion.given_work, rtol=0.0, atol=1e-5)


def test_a_path_with_a_corner_is_refused():
    """RKMK went straight on at it, and left the path."""
    two, table = lm.joints.chain(2, axis=TURN), lm.PiecewisePolynomial
    times, values = [0.0, 0.05, 1.0], [0.3, 0.35, 0.3]
    for path, told in (
        (table.linear(times, values), "the slope of the table that joint 0 follows jumps at t = 0.05"),
        (table.linear(times, values, outside="hold"), "the slope of .* jumps at t = 0.05"),
        (table.constant(times, values[:2]), "the value of .* jumps at t = 0.05"),
        (table.cubic(times, values, outside="repeat"), "the slope of .* jumps at t = 0"),
    ):
        with pytest.raises(lm.errors.InvalidInput, match=told):
            lm.joints.Linkage(two.links, two.joints, motions={0: path})
    for path in (
        table.cubic(times, values, outside="hold"),
        table.cubic(times, values, "periodic", outside="repeat"),
        table.linear([0.0, 1.0], [0.3, 0.5]),
    ):
        lm.joints.Linkage(two.links, two.joints, motions={0: path})


@lm.record
class WithoutRates(lm.joints.BallJoint):
    """A ball joint whose place in space moves along e1 by 0.2 sin(3 t); it does not say how fast."""

    t: float = 0.0

    def at_time(self, t):
        """At time t."""
        return replace(self, t=t)

    def value(self, g, k):
        """x_1 - x_2 less the shift."""
        return lm.joints.BallJoint.value(self, g, k) - vec(0.2 * sin(3.0 * self.t), 0.0, 0.0)


@lm.record
class ShakenBall(WithoutRates):
    """It says that."""

    def paces(self, g, k):
        """Less the rate of the shift."""
        return [-0.6 * cos(3.0 * self.t), 0.0, 0.0]


def shaken(kind, **motions):
    """A rod that hangs from a point."""
    return lm.joints.Linkage([lm.joints.Link(1.0, [0.1, 0.1, 0.02])], [kind(0, None, [0.0, 0.0, 0.5])], **motions)


def test_a_joint_of_ones_own_may_move_with_time():
    """It moves as a shaken support does, and is refused without the rates of its conditions."""
    supported = shaken(lm.joints.BallJoint, motions={0: Shaking([0.2, 0.0, 0.0], 3.0)})
    start = supported.state(angles={}, t=0.4)
    steps = {"h": 0.02, "steps": 2, "t0": 0.4, "compiled": False}
    beside = lm.integrate(supported, lm.LieRATTLE(), start, **steps)
    moved = shaken(ShakenBall)
    run = lm.integrate(moved, lm.LieRATTLE(), moved.state(start.mu, start.g, t=0.4), **steps)
    assert np.abs(run.g - beside.g).max() < 1e-14
    half = lm.integrate(moved, lm.LieRATTLE(), moved.state(start.mu, start.g, t=0.4), **steps | {"steps": 1})
    later = lm.integrate(moved, lm.LieRATTLE(), half.last, **steps | {"steps": 1, "t0": half.t[-1]})
    assert np.abs(later.g[-1] - run.g[-1]).max() < 1e-14

    with pytest.raises(lm.errors.NotDefined, match="must define `paces`"):
        shaken(WithoutRates)


def test_starts_are_for_the_time_at_which_a_run_begins():
    """A start made for another time misses the conditions: it was carried along, 7 cm off."""
    led = shaken(lm.joints.BallJoint, motions={0: Shaking([0.2, 0.0, 0.0], 3.0)})
    for made, t0 in (0.0, 0.4), (0.4, 0.0):
        for method in lm.RKMK(order=4), lm.LieRATTLE():
            with pytest.raises(lm.errors.InconsistentState, match="c\\(g\\) must be zero"):
                lm.integrate(led, method, led.state(angles={}, t=made), h=0.02, steps=2, t0=t0, compiled=False)
    plan = lm.Plan(led, lm.LieRATTLE(), h=0.02, compiled=False)
    run = plan.run(led.state(angles={}, t=0.4), steps=2, t0=0.4)
    between = plan.run(led.state(angles={}, t=0.4), steps=2, t0=0.4, t_eval=[0.43])
    assert np.array_equal(run.at([0.43]).g, between.g)


@lm.record
class Rising(lm.Constraint):
    """A point of a body in the plane stays at the height 0.3 sin t."""

    at: lm.Vec
    t: float = 0.0

    def at_time(self, t):
        """At time t."""
        return replace(self, t=t)

    def value(self, g):
        """Its height over that."""
        return vec(g[1, 2] + g[1, 0] * self.at[0] + g[1, 1] * self.at[1] - 0.3 * sin(self.t))

    def paces(self, g):
        """Less the rate of that."""
        return [-0.3 * cos(self.t)]


def test_conditions_of_ones_own_may_change_with_time():
    """They were frozen at t = 0.  The last digits are those of RKMK, which drifts off conditions."""
    free = lm.LiePoissonSystem(lm.SE2(), lm.KineticEnergy([0.5, 1.0, 1.0]))
    body = lm.ConstrainedBody(free, Rising([0.2, 0.1]))
    start = body.at_time(0.4).consistent([0.1, 0.3, 0.2], np.eye(3))
    run = lm.integrate(body, lm.RKMK(order=4), start, h=0.02, steps=10, t0=0.4, compiled=False)
    assert np.allclose(run.g[:, 1, 2] + run.g[:, 1, :2] @ [0.2, 0.1], 0.3 * np.sin(run.t), rtol=0.0, atol=1e-9)
    with pytest.raises(lm.errors.IncompatibleSystem, match="conditions that change with time"):
        lm.integrate(body, lm.LieRATTLE(), start, h=0.02, steps=10, t0=0.4, compiled=False)


@lm.record
class Aside(Swing):
    def coordinates(self, t):
        return 0.1 + self.amplitude * sin(self.frequency * t)


@pytest.mark.slow
def test_implicit_stages_of_bodies_that_cannot_turn():
    """Two sliders, one on a path: torques cancel, and what is left of them, 2e-14 of the forces, did not settle.  The first
    slides by (m0 + m1) (x'' + g s0z) = -m1 (s0 . s1) q1''.
    """
    rng = np.random.default_rng(5)
    along = rng.normal(size=(2, 3))
    along /= np.linalg.norm(along, axis=1)[:, None]
    mass, points = rng.uniform(0.5, 2.0, 2), 0.3 * rng.normal(size=(4, 3))
    sliders = [
        lm.joints.PrismaticJoint(0, None, points[0], points[1], along[0], np.eye(3)),
        lm.joints.PrismaticJoint(1, 0, points[2], points[3], along[1], np.eye(3)),
    ]
    links = [lm.joints.Link(m, [0.05, 0.06, 0.055]) for m in mass]
    system = lm.joints.Linkage(links, sliders, 9.81, motions={1: Aside(0.3, 2.9)})
    start = system.state(angles={0: 0.2}, rates={0: 0.7})
    method = lm.RKMK(tableau=lm.tableaus.gauss(2))
    run = lm.integrate(system, method, start, h=0.02, steps=2, compiled=False)
    share, t = mass[1] / mass.sum() * (along[0] @ along[1]), run.t
    exact = 0.2 + 0.7 * t - 4.905 * along[0, 2] * t**2 - share * 0.3 * (np.sin(2.9 * t) - 2.9 * t)
    assert np.allclose(run.joint(0).angle, exact, rtol=0.0, atol=1e-9)
