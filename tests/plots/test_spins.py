"""Pictures of runs of many sites: spins on lattices, and what is kept."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.colors import to_rgb
from matplotlib.image import AxesImage
from matplotlib.quiver import Quiver
from terms_of_spins import Exchange

import liemech as lm
from liemech import plots
from liemech.errors import InvalidInput


def spins(graph: Any, **given: Any) -> Any:
    """A short run from random directions, whose lengths are two."""
    system = lm.LiePoissonSystem(lm.SO3() ** graph.sites, lm.Terms(Exchange(1.0).over(graph)))
    mu = np.random.default_rng(5).normal(size=(graph.sites, 3))
    mu *= 2.0 / np.linalg.norm(mu, axis=1, keepdims=True)
    mu[0] = [0.0, 0.0, 2.0]
    mu[1] = [-2.0, 0.0, 0.0]
    start = system.state(mu=mu)
    return lm.integrate(system, lm.RKMK(order=4), start, h=0.1, steps=4, compiled=False, **given)


@pytest.mark.slow
def test_arrows_stand_on_the_lattice_and_point_as_the_spins() -> None:
    run = spins(lm.neighbours.square(3, 4))
    ax = plots.spins(run, 0, axis=(1.0, 0.0, 0.0))
    (arrows,) = [one for one in ax.collections if isinstance(one, Quiver)]
    i, j = np.divmod(np.arange(12), 4)
    assert (np.stack([j, i], axis=-1) == arrows.XY).all()
    assert np.abs(np.stack([arrows.U, arrows.V], axis=-1) - run.mu[0, :, :2] / 2.0).max() < 1e-12
    ax.figure.canvas.draw()
    # the second one points against the axis
    assert np.abs(arrows.get_facecolors()[1, :3] - to_rgb(plots.DIRECTIONS[0])).max() < 0.01
    assert isinstance(run.plot().collections[0], Quiver)


def test_large_layers_are_colours_site_by_site() -> None:
    graph = lm.neighbours.cubic(2, 3, 50, periodic=False)
    system = lm.LiePoissonSystem(lm.SO3() ** 300, lm.Terms(Exchange(1.0).over(graph)))
    mu = np.random.default_rng(5).normal(size=(1, 300, 3))
    run = lm.viewer.Motion(system, [0.0], {"mu": mu})
    ax = plots.spins(run, layer=1)
    (image,) = [one for one in ax.get_children() if isinstance(one, AxesImage)]
    shown = np.asarray(image.get_array())
    up = mu[0, :, 2] / np.linalg.norm(mu[0], axis=1)
    assert shown.shape == (3, 50) and np.abs(shown - up.reshape(2, 3, 50)[1]).max() < 1e-15
    assert image.origin == "lower"
    with pytest.raises(InvalidInput, match="layers are 0 to 1; got 2"):
        plots.spins(run, layer=2)


def test_a_ring_is_drawn_site_by_site_over_time() -> None:
    run = spins(lm.neighbours.ring(6))
    ax = run.plot()
    (mesh,) = ax.collections
    assert np.abs(np.reshape(mesh.get_array(), (5, 6)) - run.mu[..., 2] / 2.0).max() < 1e-15
    corners = np.asarray(mesh.get_coordinates())  # each value around its site and time
    assert np.abs(corners[:-1, 0, 1] + corners[1:, 0, 1] - 2.0 * run.t).max() < 1e-12
    assert np.abs(corners[0, :-1, 0] + corners[0, 1:, 0] - 2.0 * np.arange(6)).max() < 1e-12
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("site", "time $t$")


def test_what_is_no_lattice_of_spins_is_refused() -> None:
    with pytest.raises(InvalidInput, match="square or a cubic lattice"):
        plots.spins(spins(lm.neighbours.all_pairs(4)))
    run = spins(lm.neighbours.square(3, 3))
    for given, words in (
        ({"layer": 0}, "has no layers"),
        ({"axis": (0.0, 0.0, 0.0)}, "axis is a direction"),
        ({"sample": 5}, "the run has 5 samples"),
    ):
        with pytest.raises(InvalidInput, match=words):
            plots.spins(run, **given)


def test_constants_of_many_sites_are_drawn_as_the_report_has_them() -> None:
    run = spins(lm.neighbours.ring(5))
    ax = plots.invariants(run)
    assert [line.get_label() for line in ax.get_lines()] == [kept.name for kept in run.drift().kept]
    alone = spins(lm.neighbours.ring(5), record=["energy"])
    for one in (run, alone):
        curve = plots.drift(one).get_lines()[0].get_ydata()[-1]
        values = np.asarray(run.energy)
        assert curve == pytest.approx(np.abs(values - values[0]).max() / one.drift()["energy"].scale)
