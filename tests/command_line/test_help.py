"""What the help of the commands shows is true: its examples run."""

from __future__ import annotations

import contextlib
import io
import re
import shlex
import sys
import warnings
import webbrowser
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from scenes import slow

import liemech as lm
from liemech.command_line import check, main_job
from liemech.command_line.main import COMMANDS, main

MINE = """
import liemech as lm
Heisenberg = lm.Heisenberg
system = lm.RigidBody([1.0, 1.5, 2.0])
start = system.state([0.5, 0.3, 0.8])
"""
"""The module of the examples of `check` and `bench`."""

SHORT = {"": ["--steps", "3"], "run": ["--steps", "3"], "bench": ["--steps", "20"]}
"""Options that make an example short; the last of two counts."""


def examples() -> Iterator[str]:
    """The lines of all helps that begin with a command, without what is said of them."""
    for command in ("", *COMMANDS):
        with contextlib.redirect_stdout(io.StringIO()) as printed, contextlib.suppress(SystemExit):
            main([command, "--help"] if command else ["--help"])
        for line in printed.getvalue().splitlines():
            if line.startswith(("  liemech ", "  python -m liemech")):
                yield re.split(r"  +", line.strip())[0]


LONG = ("bench", "check 'RKMK", "--methods", "reproduce")
"""What the examples have that take longer than a second; a short result is reproduced in tests/published."""


@pytest.mark.sample(5)
@pytest.mark.parametrize("line", [slow(x) if any(word in x for word in LONG) else x for x in examples()])
def test_every_example_of_a_help_runs(
    line: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("meshcat")
    Path("my_module.py").write_text(MINE, encoding="utf-8")
    monkeypatch.setattr(webbrowser, "open", lambda _: True)
    monkeypatch.setattr(main_job, "TIMED", 10)
    try:
        for part in line.split(" && "):
            words = shlex.split(part)
            words = words[1:] if words[0] == "liemech" else words[3:]
            assert main([*words, *SHORT.get(words[0] if words and words[0] in COMMANDS else "", [])]) == 0, part
    finally:
        sys.modules.pop("my_module", None)


def test_all_helps_have_examples() -> None:
    assert len([*examples()]) > 12


def test_a_warning_is_a_line_of_the_command(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Not a place in a program that its reader has not written."""

    def warned(thing: Any) -> list[Any]:
        warnings.warn("the moments are those of no body", lm.errors.InertiaWarning, stacklevel=2)
        return []

    monkeypatch.setattr(check, "_reports", warned)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        assert main(["check", "SO3"]) == 0
    assert capsys.readouterr().err == "liemech: the moments are those of no body\n"
