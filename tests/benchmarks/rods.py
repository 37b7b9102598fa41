"""Cosserat rods against C++ and, if it is installed, PyElastica.

    python tests/benchmarks/rods.py [--quick] [--out FILE]

1. Explicit steps: a rod that is clamped at one end and begins as a quarter of a circle.  Nanoseconds of
   processor time per element and step, a fifth of the time in which a wave of stretch crosses an
   element, of whole runs that keep the last state, the least of several rounds in turn.  C++ (rods.cpp)
   is built without contraction.  "summed" are compensated sums, which ours makes by default and the
   others do not.  The change of the energy over its start in half a second, by steps of
   a tenth of that length.
2. Long steps: a rod of 50 GPa and 100 elements swings under its weight.  Steps a hundred times as long as
   PyElastica's, the time to the end, and how far the tip is from that of 400 elements.
3. Seconds of compiling, with no code on disk, for 10 and for 1000 elements.
"""

import argparse
import ctypes
import functools
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from baseline import libraries
from harness import table, write
from spins import least

import liemech as lm

try:
    import elastica
except ImportError:
    elastica = None

SOURCE = Path(__file__).with_name("rods.cpp")
RADIUS, YOUNG, DENSITY, POISSON = 0.02, 1e6, 1000.0, 0.3
SECTION = lm.models.RodSection.round(RADIUS, YOUNG, DENSITY, POISSON)
CURVED = [0.0, 0.5 * np.pi, 0.0, 0.0, 0.0, 1.0]
WAVE = np.sqrt(YOUNG / DENSITY)


def ours(n: int, tau: Any, h: float, steps: int, compensated: Any) -> tuple[Any, Any, Any]:
    """A plan, its start, and the rod."""
    rod = lm.models.CosseratRod(SECTION, 1.0, n, retraction=tau)
    plan = lm.Plan(rod, lm.KickDrift(), h=h, every=steps, compiled=True, progress=False, compensated=compensated)
    return plan, rod.at_rest(rod.shape(CURVED)), rod


