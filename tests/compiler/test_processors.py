"""Code for other processors: the same bits, code of their own on disk, and refusals by name."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("llvmlite")
from processors import AMONG, available, processor_for

from liemech.compiler import kernel
from liemech.compiler.machine import llvm
from liemech.errors import InvalidInput

pytestmark = [
    pytest.mark.compiled,
    pytest.mark.skipif(not llvm.triple().startswith("x86_64"), reason="code for one processor only"),
]

PROGRAM = """
import sys
import numpy as np
import liemech as lm
from liemech.compiler import kernel
from liemech.compiler.machine import llvm

native = sys.argv[1:] != ["plain"]
body = lm.RigidBody([1.0, 1.5, 2.25])
alone = body.state(mu=[0.5, 0.1, 0.75], g=np.eye(3))
many = body.state(mu=np.sin(np.arange(33.0)).reshape(11, 3))
how = {"h": 0.1, "compiled": native, "progress": False}
runs = [
    lm.integrate(body, lm.CovariantVariational(lm.Cayley()), many, steps=9, **how).mu,
    lm.integrate(body, lm.RKMK(order=1), alone, steps=3, precision="double-double", **how).mu,
]
print(llvm.processor()[0] if native else "", kernel.width() if native else 0, sum(k.cached for k in kernel.alive()))
print("".join(np.asarray(x).tobytes().hex() for x in runs))
"""


def started(folder: Path, processor: str, *words: str) -> subprocess.Popen[str]:
    environment = os.environ | {"LIEMECH_CPU": processor, "LIEMECH_CACHE_DIR": str(folder)}
    program = [sys.executable, "-W", "ignore", "-c", PROGRAM, *words]
    return subprocess.Popen(program, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def answer(process: subprocess.Popen[str]) -> list[str]:
    out, err = process.communicate(timeout=300)
    assert process.returncode == 0, err
    return out.splitlines()


@pytest.mark.slow
def test_the_same_bits_and_code_of_its_own(tmp_path: Path) -> None:
    """In lanes as wide as the registers of each, and where `fma` is an instruction or not."""
    among = [name for name in AMONG if available(name)]
    running = [started(tmp_path, name) for name in among]
    plain = answer(started(tmp_path, "native", "plain"))[1]
    found = [answer(process) for process in running]
    for name, (told, bits), width in zip(among, found, (2, 4, 8)):
        assert told == f"{name} {width} 0" and bits == plain, name
    again = answer(started(tmp_path, among[0]))
    assert again[0].split()[2] != "0" and again[1] == plain
    last = answer(started(tmp_path, "native"))
    assert last[0].endswith(" 0") and last[1] == plain


@pytest.mark.slow
def test_code_on_disk_is_of_one_processor(monkeypatch: pytest.MonkeyPatch) -> None:
    """The key of a kernel tells for which."""
    monkeypatch.setattr(llvm, "processor", processor_for)
    monkeypatch.setattr(llvm, "machine", llvm.machine.__wrapped__)
    keys = set()
    among = ["native", *filter(available, AMONG)]
    for name in among:
        monkeypatch.setenv("LIEMECH_CPU", name)
        keys.add(kernel._key(available, (), 1))
    assert len(keys) == len(among)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("nonsense", "knows no such processor"),
        ("i686", "knows no such processor"),
        ("apple-m1", "knows no such processor"),
        ('a"b', "knows no such processor"),
        ("bdver2", "lacks its instructions fma4, xop"),
    ],
)
def test_what_is_refused(name: str, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "bdver2" and llvm.llvm.get_host_cpu_features().get("xop"):
        pytest.skip("this processor has them")
    monkeypatch.setenv("LIEMECH_CPU", name)
    monkeypatch.setattr(llvm, "processor", processor_for)
    with pytest.raises(InvalidInput, match=message):
        kernel.available()


def test_processors_with_instructions_that_this_one_lacks(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on one with AVX2 and no more: AVX-512 is refused; what only the operating system uses is left out."""
    here = llvm.llvm.get_host_cpu_features()
    for feature in here:
        if feature.startswith(("avx512", "avx10", "amx")) or feature in ("pku", "clzero"):
            here[feature] = False
    monkeypatch.setattr(llvm.llvm, "get_host_cpu_features", lambda: here)
    monkeypatch.setenv("LIEMECH_CPU", "x86-64-v4")
    with pytest.raises(InvalidInput, match="lacks its instructions avx512bw, avx512cd, avx512dq, avx512f, avx512vl"):
        processor_for()
    if here["avx2"]:
        monkeypatch.setenv("LIEMECH_CPU", "znver2")
        _, instructions, width = processor_for()
        assert width == 4 and "-clzero" in instructions.split(",")
