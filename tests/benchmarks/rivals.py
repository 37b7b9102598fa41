"""Other packages in the races of the leader board, whichever are installed, each in the form that suits it best.

Those for smooth equations, heyoka, SciPy and diffrax, read the equations of `races.py`.  Exudyn, Lielab, MuJoCo and
REBOUND have bodies or groups of their own and take part where they have the problem.
"""

from __future__ import annotations

import importlib
import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from typing import Any

import numpy as np
import peers
from races import MOMENTS, MU, PULL, SUNS, TOP_LOAD, TOP_MOMENTS, Race

Run = Callable[[], Any]  # a whole call; what it gives is turned into outputs later, outside of the time
TIGHTEST = peers.TIGHTEST
tolerances, doubled = peers.tolerances, peers.doubled


@dataclass(frozen=True)
class Entry:
    """A method of a package in a race: its tolerances or numbers of steps between outputs;
    `prepare` sets a run up.

    outputs : of what a run gives, (count, k).  closed : is it the closed form of the motion, or a
    step that is?  fast : was its machine code made with arithmetic that may be rearranged, so that
    the bits of a result depend on the compiler?
    """

    package: str
    method: str
    settings: tuple[float, ...]
    prepare: Callable[[float], Run]
    outputs: Callable[[Any], np.ndarray]
    closed: bool = False
    fast: bool = False

    @property
    def counted(self) -> bool:
        """Are the settings numbers of steps?"""
        return all(s >= 1.0 and s == round(s) for s in self.settings)


def entries(race: Race) -> tuple[list[Entry], dict[str, str | None]]:
    """All that are installed and have the problem, and the version of each package, None if it is missing."""
    found: list[Entry] = []
    versions: dict[str, str | None] = {}
    for package, make in PACKAGES.items():
        try:
            with warnings.catch_warnings(action="ignore"):
                found += make(race)
        except (ImportError, OSError):
            versions[package] = None
        else:
            versions[package] = version(package)
    return found, versions


def version(package: str) -> str | None:
    """Of a package, None if it is not installed."""
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


# ------------------------------------------------------------------ packages for smooth equations


def heyoka(race: Race) -> list[Entry]:
    """Taylor series of an order that the tolerance asks for, compiled; with `fast_math` as well,
    which lets LLVM rearrange sums.  Nothing comes from its disk cache: setting up is measured.
    """
    hy: Any = importlib.import_module("heyoka")
    hy.llvm_state.set_diskcache_enabled(False)
    hy.llvm_state.set_memcache_limit(0)
    system, order = _equations_of_heyoka(hy, race)
    grid, first = np.array([0.0, *race.times]), np.array(race.start)[order]
    back = np.argsort(order)

    def prepare(tolerance: float, fast: bool) -> Run:
        integrator = hy.taylor_adaptive(system, first, tol=tolerance, fast_math=fast)

        def run() -> Any:
            integrator.time = 0.0
            integrator.state[:] = first
            return integrator.propagate_grid(grid)[-1]

        return run

    def outputs(y: np.ndarray) -> np.ndarray:
        return race.outputs(y[1:, back])

    settings = (*tolerances(-1, -15)[::2], 2.3e-16)
    found = [
        Entry("heyoka", name, settings, partial(prepare, fast=fast), outputs, fast=fast)
        for name, fast in (("Taylor", False), ("Taylor, fast_math", True))
    ]
    return [*found, _ellipse_of_heyoka(hy, race)] if race.key == "kepler" else found


def _equations_of_heyoka(hy: Any, race: Race) -> tuple[Any, np.ndarray]:
    """The equations, and which of our numbers are its own: gravity has a model there, whose code is made in a second."""
    if race.key == "planets":
        system = hy.model.nbody(len(SUNS), masses=list(SUNS), Gconst=PULL)
        places = np.arange(36).reshape(2, len(SUNS), 3)  # x, y, z, then velocities
        return system, places.transpose(1, 0, 2).ravel()
    variables = hy.make_vars(*[f"y{i}" for i in range(len(race.start))])
    rates = race.rates(hy, hy.time, variables)
    return list(zip(variables, rates, strict=True)), np.arange(len(race.start))


def _ellipse_of_heyoka(hy: Any, race: Race) -> Entry:
    """The closed form: Kepler's equation, `kepE`, in a compiled function of the mean anomaly.

    It starts at the pericentre, with semi-axis and mean motion one.
    """
    mean, e = hy.make_vars("M"), 1.0 - race.start[0]
    eccentric, minor = hy.kepE(hy.expression(e), mean), math.sqrt(1.0 - e * e)
    c, s = hy.cos(eccentric), hy.sin(eccentric)
    rate = 1.0 / (1.0 - e * c)
    times, found = race.times[None], np.empty((4, race.count))

    def prepare(_: float) -> Run:
        place = hy.cfunc([c - e, minor * s, -s * rate, minor * c * rate], vars=[mean])
        return lambda: place(times, outputs=found)

    return Entry("heyoka", "kepE in a cfunc", (0.0,), prepare, lambda y: race.outputs(y.T), closed=True)


