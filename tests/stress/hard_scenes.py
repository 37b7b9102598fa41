"""Hard scenes: every run keeps its structure to rounding, or is refused by an error of the package with finite samples."""

from __future__ import annotations

import functools
import itertools
import warnings
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import rounding
from goals import CAYLEY, EXP, HJ4, Size, spread
from scenes import Oscillator, asymmetric_body, quiet_body

import liemech as lm

RKMK4 = lm.RKMK(order=4)
METHODS = (EXP, CAYLEY, HJ4, RKMK4, lm.ThreeRotations(), lm.ExactFreeBody())
Run = Callable[[], lm.Trajectory]


@dataclass(frozen=True)
class Scene:
    """A row of the table: what is hard, how its runs are made, and the largest change of a Casimir
    or of g^T g that is rounding.
    """

    name: str
    runs: Callable[[Size], Iterator[Run]]
    rounding: float = 1e-11


def free(body: lm.RigidBody, mu: object, h: float = 0.1, steps: int = 200) -> Iterator[Run]:
    """A run of a free body by each method."""
    start = body.state(mu, np.eye(3))
    for method in METHODS:
        yield functools.partial(lm.integrate, body, method, start, h=h, steps=steps, progress=False)


def separatrix(size: Size) -> Iterator[Run]:
    """On the curve itself, 2 H = |mu|^2/J_2, on the middle axis, and beside both by 1e-1 to 1e-300."""
    body, _ = asymmetric_body()
    J = np.array(body.inertia)
    slope = np.sqrt((1 / J[0] - 1 / J[1]) / (1 / J[1] - 1 / J[2]))  # mu_3/mu_1 on the curve
    on = np.array([1.0, 0.4, slope]) / np.linalg.norm([1.0, 0.4, slope])
    for delta in (0.0, *10.0 ** -np.array([1.0, 3.0, 8.0, 12.0, 16.0, 100.0, 300.0])):
        for mu in ([delta, 1.0, 0.0], [0.0, -1.0, delta], on + [delta, 0.0, 0.0]):
            yield from free(body, mu, steps=size.some(1000))


def fast_and_thin(size: Size) -> Iterator[Run]:
    """Rods and discs turned by 1e-2 to 1e4 rad a step."""
    for J in ([1.0, 1.0, 1e-3], [1.0, 1.0, 2e-6], [1e-3, 1.0, 1.0], [1.0, 1.0, 2.0], [1.0, 1e-3 + 1.0, 2.0]):
        for rate in (0.1, 1.0, 10.0, 1e2, 1e3, 1e5):
            yield from free(quiet_body(J), rate * np.array(J) * [0.5, -0.7, 0.6], steps=20)


def ratios(size: Size) -> Iterator[Run]:
    """Moments of inertia that differ by up to a million, in every order, turned about nothing in particular."""
    for ratio in (1e2, 1e4, 1e6):
        for J in itertools.permutations([1.0, ratio**0.5, ratio]):
            yield from free(quiet_body(J), [0.3, 0.5, -0.4], steps=size.some(200))


def sizes_of_momenta(size: Size) -> Iterator[Run]:
    """Velocities from 1e-300 to 1e8 rad/s with h = 0.1 s."""
    body, _ = asymmetric_body()
    for mu in spread(-300.0, 8.0, 15 if size.quick else 60):
        yield from free(body, mu, steps=50)


def steps_of_all_lengths(size: Size) -> Iterator[Run]:
    """From 1e-12 s to 1e6 s, for 1 rad/s."""
    body, start = asymmetric_body()
    for k in np.linspace(-12.0, 6.0, 10 if size.quick else 37):
        yield from free(body, start.mu, h=10.0**k, steps=50)


def denormals(size: Size) -> Iterator[Run]:
    """Momenta of a few times 5e-324, alone and beside ordinary ones."""
    body, _ = asymmetric_body()
    for tiny in (5e-324, 1e-320, 2.3e-308):
        for mu in ([tiny, -tiny, 2 * tiny], [tiny, 1.0, 0.0], [1.0, tiny, tiny]):
            yield from free(body, mu, steps=50)


