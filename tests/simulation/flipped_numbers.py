"""Saved runs, checkpoints and pickles with other numbers in them, each read and gone on with in a process of its
own that may take so much memory and no more.
"""

from __future__ import annotations

import contextlib
import copy
import functools
import os
import pickle
import pickletools
import random
import re
import resource
import signal
import struct
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from terms_of_spins import Exchange, Zeeman

import liemech as lm
from liemech.command_line.scene_file import scene_file
from liemech.rooms.files import arrays as files

ROOM = 10**9
"""Bytes beyond the file and the process that a trial may take."""
SECONDS = 20
"""Of processor time after which a trial is given up: code that runs for long is no fault here."""
NUMBERS = (0, 1, -1, 2, 3, 7, 2**31, 2**31 - 1, 2**63 - 1, -(2**31), 2**40, 10**15, 10**9)
REALS = (float("nan"), float("inf"), -float("inf"), 0.0, -1.0, 1e15, 1e300, 2.0**63, 1e-300)


@lm.record
class Tilt(lm.Potential):
    """A field that is the same everywhere."""

    pull: lm.Vec

    def energy(self, g: Any) -> float:
        return lm.dot(self.pull, g[:3, 3])


@lm.record
class Tie(lm.Term):
    """A spring between two places."""

    k: float

    def energy(self, a: Any, b: Any) -> float:
        apart = a.g[:3, 3] - b.g[:3, 3]
        return 0.5 * self.k * lm.dot(apart, apart)


@lm.record
class Driven(lm.GroupEquation):
    """A velocity by a table."""

    velocities: lm.PiecewisePolynomial

    def velocity(self, t: float, g: Any) -> lm.Vec:
        return self.velocities(t)


def turned(t: float, state: Any) -> Any:
    """An event."""
    return state.mu[1] - 10.0


def scenes() -> dict[str, tuple[lm.Plan, Any, dict[str, Any]]]:
    """Of every kind of run the plan, a start, and how far it goes."""
    rng, near = np.random.default_rng(3), lm.neighbours
    body, kepler = lm.RigidBody([1.0, 1.6, 2.3]), lm.Kepler()
    start = body.state(mu=[0.5, -0.3, 0.75], g=np.eye(3))
    three, twelve = {"steps": 3}, lm.SO3() ** 12
    spins = rng.normal(size=(12, 3))
    edges = near.edges([(i, (5 * i + 1) % 12) for i in range(1, 12)], sites=12)
    J, B = lm.each(rng.uniform(0.5, 1.0, 11)), lm.each(rng.normal(size=(12, 3)))
    pairs = lm.LiePoissonSystem(twelve, lm.Terms(Exchange(J).over(edges), Zeeman(B).over(), held=[3]))
    ring = lm.LiePoissonSystem(twelve, lm.Terms(Exchange(1.0).over(near.ring(12))))
    gas = lm.MechanicalSystem(
        lm.LiePoissonSystem(lm.SE3() ** 12, lm.Terms(lm.PerSite(lm.KineticEnergy([1.0] * 6)))),
        lm.Terms(Tie(0.3).over(near.within(3.0)), pinned=[2]),
    )
    poses = np.tile(np.eye(4), (12, 1, 1))
    poses[:, :3, 3] = 4.0 * rng.uniform(size=(12, 3))
    two = lm.SO3() ** 6 * lm.SO3() ** 5
    species = lm.LiePoissonSystem(
        two,
        lm.Terms(Exchange(1.0).over(near.ring(6), of=0), Exchange(0.5).over(near.between([(0, 1), (5, 4)]), of=(0, 1))),
    )
    chain = lm.joints.chain(4)
    hinges = lm.joints.chain(3, axis=[1.0, 0.0, 0.0])
    pushes = [lm.joints.Damper(1, 0.1), lm.joints.Spring(2, 0.5)]
    arm = lm.joints.Linkage(hinges.links, hinges.joints, forces=pushes, potential={1: Tilt([0.0, 0.1, 0.2])})
    table = lm.PiecewisePolynomial.linear(np.linspace(0.0, 2.0, 21), [[0.0, 1.0, 0.5]] * 21)
    driven = Driven(lm.VectorSpace(3), table)
    bodies = [lm.RigidBody([1.0 + 0.01 * i, 1.6, 2.3]) for i in range(20)]
    many = body.state(mu=np.tile([1.0, 2.0, 3.0], (20, 1)))
    starts = body.state(mu=[[1.0, 2.0, 3.0], [0.0, 1.0, 0.5]])
    fictive = lm.TimeTransformed(kepler, lm.time_scales.DistancePower(1.5))
    toda, stars = lm.models.TodaLattice(60, periodic=True), lm.models.NBody([1.0] * 20)
    rod = lm.models.CosseratRod(lm.models.RodSection([10.0] * 6, [1.0] * 6), 1.0, 6)
    q = rng.normal(size=60)
    return {
        "body": (lm.Plan(body, lm.CovariantVariational(), 0.1), start, three),
        "adaptive": (lm.Plan(body, lm.RKMK(order=5), rtol=1e-6, events=turned), start, {"t_end": 1.0}),
        "ensemble": (lm.Plan(body, lm.RKMK(order=3), 0.1), starts, three),
        "bodies": (lm.Plan(bodies, lm.RKMK(order=3), 0.1), many, three),
        "pairs": (lm.Plan(pairs, lm.RKMK(order=4), 0.1), pairs.state(mu=spins), three),
        "ring": (lm.Plan(ring, lm.SublatticeSplitting(), 0.1), ring.state(mu=spins), three),
        "adaptive ring": (lm.Plan(ring, lm.RKMK(order=5), rtol=1e-6), ring.state(mu=spins), {"t_end": 0.3}),
        "gas": (lm.Plan(gas, lm.KickDrift(), 0.01), gas.state(mu=np.zeros((12, 6)), g=poses), three),
        "species": (lm.Plan(species, lm.RKMK(order=2), 0.1), species.state(mu=[spins[:6], spins[:5]]), three),
        "chain": (lm.Plan(chain, lm.LieRATTLE(), 0.01), chain.state(angles={}), three),
        "arm": (lm.Plan(arm, lm.LieRATTLE(), 0.01), arm.state(angles={0: 0.3}), three),
        "table": (lm.Plan(driven, lm.RKMK(order=4), 0.1), driven.state(np.zeros(3)), three),
        "fictive": (lm.Plan(fictive, lm.AdaptiveVerlet(), 0.05), kepler.pericentre(0.3), {"t_end": 0.3}),
        "toda": (lm.Plan(toda, lm.Splitting(order=2), 0.05), toda.state_of(q, q), three),
        "stars": (lm.Plan(stars, lm.StormerVerlet(), 0.01), stars.state(rng.normal(size=60), np.zeros(60)), three),
        "rod": (lm.Plan(rod, lm.KickDrift(), 1e-3), rod.state(mu=np.zeros((rod.frames, 6)), g=rod.shape()), three),
    }


