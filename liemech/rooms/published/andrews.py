"""Andrews' squeezing mechanism after 0.03 s: seven angles to the digits of the test set."""

from __future__ import annotations

from collections.abc import Iterator

from ...models.swinging.andrews import AndrewsMechanism
from ...simulation.integrate import integrate
from ..constraints.lobatto_pair import LobattoPair
from .compared import Compared

SOURCE = (
    "Mazzia and Magherini, Test Set for Initial Value Problem Solvers (2008), II-10; "
    "IFToMM library of computational benchmark problems, A03"
)
ANGLES = {
    "beta": 15.81077119629904,
    "Theta": -15.75637105984298,
    "gamma": 0.04082224013073101,
    "Phi": -0.5347301163226948,
    "delta": 0.5244099658805304,
    "Omega": 0.5347301163226948,
    "epsilon": 1.048080741042263,
}


def compared(full: bool) -> Iterator[Compared]:
    """The seven angles.  Ours stand still to 1e-12 when steps become shorter, so that the last six digits of the source
    are not its own: it is held to 2e-9.
    """
    mechanism = AndrewsMechanism()
    run = integrate(mechanism, LobattoPair(order=6), mechanism.from_rest(), h=3e-5, steps=1000, progress=False)
    for (name, published), computed in zip(ANGLES.items(), run.q[-1]):
        yield Compared(f"{name}, rad", published, float(computed), 2e-9)
