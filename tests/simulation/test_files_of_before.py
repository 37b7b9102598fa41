"""Saved runs, checkpoints and pickled plans written before modules were moved: they name classes by the places
of that day, and are read ever after.  `python tests/simulation/test_files_of_before.py` writes those that are missing.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm

FILES = Path(__file__).parent / "old_files" / "format_4"
BODY = lm.RigidBody([1.0, 1.5, 2.0])
MOMENTA = [[0.5, 0.0, 0.75], [0.1, 0.8, 0.2], [0.3, 0.3, -0.6]]


def two_rods() -> tuple[Any, Any]:
    rods = lm.joints.chain(2, mass=0.5, length=0.2, axis=[0.0, 1.0, 0.0])
    rods = lm.joints.Linkage(rods.links, rods.joints, forces=[lm.joints.Damper(0, 0.01), lm.joints.Spring(1, 0.3, 0.2)])
    return rods, rods.state(angles={0: 0.7})


def long_chain() -> tuple[Any, Any]:
    rods = lm.joints.chain(6, mass=0.5, length=0.2)
    return rods, rods.state(angles={0: [0.2, 0.7, 0.0]})


def masses(n: int) -> tuple[Any, Any]:
    free = lm.LiePoissonSystem(lm.VectorSpace(3) ** n, lm.PerSite(lm.KineticEnergy([1.0] * 3)))
    pull = lm.models.Gravity().over(lm.neighbours.all_pairs())
    system = lm.MechanicalSystem(free, lm.Terms(pull, mass=1.0))
    places = [[np.cos(k), np.sin(2.0 * k), 0.3 * k] for k in range(n)]
    return system, system.state(mu=np.zeros((n, 3)), g=places)


def top() -> tuple[Any, Any]:
    system = lm.models.HeavyTop([1.0, 1.0, 0.5], weight=2.0, centre=[0.0, 0.0, 1.0])
    return system, system.state(mu=[0.1, 0.2, 1.5], g=np.eye(3))


def noisy() -> tuple[Any, Any]:
    system = lm.Stochastic(BODY, fields=[[0.5, 0.0, 0.0]], seed=1)
    return system, system.state(mu=MOMENTA)


def pendulum() -> tuple[Any, Any]:
    system = lm.SphericalPendulum(length=1.0)
    return system, system.state(q=[0.6, 0.0, -0.8], p=[0.0, 0.5, 0.0])


FIXED: dict[str, Any] = dict(h=0.05, steps=6, every=2, progress=False, compiled=False)
RUNS: dict[str, tuple[Callable[[], tuple[Any, Any]], Any, dict[str, Any]]] = {
    "body": (lambda: (BODY, BODY.state(MOMENTA[0], np.eye(3))), lm.LiePoissonHamiltonJacobi(order=4), FIXED),
    "variational": (lambda: (BODY, BODY.state(MOMENTA[0], np.eye(3))), lm.CovariantVariational(lm.Cayley()), FIXED),
    "ensemble": (lambda: (BODY, BODY.state(MOMENTA)), lm.RKMK(order=4), FIXED),
    "adaptive": (
        lambda: (BODY, BODY.state(MOMENTA)),
        lm.RKMK(order=5),
        dict(t_end=1.0, rtol=1e-8, progress=False, compiled=False),
    ),
    "top": (top, lm.LieVerlet(), FIXED),
    "few_masses": (lambda: masses(3), lm.KickDrift(), FIXED),
    "many_masses": (lambda: masses(20), lm.RKMK(order=4), FIXED),
    "linkage": (two_rods, lm.LieRATTLE(), FIXED),
    "chain": (long_chain, lm.LieRATTLE(), FIXED | {"h": 0.01}),
    "noise": (noisy, lm.WongZakai(lm.RKMK(order=4)), FIXED),
    "pendulum": (pendulum, lm.RATTLE(), FIXED),
    "poisson": (lambda: (s := lm.models.LotkaVolterra(), s.state([1.0, 0.5])), lm.PoissonEuler(), FIXED),
    "kepler": (lambda: (s := lm.Kepler(), s.state(q=[1.0, 0.0], p=[0.0, 0.9])), lm.StormerVerlet(), FIXED),
}
"""A system with a start, a method and the options of a run, by the name of its file."""


def run_of(name: str, **more: Any) -> Any:
    make, method, options = RUNS[name]
    system, start = make()
    return lm.integrate(system, method, start, **options, **more)


def plan_of(name: str) -> tuple[Any, Any, dict[str, Any]]:
    """A plan, its start, and the options that a run of it takes."""
    make, method, options = RUNS[name]
    system, start = make()
    goal = {key: options[key] for key in ("steps", "t_end") if key in options}
    return lm.Plan(system, method, **{key: options[key] for key in options.keys() - goal.keys()}), start, goal


def assert_same(run: Any, now: Any, rounding: float = 1e-12) -> None:
    assert np.allclose(run.t, now.t, rtol=1e-14)
    for part, values in now.states.items():
        assert np.allclose(run.states[part], values, rtol=rounding, atol=0.1 * rounding), part


@pytest.mark.parametrize("name", RUNS)
def test_a_saved_run_holds_its_samples_and_goes_on(name: str) -> None:
    run, now = lm.Trajectory.load(FILES / f"{name}.npz"), run_of(name)
    assert type(run.system) is type(now.system) and run.method == now.method
    plan, _, goal = plan_of(name)
    close = 1e-6 if plan.adaptive else 1e-12  # the first step was chosen otherwise
    assert_same(run, now, close)
    goal = {key: 2 * value if key == "t_end" else value for key, value in goal.items()}
    assert_same(plan.resume(run, **goal), plan.resume(now, **goal), close)


def test_every_file_loads_whatever_classes_are_called_and_make_of_their_fields_today() -> None:
    for name in RUNS:
        system, start = RUNS[name][0]()
        run = lm.Trajectory.load(FILES / f"{name}.npz")
        assert type(run.system) is type(system)
        for part in run.states.keys() & start.arrays.keys():
            assert np.allclose(np.ravel(run.states[part][0]), np.ravel(start.arrays[part]), rtol=1e-12), (name, part)


def test_a_checkpoint_goes_on() -> None:
    whole, part = run_of("body"), lm.Trajectory.load(FILES / "checkpoint.npz")
    assert_same(part, whole)


@pytest.mark.parametrize("name", ["body", pytest.param("many_masses", marks=pytest.mark.slow), "linkage"])
def test_a_pickled_plan_runs(name: str) -> None:
    plan = pickle.loads((FILES / f"{name}.pickle").read_bytes())
    _, start, goal = plan_of(name)
    assert_same(plan.run(start, **goal), run_of(name))


def write() -> None:
    FILES.mkdir(exist_ok=True)
    for name in RUNS:
        if not (path := FILES / f"{name}.npz").exists():
            run_of(name).save(path)
    if not (path := FILES / "checkpoint.npz").exists():
        run_of("body", checkpoint=path, checkpoint_every="2 steps")
    for name in ("body", "many_masses", "linkage"):
        if not (path := FILES / f"{name}.pickle").exists():
            path.write_bytes(pickle.dumps(plan_of(name)[0]))


if __name__ == "__main__":
    write()
