"""Many sites of one system on a page: they stand where they are, point where they point, and what is left out is said."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Tab
from scipy.spatial.transform import Rotation
from terms_of_spins import Exchange

import liemech as lm
from liemech.errors import InvalidInput
from liemech.models import SPC, Gravity
from liemech.viewer import Motion, Scene, Sites, Spins, thinning
from liemech.viewer.chromium import Chromium
from liemech.viewer.page import described

T = np.linspace(0.0, 4.0, 41)


@lm.record
class Spring(lm.Term):
    """A spring between two bodies."""

    def energy(self, a: Any, b: Any) -> float:
        return 0.5 * (a.g[0, 3] - b.g[0, 3]) ** 2


def spins(graph: Any) -> lm.LiePoissonSystem:
    return lm.LiePoissonSystem(lm.SO3() ** graph.sites, lm.Terms(Exchange(1.0).over(graph)))


def turning(sites: int, times: np.ndarray = T) -> np.ndarray:
    """Spins of different length that turn about the vertical, each at its rate, (n, sites, 3)."""
    angle = np.outer(times, 0.2 + 0.1 * np.arange(sites) % 1.7)
    up = np.linspace(-0.9, 0.9, sites)
    across = np.sqrt(1.0 - up**2)
    found = np.stack([across * np.cos(angle), across * np.sin(angle), 0.0 * angle + up], axis=-1)
    return found * np.linspace(0.5, 2.0, sites)[:, None]


def molecules(sites: int) -> tuple[np.ndarray, Rotation]:
    """Poses, (n, sites, 4, 4), that fly and turn, out of a box and into it."""
    rng = np.random.default_rng(4)
    poses = np.tile(np.eye(4), (len(T), sites, 1, 1))
    start, pace, spin = (rng.normal(size=(sites, 3)) for _ in range(3))
    for k, t in enumerate(T):
        poses[k, :, :3, :3] = Rotation.from_rotvec(t * spin).as_matrix()
        poses[k, :, :3, 3] = 9.0 + start + t * pace
    return poses, Rotation.from_rotvec(spin)


MATRICES = "Array.from(inner.instanceMatrix.array)"
COLOURS = "Array.from(inner.instanceColor.array)"


def seen(tab: Tab, times: Any, value: str, width: int, path: str = "panel 1/run 1/sites") -> Any:
    return tab.read(path, times, value).reshape(len(times), -1, width)


def opened(browser: Chromium, scene: Scene, folder: Path) -> Tab:
    tab = Tab.of(browser, scene.save(folder / "sites.html"))
    tab.wait("window.ready || window.failed")
    return tab


def test_arrows_on_a_page_are_the_spins(browser: Chromium, tmp_path: Path) -> None:
    lattice = lm.neighbours.square(5, 7)
    mu = turning(35)
    scene = Scene(Motion(spins(lattice), T, {"mu": mu}))
    (panel,) = scene.panels()
    with opened(browser, scene, tmp_path) as tab:
        some = [0, 13, 40]
        m = seen(tab, T[some], MATRICES, 16, "panel 1/run 1/spins").reshape(3, 35, 4, 4)
        places = m[:, :, 3, :3] * panel.unit + panel.centre
        i, j = np.divmod(np.arange(35), 7)
        assert np.abs(places - np.stack([j, i, 0 * i], axis=-1)).max() < 1e-3
        # the third axis of an arrow, as long as the arrow
        size = 0.85 / panel.unit
        assert np.abs(m[:, :, 2, :3] / size - mu[some] / 2.0).max() < 2e-4
        color = seen(tab, T[some], COLOURS, 3, "panel 1/run 1/spins")
        up = mu[some][..., 2] / np.linalg.norm(mu[some], axis=-1)
        blue, ink, orange = (np.array([int(c[k : k + 2], 16) for k in (1, 3, 5)]) / 255.0 for c in lm.plots.DIRECTIONS)
        wanted = ink + np.abs(up)[..., None] * (np.where(up[..., None] < 0.0, blue, orange) - ink)
        assert np.abs(color - wanted).max() < 1e-3
        # half-way between two samples the angle is half-way, and the length is kept
        halfway = seen(tab, [0.05], MATRICES, 16, "panel 1/run 1/spins").reshape(35, 4, 4)[:, 2, :3]
        middle = mu[0] + mu[1]
        middle *= (np.linalg.norm(mu[0], axis=1) / np.linalg.norm(middle, axis=1))[:, None]
        assert np.abs(halfway / size - middle / 2.0).max() < 2e-4
        legend = tab.evaluate("document.getElementById('legend').textContent")
        assert legend == "spins along \u2212z+z"
        assert tab.complaints() == []


def test_bodies_on_a_page_stand_and_turn_as_the_poses(browser: Chromium, tmp_path: Path) -> None:
    poses, _ = molecules(9)
    inertia = [0.2, 0.3, 0.4, 1.0, 1.0, 1.0]
    bodies = lm.LiePoissonSystem(lm.SE3() ** 9, lm.PerSite(lm.KineticEnergy(inertia)))
    system = lm.MechanicalSystem(bodies, lm.Terms(Spring().over(lm.neighbours.chain(9))))
    scene = Scene(Motion(system, T, {"g": poses}))
    (panel,) = scene.panels()
    with opened(browser, scene, tmp_path) as tab:
        some = [0, 20, 40]
        m = seen(tab, T[some], MATRICES, 16).reshape(3, 9, 4, 4)
        places = m[:, :, 3, :3] * panel.unit + panel.centre
        assert np.abs(places - poses[some][:, :, :3, 3]).max() < 1e-3
        # edges a_i with J_1 = m (a_2^2 + a_3^2)/12, ...: the box with this inertia and mass
        edges = np.linalg.norm(m[0, 0, :3, :3], axis=1) * panel.unit
        moments = (edges**2).sum() / 12.0 - edges**2 / 12.0
        assert moments == pytest.approx(inertia[:3], rel=1e-4)
        turns = m[:, :, :3, :3].transpose(0, 1, 3, 2) * panel.unit / edges
        assert np.abs(turns - poses[some][:, :, :3, :3]).max() < 2e-4
        assert tab.complaints() == []


@pytest.mark.slow
def test_atoms_on_a_page_are_those_of_the_molecules_in_their_box(browser: Chromium, tmp_path: Path) -> None:
    water, (poses, _) = SPC(), molecules(9)
    near = lm.neighbours.within(9.0, box=[18.6] * 3)
    free = lm.LiePoissonSystem(lm.SE3() ** 9, lm.PerSite(water.kinetic_energy))
    system = lm.MechanicalSystem(free, lm.Terms(water.over(near)))
    scene = Scene(Motion(system, T, {"g": poses}))
    (panel,) = scene.panels()
    with opened(browser, scene, tmp_path) as tab:
        m = seen(tab, [T[0], T[40], 0.5 * (T[20] + T[21])], MATRICES, 16).reshape(3, 3, 9, 4, 4)
        found = m[..., 3, :3] * panel.unit + panel.centre
        for k, n in ((0, 0), (1, 40)):
            middle = np.mod(poses[n, :, :3, 3], 18.6)
            turned = np.einsum("sij,aj->asi", poses[n, :, :3, :3], np.array(water.atoms))
            assert np.abs(found[k] - (middle + turned)).max() < 2e-3
        # between two samples nothing flies across the box
        off = found[2] - 0.5 * (poses[20] + poses[21])[:, :3, 3]
        off -= 18.6 * np.round(off / 18.6)
        assert np.linalg.norm(off, axis=-1).max() < 1.1
        assert tab.complaints() == []


def test_large_lattices_are_thinned_and_the_page_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(thinning, "MOST_SITES", 500)
    monkeypatch.setattr(thinning, "MOST_NUMBERS", 3 * 400 * 20)
    lattice = lm.neighbours.square(60, 60)
    mu = turning(3600)
    scene = Scene(Motion(spins(lattice), T, {"mu": mu}))
    content = described(scene)
    assert content["notes"] == ["shown: 400 of 3,600 sites, one in 3 along each axis, 20 of 41 samples"]
    (track,) = [track for track in content["tracks"] if track["channel"] == "vectors"]
    moving = track["values"].reshape(20, 400, 3) * track["unit"]
    i, j = np.meshgrid(np.arange(0, 60, 3), np.arange(0, 60, 3), indexing="ij")
    last = mu[-1, (60 * i + j).ravel()]
    assert np.abs(moving[-1] - last / np.linalg.norm(last, axis=1).max()).max() < 1e-4
    # an antiferromagnet still looks like one: neighbours that are shown are of different sublattices
    shown = scene.shown[0].motion.sites
    assert shown is not None
    assert ((shown // 60 + shown % 60) % 2).reshape(20, 20)[0].tolist()[:4] == [0, 1, 0, 1]


@pytest.mark.slow
def test_pages_of_a_hundred_thousand_sites_stay_small() -> None:
    lattice, t = lm.neighbours.cubic(47, 47, 47), np.linspace(0.0, 1.0, 900)
    mu = np.empty((900, lattice.sites, 3), dtype=np.float32)
    mu[:] = turning(lattice.sites, np.zeros(1))
    mu *= np.cos(t)[:, None, None].astype(np.float32)  # it moves
    run = Motion.__new__(Motion)  # without the copies that checking makes
    vars(run).update(system=spins(lattice), t=t, states={"mu": mu}, bodies=None, sites=None, note="")
    assert len(Scene(run).html()) < 20e6


def test_some_sites_are_shown_by_their_numbers() -> None:
    lattice = lm.neighbours.cubic(3, 4, 5)
    motion = Motion(spins(lattice), T, {"mu": turning(60)})
    layer = np.arange(60).reshape(3, 4, 5)[1].ravel()
    scene = Scene(motion, sites=layer)
    shown = scene.shown[0].motion
    assert (shown["mu"] == turning(60)[:, layer]).all() and shown.note == "20 of 60 sites"
    (panel,) = scene.panels()
    places = next(iter(panel.nodes.values())).still["cloud"] * panel.unit + panel.centre
    i, j, k = np.unravel_index(layer, (3, 4, 5))
    assert np.abs(places - np.stack([k, j, i], axis=-1)).max() < 1e-12


def test_rings_are_circles_with_neighbours_at_a_distance_of_one() -> None:
    places = lm.neighbours.ring(11).layout
    apart = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
    assert apart == pytest.approx(np.ones(11), rel=1e-12)
    assert np.ptp(np.linalg.norm(places, axis=1)) < 1e-14
    assert lm.neighbours.chain(3).layout.tolist() == [[0, 0, 0], [1, 0, 0], [2, 0, 0]]


def test_runs_of_every_kind_of_site_have_a_picture() -> None:
    lattice = lm.neighbours.ring(4)
    of_spins = spins(lattice)
    run = lm.integrate(of_spins, lm.RKMK(order=4), of_spins.state(mu=turning(4)[0]), h=0.1, steps=4, compiled=False)
    assert [type(c) for c in run.view().shown[0].contents] == [Spins]
    masses = lm.LiePoissonSystem(
        lm.VectorSpace(2) ** 3, lm.PerSite(lm.KineticEnergy(lm.each([[1.0] * 2, [8.0] * 2, [27.0] * 2])))
    )
    field = lm.Terms(Gravity().over(lm.neighbours.all_pairs()), mass=lm.each([1.0, 8.0, 27.0]))
    pulled = lm.MechanicalSystem(masses, field)
    places = np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0]])
    start = pulled.state(mu=np.zeros((3, 2)), g=places)
    run = lm.integrate(pulled, lm.LieVerlet(), start, h=0.01, steps=5, compiled=False)
    (panel,) = run.view().panels()
    node = panel.nodes["panel 1/run 1/sites"]
    assert node.shape is not None and "sizes" in node.shape.known
    sizes = node.shape.known["sizes"].reshape(3, 3)[:, 0]
    assert sizes[1:] / sizes[2] == pytest.approx([2.0 / 3.0, 1.0])  # as the cube roots
    found = node.moving["cloud"] * panel.unit + panel.centre
    assert np.abs(found[..., :2] - run.g).max() < 1e-12 and not found[..., 2].any()


def test_bad_input_is_named() -> None:
    pairs = lm.neighbours.edges([(0, 1), (1, 2)])
    motion = Motion(spins(pairs), T, {"mu": turning(3)})
    with pytest.raises(InvalidInput, match=r"give positions=, as \(3, 2\) or \(3, 3\)"):
        Scene(motion)
    places = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
    Scene(motion, Spins(positions=places)).panels()
    with pytest.raises(InvalidInput, match=r"positions have shape \(2, 2\)"):
        Scene(motion, Spins(positions=places[:2]))
    with pytest.raises(InvalidInput, match="axis is a direction"):
        Scene(motion, Spins(positions=places, axis=(0.0, 0.0, 0.0)))
    with pytest.raises(InvalidInput, match="Sites shows the places of many sites"):
        Scene(Motion(lm.RigidBody([1.0, 2.0, 3.0]), T, {"mu": turning(1)[:, 0]}), Sites())
    for sites in (-1, [0, 3], [0.5], []):
        with pytest.raises(InvalidInput, match="sites are the numbers of those to show"):
            Scene(motion, Spins(positions=places), sites=sites)
    many = np.stack([turning(3)] * 2, axis=1)
    ensemble = Motion(spins(lm.neighbours.ring(3)), T, {"mu": many}, bodies=2)
    with pytest.raises(InvalidInput, match="one member of an ensemble of many sites"):
        Scene(ensemble)
