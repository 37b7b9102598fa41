"""Words of memory tell when functions and classes change, and nothing else hides it."""

import types

import pytest

import liemech as lm
from liemech.compiler.changes import words
from liemech.compiler.changes.staleness import LOOKS, Guard

pytest.importorskip("llvmlite")


def one(x=1, *, y=2):
    return x + y


def other(x=1, *, y=2):
    return x - y


class Base:
    factor = 2.0


class Derived(Base):
    pass


def looking(*reads):
    """Words of these reads: holder, how, name."""
    found = [words.words_of(*read) for read in reads]
    if [] in found:
        pytest.skip("this interpreter shows no such words")
    return words.Words([word for own in found for word in own])


@pytest.mark.parametrize(
    "name, value", [("__code__", other.__code__), ("__defaults__", (5,)), ("__kwdefaults__", {"y": 7})]
)
def test_a_function_that_gets_another_part_shows_it(name, value):
    function = types.FunctionType(one.__code__, globals(), argdefs=(1,))
    function.__kwdefaults__ = {"y": 2}
    before = getattr(function, name)
    seen = looking((function, "attribute", name, before))
    assert seen.same()
    setattr(function, name, value)
    assert not seen.same()
    setattr(function, name, before)
    assert seen.same()


@pytest.mark.parametrize("where", [Base, Derived])
@pytest.mark.parametrize("again", [False, True])
def test_a_class_shows_what_is_set_in_it_or_in_a_base(where, again):
    base = type("Base", (), dict(factor=2.0))
    derived = type("Derived", (base,), {})
    seen = looking((derived, "member 0", "factor", 2.0))
    assert seen.same()
    changed = base if where is Base else derived
    changed.factor = 3.0
    if again:  # a version that comes back would hide it
        changed.factor = 2.0
        assert derived.factor == 2.0
    assert not seen.same()


def test_a_class_with_another_base_shows_it():
    first, second = type("First", (), dict(f=1)), type("Second", (), dict(f=2))
    derived = type("Derived", (first,), {})
    seen = looking((derived, "member 0", "f", 1))
    derived.__bases__ = (second,)
    assert not seen.same()


def test_names_that_a_class_of_classes_keeps_are_compared_by_python():
    assert words.words_of(Base, "attribute", "__name__", "Base") == []
    assert words.words_of(Base, "attribute", "__dict__", None) == []


@pytest.mark.parametrize("name", ["factor", "len"])
def test_a_module_shows_names_that_are_set_in_it_or_hide_those_of_python(name):
    space = {"factor": 2.0, "__builtins__": __builtins__}
    function = types.FunctionType(one.__code__, space)
    seen = looking((function, "global", name, space.get(name, len)))
    assert seen.same()
    space[name] = 3.0
    assert not seen.same()


def test_a_class_that_counts_is_given_up_and_its_formulas_still_watched():
    class Counting(Base):
        asked = 0

    steps = [(-1, "argument", 0), (0, "class", ""), (1, "member 0", "factor")]
    body = Counting()
    guard = Guard(steps, [body, Counting, 2.0], ["", "", "a token"], {})
    for _ in range(3 * LOOKS):
        Counting.asked += 1
        assert guard.verdict((body,)) is True
    assert guard.glance[0].same()  # they are given up
    Counting.factor = 3.0
    assert guard.verdict((body,)) is False


def test_a_formula_that_changes_between_two_runs_changes_the_second():
    @lm.record
    class Field(lm.Hamiltonian):
        inertia: lm.Vec

        def energy(self, mu):
            return 0.5 * lm.dot(mu, mu / self.inertia)

    body = lm.LiePoissonSystem(lm.SO3(), Field([1.0, 2.0, 3.0]))
    plan = lm.Plan(body, lm.RKMK(4), 0.1, compiled=True)
    start = body.state(mu=[1.0, 2.0, 3.0])
    runs = [plan.run(start, steps=4).mu for _ in range(3)]
    assert (runs[0] == runs[2]).all()
    Field.energy = lambda self, mu: 0.25 * lm.dot(mu, mu / self.inertia)
    slower = plan.run(start, steps=4).mu
    plain = lm.Plan(body, lm.RKMK(4), 0.1, compiled=False).run(start, steps=4).mu
    assert (slower == plain).all()
    assert abs(slower - runs[0]).max() > 0.1
