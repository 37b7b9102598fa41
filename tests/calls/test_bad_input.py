"""Bad input at the border: an error at once, that names the argument, the value and the cure;
nothing hangs, nothing is NaN.
"""

from __future__ import annotations

import math
import time
import tracemalloc
import warnings
from collections.abc import Callable, Iterator
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from scenes import CAYLEY, EXP, METHODS, RKMK4
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech.errors import InvalidInput

NAN, INF = math.nan, math.inf
BODY = lm.RigidBody([1.0, 1.6, 2.3])
START = BODY.state([0.3, 0.4, 0.5], np.eye(3))
G = lm.SO3()
value, kind = lm.errors.InvalidInput, lm.errors.InvalidType


@pytest.fixture(autouse=True)
def no_warnings() -> Iterator[None]:
    """NumPy must find nothing to complain about on the way to our complaint."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def refused(error: type[Exception], words: str, call: Callable[[], object]) -> None:
    """The call fails with this error, in less than a second of work, and allocates nothing large (a module
    may be loaded).
    """
    tracemalloc.start()
    begun = time.thread_time()
    try:
        with pytest.raises(error, match=words) as caught:
            call()
        assert time.thread_time() - begun < 1.0
        assert tracemalloc.get_traced_memory()[1] < 2**24
    finally:
        tracemalloc.stop()
    assert type(caught.value) is error
    assert isinstance(caught.value, lm.errors.LiemechError)
    assert isinstance(caught.value, TypeError if error is kind else ValueError)


def go(**options: object) -> lm.Trajectory:
    system, method, start = (options.pop(k, v) for k, v in (("system", BODY), ("method", RKMK4), ("start", START)))
    return lm.integrate(system, method, start, **{"h": 0.1, "steps": 3} | options)


# ---------------------------------------------------------------- integrate


STEPS = [
    (value, "h must be finite; got nan", dict(h=NAN)),
    (value, "h must be finite; got inf", dict(h=INF)),
    (value, "h must be finite; got -inf", dict(h=-INF)),
    (value, "h = 0 is no step", dict(h=0)),
    (value, "h = 0 is no step", dict(h=0.0)),
    (value, "h = -0 is no step", dict(h=-0.0)),
    (value, "h = .*e-324 is no step.*1/h overflows", dict(h=5e-324)),
    (value, "h = 1e-17 is lost beside t = 1.*smallest useful step there is 2.2e-16", dict(h=1e-17, t0=1.0)),
    (value, r"h = 0.1 is lost beside t = 1e\+20", dict(t0=1e20)),
    (value, "t0 must be finite; got nan", dict(t0=NAN)),
    (value, "lead to t = inf", dict(h=1e308, steps=10)),
    (kind, "h must be a number; got '0.1'", dict(h="0.1")),
    (value, "give h and steps.*or t_end", dict(h=None)),
    (kind, "h must be a number; got True", dict(h=True)),
    (kind, "h must be a number", dict(h=np.True_)),
    (kind, "h must be a number", dict(h=0.1 + 0j)),
    (kind, "h must be a number", dict(h=b"0.1")),
    (kind, "h must be a number", dict(h=[0.1])),
    (kind, "h must be a number", dict(h=np.array([0.1]))),
    (value, "steps must be at least 0.*got -1", dict(steps=-1)),
    (value, r"at most 2\*\*53", dict(steps=10**30)),
    (kind, "steps must be a whole number; got 2.5", dict(steps=2.5)),
    (kind, "steps must be a whole number; got 2.0", dict(steps=2.0)),
    (kind, "steps must be a whole number; got True", dict(steps=True)),
    (kind, "steps must be a whole number; got '10'", dict(steps="10")),
    (value, "give h and steps.*or t_end", dict(steps=None)),
    (value, "every must be at least 1.*got 0", dict(every=0)),
    (value, "every must be at least 1.*got -3", dict(every=-3)),
    (kind, "every must be a whole number; got 2.0", dict(every=2.0)),
    (value, "workers must be at least 1.*got 0", dict(workers=0)),
    (kind, "workers must be a whole number", dict(workers="2")),
    (kind, "compiled must be True, False or None; got 'yes'", dict(compiled="yes")),
    (kind, "progress must be True, False or None; got 'bar'", dict(progress="bar")),
    (value, 'record is .*"mu".*got .*enrgy', dict(record=("mu", "enrgy"))),
    (value, "record is .*got .*'g'", dict(record=("g",))),
    (value, "record is", dict(record=())),
    (kind, "record is .*got 5", dict(record=5)),
    (value, "record asks for g, but the start has none", dict(record=("mu", "g"), start=BODY.state([1, 2, 3]))),
    (kind, "method must be a method such as RKMK.*got 'RK4'", dict(method="RK4")),
    (kind, r"write RKMK\(\.\.\.\), with the brackets", dict(method=lm.RKMK)),
    (kind, "method must be a method .*got BodyState", dict(method=START, start=RKMK4)),
    (kind, "system and method are swapped", dict(system=RKMK4, method=BODY)),
    (kind, "system must be a system .*got <class", dict(system=lm.RigidBody)),
    (kind, "system must be a system .*got None", dict(system=None)),
    (kind, r"start must come from system.state\(.*got list", dict(start=[1.0, 2.0, 3.0])),
    (kind, r"start must come from system.state\(.*got ndarray", dict(start=np.ones(3))),
    (kind, "start must come from .*got NoneType", dict(start=None)),
    (value, r"mu\[1\] is nan", dict(start=lm.BodyState([1.0, NAN, 2.0]))),
]


@pytest.mark.parametrize(("error", "words", "options"), STEPS, ids=[str(o) for *_, o in STEPS])
def test_calls_that_cannot_be_meant(error: type[Exception], words: str, options: dict) -> None:
    refused(error, words, lambda: go(**options))


@pytest.mark.parametrize("every", [1, 3])
def test_more_samples_than_memory(every: int) -> None:
    refused(
        value, r"need .* GiB .*this machine has .*larger `every`", lambda: go(steps=10**12, every=every, compiled=False)
    )


def test_a_method_that_needs_more_than_the_system_has() -> None:
    @lm.record
    class Linear(lm.Hamiltonian):
        """Its velocity does not depend on the momentum: there is no Lagrangian."""

        def energy(self, mu: lm.Vec) -> float:
            return mu[0]

        def gradient(self, mu: lm.Vec) -> lm.Vec:
            return lm.vec(1.0, 0.0, 0.0)

    system = lm.LiePoissonSystem(G, Linear())
    with pytest.raises(lm.errors.IncompatibleSystem, match=r"needs a system with a lagrangian.*RKMK accepts every"):
        lm.integrate(system, EXP, system.state([1, 2, 3]), h=0.1, steps=1)


def test_what_can_be_meant_is_taken() -> None:
    """Numbers of any real kind, negative steps, no steps at all, lists in a state, a start from another object."""
    for h in (np.float32(0.5), np.array(0.5), np.int64(1), 1, -0.5):
        assert go(h=h, steps=np.int32(2)).t[-1] == 2 * float(h)
    assert len(go(steps=0)) == 1
    assert go(start=lm.BodyState([1, 2, 3])).g is None
    with pytest.raises(kind):
        go(h=Fraction(1, 2))


# ---------------------------------------------------------------- states


ROTATION = Rotation.from_rotvec([0.1, 0.2, 0.3])
MOMENTA = [
    (value, r"mu\[0\] is nan", [NAN, 0, 0]),
    (value, r"mu\[2\] is -inf", [0, 0, -INF]),
    (value, r"mu\[1, 2\] is nan", [[1, 2, 3], [1, 2, NAN]]),
    (value, r"mu has shape \(2,\).*shape \(3,\), .* \(bodies, 3\)", [1, 2]),
    (value, r"mu has shape \(\)", 3.0),
    (value, r"mu has shape \(3, 1\)", [[1], [2], [3]]),
    (value, r"mu has shape \(0, 3\).*at least one body", np.empty((0, 3))),
    (value, r"mu has shape \(2, 2, 3\)", np.ones((2, 2, 3))),
    (value, "ragged", [[1, 2, 3], [1, 2]]),
    (value, "masked", np.ma.array([1.0, 2.0, 3.0], mask=[0, 1, 0])),
    (kind, "mu must be real numbers; got dtype", "abc"),
    (kind, "mu must be real numbers; got dtype", ["1", "2", "3"]),
    (value, "give mu, the momentum, or xi, the velocity", None),
    (kind, "mu must be real numbers; got dtype bool", [True, False, True]),
    (kind, "mu must be real numbers; got dtype complex", [1j, 0, 0]),
]
ELEMENTS = [
    (value, "g is not in SO3.*reflection", -np.eye(3)),
    (value, "g is not in SO3.*reflection", np.diag([1.0, 1.0, -1.0])),
    (value, "g is not in SO3.*differs from the unit matrix by 3.0e", 2 * np.eye(3)),
    (value, "g is not in SO3.*by 2.0e-05, more than 1e-06", np.eye(3) + 1e-5),
    (value, "g is not in SO3", np.zeros((3, 3))),
    (value, "g is not in SO3", 1e200 * np.eye(3)),
    (value, r"g\[0, 1\] is nan", [[1, NAN, 0], [0, 1, 0], [0, 0, 1]]),
    (value, r"g has shape \(3, 2\).*shape \(3, 3\)", np.zeros((3, 2))),
    (value, r"g has shape \(4,\)", [0.0, 0.0, 0.0, 1.0]),
    (value, r"g has shape \(4, 4\)", np.eye(4)),
    (value, r"g has shape \(0, 3, 3\).*at least one body", np.empty((0, 3, 3))),
    (value, "ragged", [[1, 0], [1]]),
    (kind, "g must be real numbers", "identity"),
    (kind, "g must be real numbers", 1j * np.eye(3)),
]


@pytest.mark.parametrize(("error", "words", "mu"), MOMENTA)
def test_momenta(error: type[Exception], words: str, mu: object) -> None:
    refused(error, "RigidBody.state: .*" + words, lambda: BODY.state(mu))


@pytest.mark.parametrize(("error", "words", "g"), ELEMENTS)
def test_attitudes(error: type[Exception], words: str, g: object) -> None:
    refused(error, "RigidBody.state: .*" + words, lambda: BODY.state([1, 2, 3], g))


def test_momenta_and_attitudes_that_do_not_fit() -> None:
    refused(value, "2 momenta and 3 group elements", lambda: BODY.state(np.ones((2, 3)), np.stack([np.eye(3)] * 3)))
    refused(
        value, r"g\[1\] is not in SO3.*reflection", lambda: BODY.state([1, 2, 3], np.stack([np.eye(3), -np.eye(3)]))
    )


def test_states_that_can_be_meant() -> None:
    """Rounding errors in a rotation are kept as they are, never repaired; SciPy's rotations are
    taken; one attitude serves all.
    """
    nearly = np.eye(3) + 1e-10
    assert np.array_equal(BODY.state([1, 2, 3], nearly).g, nearly)
    assert np.array_equal(BODY.state([1, 2, 3], ROTATION).g, ROTATION.as_matrix())
    flipped = Rotation.from_quat(-ROTATION.as_quat())
    assert np.allclose(BODY.state([1, 2, 3], flipped).g, ROTATION.as_matrix(), atol=1e-16)
    assert BODY.state(np.ones((4, 3)), np.eye(3)).g.shape == (4, 3, 3)
    assert BODY.state([1, 2, 3], np.stack([np.eye(3)] * 4)).mu.shape == (4, 3)


# ---------------------------------------------------------------- bodies and methods


INERTIAS = [
    (value, "principal moment -1; all must be positive", [-1, 1, 1]),
    (value, "principal moment 0; all must be positive", [0, 1, 1]),
    (
        value,
        "principal moment 0.*up to rounding; all must be positive|principal moment 0;",
        [[1, 1, 0], [1, 1, 0], [0, 0, 1]],
    ),
    (value, "zero up to rounding", [[2, 1, 0], [1, 2, 0], [0, 0, 1e-17]]),
    (value, "principal moment -1", [[1, 2, 0], [2, 1, 0], [0, 0, 1]]),
    (value, "not symmetric: .* differ by 1.0e-06", [[1, 1e-6, 0], [0, 1, 0], [0, 0, 1]]),
    (value, "three principal moments or a 3x3 matrix", 5.0),
    (value, r"shape \(2,\)", [1, 2]),
    (value, r"shape \(1, 3\)", [[1, 2, 3]]),
    (value, r"shape \(3, 1\)", [[1], [2], [3]]),
    (value, r"inertia\[1\] is nan", [1, NAN, 1]),
    (value, r"inertia\[0, 0\] is inf", np.diag([INF, 1, 1])),
    (value, "inverses must not overflow", [1e-310, 1e-310, 1e-310]),
    (kind, "real numbers; got dtype complex", [1 + 0j, 1, 1]),
    (kind, "real numbers", "steel"),
    (kind, "real numbers; got dtype object", None),
]


@pytest.mark.parametrize(("error", "words", "inertia"), INERTIAS)
def test_inertias(error: type[Exception], words: str, inertia: object) -> None:
    refused(error, "RigidBody: .*" + words, lambda: lm.RigidBody(inertia))


def test_extreme_inertias_that_can_be_meant() -> None:
    for unit in (1e-300, 1e-46, 1e40, 1e307):
        assert np.array(lm.RigidBody(unit * np.array([1.0, 1.6, 2.3])).inertia)[0] == unit
        lm.RigidBody(unit * np.array([[1.0, 0.1, 0.0], [0.1, 1.6, 0.0], [0.0, 0.0, 2.3]]))


def test_exact_motion() -> None:
    refused(value, "RigidBody.exact: t must be finite; got nan", lambda: BODY.exact(START, NAN))
    refused(value, "RigidBody.exact: t must be finite; got inf", lambda: BODY.exact(START, [0.0, INF]))
    refused(value, r"row of times; got shape \(2, 2\)", lambda: BODY.exact(START, np.ones((2, 2))))
    refused(kind, "RigidBody.exact: t must be real numbers", lambda: BODY.exact(START, "noon"))
    refused(kind, "RigidBody.exact: start must come from body.state", lambda: BODY.exact([1, 2, 3], 1.0))
    refused(value, "one body at a time", lambda: BODY.exact(BODY.state(np.ones((2, 3))), 1.0))
    refused(kind, "RigidBody.period: start must come from body.state", lambda: BODY.period(np.ones(3)))
    refused(value, "one body at a time", lambda: BODY.period(BODY.state(np.ones((2, 3)))))


METHOD_OPTIONS = [
    (value, r"order is one of \[1, 2, 3, 4, 5, 6, 7, 8\], or give a tableau; got 9", lambda: lm.RKMK(order=9)),
    (value, "order is one of .*; got '4'", lambda: lm.RKMK(order="4")),  # type: ignore[arg-type]
    (value, r"order is one of .*; got 2\.0", lambda: lm.RKMK(order=2.0)),  # type: ignore[arg-type]
    (value, "order is one of .*; got True", lambda: lm.RKMK(order=True)),
    (kind, "tableau must be a ButcherTableau; got 3", lambda: lm.RKMK(tableau=3)),  # type: ignore[arg-type]
    (kind, "retraction must be Exponential.*got <class", lambda: lm.RKMK(retraction=lm.Cayley)),  # type: ignore[arg-type]
    (value, "from 0 to 12 .*got -1", lambda: lm.RKMK(truncation=-1)),
    (value, "from 0 to 12 .*got 13", lambda: lm.RKMK(truncation=13)),
    (value, "from 0 to 12 .*got 2.0", lambda: lm.RKMK(truncation=2.0)),  # type: ignore[arg-type]
    (value, "from 0 to 12 .*got 'all'", lambda: lm.RKMK(truncation="all")),
    (value, "no series to cut; leave truncation out", lambda: lm.RKMK(truncation=2, retraction=lm.Cayley())),
    (kind, "retraction must be Exponential.*got <class", lambda: lm.CovariantVariational(lm.Cayley)),  # type: ignore[arg-type]
    (kind, "retraction must be Exponential.*got 'cay'", lambda: lm.CovariantVariational("cay")),  # type: ignore[arg-type]
]


@pytest.mark.parametrize(("error", "words", "call"), METHOD_OPTIONS)
def test_methods(error: type[Exception], words: str, call: Callable[[], object]) -> None:
    refused(error, words, call)


# ---------------------------------------------------------------- geometry on arrays


XI, MU, R = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0]), ROTATION.as_matrix()
GEOMETRY = [
    (value, r"SO3.exp: xi has shape \(2,\); its last axes must be \(3,\)", lambda: G.exp([1, 2])),
    (value, r"SO3.exp: xi has shape \(\)", lambda: G.exp(np.array(1.0))),
    (value, r"SO3.exp: xi\[0\] is inf", lambda: G.exp([INF, 0, 0])),
    (value, r"SO3.exp: xi\[1, 2\] is nan", lambda: G.exp([[1, 2, 3], [1, 2, NAN]])),
    (value, "SO3.exp has no finite value at xi = .1e.200", lambda: G.exp([1e200, 0, 0])),
    (value, "ragged", lambda: G.exp([[1, 2, 3], [1]])),
    (kind, "SO3.exp: xi must be real numbers; got dtype", lambda: G.exp(["1", "2", "3"])),
    (kind, "SO3.exp: xi must be real numbers; got dtype bool", lambda: G.exp([True, False, True])),
    (kind, "SO3.exp: xi must be real numbers; got dtype complex", lambda: G.exp(np.array([1j, 0, 0]))),
    (kind, "SO3.exp: xi must be real numbers; got dtype object", lambda: G.exp(np.array([1, None, 0]))),
    (value, "SO3.log: g is not in SO3.*reflection", lambda: G.log(-np.eye(3))),
    (value, "SO3.log: g is not in SO3.*unit matrix by 3.0e", lambda: G.log(2 * np.eye(3))),
    (value, "SO3.log: g is not in SO3", lambda: G.log(np.zeros((3, 3)))),
    (value, r"SO3.log: g\[0, 0\] is nan", lambda: G.log(np.full((3, 3), NAN))),
    (value, r"SO3.log: g has shape \(3, 2\); its last axes must be \(3, 3\)", lambda: G.log(np.ones((3, 2)))),
    (value, "SO3.quaternion: g is not in SO3", lambda: G.quaternion(2 * np.eye(3))),
    (
        lm.errors.OutsideChart,
        "the Cayley map cannot represent it.*use log",
        lambda: G.cayley_inv(np.diag([1.0, -1.0, -1.0])),
    ),
    (value, "SO3.cayley_inv: g is not in SO3.*reflection", lambda: G.cayley_inv(-R)),
    (value, 'SO3.dexp: side is "right" or "left"; got \'up\'', lambda: G.dexp(XI, MU, "up")),
    (value, 'SO3.dexp_inv: side is "right" or "left"', lambda: G.dexp_inv(XI, MU, side=None)),  # type: ignore[arg-type]
    (value, "leading axes .* do not broadcast", lambda: G.ad(np.ones((4, 3)), np.ones((5, 3)))),
    (value, r"SO3.Ad: g has shape", lambda: G.Ad(XI, XI)),
    (value, r"CoadjointAction.K: g has shape", lambda: lm.coadjoint(G).K(np.ones(4), MU)),
    (value, r"RigidBody.energy: mu has shape \(2,\)", lambda: BODY.energy([1, 2])),
    (value, r"Exponential.tau: xi has shape \(2,\)", lambda: lm.Exponential().tau(G, np.ones(2))),
    (value, "Cayley.tau_inv: g is not in SO3", lambda: lm.Cayley().tau_inv(G, -R)),
    (value, r"SO3Algebra.hat: xi has shape \(4,\)", lambda: G.algebra.hat(np.ones(4))),
]


@pytest.mark.parametrize(("error", "words", "call"), GEOMETRY)
def test_geometry(error: type[Exception], words: str, call: Callable[[], object]) -> None:
    refused(error, words, call)


def test_tuples_are_arrays_like_lists() -> None:
    for given in (XI, XI.tolist(), tuple(XI), lm.Vec.of(XI)):
        assert np.array_equal(G.exp(given), G.exp(XI))
        assert np.array_equal(BODY.energy(given), BODY.energy(XI))


@pytest.mark.parametrize("method", METHODS, ids=lambda m: m.name)
def test_every_error_of_a_run_is_one_of_ours(method: lm.Method) -> None:
    warnings.simplefilter("ignore", lm.errors.StepWarning)
    for mu in ([1e200, 1.0, 1.0], [1e5, -1e5, 1e5]):
        try:
            lm.integrate(BODY, method, BODY.state(mu), h=1.0, steps=3)
        except lm.errors.IntegrationFailure as failure:
            assert np.isfinite(failure.trajectory.mu).all()
    assert CAYLEY in METHODS


XI6 = lm.SE3().log(lm.SE3().exp(lm.vec(0.1, 0.2, 0.3, 1.0, 2.0, 3.0)))
CASES: dict[str, Any] = {
    "SO3.exp: xi": lambda: lm.SO3().exp(XI6),
    "GL.cayley: xi": lambda: lm.GL(2).cayley(lm.vec(1.0, 1.0, 1.0, 1.0, 1.0)),
    "SO3Algebra.bracket: eta": lambda: lm.SO3().algebra.bracket(lm.vec(1.0, 2.0, 3.0), XI6),
    "SO3.Ad: g": lambda: lm.SO3().Ad(lm.SE3().identity(), lm.vec(1.0, 2.0, 3.0)),
    "Exponential.tau: xi": lambda: lm.Exponential().tau(lm.SO3(), XI6),
}


@pytest.mark.parametrize("where", CASES)
def test_they_are_refused_by_name(where: str) -> None:
    with pytest.raises(InvalidInput, match=where.replace(".", r"\.") + r" has shape .* must be"):
        CASES[where]()


@lm.record
class Circling(lm.HomogeneousEquation):
    """A point on a sphere."""

    def velocity(self, t: float, x: lm.Vec) -> lm.Vec:
        return lm.vec(x[1], x[2], 1.0)


def test_points_too_far_off_for_a_float_are_refused_by_the_state() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"Circling\.state: x is no point of SphereAction"):
        Circling(lm.actions.SphereAction(lm.SO3())).state(x=[1e308] * 3)


@pytest.mark.parametrize("mu", [[[1.0, 2.0], [1.0]], [1.0, 2.0], [float("nan")] * 4, "abc"], ids=str)
def test_groups_without_further_invariants_refuse_what_is_no_momentum(mu: object) -> None:
    assert lm.GL(2).further_invariants([1.0, 2.0, 3.0, 4.0]) is None
    with pytest.raises((lm.errors.InvalidInput, lm.errors.InvalidType), match=r"GL.*further_invariants: mu"):
        lm.GL(2).further_invariants(mu)


def test_momenta_that_leave_the_range_of_floats_are_refused_in_the_name_of_what_was_called() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"random_on_orbit: SE3\.K has no finite value"):
        lm.coadjoint(lm.SE3()).random_on_orbit([1e308] * 6, rng=5)


def short_run(system: lm.System, start: lm.State) -> lm.Trajectory:
    return lm.integrate(system, lm.RKMK(order=4), start, h=0.1, steps=2, compiled=False)


def test_casimirs_of_a_top() -> None:
    top = lm.models.HeavyTop([1.0, 1.5, 2.0], 1.0, [0.0, 0.0, 1.0])
    run = short_run(top, top.state([0.1, 0.2, 0.3], np.eye(3)))
    with pytest.raises(
        lm.errors.InvalidInput, match=r"Trajectory\.casimirs: HeavyTop.* free bodies .*`run\.drift\(\)` names"
    ):
        run.casimirs  # noqa: B018


def test_rotations_of_every_kind() -> None:
    """Quaternions and matrices turn alike; of a top the configuration counts, and a motion of the
    plane is no rotation of space.
    """
    mu, energy = [0.1, 0.2, 0.3], lm.KineticEnergy([1.0, 2.0, 3.0])
    matrices = lm.LiePoissonSystem(lm.SO3(), energy)
    quaternions = lm.LiePoissonSystem(lm.UnitQuaternions(), energy)
    expected = short_run(matrices, matrices.state(mu, np.eye(3))).rotation.as_matrix()
    found = short_run(quaternions, quaternions.state(mu, [0.0, 0.0, 0.0, 1.0])).rotation.as_matrix()
    assert np.abs(found - expected).max() <= 1e-15
    top = lm.models.HeavyTop([1.0, 2.0, 3.0], 0.0, [0.0, 0.0, 1.0])
    assert np.abs(short_run(top, top.state(mu, np.eye(3))).rotation.as_matrix() - expected).max() <= 1e-15
    plane = lm.LiePoissonSystem(lm.SE2(), energy)
    with pytest.raises(lm.errors.InvalidInput, match=r"rotations of space, which elements of SE2\(\) are not"):
        short_run(plane, plane.state(mu, lm.SE2().exp([0.1, 1.0, 2.0]))).rotation  # noqa: B018


def test_a_closed_form_in_the_wrong_class() -> None:
    """dexp depends on the algebra alone; in the class of the group no method would find it."""
    with pytest.raises(lm.errors.InvalidType, match=r"Misplaced\.dexp.*class of the algebra"):

        class Misplaced(lm.SO3):
            def dexp(self, xi: lm.Vec, eta: lm.Vec) -> lm.Vec:  # type: ignore[misc]
                return eta


def test_a_differential_with_a_side_is_refused() -> None:
    """Formulas are left-trivialised; one with a side stems from a time when they were not."""
    with pytest.raises(lm.errors.InvalidType, match=r"Sided\.dexp_inv takes `side`.*at -xi"):

        class Sided(type(lm.SO3().algebra)):  # type: ignore[misc]
            def dexp_inv(self, xi, eta, side="right"):  # type: ignore[no-untyped-def]
                return eta

    with pytest.raises(lm.errors.InvalidType, match=r"Sided\.dtau takes `side`"):

        class Sided(lm.Retraction):  # type: ignore[no-redef]
            def dtau(self, group, xi, eta, side="right"):  # type: ignore[no-untyped-def]
                return eta


def test_nothing_to_compose() -> None:
    with pytest.raises(lm.errors.InvalidInput, match=r"ExactFreeBody\(\) is exact; there is no error"):
        lm.Composition(lm.ExactFreeBody(), order=4)
