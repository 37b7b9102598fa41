"""The tables of docs/options.md are true: an option is refused where its cell says "-", and nowhere
else; so are the combinations of the second table.
"""

from __future__ import annotations

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import liemech as lm

PAGE = (Path(__file__).parents[2] / "docs" / "options.md").read_text(encoding="utf-8")
PLANET = lm.Kepler()
ONE = PLANET.state(q=[0.6, 0.0], p=[0.0, 1.4])
TWO = PLANET.state(q=[[0.6, 0.0], [0.5, 0.1]], p=[[0.0, 1.4], [0.0, 1.3]])

CONTROLS: dict[str, tuple[Any, dict[str, Any]]] = {
    "fixed": (lm.StormerVerlet(), {"h": 0.05, "steps": 4}),
    "adaptive": (lm.RKMK(order=5), {"t_end": 0.2}),
    "fictive": (
        lm.ReversibleController(lm.StormerVerlet(), lm.time_scales.DistancePower(1.5)),
        {"h": 0.05, "t_end": 0.2},
    ),
}
VALUES: dict[str, Any] = {
    "h": 0.05,
    "steps": 400,
    "t_end": 0.2,
    "t0": 0.01,
    "rtol": 1e-8,
    "atol": 1e-8,
    "max_step": 0.1,
    "breaks": [0.1],
    "every": 2,
    "t_eval": [0.0, 0.1],
    "dense": True,
    "record": ["energy"],
    "events": lambda t, state: state.q[0],
    "compensated": True,
    "precision": "double-double",
    "compiled": False,
    "progress": False,
    "workers": 2,
    "checkpoint": "run.npz",
    "checkpoint_every": "10 steps",
}
"""A value of every option, but of `executor`."""

TOGETHER: tuple[tuple[Any, str, dict[str, Any]], ...] = (
    (ONE, "fixed", {"t_end": 0.2}),
    (ONE, "fictive", {"steps": 4, "t_end": None, "t_eval": [0.0]}),
    (ONE, "fixed", {"precision": "double-double", "compensated": True}),
    (TWO, "fixed", {"executor": ThreadPoolExecutor(1), "checkpoint": "run.npz"}),
    (ONE, "fixed", {"executor": ThreadPoolExecutor(1)}),
    (ONE, "adaptive", {"dense": True, "record": ["energy"]}),
)
"""For each row of the second table a run that is so."""


def rows(head: str) -> list[list[str]]:
    """The rows of the table under a head, cell by cell."""
    lines = PAGE.partition(f"| {head} |")[2].splitlines()[2:]
    found = []
    for line in lines:
        if not line.startswith("|"):
            break
        found.append([cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]])
    return found


def answer(start: Any, control: str, options: dict[str, Any]) -> str:
    """Why a run is refused; empty if it is not."""
    method, given = CONTROLS[control]
    try:
        lm.integrate(PLANET, method, start, **given | options)
    except (lm.errors.InvalidInput, lm.errors.IncompatibleSystem) as refusal:
        return str(refusal)
    return ""


def test_the_table_has_every_option_once() -> None:
    named = [name for row in rows("option") for name in re.findall(r"`(\w+)`", row[0])]
    assert sorted(named) == sorted([*VALUES, "executor"])
    assert all(len(row) == 5 for row in rows("option"))


@pytest.mark.parametrize("control", CONTROLS)
def test_an_option_is_refused_where_its_cell_says_so(
    control: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    column = 2 + list(CONTROLS).index(control)
    for row in rows("option"):
        for name in set(re.findall(r"`(\w+)`", row[0])) - {"executor", "steps", "t_end"}:
            more = {"checkpoint": "run.npz"} if name == "checkpoint_every" else {}
            said = answer(ONE, control, {name: VALUES[name]} | more)
            assert bool(said) == row[column].startswith("-"), f"{name}, {control}: {said or 'runs'}"
            assert not said or name in said


def test_combinations_of_the_second_table_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for row, (start, control, options) in zip(rows("combination"), TOGETHER, strict=True):
        assert answer(start, control, options), f"{row[0]} is not refused"


def test_fixed_steps_have_no_motion_between_them_to_leave_out() -> None:
    assert answer(ONE, "fixed", {"dense": False})
