"""`liemech view FILE`: a saved run in the browser."""

from __future__ import annotations

import webbrowser
from collections.abc import Sequence
from pathlib import Path

import liemech as lm

from ..rooms.files.archive import meshes_outside
from .constructors import imported, modules_of_the_folder
from .options import Parser, output


def view(arguments: Sequence[str]) -> int:
    """The command.  Returns the exit status: 0."""
    parser = Parser(prog="liemech view", description="Show a run saved by `liemech run SCENE --save` in the browser.")
    add = parser.add_argument
    add("file", type=Path, metavar="FILE", help="a run, .npz, or a page, .html")
    add(
        "--show",
        nargs="+",
        metavar="NAME",
        help='what is shown, such as "body" or "momentum"; default: what suits the system',
    )
    add(
        "--modules",
        nargs="+",
        default=(),
        metavar="MODULE",
        help="where classes of yours are, which the run is made of",
    )
    add("--trusted", action="store_true", help="import whatever modules the file names; this runs their code")
    add("--out", type=output(".html"), metavar="PAGE", help="write the page there, and do not open it")
    options = parser.parse_args(arguments)
    if options.file.suffix == ".html":
        if not options.file.exists():
            raise lm.errors.InvalidInput(f"{options.file}: there is no such page")
        page = options.file
    else:
        for module in options.modules:
            imported(module, "argument --modules")
        if options.trusted:
            modules_of_the_folder()
        run = lm.Trajectory.load(options.file, options.modules, options.trusted)
        outside = [] if options.trusted else meshes_outside(run.system, options.file)
        if outside:
            raise lm.errors.InvalidInput(
                f"{options.file}: a page would hold files outside of its folder, {', '.join(outside)}; if you "
                "know them, --trusted shows them"
            )
        scene = lm.viewer.Scene(run, options.show, title=options.file.stem)
        page = scene.save(options.out or options.file.with_suffix(".html"))
    if options.out is None:
        webbrowser.open(page.resolve().as_uri())
    print(page)
    return 0
