"""What is no rod, no section, no place for a pin, and shapes that are given."""

import numpy as np
import pytest

import liemech as lm
from liemech.errors import InvalidInput, InvalidType, NoConvergence
from liemech.models import CosseratRod, RodSection

SECTION = RodSection.round(0.02, young=1e6, density=1000.0)
ROD = CosseratRod(SECTION, 1.0, 4)


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: CosseratRod(SECTION, 1.0, 0), "elements must be a whole number from 1 on; got 0"),
        (lambda: CosseratRod(SECTION, 1.0, 2, closed=True), "from 3 on; got 2"),
        (lambda: CosseratRod(SECTION, -1.0, 3), "length must be positive"),
        (lambda: CosseratRod(SECTION, 1.0, 3, ends="free"), "ends are two of"),
        (lambda: CosseratRod(SECTION, 1.0, 3, rest=[1.0, 2.0]), r"rest is a strain, \(6,\)"),
        (lambda: CosseratRod(SECTION, 1.0, 3, tip_force=[1.0, 2.0]), r"tip_force has shape \(2,\)"),
        (lambda: CosseratRod(SECTION, 1.0, 3, damping=-1.0), "damping is not negative"),
        (lambda: CosseratRod(SECTION, 1.0, 3, gravity=np.nan), "gravity is nan"),
        (lambda: CosseratRod(SECTION, 1.0, 3, closed=True, tip_force=[1, 0, 0]), "no tip to load"),
        (lambda: RodSection([1.0, 2.0, 3.0], [1.0] * 6), "stiffness has six components"),
        (lambda: RodSection.round(-1.0, 1.0, 1.0), "radius must be positive"),
        (lambda: RodSection.tube(1.0, 1.0, 1.0, 1.0), "inner between 0 and it"),
        (lambda: RodSection.rectangle(1.0, 0.0, 1.0, 1.0), "width and height must be positive"),
        (lambda: RodSection.round(1.0, 1.0, 1.0, poisson=0.6), "poisson is above -1"),
        (lambda: ROD.shape([1.0]), r"u is \(6,\) or \(4, 6\)"),
        (lambda: ROD.along(np.zeros((5, 3))), "two places of the curve are the same"),
        (lambda: ROD.along(np.zeros((3, 3))), r"curve is \(5, 3\)"),
        (lambda: ROD.equilibrium(np.eye(4)), r"g is \(5, 4, 4\)"),
        (lambda: ROD.state(mu=np.ones((5, 6)), g=ROD.shape()), "site 0 is held"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_said(make, says):
    with pytest.raises(InvalidInput, match=says):
        make()


def test_a_section_is_a_section():
    with pytest.raises(InvalidType, match="section must be a RodSection"):
        CosseratRod(3.0, 1.0, 3)


def test_a_load_that_nothing_holds_has_no_balance():
    with pytest.raises(NoConvergence, match="no balance found at 1 of 1 parts"):
        CosseratRod(SECTION, 1.0, 3, ends=("free", "free"), gravity=1.0).equilibrium(stages=1)


@lm.record
class Pull(lm.Term):
    def energy(self, a):
        return -a.g[0, 0]


def test_pins_are_for_frames_in_space():
    body = lm.LiePoissonSystem(lm.SO3() ** 3, lm.PerSite(lm.KineticEnergy([1.0, 2.0, 3.0])))
    with pytest.raises(InvalidInput, match=r"pinned sites turn where they are, on SE3\(\)"):
        lm.MechanicalSystem(body, lm.Terms(Pull(), pinned=[1]))
    with pytest.raises(InvalidInput, match="pinned names site 9, which is not there"):
        lm.MechanicalSystem(ROD.body, lm.Terms(Pull(), pinned=[9]))
    assert "pinned=[1]" in repr(lm.Terms(Pull(), pinned=[1]))


def test_a_pinned_frame_has_no_force_along_and_no_linear_momentum():
    rod = CosseratRod(SECTION, 1.0, 2, ends=("hinged", "free"), gravity=1.0)
    g = rod.shape([0.3, 1.0, 0.2, 0.1, 0.0, 1.1])
    force = np.asarray(rod.force(g)).reshape(3, 6)
    assert not force[0, 3:].any() and force[0, :3].any()
    with pytest.raises(InvalidInput, match="site 0 is pinned: its linear momentum must be zero"):
        rod.state(mu=np.ones((3, 6)), g=g)


def test_shapes_and_curves_have_the_strains_that_were_asked_for():
    u = np.random.default_rng(1).normal(size=(4, 6)) + [0.0, 0.0, 0.0, 0.0, 0.0, 3.0]
    np.testing.assert_allclose(ROD.strains(ROD.shape(u)), u, atol=1e-13)
    fine = CosseratRod(SECTION, 1.0, 400)
    a, b = 0.3, 0.4 / (2.0 * np.pi)  # a helix of radius a and pitch 2 pi b
    c = np.hypot(a, b)
    g = fine.along(lambda s: (a * np.cos(s / c), a * np.sin(s / c), b * s / c))
    bend = np.linalg.norm(fine.strains(g)[:, :2], axis=1)
    np.testing.assert_allclose(bend, a / c**2, rtol=1e-4)
    np.testing.assert_allclose(fine.strains(g)[:, 2], 0.0, atol=1e-4)  # frames that do not turn
    twisted = fine.along(lambda s: (0.0, 0.0, s), twist=2.0)
    np.testing.assert_allclose(fine.strains(twisted), [[0, 0, 2.0, 0, 0, 1.0]] * 400, atol=1e-9)
