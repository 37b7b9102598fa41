"""Chains of rods by loops over bodies and joints, against C++ and, if they are there, MuJoCo and Pinocchio.

    python tests/benchmarks/chains.py [--quick] [--peers] [--only PART] [--out FILE]

Figures are nanoseconds of processor time per rod and step of 2 ms, of whole runs that keep the last state, the least of
several rounds in turn; "hinges" is the same chain on hinges, "order 4" a composition of five substeps.  Then rods that
hang from the rim of one wheel.  Ours is by default compensated; the methods of C++ and of ours are two different ones
of order 2.  C++ is built without contraction.  Then the seconds of compiling, with no code on disk.
"""

import argparse
import ctypes
import functools
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from baseline import FLAGS
from harness import table, write
from spins import least

import liemech as lm
from liemech.formulas import dot, sqrt, vec

SOURCE, H = Path(__file__).with_name("chains.cpp"), 0.002


def build() -> Any:
    """The loops of `chains.cpp`, compiled for this processor."""
    path = Path(tempfile.mkdtemp()) / "chains.so"
    command = ["g++", *FLAGS, "-ffp-contract=off", str(SOURCE), "-o", str(path)]
    subprocess.run(command, check=True)
    library = ctypes.CDLL(str(path))
    library.chain_lanes.restype = library.chain_rattle.restype = ctypes.c_double
    return library


def bent(n: int, axis: Any = None) -> tuple[Any, Any, np.ndarray]:
    """A chain, its start at rest, and the attitudes of its rods."""
    linkage, end = lm.joints.chain(n, axis=axis), np.zeros(3)
    b = np.arange(n)
    turns = np.transpose([0.1 * np.cos(b), 0.3 + 0.1 * np.sin(b), 0.0 * b + 0.2])
    if axis is not None:
        turns *= axis
    poses = np.tile(np.eye(4), (n, 1, 1))
    for pose, turn in zip(poses, turns):
        pose[:3, :3] = lm.SO3().exp(turn)
        pose[:3, 3], end = end - 0.5 * pose[:3, 2], end - pose[:3, 2]
    return linkage, linkage.assembled(poses), np.ascontiguousarray(poses[:, :3, :3])


def in_cpp(loop: Any, R: np.ndarray, steps: int, lanes: bool) -> np.ndarray:
    """The attitudes after so many steps in C++."""
    end, told, H0 = np.empty_like(R), np.zeros(1), np.zeros(1)
    at = [ctypes.c_void_p(x.ctypes.data) for x in (R, told, end, H0)]
    head = ctypes.c_long(len(R)), at[0], ctypes.c_double(H), ctypes.c_long(steps)
    if lanes:
        loop.chain_lanes(*head, ctypes.c_double(1e-16), at[1], at[2])
    else:
        loop.chain_rattle(*head, ctypes.c_long(1), ctypes.c_double(1e-16), at[3], at[1], at[2])
    return end


def peers(n: int) -> dict[str, Callable[[int], Any]]:
    """Steps of MuJoCo, and evaluations of accelerations by Pinocchio, of the same chain."""
    found: dict[str, Callable[[int], Any]] = {}
    try:
        import mujoco
    except ImportError:
        mujoco = None
    if mujoco is not None and n <= 64:
        across, along = (3 * 0.05**2 + 1.0) / 12, 0.5 * 0.05**2
        rod = (
            '<body pos="0 0 {0}"><joint type="ball"/><inertial pos="0 0 -0.5" mass="1" '
            f'diaginertia="{across} {across} {along}"/>'
        )
        for integrator in ("Euler", "RK4"):
            text = (
                f'<mujoco><option timestep="{H}" integrator="{integrator}"/><worldbody>'
                + "".join(rod.format(0 if k == 0 else -1) for k in range(n))
                + "</body>" * n
                + "</worldbody></mujoco>"
            )
            model = mujoco.MjModel.from_xml_string(text)
            data = mujoco.MjData(model)
            data.qvel[:3] = 0.3

            def run(steps: int, model: Any = model, data: Any = data) -> None:
                mujoco.mj_step(model, data, steps)

            found[f"MuJoCo, {integrator}"] = run
    try:
        import pinocchio as pin
    except ImportError:
        return found
    model, parent = pin.Model(), 0
    inertia = pin.Inertia.FromCylinder(1.0, 0.05, 1.0)
    for k in range(n):
        shift = pin.SE3(np.eye(3), np.array([0.0, 0.0, 0.0 if k == 0 else -1.0]))
        parent = model.addJoint(parent, pin.JointModelSpherical(), shift, f"ball {k}")
        model.appendBodyToJoint(parent, inertia, pin.SE3(np.eye(3), np.array([0, 0, -0.5])))
    data, q, v = model.createData(), pin.neutral(model), 0.1 * np.ones(model.nv)

    def aba(calls: int) -> None:
        for _ in range(calls):
            pin.aba(model, data, q, v, v)

    found["aba of Pinocchio"] = aba
    return found


