"""Copies: a formula that is called again in one form is translated once, and LLVM copies it; the
bits are those of formulas that are written out.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("llvmlite")
import worlds
from test_inlining import ROWS, TEXT, no_kernels

from liemech.compiler import kernel
from liemech.compiler.machine import llvm
from liemech.compiler.translation import branches, inlining, instructions
from liemech.compiler.translation import module as llvm_module

pytestmark = pytest.mark.compiled


@pytest.fixture
def copied(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Every formula is copied from its second call of one form on; the names of what is."""
    no_kernels(monkeypatch)
    monkeypatch.setattr(inlining, "COPIED", 0)
    monkeypatch.setattr(inlining, "PER_NUMBER", 0)
    names: list[str] = []
    make = inlining.Outliner.make

    def noted(self: Any, key: Any, call: Any, frame: Any, *args: Any) -> Any:
        made = make(self, key, call, frame, *args)
        if key[0] == "copy" and made is not None:
            names.append(frame.source.function.__name__)
        return made

    monkeypatch.setattr(inlining.Outliner, "make", noted)
    return names


CALLS = {
    "ways": "norm2",  # two vectors that are one
    "raising": "root",  # it fails, in some lanes
    "derived": "cubed",
    "lists": "longer",
    "imaginary": "",  # products of matrices are no formulas
}


@pytest.mark.sample(2)
@pytest.mark.parametrize("name", CALLS)
def test_formulas(name: str, copied: list[str], tmp_path: Path) -> None:
    text = TEXT + f"def turned(x, y, turns):\n    return {name}(x, y) + {name}(x, y) + {name}(y, x)"
    module = worlds.module_from(text, tmp_path, f"copied_{name}")
    worlds.same_in_all_worlds(module.turned, ROWS, lanes=[1, 4])
    assert {name, CALLS[name] or name} <= {*copied}


def test_a_repeated_formula_is_translated_twice_and_not_thirty_times(
    copied: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Once where it stands, once for LLVM to copy; the module knows how long it will be."""
    text = """
def turn(x, y):
    a, b = x * x - y * y, x * y + x
    return a * a - b * b, a * b + a

def formula(x, y, n):
    for k in range(30):
        x, y = turn(x, y)
    return x, y
"""
    texts: list[str] = []
    compiled = llvm.object_code
    monkeypatch.setattr(llvm, "object_code", lambda t: (texts.append(t), compiled(t))[1])
    module = worlds.module_from(text, tmp_path, "copied_thirty")
    worlds.same_in_all_worlds(module.formula, [(0.3, 0.4), (0.1, -0.2)], lanes=[1, kernel.width()])
    assert copied == ["turn", "turn"]
    kernels = [made for made in texts if '"liemech"' in made]  # beside what a process makes once
    assert len(kernels) == 2
    for made in kernels:
        assert made.count("fmul") == 2 * 6
        assert llvm.size(made) > 30 * 10
        assert llvm.optimised(made).count("fmul") >= 30 * 6


def test_lanes_of_a_long_kernel_are_translated_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """With one register a number; a short one once more, with two."""
    no_kernels(monkeypatch)
    widths: list[int] = []
    translation = llvm_module._translation
    monkeypatch.setattr(llvm_module, "_translation", lambda *a: (widths.append(a[2]), translation(*a))[1])
    text = "def formula(x, y, n):\n    return x * y + x, y / (x * x + 1.0)"
    rows = [(0.1 * k, 1.0 + k) for k in range(kernel.lanes())]
    for short, wanted in ((instructions.SHORT, [kernel.width(), kernel.lanes()]), (0, [kernel.width()])):
        monkeypatch.setattr(instructions, "SHORT", short)
        module = worlds.module_from(text, tmp_path, f"widths_{short}")
        worlds.same_in_all_worlds(module.formula, rows, lanes=[kernel.lanes()])
        assert widths[-len(wanted) :] == wanted
        widths.clear()


def test_a_branch_with_a_loop_without_a_known_end_is_rare(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """As one that calls the C library: what is alive around it stays in registers."""
    text = """
def formula(x, y, n):
    if x > y:
        while x > 1.0:
            x = x * 0.75
    return x + y
"""
    texts: list[str] = []
    compiled = llvm.object_code
    monkeypatch.setattr(llvm, "object_code", lambda t: (texts.append(t), compiled(t))[1])
    module = worlds.module_from(text, tmp_path, "rarely_looping")
    worlds.same_in_all_worlds(module.formula, [(9.0, 0.4), (0.1, 0.2)], lanes=[1])
    assert any(f"i32 1, i32 {branches.RARE}" in made for made in texts)