def tops(size: Size) -> Iterator[Run]:
    """Heavy tops in gravity of 1 to 1e8 N, h = 0.01 s."""
    for weight in 10.0 ** np.linspace(0.0, 8.0, 5 if size.quick else 17):
        top = lm.models.HeavyTop([1.0, 1.5, 0.7], float(weight), [0.6, 0.0, 0.8])
        start = top.state([0.1, 0.2, 2.0], np.eye(3))
        for method in (lm.LieVerlet(lm.Cayley()), lm.LieVerlet(), lm.KickDrift()):
            yield functools.partial(lm.integrate, top, method, start, h=0.01, steps=50, progress=False)


def springs(size: Size) -> Iterator[Run]:
    """Oscillators with h w from 0.1 to 1e150: past h w = 2 an explicit method blows up, and says so."""
    for w in 10.0 ** np.linspace(0.0, 151.0, 8 if size.quick else 40):
        system = Oscillator(float(w))
        start = system.state([1.0], [0.0])
        for method in (lm.StormerVerlet(), lm.Splitting(order=4)):
            yield functools.partial(lm.integrate, system, method, start, h=0.1, steps=300, progress=False)


def rods(size: Size) -> Iterator[Run]:
    """A mass on a rod: h from 1e-12 s to 1e3 s, gravity up to 1e8 m/s^2, units of length by powers
    of two, and next to the upper point of rest.
    """
    methods = (lm.RATTLE(), lm.Composition(lm.RATTLE(), order=4), lm.GeodesicSplitting(order=4))
    steps = 10.0 ** np.linspace(-12.0, 3.0, 6 if size.quick else 16)
    cases = [(1.0, 1.0, float(h), 0.3) for h in steps]
    cases += [(1.0, 10.0**k, 0.01, 0.3) for k in range(9)]
    cases += [(2.0**k, 2.0**k, 0.05, 0.3) for k in (-150, -40, 40, 150)]
    cases += [(1.0, 1.0, 0.05, away) for away in (1e-3, 1e-8, 1e-16, 1e-160, 0.0)]
    for length, gravity, h, away in cases:
        system = lm.SphericalPendulum(length=length, gravity=gravity)
        up = away <= 1e-3
        q = np.array([away, 0.0, 1.0]) if up else np.array([0.6, 0.0, -0.8])
        p = np.zeros(3) if up else np.array([0.0, 0.7, 0.0])
        start = system.consistent(length * q, length * p)
        for method in methods:
            yield functools.partial(lm.integrate, system, method, start, h=h, steps=200, progress=False)


def eccentric(size: Size) -> Iterator[Run]:
    """Kepler's ellipses of e = 0 to 1 - 1e-12 in a time of their own, steps from 1e-12 to 1e3."""
    kepler, sigma = lm.Kepler(), lm.time_scales.DistancePower(1.5)
    pairs: list[tuple[lm.System, lm.Method]] = [
        (kepler, lm.ReversibleController(lm.StormerVerlet(), sigma)),
        (kepler, lm.ReversibleController(lm.Splitting(order=6), sigma)),
        (lm.TimeTransformed(kepler, sigma), lm.AdaptiveVerlet()),
    ]
    eccentricities = [0.0, 0.9, 0.999, 1.0 - 1e-6, 1.0 - 1e-9, 1.0 - 1e-12]
    steps = 10.0 ** np.linspace(-12.0, 3.0, 4 if size.quick else 11)
    cases = [(e, 0.02) for e in eccentricities] + [(0.9, float(h)) for h in steps]
    for e, h in cases:
        start = kepler.pericentre(e)
        for system, method in pairs:
            yield functools.partial(lm.integrate, system, method, start, h=h, steps=200, progress=False)


def powers(size: Size) -> Iterator[Run]:
    """Power series: momenta from 1e-300 to 1e8, and inertia ratios to 10^6; a step that is too
    large for the series is refused.
    """
    body, _ = asymmetric_body()
    cases = [(body, mu) for mu in spread(-300.0, 8.0, 8 if size.quick else 30)]
    cases += [(quiet_body([1.0, r**0.5, r]), np.array([0.3, 0.5, -0.4])) for r in (1e2, 1e4, 1e6)]
    for each, mu in cases:
        for method in (lm.Taylor(8), lm.Taylor(16)):
            yield functools.partial(lm.integrate, each, method, each.state(mu), h=0.1, steps=50, progress=False)


