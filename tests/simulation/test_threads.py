"""Threads that share systems, plans, groups: each run has the bits that it has alone."""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
from terms_of_spins import Exchange

import liemech as lm
from liemech.compiler import kernel
from liemech.formulas import blas
from liemech.systems.potential import Force

pytestmark = pytest.mark.compiled  # plain Python holds the interpreter's lock

THREADS = 4
EYE = np.eye(3)


@pytest.fixture(autouse=True)
def _many_switches():
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-5)
    yield
    sys.setswitchinterval(before)


def numbers(seed, *shape):
    return np.random.default_rng(seed).normal(size=shape)


@lm.record
class Bent(lm.Term):
    k: float

    def energy(self, a, b):
        d = a.q - b.q
        return 0.5 * self.k * lm.dot(d, d) + 0.1 * lm.dot(d, d) * lm.dot(d, d)


@lm.record
class Tie(lm.Term):
    k: float

    def energy(self, a, b):
        d = a.g - b.g
        return 0.5 * self.k * lm.dot(d, d) + 0.1 * lm.dot(d, d) * lm.dot(d, d)


BODY = lm.RigidBody([1.0, 1.5, 2.0])
STARTS = [BODY.state(mu=[0.8, 0.1 * k, 0.2], g=EYE) for k in range(THREADS)]


def of_plan(plan: Any, starts: Any, **how: Any) -> Any:
    """A run of every number, by one plan."""

    def run(k: int) -> Any:
        made = plan.run(starts[k], **how)
        return [made.t, *made.states.values(), *([made.at(0.4 * made.t[-1]).mu] if made.dense is not None else [])]

    return run


def body(method, many=0, **options):
    how = {name: options.pop(name) for name in ("steps", "t_end", "t_eval") if name in options}
    starts = STARTS
    if many:
        starts = [BODY.state(mu=numbers(k, many, 3), g=np.tile(EYE, (many, 1, 1))) for k in range(THREADS)]
    return of_plan(lm.Plan(BODY, method, progress=False, compiled=True, **options), starts, **how)


def upside(t, state):
    return state.g[2, 2]


def spins(n=2000):
    system = lm.LiePoissonSystem(lm.SO3() ** n, lm.Terms(Exchange(1.0).over(lm.neighbours.ring(n))))
    mu = numbers(0, THREADS, n, 3)
    return system, [system.state(mu=x / np.linalg.norm(x, axis=1)[:, None]) for x in mu]


def by_sites(method, steps=20, n=2000, **options):
    system, starts = spins(n)
    given = {"h": 0.05, "every": steps} if "rtol" not in options else {}
    how = {"steps": steps} if "rtol" not in options else {"t_end": 0.5}
    return of_plan(lm.Plan(system, method, progress=False, **given, **options), starts, **how)


def product(of):
    system, starts = spins()
    plan, w = lm.Plan(system, lm.RKMK(order=4), h=0.05, every=10, progress=False), numbers(1, 6000)
    return lambda k: plan.tangent(starts[k], steps=10, **{of: w}).tangent[of][-1]


@lm.record
class Flat(lm.Potential):
    def energy(self, g):
        return 0.0 * g[0, 0]


@lm.record
class Push(Force):
    """A torque that changes with time: gradients of runs from different t0 differ."""

    k: float

    def covector(self, t, xi, g):
        return self.k * lm.vec(1.0, t, 0.0)


def gradient():
    system = lm.MechanicalSystem(BODY, Flat(), load=Push(0.3))
    plan = lm.Plan(system, lm.RKMK(order=4), h=0.01, compiled=True, progress=False)

    def run(k):
        found = plan.gradient(lambda s: s.mu[0] * s.g[0, 1], STARTS[k], steps=400, t0=1.0 * k, by=("start", "k"))
        return [found.value, found["start"], found["k"]]

    return run


def steppers():
    system, starts = spins()
    plans = [lm.Plan(system, lm.RKMK(order=4), h=0.05, progress=False), lm.Plan(BODY, lm.RKMK(order=4), h=0.05)]

    def run(k):
        found = []
        for plan, start in zip(plans, (starts[k], STARTS[k])):
            stepper = plan.stepper(start)
            for _ in range(5):
                stepper.step(4)
            found.append(np.array(stepper.mu))
        return found

    return run


def gravity():
    bodies = lm.models.NBody([1.0] * 400)
    starts = [bodies.state(q=numbers(k, 1200), p=np.zeros(1200)) for k in range(THREADS)]
    return of_plan(lm.Plan(bodies, lm.StormerVerlet(), h=1e-3, every=10, progress=False), starts, steps=10)


def linkage(method):
    system = lm.joints.chain(24)
    starts = [system.state(angles={0: [0.1 * k, 0.6, 0.0], 12: [0.5, 0.0, 0.1 * k]}) for k in range(THREADS)]
    return of_plan(lm.Plan(system, method, h=0.002, every=20, progress=False), starts, steps=20)