def as_a_field(rod: Any, h: float, steps: int) -> Any:
    """A plan of the rod said as a `Field`."""
    density = lm.FieldDensity(
        lm.KineticEnergy(SECTION.inertia), lm.StrainEnergy(SECTION.stiffness, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    )
    line = lm.Field(lm.SE3(), density, 1.0, rod.elements, ends=("held", "free"))
    return lm.Plan(line, lm.KickDrift(), h=h, every=steps, compiled=True, progress=False, compensated=False)


class InCpp:
    """The same rod in C++: places of the nodes, frames of the segments between them."""

    def __init__(self, n: int) -> None:
        K, J, l = np.array(SECTION.stiffness), np.array(SECTION.inertia), 1.0 / n
        rod = lm.models.CosseratRod(SECTION, 1.0, n)
        twice = lm.models.CosseratRod(SECTION, 1.0, 2 * n).shape(CURVED)
        self.x = np.ascontiguousarray(rod.shape(CURVED)[:, :3, 3])
        self.R = np.ascontiguousarray(twice[1::2, :3, :3])
        mass = np.full(n + 1, l * J[5])
        mass[[0, -1]] *= 0.5
        self.given = l, np.ascontiguousarray(K[3:]), np.ascontiguousarray(K[:3]), mass
        self.inertia, self.n = l * J, n
        self.loop = libraries(SOURCE)["off"].rod
        self.loop.restype = ctypes.c_double

    def run(self, h: float, steps: int) -> tuple[float, np.ndarray]:
        """The energy and the places at the end."""
        l, S, B, mass = self.given
        x, R, v, L = self.x.copy(), self.R.copy(), np.zeros_like(self.x), np.zeros((self.n, 3))
        load, out = np.zeros(3), np.zeros(6)
        at = [ctypes.c_void_p(a.ctypes.data) for a in (S, B, mass, x, v, R, L, load, out)]
        number = ctypes.c_double
        energy = self.loop(
            ctypes.c_long(self.n), number(l), *at[:3], number(self.inertia[0]),
            number(self.inertia[2]), *at[3:7], number(h), ctypes.c_long(steps), 1, at[7], number(0.0),
            at[8],
        )  # fmt: skip
        return energy, x


def in_elastica(
    n: int, young: float, density: float, radius: float, gravity: float = 0.0, curved: bool = True
) -> tuple[Any, Any]:
    """A simulator of PyElastica and its rod; e3 of ours is the tangent there."""

    class Simulator(elastica.BaseSystemCollection, elastica.Constraints, elastica.Forcing):
        pass

    made = Simulator()
    z, x = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
    start = np.zeros(3)
    direction = z if curved else x
    normal = x if curved else z
    rod = elastica.CosseratRod.straight_rod(
        n, start, direction, normal, 1.0, radius, density, youngs_modulus=young,
        shear_modulus=0.5 * young / (1.0 + POISSON),
    )  # fmt: skip
    made.append(rod)
    if curved:
        nodes = lm.models.CosseratRod(SECTION, 1.0, n).shape(CURVED)
        middles = lm.models.CosseratRod(SECTION, 1.0, 2 * n).shape(CURVED)[1::2]
        rod.position_collection[:] = nodes[:, :3, 3].T
        rod.director_collection[:] = np.transpose(middles[:, :3, :3], (2, 1, 0))
    made.constrain(rod).using(elastica.OneEndFixedBC, constrained_position_idx=(0,), constrained_director_idx=(0,))
    if gravity:
        made.add_forcing_to(rod).using(elastica.GravityForces, acc_gravity=np.array([0.0, 0.0, -gravity]))
    made.finalize()
    return made, rod


def elastica_steps(simulator: Any, h: float, steps: int) -> None:
    """So many steps of PyElastica."""
    stepper, t = elastica.PositionVerlet(), np.float64(0.0)
    for _ in range(steps):
        t = stepper.step(simulator, t, np.float64(h))


def energy_of(rod: Any) -> float:
    """Its own energy of a rod of PyElastica."""
    return float(
        rod.compute_translational_energy()
        + rod.compute_rotational_energy()
        + rod.compute_bending_energy()
        + rod.compute_shear_energy()
    )


def explicit(chosen: Any) -> dict[str, Any]:
    """Nanoseconds per element and step, and bands of the energy over 0.5 s."""
    kept, lines = {}, []  # type: dict[str, Any], list[Any]
    for n in (10, 100) if chosen.quick else (10, 50, 100, 1000, 4000):
        h, steps = 0.2 / n / WAVE, max(100, (200_000 if chosen.quick else 1_000_000) // n)
        runs: dict[str, Callable[[], Any]] = {}
        for name, tau in (("exp", lm.Exponential()), ("Cayley", lm.CayleyAdjoint())):
            for more, sums in ((", summed", None), ("", False)):
                plan, start, rod = ours(n, tau, h, steps, sums)
                runs[name + more] = functools.partial(plan.run, start, steps=steps)
        runs["field"] = functools.partial(as_a_field(rod, h, steps).run, start, steps=steps)
        cpp = InCpp(n)
        runs["C++"] = functools.partial(cpp.run, h, steps)
        few = max(20, steps // 20)
        if elastica is not None:
            simulator, theirs = in_elastica(n, YOUNG, DENSITY, RADIUS)
            runs["PyElastica"] = functools.partial(elastica_steps, simulator, h, few)
        for run in runs.values():
            run()
        times = least(runs, 3 if chosen.quick else 7)
        ns = {k: 1e9 * t / n / (few if k == "PyElastica" else steps) for k, t in times.items()}
        bands: dict[str, float] = {}
        if n <= 100:
            fine = 0.1 * h
            swing = round(0.5 / fine)
            plan = lm.Plan(rod, lm.KickDrift(), h=fine, every=swing // 200, record=("energy",), progress=False)
            energy = plan.run(start, steps=swing).energy
            bands["ours"] = float(np.ptp(energy) / energy[0])
            wider = 4.0 * fine
            plan = lm.Plan(
                rod, lm.KickDrift(order=4), h=wider, every=max(1, swing // 800), record=("energy",), progress=False
            )
            energy = plan.run(start, steps=swing // 4).energy
            bands["order 4"] = float(np.ptp(energy) / energy[0])
            if elastica is not None:
                simulator, theirs = in_elastica(n, YOUNG, DENSITY, RADIUS)
                energies = []
                elastica_steps(simulator, fine, 1)
                for _ in range(50):
                    energies.append(energy_of(theirs))
                    elastica_steps(simulator, fine, swing // 50)
                bands["PyElastica"] = float(np.ptp(energies) / energies[0])
        kept[str(n)] = {"ns": ns, "bands": bands}
        peer = ns.get("PyElastica")
        lines.append(
            [n, ns["exp, summed"], ns["exp"], ns["Cayley, summed"], ns["Cayley"], ns["C++"], peer,
             ns["field"] / ns["exp"], ns["exp"] / ns["C++"], ns["Cayley"] / ns["C++"], peer and ns["exp"] / peer,
             peer and ns["Cayley"] / peer, bands.get("ours"), bands.get("order 4"),
             bands.get("PyElastica")]
        )  # fmt: skip
    table(
        "explicit steps: nanoseconds per element and step, ratios, and changes of the energy",
        ["elements", "exp, summed", "exp", "Cayley, summed", "Cayley", "C++", "PyElastica", "field / rod", "exp / C++",
         "Cayley / C++", "exp / PyE.", "Cayley / PyE.", "energy", "order 4, 4 h", "PyElastica's"],
        lines,
    )  # fmt: skip
    return kept


STIFF = dict(young=50e9, density=5000.0, radius=0.005)
LEVEL = [[0, 0, 1, 0], [0, 1, 0, 0], [-1, 0, 0, 0], [0, 0, 0, 1]]
"""The first frame of a rod along x."""


def implicit(chosen: Any) -> dict[str, Any]:
    """A rod of 50 GPa under its weight: the time to the end and the error of the tip."""
    n, T, short = (50 if chosen.quick else 100), 0.1, 1.5e-6
    section = lm.models.RodSection.round(STIFF["radius"], STIFF["young"], STIFF["density"], POISSON)

    def swing(elements: int, h: float) -> tuple[Any, Any, int]:
        rod = lm.models.CosseratRod(section, 1.0, elements, gravity=9.81)
        steps = round(T / h)
        method = lm.GalerkinVariational(order=2)
        plan = lm.Plan(rod, method, h=T / steps, every=steps, progress=False, compiled=True)
        return plan, rod.at_rest(rod.shape(start=LEVEL)), steps

    plan, start, steps = swing(2 * n if chosen.quick else 400, 2e-5)
    exact = plan.run(start, steps=steps).g[-1, -1, :3, 3]
    kept: dict[str, Any] = {}
    lines = []
    runs: dict[str, Any] = {}
    for factor in (50, 100, 200, 400):
        plan, start, steps = swing(n, factor * short)
        runs[f"ours, {factor} times"] = (functools.partial(plan.run, start, steps=steps), factor)
    for name, (run, factor) in runs.items():
        off = float(np.abs(run().g[-1, -1, :3, 3] - exact).max())
        seconds = least({name: run}, 3)[name]
        kept[name] = {"seconds": seconds, "error": off, "h": factor * short}
    if elastica is not None:
        steps = round(T / short)
        simulator, rod = in_elastica(n, gravity=9.81, curved=False, **STIFF)
        elastica_steps(simulator, 1e-12, 1)
        seconds = least({"": functools.partial(elastica_steps, simulator, short, steps)}, 1)[""]
        off = float(np.abs(rod.position_collection[:, -1] - exact).max())
        kept["PyElastica"] = {"seconds": seconds, "error": off, "h": short}
    peer = kept.get("PyElastica", {}).get("seconds")
    for name, one in kept.items():
        lines.append([name, one["h"], one["seconds"], one["error"], peer and one["seconds"] / peer])
    table(
        f"a rod of 50 GPa, {n} elements, to t = {T}",
        ["", "h", "s", "error of the tip in m", "/ PyElastica"], lines,
    )  # fmt: skip
    return kept


COMPILED = """
import sys, time
import liemech as lm
import liemech.compiler.translation.translator, liemech.compiler.sites.loops_over_sites, llvmlite.binding
section = lm.models.RodSection.round(0.02, 1e6, 1000.0)
rod = lm.models.CosseratRod(section, 1.0, int(sys.argv[2]), gravity=9.81)
method = {"KickDrift()": lm.KickDrift(), "GalerkinVariational(order=2)": lm.GalerkinVariational(order=2)}[sys.argv[1]]
start = rod.at_rest()
begun = time.process_time()
lm.integrate(rod, method, start, h=1e-6, steps=5, compiled=True, progress=False)
print(time.process_time() - begun)
"""


def compiling(chosen: Any) -> dict[str, float]:
    """Processor seconds until the first steps are made, in new processes without code on disk."""
    found, lines = {}, []
    for method in ("KickDrift()", "GalerkinVariational(order=2)"):
        for n in (10,) if chosen.quick else (10, 1000):
            told = subprocess.run(
                [sys.executable, "-c", COMPILED, method, str(n)],
                env=os.environ | {"LIEMECH_CACHE_DIR": os.devnull}, check=True, capture_output=True,
            )  # fmt: skip
            found[f"{method} {n}"] = float(told.stdout)
            lines.append([method, n, float(told.stdout)])
    table("seconds of compiling", ["", "elements", "s"], lines)
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    kept = {"explicit": explicit(chosen), "implicit": implicit(chosen), "compiling": compiling(chosen)}
    if chosen.out:
        write(chosen.out, kept)


if __name__ == "__main__":
    main()
