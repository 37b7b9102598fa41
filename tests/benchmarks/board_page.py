"""The pages of the leader board, of what `leader_board.py` measured."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

PROOF = Path(__file__).parents[2] / "docs" / "proof"
PAGE, TABLES = PROOF / "leader_board.md", PROOF / "measured" / "work_precision.md"
MARKS = "<!-- measured: tests/benchmarks/leader_board.py -->\n", "<!-- end -->"
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
Best = tuple[float, str] | None
CLEAR = 0.9
"""At most so many times a rival's time is clearly ahead; down to its inverse it is level."""

HEAD = """# Leader board

For each problem and each error the quickest method of this library, and the quickest one of any
other package that is installed. The ratio is our time over theirs: below one we are ahead.

`pip install ".[peers]"` brings the other packages. `python tests/benchmarks/leader_board.py`
measures everything and writes this page, in some twenty minutes; `--only top` repeats one problem.
`tests/benchmarks/leader_board.json` has all methods with all their settings: errors, medians and
quartiles.

* **Outputs**: ten, equally spaced; everybody gives the same ones. The **error** is the largest
  difference to the reference over all outputs and all components, in the units of the problem.
* **References** are not ours: heyoka in 113 bits with 1e-30 a step (in 64 bits, 1e-20, for t = 10^5
  and the planets), `tests/benchmarks/races.py`.
* **Time** is that of a whole call from Python, prepared beforehand (an integrator of heyoka, a
  `Plan` of ours, a jitted function of JAX). *Warm* calls follow one another, a *cold* one comes after
  everybody else had a turn: its data and code have left the cache. Medians of up to nine rounds, in
  which all take turns. One thread.
* **Settings**: of every method that is anywhere near the quickest, the loosest setting that reaches
  an error is looked for, by halving the interval between two settings four times: whole numbers of
  steps, any tolerance. A time counts for an error only if that very setting was run and reached it.
* **Like beside like**: methods that go step by step beside such methods, closed forms beside closed
  forms (`system.exact`, a flow that is exact in one step, REBOUND's WHFast for two bodies, heyoka's
  `kepE`).
* **fast_math** lets a compiler rearrange sums, so that the last bits depend on it. We do not use it:
  a run has the same bits in plain Python, in native code, in lanes. heyoka has a column with it and
  one without; who is ahead is told with it.
* **R^n** after a name: our Taylor series of the plain equations that other packages have, too
  ([how](../taylor.md#in-rn)). Momenta leave their orbit and attitudes the group with the error of the
  method, as theirs do. Ours on the group stay there to rounding, and have a column of their own.

"""
REASONS = {
    "momentum": "the call. Native code takes 0.002 to 0.009 ms, heyoka's with fast_math, up to the end "
    "and without the grid, 0.01 to 0.016.",
    "attitude": "the call. `exact` pays for elliptic functions of arrays in NumPy.",
    "long": "phase. Rounding of 1e-16 a turn is 1e-11 after 10^5 s; only few long steps do better.",
    "top": "the call. Native code takes 0.6 to 0.7 of heyoka's time with fast_math.",
    "fish": "the call, as for the top: native code takes 0.8 to 0.9 of heyoka's time.",
    "kepler": "steps of the symplectic methods are in fictive time and do not end at outputs: each "
    "output costs a step of its own. Taylor's call takes 0.02 ms; of its steps each of order 18 takes "
    "0.32 microseconds, heyoka's of order 16 as long, and 0.25 with fast_math, which fuses products "
    "and sums.",
    "pendulum": "the call.",
    "planets": "Kepler's equation: ours starts each step from nothing.",
    "four": "the call.",
    "driven": "the call.",
}
LIMITS = """
## What the others were given

* **heyoka**: `taylor_adaptive`, never in compact mode, tolerances from 1e-1 to 2.3e-16, `fast_math`
  off and on; planets as `model.nbody`; outputs by `propagate_grid`; caches on disk and in memory
  off, so that setting up is measured. Closed form: `kepE` in a `cfunc`.
* **SciPy**: `solve_ivp` with DOP853, LSODA, Radau and `t_eval`; right-hand sides in Python and, after
  elimination of common subexpressions, in Numba.
* **diffrax**: Tsit5 and Dopri8 with a PID controller, one jitted call in 64 bits, one thread.
* **JAX**, ensembles: RK4, components first, one jitted call; all bodies at once, and `lax.map` over
  blocks of 256 to 16,384 bodies. The best counts.
* **Exudyn**: RK67 and RK44, explicit methods on the Lie group. **Lielab**: Munthe-Kaas methods with
  RKV98r and steps that follow a tolerance. **MuJoCo**: RK4 by `rollout`.
* **REBOUND**: a simulation made once and set back to its start, `safe_mode` 0, from one step between
  two outputs; WHFast plain, with correctors, with the lazy kernel, in democratic heliocentric
  coordinates; SABA 4, corrected 4, (10, 4), (8, 6, 4), (10, 6, 4); IAS15.

**Can you do better?** Change a rival's entry in `tests/benchmarks/rivals.py` and run
`python tests/benchmarks/leader_board.py --only kepler` with the key of the race. Whoever finds a
quicker setting of any package is asked to send it: the board is to be what its authors would sign.

## Who takes part in what

| package | problems | why not the others |
| --- | --- | --- |
| heyoka, diffrax | all | |
| SciPy | all | right-hand sides in Python are not for t = 10^5 (minutes) |
| Exudyn | bodies, top | forces of other problems would be called back in Python |
| Lielab | bodies, top, driven rotation | called back in Python in any case; t = 10^5 takes minutes |
| MuJoCo | body with attitude, top, ensembles | a pendulum without thickness has no inertia that it accepts |
| REBOUND | Kepler, planets | gravity only |
"""


