"""The lists of scenes and methods can be read: columns are apart, and sentences are whole."""

from __future__ import annotations

import pytest

from liemech.command_line.main import main
from liemech.command_line.scenes import SCENES


def test_columns_are_apart_and_sentences_are_whole(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    assert main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.partition("  ")[0] for line in lines if not line.startswith(" ")] == list(SCENES)
    assert main(["methods"]) == 0
    lines += capsys.readouterr().out.splitlines()
    assert not [line for line in lines if "..." in line and "order=..." not in line]
