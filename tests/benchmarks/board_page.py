"""The pages of the leader board, of what `leader_board.py` measured."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

PROOF = Path(__file__).parents[2] / "docs" / "proof"
PAGE, TABLES = PROOF / "leader_board.md", PROOF / "measured" / "leader_board.md"
TARGETS = (1e-3, 1e-6, 1e-9, 1e-12)
Best = tuple[float, str] | None
CLEAR = 0.9
"""At most so many times a rival's time is clearly ahead; down to its inverse it is level."""

HEAD = """# Leader board

For each of ten problems and each error the quickest method of this library beside the quickest one of any other
package at its best settings, with `fast_math` or without. A cell has the ratio of our time of a call to theirs, below
one where we are ahead, bold where we are behind by more than a tenth, and our time. Methods go step by step; motions in
closed form are compared among themselves.

"""
HOW = """## How it is measured

* Ten **outputs**, equally spaced. The **error** is the largest difference to the reference over all outputs and
  components. **References** are not ours: heyoka in 113 bits with 1e-30 a step (in 64 bits, 1e-20, for t = 10^5 and the
  planets), `tests/benchmarks/races.py`.
* **Time** is that of a whole call from Python of what is prepared beforehand (an integrator of heyoka, a `Plan` of ours, a
  jitted function of JAX): the median of up to nine rounds in which all take turns, on one thread.
* **Settings**: of every method anywhere near the quickest, the loosest setting that reaches an error, found by halving the
  interval between two settings four times. A time counts only if that very setting was run and reached the error.
* **R^n** after a name: our Taylor series of the plain equations that other packages integrate. Momenta leave their orbit
  and attitudes the group with the error of the method, as theirs do; on the group ours stay there to rounding.
* `fast_math` lets a compiler rearrange sums. We do not use it: plain Python, native code and lanes have the same bits.

`pip install ".[peers]"` brings the other packages, `python tests/benchmarks/leader_board.py` measures everything in some
twenty minutes and writes this page; `--only top` repeats one problem. [All tables](measured/leader_board.md) have the
methods and settings, warm and cold calls, every package, closed forms and setting up;
[work and precision](measured/work_precision.md) has our symplectic methods, and what is left of the energy after a long
time.

"""
TABLES_HEAD = """# Tables of the leader board

The [leader board](../leader_board.md) says how they are measured. After the name of a method: its steps between two
outputs, or its tolerance. *Warm* calls follow one another; a *cold* one comes after everybody else had a turn, when its
data and code have left the cache. `tests/benchmarks/leader_board.json` has all methods with all their settings, medians
and quartiles.

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
GIVEN = """## What the others were given

* **heyoka**: `taylor_adaptive`, never in compact mode, tolerances from 1e-1 to 2.3e-16, `fast_math` off and on; planets as
  `model.nbody`; outputs by `propagate_grid`; no caches, so that setting up is measured. Closed form: `kepE` in a `cfunc`.
* **SciPy**: `solve_ivp` with DOP853, LSODA, Radau and `t_eval`; right-hand sides in Python and, after elimination of common
  subexpressions, in Numba. Not for t = 10^5, which takes minutes.
* **diffrax**: Tsit5 and Dopri8 with a PID controller, one jitted call in 64 bits, one thread.
* **JAX**, ensembles: RK4, components first, one jitted call; all bodies at once, and `lax.map` over blocks of 256 to 16,384
  bodies. The best counts.
* **REBOUND**, Kepler and planets: a simulation made once and set back to its start, `safe_mode` 0; WHFast plain, with
  correctors, with the lazy kernel, in democratic heliocentric coordinates; SABA 4, corrected 4, (10, 4), (8, 6, 4),
  (10, 6, 4); IAS15.
* **MuJoCo**, bodies, top, ensembles: RK4 by `rollout`. **Exudyn**, bodies and top: RK67 and RK44 on the Lie group.
  **Lielab**, bodies, top, driven rotation: Munthe-Kaas methods with RKV98r and a tolerance.

