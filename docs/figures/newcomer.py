"""Film the path of a newcomer: from `pip install` to a body that moves in the browser.

    python docs/figures/newcomer.py                # writes newcomer.gif; needs Chromium and Pillow

Everything is run, in a copy of the folder and an environment of its own; the clock shows the time it
took on this machine.  Waiting is shown sixty times as fast, and says so.  At the end `k` makes a
link to the moment and view that are shown.
"""

import io
import os
import subprocess
import sys
import tempfile
import textwrap
import time
import venv
from itertools import pairwise
from pathlib import Path

import matplotlib
import numpy as np
from PIL import Image, ImageDraw, ImageFont

import liemech as lm
from liemech.viewer.snapshot import _at, _stage

HERE = Path(__file__).parent
SIZE, LINE, WIDTH = (640, 340), 19, 76
INSTALL = 'pip install ".[plot,viewer]"'
PROGRAM = """\
import liemech as lm
body = lm.RigidBody([1.0, 2.0, 3.0])
start = body.state(mu=[0.01, 1.0, 0.01], g=lm.SO3().identity())
run = lm.integrate(body, lm.RKMK(), start, h=0.1, steps=600)
run.view().save("body.html")
"""
PICTURES, PER_SECOND, FASTER = 40, 8, 60
FONT = ImageFont.truetype(
    str(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / "DejaVuSansMono.ttf"), 13
)


def terminal(lines: list[str], seconds: float, note: str = "") -> Image.Image:
    """The screen of a terminal, with the clock in its corner."""
    picture = Image.new("RGB", SIZE, "#10151c")
    pen = ImageDraw.Draw(picture)
    for k, line in enumerate(lines[-(SIZE[1] // LINE - 2) :]):
        color = "#e8edf4" if line[:1] in "$>" else "#9fb0c4"
        pen.text((14, 12 + k * LINE), line[:WIDTH], fill=color, font=FONT)
    said = f"{seconds:5.1f} s{note}"
    pen.text((SIZE[0] - 14, SIZE[1] - 26), said, fill="#E8A33D", font=FONT, anchor="ra")
    return picture


def run(command: list[str], folder: Path) -> tuple[float, str]:
    """How long a command takes, in s, and what it prints."""
    begun = time.monotonic()
    clean = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "LIEMECH_CACHE_DIR")}
    done = subprocess.run(
        command, cwd=folder, env=clean | {"HOME": str(folder)}, text=True, capture_output=True
    )
    if done.returncode:
        sys.exit(done.stdout + done.stderr)
    return time.monotonic() - begun, done.stdout


def main() -> None:
    frames: list[Image.Image] = []
    with tempfile.TemporaryDirectory() as place:
        copy = Path(place) / "liemech"
        root = HERE.parent.parent
        files = subprocess.run(
            ["git", "ls-files", "liemech", "pyproject.toml", "README.md"],
            cwd=root,
            text=True,
            capture_output=True,
            check=True,
        ).stdout.split("\n")
        for file in filter(None, files):
            (copy / file).parent.mkdir(parents=True, exist_ok=True)
            (copy / file).write_bytes((root / file).read_bytes())
        venv.create(Path(place) / "env", with_pip=True)
        python = str(Path(place) / "env" / "bin" / "python")
        took, said = run([python, "-m", "pip", "install", ".[plot,viewer]"], copy)
        ran, _ = run([python, "-c", PROGRAM], Path(place))

    lines = [f"$ {INSTALL}"]
    frames += [terminal(lines[:1], 0.0)] * PER_SECOND
    for t in np.arange(0.0, took, FASTER / PER_SECOND):
        frames.append(terminal(lines, t, f"   ({FASTER} times as fast)"))
    installed = next(line for line in said.split("\n") if line.startswith("Successfully"))
    lines += [*textwrap.wrap(installed, WIDTH), "$ python"]
    for line in PROGRAM.splitlines():
        lines.append(f">>> {line}")
        frames += [terminal(lines, took)] * (PER_SECOND // 2)
    frames += [terminal(lines, took + t) for t in np.arange(0.0, ran, 1.0 / PER_SECOND)]

    body = lm.RigidBody([1.0, 2.0, 3.0])
    start = body.state(mu=[0.01, 1.0, 0.01], g=lm.SO3().identity())
    scene = lm.integrate(body, lm.RKMK(), start, h=0.1, steps=600).view()
    with _stage(scene, SIZE) as page:
        frames += [
            Image.open(io.BytesIO(_at(page, t))).convert("RGB")
            for t in np.linspace(0.0, 0.6 * scene.duration, PICTURES)
        ]
        page.evaluate("document.getElementById('link').click()")
        page.wait("document.getElementById('message').style.display === 'block'")
        frames += [Image.open(io.BytesIO(page.picture())).convert("RGB")] * (3 * PER_SECOND)
    some = Image.fromarray(np.hstack([np.asarray(frames[k]) for k in (0, -PICTURES, -1)]))
    palette = some.quantize(160, method=Image.Quantize.MAXCOVERAGE)
    shots = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    durations = [round(1000 / PER_SECOND)] * len(shots)
    kept = [0, *(k for (j, k) in pairwise(range(len(frames))) if frames[k] is not frames[j])]
    spans = [sum(durations[a:b]) for a, b in pairwise([*kept, len(shots)])]
    first, *others = (shots[k] for k in kept)
    first.save(HERE / "newcomer.gif", save_all=True, append_images=others, duration=spans, loop=0)
    print(f"installed in {took:.0f} s; five lines to a page in {ran:.1f} s")


if __name__ == "__main__":
    main()
