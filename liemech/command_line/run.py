"""`liemech run`: follow a scene, tell what was kept, save, draw and show it."""

from __future__ import annotations

import json
import sys
import textwrap
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

import liemech as lm

from ..simulation.arguments import chooses_steps
from ..simulation.reports.progress import WANTED
from .constructors import read
from .options import Parser, called, count, duration, number, output, picture
from .scene import Setup
from .scene_file import scene_file
from .scenes import SCENES, scene_meant

HERE = Path()

EXAMPLES = """\
examples:
  liemech run heavy-top
  liemech run heavy-top --view --plot        heavy-top.html and heavy-top.png
  liemech run kepler --method "Splitting(order=8)" --h 0.05 --steps 1e5
  liemech run flip --save && liemech view flip.npz
  liemech run pendulum --explain             what would be computed
"""


def run(arguments: Sequence[str]) -> int:
    """The command.  Returns the exit status: 0, 1 if the run or a file failed, 130 after Ctrl-C."""
    options = _options(arguments)
    scene = _scene(options)
    saved, viewed, plotted = (getattr(options, name) is not None for name in ("save", "view", "plot"))
    refused = []
    try:
        record = scene.parts(saved=saved, viewed=viewed, plotted=plotted)
    except lm.errors.InvalidInput as wrong:
        if not viewed or scene.view is not None or not (saved or plotted):
            raise
        # the other outputs need not be missed
        options.view, refused = None, [f"no page: {wrong}"]
        record = scene.parts(saved=saved, viewed=False, plotted=plotted)
    every = scene.sampling(saved)
    if options.explain:
        print(explained(scene, record, every))
        return 0
    started, compiled, status, outcome = time.perf_counter(), WANTED.compiled, 0, ""
    with warnings.catch_warnings(record=True) as notes:
        warnings.simplefilter("always")
        try:
            trajectory = scene.run(record, every, False if options.quiet or options.json else None)
        except (lm.errors.IntegrationFailure, lm.errors.IntegrationInterrupted) as stopped:
            trajectory = stopped.trajectory
            status, outcome = (
                (1, str(stopped)) if isinstance(stopped, lm.errors.IntegrationFailure) else (130, "interrupted")
            )
    compiled = WANTED.compiled - compiled
    spent = time.perf_counter() - started - compiled
    for text in [*(str(note.message) for note in notes), *([outcome] if outcome else [])]:
        print(f"liemech: {text}", file=sys.stderr)
    if not len(trajectory):
        return status
    files, missed = _files(scene, trajectory, options, outcome)
    refused += missed
    for text in refused:
        print(f"liemech: {text}", file=sys.stderr)
    if options.json:
        print(json.dumps(_data(options.scene, scene, trajectory, (spent, compiled), files), allow_nan=False))
    elif not options.quiet:
        print(_report(scene, trajectory, spent, compiled), *(f"Written: {file}" for file in files), sep="\n")
    return status or int(bool(refused))


def explained(scene: Setup, record: tuple[str, ...], every: int) -> str:
    """Lines that say what is computed and what is not, and why."""
    parts = [name for name, x in scene.start.parts.items() if x is not None]
    essential = [name for name, x in scene.system.essential_part(scene.start).parts.items() if x is not None]
    lines = [f"{scene.title}: {called(scene.system)}", f"  method        {scene.method!r}"]
    if scene.system.fictive or scene.method.fictive:
        end = f"{scene.steps} of them" if scene.t_end is None else f"to t = {scene.t_end:g}"
        lines.append(f"  steps         of h = {scene.h:g} in fictive time, {end}; one in {every} is kept")
    elif scene.t_end is not None and scene.h is not None and not chooses_steps(scene.method):
        lines.append(f"  steps         of h = {scene.h:g}, all alike, to t = {scene.t_end:g}; one in {every} is kept")
    elif scene.t_end is None:
        assert scene.steps is not None
        samples = scene.steps // every + 1 + bool(scene.steps % every)
        lines.append(f"  steps         {scene.steps} of h = {scene.h:g}; {samples} samples are kept")
    else:
        lines.append(f"  steps         adaptive, to t = {scene.t_end:g}; every one is kept, and the way between them")
    for name in parts:
        if name in essential:
            why = "computed, the motion depends on it"
        else:
            why = "computed, it is recorded or shown" if name in record else "not computed, nothing shows it"
        lines.append(f"  {name:<13} {why}")
    arrays = {name: np.asarray(x)[None] for name, x in scene.start.arrays.items()}
    whole: Any = scene.system
    system = whole.system if whole.fictive else whole  # whose constants a run in fictive time tells
    all_constants = list(system.constants(arrays))
    constants = list(system.constants({name: rows for name, rows in arrays.items() if name in record}))
    lines.append(f"  constants     {', '.join(constants) or 'none'}")
    missing = [name for name in all_constants if name not in constants]
    if missing:
        lines.append(f"  not told      {', '.join(missing)}: needs what is not computed")
    return "\n".join(lines)


