"""Multiple time steps of linkages: slow potentials of bodies outside, springs at joints inside."""

import numpy as np
import pytest
from orders import slope

import liemech as lm
from liemech.errors import IncompatibleSystem
from liemech.joints import Damper, Linkage, Spring, chain

TURN = [0.0, 1.0, 0.0]


@lm.record
class Tether(lm.Potential):
    """A soft spring from a body to a point."""

    k: float

    def energy(self, g):
        """k |p - a|^2/2."""
        x, y, z = g[0, 3] - 1.0, g[1, 3], g[2, 3] + 0.5
        return 0.5 * self.k * (x * x + y * y + z * z)


@lm.record
class Together(lm.Potential):
    """A soft spring between the first body and the last one of three."""

    k: float

    def energy(self, g):
        """k |p_2 - p_0|^2/2."""
        return 0.5 * self.k * sum((g[32 + j] - g[j]) * (g[32 + j] - g[j]) for j in (3, 7, 11))


def stiff(potential, n=3, forces=()):
    """Hinges with stiff springs, bent and moving."""
    rods = chain(n, axis=TURN)
    springs = [Spring(k, 200.0) for k in range(n)]
    made = Linkage(rods.links, rods.joints, forces=[*springs, *forces], potential=potential)
    return made, made.state(angles={0: 0.5, 1: 0.1}, rates={2: 0.5})


def ended(made, method, h, steps, compiled=False):
    return lm.integrate(made[0], method, made[1], h=h, steps=steps, compiled=compiled)


@pytest.mark.slow
@pytest.mark.parametrize("potential", [{0: Tether(1.0), 2: Tether(0.5)}, Together(1.0)])
def test_one_fast_step_is_lie_rattle(potential):
    """Impulses at the end of a kick and those at the end of a step are the same ones, found in two parts."""
    made = stiff(potential)
    one, other = (ended(made, method, 0.02, 5) for method in (lm.MultipleTimeSteps((1,)), lm.LieRATTLE()))
    assert np.abs(one.mu - other.mu).max() < 1e-12 and np.abs(one.g - other.g).max() < 1e-13


@pytest.mark.slow
def test_order_under_a_damper():
    damped = stiff({b: Tether(1.0) for b in range(4)}, n=4, forces=[Damper(1, 5.0)])
    wanted = ended(damped, lm.RKMK(order=8), 1e-3, 800, None).g[-1]
    counts = (50, 100, 200)
    errors = [np.abs(ended(damped, lm.MultipleTimeSteps((4,)), 0.8 / n, n, True).g[-1] - wanted).max() for n in counts]
    assert slope(counts, errors) == pytest.approx(-2.0, abs=0.1)


def test_what_is_refused():
    rods = chain(3, axis=TURN)
    start = rods.state(angles={0: 0.5})
    for made, method, words in (
        (rods, lm.MultipleTimeSteps((4,)), "potential"),
        (stiff(Together(1.0))[0], lm.MultipleTimeSteps((4, 2)), "one ratio"),
    ):
        with pytest.raises(IncompatibleSystem, match=words):
            lm.integrate(made, method, start, h=0.01, steps=2)
