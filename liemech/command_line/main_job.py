"""The main job, `python -m liemech`: a rigid body by several methods and in closed form, a table and a picture."""

from __future__ import annotations

import argparse
import functools
import math
import sys
import textwrap
import timeit
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import liemech as lm

from ..simulation.reports.drift import Drift
from ..simulation.reports.progress import named
from .options import Parser, count, duration, number, picture, short

METHODS: dict[str, tuple[str, lm.Method]] = {
    "rkmk4": ("RKMK4", lm.RKMK(order=4)),
    "cayley": ("Algorithm 1, Cayley", lm.CovariantVariational(lm.Cayley())),
    "exp": ("Algorithm 1, exp", lm.CovariantVariational(lm.Exponential())),
    "hj4": ("Hamilton-Jacobi 4", lm.LiePoissonHamiltonJacobi(order=4)),
}
SAMPLES = 100_000  # of longer runs not every state is kept
TIMED = 20_000  # steps of the short native run that tells what a step costs

VIEW = (28.0, 38.0)  # azimuth and elevation from which most of the usual curve lies in front

PHYSICS = """\
the physics:
  A rigid body turns freely about its centre of mass. In the body, its angular
  momentum mu obeys Euler's equation mu' = mu x w with w = J^-1 mu; its attitude
  g, the rotation from body to space, follows by g' = g hat(w).
  Three things never change: the energy mu.w/2, the length |mu|, which holds mu
  on a sphere, and g mu, the momentum seen from space. All methods here keep the
  last two to rounding. RKMK4, of order 4, lets the energy drift; Algorithm 1, a
  discrete action principle of order 2, and the Hamilton-Jacobi method, a
  generating function of order 4, keep its error bounded. How far each of them
  is from the exact motion, which is known in elliptic functions, is another
  matter. The time of a step is that of a short native run.

examples:
  python -m liemech
  python -m liemech --h 0.05 --steps 2000 --methods rkmk4 exp
  python -m liemech --inertia 1 2 3 --mu 0.001 1 0 --h 0.2 --steps 1000
      a body spun about its middle axis turns over, again and again
  python -m liemech --steps 1e6 --h 0.1
      long runs are compiled: much faster, and the same to the bit
  python -m liemech --inertia 2/3 1 2 --h 0.5
      Fig. 1 of the article; no body has these moments, the equations are as good

other commands, each with a --help of its own:
  run SCENE | FILE.toml   follow a scene: tops, satellites, pendulums, planets
  scenes, methods         what there is
  check module:Class      does a class of yours obey its laws?
  bench module:system     how fast are the steps of a system of yours?
  view FILE.npz           show a saved run in the browser
"""