# ------------------------------------------------------------------ other numbers


def places(value: Any) -> Iterator[tuple[Any, Any]]:
    """The containers and keys of all numbers in a JSON value."""
    for key, x in list(value.items() if isinstance(value, dict) else enumerate(value)):
        if isinstance(x, (dict, list)):
            yield from places(x)
        elif isinstance(x, (int, float)):
            yield value, key


def other(x: Any, rng: random.Random) -> Any:
    """Another number in place of one of a text or an array."""
    if isinstance(x, bool):
        return not x
    near = [x + 1, x - 1, 2 * x] if isinstance(x, int) else [-x, x + 1.0, x * 1e9]
    return rng.choice([*NUMBERS, *near] if isinstance(x, int) else [*REALS, *near])


def flipped(arrays: dict[str, Any], about: dict[str, Any], rng: random.Random) -> tuple[Any, Any]:
    """What a file holds, with one to three other numbers; rarely in the samples, which nobody goes on from."""
    arrays, about = {name: x.copy() for name, x in arrays.items()}, copy.deepcopy(about)
    for _ in range(rng.choice((1, 1, 1, 2, 3))):
        whole = [(at, key) for at, key in places(about) if type(at[key]) is not float]
        numbers = [name for name, x in arrays.items() if x.size and not name.startswith("state.")]
        way = rng.random()
        if way < 0.65:
            at, key = rng.choice(whole)
            at[key] = other(at[key], rng)
        elif way < 0.75:
            at, key = rng.choice([*places(about)])
            at[key] = other(at[key], rng)
        else:
            x = arrays[rng.choice(numbers)].reshape(-1)
            i = rng.randrange(len(x))
            with np.errstate(all="ignore"), contextlib.suppress(OverflowError, TypeError):
                x[i] = other(x[i].item(), rng)
    return arrays, about


WIDTHS = {"BININT1": 1, "BININT2": 2, "BININT": 4, "BINFLOAT": 8}