SCENES = (
    Scene("on the separatrix, and beside it by 1e-1 to 1e-300", separatrix),
    Scene("rods and discs, 1e-2 to 1e4 rad a step", fast_and_thin),
    Scene("inertia ratios 1e2, 1e4, 1e6, in every order", ratios),
    Scene("\\|xi\\| from 1e-300 to 1e8", sizes_of_momenta),
    Scene("h from 1e-12 to 1e6 s at 1 rad/s", steps_of_all_lengths),
    Scene("denormal momenta", denormals),
    Scene("tops of 1 to 1e8 N, h = 0.01 s", tops),
    Scene("springs, h w from 0.1 to 1e150", springs),
    Scene("rods: h from 1e-12 to 1e3 s, gravity to 1e8, lengths 2^-150 to 2^150, upright", rods),
    Scene("ellipses to e = 1 - 1e-12 in a time of their own, steps 1e-12 to 1e3", eccentric, 1e-8),
    Scene("power series: \\|xi\\| from 1e-300 to 1e8, inertia ratios to 1e6", powers),
)


def ended(run: Run, most: float) -> tuple[str, float]:
    """How a run ended: "kept", "refused", or what is wrong; and the largest change of what it keeps."""
    try:
        with warnings.catch_warnings(), np.errstate(all="ignore"):
            warnings.simplefilter("ignore")
            found, how = run(), "kept"
    except lm.errors.IntegrationFailure as error:
        found, how = error.trajectory, "refused"
    except lm.errors.LiemechError:
        return "refused", 0.0
    except Exception as error:
        return f"bare {type(error).__name__}", 0.0
    if not all(np.isfinite(x).all() for x in found.states.values()):
        return "not finite", 0.0
    change = 0.0
    if found.states.get("g") is not None:
        change = float(np.abs(np.swapaxes(found.g, -1, -2) @ found.g - np.eye(3)).max())
    if isinstance(found.system, lm.RigidBody) and (largest := np.abs(found.mu[0]).max()) > 1e-290:
        length = np.linalg.norm(found.mu / largest, axis=1)
        change = max(change, float(np.abs(length / length[0] - 1).max()))
    if isinstance(found.system, lm.SphericalPendulum):
        off = np.linalg.norm(found.q / found.system.length, axis=1) - 1.0
        change = max(change, float(np.abs(off).max()))
    if isinstance(found.system, lm.Kepler):
        (x, y), (u, v) = found.q.T, found.p.T
        turning = x * v - y * u  # angular momentum, beside its terms at the start
        change = max(change, float(np.abs(turning - turning[0]).max() / abs(turning[0])))
    return (how if change <= most else "lost"), change


def row(scene: Scene, size: Size) -> str:
    """How the runs of a scene ended."""
    ends = [ended(run, scene.rounding) for run in scene.runs(size)]
    count = Counter(how for how, _ in ends)
    wrong = {how: n for how, n in count.items() if how not in ("kept", "refused")}
    print(f"{scene.name}: {dict(count)}, {max(change for _, change in ends):.1e}", flush=True)
    shown = ", ".join(f"{n} {how}" for how, n in wrong.items()) or "0"
    return f"| {scene.name} | {len(ends)} | {count['kept']} | {count['refused']} | {shown} | {max(c for _, c in ends):.1e} |"


def there_and_back(size: Size) -> str:
    """How far a chaotic top is from its start after steps forth and back: only as long as the way
    back is known is it one.
    """
    top = lm.models.HeavyTop([1.0, 1.5, 0.7], 1.3, [0.6, 0.0, 0.8])
    cells, method = [], lm.LieVerlet(lm.Cayley())
    start = top.state([0.4, -0.3, 1.9], rounding.ATTITUDE)
    for precision in ("double", "double-double"):
        plan = lm.Plan(top, method, 0.05, every=10**6, precision=precision, progress=False)
        for steps in (100, 1000, 10_000):
            there = plan.run(start, steps=steps)
            back = plan.replace(h=-0.05).run(there.last, steps=steps)
            cells.append(f"{np.abs(back.mu[-1] - np.asarray(start.mu)).max():.0e}")
    return f"| {cells[0]} | {cells[1]} | {cells[2]} | {cells[3]} | {cells[4]} | {cells[5]} |"
