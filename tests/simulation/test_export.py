"""C code of a plan: compiled by `cc`, it makes the run to the bit."""

from __future__ import annotations

import math
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import liemech as lm
from liemech.errors import IncompatibleSystem, InvalidInput, NotCompilable

pytestmark = pytest.mark.compiled
CC = shutil.which("cc")
NEEDS_CC = pytest.mark.skipif(CC is None, reason="there is no C compiler")


@lm.record
class Push(lm.Force):
    torque: Any
    gain: float = 0.3

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        torque = self.torque(t) if callable(self.torque) else self.torque
        return torque - self.gain * lm.vec(g[2, 1], 0.0, g[0, 1])


def satellite(torque: Any = (0.1, -0.2, 0.3)) -> Any:
    load = Push(torque if callable(torque) else lm.vec(*torque))
    return lm.MechanicalSystem(lm.RigidBody([1.0, 1.5, 2.0]), lm.NoPotential(), load=load)


START = satellite().state(xi=[0.3, -0.2, 0.4], g=lm.SO3().exp([0.3, 0.1, -0.2]))
TABLE = lm.PiecewisePolynomial.linear([0.0, 0.13, 1.0], np.eye(3), outside="hold")
BODY, TOP = lm.RigidBody([1.0, 1.6, 2.3]), lm.models.HeavyTop([1.0, 1.5, 0.7], 1.3, [0.6, 0.0, 0.8])
PENDULUM = lm.SphericalPendulum()
CASES: dict[str, tuple[Any, Any, Any, bool]] = {
    "explicit": (satellite(), lm.RKMK(order=4), START, True),
    "with a memory": (satellite(), lm.LieVerlet(), START, False),
    "of kicks": (TOP, lm.KickDrift(), TOP.state(mu=[0.1, 0.2, 3.0], g=np.eye(3)), False),
    "of a table": (satellite(TABLE), lm.CommutatorFree(order=4), START, False),
    "compensated": (BODY, lm.CovariantVariational(lm.Cayley()), BODY.state(mu=[0.5, -0.3, 0.7]), False),
    "constrained": (PENDULUM, lm.RATTLE(), PENDULUM.state([1.0, 0.0, 0.0], [0.0, 0.5, 0.3]), False),
}  # fmt: skip


def compiled(folder: Path, name: str, more: str = "") -> None:
    """By the C compiler, which has nothing to say to it."""
    flags = f"-std=c99 -Wall -Wextra -pedantic -Werror -O2 {more}".split()
    files = [f"{name}_example.c", f"{name}.o", "-lm", "-o", name]
    made = subprocess.run([str(CC), *flags, *files], cwd=folder, capture_output=True, text=True, timeout=60)
    assert made.returncode == 0, made.stderr


def printed(folder: Path, name: str, *words: str) -> np.ndarray:
    """What the program prints, as numbers."""
    made = subprocess.run([folder / name, *words], capture_output=True, text=True, timeout=60, check=True)
    return np.array([[float(x) for x in line.split()] for line in made.stdout.splitlines()])


@pytest.mark.slow
@NEEDS_CC
@pytest.mark.parametrize("case", CASES)
def test_the_example_makes_the_run_to_the_bit(case: str, tmp_path: Path) -> None:
    system, method, start, bounded = CASES[case]
    plan = lm.Plan(system, method, h=0.01)
    made = plan.export(tmp_path / "body", start)
    assert (made.bound is not None) == bounded
    compiled(tmp_path, "body")
    found = printed(tmp_path, "body", "15", "3")
    run = plan.run(start, steps=45)
    parts = [np.reshape(x[::3], (16, -1)) for x in run.states.values()]
    assert np.array_equal(found, np.column_stack([run.t[::3], *parts]))


LOOP = """
#include <stdio.h>
#include "loop.h"
int main(void) {
  loop_state start = {{0.3, -0.3, 0.8}, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  loop_inputs command = {{0, 0, 0}, 0.5};
  loop run, other;
  int k, i;
  if (!loop_begin(&run, &start, NULL, 2.0)) return 1;
  for (k = 0; k < 6; k++) {
    for (i = 0; i < 3; i++) command.torque[i] = -0.5 * run.state.mu[i];
    if (loop_step(&run, &command, 2) != 2) return 2;
    other = run;  /* a copy goes on by itself */
    if (loop_step(&run, NULL, 1) != 1 || loop_step(&other, NULL, 1) != 1) return 3;
    if (memcmp(&run.state, &other.state, sizeof run.state)) return 4;
  }
  printf("%.17g", loop_time(&run));
  for (i = 0; i < 12; i++) printf(" %.17g", ((double *)&run.state)[i]);
  printf("\\n");
  return 0;
}
"""