def quickest(points: list[dict[str, Any]], target: float, kind: str = "warm") -> float | None:
    """Seconds of the quickest setting that was run and reached an error; None if none did."""
    return min((point[kind] for point in points if point["error"] <= target), default=None)


def best(curves: Iterable[dict[str, Any]], target: float, kind: str = "warm") -> Best:
    """The least time of these methods to an error, and whose it is, with its setting."""
    return min(
        ((point[kind], called(c, point)) for c in curves for point in c["points"] if point["error"] <= target),
        default=None,
    )


def called(curve: dict[str, Any], point: dict[str, Any]) -> str:
    """A method and its setting: steps between two outputs, or a tolerance."""
    name, setting = curve["method"], point["setting"]
    if curve["package"] != "liemech":
        name = f"{curve['package']} {name}"
    if not setting:
        return str(name)
    return f"{name}: {setting:.0f}" if setting >= 1.0 else f"{name}: {error(setting)}"


def cell(found: Best) -> str:
    """Milliseconds and the method."""
    return f"{number(1e3 * found[0])} ({found[1]})" if found else "-"


def number(x: float) -> str:
    """Two figures."""
    return f"{x:.2g}" if x < 99.5 else f"{float(f'{x:.2g}'):.0f}"


def error(target: float) -> str:
    return f"{target:.0e}".replace("e-0", "e-")


def verdict(ours: Best, theirs: Best) -> str:
    """Who is ahead, by more than a tenth or not."""
    if not ours:
        return "🔴 behind" if theirs else "nobody"
    if not theirs or ours[0] <= CLEAR * theirs[0]:
        return "🟢 clear"
    return "🟡 within 10 %" if ours[0] * CLEAR <= theirs[0] else "🔴 behind"


def ratio(ours: Best, theirs: Best) -> str:
    return number(ours[0] / theirs[0]) if ours and theirs else "-"


def races(measured: dict[str, Any]) -> tuple[str, list[str]]:
    """The table of what goes step by step, and the problems in which we are behind somewhere."""
    text = "| problem | error | verdict | ratio | liemech, ms | of these not in R^n, ms "
    text += "| best other package, ms | ratio, warm | cold | the same with fast_math, ms |\n"
    text += "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
    behind, said = [], []
    for key, race in measured["races"].items():
        stepped = [c for c in race["curves"] if not c["closed"]]
        ours = [c for c in stepped if c["package"] == "liemech"]
        others = [c for c in stepped if c["package"] != "liemech"]
        bits = [c for c in others if not c["fast"]]
        for target in TARGETS:
            first, theirs, fastest = (best(c, target) for c in (ours, bits, others))
            structured = best([c for c in ours if ", R^" not in c["method"]], target)
            cold = ratio(best(ours, target, "cold"), best(bits, target, "cold"))
            said.append(verdict(first, fastest))
            if said[-1].endswith("behind") and key not in behind:
                behind.append(key)
            cells = [
                race["name"], error(target), said[-1], ratio(first, fastest), cell(first),
                cell(structured), cell(theirs), ratio(first, theirs), cold,
                "" if fastest == theirs else cell(fastest),
            ]  # fmt: skip
            text += f"| {' | '.join(cells)} |\n"
    counts = [f"{sum(word in x for x in said)} {word}" for word in ("clear", "within 10 %", "behind")]
    nobody = sum("nobody" in x for x in said)
    head = f"Of {len(said)} cells, beside the others at their best: {', '.join(counts)}"
    return head + (f", {nobody} reached by nobody" if nobody else "") + ".\n\n" + text, behind


