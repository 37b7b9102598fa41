"""The page of the command line and the gallery are true: every command runs, every example is shown."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from liemech.command_line.main import COMMANDS, main

ROOT = Path(__file__).parent.parent.parent
PAGE = (ROOT / "docs" / "command_line.md").read_text(encoding="utf-8")
GALLERY = (ROOT / "docs" / "gallery.md").read_text(encoding="utf-8")


@pytest.mark.slow
def test_every_command_of_the_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    pytest.importorskip("meshcat")
    monkeypatch.chdir(tmp_path)
    (file,) = re.findall(r"^```toml\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)
    (tmp_path / "book.toml").write_text(file)
    lines = "".join(re.findall(r"^```sh\n(.*?)^```", PAGE, flags=re.MULTILINE | re.DOTALL)).splitlines()
    for line in lines:
        program, *words = shlex.split(line)
        assert program == "liemech" and main(words) == 0, line
    assert {shlex.split(line)[1] for line in lines} == set(COMMANDS)
    written = {path.name for path in tmp_path.iterdir()}
    assert written == {"book.toml", "book.html", "flip.png", "flip.html", "top.npz", "top.html", "elastica.png"}
    assert "g             not computed" in capsys.readouterr().out


def test_the_gallery_shows_every_example_and_every_picture_is_small() -> None:
    examples = {path.stem for path in (ROOT / "examples").glob("*.py")}
    shown = set(re.findall(r"\(\.\./examples/(\w+)\.py\)", GALLERY))
    assert shown == examples, "draw the new ones, and write the gallery: python docs/figures/draw.py NAME"
    for picture in re.findall(r"\(figures/(\w+\.png)\)", GALLERY):
        assert (ROOT / "docs" / "figures" / picture).stat().st_size < 150_000
    assert (ROOT / "docs" / "figures" / "flip.gif").stat().st_size < 1_000_000