@functools.lru_cache(64)
def places_in_pickle(data: bytes) -> list[tuple[int, int]]:
    """Where the numbers of a pickle begin, and how many bytes each has: its own, and those of arrays."""
    found = []
    for operation, value, at in pickletools.genops(data):
        if operation.name in WIDTHS:
            found.append((at + 1, WIDTHS[operation.name]))
        elif isinstance(value, bytes) and len(value) % 8 == 0:
            begin = data.index(value, at)
            found += [(begin + 8 * i, 8) for i in range(min(40, len(value) // 8))]
    return found


def pickled(data: bytes, rng: random.Random) -> bytes:
    """A pickle with one or two other numbers."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 2))):
        at, width = rng.choice(places_in_pickle(data))
        most = 2 ** (8 * width)
        x = rng.choice((0, 1, 2, 12, most - 1, most // 2, most // 2 - 1, rng.randrange(256)))
        number = (
            struct.pack("<d", rng.choice(REALS)) if width == 8 and rng.random() < 0.5 else x.to_bytes(width, "little")
        )
        out[at : at + width] = number
    return bytes(out)


# ------------------------------------------------------------------ trials


def used(run: Any, plan: lm.Plan, more: dict[str, Any]) -> Iterator[Callable[[], Any]]:
    """What a user does with a run that he was given: with whatever error, but without a crash."""
    further = {"steps": 2} if "steps" in more else {"t_end": 2.0 * more["t_end"], "steps": 50}
    yield lambda: repr(run)
    yield lambda: run.at(run.t[:2])
    yield lambda: run.energy
    yield lambda: run.drift()
    yield lambda: lm.viewer.Scene(run)
    yield lambda: plan.replace(system=run.system, method=run.method).resume(run, **further)
    yield lambda: plan.replace(system=run.system, method=run.method).run(run.last, **further)
    yield lambda: plan.resume(run, **further)


def in_a_child(work: Callable[[], None], size: int = 0, seconds: int = SECONDS) -> tuple[str, str]:
    """How a piece of work ends in a process of its own that may take `ROOM` and the size of a file, and so much
    processor time: "done", "memory", "slow", "signal 11", ...; and what it tells.
    """
    end, begin = os.pipe()
    child = os.fork()
    if child == 0:
        told = "done"
        try:
            os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            most = pages * os.sysconf("SC_PAGE_SIZE") + size + ROOM
            resource.setrlimit(resource.RLIMIT_AS, (most, most))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 10))
            work()
        except BaseException as error:
            told = "memory" if out_of_memory(error) else f"{type(error).__name__}"
            lines = traceback.format_exception(error)
            os.write(begin, f"{told}\n{''.join(lines[-40:])}".encode()[-60_000:])
            os._exit(0)
        os.write(begin, b"done\n")
        os._exit(0)
    os.close(begin)
    with os.fdopen(end, "rb") as file:
        told = file.read().decode(errors="replace")
    _, status = os.waitpid(child, 0)
    if os.WIFSIGNALED(status) and os.WTERMSIG(status) == signal.SIGXCPU:
        return "slow", told
    if os.WIFSIGNALED(status):
        return f"signal {os.WTERMSIG(status)}", told
    return told.partition("\n")[0], told


def faults(ways: Iterable[str]) -> set[str]:
    """Those ways to end that no number may lead to."""
    return {way for way in ways if way in ("memory", "BufferOverrun") or way.startswith("signal")}


def out_of_memory(error: BaseException | None) -> bool:
    """Is it an error of memory, or one that came of such an error?"""
    while error is not None:
        if isinstance(error, MemoryError) or "allocate" in str(error).lower():
            return True
        error = error.__cause__ or error.__context__
    return False


def trial(path: Path, plan: lm.Plan, more: dict[str, Any]) -> None:
    """Read a file and go on with it."""
    if path.suffix == ".pickle":
        theirs, run = pickle.loads(path.read_bytes())
    else:
        theirs, run = plan, lm.Trajectory.load(path)
    for use in (*used(run, plan, more), *(used(run, theirs, more) if theirs is not plan else ())):
        try:
            use()
        except Exception as error:
            if out_of_memory(error) or isinstance(error, lm.errors.BufferOverrun):
                raise


def fuzz(kinds: list[str], cases: int, seed: int, folder: Path, seconds: int = SECONDS) -> Counter[str]:
    """How many trials ended in which way; of those that are faults a copy of the file stays in the folder."""
    rng, written, ended, every = random.Random(seed), {}, Counter[str](), scenes()
    for name in kinds:
        plan, start, more = every[name]
        plan = plan.replace(compiled=True)
        run = plan.run(start, **more)
        path = folder / f"{name}.npz"
        run.save(path)
        trial(path, plan, more)  # native code is there, and the process as large as it must be
        data = pickle.dumps((plan, run))
        (folder / "run.pickle").write_bytes(data)
        trial(folder / "run.pickle", plan, more)
        written[name] = plan, more, files.read(path), data
    for case in range(cases):
        name = rng.choice(kinds)
        plan, more, held, data = written[name]
        by_pickle = rng.random() < 0.2
        path = folder / ("run.pickle" if by_pickle else "run.npz")
        if by_pickle:
            path.write_bytes(pickled(data, rng))
        else:
            files.write(path, *flipped(*held, rng))
        way, told = in_a_child(
            lambda path=path, plan=plan, more=more: trial(path, plan, more), path.stat().st_size, seconds
        )
        ended[way] += 1
        if faults([way]):
            kept = folder / f"fault {way} {name} {seed} {case}{path.suffix}"
            kept.write_bytes(path.read_bytes())
            kept.with_suffix(".txt").write_text(told)
    return ended


# ------------------------------------------------------------------ texts

MASS = '<inertial><mass value="1.5"/><inertia ixx="1" iyy="1.2" izz="1.4" ixy="0" ixz="0.1" iyz="0"/></inertial>'
ROBOT = f"""<robot><link name="a"/>
{"".join(f'<link name="{x}">{MASS}<visual><geometry><box size="1 2 3"/></geometry></visual></link>' for x in "bcd")}
<joint name="1" type="revolute"><parent link="a"/><child link="b"/><axis xyz="1 0 0"/><origin xyz="0 0 1" rpy="0 0 0.5"/>
<limit effort="10" velocity="2" lower="-1" upper="1"/><dynamics damping="0.1" friction="0.2"/></joint>
<joint name="2" type="prismatic"><parent link="b"/><child link="c"/><axis xyz="0 0 1"/><origin xyz="0 1 1"/>
<limit effort="10" velocity="2" lower="-1" upper="1"/></joint>
<joint name="3" type="continuous"><parent link="c"/><child link="d"/><axis xyz="0 1 0"/></joint></robot>"""
TEXTS = (
    """[system]
name = "RigidBody"
inertia = [1.0, 1.5, 2.0]
[start]
mu = [0.5, 0.0, 0.866]
g = "identity"
[method]
name = "RKMK"
order = 4
[run]
h = 0.1
steps = 10
every = 2
""",
    """[system]
name = "LiePoissonSystem"
group = "SO(4)"
hamiltonian = "KineticEnergy([1.0, 1.5, 2.0, 1.0, 1.2, 3.0])"
[start]
mu = [0.5, 0.0, 0.866, 0.1, 0.2, 0.3]
[method]
name = "Composition"
base = "CovariantVariational()"
order = 4
[run]
h = 0.1
steps = 10
""",
    """[system]
name = "TodaLattice"
particles = 3
[start]
y = [0.5, 0.3, 0.866, 0.1, 0.2]
[method]
name = "Splitting"
order = 2
[run]
h = 0.1
steps = 10
""",
)


def read_text(path: Path, compiled: bool) -> None:
    """Read a robot or a scene, and let it move."""
    if path.suffix == ".urdf":
        robot = lm.joints.Linkage.from_urdf(path, stops=1.0, armature=0.1)
        lm.integrate(robot, lm.LieRATTLE(), robot.state(angles={}), h=1e-3, steps=2, compiled=compiled)
    else:
        scene = scene_file(path)
        lm.integrate(scene.system, scene.method, scene.start, h=scene.h, steps=2, compiled=compiled)


def fuzz_texts(cases: int, seed: int, folder: Path, compiled: bool) -> Counter[str]:
    """How many robots and scenes with other numbers ended in which way."""
    rng, ended = random.Random(seed), Counter[str]()
    files_of = [(folder / "robot.urdf", ROBOT), *[(folder / f"scene{i}.toml", text) for i, text in enumerate(TEXTS)]]
    for path, text in files_of:
        path.write_text(text)
        read_text(path, compiled)
    for case in range(cases):
        path, text = rng.choice(files_of)
        for _ in range(rng.choice((1, 1, 2))):
            found = rng.choice([*re.finditer(r"-?\d+(\.\d+)?", text)])
            x: Any = float(found[0]) if "." in found[0] else int(found[0])
            text = text[: found.start()] + str(other(x, rng)) + text[found.end() :]
        path.write_text(text)
        way, told = in_a_child(lambda path=path: read_text(path, compiled))
        ended[way] += 1
        if faults([way]):
            (folder / f"fault {way} {seed} {case}{path.suffix}").write_text(text)
            (folder / f"fault {way} {seed} {case}.txt").write_text(told)
    return ended