PICTURE = "Our time over the best other time, logarithmic: most dots are left of one"


def figure(measured: dict[str, Any], file: Path) -> None:
    """Our time over the best of all others, a row for each problem and a dot for each error."""
    import liemech as lm

    rows = list(measured["races"].values())
    figure, ax = lm.plots.subplots(figsize=(7.4, 0.34 * len(rows) + 1.2))
    ax.axvspan(CLEAR, 1.0 / CLEAR, color="#e4e7ec", zorder=0.5, linewidth=0, label="within 10 %")
    ax.axvline(1.0, color="#5f6672", linewidth=0.9, zorder=0.6)
    for k, (target, marker) in enumerate(zip(TARGETS, "os^D", strict=True)):
        found = []
        for y, race in enumerate(rows):
            stepped = [c for c in race["curves"] if not c["closed"]]
            ours, others = (
                best([c for c in stepped if (c["package"] == "liemech") is own], target) for own in (True, False)
            )
            if ours and others:
                found.append((ours[0] / others[0], y))
        x, y = zip(*found, strict=True)
        label = f"error {error(target)}"
        ax.plot(x, y, marker, color=lm.plots.COLORS[k], markersize=6.0, label=label)
    ax.set(xscale="log", xlabel="our time / the best other time    (left: we are ahead)")
    low, high = ax.get_xlim()
    ticks = [x for x in (0.05, 0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 5.0) if low <= x <= high]
    ax.set_xticks(ticks, [f"{x:g}" for x in ticks])
    ax.set_xticks([], minor=True)
    ax.set_yticks(range(len(rows)), [race["name"] for race in rows])
    ax.invert_yaxis()
    lm.plots.legend(ax, loc="upper center", bbox_to_anchor=(0.3, -0.12), ncols=5)
    lm.plots.save(figure, file, dpi=130)


def closed_forms(measured: dict[str, Any]) -> str:
    """Motions that are known: whole calls for ten outputs, at the error that each has."""
    text = "| problem | method | error | ms, warm | cold |\n| --- | --- | --- | --- | --- |\n"
    for race in measured["races"].values():
        rows = [(p["warm"], called(c, p), p) for c in race["curves"] if c["closed"] for p in c["points"]]
        for _, name, p in sorted(rows, key=lambda row: row[0]):
            whose = name if any(w in name for w in ("heyoka", "REBOUND")) else f"liemech {name}"
            cells = [race["name"], whose, f"{p['error']:.0e}", number(1e3 * p["warm"]), number(1e3 * p["cold"])]
            text += f"| {' | '.join(cells)} |\n"
    return text


def set_ups(measured: dict[str, Any]) -> str:
    """What comes before: for each package its quickest method at 1e-9, milliseconds of setting up
    and of the first call.
    """
    packages = list(dict.fromkeys(c["package"] for race in measured["races"].values() for c in race["curves"]))
    text = f"| problem | {' | '.join(packages)} |\n| --- |{' --- |' * len(packages)}\n"
    for race in measured["races"].values():
        cells = []
        for package in packages:
            points = [c["points"] for c in race["curves"] if c["package"] == package and c["points"]]
            costs = [max(0.0, *(p["set_up"] + p["first"] - p["warm"] for p in curve)) for curve in points]
            cells.append(f"{number(min(costs))} to {number(max(costs))}" if costs else "-")
        text += f"| {race['name']} | {' | '.join(cells)} |\n"
    return text