@pytest.mark.slow
@NEEDS_CC
@pytest.mark.parametrize("method", [lm.RKMK(order=4), lm.LieVerlet()], ids=["RKMK", "LieVerlet"])
def test_a_loop_closed_in_c_is_that_of_the_stepper(method: Any, tmp_path: Path) -> None:
    plan = lm.Plan(satellite(), method, h=2.0**-6)
    start = plan.system.state(mu=[0.3, -0.3, 0.8], g=np.eye(3))
    plan.export(tmp_path / "loop", start, inputs=["torque", "load.gain"], target="native")
    (tmp_path / "loop_example.c").write_text(LOOP)
    compiled(tmp_path, "loop", "-ffp-contract=off")
    found = printed(tmp_path, "loop")[0]
    loop = plan.stepper(start, t0=2.0)
    for _ in range(6):
        loop.step(2, torque=-0.5 * loop.mu, gain=0.5)
        loop.step(1)
    assert np.array_equal(found, [loop.t, *loop.mu, *loop.g.ravel()])


FUSE = """
#include <stdio.h>
#include "fuse.h"
int main(void) {
  fuse_state start = {{0.1, 0.1, 0.1}};
  fuse_inputs command = {{0, 0, 0}};
  fuse run;
  fuse_begin(&run, &start, &command, 0.0);
  printf("%d ", (int)fuse_step(&run, NULL, 4));
  command.torque[0] = 200;
  printf("%d ", (int)fuse_step(&run, &command, 4));
  printf("%.17g ", fuse_time(&run));
  command.torque[0] = 0;
  printf("%d ", (int)fuse_step(&run, &command, 2));
  printf("%.17g\\n", fuse_time(&run));
  return 0;
}
"""


@lm.record
class Fused(lm.DrivenHamiltonian):
    """An energy that is not there for large fields."""

    torque: lm.Vec

    def energy(self, t: float, mu: Any) -> Any:
        if self.torque[0] > 100.0:
            raise ValueError("the fuse is blown")
        return 0.5 * lm.dot(mu, mu) + lm.dot(self.torque, mu)


@NEEDS_CC
def test_a_step_that_fails_is_not_made(tmp_path: Path) -> None:
    system = lm.DrivenLiePoissonSystem(lm.SO3(), Fused([0.0, 0.0, 0.0]))
    plan = lm.Plan(system, lm.RKMK(order=4), h=0.25)
    plan.run(system.state(mu=[0.1, 0.1, 0.1]), steps=1)
    plan.export(tmp_path / "fuse", inputs=["torque"])  # of the only starts it had
    (tmp_path / "fuse_example.c").write_text(FUSE)
    compiled(tmp_path, "fuse")
    assert printed(tmp_path, "fuse").tolist() == [[4.0, 0.0, 1.0, 2.0, 1.5]]


@pytest.mark.slow
def test_it_needs_the_c_library_and_nothing_else(tmp_path: Path) -> None:
    """Names that the object file asks for, and platforms that it may be for."""
    plan = lm.Plan(satellite(), lm.LieVerlet(), h=0.01)
    made = plan.export(tmp_path / "body", START)
    assert "-march" not in made.header.read_text() and made.processor == "generic"
    code = made.object.read_bytes()
    for name in (b"Py", b"liemech_raised", b"liemech_ensure", b"liemech_fetch", b"malloc"):
        assert name not in code, name
    assert "No bound on the time of a step" in made.header.read_text()
    nm = shutil.which("nm")
    if nm:
        listed = subprocess.run([nm, "-u", made.object], capture_output=True, text=True).stdout
        assert {x.split()[-1] for x in listed.splitlines()} <= {"sin", "cos"}
    far = plan.export(tmp_path / "far", START, target="aarch64-linux-gnu:cortex-a72")
    assert far.platform == "aarch64-linux-gnu" and far.object.read_bytes()[18] == 0xB7  # EM_AARCH64
    for target, words in (("thumbv7em-none-eabihf", "64 bits"), ("nowhere", "knows no target")):
        with pytest.raises(NotCompilable, match=words):
            plan.export(tmp_path / "far", START, target=target)