def scipy(race: Race) -> list[Entry]:
    """DOP853, LSODA and Radau, the right-hand side in Python."""
    return _scipy(race, "Python", lambda t, y: race.rates(math, t, y.tolist()))


def scipy_numba(race: Race) -> list[Entry]:
    """The same with a right-hand side in machine code."""
    numba: Any = importlib.import_module("numba")
    return _scipy(race, "Numba", _machine_code(numba, race))


def _machine_code(numba: Any, race: Race) -> Callable[..., Any]:
    """The equations, written out as straight lines by SymPy's printer, and compiled."""
    sympy: Any = importlib.import_module("sympy")
    y = sympy.symbols(f"y:{len(race.start)}")
    t = sympy.Symbol("t")
    shared, rates = sympy.cse([sympy.sympify(rate) for rate in race.rates(sympy, t, y)])
    lines = ["def f(t, y):", f"    {', '.join(map(str, y))}, = y", f"    rates = empty({len(rates)})"]
    lines += [f"    {name} = {sympy.pycode(value).replace('math.', '')}" for name, value in shared]
    lines += [f"    rates[{i}] = {sympy.pycode(rate).replace('math.', '')}" for i, rate in enumerate(rates)]
    space: dict[str, Any] = {"empty": np.empty, "sin": math.sin, "cos": math.cos, "sqrt": math.sqrt}
    exec("\n".join([*lines, "    return rates"]), space)
    made: Callable[..., Any] = numba.njit(space["f"])
    return made


def _scipy(race: Race, label: str, f: Callable[..., Any]) -> list[Entry]:
    integrate: Any = importlib.import_module("scipy.integrate")
    if race.key == "long" and label == "Python":
        return []  # minutes

    def prepare(tolerance: float, method: str) -> Run:
        options = {"method": method, "rtol": tolerance, "atol": tolerance, "t_eval": race.times}
        return lambda: integrate.solve_ivp(f, (0.0, race.end), race.start, **options).y.T

    within = {"DOP853": tolerances(-3, -13)[::2], "LSODA": tolerances(-4, -12)[::2], "Radau": tolerances(-3, -9)[::2]}
    return [
        Entry("SciPy", f"{method}, {label}", settings, partial(prepare, method=method), race.outputs)
        for method, settings in within.items()
    ]


def diffrax(race: Race) -> list[Entry]:
    """Tsit5 and Dopri8 with a controller of PID type, compiled once by JAX; the tolerance is an argument."""
    jax: Any = importlib.import_module("jax")
    dx: Any = importlib.import_module("diffrax")
    jax.config.update("jax_enable_x64", True)
    np_like = jax.numpy

    def field(t: Any, y: Any, args: Any) -> Any:
        return np_like.stack(race.rates(np_like, t, [y[i] for i in range(len(race.start))]))

    first, grid = np_like.array(race.start), dx.SaveAt(ts=np_like.array(race.times))

    def solver(kind: Any) -> Any:
        @jax.jit
        def solve(tolerance: Any) -> Any:
            controller = dx.PIDController(rtol=tolerance, atol=tolerance)
            term = dx.ODETerm(field)
            return dx.diffeqsolve(
                term, kind, 0.0, race.end, None, first, saveat=grid, stepsize_controller=controller, max_steps=10**7, throw=False
            ).ys  # fmt: skip

        return solve

    def entry(name: str, settings: tuple[float, ...]) -> Entry:
        solve = solver(getattr(dx, name)())
        return Entry("diffrax", name, settings, lambda tolerance: lambda: np.asarray(solve(tolerance)), race.outputs)

    return [entry("Tsit5", tolerances(-3, -9)[::2]), entry("Dopri8", tolerances(-4, -13)[::3])]


# ------------------------------------------------------------------ packages of bodies and groups


def _problem(race: Race) -> peers.Problem | None:
    """The body of `peers.py`, if it is one."""
    if race.key == "top":
        start: Any = race.start
        return peers.Problem(
            race.name, TOP_MOMENTS, start[:3], tuple(race.times), TOP_LOAD, start[3:], 100.0 / race.end
        )
    if race.key in ("attitude", "long"):
        return peers.Problem(race.name, MOMENTS, MU, tuple(race.times), pace=100.0 / race.end)
    return None


