"""Random formulas, a new one for every seed: the three worlds agree to the bit.

`python tests/compiler/test_same_bits.py 1000 5000` runs many more.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import fuzz
import pytest
import worlds

from liemech.compiler import kernel
from liemech.compiler.changes import cache
from liemech.errors import NotCompilable

HONEST = (
    "the returned value has no one form",
    "every way through the formula raises",
    "an integer on one way and a float on another",
)
"""What the compiler may say of a random formula that Python runs."""


def check(seed: int, folder: Path, lanes: tuple[int, ...]) -> bool:
    """Compare the formula of this seed in all worlds; False if it was refused with good reason."""
    text = fuzz.Writer(seed).module()
    module = worlds.module_from(text, folder, f"random_formula_{seed}")
    rows = fuzz.arguments(seed, 24, worlds.SPECIAL)
    if all(isinstance(worlds.plain(module.formula, row, 2), str) for row in rows):
        return False
    try:
        worlds.same_in_all_worlds(module.formula, rows, turns=2, lanes=lanes)
    except NotCompilable as refusal:
        if not any(reason in str(refusal) for reason in HONEST):
            raise
        return False
    except AssertionError as difference:
        raise AssertionError(f"{text}\nseed {seed}: {difference}") from None
    finally:
        del sys.modules[f"random_formula_{seed}"]
    return True


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("hundred", range(3))
def test_random_formulas(hundred: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cache, "store", lambda *_: None)  # nobody will ever need them again
    seeds = range(100 * hundred, 100 * hundred + 15)
    lanes = (1, kernel.lanes()) if hundred else (1, 4)
    passed = sum(check(seed, tmp_path, lanes) for seed in seeds)
    assert passed > 0.8 * len(seeds)


def main(first: int, last: int) -> None:
    cache.store = lambda *_: None
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, last):
            try:
                check(seed, Path(folder), (1, 4, kernel.lanes()) if seed % 10 == 0 else (1, 4))
            except Exception as failure:
                print(f"seed {seed}: {type(failure).__name__}: {failure}", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
