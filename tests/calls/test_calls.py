"""Calls of public methods with whatever people pass, and batches beside their single calls:
`fuzz_calls` makes them up.
"""

from __future__ import annotations

import warnings
from typing import Any

import fuzz_calls
import fuzz_makers
import numpy as np
import pytest

import liemech as lm
from liemech.compiler import batch


@pytest.mark.slow
def test_calls_end_with_a_result_or_with_an_error_that_says_what_is_wrong() -> None:
    assert fuzz_calls.failures(500, seed=5) == []


@pytest.mark.parametrize("function, given", fuzz_makers.makers())
def test_what_makes_things_is_called_as_it_should_be(function: Any, given: dict[str, Any]) -> None:
    fuzz_makers.called(function, given)


@pytest.mark.parametrize("count, seed", [(600, 5), pytest.param(20_000, 6, marks=pytest.mark.slow)])
def test_things_are_made_or_refused_with_an_error_that_says_why(count: int, seed: int) -> None:
    assert fuzz_makers.failures(count, seed) == []


@pytest.mark.parametrize("what", fuzz_makers.overridables(), ids=lambda what: what.base.__name__)
def test_classes_of_users_are_made_and_run_as_pages_tell(what: Any) -> None:
    what.used(what.made(what.cls(what.right())(*what.given)))


@pytest.mark.parametrize("count, seed", [(200, 5), pytest.param(20_000, 6, marks=pytest.mark.slow)])
def test_wrong_signatures_and_results_are_refused_by_name(count: int, seed: int) -> None:
    """Nine in ten where the class or the system is made, the others by the run."""
    ends, bad = fuzz_makers.wrong_signatures(count, seed)
    assert bad == [] and ends["made"] > 0.9 * count


@pytest.mark.parametrize("factor", [1e160, 1e300, 1e308 + 1e308j])
def test_generators_whose_products_leave_the_range_of_floats_are_refused(factor: complex) -> None:
    generators = lm.SU(2).generators if isinstance(factor, complex) else lm.SO(3).generators
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(lm.errors.InvalidInput, match="products leave the range of floats"):
            assert lm.MatrixLieGroup.of(np.where(np.array(generators) != 0.0, factor, 0.0)).dim


@pytest.mark.slow
def test_many_calls_end_with_a_result_or_with_an_error_that_says_what_is_wrong() -> None:
    """A thousand here; all by `python tests/calls/fuzz_calls.py 20000 6`."""
    assert fuzz_calls.failures(1_000, seed=6) == []


@pytest.fixture
def at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Native code is made at once."""
    monkeypatch.setattr(batch, "WORTH", 0.0)
    monkeypatch.setattr(batch, "ROWS", 0)
    monkeypatch.setattr(batch, "NOISE", 0.0)


@pytest.mark.slow
@pytest.mark.compiled
@pytest.mark.parametrize("number", range(16))
def test_a_batch_is_its_single_calls(number: int, at_once: None) -> None:
    rng = np.random.default_rng(number)
    methods = fuzz_calls.of_arrays()
    assert fuzz_calls.batch_failure(methods[int(rng.integers(len(methods)))], rng) == ""


@pytest.mark.slow
@pytest.mark.compiled
def test_batches_of_many_methods_are_their_single_calls(at_once: None) -> None:
    rng = np.random.default_rng(0)
    """Every fiftieth here; compiling all takes a quarter of an hour."""
    assert [
        what for method in list(fuzz_calls.of_arrays())[::50] if (what := fuzz_calls.batch_failure(method, rng))
    ] == []
