"""What every test may rely on: fixed seeds, no window, no compiler where it is switched off; and
how workers share the tests.
"""

from __future__ import annotations

import gc
import importlib.util
import os
import signal
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from zlib import crc32

# bytecode is kept, so that processes of the tests need not translate all modules
if sys.dont_write_bytecode:
    sys.dont_write_bytecode = False
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)

# small matrices: threads that wait for each other on a busy machine
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import pytest

import liemech
from liemech.simulation.compiled import execution

# For this process and the programs that tests start anywhere: no window, and the liemech under
# test.
os.environ["MPLBACKEND"] = "Agg"
home = str(Path(liemech.__file__).parent.parent)
os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, [home, os.environ.get("PYTHONPATH")]))

# Tests interrupt themselves, which a shell switches off for what it runs in the background.
signal.signal(signal.SIGINT, signal.default_int_handler)

# Most runs of tests are short, and nobody repeats them: native code is made where plain Python
# would take seconds, or on demand.
execution.WAIT = 0.6


def can_compile() -> bool:
    """Whether native code may be made in this run: llvmlite is installed and nobody asked for plain Python."""
    switched_off = os.environ.get("LIEMECH_COMPILE") == "0" or os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
    return not switched_off and importlib.util.find_spec("llvmlite") is not None


@pytest.hookimpl(optionalhook=True, tryfirst=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With `-n` alone a worker gets whole files, those of most tests first: the kernels that the
    tests of a file share are made once.  Those beside this file go to one, which parses the library once.
    """
    if config.getvalue("dist") != "load":
        return None
    from xdist.scheduler import LoadFileScheduling

    class ByFiles(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file = super()._split_scope(nodeid)
            return file if "/" in file.removeprefix("tests/") else "tests"

    return ByFiles(config, log)


def pytest_collection_finish() -> None:
    """What thousands of tests keep for good is not searched for garbage again and again, and the
    numbers of plain Python's steps less often: an eighth of the time of all tests.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 50)


def pytest_sessionfinish() -> None:
    """Nor when all is over."""
    gc.freeze()


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--one-in", type=int, default=1, metavar="N", help="run one N-th of the selected tests only")
    parser.addoption(
        "--part", type=int, default=0, metavar="K", help="which of the N parts --one-in leaves, by K modulo N"
    )
    parser.addoption("--every-variant", action="store_true", help="tests that are not slow, in all their variants")
    parser.addoption(
        "--draw", type=int, default=0, metavar="N", help="other random numbers: every test holds for any of them"
    )


def sampled(variants: list[pytest.Function], count: int) -> list[pytest.Function]:
    """So many variants of a test, each with those values of its parameters that were taken least often before."""
    taken: Counter[str] = Counter()
    # neighbours apart
    rest = sorted(range(len(variants)), key=lambda i: 0.618034 * i % 1.0)
    have = [values(variant) for variant in variants]
    chosen: list[pytest.Function] = []
    while rest and len(chosen) < count:
        k = min(range(len(rest)), key=lambda k: sum(map(taken.__getitem__, have[rest[k]])))
        taken.update(have[rest[k]])
        chosen.append(variants[rest.pop(k)])
    return chosen


def values(item: pytest.Function) -> list[str]:
    """The values of the parameters of a test."""
    return [f"{name} = {value!r}" for name, value in item.callspec.params.items()]


VARIANTS = 1
"""So many variants of a test run by default, unless it is marked `sample(n)`; those of the house, beside this file, all."""


def leave_a_sample(items: list[pytest.Item], turn: int) -> None:
    """Some variants of each test run by default, other ones after every landing, and of two tests with the same groups,
    say, not the same ones; the rest are slow.
    """
    tests = defaultdict(list)
    for item in items:
        if isinstance(item, pytest.Function) and hasattr(item, "callspec") and not item.get_closest_marker("slow"):
            tests[item.parent, item.originalname].append(item)
    for (parent, name), variants in tests.items():
        mark = variants[0].get_closest_marker("sample")
        of_the_house = variants[0].path.parent == Path(__file__).parent
        count = mark.args[0] if mark else len(variants) if of_the_house else VARIANTS
        first = (turn + crc32(f"{parent.nodeid}::{name}".encode())) % len(variants)
        if len(variants) > count:
            chosen = {*map(id, sampled(variants[first:] + variants[:first], count))}
            for item in variants:
                if id(item) not in chosen:
                    item.add_marker(pytest.mark.slow)


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector: pytest.Collector) -> Iterator[None]:
    """Each worker begins with other folders, so that files which nobody has imported yet are translated by one of them
    and not by all.
    """
    report = yield
    worker = getattr(collector.config, "workerinput", None)
    if worker and collector.path == Path(__file__).parent and isinstance(collector, pytest.Directory):
        first = len(report.result) * int(worker["workerid"].removeprefix("gw")) // worker["workercount"]
        report.result = report.result[first:] + report.result[:first]
    return report


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> Iterator[None]:
    depth = len(Path(__file__).parts)
    items.sort(key=lambda item: item.path.parts[:depth])  # for all workers in one order
    if not config.getoption("every_variant"):
        turn = config.rootpath / ".ci" / "turn"
        leave_a_sample(items, int(turn.read_text()) if turn.exists() else 0)
    yield  # the tests are chosen by their marks
    every = max(1, config.getoption("one_in"))
    part = config.getoption("part") % every

    def in_part(item: pytest.Item) -> bool:  # a test is in one part only, whatever runs by default and beside it
        return crc32(item.nodeid.encode()) % every == part

    config.hook.pytest_deselected(items=[item for item in items if not in_part(item)])
    items[:] = filter(in_part, items)
    if can_compile():
        return
    plain = pytest.mark.skip(reason="needs the compiler, which is missing or switched off")
    for item in items:
        if item.get_closest_marker("compiled"):
            item.add_marker(plain)


def numbers_of(test: pytest.FixtureRequest) -> np.random.Generator:
    """Random numbers of a test, whichever tests ran before it."""
    return np.random.default_rng([crc32(test.node.nodeid.encode()), test.config.getoption("draw")])


@pytest.fixture
def rng(request: pytest.FixtureRequest) -> np.random.Generator:
    """The random numbers of a test."""
    return numbers_of(request)


@pytest.fixture(autouse=True)
def generator_of_the_file(request: pytest.FixtureRequest) -> None:
    """A test that draws from the generator `RNG` of its file finds it at the test's own numbers."""
    generator = getattr(getattr(request, "module", None), "RNG", None)
    if generator is not None:
        generator.bit_generator.state = numbers_of(request).bit_generator.state
