"""What the thresholds of the compiler do: the seconds of compiling, the instructions and the time of a step
with each of them halved and doubled, over those with the present one.

    python tests/benchmarks/thresholds.py [--only NAME] [--cases TEXT]

Each case is compiled in a process of its own; times are of the processor.
"""

import argparse
import importlib
import json
import math
import subprocess
import sys
from typing import Any

THRESHOLDS = {
    "translation.inlining": ("LONG", "WORTH", "LARGE", "SLACK", "MOST", "ALONE", "WHOLE", "COPIED", "PER_NUMBER"),
    "translation.state": ("HUGE",),
    "translation.instructions": ("SIDE_BY_SIDE", "SHORT"),
    "translation.loops": ("UNROLL",),
    "translation.native_functions": ("RETURNED",),
    "numbers.memory_loops": ("LARGE", "TERMS"),
}
"""Where they are, below `liemech.compiler`."""

CASES = (
    "RKMK8, top, lanes", "Composition 8 of exp, SE(3)", "Algorithm 1, SO(6)", "Galerkin 4, tau only",
    "LieRATTLE, chain of 2, lanes", "Splitting 4, planets",
)  # fmt: skip
"""Of `compile_time.py`, those whose kernels are long."""

FACTORS = 0.5, 2.0

MEASURED = "cold", "instructions", "ns"


def measured(case: str, module: str, name: str, factor: float) -> dict[str, Any]:
    """Seconds, instructions and ns a step of one case, with one threshold changed."""
    change = [module, name, str(factor)]
    output = subprocess.run([sys.executable, __file__, "--case", case, *change], capture_output=True, text=True)
    return json.loads(output.stdout) if output.returncode == 0 else {}


def in_this_process(case: str, module: str, name: str, factor: float) -> None:
    """Print the numbers of one case."""
    import compile_time

    home = importlib.import_module(f"liemech.compiler.{module}")
    value = getattr(home, name)
    setattr(home, name, type(value)(factor * value))
    print(json.dumps(compile_time.measured(case, True)))


def main() -> None:
    """Print a row for each threshold and factor: the ratios of each case, and their geometric means."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--cases", default="")
    parser.add_argument("--case", nargs=4, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.case:
        case, module, name, factor = options.case
        in_this_process(case, module, name, float(factor))
        return
    names = [(module, name) for module, several in THRESHOLDS.items() for name in several if options.only in name]
    cases = [case for case in CASES if options.cases in case]
    before = {case: measured(case, "translation.state", "HUGE", 1.0) for case in cases}
    print("| threshold | factor | compiling | instructions | a step |\n| --- | --- | --- | --- | --- |", flush=True)
    for module, name in names:
        for factor in FACTORS:
            now = {case: measured(case, module, name, factor) for case in cases}
            cells = [ratios([now[c][what] / before[c][what] for c in cases if now[c]]) for what in MEASURED]
            print(f"| {module.rpartition('.')[2]}.{name} | {factor} | {' | '.join(cells)} |", flush=True)


def ratios(values: list[float]) -> str:
    """The geometric mean of some ratios, and the least and the largest of them."""
    mean = math.exp(sum(map(math.log, values)) / len(values))
    return f"{mean:.2f} ({min(values):.2f} to {max(values):.2f})"


if __name__ == "__main__":
    main()