def rod():
    section = lm.models.RodSection([1.0, 1.2, 0.8, 30.0, 30.0, 40.0], [0.1, 0.12, 0.2, 1.0, 1.0, 1.0])
    system = lm.models.CosseratRod(section, 1.0, 40, ends=("free", "free"))
    shape = system.shape([0.3, 0.5, 0.2, 0.02, 0.0, 1.02])
    starts = [system.state(mu=0.1 * numbers(k, system.frames, 6), g=shape) for k in range(THREADS)]
    return of_plan(lm.Plan(system, lm.GalerkinVariational(order=2), h=5e-3, progress=False), starts, steps=5)


def large():
    group = lm.SO(10)
    system = lm.LiePoissonSystem(group, lm.KineticEnergy(1.0 + numbers(1, group.dim) ** 2))
    starts = [system.state(mu=numbers(k, group.dim), g=np.eye(10)) for k in range(THREADS)]
    return of_plan(lm.Plan(system, lm.RKMK(order=4), h=0.01, every=20, progress=False), starts, steps=20)


def noise():
    system, starts = spins()
    bath = lm.thermal_bath(system, damping=0.3, temperature=0.5, seed=6)
    return of_plan(lm.Plan(bath, lm.WongZakai(lm.RKMK(order=4)), h=0.05, every=20, progress=False), starts, steps=20)


def species():
    group = lm.SO3() ** 500 * lm.SO3() ** 300
    terms = lm.Terms(
        Exchange(1.0).over(lm.neighbours.ring(500), of=0), Exchange(0.5).over(lm.neighbours.ring(300), of=1)
    )
    system = lm.LiePoissonSystem(group, terms)
    starts = [system.state(mu=[numbers(k, 500, 3), numbers(k + 9, 300, 3)]) for k in range(THREADS)]
    return of_plan(lm.Plan(system, lm.RKMK(order=4), h=0.05, every=20, progress=False), starts, steps=20)


def rows(group):
    """Calls with one row, which native code takes at one place in memory, and with many."""
    xi, many = numbers(0, THREADS, group.dim), numbers(1, THREADS, 500, group.dim)

    def run(k):
        found = [group.exp(xi[k]) for _ in range(300)]
        return [np.array(found), np.array([group.log(g) for g in found]), group.exp(many[k]), group.dexp(xi[k], xi[0])]

    return run


CASES = {
    "a body, fixed steps": (lambda: body(lm.RKMK(order=4), h=0.01, steps=2000), True),
    "a body, implicit steps": (lambda: body(lm.ImplicitMidpoint(), h=0.01, steps=500), False),
    "a body, adaptive": (lambda: body(lm.RKMK(order=5), rtol=1e-9, t_end=20.0), True),
    "a body, dense": (lambda: body(lm.RKMK(order=5), rtol=1e-9, dense=True, t_end=20.0), False),
    "a body, times": (lambda: body(lm.RKMK(order=5), rtol=1e-9, t_end=9.0, t_eval=np.linspace(0.0, 9.0, 50)), False),
    "a body, Taylor": (lambda: body(lm.Taylor(order=8), h=0.05, steps=200), False),
    "a body, events": (lambda: body(lm.RKMK(order=5), rtol=1e-9, events=upside, t_end=20.0), False),
    "an ensemble": (lambda: body(lm.RKMK(order=4), many=50, h=0.01, steps=300), True),
    "an ensemble, two workers": (lambda: body(lm.RKMK(order=4), many=50, h=0.01, steps=300, workers=2), False),
    "an ensemble, adaptive": (lambda: body(lm.RKMK(order=5), many=20, rtol=1e-8, t_end=5.0), False),
    "spins by RKMK": (lambda: by_sites(lm.RKMK(order=4)), True),
    "spins by RKMK, two workers": (lambda: by_sites(lm.RKMK(order=4), n=40000, steps=4, workers=2), False),
    "spins, adaptive": (lambda: by_sites(lm.RKMK(order=5), rtol=1e-6), False),
    "spins, implicit": (lambda: by_sites(lm.SphericalMidpoint(), n=300), False),
    "spins by colours": (lambda: by_sites(lm.SublatticeSplitting(order=2)), False),
    "spins by bonds": (lambda: by_sites(lm.BondSplitting(order=2)), False),
    "J v": (lambda: product("along"), False),
    "J^T w": (lambda: product("against"), False),
    "gradients": (gradient, False),
    "steppers": (steppers, True),
    "gravity": (gravity, False),
    "a linkage, LieRATTLE": (lambda: linkage(lm.LieRATTLE()), False),
    "a linkage, RKMK": (lambda: linkage(lm.RKMK(order=4)), False),
    "a linkage, Taylor": (lambda: linkage(lm.Taylor(order=6)), False),
    "a rod": (rod, False),
    "large matrices": (large, False),
    "noise": (noise, False),
    "species": (species, False),
    "rows of SO(3)": (lambda: rows(lm.SO3()), True),
    "rows of SE(3)": (lambda: rows(lm.SE3()), False),
}


