"""An example tells one story in under forty lines and ends with a number and a picture, which the gallery shows."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
GALLERY = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda example: example.stem)
def test_one_story_a_number_and_a_picture(example: Path) -> None:
    code = example.read_text(encoding="utf-8")
    assert len(code.splitlines()) < 40
    assert "print(" in code
    pictures = re.findall(r'"(\w+\.png)"', code)
    assert pictures
    for picture in pictures:
        assert (ROOT / "docs" / "figures" / picture).stat().st_size < 150_000
        assert f"(figures/{picture})" in GALLERY
    assert f"(../examples/{example.name})" in GALLERY