**Can you do better?** Change a rival's entry in `tests/benchmarks/rivals.py` and run `python
tests/benchmarks/leader_board.py --only kepler` with the key of the race. Whoever finds a quicker setting of any package is
asked to send it: the board is to be what its authors would sign.
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
        return "behind" if theirs else "nobody"
    if not theirs or ours[0] <= CLEAR * theirs[0]:
        return "clear"
    return "within 10 %" if ours[0] * CLEAR <= theirs[0] else "behind"


def ratio(ours: Best, theirs: Best) -> str:
    return number(ours[0] / theirs[0]) if ours and theirs else "-"


def stepped(race: dict[str, Any], target: float, kind: str = "warm") -> tuple[Best, Best, Best, Best]:
    """The least times to an error of what goes step by step: ours, ours on the group, the others' with the same bits
    everywhere and the others' at their best.
    """
    curves = [c for c in race["curves"] if not c["closed"]]
    ours = [c for c in curves if c["package"] == "liemech"]
    others = [c for c in curves if c["package"] != "liemech"]
    groups = ours, [c for c in ours if ", R^" not in c["method"]], [c for c in others if not c["fast"]], others
    first, structured, bits, fastest = (best(group, target, kind) for group in groups)
    return first, structured, bits, fastest


def board(measured: dict[str, Any]) -> tuple[str, list[str]]:
    """How often we are ahead, the table of ratios, and the problems in which we are behind somewhere."""
    text = f"| | {' | '.join(f'to {error(target)}' for target in TARGETS)} |\n| --- |{' --- |' * len(TARGETS)}\n"
    behind, said = [], []
    for key, race in measured["races"].items():
        cells = []
        for target in TARGETS:
            ours, _, _, theirs = stepped(race, target)
            said.append(verdict(ours, theirs))
            shown = ratio(ours, theirs)
            if said[-1] == "behind":
                shown = f"**{shown}**"
                behind = behind if key in behind else [*behind, key]
            cells.append(f"{shown} ({number(1e3 * ours[0])} ms)" if ours else "-")
        text += f"| {race['name']} | {' | '.join(cells)} |\n"
    counts = [f"{said.count(word)} {word}" for word in ("clear", "within 10 %", "behind")]
    nobody = f", {said.count('nobody')} reached by nobody" if "nobody" in said else ""
    return f"Of {len(said)} cells: {', '.join(counts)}{nobody}.\n\n{text}", behind


def races(measured: dict[str, Any]) -> str:
    """The table of what goes step by step, with methods and settings."""
    text = "| problem | error | verdict | ratio | liemech, ms | of these not in R^n, ms "
    text += "| best other package, ms | ratio, warm | cold | the same with fast_math, ms |\n"
    text += "| --- | --- | --- | --- | --- | --- | --- | --- | --- | --- |\n"
    for race in measured["races"].values():
        for target in TARGETS:
            first, structured, theirs, fastest = stepped(race, target)
            ours_cold, _, theirs_cold, _ = stepped(race, target, "cold")
            cells = [
                race["name"], error(target), verdict(first, fastest), ratio(first, fastest), cell(first),
                cell(structured), cell(theirs), ratio(first, theirs), ratio(ours_cold, theirs_cold),
                "" if fastest == theirs else cell(fastest),
            ]  # fmt: skip
            text += f"| {' | '.join(cells)} |\n"
    return text


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
    lm.plots.save(figure, file)


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
    table, behind = board(measured)
    text = f"{HEAD}{table}\n![{PICTURE}](../figures/leader_board.png)\n\n{machine(measured)}\n"
    if behind:
        text += "\nWhere we are behind:\n\n"
        text += "".join(f"* **{measured['races'][key]['name']}**: {REASONS[key]}\n" for key in behind)
    if measured.get("crowds"):
        text += f"\n## Ensembles\n\n{crowds(measured['crowds'])}"
    return f"{text}\n{HOW}{GIVEN}"


def machine(measured: dict[str, Any]) -> str:
    """Where, when and beside which versions it was measured."""
    there = ", ".join(f"{name} {v}" for name, v in measured["versions"].items() if v)
    missing = ", ".join(name for name, v in measured["versions"].items() if not v)
    cpu, day = measured["machine"]["cpu"], measured["machine"]["time"][:10]
    text = f"On {cpu}, {day}, with {there}. Missing: {missing or 'none'}."
    parts = [*measured["races"].values(), {"name": "ensembles", **measured.get("crowds", {})}]
    elsewhere = [part for part in parts if part.get("machine", cpu) != cpu]
    if elsewhere:
        names, cpus = (dict.fromkeys(part[x] for part in elsewhere) for x in ("name", "machine"))
        text += f" Measured on {', '.join(cpus)}: {'; '.join(names)}."
    return text


def tables(measured: dict[str, Any]) -> str:
    """All tables: methods and settings, every package, closed forms and setting up."""
    text = f"{TABLES_HEAD}{machine(measured)}\n\n## Step by step\n\n{races(measured)}\n"
    text += f"## Every package\n\nMilliseconds of its quickest method.\n\n{packages(measured)}"
    text += f"## Closed forms\n\n{closed_forms(measured)}"
    text += "\n## Setting up\n\nSeconds before the second call: setting up, fitting, machine code, the first call less a warm "
    text += (
        "one; the least and the most of a package's methods.\nOurs is kept on disk: with code that is there already it "
    )
    return text + f"is the least.\n\n{set_ups(measured)}"


def packages(measured: dict[str, Any]) -> str:
    """For each problem the quickest method of each package, in milliseconds."""
    text = ""
    for race in measured["races"].values():
        groups = list(dict.fromkeys((c["package"], c["closed"]) for c in race["curves"]))
        text += f"| {race['name']} | {' | '.join(map(error, TARGETS))} |\n"
        text += f"| --- |{' --- |' * len(TARGETS)}\n"
        for package, closed in groups:
            curves = [c for c in race["curves"] if (c["package"], c["closed"]) == (package, closed)]
            found = [best(curves, target) for target in TARGETS]
            names = [f and (f[0], f[1].removeprefix(f"{package} ")) for f in found]
            text += f"| {package}{', closed form' if closed else ''} | {' | '.join(cell(f) for f in names)} |\n"
        text += "\n"
    return text


def write_pages(measured: dict[str, Any]) -> None:
    """docs/proof/leader_board.md and docs/proof/measured/leader_board.md."""
    PAGE.write_text(page(measured), encoding="utf-8")
    TABLES.write_text(tables(measured), encoding="utf-8")
    print(f"written: {PAGE}, {TABLES}")
