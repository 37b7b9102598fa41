"""The lists of groups, retractions, joints, models and methods from which tables of tests draw have all that the library has."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import pytest
import shipped

import liemech as lm
from liemech.names import everything
from liemech.systems.system import System

LISTS: dict[str, tuple[type, tuple[Any, ...]]] = {
    "GROUPS": (lm.LieGroup, (*shipped.GROUPS, *shipped.OF_SITES)),
    "RETRACTIONS": (lm.Retraction, shipped.RETRACTIONS),
    "METHODS": (lm.Method, shipped.METHODS),
    "JOINTS": (lm.joints.BallJoint.__base__, tuple(joint for joint, _ in shipped.JOINTS.values())),  # type: ignore[dict-item]
}


@pytest.mark.sample(len(LISTS))
@pytest.mark.parametrize("name", LISTS)
def test_every_public_class_is_in_its_list(name: str) -> None:
    base, members = LISTS[name]
    public = {x for x in everything().values() if inspect.isclass(x) and issubclass(x, base) and x is not base}
    require_all(public, members, name)


def test_every_ready_system_is_in_the_list_of_models() -> None:
    classes = [x for x in everything().values() if inspect.isclass(x) and issubclass(x, System)]
    ready = {x for x in classes if x.__module__.startswith(("liemech.models", "liemech.joints"))}
    require_all(ready, shipped.MODELS, "MODELS")


def require_all(classes: set[type], members: tuple[Any, ...], name: str) -> None:
    missing = {x for x in classes if not any(isinstance(member, x) for member in members)}
    assert not missing, f"{sorted(x.__name__ for x in missing)} in no list: add them to {name} in {shipped.__file__}"


@pytest.mark.parametrize(("name", "page"), [("GROUPS", "groups.md"), ("JOINTS", "joints.md")])
def test_every_public_class_is_on_its_page(name: str, page: str) -> None:
    base, _ = LISTS[name]
    public = {x.__name__ for x in everything().values() if inspect.isclass(x) and issubclass(x, base) and x is not base}
    file = Path(__file__).parent.parent / "docs" / page
    text = file.read_text(encoding="utf-8")
    missing = sorted(x for x in public if f"`{x}(" not in text and f"`{x}." not in text)
    assert not missing, f"{missing} on no line of {file}: add a row to its table"