def crowds(measured: dict[str, Any]) -> str:
    """Ensembles: steps, and time to error."""
    text = "Nanoseconds of a step of one body, order 4, momentum and attitude, one core:\n\n"
    names = list(dict.fromkeys(name for row in measured["steps"] for name in row["seconds"]))
    text += (
        f"| bodies | steps | {' | '.join(names)} | best other / liemech |\n| --- | --- |{' --- |' * (len(names) + 1)}\n"
    )
    for row in measured["steps"]:
        ns = {name: 1e9 * t["median"] / row["bodies"] / row["steps"] for name, t in row["seconds"].items()}
        ours, others = (ns["liemech RKMK4"], [x for name, x in ns.items() if not name.startswith("liemech")])
        cells = [number(ns[name]) if name in ns else "-" for name in names]
        text += f"| {row['bodies']:,} | {row['steps']} | {' | '.join(cells)} | {number(min(others) / ours) if others else '-'} |\n"
    for found in measured["to error"]:
        if not found["seconds"]:
            continue
        which = "each with an inertia of its own" if found["different"] else "all alike"
        text += f"\n{found['bodies']} bodies, {which}, momentum and attitude at t = 20 with an error "
        text += "below 1e-9; the setting after the name:\n\n"
        text += "| | ms | quartiles | error | times the quickest other |\n| --- | --- | --- | --- | --- |\n"
        others = [t["median"] for name, t in found["seconds"].items() if not name.startswith("liemech")]
        for name, t in sorted(found["seconds"].items(), key=lambda item: item[1]["median"]):
            low, middle, high = (1e3 * t[x] for x in ("low", "median", "high"))
            over = number(t["median"] / min(others)) if others else "-"
            text += f"| {name} | {number(middle)} | {number(low)} to {number(high)} | {found['errors'][name]:.0e} | {over} |\n"
    return text


def page(measured: dict[str, Any]) -> str:
    """The leader board."""
    table, behind = races(measured)
    there = ", ".join(f"{name} {v}" for name, v in measured["versions"].items() if v)
    missing = ", ".join(name for name, v in measured["versions"].items() if not v)
    machine, day = measured["machine"]["cpu"], measured["machine"]["time"][:10]
    title, what, how = HEAD.split("\n\n", 2)
    counts, _, rows = table.partition("\n\n")
    picture = f"![{PICTURE}](../figures/leader_board.png)"
    text = f"{title}\n\n{what}\n\n{counts}\n\n{picture}\n\n## Time to error\n\n"
    text += "The first ratio is that to the best of all others, fast_math or not.\n\n"
    text += (
        f"{rows}\n## How it is measured\n\n{how}On {machine}, {day}, with {there}. Missing: {missing or 'none'}.\n\n"
    )
    parts = [*measured["races"].values(), {"name": "ensembles", **measured.get("crowds", {})}]
    elsewhere = [part for part in parts if part.get("machine", machine) != machine]
    if elsewhere:
        names, cpus = (dict.fromkeys(part[x] for part in elsewhere) for x in ("name", "machine"))
        text += f"Measured on {', '.join(cpus)}: {'; '.join(names)}.\n\n"
    text += f"## Closed forms\n\n{closed_forms(measured)}\n"
    text += "## What stands in the way\n\n"
    text += "Where we are behind:\n\n" if behind else "Nothing today.\n"
    text += "".join(f"* **{measured['races'][key]['name']}**: {REASONS[key]}\n" for key in behind)
    if measured.get("crowds"):
        text += f"\n## Ensembles\n\n{crowds(measured['crowds'])}"
    text += "\n## Setting up\n\nSeconds before the second call: setting up, fitting, machine code, the "
    text += "first call less a warm one; the least and\nthe most of a package's methods. Ours is kept "
    text += "on disk: with code that is there already it is the least.\n\n"
    return text + set_ups(measured) + LIMITS


def tables(measured: dict[str, Any]) -> str:
    """For each problem the quickest method of each package, in milliseconds."""
    text = ""
    for race in measured["races"].values():
        packages = list(dict.fromkeys((c["package"], c["closed"]) for c in race["curves"]))
        text += f"{race['name'][0].upper()}{race['name'][1:]}:\n\n| | {' | '.join(map(error, TARGETS))} |\n"
        text += f"| --- |{' --- |' * len(TARGETS)}\n"
        for package, closed in packages:
            curves = [c for c in race["curves"] if (c["package"], c["closed"]) == (package, closed)]
            found = [best(curves, target) for target in TARGETS]
            names = [f and (f[0], f[1].removeprefix(f"{package} ")) for f in found]
            text += f"| {package}{', closed form' if closed else ''} | {' | '.join(cell(f) for f in names)} |\n"
        text += "\n"
    there = ", ".join(f"{name} {version}" for name, version in measured["versions"].items() if version)
    return text + f"On {measured['machine']['cpu']}, {measured['machine']['time'][:10]}, with {there}.\n"


def write_pages(measured: dict[str, Any]) -> None:
    """docs/proof/leader_board.md, and the tables of docs/proof/measured/work_precision.md."""
    PAGE.write_text(page(measured), encoding="utf-8")
    before, _, rest = TABLES.read_text(encoding="utf-8").partition(MARKS[0])
    TABLES.write_text(before + MARKS[0] + tables(measured) + MARKS[1] + rest.partition(MARKS[1])[2], encoding="utf-8")
    print(f"written: {PAGE}, {TABLES}")