def _both(results: Any) -> np.ndarray:
    return np.array([[*mu, *g.ravel()] for mu, g in results])


def _of_peers(
    race: Race, contenders: Callable[[], list[peers.Contender]], chosen: dict[str, tuple[float, ...]]
) -> list[Entry]:
    """The contenders of `peers.py` that are chosen, with settings for this race: steps of the whole
    time, or tolerances.
    """
    problem = _problem(race)
    if problem is None:
        return []
    known = {contender.method: contender for contender in contenders()}
    return [
        Entry(known[name].package, name, settings, partial(known[name].prepare, problem), _both)
        for name, settings in chosen.items()
    ]


def exudyn(race: Race) -> list[Entry]:
    """Explicit Lie group methods of a rigid body; forces of other problems would be called back in Python."""
    importlib.import_module("exudyn")
    fine = 1000.0 if race.end > 1e4 else 1.0
    steps = {"RK67": doubled(50, 6), "RK44": doubled(400, 4)}
    return _of_peers(race, peers.exudyn, {name: tuple(fine * x for x in n) for name, n in steps.items()})


def lielab(race: Race) -> list[Entry]:
    """Munthe-Kaas methods, called back in Python."""
    importlib.import_module("lielab")
    if race.key == "driven":
        return [_lielab_driven(race)]
    if race.end > 1e4:
        return []  # minutes
    return _of_peers(race, peers.lielab, {"RKMK RKV98r": tolerances(-3, -13)[::2]})


def _lielab_driven(race: Race) -> Entry:
    """(g^T)' = -xi g^T: velocities of Lielab act from the left."""
    domain: Any = importlib.import_module("lielab.domain")
    integrate: Any = importlib.import_module("lielab.integrate")

    def velocity(t: float, place: Any) -> Any:
        xi = domain.so(3)
        xi.set_vector(-np.array([math.cos(2.0 * t), math.sin(t), 1.0 + 0.5 * math.cos(3.0 * t)]))
        return domain.CompositeAlgebra([xi])

    def prepare(tolerance: float) -> Run:
        system, options = integrate.HomogeneousIVPSystem(velocity), integrate.IVPOptions()
        options.method = integrate.IVPMethod.MuntheKaas
        options.coefficients = integrate.RungeKuttaCoefficients.RKV98r
        options.variable_time_step = True
        options.reltol = options.abstol = tolerance
        options.dt, options.dt_max = 0.05, 10.0

        def run() -> Any:
            place, found, begin = domain.CompositeManifold([domain.SO(np.eye(3))]), [], 0.0
            for end in race.times.tolist():
                place = integrate.solve_ivp(system, np.array([begin, end]), place, options).y[-1]
                found.append(np.array(place.point[0].get_matrix()).T.ravel())
                begin = end
            return np.array(found)

        return run

    return Entry("Lielab", "RKMK RKV98r", tolerances(-3, -13)[::2], prepare, np.asarray)


def mujoco(race: Race) -> list[Entry]:
    """RK4 of its rigid body, in its own loop over steps; a rod without thickness, the pendulum, has
    no inertia that it accepts.
    """
    mj: Any = importlib.import_module("mujoco")
    rollout: Any = importlib.import_module("mujoco.rollout")
    if race.key not in ("attitude", "top"):
        return []
    heavy = race.key == "top"
    moments, load, mass = np.array(TOP_MOMENTS if heavy else MOMENTS), np.array(TOP_LOAD), 1.3
    place = (
        load / (mass * 1e4) if heavy else np.zeros(3)
    )  # gravity is 1e4, the arm is short: the body is nearly its own centre
    inertia = np.diag(moments) - mass * (place @ place * np.eye(3) - np.outer(place, place))
    i = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].tolist()

    def words(values: Any) -> str:
        return " ".join(f"{x!r}" for x in np.asarray(values).tolist())

    def prepare(setting: float) -> Run:
        steps = round(setting)
        h, gravity = race.end / race.count / steps, -1e4 if heavy else 0.0
        xml = f"""<mujoco><option timestep="{h!r}" integrator="RK4" gravity="0 0 {gravity}"/>
        <worldbody><body><joint type="ball"/>
        <inertial mass="{mass}" pos="{words(place)}" fullinertia="{words(i)}"/></body></worldbody>
        </mujoco>"""
        model = mj.MjModel.from_xml_string(xml)
        data = mj.MjData(model)
        data.qpos[:] = race.start[3:]
        data.qvel[:] = np.array(race.start[:3]) / moments
        first = np.empty(mj.mj_stateSize(model, mj.mjtState.mjSTATE_FULLPHYSICS))
        mj.mj_getState(model, data, first, mj.mjtState.mjSTATE_FULLPHYSICS)

        def run() -> Any:
            states, _ = rollout.rollout(model, data, first[None], nstep=steps * race.count)
            return states[0, steps - 1 :: steps]

        return run

    def outputs(states: Any) -> np.ndarray:  # time, quaternion, velocity
        return race.outputs(np.concatenate([states[:, 5:8] * moments, states[:, 1:5]], axis=1))

    return [Entry("MuJoCo", "RK4", tuple(x / 10 for x in doubled(400, 5)), prepare, outputs)]


