"""Methods of which nothing is said, the orders that they offer, and what they are called."""

from __future__ import annotations

import dataclasses
import itertools
import re
from typing import Any

import numpy as np
import pytest
import shipped

import liemech as lm
from liemech import tableaus
from liemech.names import everything

pytestmark = pytest.mark.sample(99)  # all, a millisecond each

METHODS: dict[type, dict[str, Any]] = {
    lm.AdaptiveVerlet: {"order": 2},
    lm.Boris: {"order": 2},
    lm.class_functions.ClassFunction: {"reach": 1.0},
    lm.CommutatorFree: {"order": 4},
    lm.Composition: {"order": 4},
    lm.ConstrainedEuler: {"order": 1},
    lm.charts.DarbouxLieChart: {"steps": 4},
    lm.DiscreteLagrangian: {"order": 1},
    lm.FirstKindHamiltonJacobi: {"order": 2},
    lm.GalerkinVariational: {"order": 4},
    lm.HamiltonJacobi: {"order": 4},
    lm.ImplicitMidpoint: {"order": 2},
    lm.Isospectral: {"order": 4},
    lm.KickDrift: {"order": 2},
    lm.LagrangeDAlembert: {"order": 2},
    lm.LiePoissonHamiltonJacobi: {"order": 4},
    lm.LieRATTLE: {"order": 2},
    lm.LieVerlet: {"order": 2},
    lm.LobattoPair: {"order": 4},
    lm.Magnus: {"order": 4},
    lm.MoserVeselov: {"order": 2},
    lm.MultipleTimeSteps: {"order": 2, "ratios": (10,)},
    lm.PoissonEuler: {"order": 1},
    lm.PoissonHamiltonJacobi: {"order": 4},
    lm.PoissonVerlet: {"order": 2},
    lm.QuadratureLagrangian: {"order": 4, "nodes": 2},
    lm.RATTLE: {"order": 2, "shares": (0.5, 0.5)},
    lm.RKMK: {"order": 4},
    lm.SphericalMidpoint: {"order": 2},
    lm.SymmetricHamiltonJacobi: {"order": 4},
    lm.Splitting: {"order": 2},
    lm.SymplecticRKMK: {"order": 4},
    lm.Taylor: {"order": 12},
    lm.ThreeRotations: {"order": 2},
    lm.class_functions.TraceOfAd: {"reach": 0.5},
    lm.charts.Andoyer: {"degrees": 1},
    lm.time_scales.DistancePower: {"power": 1.5},
}
OFFERED: list[tuple[Any, list[int]]] = [
    (lm.CommutatorFree, [1, 2, 3, 4]),
    (lm.CrouchGrossman, [1, 2, 3, 4]),
    (lm.Isospectral, [2, 4, 6, 8, 10]),
    (lambda p: lm.KickDrift(order=p), [2, 4, 6, 8]),
    (lambda p: lm.Splitting(order=p), [1, 2, 3, 4, 6, 8]),
    (lm.GalerkinVariational, [2, 4, 6, 8]),
    (lm.SymplecticRKMK, [2, 4, 6, 8]),
    (lm.LiePoissonHamiltonJacobi, [2, 4, 6, 8]),
    (lm.LobattoPair, [2, 4, 6, 8]),
    (lm.FirstKindHamiltonJacobi, [1, 2, 3, 4]),
    (lm.HamiltonJacobi, [*range(1, 11)]),
    (lambda p: lm.HamiltonJacobi(p, kind="qQ"), [1, 2, 3, 4]),
    (lambda p: lm.HamiltonJacobi(p, kind="pP"), [1, 2, 3, 4]),
    (lm.SymmetricHamiltonJacobi, [2, 4, 6, 8, 10]),
    (lambda p: lm.SymmetricHamiltonJacobi(p, "qQ"), [2, 4]),
    (lm.Magnus, [2, 4, 6]),
    (lm.Taylor, [*range(2, 31)]),
    (lambda p: lm.QuadratureLagrangian(nodes=p), [2, 3, 4]),
]
NAMES = {
    lm.HamiltonJacobi(3): "Hamilton-Jacobi 3",
    lm.HamiltonJacobi(3, True): "Hamilton-Jacobi 3, adjoint",
    lm.HamiltonJacobi(3, kind="qQ"): "Hamilton-Jacobi 3 (q, Q)",
    lm.SymmetricHamiltonJacobi(4, "pP"): "Symmetric Hamilton-Jacobi 4 (p, P)",
    lm.ConstrainedEuler(): "Constrained Euler",
    lm.ConstrainedEuler("drift"): "Constrained Euler, drift first",
    lm.StormerVerlet(): "Stormer-Verlet",
    lm.StormerVerlet(first="drift"): "Stormer-Verlet, drift first",
    lm.MultipleTimeSteps((4, 10)): "Impulse 4:10",
    lm.MultipleTimeSteps((4,), mollified=True): "Mollified impulse 4",
    lm.RKMK(4): "RKMK4",
    lm.RKMK(tableau=tableaus.gauss(2)): "RKMK (Gauss 4)",
    lm.RKMK(tableau=tableaus.KUTTA38, retraction=lm.Cayley()): "RKMK (3/8 rule, Cayley)",
    lm.RKMK(4, truncation=5): "RKMK4 (ad^5)",
    lm.RKMK(4, truncation="closed"): "RKMK4 (closed)",
    lm.Taylor(): "Taylor12",
    lm.Taylor(8, lm.Exponential()): "Taylor8 (Exponential)",
    lm.CommutatorFree(): "CF4",
    lm.CommutatorFree(order=1): "Lie-Euler",
    lm.CrouchGrossman(order=3): "CG3",
    lm.Magnus(order=6): "Magnus6",
    lm.CovariantVariational(lm.Cayley()): "Algorithm 1 (Cayley)",
    lm.LiePoissonHamiltonJacobi(4, lm.Cayley()): "Hamilton-Jacobi 4 (Cayley)",
    lm.FirstKindHamiltonJacobi(3, lm.Cayley()): "Hamilton-Jacobi 3 of the first kind (InvariantForm, Cayley)",
    lm.GalerkinVariational(6, lm.Cayley()): "Galerkin 6 (Cayley)",
    lm.KickDrift(lm.ThreeRotations()): "Strang splitting (Three rotations)",
    lm.Composition(lm.CovariantVariational(lm.Cayley())): "Suzuki 4 of Algorithm 1 (Cayley)",
}


