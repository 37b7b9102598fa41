"""How a command refuses."""

from __future__ import annotations

import pytest

from liemech.command_line.main import main


def refused(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    """What a command complains of, in one line and with status 2."""
    with pytest.raises(SystemExit) as exit:
        main(words)
    printed, complained = capsys.readouterr()
    assert exit.value.code == 2 and printed == "" and complained.count("\n") == 1, complained
    return complained
