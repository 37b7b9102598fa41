"""Measure side by side: interleaved repetitions, ratios taken pair by pair, a table to read and JSON to keep."""

import argparse
import json
import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

Run = Callable[[int], object]  # advances by that many steps


@dataclass(frozen=True)
class Timing:
    """Nanoseconds per unit of work, one number for each repetition."""

    ns: np.ndarray

    @property
    def best(self) -> float:
        return float(self.ns.min())

    @property
    def median(self) -> float:
        return float(np.median(self.ns))

    def over(self, other: "Timing") -> float:
        """Median of the ratios of neighbouring repetitions: slow drifts of the clock cancel."""
        return float(np.median(self.ns / other.ns))

    def as_dict(self) -> dict[str, float]:
        return {"best": self.best, "median": self.median}


def seconds(run: Run, steps: int) -> float:
    begin = time.perf_counter()
    run(steps)
    return time.perf_counter() - begin


def steps_lasting(run: Run, duration: float) -> int:
    """Steps that take about `duration` seconds; the search also warms caches and compilers."""
    run(1)
    steps, spent = 1, seconds(run, 1)
    # one slow call proves nothing
    while spent < duration / 4 or min(seconds(run, steps) for _ in range(2)) < duration / 4:
        steps *= max(2, min(16, int(duration / 4 / max(spent, 1e-7))))
        spent = min(seconds(run, steps) for _ in range(2))
    return max(1, round(steps * duration / spent))


def cost(call: Callable[[], object], rounds: int, calls: int) -> float:
    """The least processor time of so many rounds, in us a call."""
    best = float("inf")
    for _ in range(rounds):
        begun = time.process_time()
        for _ in range(calls):
            call()
        best = min(best, (time.process_time() - begun) / calls)
    return 1e6 * best


def measure(
    runs: Mapping[str, Run], *, bodies: int = 1, repetitions: int = 15, duration: float = 0.03
) -> dict[str, Timing]:
    """Time each run in turn, again and again; nanoseconds per step of one body."""
    steps = {name: steps_lasting(run, duration) for name, run in runs.items()}
    spent: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(repetitions):
        for name, run in runs.items():
            spent[name].append(seconds(run, steps[name]) / (steps[name] * bodies) * 1e9)
    return {name: Timing(np.array(values)) for name, values in spent.items()}


def table(title: str, columns: Sequence[str], rows: Sequence[Sequence[object]]) -> None:
    """Print rows under their columns; numbers to three or four figures, None as a dash."""

    def text(cell: object) -> str:
        if cell is None:
            return "-"
        if isinstance(cell, float):
            return f"{cell:.2g}" if abs(cell) < 0.1 else f"{cell:.2f}" if abs(cell) < 10 else f"{cell:.1f}"
        return str(cell)

    cells = [list(columns), *[[text(cell) for cell in row] for row in rows]]
    width = [max(map(len, column)) for column in zip(*cells, strict=True)]
    print(f"\n{title}")
    for k, row in enumerate(cells):
        print(
            "  "
            + "  ".join(
                cell.ljust(w) if j == 0 else cell.rjust(w) for j, (cell, w) in enumerate(zip(row, width, strict=True))
            ).rstrip()
        )
        if k == 0:
            print("  " + "  ".join("-" * w for w in width))


def to_an_error(points: Sequence[tuple[int, float, float]], error: float) -> list[object]:
    """Steps and microseconds of the first of some runs, (steps, us, error), that is within an error."""
    return next(([steps, us] for steps, us, e in points if e <= error), [None, None])


def work_precision(panels: Mapping[str, Mapping[str, Sequence[tuple[int, float, float]]]], path: Path) -> None:
    """Draw error over processor time of runs, (steps, us, error), for each system and method."""
    import liemech as lm

    picture, axes = lm.plots.subplots(1, len(panels), figsize=(4.4 * len(panels), 4.4), squeeze=False)
    for ax, (name, methods) in zip(axes[0], panels.items(), strict=True):
        for k, (method, points) in enumerate(methods.items()):
            _, us, error = zip(*points)
            ax.loglog(us, error, "o-" if k < 6 else "s--", ms=3, lw=1.2, label=method)  # there are six colours
        ax.xaxis.set_minor_formatter("")
        ax.set(title=name, xlabel="processor time of a run (us)")
        ax.legend(fontsize=7)
    axes[0][0].set_ylabel("error at the end")
    lm.plots.save(picture, path)
    print(f"written: {path}")


def machine() -> dict[str, object]:
    """What the numbers were measured on."""
    names = [line.split(":")[1].strip() for line in _lines("/proc/cpuinfo") if line.startswith("model name")]
    return {
        "cpu": names[0] if names else platform.processor(),
        "code for": os.environ.get("LIEMECH_CPU") or "native",
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "numpy": np.__version__,
        "time": time.strftime("%Y-%m-%d %H:%M:%S"),
    }


def _lines(path: str) -> list[str]:
    return Path(path).read_text().splitlines() if Path(path).exists() else []


def options(doc: str | None, out: str) -> tuple[Path, tuple[int, float]]:
    """The command line of a benchmark of single steps: where the JSON goes, and repetitions and
    seconds, fewer with --quick.
    """
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="smoke run: rough numbers")
    parser.add_argument("--out", type=Path, default=Path(out), help="where the JSON goes")
    chosen = parser.parse_args()
    return chosen.out, (15, 0.0005) if chosen.quick else (250, 0.001)


def write(path: Path | str, results: Mapping[str, object]) -> None:
    Path(path).write_text(json.dumps({"machine": machine(), **results}, indent=1) + "\n")
    about = machine()
    print(f"\n{about['cpu']}, code for {about['code for']}\nwritten: {path}")