@pytest.mark.parametrize("method", METHODS, ids=lambda method: method.__name__)
def test_what_a_method_is_when_nothing_is_said(method: type) -> None:
    said = {f.name: f.default for f in dataclasses.fields(method)}
    assert {name: said.get(name, getattr(method, name, None)) for name in METHODS[method]} == (METHODS[method])


@pytest.mark.parametrize(("made", "wanted"), OFFERED)
def test_which_orders_a_method_offers(made: Any, wanted: list[int]) -> None:
    found = []
    for order in (*range(-1, 40), 2.0, True, "4", None):
        try:
            made(order)
        except (lm.errors.InvalidInput, lm.errors.InvalidType) as refusal:
            assert re.search("order|nodes", str(refusal))
            continue
        found.append(order)
    assert found == wanted
    assert [made(np.int64(order)) for order in wanted] == [made(order) for order in wanted]


@pytest.mark.parametrize("method", NAMES, ids=repr)
def test_what_a_method_is_called(method: lm.Method) -> None:
    assert method.name == NAMES[method]


@pytest.mark.parametrize("method", [*shipped.METHODS, *NAMES], ids=lambda method: method.name)
def test_a_method_says_how_it_is_made(method: lm.Method) -> None:
    """But for tableaus and functions, which are named."""
    said = repr(method)
    if "Tableau(" not in said and "sigma(" not in said:
        assert eval(said, everything()) == method


POOL: dict[str, list[Any]] = {
    "order": [1, 2, 3, 4, 6, 8],
    "retraction": [lm.Exponential(), lm.Cayley()],
    "tableau": [
        *tableaus.TABLEAUS.values(),
        *tableaus.SPLITTINGS.values(),
        *tableaus.COMPOSITIONS.values(),
        tableaus.CF3,
        tableaus.CF4,
        tableaus.CG3,
        tableaus.CG4,
    ],
    "truncation": ["closed", 2, 5],
    "first": ["u", "v", "kick", "drift"],
    "adjoint": [False, True],
    "kind": ["qP", "qQ", "pP"],
    "quadratic": [True, False],
    "project": [False, True],
    "mollified": [False, True],
    "ratios": [(2,), (3,), (2, 2)],
    "scale": [None, 0.5],
    "base": [lm.StormerVerlet(), lm.LieVerlet(), lm.PoissonVerlet()],
    "method": [lm.StormerVerlet(), lm.LieVerlet(), lm.RKMK(4), lm.RKMK(tableau=tableaus.gauss(2))],
    "free": [lm.ExactFreeBody(), lm.ThreeRotations()],
}
SHIPPED = sorted({x for x in everything().values() if isinstance(x, type)}, key=lambda kind: kind.__name__)


@pytest.mark.parametrize("kind", [k for k in SHIPPED if issubclass(k, lm.Method)], ids=lambda k: k.__name__)
@pytest.mark.filterwarnings("ignore::liemech.errors.OrderWarning")
def test_different_methods_have_different_names(kind: Any) -> None:
    """Two curves of one picture are told apart."""
    names: dict[str, Any] = {}
    fields = [f.name for f in dataclasses.fields(kind) if f.init and f.name in POOL]
    for chosen in itertools.chain.from_iterable(itertools.combinations(fields, k) for k in (0, 1, 2)):
        for values in itertools.product(*[POOL[name] for name in chosen]):
            try:
                method = kind(**dict(zip(chosen, values)))
            except (lm.errors.LiemechError, TypeError):
                continue
            assert names.setdefault(method.name, method) == method
