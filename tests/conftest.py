"""What every test may rely on: fixed seeds, no window, no compiler where it is switched off."""

from __future__ import annotations

import importlib.util
import os
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # small matrices: threads that wait for each other on a busy machine

import numpy as np
import pytest
from hypothesis import settings

import liemech

# For this process and the programs that tests start anywhere: no window, and the liemech under test.
os.environ["MPLBACKEND"] = "Agg"
home = str(Path(liemech.__file__).parent.parent)
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH")]))

# The same examples in every run: a law that fails fails again. No deadline, for the first call may compile.
settings.register_profile("liemech", derandomize=True, deadline=None, database=None, max_examples=50)
settings.load_profile("liemech")


def can_compile() -> bool:
    """Whether native code may be made in this run: llvmlite is installed and nobody asked for plain Python."""
    switched_off = os.environ.get("LIEMECH_COMPILE") == "0" or os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
    return not switched_off and importlib.util.find_spec("llvmlite") is not None


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    if can_compile():
        return
    plain = pytest.mark.skip(reason="needs the compiler, which is missing or switched off")
    for item in items:
        if item.get_closest_marker("compiled"):
            item.add_marker(plain)


@pytest.fixture
def rng() -> np.random.Generator:
    """Random numbers that are the same in every run."""
    return np.random.default_rng(20_240_229)
