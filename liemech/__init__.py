"""liemech: mechanics on Lie groups, with integrators that keep the geometry.

    import liemech as lm

    body = lm.RigidBody([1.0, 1.5, 2.0])
    start = body.state(mu=[0.5, 0.0, 0.75**0.5], g=np.eye(3))
    run = lm.integrate(body, lm.RKMK(order=4), start, h=0.1, steps=10_000)

Spaces are objects, their elements arrays.  A method steps a system, `integrate` owns the loop, a
`Trajectory` the samples.

The public names are listed in the stub beside this file, and in those of `models`, `joints`,
`charts` and others; docs/names.md says what each is.
"""

import sys
from typing import Any

from .formulas.calls import batches, one_row
from .names import lazily
from .names.finder import Finder


def _evaluate_rows(batch: batches.Batch) -> Any:
    """Methods called with many rows may be compiled: formulas do not know the compiler, the package
    does.
    """
    from .compiler.batch import evaluate_rows

    return evaluate_rows(batch)


def _prepare(row: one_row.OneRow, args: tuple[Any, ...], result: Any) -> None:
    """Make native code for a method that is called with one row again and again."""
    from .compiler.one_row import prepare

    prepare(row, args, result)


batches.evaluate_rows, one_row.prepare = _evaluate_rows, _prepare

__version__ = "0.1.0"

sys.meta_path[:] = Finder(), *(x for x in sys.meta_path if type(x).__module__ != Finder.__module__)

__getattr__, __dir__, __all__ = lazily(__name__)
