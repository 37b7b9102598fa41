"""Options of all commands: how they complain, and how numbers are read; numbers as people read them."""

from __future__ import annotations

import argparse
import math
import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

MOST_STEPS = 10**12  # more would take days, however fast they are


class Parser(argparse.ArgumentParser):
    """Bad options get one line and exit status 2; -1/2 and -1e-3 are numbers; texts are printed as they are written."""

    def __init__(self, **options: object) -> None:
        super().__init__(formatter_class=argparse.RawDescriptionHelpFormatter, **options)  # type: ignore[arg-type]
        # or -1/2 and -1e-3 would be taken for options
        self._negative_number_matcher = re.compile(r"-[.\d]")

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"{self.prog}: {message} (--help explains)\n")


def number(text: str) -> float:
    """A finite number, also written as a fraction."""
    above, _, below = text.partition("/")
    value: float | None
    try:
        value = float(above) / float(below or 1)
    except (ValueError, ZeroDivisionError):
        value = None
    if value is None or not math.isfinite(value):
        raise argparse.ArgumentTypeError(f"{text!r} is not a finite number, such as 0.5 or 2/3")
    return value


def count(text: str) -> int:
    """A whole number from 1 on; 1e6 is one."""
    value = number(text)
    if value != int(value) or not 1 <= value <= MOST_STEPS:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 1 to {MOST_STEPS:.0e}")
    return int(value)


def picture(text: str, name: str = "rigid_body.png") -> Path:
    """The picture to write, in a folder that exists then."""
    path = Path(text)
    if not path.suffix or path.is_dir():
        path = path / name
    if path.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise argparse.ArgumentTypeError(f"{text!r} is neither a folder nor a .png, .svg or .pdf file")
    return writable(path)


def writable(path: Path) -> Path:
    """The file, in a folder that is made if need be; both may be written."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as refused:
        raise argparse.ArgumentTypeError(f"cannot write there: {refused}") from None
    if path.is_dir() or not os.access(path if path.exists() else path.parent, os.W_OK):
        reason = "it is a folder" if path.is_dir() else "permission denied"
        raise argparse.ArgumentTypeError(f"cannot write to {str(path)!r}: {reason}")
    return path


def output(ending: str) -> Callable[[str], Path]:
    """A file with this ending, in a folder that exists then."""

    def path(text: str) -> Path:
        if Path(text).suffix.lower() != ending:
            raise argparse.ArgumentTypeError(f"{text!r} does not end with {ending}")
        return writable(Path(text))

    return path


def short(x: float) -> str:
    """Two digits, in few characters."""
    if x == 0.0 or 0.1 <= abs(x) < 1000.0:
        return f"{x:.2g}" if abs(x) < 100.0 else f"{x:.0f}"
    digits, exponent = f"{x:.1e}".split("e")
    return f"{digits}e{int(exponent)}"


def called(thing: Any) -> str:
    """The name of a system in a line: as it is written, or by its class alone where that is long."""
    text = repr(thing)
    return text if len(text) <= 110 else f"{text.partition('(')[0]}(...)"


def duration(seconds: float) -> str:
    """Three digits, with the unit that leaves least to write."""
    rounded = float(f"{seconds:.3g}")
    unit, size = next(((u, s) for u, s in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)) if rounded >= s), ("ns", 1e-9))
    return f"{rounded / size:.6g} {unit}"
