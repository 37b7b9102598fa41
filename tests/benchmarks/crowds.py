"""Ensembles of free bodies on the leader board: nanoseconds of a step, and time to error with equal
and with different inertia.

`leader_board.py` calls `measure`.  One thread everywhere.
"""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from races import body_attitude, matrices, turning

import liemech as lm
from liemech.tableaus import DOP853

MOMENTS = np.array([1.0, 1.5, 2.0])
END, BODIES, CHECKED, GOAL = 20.0, 256, 8, 1e-9
STEP = 0.1
Run = Callable[[], Any]


def starts(n: int) -> np.ndarray:
    """Momenta of length one, (n, 3)."""
    mu = np.random.default_rng(3).normal(size=(n, 3))
    return np.asarray(mu / np.linalg.norm(mu, axis=1)[:, None])


def inertias(n: int, different: bool) -> np.ndarray:
    """(n, 3): the same moments, or moments that differ by up to a tenth."""
    change = np.random.default_rng(4).uniform(-0.05, 0.05, size=(n, 3)) if different else np.zeros((n, 3))
    return np.asarray(MOMENTS * (1.0 + change))


def measure(quick: bool) -> dict[str, Any]:
    """Both tables."""
    return {"steps": steps_of_crowds(quick), "to error": [to_error(different, quick) for different in (False, True)]}


def timed(runs: dict[str, Run], rounds: int) -> dict[str, dict[str, float]]:
    """Seconds of each in turn: first call, median and quartiles."""
    found: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds + 1):
        for name, run in runs.items():
            if len(found[name]) > 2 and found[name][1] > 1.0:
                continue
            begun = time.perf_counter()
            run()
            found[name].append(time.perf_counter() - begun)
    kept = {}
    for name, (first, *rest) in found.items():
        low, middle, high = np.quantile(rest, [0.25, 0.5, 0.75]).tolist()
        kept[name] = {"first": first, "median": middle, "low": low, "high": high}
    return kept


# ------------------------------------------------------------------ nanoseconds of a step


def steps_of_crowds(quick: bool) -> list[dict[str, Any]]:
    """Order 4, momentum and attitude, the end kept: RKMK4 here, RK4 with quaternions in JAX, MuJoCo's RK4."""
    rows = []
    for n in (16, 256) if quick else (16, 256, 4096, 65_536, 1_000_000):
        for steps in (20, 200):
            runs: dict[str, Run] = {"liemech RKMK4": _ours(n, steps)}
            blocked = {f"JAX RK4, blocks of {b}": partial(_jax, block=b) for b in (256, 1024, 4096, 16_384) if b < n}
            for name, make in {"JAX RK4": _jax, **blocked, "MuJoCo RK4": _mujoco}.items():
                try:
                    run = make(n, steps)
                except ImportError:
                    continue
                if run is not None:
                    runs[name] = run
            found = timed(runs, 1 if quick else 5 if n < 1e5 else 2)
            found = best_of_jax(found)
            rows.append({"bodies": n, "steps": steps, "seconds": found})
            texts = [f"{name} {1e9 * t['median'] / n / steps:.3g}" for name, t in found.items()]
            print(f"{n} bodies, {steps} steps, ns of a step: {', '.join(texts)}", flush=True)
    return rows


def best_of_jax(found: dict[str, dict[str, float]]) -> dict[str, dict[str, float]]:
    """JAX has one column, that of its quickest blocks, whose size is kept."""
    blocks = {name: t for name, t in found.items() if name.startswith("JAX RK4")}
    rest = {name: t for name, t in found.items() if name not in blocks}
    if not blocks:
        return rest
    name, quickest = min(blocks.items(), key=lambda item: item[1]["median"])
    size = name.rpartition(" ")[2]
    return {**rest, "JAX RK4": {**quickest, "block": float(size) if size.isdigit() else 0.0}}


def _ours(n: int, steps: int) -> Run:
    body = lm.RigidBody(MOMENTS)
    plan = lm.Plan(body, lm.RKMK(order=4), h=STEP, every=steps, compiled=True, progress=False, workers=1)
    begin = body.state(mu=starts(n), g=np.broadcast_to(np.eye(3), (n, 3, 3)))

    def run() -> Any:
        motion: Any = plan.run(begin, steps=steps)
        return motion.mu[-1], motion.g[-1]

    return run