def _scene(options: Any) -> Setup:
    """The scene that is named, or that of a file, with the changes of the options."""
    if options.scene in SCENES:
        scene = SCENES[options.scene]()
    elif options.scene.endswith(".toml"):
        scene = scene_file(Path(options.scene), options.trusted)
    else:
        raise lm.errors.InvalidInput(
            f"{options.scene!r} is neither a scene nor a .toml file{scene_meant(options.scene)}; "
            "`liemech scenes` lists them"
        )
    method = None if options.method is None else read(options.method, lm.Method, "argument --method")
    return scene.changed(h=options.h, steps=options.steps, method=method)


def _files(scene: Setup, done: lm.Trajectory, options: Any, said: str) -> tuple[list[str], list[str]]:
    """Write what was asked for: the files, and what went wrong."""
    files: list[str] = []
    refused: list[str] = []
    name = Path(options.scene).stem

    def view(path: Path) -> None:
        lm.viewer.Scene(done, scene.view, title=scene.title, note=said).save(path)

    def plot(path: Path) -> None:
        lm.plots.save(lm.plots.plot(done, title=scene.title).figure, path)  # type: ignore[arg-type]

    for option, write, ending in (
        (options.save, done.save, "npz"),
        (options.view, view, "html"),
        (options.plot, plot, "png"),
    ):
        if option is None:
            continue
        path = Path(f"{name}.{ending}") if option == HERE else option
        try:
            write(path)
            files.append(str(path))
        except (lm.errors.LiemechError, OSError) as wrong:
            refused.append(f"{path} is not written: {wrong}")
    return files, refused


def _report(scene: Setup, done: lm.Trajectory, spent: float, compiled: float) -> str:
    """Lines that say what was run, and how well the constants were kept."""
    how = "native code" if done.compiled else "plain Python"
    compile_time = f" and {duration(compiled)} to compile" if compiled > 0.0 else ""
    steps = f"{done.method!r}, {done.steps} steps to t = {done.t[-1]:g}, {how}, {duration(spent)}"
    lines = [f"{scene.title}: {called(scene.system)}", steps + compile_time]
    return "\n".join([*lines, str(done.drift()) if len(done) > 1 else "the start alone; no constants to compare"])


def _data(name: str, scene: Setup, done: lm.Trajectory, spent: tuple[float, float], files: list[str]) -> dict[str, Any]:
    """The report as data, for programs."""
    constants = done.drift().kept if len(done) > 1 else ()
    return {
        "scene": name,
        "title": scene.title,
        "system": repr(scene.system),
        "method": repr(done.method),
        "steps": done.steps,
        "h": float(done.h),
        "samples": len(done),
        "compiled": done.compiled,
        "seconds": spent[0],
        "seconds to compile": spent[1],
        "last": {"t": float(done.t[-1])} | {part: rows[-1].tolist() for part, rows in done.states.items()},
        "kept": [
            {"name": k.name, "verdict": k.verdict, "largest change": k.largest, "measure": k.measure} for k in constants
        ],
        "files": files,
    }


def _options(arguments: Sequence[str]) -> Any:
    names = textwrap.indent(textwrap.fill(", ".join(SCENES), 76, break_on_hyphens=False), "  ")
    parser = Parser(
        prog="liemech run",
        description="Follow a scene and tell how well its constants were kept.",
        epilog=f"scenes:\n{names}\n\n{EXAMPLES}",
    )
    add = parser.add_argument
    add("scene", metavar="SCENE", help="one of the scenes below, or a file, scene.toml")
    add("--h", type=number, metavar="H", help="length of a step")
    add("--steps", type=count, metavar="N", help="number of steps")
    add("--method", metavar="METHOD", help='another method, such as "RKMK(order=4)"; `liemech methods` lists them')
    add(
        "--save",
        nargs="?",
        const=HERE,
        type=output(".npz"),
        metavar="FILE",
        help="write the run to FILE, default SCENE.npz",
    )
    add(
        "--view",
        nargs="?",
        const=HERE,
        type=output(".html"),
        metavar="FILE",
        help="write a page for the browser, SCENE.html",
    )
    add("--plot", nargs="?", const=HERE, type=picture, metavar="FILE", help="draw a picture, SCENE.png (or .svg, .pdf)")
    add("--explain", action="store_true", help="tell what would be computed and what would not, and stop")
    add("--trusted", action="store_true", help="import the modules that a file names; this runs their code")
    add("--quiet", action="store_true", help="print nothing but errors")
    add("--json", action="store_true", help="print the result as JSON")
    return parser.parse_args(arguments)
