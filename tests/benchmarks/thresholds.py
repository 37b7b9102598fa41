"""How much code the thresholds of the compiler make: the instructions of kernels with each of them halved and doubled,
over those with the present one.

    python tests/benchmarks/thresholds.py [--only NAME]

Every kernel is compiled in a process of its own.  Seconds of compiling and the time of a step, which decided, are those of
`compile_time.py`.
"""

import argparse
import importlib
import json
import math
import os
import subprocess
import sys

THRESHOLDS = {
    "translation.inlining": ("LONG", "WORTH", "LARGE", "SLACK", "ALONE", "WHOLE", "COPIED", "PER_NUMBER"),
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
"""Of `compile_time.py`."""


def instructions(case: str, module: str, name: str, factor: float) -> float:
    """The instructions of a case with one threshold changed; nan if it is refused."""
    command = [sys.executable, __file__, "--case", case, module, name, str(factor)]
    known = os.environ | {"LIEMECH_CACHE_DIR": os.devnull}
    output = subprocess.run(command, env=known, capture_output=True, text=True)
    return float(json.loads(output.stdout)["instructions"]) if output.returncode == 0 else math.nan


def in_this_process(case: str, module: str, name: str, factor: str) -> None:
    """Compile one case, and print its numbers."""
    import compile_time

    home = importlib.import_module(f"liemech.compiler.{module}")
    value = getattr(home, name)
    setattr(home, name, type(value)(float(factor) * value))
    print(json.dumps(compile_time.measured(case, False)))


def main() -> None:
    """Print a row for each threshold: the geometric mean of the ratios, the least and the largest."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="")
    parser.add_argument("--case", nargs=4, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.case:
        in_this_process(*options.case)
        return
    present = [instructions(case, "translation.state", "HUGE", 1.0) for case in CASES]
    print("| threshold | half of it | twice |\n| --- | --- | --- |", flush=True)
    for module, names in THRESHOLDS.items():
        for name in (name for name in names if options.only in name):
            cells = []
            for factor in (0.5, 2.0):
                ratios = [instructions(c, module, name, factor) / n for c, n in zip(CASES, present, strict=True)]
                known = [x for x in ratios if x == x]
                mean = math.exp(sum(map(math.log, known)) / len(known))
                refused = f", {len(ratios) - len(known)} refused" * (len(known) < len(ratios))
                cells.append(f"{mean:.2f} ({min(known):.2f} to {max(known):.2f}{refused})")
            print(f"| `{module.rpartition('.')[2]}.{name}` | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
