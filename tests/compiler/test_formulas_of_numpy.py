"""Formulas as users of NumPy write them, with NumPy as the reference."""

from __future__ import annotations

from pathlib import Path

import fuzz_numpy
import pytest

from liemech.compiler import kernel

pytestmark = pytest.mark.compiled

SOME = range(0, len(fuzz_numpy.FORMULAS), 6)
"""Formulas of the quick tests."""


@pytest.mark.parametrize(
    "i", [i if i in SOME else pytest.param(i, marks=pytest.mark.slow) for i in range(len(fuzz_numpy.FORMULAS))]
)
def test_numpy_plain_python_and_native_code_agree(i: int, tmp_path: Path) -> None:
    lanes = (1, kernel.lanes())
    assert not [*fuzz_numpy.differences(i, tmp_path, 0, lanes)]