def pace(chosen: Any) -> dict[str, Any]:
    """Nanoseconds per rod and step."""
    loops, kept, lines = build(), {}, []  # type: Any, dict[str, Any], list[Any]
    turn = np.array([0.0, 1.0, 0.0])
    for n in (4, 64) if chosen.quick else (4, 16, 64, 250, 1000):
        steps = (20_000 if chosen.quick else 100_000) // n
        runs: dict[str, Callable[[], Any]] = {}
        four = lm.Composition(lm.LieRATTLE(), order=4)
        for name, axis, method in (
            ("ours", None, lm.LieRATTLE()), ("hinges", turn, lm.LieRATTLE()), ("order 4", None, four)
        ):  # fmt: skip
            linkage, start, R = bent(n, axis)
            plan = lm.Plan(linkage, method, h=H, every=steps, compiled=True, progress=False)
            runs[name] = functools.partial(plan.run, start, steps=steps)
            if name == "ours":
                runs["C++, lanes"] = functools.partial(in_cpp, loops, R, steps, True)
                runs["C++"] = functools.partial(in_cpp, loops, R, steps, False)
                ours = plan.run(start, steps=50).g[-1].reshape(n, 4, 4)[:, :3, :3]
                off = np.abs(ours - in_cpp(loops, R, 50, True)).max()
                if not off < 1e-3:
                    raise AssertionError(f"{n} rods: C++ and liemech differ by {off}")
        fewer = max(1, steps // 20)
        others = peers(n) if chosen.peers else {}
        runs |= {name: functools.partial(run, fewer) for name, run in others.items()}
        for run in runs.values():
            run()
        times = least(runs, 3 if chosen.quick else 7)
        ns = {k: 1e9 * t / n / (fewer if k in others else steps) for k, t in times.items()}
        kept[str(n)] = ns
        lines.append([n, *[ns.get(k) for k in COLUMNS], ns["ours"] / ns["C++, lanes"]])
    table("nanoseconds per rod and step", ["rods", *COLUMNS, "ours / lanes"], lines)
    return kept


COLUMNS = (
    "ours", "hinges", "order 4", "C++, lanes", "C++", "MuJoCo, Euler", "MuJoCo, RK4", "aba of Pinocchio"
)  # fmt: skip


def reduced(chosen: Any) -> dict[str, Any]:
    """Nanoseconds per rod and step of methods that leave the conditions, and of chains of points."""
    kept, lines = {}, []  # type: dict[str, Any], list[Any]
    methods = {
        "RKMK 4": lm.RKMK(order=4), "RKMK 8": lm.RKMK(order=8), "Taylor 4": lm.Taylor(order=4),
        "Taylor 8": lm.Taylor(order=8), "Taylor 12": lm.Taylor(order=12),
    }  # fmt: skip
    if chosen.quick:
        methods = {"Taylor 4": methods["Taylor 4"]}
    for n in (4, 64) if chosen.quick else (4, 64, 1000):
        steps, (linkage, start, _) = 20_000 // n, bent(n)
        runs: dict[str, Callable[[], Any]] = {}
        for name, method in methods.items():
            plan = lm.Plan(linkage, method, h=H, every=steps, compiled=True, progress=False)
            runs[name] = functools.partial(plan.run, start, steps=steps)
        points = lm.models.ChainPendulum([1.0] * n, [1.0] * n, 9.81)
        places = np.cumsum([[0.05 * np.cos(k), 0.2, -0.97] for k in range(n)], axis=0)
        unit = places - np.vstack([np.zeros(3), places[:-1]])
        hung = np.cumsum(unit / np.linalg.norm(unit, axis=1)[:, None], axis=0).ravel()
        plan = lm.Plan(points, lm.RATTLE(), h=H, every=steps, compiled=True, progress=False)
        at_rest = points.state(hung, np.zeros(3 * n))
        runs["points, RATTLE"] = functools.partial(plan.run, at_rest, steps=steps)
        for run in runs.values():
            run()
        times = least(runs, 3 if chosen.quick else 7)
        kept[str(n)] = {k: 1e9 * t / n / steps for k, t in times.items()}
        lines.append([n, *kept[str(n)].values()])
    table("nanoseconds per rod and step", ["rods", *runs], lines)
    return kept


def long_run(chosen: Any) -> dict[str, Any]:
    """Ten rods, 10^5 steps of 1 ms: band and trend of the energy, conditions."""
    kept, lines = {}, []  # type: dict[str, Any], list[Any]
    linkage, steps = lm.joints.chain(10), 2_000 if chosen.quick else 100_000
    start = linkage.state(angles={0: [0.3, 0.8, 0.1], 5: [0.5, 0.0, 0.3]})
    for order, method in ((2, lm.LieRATTLE()), (4, lm.Composition(lm.LieRATTLE(), order=4))):
        run = lm.integrate(linkage, method, start, h=1e-3, steps=steps, every=10, compiled=True, progress=False)
        fall = np.abs(linkage.energy(np.zeros_like(run.mu), run.g)).max()
        parts = np.array_split(run.energy, 20)
        middles = np.array([part.mean() for part in parts])
        slope, cov = np.polyfit(np.arange(20.0), middles, 1, cov=True)
        missed = np.abs(linkage.conditions_at(run.mu[-1], run.g[-1])[0]).max() / 10.0
        found = [np.ptp(run.energy) / fall, 20.0 * slope[0] / fall, 20 * cov[0, 0] ** 0.5 / fall, missed]
        kept[str(order)] = [float(x) for x in found]
        lines.append([order, *found])
    table("ten rods", ["order", "band of the energy", "trend", "+-", "conditions, of the length"], lines)
    return kept


def wheel(m: int) -> tuple[Any, Any]:
    """Rods at the rim of a wheel on a ball joint, at rest."""
    links, poses = [lm.joints.Link(5.0, [1.0, 1.2, 1.1])], np.tile(np.eye(4), (m + 1, 1, 1))
    joints = [lm.joints.BallJoint(0, None, [0.0, 0.0, 0.7], [0.0, 0.0, 0.7])]
    rng, top = np.random.default_rng(3), np.array([0.0, 0.0, 0.5])
    for k in range(m):
        rim = np.array([np.cos(2 * np.pi * k / m), np.sin(2 * np.pi * k / m), 0.0])
        R = lm.SO3().exp(0.4 * rng.normal(size=3))
        poses[k + 1, :3, :3], poses[k + 1, :3, 3] = R, rim - R @ top
        links.append(lm.joints.Link.rod(1.0, 1.0, 0.05))
        joints.append(lm.joints.BallJoint(k + 1, 0, top, rim))
    linkage = lm.joints.Linkage(links, joints)
    return linkage, linkage.assembled(poses)


def hubs(chosen: Any) -> dict[str, float]:
    """Nanoseconds per rod and step of many rods on one body."""
    found, lines = {}, []
    for m in (8, 32) if chosen.quick else (4, 8, 32, 128):
        linkage, start = wheel(m)
        steps = (20_000 if chosen.quick else 100_000) // m
        plan = lm.Plan(linkage, lm.LieRATTLE(), h=H, every=steps, compiled=True, progress=False)
        run = functools.partial(plan.run, start, steps=steps)
        run()
        found[str(m)] = 1e9 * least({"ours": run}, 3 if chosen.quick else 7)["ours"] / m / steps
        lines.append([m, found[str(m)]])
    table("nanoseconds per rod and step, rods on one body", ["rods", "ours"], lines)
    return found


@lm.record
class Charges(lm.Potential):
    """Rods that repel each other from middle to middle, all pairs: V = k sum 1/sqrt(r^2 + a^2)."""

    count: int
    k: float

    def energy(self, g: Any) -> Any:
        """The sum over pairs."""
        total = 0.0
        for b in range(self.count):
            for c in range(b):
                apart = [g[16 * b + i] - g[16 * c + i] for i in (3, 7, 11)]
                total = total + self.k / sqrt(dot(vec(*apart), vec(*apart)) + 0.01)
        return total


def several_rates(chosen: Any) -> dict[str, Any]:
    """Processor time and error of a chain with stiff springs at its joints, and of the same with charges:
    LieRATTLE, and n of its steps in one with the slow force.
    """
    kept, lines = {}, []  # type: dict[str, Any], list[Any]
    n, turn, end = 5 if chosen.quick else 16, [0.0, 1.0, 0.0], 0.4
    rods = lm.joints.chain(n, axis=turn)
    springs = [lm.joints.Spring(k, 2000.0) for k in range(n)]
    made = lm.joints.Linkage(rods.links, rods.joints, forces=springs, potential=Charges(n, 2.0))
    start = made.state(angles={0: 0.3, 4: 0.2})
    fine = 200 if chosen.quick else 1600
    exact = lm.integrate(made, lm.RKMK(order=8), start, h=end / fine, steps=fine, progress=False).g[-1]
    runs: dict[str, Callable[[], Any]] = {}
    errors = {}
    for ratio, counts in ((1, (200, 400, 800)), (4, (50, 100, 200)), (16, (13, 25, 50))):
        method: Any = lm.LieRATTLE() if ratio == 1 else lm.MultipleTimeSteps((ratio,))
        for steps in counts[:1] if chosen.quick else counts:
            plan = lm.Plan(made, method, h=end / steps, every=steps, compiled=True, progress=False)
            name = f"{'LieRATTLE' if ratio == 1 else f'{ratio} fast steps in one'}, {steps}"
            runs[name] = functools.partial(plan.run, start, steps=steps)
            errors[name] = float(np.abs(runs[name]().g[-1] - exact).max())
    times = least(runs, 3 if chosen.quick else 9)
    for name in runs:
        kept[name] = [1e3 * times[name], errors[name]]
        lines.append([name, *kept[name]])
    table(f"{n} rods with stiff springs and charges, {end:g} s", ["method, steps", "ms", "error, m"], lines)
    return kept


COMPILED = """
import sys, time
import numpy as np
import liemech as lm
from liemech.joints import BallJoint, Damper, Linkage, Spring, chain
import liemech.compiler.translation.translator, liemech.compiler.sites.loops_over_sites, llvmlite.binding
turn, n = [0.0, 1.0, 0.0], int(sys.argv[2])
hinges, balls = chain(n, axis=turn), chain(n)
made = {
    "balls": lambda: balls,
    "hinges": lambda: hinges,
    "both": lambda: Linkage(hinges.links, [(hinges, balls)[k % 2].joints[k] for k in range(n)]),
    "springs": lambda: Linkage(hinges.links, hinges.joints, forces=[Spring(k, 1.0) for k in range(n)]),
    "dampers": lambda: Linkage(hinges.links, hinges.joints, forces=[Damper(k, 1.0) for k in range(n)]),
}[sys.argv[1]]()
start = made.state(angles={})
begun = time.process_time()
lm.integrate(made, lm.LieRATTLE(), start, h=0.002, steps=5, compiled=True, progress=False)
print(time.process_time() - begun)
"""


def compiling(chosen: Any) -> dict[str, float]:
    """Processor seconds until the first steps are made, in new processes without code on disk."""
    found, lines = {}, []
    cases = [("balls", 10), ("balls", 1000)] + [(k, 10) for k in ("hinges", "both", "springs", "dampers")]
    for kind, n in cases[:1] if chosen.quick else cases:
        told = subprocess.run(
            [sys.executable, "-c", COMPILED, kind, str(n)],
            env=os.environ | {"LIEMECH_CACHE_DIR": os.devnull}, check=True, capture_output=True,
        )  # fmt: skip
        found[f"{kind} {n}"] = float(told.stdout)
        lines.append([f"{n} rods, {kind}", float(told.stdout)])
    table("seconds of compiling", ["", "s"], lines)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--peers", action="store_true", help="MuJoCo and Pinocchio, if installed")
    parser.add_argument("--only", choices=["pace", "hubs", "reduced", "rates", "long", "compiling"])
    parser.add_argument("--out")
    chosen = parser.parse_args()
    parts = {
        "pace": pace,
        "hubs": hubs,
        "reduced": reduced,
        "rates": several_rates,
        "long": long_run,
        "compiling": compiling,
    }
    kept = {name: part(chosen) for name, part in parts.items() if chosen.only in (None, name)}
    if chosen.out:
        write(chosen.out, kept)


if __name__ == "__main__":
    main()
