"""Runs give the bits that they gave: `net.py` says how they are recorded, and when to write them anew."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import net
import pytest


def runs() -> Iterator[Any]:
    """Every case in every world."""
    for case in net.cases():
        for world in case.worlds:
            marks = [pytest.mark.compiled] if world == "native" else []
            yield pytest.param(case, world, id=case.named(world), marks=marks)


@pytest.mark.sample(32)  # by default; `pytest tests/net --every-variant` has all, as the gate in its slices
@pytest.mark.parametrize(("case", "world"), [*runs()])
def test_a_run_gives_the_bits_that_it_gave(case: net.Case, world: str) -> None:
    """What was refused may be allowed; nothing else changes."""
    other = net.missing(case)
    if other:
        pytest.skip(f"{', '.join(other)} rounds otherwise here than where the hashes were written")
    changed = net.differences(net.known(case, world), case.found(world == "native"))
    assert not changed, "\n".join(changed)


def test_names_are_unique_and_all_written() -> None:
    names = [case.name for case in net.cases()]
    assert len(names) == len(set(names))
    assert not set(names) - net.stored()["cases"].keys()
