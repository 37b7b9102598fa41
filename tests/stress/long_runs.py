"""Runs of up to 10^8 steps for each family of methods and for other packages: the error of the energy over time.

    python tests/stress/long_runs.py [--minutes 20] [--steps 1e8] [--only RKMK] [--page]

A run goes on from sample to sample by factors of sqrt 10; of each part the largest error counts. It ends at the steps
that were asked for, or when the next part would take longer than the time that is left for it.  Results are kept in
`long_runs.json`, a longer run takes the place of a shorter one; --page writes the table and the figure of
docs/proof/reliability.md from them.
"""

from __future__ import annotations

import argparse
import importlib
import json
import math
import os
import sys
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "benchmarks")]
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np  # noqa: E402

import liemech as lm  # noqa: E402
from liemech.tableaus import DOP853  # noqa: E402

KEPT, PAGE = HERE / "long_runs.json", HERE.parents[1] / "docs" / "proof" / "reliability.md"
FIGURE = PAGE.parents[1] / "figures" / "long_runs.png"
FIRST, SAMPLES = 1000, 300
Part = Callable[[int], np.ndarray]  # goes on by so many steps: the energies of about 300 states on the way

J, MU, H = np.array([1.0, 1.5, 2.0]), np.array([0.5, 0.0, math.sqrt(0.75)]), 0.1


def parts() -> Iterator[tuple[str, str, Callable[[], tuple[float, Part]]]]:
    """Group, name, and what makes the energy at the start and the run."""
    body = lm.RigidBody(J)
    still, turned = body.state(mu=MU), body.state(mu=MU, g=np.eye(3))
    top = lm.models.HeavyTop([1.0, 1.0, 0.5], 1.0, [0.0, 0.0, 0.8])
    spin = top.state(mu=[0.3, 0.2, 1.5], g=lm.SO3().exp(np.array([0.4, 0.1, 0.0])))
    sphere = lm.SphericalPendulum(gravity=1.0)
    swing = sphere.state([0.6, 0.0, -0.8], [0.0, 0.7, 0.0])
    kepler = lm.Kepler()
    ellipse = kepler.pericentre(0.3)
    free: dict[str, Any] = {
        "RKMK 4": lm.RKMK(order=4), "RKMK DOP853": lm.RKMK(tableau=DOP853), "commutator-free 4": lm.CommutatorFree(order=4),
        "Taylor 12": lm.Taylor(12), "Algorithm 1, exp": lm.CovariantVariational(),
        "Algorithm 1, Cayley": lm.CovariantVariational(lm.Cayley()),
        "Algorithm 1, composed to 4": lm.Composition(lm.CovariantVariational(lm.Cayley()), order=4),
        "Hamilton-Jacobi 4, exp": lm.LiePoissonHamiltonJacobi(), "Hamilton-Jacobi 6, exp": lm.LiePoissonHamiltonJacobi(order=6),
        "three rotations": lm.ThreeRotations(), "exact flow": lm.ExactFreeBody(), "Galerkin 4": lm.GalerkinVariational(4),
        "spherical midpoint": lm.SphericalMidpoint(),
    }  # fmt: skip
    for name, method in free.items():
        start = turned if name in ("RKMK DOP853", "Galerkin 4") else still
        yield "free body", name, lambda m=method, s=start: ours(body, m, s, H)
    for name, method in {
        "Lie-Verlet": lm.LieVerlet(lm.Cayley()),
        "kicks and exact drifts 4": lm.KickDrift(order=4),
    }.items():
        yield "heavy top", name, lambda m=method: ours(top, m, spin, 0.05)
    for name, method in {"RATTLE": lm.RATTLE(), "geodesics 4": lm.GeodesicSplitting(order=4)}.items():
        yield "spherical pendulum", name, lambda m=method: ours(sphere, m, swing, 0.05)
    for name, method in {"Stormer-Verlet": lm.StormerVerlet(), "splitting 6": lm.Splitting(order=6)}.items():
        yield "Kepler, e = 0.3", name, lambda m=method: ours(kepler, m, ellipse, 0.05)
    yield "free body", "heyoka, 1e-16", lambda: heyoka(2.3e-16)
    yield "free body", "heyoka, 1e-9", lambda: heyoka(1e-9)
    yield "free body", "SciPy DOP853, 1e-9", lambda: scipy(1e-9)
    yield "free body", "Exudyn RK44", exudyn
    yield "free body", "MuJoCo RK4", mujoco
    yield "Kepler, e = 0.3", "REBOUND WHFast", lambda: rebound("whfast")
    yield "Kepler, e = 0.3", "REBOUND IAS15", lambda: rebound("ias15")


