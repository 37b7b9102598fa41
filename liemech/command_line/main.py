"""Which command: the main job if none is named."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import Any

from ..errors import LiemechError
from ..names import meant
from .options import Parser

COMMANDS = {
    "run": "run", "scenes": "lists", "methods": "lists", "check": "check", "bench": "bench", "view": "view",
    "reproduce": "reproduce",
}  # fmt: skip
"""The commands, and the file of each, which is loaded when it is wanted."""

MAIN = "main_job"
"""The command if none is named, and its file."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Returns the exit status: 0; 1 if a run, a picture or a check failed; 130 after Ctrl-C.  Bad
    options exit with 2.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0].startswith("-"):
        words = [MAIN, *words]
    elif words[0] not in COMMANDS:
        from .scenes import scene_meant

        near = meant(words[0], COMMANDS) or scene_meant(words[0], "run ")
        Parser(prog="liemech").error(f"{words[0]!r} is no command{near}; there are {', '.join(COMMANDS)}")
    name, *options = words
    command: Callable[[Sequence[str]], int] = getattr(import_module(f".{COMMANDS.get(name, MAIN)}", __package__), name)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = _print_warning
            return command(options)
    except KeyboardInterrupt:
        print("liemech: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever reads what is printed has had enough
        sys.stderr.close()
        return 1
    except (LiemechError, OSError) as wrong:
        Parser(prog="python -m liemech" if name == MAIN else f"liemech {name}").error(str(wrong))


def _print_warning(message: Warning | str, *_: Any, **__: Any) -> None:
    """Print a warning without the line of the program, which its reader has not written."""
    print(f"liemech: {message}", file=sys.stderr)
