"""Which command: the main job if none is named."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from importlib import import_module

COMMANDS = {
    "run": "run",
    "scenes": "lists",
    "methods": "lists",
    "check": "check",
    "bench": "bench",
    "view": "view",
}
"""The commands, and the file of each, which is loaded when it is wanted."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command.

    Returns the exit status: 0; 1 if a run, a picture or a check failed; 130 after Ctrl-C.  Bad options exit with 2.
    """
    words = list(sys.argv[1:] if arguments is None else arguments)
    if not words or words[0].startswith("-"):
        from .main_job import main_job

        return main_job(words)
    name, *options = words
    if name not in COMMANDS:
        print(f"liemech: {name!r} is no command; there are {', '.join(COMMANDS)} (--help explains)", file=sys.stderr)
        raise SystemExit(2)
    command: Callable[[Sequence[str]], int] = getattr(import_module(f".{COMMANDS[name]}", __package__), name)
    try:
        return command(options)
    except KeyboardInterrupt:
        print("liemech: interrupted", file=sys.stderr)
        return 130
    except BrokenPipeError:  # whoever reads what is printed has had enough
        sys.stderr.close()
        return 1