@lm.record
class AskingPython(lm.Force):
    def covector(self, t: float, xi: Any, g: Any) -> Any:
        return lm.vec(math.hypot(xi[0], xi[1]), math.erf(xi[2]), 0.0)


@lm.record
class NamedAsInC(lm.Force):
    double: float = 0.1

    def covector(self, t: float, xi: Any, g: Any) -> Any:
        return lm.vec(self.double, 0.0, 0.0)


@pytest.mark.slow
def test_what_is_refused(tmp_path: Path) -> None:
    path, plan = tmp_path / "body", lm.Plan(satellite(), lm.RKMK(order=4), h=0.01)
    asking = lm.MechanicalSystem(BODY, lm.NoPotential(), load=AskingPython())
    named = lm.MechanicalSystem(BODY, lm.NoPotential(), load=NamedAsInC())
    spins = lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5))
    for refused, given, error, words in (
        (lambda: lm.Plan(asking, lm.RKMK(), h=0.01).export(path, START), 0, NotCompilable, "math.erf"),
        (lambda: lm.Plan(BODY, lm.RKMK(order=5), rtol=1e-6).export(path, START), 0, IncompatibleSystem, "fixed"),
        (lambda: lm.Plan(lm.Kepler(), spins, h=0.1).export(path), 0, IncompatibleSystem, "fixed steps"),
        (lambda: plan.export(path), 0, InvalidInput, "give start="),
        (lambda: plan.export(tmp_path / "a-b", START), 0, InvalidInput, "'a-b' is no name in C"),
        *[(lambda name=name: plan.export(tmp_path / name, START), 0, InvalidInput, f"{name}_run")
          for name in ("for", "int", "double", "main", "printf", "class", "sin", "int64_t")],
        (lambda: lm.Plan(named, lm.LieVerlet(), h=0.01).export(path, START, inputs=["double"]), 0, InvalidInput, "rename"),
        (lambda: plan.export(path, START, inputs=["inertia"]), 0, InvalidInput, "follow from body.inertia"),
        (lambda: plan.export(path, START, inputs=["torq"]), 0, InvalidInput, "torq is no parameter"),
    ):  # fmt: skip
        with pytest.raises(error, match=words):
            refused()
        assert not path.with_suffix(".o").exists() and given == 0


def test_the_bound_is_the_longest_way() -> None:
    """A step with two branches, by hand: 3 + max(2, 5) + 2 instructions; and one with a loop in it."""
    from liemech.compiler.machine.object_files import bound_of

    step = """
define void @k(ptr %p) {
  br label %bodies
bodies:
  br label %samples
samples:
  br label %steps
steps:
  %x = fadd double %a, %b
  %c = fcmp olt double %x, 1.0
  br i1 %c, label %short, label %long
short:
  %y = fmul double %x, %x
  br label %join
long:
  %z = fdiv double %x, %x
  %w = call double @llvm.sqrt.f64(double %z)
  %v = tail call fastcc double @inner(double %w)
  %u = fmul double %v, %v
  br label %INSIDE
join:
  %d = icmp eq i64 0, 1
  br i1 %d, label %steps, label %after
after:
  %e = icmp eq i64 0, 1
  br i1 %e, label %samples, label %last
last:
  br i1 %e, label %bodies, label %end
end:
  ret void
}
define internal double @inner(double %x) {
  %y = call double @"liemech_sin"(double %x)
  ret double %y
}
"""
    found = bound_of(step.replace("INSIDE", "join"), "k")
    assert found is not None
    # steps: 3, the long way: 5 and the 2 of the function inside, the join: 2
    assert (found.instructions, found.arithmetic) == (12, 3)
    assert (found.divisions, found.calls) == (2, 1)
    assert found.overhead == 1 + 1 + 1 + 2 + 1 + 1
    for inside in ("long", "first"):  # a loop in a step, and one that leads out of it
        turns = f"  br i1 %c, label %{inside}, label %join"
        first = "first:\n  br i1 %c, label %first, label %end\njoin:"
        looped = step.replace("  br label %INSIDE", turns).replace("join:", first)
        assert bound_of(looped, "k") is None