def _jax(n: int, steps: int, block: int = 0) -> Run:
    """All bodies at once, or one block after the other, each through all steps while it is in the cache."""
    jax: Any = importlib.import_module("jax")
    jax.config.update("jax_enable_x64", True)

    def rate(y: Any) -> Any:
        return jax.numpy.stack(body_attitude(None, 0.0, y))

    def all_steps(y: Any) -> Any:  # components first: one row each for all bodies
        def step(_: Any, y: Any) -> Any:
            a = rate(y)
            b = rate(y + 0.5 * STEP * a)
            c = rate(y + 0.5 * STEP * b)
            return y + STEP / 6.0 * (a + 2.0 * b + 2.0 * c + rate(y + STEP * c))

        return jax.lax.fori_loop(0, steps, step, y)

    first = np.concatenate([starts(n).T, np.eye(4)[:, :1] * np.ones(n)])
    if not block:
        together = jax.jit(all_steps)
        return lambda: np.asarray(together(first))
    blocks = -(-n // block)
    padded = np.pad(first, ((0, 0), (0, blocks * block - n)), mode="edge")
    rows = padded.reshape(7, blocks, block).transpose(1, 0, 2).copy()
    apart = jax.jit(lambda y: jax.lax.map(all_steps, y))
    return lambda: np.asarray(apart(rows))


def _mujoco(n: int, steps: int) -> Run | None:
    if n * steps > 60_000:
        return None  # seconds and more
    mj: Any = importlib.import_module("mujoco")
    rollout: Any = importlib.import_module("mujoco.rollout")
    model = mj.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{STEP}" integrator="RK4" gravity="0 0 0"/><worldbody><body><joint type="ball"/>
        <inertial mass="1" pos="0 0 0" diaginertia="1 1.5 2"/></body></worldbody></mujoco>"""
    )
    data = mj.MjData(model)
    first = np.zeros((n, mj.mj_stateSize(model, mj.mjtState.mjSTATE_FULLPHYSICS)))
    first[:, 1], first[:, 5:8] = 1.0, starts(n) / MOMENTS
    return lambda: rollout.rollout(model, data, first, nstep=steps)[0][:, -1]


# ------------------------------------------------------------------ time to error


def to_error(different: bool, quick: bool) -> dict[str, Any]:
    """256 bodies until t = 20 with an error of momentum and attitude below 1e-9: the loosest
    setting of each that does it.
    """
    n = 32 if quick else BODIES
    mu, J = starts(n), inertias(n, different)
    hy: Any
    try:
        hy = importlib.import_module("heyoka")
    except ImportError:
        print("heyoka is not installed: ensembles have no reference")
        return {"different": different, "seconds": {}}
    system = _system(hy)
    exact = _reference(hy, system, mu, J)
    runs: dict[str, Run] = {}
    errors: dict[str, float] = {}
    for name, settings, prepare in (*_contenders(mu, J, different), *_heyokas(hy, system, mu, J), *_diffrax(mu, J)):
        for setting in settings:
            run = prepare(setting)
            error = float(np.abs(run()[:CHECKED] - exact).max())
            if error <= GOAL:
                runs[f"{name}, {setting:g}"], errors[f"{name}, {setting:g}"] = run, error
                break
    found = timed(runs, 1 if quick else 9)
    for name, t in found.items():
        print(f"{name}: {1e3 * t['median']:.3g} ms, error {errors[name]:.0e}", flush=True)
    return {"different": different, "bodies": n, "seconds": found, "errors": errors}


def _system(hy: Any) -> Any:
    variables = hy.make_vars(*[f"y{i}" for i in range(7)])
    a, b, c = (hy.par[i] for i in range(3))  # 1/J
    p, q, r = variables[:3]
    torque = [(c - b) * (q * r), (a - c) * (r * p), (b - a) * (p * q)]
    return list(zip(variables, [*torque, *turning(variables[3:], [a * p, b * q, c * r])], strict=True))


def _outputs(y: np.ndarray) -> np.ndarray:
    """Momentum and rotation matrix, (n, 12), of (n, 7)."""
    return np.concatenate([y[:, :3], matrices(y[:, 3:7])], axis=1)


def _reference(hy: Any, system: Any, mu: np.ndarray, J: np.ndarray) -> np.ndarray:
    """The first bodies by heyoka in 64 bits, 1e-18 a step."""
    wide = np.longdouble
    integrator = hy.taylor_adaptive(
        system, np.zeros(7, wide), tol=wide(1e-18), fp_type=wide, pars=np.ones(3, wide), compact_mode=True
    )
    found = []
    for k in range(CHECKED):
        integrator.time = wide(0)
        integrator.state[:] = [*mu[k], 1.0, 0.0, 0.0, 0.0]
        integrator.pars[:] = wide(1) / J[k].astype(wide)
        integrator.propagate_until(wide(END))
        found.append(np.array(integrator.state, dtype=float))
    return _outputs(np.array(found))


def _contenders(
    mu: np.ndarray, J: np.ndarray, different: bool
) -> list[tuple[str, tuple[float, ...], Callable[[float], Run]]]:
    bodies: Any = [lm.RigidBody(row) for row in J] if different else lm.RigidBody(J[0])
    one = bodies[0] if different else bodies
    begin = one.state(mu=mu, g=np.broadcast_to(np.eye(3), (len(mu), 3, 3)))

    def prepare(setting: float, method: Any) -> Run:
        steps = int(setting)
        plan = lm.Plan(bodies, method, h=END / steps, every=steps, compiled=True, progress=False, workers=1)

        def run() -> Any:
            motion: Any = plan.run(begin, steps=steps)
            return np.concatenate([motion.mu[-1], motion.g[-1].reshape(len(mu), 9)], axis=1)

        return run

    methods = {
        "RKMK DOP853": (lm.RKMK(tableau=DOP853), (20, 30, 45, 60, 80, 110)),
        "Taylor 12": (lm.Taylor(12), (15, 20, 27, 36, 48, 64)),
        "Taylor 18": (lm.Taylor(18), (8, 12, 16, 20, 27, 36)),
        "exact flow": (lm.ExactFreeBody(), (1,)),
    }
    return [(f"liemech {name}", n, lambda s, m=method: prepare(s, m)) for name, (method, n) in methods.items()]


def _heyokas(
    hy: Any, system: Any, mu: np.ndarray, J: np.ndarray
) -> list[tuple[str, tuple[float, ...], Callable[[float], Run]]]:
    first = np.concatenate([mu, np.ones((len(mu), 1)), np.zeros((len(mu), 3))], axis=1)
    wide = hy.recommended_simd_size()

    def one_by_one(tolerance: float) -> Run:
        integrator = hy.taylor_adaptive(system, np.zeros(7), tol=tolerance, pars=np.ones(3))

        def run() -> Any:
            found = np.empty((len(mu), 7))
            for k in range(len(mu)):
                integrator.time = 0.0
                integrator.state[:], integrator.pars[:] = first[k], 1.0 / J[k]
                integrator.propagate_until(END)
                found[k] = integrator.state
            return _outputs(found)

        return run

    def batch(tolerance: float) -> Run:
        integrator = hy.taylor_adaptive_batch(system, np.zeros((7, wide)), tol=tolerance, pars=np.ones((3, wide)))

        def run() -> Any:
            found = np.empty((len(mu), 7))
            for k in range(0, len(mu), wide):
                integrator.set_time(0.0)
                integrator.state[:], integrator.pars[:] = (first[k : k + wide].T, 1.0 / J[k : k + wide].T)
                integrator.propagate_until(END)
                found[k : k + wide] = integrator.state.T
            return _outputs(found)

        return run

    within = (1e-8, 1e-9, 1e-10, 1e-11)
    return [("heyoka, one by one", within, one_by_one), (f"heyoka, batches of {wide}", within, batch)]


def _diffrax(mu: np.ndarray, J: np.ndarray) -> list[tuple[str, tuple[float, ...], Callable[[float], Run]]]:
    try:
        jax: Any = importlib.import_module("jax")
        dx: Any = importlib.import_module("diffrax")
    except ImportError:
        return []
    jax.config.update("jax_enable_x64", True)

    def field(t: Any, y: Any, inverse: Any) -> Any:
        a, b, c = inverse
        p, q, r = y[0], y[1], y[2]
        torque = [(c - b) * (q * r), (a - c) * (r * p), (b - a) * (p * q)]
        return jax.numpy.stack([*torque, *turning([y[i] for i in range(3, 7)], [a * p, b * q, c * r])])

    @jax.jit
    def solve(first: Any, inverse: Any, tolerance: Any) -> Any:
        def one(y: Any, parameters: Any) -> Any:
            controller = dx.PIDController(rtol=tolerance, atol=tolerance)
            return dx.diffeqsolve(
                dx.ODETerm(field), dx.Dopri8(), 0.0, END, None, y, parameters, stepsize_controller=controller, max_steps=10**5
            ).ys[-1]  # fmt: skip

        return jax.vmap(one)(first, inverse)

    first = np.concatenate([mu, np.ones((len(mu), 1)), np.zeros((len(mu), 3))], axis=1)

    def prepare(tolerance: float) -> Run:
        return lambda: _outputs(np.asarray(solve(first, 1.0 / J, tolerance)))

    return [("diffrax Dopri8, vmap", (1e-8, 1e-9, 1e-10, 1e-11), prepare)]
