"""What is read in odd ways is what is there now, or refused: plain against native, after a change, and
after a restart, from the code on disk.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest
from compiler import odd_reads

GROUPS = 16

pytestmark = [pytest.mark.compiled, pytest.mark.filterwarnings("ignore")]


@pytest.mark.parametrize("group", range(GROUPS))
def test_odd_reads(group: int, tmp_path: Path) -> None:
    numbers = [*range(group, len(odd_reads.PROGRAMS), GROUPS)]
    wrong = odd_reads.mistakes(numbers, tmp_path, False)
    assert not wrong, "\n".join(wrong)
    command = [sys.executable, "-m", "compiler.odd_reads", str(tmp_path), str(group), str(GROUPS)]
    paths = [str(Path(odd_reads.__file__).parents[1]), *sys.path]
    done = subprocess.run(
        command, env=os.environ | {"PYTHONPATH": os.pathsep.join(paths)}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert not done.stdout, done.stdout
