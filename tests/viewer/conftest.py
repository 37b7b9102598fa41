"""One browser for all tests, or a reason to skip: LIEMECH_BROWSER=required forbids to skip."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterator

import pytest

from liemech.viewer.chromium import Chromium, find

REQUIRED = os.environ.get("LIEMECH_BROWSER") == "required"


def lacking() -> str | None:
    """Why pages cannot be tried here."""
    if importlib.util.find_spec("meshcat") is None:
        return "needs meshcat's page (the extra viewer)"
    return None if find() else "needs Chromium on the search path"


@pytest.fixture(scope="session")
def browser() -> Iterator[Chromium]:
    """A browser with windows of 640 x 480."""
    reason = lacking()
    if reason and not REQUIRED:
        pytest.skip(reason)
    with Chromium((640, 480)) as one:
        yield one
