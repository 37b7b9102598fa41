"""What a public function of a group costs on one element, in microseconds of processor time:

    python tests/benchmarks/one_element.py [--quick]

The way of many rows, on which one element went before; the short way in plain Python, which the first
calls go; and native code, on which they go after a third of a second of calls, or when it is on disk.
Beside them SciPy's Rotation, where it has the function.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from harness import cost
from scipy.spatial.transform import Rotation

import liemech as lm
from liemech.formulas.calls import broadcasting, one_row

GROUPS = (lm.SO3(), lm.SE3(), lm.SU(2), lm.UnitQuaternions(), lm.SE2(), lm.SE23(), lm.SGal3(), lm.SO(4))


def functions(group: Any) -> Iterator[tuple[str, Callable[..., Any], tuple[Any, ...]]]:
    rng = np.random.default_rng(1)
    g, h = group.random(rng, 2)
    xi, mu = 0.3 * rng.normal(size=(2, group.dim))
    x, algebra = group.algebra.hat(xi), group.algebra
    of_group = {
        "compose": (g, h), "inverse": (g,), "exp": (xi,), "log": (g,), "Ad": (g, xi),
        "Ad_star": (g, mu), "Ad_matrix": (g,), "K": (g, mu), "ad": (xi, mu), "ad_star": (xi, mu),
        "compose_exp": (g, xi), "dexp": (xi, mu), "dexp_inv": (xi, mu), "exp_Ad_star": (xi, mu),
        "cayley": (xi,), "cayley_inv": (g,), "body_velocity": (g, g @ x if g.shape == x.shape else g),
        "casimirs": (mu,), "distance": (g, h), "contains": (g,), "defect": (g,), "scale": (g,),
    }  # fmt: skip
    for name, args in of_group.items():
        yield name, getattr(group, name), args
    for name, args in {"hat": (xi,), "vee": (x,), "bracket": (xi, mu)}.items():
        yield f"algebra.{name}", getattr(algebra, name), args
    if isinstance(group, lm.SO3):
        yield "action on a point", lm.actions.LinearAction(group).act, (g, xi)


SCIPY = {
    "exp": lambda xi: Rotation.from_rotvec(xi),
    "log": lambda g: Rotation.from_matrix(g).as_rotvec(),
    "compose": lambda a, b: a * b,
    "inverse": lambda a: a.inv(),
    "action on a point": lambda a, x: a.apply(x),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true")
    rounds, calls = (2, 50) if parser.parse_args().quick else (7, 400)
    short = broadcasting.one_row
    print(f"{'group':18} {'function':18} {'before':>8} {'plain':>8} {'native':>8}   us a call")
    for group in GROUPS[: 2 if rounds == 2 else None]:
        for name, function, args in functions(group):
            try:
                function(*args)
            except (lm.errors.LiemechError, AttributeError):
                continue
            broadcasting.one_row = lambda *_: None
            before = cost(partial(function, *args), rounds, calls)
            broadcasting.one_row = short
            one_row.SOON, prepare, one_row.prepare = np.inf, one_row.prepare, None
            plain = cost(partial(function, *args), rounds, calls)
            one_row.prepare = prepare
            for row in getattr(function.__self__, "_single_rows", {}).values():
                if row is not None:
                    row.spent, row.next = 1.0, 0.0
            native = cost(partial(function, *args), rounds, calls)
            line = f"{group!r:18} {name:18} {before:8.1f} {plain:8.1f} {native:8.1f}"
            if isinstance(group, lm.SO3) and name in SCIPY:
                given = [Rotation.from_matrix(a) if np.ndim(a) == 2 and name != "log" else a for a in args]
                line += f"   SciPy {cost(partial(SCIPY[name], *given), rounds, calls):.1f}"
            print(line, flush=True)


if __name__ == "__main__":
    main()