def main_job(arguments: Sequence[str] | None = None) -> int:
    """Run the job.  Returns the exit status: 0; 1 if a run or the picture failed; 130 after
    Ctrl-C.  Bad options exit with 2.
    """
    options = parse(arguments)
    every = -(-options.steps // SAMPLES)
    step = {"h": options.h, "steps": options.steps // every * every, "every": every}
    interrupted = False
    runs: list[tuple[str, lm.Trajectory]] = []
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        body = lm.RigidBody(options.inertia)
    start = body.state(mu=options.mu, g=np.eye(3))
    for name, method in map(METHODS.__getitem__, options.methods):
        try:
            with named(name):
                runs.append((name, lm.integrate(body, method, start, **step)))
        except lm.errors.IntegrationFailure as failure:
            print(f"{name}: {failure}", file=sys.stderr)
        except lm.errors.IntegrationInterrupted as stopped:
            interrupted = True
            cut = stopped.trajectory
            print(f"{name}: interrupted at t = {cut.t[-1]:g}; the errors told are those there", file=sys.stderr)
            if len(cut) > 1:
                runs.append((name, cut))
            break
    if interrupted and not runs:
        return 130
    t = step["h"] * np.arange(0, step["steps"] + 1, every)
    exact = body.exact(start, t)
    costs, how = [math.nan] * len(runs), "Interrupted: steps were not timed."
    if not (options.quiet or interrupted):
        costs, how = timed(body, start, runs)
    rows = [
        compare(body, name, run, t[: len(run)], _until(exact, len(run)), cost)
        for (name, run), cost in zip(runs, costs, strict=True)
    ]
    rows.append(compare(body, "exact", exact, t, exact, math.nan))
    if not options.quiet:
        print(header(body, start, step, notes), table(rows), how, sep="\n\n")
    captions = [f"momentum error {row[1]}\nenergy error {row[3]}, {row[4]}" for row in rows]
    panels = [(name, run.mu, text, exact.mu[len(run) - 1]) for (name, run), text in zip(runs, captions)]
    page(body, start, runs, float(t[-1]), options.out.with_suffix(".html"), options.quiet)
    drawn = draw(body, start, panels, options.out, options.quiet)
    if interrupted:
        return 130
    return 0 if drawn and len(runs) == len(options.methods) else 1


# ------------------------------------------------------------------ what is computed


def timed(body: Any, start: Any, runs: Sequence[tuple[str, lm.Trajectory]]) -> tuple[list[float], str]:
    """Seconds of a step of each method, the least of three short native runs, and a sentence that says so."""
    costs, native = [], True
    for name, run in runs:
        steps = TIMED if native else len(run)
        again = functools.partial(
            lm.integrate, body, run.method, start, h=run.h, steps=steps, every=steps, progress=False
        )
        with warnings.catch_warnings(), named(name):
            warnings.simplefilter("ignore")
            native = native and bool(again().compiled)
            costs.append(min(timeit.repeat(again, number=1, repeat=3)) / steps)
    how = f"a native run of {TIMED} steps, compile time apart" if native else "plain Python"
    return costs, f"The time of a step is that of {how}."


def compare(body: Any, name: str, run: Any, t: np.ndarray, exact: lm.BodyState, seconds: float) -> tuple[str, ...]:
    """A line of the table: the errors of a run at its end, and how well it kept what is constant."""
    energy, casimir, spatial = (body.energy(run.mu), body.casimirs(run.mu), body.spatial_momentum(run.mu, run.g))
    turn = body.group.log(exact.g[-1].T @ run.g[-1])
    return (
        name,
        "-" if run is exact else short(np.abs(run.mu[-1] - exact.mu[-1]).max()),
        "-" if run is exact else short(math.degrees(np.linalg.norm(turn))),
        short(np.abs(energy - energy[0]).max()),
        Drift.of(body, t, {"mu": run.mu, "g": run.g})["energy"].verdict,
        short(np.abs(casimir / casimir[0] - 1.0).max()),
        short(np.linalg.norm(spatial - spatial[0], axis=1).max() / np.linalg.norm(spatial[0])),
        duration(seconds) if math.isfinite(seconds) else "-",
    )


def _until(exact: lm.BodyState, samples: int) -> Any:
    """The exact motion at the first samples."""
    whole: Any = exact
    return lm.BodyState(whole.mu[:samples], whole.g[:samples])


# ------------------------------------------------------------------ what is printed


def header(body: lm.RigidBody, start: lm.BodyState, step: dict[str, Any], notes: Sequence[Any]) -> str:
    """The lines that say what is simulated."""
    end, period = step["h"] * step["steps"], body.period(start)
    laps = f", {abs(end) / period:.3g} periods of mu" if 0.0 < period < math.inf else ""
    thinning = f"; every {step['every']}th state kept" if step["every"] > 1 else ""
    lines = [
        "A free rigid body:  mu' = mu x w,  g' = g hat(w),  w = J^-1 mu",
        f"  inertia  J = diag{listed(np.array(body.inertia))} kg m^2",
        f"  start    mu = {listed(start.mu)} kg m^2/s,  g = 1",
        f"  run      {step['steps']} steps of h = {step['h']:g} s to t = {end:g} s{laps}{thinning}",
    ]
    first, others = "  note     ", " " * 11
    lines += [textwrap.fill(str(n.message), 80, initial_indent=first, subsequent_indent=others) for n in notes]
    return "\n".join(lines)


def table(rows: Sequence[Sequence[str]]) -> str:
    """The lines under their heads."""
    lines = [
        "                      error at the end     error of the energy   relative change   time",
        "                     momentum  attitude   largest               |mu|^2    g mu      per",
        "                      kg m2/s   degrees         J                                  step",
    ]
    lines.append("-" * len(lines[-1]))
    widths = (9, 10, 10, 11, 10, 9, 9)
    lines += [f"{name:<20}" + "".join(f"{c:>{w}}" for c, w in zip(cells, widths)) for name, *cells in rows]
    return "\n".join(lines)


def listed(numbers: Any) -> str:
    return f"({', '.join(f'{x:.6g}' for x in numbers)})"


# ------------------------------------------------------------------ what is drawn


def page(
    body: lm.RigidBody, start: lm.BodyState, runs: list[tuple[str, Any]], end: float, file: Path, quiet: bool
) -> None:
    """Bodies and momenta as a moving picture for the browser, the exact motion among them; a line
    where there is none.
    """
    from ..viewer import Motion, Scene

    t = np.linspace(0.0, end, 401)
    try:
        scene = Scene(title="A free rigid body")
        for name, run in runs:
            scene.add(run, name=name)
        scene.add(Motion(body, t, body.exact(start, t)), name="exact", color="#1a1a1a").save(file)
    except (lm.errors.LiemechError, OSError) as refused:
        print(f"No page for the browser: {refused}", file=sys.stderr if quiet else sys.stdout)
        return
    if not quiet:
        print(f"Page for the browser: {file}")


def draw(body: lm.RigidBody, start: lm.BodyState, panels: list[Any], file: Path, quiet: bool) -> bool:
    """The momenta on their sphere, a panel for each run.  False if there should be a picture and is none."""
    from .. import plots

    period = body.period(start)
    lap = body.exact(start, np.linspace(0.0, period if 0.0 < period < math.inf else 1.0, 400))
    try:
        plots.save(plots.figure_one(panels, lap.mu, np.array(body.inertia), view=VIEW), file)
    except lm.errors.MissingExtra as missing:
        print(f"No picture: {missing}", file=sys.stderr if quiet else sys.stdout)
        return not quiet  # who wants no table wants the picture
    except (lm.errors.LiemechError, OSError) as refused:
        print(f"No picture: {refused}", file=sys.stderr)
        return False
    if not quiet:
        print(f"Picture: {file}")
    return True


# ------------------------------------------------------------------ options


def parse(arguments: Sequence[str] | None) -> argparse.Namespace:
    """The options that the arguments give."""
    parser = Parser(
        prog="python -m liemech",
        description="Follow a free rigid body by several methods, compare them with the exact motion, draw a picture.",
        epilog=PHYSICS,
    )
    three: dict[str, Any] = {"nargs": 3, "type": number}
    add = parser.add_argument
    add("--steps", type=count, default=200, metavar="N", help="number of steps (200)")
    add("--h", type=number, default=0.3, metavar="H", help="length of a step in s (0.3); a negative one runs backwards")
    add("--inertia", **three, default=(1.0, 1.5, 2.0), metavar="J", help="principal moments in kg m^2 (1 3/2 2)")
    add("--mu", **three, default=(0.5, 0.0, 0.75**0.5), metavar="M", help="momentum in kg m^2/s (0.5 0 sqrt(3)/2)")
    names = " ".join(METHODS)
    add("--methods", nargs="+", choices=METHODS, default=[*METHODS], metavar="NAME", help=f"among {names} (all)")
    where = "folder for rigid_body.png, or a .png, .svg or .pdf file (here)"
    add("--out", type=picture, default="", metavar="PATH", help=where)
    add("--quiet", action="store_true", help="print nothing but errors; the picture is still drawn")
    add("--version", action="version", version=f"liemech {lm.__version__}")
    options = parser.parse_args(arguments)
    if not any(options.mu):
        parser.error("argument --mu: a body without angular momentum stays at rest")
    return options
