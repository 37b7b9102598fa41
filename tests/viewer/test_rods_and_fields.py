"""Elastic rods as tubes, and vorticity as the colours of a sphere."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser import Tab

import liemech as lm
from liemech.errors import InvalidInput
from liemech.viewer import Field, Motion, Rod, Scene
from liemech.viewer.chromium import Chromium

RUBBER = lm.models.RodSection.round(radius=0.02, young=2e6, density=1100.0)
ARC = np.pi
"""The curvature of a rod of length 1 that is bent into a half circle, in rad/m."""


def bent(elements: int, **options: object) -> Motion:
    """A rod that is bent into a half circle, as a motion of two samples."""
    rod = lm.models.CosseratRod(RUBBER, 1.0, elements, **options)
    g = rod.shape([ARC, 0.0, 0.0, 0.0, 0.0, 1.0])
    moved = g.copy()
    moved[:, 2, 3] += 0.1
    return Motion(rod, [0.0, 1.0], {"g": np.stack([g, moved])})


@pytest.mark.parametrize("elements", [3, 40])
def test_a_tube_follows_the_elements_and_not_their_chords(elements: int) -> None:
    motion = bent(elements)
    (panel,) = Scene(motion).panels()
    tube = panel.nodes["panel 1/run 1/tube"]
    starts = tube.moving["cloud"] * panel.unit + panel.centre
    assert starts.shape == (2, 120, 3)  # three pieces of each of forty, forty of each of three
    centre = motion["g"][0, 0] @ [0.0, -1.0 / ARC, 0.0, 1.0]  # curvature about e1
    assert np.linalg.norm(starts[0] - centre[:3], axis=1) == pytest.approx(1.0 / ARC, rel=1e-12)
    ends = starts + tube.still["vectors"] * panel.unit
    assert ends[:, :-1] == pytest.approx(starts[:, 1:], abs=1e-12)
    assert ends[:, -1] == pytest.approx(motion["g"][:, -1, :3, 3], abs=1e-12)
    assert tube.shape is not None
    thick = tube.shape.known["sizes"].reshape(120, 3)[:, 0]
    thick = thick * np.linalg.norm(tube.still["vectors"], axis=1) * panel.unit
    assert thick == pytest.approx(2.0 * RUBBER.radius)


def test_round_ends_fill_the_bends_of_a_tube() -> None:
    """Between two pieces that turn by a the outside of the bend is at a/2 beyond their ends."""
    motion = bent(40)
    (panel,) = Scene(motion).panels()
    tube = panel.nodes["panel 1/run 1/tube"]
    assert tube.shape is not None
    length = np.linalg.norm(tube.still["vectors"], axis=1) * panel.unit
    points = tube.shape.geometry()["points"]
    x = RUBBER.radius / 0.5 * np.array([p["x"] for p in points])
    z = length.max() * np.array([p["y"] for p in points])
    assert x.max() == pytest.approx(RUBBER.radius) and z.max() > length.max()
    corners = np.stack([x, z], axis=1)[z <= 1e-9][:3]  # of the end at the origin, from its tip to its rim
    assert np.linalg.norm(corners, axis=1) == pytest.approx(RUBBER.radius)  # half a ball
    chords = np.linalg.norm(0.5 * (corners[1:] + corners[:-1]), axis=1)
    assert chords[-1] > 0.95 * RUBBER.radius  # up to bends of 60 degrees


def test_ends_are_marked_where_they_are_held() -> None:
    held = Scene(bent(4, ends=("clamped", "hinged"))).panels()[0].nodes
    assert {"panel 1/run 1/end 0", "panel 1/run 1/end -1"} <= held.keys()
    free = Scene(bent(4)).panels()[0].nodes
    assert "panel 1/run 1/trail" in free and "panel 1/run 1/end -1" not in free
    rod = lm.models.CosseratRod(RUBBER, 1.0, 12, closed=True)
    s = 0.5 / np.pi
    g = rod.along(lambda x: (s * np.cos(x / s), s * np.sin(x / s), 0.0 * x))
    between = rod.between(g, 10)
    assert between.shape == (121, 4, 4) and between[-1] == pytest.approx(between[0])
    assert between[::10][:-1] == pytest.approx(g, abs=1e-15)
    nodes = Scene(Motion(rod, [0.0], {"g": g[None]})).panels()[0].nodes
    assert not any("end" in path.rpartition("/")[2] for path in nodes)


def test_threads_are_drawn_thicker_and_the_page_says_so() -> None:
    assert Scene(bent(4)).notes() == []
    wire = lm.models.RodSection.round(radius=1e-4, young=2e11, density=7800.0)
    assert wire.radius == pytest.approx(1e-4, rel=1e-12)
    rod = lm.models.CosseratRod(wire, 1.0, 4)
    motion = Motion(rod, [0.0], {"g": rod.shape()[None]})
    assert Scene(motion).notes() == ["the thickness of the rod is not to scale"]
    body = Motion(lm.RigidBody([1.0, 2.0, 3.0]), [0.0], {"g": np.eye(3)[None]})
    for show in ("rod", "field"):
        with pytest.raises(InvalidInput, match=f"{show.title()} shows"):
            Scene(body, show=show)


def zonal() -> Motion:
    """Vorticity that grows from one pole to the other, and turns about in the second sample."""
    sphere = lm.models.ZeitlinSphere(16)
    mu = sphere.from_harmonics({(1, 0): 1.0}).mu
    return Motion(sphere, [0.0, 1.0], {"mu": np.stack([mu, -mu])})


def test_colours_are_the_vorticity() -> None:
    motion = zonal()
    scene = Scene(motion)
    assert scene.shown[0].contents == (Field(),)
    (panel,) = scene.panels()
    tones = panel.nodes["panel 1/run 1/field"].moving["tones"].reshape(2, 121, 241)
    assert np.ptp(tones, axis=2).max() < 1e-12 and (tones[0] == -tones[1]).all()
    z = np.sin(np.linspace(0.5 * np.pi, -0.5 * np.pi, 121))  # of Y_10, by latitudes
    most = np.abs(motion.system.levels(motion["mu"][0])).max()
    largest = np.sqrt(0.75 / np.pi) / most  # matrices have no value at the poles themselves
    assert 1.0 < largest < 1.1
    assert tones[0, :, 7] == pytest.approx(np.clip(largest * z, -1.0, 1.0), abs=1e-10)
    (scale,) = scene.legend()
    assert scale["ends"][1] == f"+{most:.2g}/s"


def test_of_a_magnetic_sphere_it_is_the_potential() -> None:
    """A = z and then -z, whatever the vorticity."""
    sphere = lm.models.MagneticSphere(16)
    mu = [sphere.from_harmonics({(2, 1): a}, {(1, 0): b}).mu for a, b in ((0.3, 1.0), (-0.7, -1.0))]
    scene = Scene(Motion(sphere, [0.0, 1.0], {"mu": np.array(mu)}))
    (panel,) = scene.panels()
    tones = panel.nodes["panel 1/run 1/field"].moving["tones"].reshape(2, 121, 241)
    z = np.sin(np.linspace(0.5 * np.pi, -0.5 * np.pi, 121))
    assert np.ptp(tones, axis=2).max() < 1e-12 and (tones[0] == -tones[1]).all()
    assert np.corrcoef(tones[0, :, 0], z)[0, 1] > 0.999
    assert scene.legend()[0]["name"] == "magnetic potential"


def test_a_long_film_stays_small() -> None:
    motion = zonal()
    many = Motion(motion.system, np.arange(900.0), {"mu": np.tile(motion["mu"][:1], (900, 1))})
    many["mu"][::2] *= -1.0
    assert 2e6 < len(Scene(many).html()) < 20e6


@pytest.mark.slow
def test_the_page_colours_the_poles(browser: Chromium, tmp_path: Path) -> None:
    with Tab.of(browser, Scene(zonal()).save(tmp_path / "field.html")) as tab:
        tab.wait("window.ready || window.failed")
        first = "Array.from(inner.geometry.attributes.color.array.slice(0, 3))"
        seen = tab.read("panel 1/run 1/field", [0.0, 0.5, 1.0], first)
        blue, white, red = ([int(c[k : k + 2], 16) / 255 for k in (1, 3, 5)] for c in COLORS)
        assert seen == pytest.approx(np.array([red, white, blue]), abs=2e-3)
        # the first point of the sphere is its north pole, which is up
        place = "inner.localToWorld(new MeshCat.THREE.Vector3(0, 1, 0)).toArray()"
        assert tab.read("panel 1/run 1/field", [0.0], place)[0] == pytest.approx([0, 1, 0], abs=1e-6)
        assert tab.complaints() == []


COLORS = "#0072B2", "#f7f7f5", "#D55E00"


def test_several_rods_share_a_picture() -> None:
    (panel,) = Scene(bent(4), name="four").add(bent(8), name="eight").panels()
    assert {"panel 1/run 1/tube", "panel 1/run 2/tube"} <= panel.nodes.keys()
    assert isinstance(Scene(bent(4)).shown[0].contents[0], Rod)
