"""`liemech check module:Class`: does a class obey its laws?"""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np

import liemech as lm

from .constructors import read
from .options import Parser

GROUPS = (lm.SO3(), lm.SE3())
"""Where a retraction is checked."""

BELOW = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, -0.5], [0.0, 0.0, 0.0, 1.0]]).ravel()
"""The pose of a body that hangs half a metre below its fixed point."""


def check(arguments: Sequence[str]) -> int:
    """The command.  Returns the exit status: 0, 1 if a law is broken."""
    parser = Parser(
        prog="liemech check",
        description="Check the laws of a group, a retraction, a Poisson structure or a system, or the claims of a method; "
        "print a table.",
        epilog="examples:\n  liemech check my_module:Heisenberg\n"
        "  liemech check 'RigidBody([1.0, 2.0, 2.5])'\n  liemech check 'RKMK(order=5)'",
    )
    parser.add_argument(
        "what", metavar="module:Class", help="a class of yours, with or without arguments, or one of the library"
    )
    parser.add_argument("--json", action="store_true", help="print the verdicts as JSON")
    options = parser.parse_args(arguments)
    reports = _reports(read(options.what, lm.Record, "argument module:Class"))
    if options.json:
        print(json.dumps([{"subject": r.subject, "laws": {f.law: f.verdict for f in r.findings}} for r in reports]))
    else:
        print(*reports, sep="\n\n")
    return int(any(report.broken for report in reports))


def _reports(thing: Any) -> list[Any]:
    """The reports of the checks that fit an object."""
    if isinstance(thing, lm.LieGroup):
        return [lm.check_group(thing, raises=False)]
    if isinstance(thing, lm.Retraction):
        return [lm.check_retraction(thing, group, raises=False) for group in GROUPS]
    if isinstance(thing, lm.PoissonStructure):
        return [lm.check_poisson(thing, raises=False)]
    if isinstance(thing, lm.System):
        return [lm.check_system(thing, raises=False)]
    if isinstance(thing, lm.Method):
        for system, start in _problems():
            try:
                thing.require(system)
            except lm.errors.IncompatibleSystem:
                continue
            return [lm.check_method(thing, system, start, raises=False)]
        raise lm.errors.InvalidInput(
            f"{thing!r} accepts none of the systems tried here, which are a free body, a top, a "
            "planet, a pendulum on a sphere, hares and foxes, and a body at a fixed point; call "
            "lm.check_method(method, system, start) with a system of yours"
        )
    raise lm.errors.InvalidInput(
        f"{thing!r} is neither a group, a retraction, a system, a Poisson structure nor a method"
    )


def _problems() -> list[tuple[Any, Any]]:
    """Systems on which a method can be checked: a free body, a top, a planet, and ones for methods
    that take nothing else.
    """
    library: Any = lm  # type checkers take fields that a model derives for arguments
    body, planet = library.RigidBody([1.0, 1.5, 2.0]), library.Kepler()
    ball, species = library.SphericalPendulum(), library.models.LotkaVolterra()
    hung = library.joints.Linkage(
        [lm.joints.Link(3.0, [0.1, 0.2, 0.2])], [lm.joints.BallJoint(0, None, [0.0, 0.0, 0.5])], 9.81
    )
    top = library.models.HeavyTop([1.0, 1.5, 0.7], 1.3, [0.6, 0.0, 0.8])
    return [
        (body, body.state([0.5, 0.3, 0.8], np.eye(3))),
        (body, body.state([0.5, 0.3, 0.8])),
        (top, top.state([0.3, 0.6, 1.1], np.eye(3))),
        (planet, planet.pericentre(0.3)),
        (ball, ball.consistent([0.8, 0.0, -0.6], [0.0, 1.2, 0.0])),
        (species, species.state([1.5, 1.0])),
        (hung, hung.consistent([0.1, 0.2, 0.3, 0.0, 0.0, 0.0], BELOW)),
    ]