def rebound(race: Race) -> list[Entry]:
    """Points in gravity: IAS15, and WHFast and SABA, whose step of two bodies is the exact motion.

    A simulation is made once, and set back to the start by each run; IAS15 remembers its last steps,
    so that each run has a copy.
    """
    rb: Any = importlib.import_module("rebound")
    if race.key not in ("kepler", "planets"):
        return []
    first = np.array(race.start)

    def simulation() -> Any:
        made = rb.Simulation()
        if race.key == "kepler":
            made.add(m=1.0)
            made.add(m=0.0, x=first[0], y=first[1], vx=first[2], vy=first[3])
            return made
        made.G = PULL
        places, speeds = first.reshape(2, 6, 3).tolist()
        for mass, x, v in zip(SUNS, places, speeds, strict=True):
            made.add(m=mass, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
        return made

    def outputs(found: np.ndarray) -> np.ndarray:
        if race.key == "kepler":
            return found[:, :, 1, :2].reshape(race.count, 4)
        return found[:, 0].reshape(race.count, 18)

    times = race.times.tolist()

    def adaptive(setting: float) -> Run:
        made = simulation()
        made.integrator = "ias15"
        made.integrator.epsilon = setting
        found = np.empty((race.count, 2, made.N, 3))

        def run() -> Any:
            moving = made.copy()
            for t, (places, speeds) in zip(times, found, strict=True):
                moving.integrate(t)
                moving.serialize_particle_data(xyz=places, vxvyvz=speeds)
            return found

        return run

    def fixed(setting: float, method: str, options: dict[str, Any]) -> Run:
        made = simulation()
        made.integrator = method
        for name, value in {"safe_mode": 0, **options}.items():
            setattr(made.integrator, name, value)
        steps = round(setting)
        made.dt = race.end / race.count / steps
        x, v = np.empty((made.N, 3)), np.empty((made.N, 3))
        made.serialize_particle_data(xyz=x, vxvyvz=v)
        found = np.empty((race.count, 2, made.N, 3))

        def run() -> Any:
            made.set_serialized_particle_data(xyz=x, vxvyvz=v)
            made.t, made.did_modify_particles = 0.0, 1
            for places, speeds in found:
                made.steps(steps)
                made.synchronize()
                made.serialize_particle_data(xyz=places, vxvyvz=speeds)
            return found

        return run

    def entry(name: str, settings: tuple[float, ...], method: str, closed: bool = False, **options: Any) -> Entry:
        prepare = partial(fixed, method=method, options=options)
        return Entry("REBOUND", name, settings, prepare, outputs, closed)

    within = (1e-1, 1e-3, 1e-5, 1e-7, 1e-9)
    found = [Entry("REBOUND", "IAS15", within, adaptive, outputs)]
    if race.key == "kepler":
        return [*found, entry("WHFast", (1.0, 4.0), "whfast", True)]
    steps = doubled(1, 10)
    best = {"corrector": 17, "corrector2": 1, "kernel": "LAZY"}
    return [
        *found,
        entry("WHFast", steps, "whfast"),
        entry("WHFast, corrector 17", steps, "whfast", corrector=17),
        entry("WHFast, correctors and lazy kernel", steps, "whfast", **best),
        entry("WHFast, democratic heliocentric", steps, "whfast", coordinates="DEMOCRATICHELIOCENTRIC"),
        entry("SABA 4", steps, "saba", type="4"),
        entry("SABA 4, corrected", steps, "saba", type="CL_4"),
        entry("SABA (10, 4)", steps, "saba", type="10_4"),
        entry("SABA (8, 6, 4)", steps, "saba", type="8_6_4"),
        entry("SABA (10, 6, 4)", steps, "saba", type="10_6_4"),
    ]


PACKAGES: dict[str, Callable[[Race], list[Entry]]] = {
    "heyoka": heyoka,
    "scipy": scipy,
    "numba": scipy_numba,
    "diffrax": diffrax,
    "exudyn": exudyn,
    "lielab": lielab,
    "mujoco": mujoco,
    "rebound": rebound,
}
