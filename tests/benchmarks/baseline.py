"""The C++ opponent of `baseline.cpp`, compiled on the spot and called through ctypes."""

import ctypes
import hashlib
import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).with_name("baseline.cpp")
PROCESSOR = os.environ.get("LIEMECH_CPU") or "native"
FLAGS = ("-std=c++17", "-O3", f"-march={PROCESSOR}", "-fno-math-errno", "-shared", "-fPIC")
CONTRACTIONS = ("off", "fast")


def libraries(source: Path) -> dict[str, ctypes.CDLL]:
    """The C++ of a file in each contraction mode, "off" and "fast", compiled for this processor; empty without g++."""
    compiler = os.environ.get("CXX") or shutil.which("g++")
    if not compiler:
        return {}
    folder, found = Path(tempfile.mkdtemp()), {}
    for contraction in CONTRACTIONS:
        library = folder / f"{source.stem}-{contraction}.so"
        command = [compiler, *FLAGS, f"-ffp-contract={contraction}", str(source), "-o", str(library)]
        subprocess.run(command, check=True)
        found[contraction] = ctypes.CDLL(str(library))
    return found


METHODS = {
    "RKMK4": 0,
    "Algorithm 1, Cayley": 1,
    "Algorithm 1, exp": 2,
    "Algorithm 1, Cayley, one unknown": 3,
    "Hamilton-Jacobi 4, exp": 4,
    "Suzuki of Algorithm 1, Cayley": 5,
    "Suzuki of Algorithm 1, exp": 6,
    "Lie-Verlet, Cayley": 7,
    "Lie-Verlet, exp": 8,
}
ALONE = 5
"""From this number on one body at a time."""
TOP = 7
"""From this number on a heavy top, whose attitude moves too."""
FIXED_NEWTON = {
    "Cayley, 2 solves": 9,
    "Cayley, 3 solves": 10,
    "exp, 2 solves": 11,
    "exp, 3 solves": 12,
}  # only in a sweep build; two solves are too few in the first steps, where nothing can be extrapolated yet


@dataclass(frozen=True)
class Baseline:
    """One build of the kernels; `contraction` is GCC's -ffp-contract, off or fast."""

    contraction: str
    path: Path
    width: int
    _library: ctypes.CDLL

    def lanes(self, groups: int = 3) -> int:
        """Bodies advanced together by the ensemble kernel: SIMD width times registers per variable (3 is the best)."""
        return self.width * groups

    def advance(
        self, method: int, lanes: int, mu: np.ndarray, g: np.ndarray | None, inertia: np.ndarray, h: float, steps: int
    ) -> float:
        """Advance momenta (3, n) and attitudes (9, n) or None in place; returns Newton solves per step.

        inertia : the moments, (3,), followed by weight times centre if it is a top, (6,).
        """
        n = mu.shape[1]
        if n % lanes:
            raise ValueError(f"{n} bodies are not a multiple of {lanes} lanes")
        attitude = ctypes.c_void_p() if g is None else ctypes.c_void_p(g.ctypes.data)
        solves = self._library.advance(
            method,
            lanes,
            ctypes.c_void_p(mu.ctypes.data),
            attitude,
            ctypes.c_void_p(inertia.ctypes.data),
            ctypes.c_double(h),
            ctypes.c_long(n),
            ctypes.c_long(steps),
        )
        if solves < 0:
            raise ValueError(f"no kernel for method {method} with {lanes} lanes in this build")
        return solves / (steps * (n // lanes))

    def packed(self) -> dict[str, dict[str, int]]:
        """Arithmetic instructions of each ensemble kernel by register: zmm, ymm (packed) and scalar. Needs objdump."""
        if shutil.which("objdump") is None:
            return {}
        listing = subprocess.run(
            ["objdump", "-d", "-C", "--no-show-raw-insn", str(self.path)], capture_output=True, text=True, check=True
        ).stdout
        counts: dict[str, dict[str, int]] = {}
        for block in listing.split("\n\n"):
            head = re.search(r"<(?:long )?march<(.*), Lanes<(\d)>, (true|false)>", block)
            if head:
                records = "mu, g" if head[3] == "true" else "mu"
                name = f"{head[1]}, {int(head[2]) * self.width} lanes, {records}"
                operations = re.findall(r"\sv(?:add|sub|mul|div|fn?m(?:add|sub)\d+)(pd|sd)\s+(.*)", block)
                # a kernel may come in parts
                count = counts.setdefault(name, {"zmm": 0, "ymm": 0, "scalar": 0})
                for kind, registers in operations:
                    count["scalar" if kind == "sd" else "zmm" if "zmm" in registers else "ymm"] += 1
        return counts


def build(*, sweep: bool = False) -> dict[str, Baseline]:
    """Compile the kernels in each contraction mode, side by side; empty without g++. Kept in the temporary folder."""
    compiler = os.environ.get("CXX") or shutil.which("g++")
    if not compiler:
        return {}
    version = subprocess.run([compiler, "--version"], capture_output=True, text=True, check=True).stdout
    processor = Path("/proc/cpuinfo").read_text().split("\n\n")[0] if Path("/proc/cpuinfo").exists() else ""
    native = [
        line for line in processor.splitlines() if line.startswith(("model", "flags"))
    ]  # -march=native is no portable key
    folder = Path(tempfile.gettempdir()) / f"liemech-benchmarks-{os.getuid() if hasattr(os, 'getuid') else 0}"
    folder.mkdir(mode=0o700, exist_ok=True)
    paths, jobs = {}, []
    for contraction in CONTRACTIONS:
        command = [compiler, *FLAGS, f"-ffp-contract={contraction}", *(["-DSWEEP"] if sweep else []), str(SOURCE)]
        key = hashlib.sha256("\n".join([version, *native, *command, SOURCE.read_text()]).encode()).hexdigest()[:16]
        paths[contraction] = folder / f"baseline-{contraction}-{key}.so"
        if not paths[contraction].exists():
            unfinished = paths[contraction].with_suffix(f".{os.getpid()}")
            jobs.append((subprocess.Popen([*command, "-o", str(unfinished)]), unfinished, paths[contraction]))
    for job, unfinished, path in jobs:
        if job.wait():
            raise RuntimeError(f"{compiler} failed on {SOURCE.name}")
        unfinished.replace(path)
    return {contraction: _load(contraction, path) for contraction, path in paths.items()}


def _load(contraction: str, path: Path) -> Baseline:
    library = ctypes.CDLL(str(path))
    library.advance.restype = ctypes.c_long
    return Baseline(contraction, path, library.simd_width(), library)


def plain_c(source: Path, defines: Mapping[str, object], contraction: str, folder: Path) -> ctypes.CDLL | None:
    """A library of plain C, compiled for these definitions, with or without fused multiply-add;
    None without a compiler.
    """
    compiler = os.environ.get("CC") or shutil.which("gcc")
    if not compiler:
        return None
    name = hashlib.sha256(repr((sorted(defines.items()), contraction)).encode()).hexdigest()[:16]
    flags = [f for f in FLAGS if not f.startswith("-std")]
    values = [f"-D{key}={value}" for key, value in defines.items()]
    path = folder / f"{source.stem}-{name}.so"
    command = [compiler, *flags, f"-ffp-contract={contraction}", *values, str(source), "-o", str(path), "-lm"]
    subprocess.run(command, check=True)
    return ctypes.CDLL(str(path))


def listed(numbers: Iterable[float]) -> str:
    """Numbers as C has them in braces."""
    return ",".join(map(repr, numbers))