@pytest.mark.parametrize(
    "name", [name if quick else pytest.param(name, marks=pytest.mark.slow) for name, (_, quick) in CASES.items()]
)
def test_runs_in_threads_have_the_bits_of_runs_alone(name: str) -> None:
    run = CASES[name][0]()
    alone = [run(k) for k in range(THREADS)]
    for _ in range(5):
        found: list[Any] = [None] * THREADS
        together = threading.Barrier(THREADS)

        def work(k: int, found: Any = found, together: Any = together) -> None:
            together.wait()
            try:
                found[k] = run(k)
            except BaseException as error:
                found[k] = error

        threads = [threading.Thread(target=work, args=(k,)) for k in range(THREADS)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        for k in range(THREADS):
            if isinstance(found[k], BaseException):
                raise found[k]
            for x, y in zip(found[k], alone[k], strict=True):
                np.testing.assert_array_equal(x, y)


@pytest.mark.slow
def test_two_calls_at_once_have_two_scratch_memories() -> None:
    system, starts = spins(100)
    plan = lm.Plan(system, lm.RKMK(order=4), h=0.05, compiled=True, progress=False)
    plan.run(starts[0], steps=2)
    (shape,) = plan._sites.known.values()
    execution = shape.stepping.of_a_run()
    with execution.on_sites(100, 100) as one, shape.stepping.on_sites(100, 100) as other:
        assert one is not None and other is not None
        assert not np.shares_memory(one.scratch, other.scratch)
    with execution.on_sites(100, 100) as again:
        assert again in (one, other)  # nothing is made anew


FACTOR = 1.0


@lm.record
class Own(lm.Hamiltonian):
    k: float

    def energy(self, mu):
        return self.k * FACTOR * mu[0] * mu[0] + 0.3 * mu[1] * mu[1]


@lm.record
class Fitting(lm.Term):
    J: float

    def energy(self, a, b):
        return -self.J * FACTOR * lm.dot(a.mu, b.mu)


def one_body():
    system = lm.LiePoissonSystem(lm.SO3(), Own(1.3))
    return system, system.state(mu=[0.8, 0.1, 0.2])


def some_bodies():
    system = lm.LiePoissonSystem(lm.SO3(), Own(1.3))
    return system, system.state(mu=numbers(0, 5, 3))


def many_sites():
    system = lm.LiePoissonSystem(lm.SO3() ** 40, lm.Terms(Fitting(1.0).over(lm.neighbours.ring(40))))
    return system, system.state(mu=numbers(0, 40, 3))


RKMK, COLOURS = lm.RKMK(order=4), lm.SublatticeSplitting(order=2)


@pytest.mark.parametrize(
    "make, method", [(one_body, RKMK), (some_bodies, RKMK), (many_sites, RKMK), (many_sites, COLOURS)]
)
def test_a_stepper_keeps_its_formulas_while_the_plan_runs_with_others(make, method, monkeypatch) -> None:
    """What formulas read counts as it was when the stepper was made."""
    system, start = make()
    plan = lm.Plan(system, method, h=0.05, compiled=True, progress=False)
    plan.run(start, steps=4)
    expected = plan.run(start, steps=6).mu[-1]
    stepper = plan.stepper(start)
    stepper.step(3)
    monkeypatch.setattr(sys.modules[__name__], "FACTOR", 3.0)
    other = plan.run(start, steps=6).mu[-1]
    stepper.step(3)
    np.testing.assert_array_equal(stepper.mu, expected)
    assert np.abs(other - expected).max() > 1e-3


def test_blas_stays_on_one_thread_until_the_last_caller_is_done() -> None:
    functions = blas._threads()
    if functions is None:
        pytest.skip("no OpenBLAS")
    count, set_count = functions
    before = count()
    set_count(2)
    try:
        if count() != 2:
            pytest.skip("OpenBLAS with one thread")
        with contextlib.ExitStack() as first, contextlib.ExitStack() as second:
            first.enter_context(blas.one_thread())
            second.enter_context(blas.one_thread())
            first.close()
            assert count() == 1
            second.close()
            assert count() == 2
    finally:
        set_count(before)


def test_threads_ask_for_native_code_where_llvmlite_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    """All at once, while an import fails: none sees half a module."""
    from liemech import compiler

    class Missing:
        """A search for modules that takes its time and finds no llvmlite."""

        @staticmethod
        def find_spec(name: str, *_: Any) -> None:
            if name == "llvmlite":
                time.sleep(1e-3)
                raise ModuleNotFoundError(name=name)

    for name in [n for n in sys.modules if n.split(".")[0] == "llvmlite" or n == "liemech.compiler.machine.llvm"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.delattr(compiler, "llvm", raising=False)
    monkeypatch.setattr(sys, "meta_path", [Missing, *sys.meta_path])
    with ThreadPoolExecutor(8) as pool:
        answers = list(pool.map(lambda _: kernel.available(), range(400)))
    assert set(answers) == {"llvmlite is not installed"}
