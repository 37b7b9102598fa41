"""`run.cite()`: the sources of a run are those that its classes name."""

from __future__ import annotations

import numpy as np
import pytest

import liemech as lm


@lm.record
class OwnTop(lm.models.HeavyTop):
    """A top of a paper.

    Source: Somebody, A paper of their own (2026), equation (7).
    """


def test_a_run_cites_method_system_and_parts() -> None:
    top = OwnTop([1.0, 1.6, 2.3], 0.8, [0.1, 0.2, 1.0])
    run = lm.integrate(top, lm.LieVerlet(), top.state(mu=[0.0, 0.0, 1.0], g=np.eye(3)), h=0.1, steps=2)
    sources = run.cite()
    assert sources["OwnTop"] == "Somebody, A paper of their own (2026), equation (7)."
    assert {"LieVerlet", "RigidBody", "FixedPointGravity", "SO3"} <= sources.named.keys()
    assert str(sources).startswith("liemech") and "Bou-Rabee and Marsden" in str(sources)
    assert sources.bibtex.count("@misc{") == len(sources.named) + 1
    assert sources.bibtex.count("{") == sources.bibtex.count("}")
    with pytest.raises(lm.errors.InvalidInput, match="'RKMK' names none; known are: LieVerlet"):
        sources["RKMK"]


def test_ensembles_and_composed_methods_cite_what_they_are_made_of() -> None:
    bodies = [lm.RigidBody([1.0, 1.5, 2.0]), lm.RigidBody([1.0, 1.6, 2.0])]
    start = bodies[0].state(mu=np.ones((2, 3)))
    named = lm.integrate(bodies, lm.Composition(lm.CovariantVariational(), order=4), start, h=0.1, steps=2).cite().named
    assert {"RigidBody", "CovariantVariational"} <= named.keys() and len(set(named.values())) == len(named)


@lm.record
class Signs(lm.models.HeavyTop):
    """A top. Source: Euler & Sons, A_1 to 100 % (1758)."""


def test_signs_of_latex_are_texts_in_bibtex() -> None:
    top = Signs([1.0, 1.6, 2.3], 0.8, [0.1, 0.2, 1.0])
    run = lm.integrate(top, lm.LieVerlet(), top.state(mu=[0.0, 0.0, 1.0], g=np.eye(3)), h=0.1, steps=2)
    assert r"note = {Euler \& Sons, A\_1 to 100 \% (1758).}" in run.cite().bibtex