# ------------------------------------------------------------------ runs


def ours(system: Any, method: Any, start: Any, h: float) -> tuple[float, Part]:
    """A plan that goes on."""
    plan = lm.Plan(system, method, h=h, every=FIRST // SAMPLES + 1, compiled=True, progress=False)
    last = plan.run(start, steps=1)
    energy = float(last.energy[0])

    def go_on(steps: int) -> np.ndarray:
        nonlocal last
        last = plan.replace(every=max(1, steps // SAMPLES)).resume(last, steps=steps)
        return np.asarray(last.energy)

    return energy, go_on


def kinetic(mu: np.ndarray) -> np.ndarray:
    """mu . J^-1 mu/2."""
    return np.asarray(0.5 * (mu * mu / J).sum(axis=-1))


def _pieces(steps: int) -> list[int]:
    return np.diff(np.linspace(0, steps, min(steps, SAMPLES) + 1).astype(int)).tolist()


def heyoka(tolerance: float) -> tuple[float, Part]:
    """As long as so many steps of 0.1 are."""
    from races import body as rates

    hy: Any = importlib.import_module("heyoka")
    variables = hy.make_vars("p", "q", "r")
    integrator = hy.taylor_adaptive(list(zip(variables, rates(hy, hy.time, variables), strict=True)), MU, tol=tolerance)
    turn = 0

    def go_on(steps: int) -> np.ndarray:
        nonlocal turn
        found = []
        for piece in _pieces(steps):
            turn += piece
            integrator.propagate_until(H * turn)
            found.append(integrator.state.copy())
        return kinetic(np.array(found))

    return float(kinetic(MU)), go_on


def scipy(tolerance: float) -> tuple[float, Part]:
    """As long as so many steps of 0.1 are."""
    integrate: Any = importlib.import_module("scipy.integrate")
    a, b, c = (1.0 / J).tolist()

    def rates(t: float, y: Any) -> list[float]:
        p, q, r = y.tolist()
        return [(c - b) * q * r, (a - c) * r * p, (b - a) * p * q]

    state = MU

    def go_on(steps: int) -> np.ndarray:
        nonlocal state
        end = H * steps
        found = integrate.solve_ivp(
            rates,
            (0.0, end),
            state,
            method="DOP853",
            rtol=tolerance,
            atol=tolerance,
            t_eval=np.linspace(0, end, SAMPLES),
        ).y.T
        state = found[-1]
        return kinetic(found)

    return float(kinetic(MU)), go_on


def exudyn() -> tuple[float, Part]:
    """Its rigid body, with steps of 0.1."""
    import peers

    importlib.import_module("exudyn")
    contender = next(c for c in peers.exudyn() if c.method == "RK44")
    state = [*MU.tolist(), 1.0, 0.0, 0.0, 0.0]

    def go_on(steps: int) -> np.ndarray:
        nonlocal state
        pieces = [n for n in np.diff(np.linspace(0, steps, 31).astype(int)).tolist() if n]
        found = []
        for piece in pieces:  # the attitude does not act on the momentum: each piece begins with none
            problem = peers.Problem("", tuple(J.tolist()), tuple(state[:3]), (H * piece,), pace=100.0 / (H * piece))
            mu, _ = contender.prepare(problem, float(piece))()[-1]
            state[:3] = mu.tolist()
            found.append(mu)
        return kinetic(np.array(found))

    return float(kinetic(MU)), go_on


def mujoco() -> tuple[float, Part]:
    """Its rigid body, with steps of 0.1, in its own loop."""
    mj: Any = importlib.import_module("mujoco")
    rollout: Any = importlib.import_module("mujoco.rollout")
    model = mj.MjModel.from_xml_string(
        f"""<mujoco><option timestep="{H}" integrator="RK4" gravity="0 0 0"/><worldbody><body><joint type="ball"/>
        <inertial mass="1" pos="0 0 0" diaginertia="1 1.5 2"/></body></worldbody></mujoco>"""
    )
    data = mj.MjData(model)
    state = np.zeros((1, mj.mj_stateSize(model, mj.mjtState.mjSTATE_FULLPHYSICS)))
    state[0, 1], state[0, 5:8] = 1.0, MU / J

    def go_on(steps: int) -> np.ndarray:
        nonlocal state
        found = []
        for piece in _pieces(steps):
            state = rollout.rollout(model, data, state, nstep=piece)[0][:, -1]
            found.append(J * state[0, 5:8])
        return kinetic(np.array(found))

    return float(kinetic(MU)), go_on


def rebound(method: str) -> tuple[float, Part]:
    """An ellipse, as long as so many steps of 0.05 are."""
    rb: Any = importlib.import_module("rebound")
    made = rb.Simulation()
    made.add(m=1.0)
    made.add(m=0.0, x=0.7, vy=math.sqrt(1.3 / 0.7))
    made.integrator, made.dt = method, 0.05
    turn = 0

    def go_on(steps: int) -> np.ndarray:
        nonlocal turn
        found = []
        for piece in _pieces(steps):
            turn += piece
            if method == "ias15":
                made.integrate(0.05 * turn)
            else:
                made.steps(piece)
                made.synchronize()
            p = made.particles[1]
            found.append(0.5 * (p.vx**2 + p.vy**2) - 1.0 / math.hypot(p.x, p.y))
        return np.array(found)

    return -0.5, go_on


# ------------------------------------------------------------------ measuring


def measured(make: Callable[[], tuple[float, Part]], most: float, seconds: float) -> dict[str, Any]:
    """Steps and the largest relative error of the energy between two of them, as far as time allows."""
    energy, go_on = make()
    done, found, begun = 0, [], time.process_time()
    spent = 0.0
    for k in range(100):
        until = round(FIRST * 10.0 ** (0.5 * k))
        if until > most or time.process_time() - begun + 2.2 * spent > seconds:
            break
        part = time.process_time()
        errors = np.abs(go_on(until - done) / energy - 1.0)
        spent = time.process_time() - part
        done = until
        found.append([done, float(errors.max())])
    return {"steps": done, "errors": found, "seconds": time.process_time() - begun}


def exponent(errors: list[list[float]]) -> float | None:
    """Of the growth in the last two decades; None for less."""
    n, e = np.array(errors[-5:]).T if len(errors) >= 5 else (np.ones(1), np.ones(1))
    if len(n) < 5 or not (e > 0.0).all():
        return None
    return float(np.polyfit(np.log(n), np.log(e), 1)[0])


def kind(power: float | None, last: float) -> str:
    """In words."""
    if power is None:
        return "too short to tell"
    if power < 0.2:
        return "bounded"
    if power < 0.8:
        return "walks, rounding" if last < 1e-10 else "grows"
    return "drifts" if last > 1e-10 else "drifts, rounding"


def table(kept: dict[str, Any]) -> str:
    """The rows, families first."""
    text = "| | method | steps | error at 10^4 | 10^6 | 10^8 | exponent | |\n| --- | --- | --- | --- | --- | --- | --- | --- |"
    for key, found in kept.items():
        group, name = key.split(": ", 1)
        at = {round(math.log10(n), 1): e for n, e in found["errors"]}
        power = exponent(found["errors"])
        cells = [f"{at[k]:.0e}" if k in at else "-" for k in (4.0, 6.0, 8.0)]
        shown = f"{power:.2f}" if power is not None else "-"
        last = found["errors"][-1][1] if found["errors"] else 0.0
        text += f"\n| {group} | {name} | {found['steps']:.0e} | {' | '.join(cells)} | {shown} | {kind(power, last)} |"
    return text.replace("e+0", "e").replace("e-0", "e-")


def draw(kept: dict[str, Any]) -> None:
    """Errors over steps: the free body by us and by other packages, and the other systems."""

    def panel(key: str) -> str:
        if not key.startswith("free body"):
            return "other systems"
        theirs = any(name in key for name in ("heyoka", "SciPy", "Exudyn", "MuJoCo"))
        return "free body, other packages" if theirs else "free body, h = 0.1"

    titles = ("free body, h = 0.1", "free body, other packages", "other systems")
    figure, axes = lm.plots.subplots(3, 1, figsize=(8.6, 11.5), sharex=True)
    for ax, title in zip(axes, titles, strict=True):
        chosen = {k: found for k, found in kept.items() if panel(k) == title and found["errors"]}
        for i, (key, found) in enumerate(chosen.items()):
            n, e = np.array(found["errors"]).T
            name = key.split(": ", 1)[1] if key.startswith("free body") else key
            style = {
                "color": lm.plots.COLORS[i % 6],
                "marker": "o^sDvP"[(i + i // 6) % 6],
                "linestyle": "-" if i < 6 else "--",
            }
            ax.loglog(n, np.maximum(e, 1e-17), linewidth=1, markersize=3.5, label=name, **style)
        ax.set(title=title, ylim=(1e-17, 1e1), ylabel="relative error of the energy")
        named_beside(ax)
    axes[-1].set_xlabel("steps $N$")
    lm.plots.save(figure, FIGURE)


def named_beside(ax: Any) -> None:
    """Names right of the picture, in the order in which the curves end."""
    lines = sorted(ax.get_lines(), key=lambda line: -line.get_ydata()[-1])
    handles, names = lines, [line.get_label() for line in lines]
    ax.legend(handles, names, fontsize=8.5, frameon=False, loc="center left", bbox_to_anchor=(1, 0.5))


def write_page(kept: dict[str, Any]) -> None:
    """The table and the figure of docs/proof/reliability.md."""
    page, begin, end = (PAGE.read_text(encoding="utf-8"), "<!-- long runs -->", "<!-- end of long runs -->")
    first, last = page.index(begin) + len(begin), page.index(end)
    PAGE.write_text(f"{page[:first]}\n\n{table(kept)}\n\n{page[last:]}", encoding="utf-8")
    draw(kept)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=20.0, help="of the processor, for all")
    parser.add_argument("--steps", type=float, default=1e8)
    parser.add_argument("--only", default="", help="rows whose name contains this")
    parser.add_argument("--page", action="store_true", help="write table and figure")
    chosen = parser.parse_args()
    kept: dict[str, Any] = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    rows = [row for row in parts() if chosen.only in f"{row[0]}: {row[1]}"]
    for group, name, make in [] if chosen.page else rows:
        try:
            with warnings.catch_warnings(action="ignore"):
                found = measured(make, chosen.steps, 60.0 * chosen.minutes / len(rows))
        except ImportError as missing:
            print(f"{name}: {missing}")
            continue
        print(
            f"{group}: {name}: {found['steps']:.0e} steps, {found['seconds']:.0f} s, {found['errors'][-1:]}", flush=True
        )
        if found["steps"] >= kept.get(f"{group}: {name}", {"steps": 0})["steps"]:
            kept[f"{group}: {name}"] = found
            order = [f"{g}: {n}" for g, n, _ in parts()]
            kept = {key: kept[key] for key in order if key in kept}
            KEPT.write_text(json.dumps(kept, indent=None).replace('}, "', '},\n"') + "\n", encoding="utf-8")
    write_page(kept)


if __name__ == "__main__":
    main()
