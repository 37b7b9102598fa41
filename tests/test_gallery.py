"""An example tells one story in under forty lines, and ends with a number and a picture."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

EXAMPLES = sorted((Path(__file__).parent.parent / "examples").glob("*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.stem)
def test_one_story_a_number_and_a_picture(example: Path) -> None:
    code = example.read_text(encoding="utf-8")
    assert len(code.splitlines()) < 40
    assert "print(" in code
    assert re.search(r'"\w+\.png"', code)
