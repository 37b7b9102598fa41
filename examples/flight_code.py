"""The steps of a top as C code without Python: compiled by cc, it makes the same run, to the bit."""

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np

import liemech as lm

top = lm.models.HeavyTop([1.0, 1.2, 0.6], 1.0, [0.0, 0.0, 0.5])
start = top.state(mu=[0.3, 0.2, 2.0], g=lm.SO3().exp([0.4, 0.0, 0.0]))
plan = lm.Plan(top, lm.RKMK(order=4), h=0.01)
run = plan.run(start, steps=2000)
axis = run.g[:, :, 2]  # the third axis of the body, seen from space
with tempfile.TemporaryDirectory() as folder:
    made = plan.export(Path(folder) / "top", start)
    bound, size = made.bound, made.object.stat().st_size
    print(f"an object file of {size} bytes; a step is at most {bound.instructions} operations,")
    print(
        f"of which {bound.divisions} are divisions or roots, and {bound.calls} calls of sin or cos"
    )
    if shutil.which("cc"):
        build = ["cc", "-O2", "top_example.c", "top.o", "-lm", "-o", "top"]
        subprocess.run(build, cwd=folder, check=True)
        told = subprocess.run([Path(folder) / "top", "2000", "1"], capture_output=True, text=True)
        rows = np.array([line.split() for line in told.stdout.splitlines()], dtype=float)
        same = np.array_equal(rows[:, 1:4], run.mu) and np.array_equal(rows[:, 0], run.t)
        print(f"C and Python agree to the bit after {len(rows) - 1} steps: {same}")
        axis = rows[:, 4:].reshape(-1, 3, 3)[:, :, 2]
figure, ax = lm.plots.subplots()
ax.plot(axis[:, 0], axis[:, 1])
ax.set(aspect="equal", xlabel="nose of the top, $x$", ylabel="$y$")
lm.plots.save(figure, "flight_code.png")
