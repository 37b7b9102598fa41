"""The page in a real browser: it draws, it moves as the trajectory does, and it answers."""

from __future__ import annotations

import functools
import html
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import Tab

import liemech as lm
from liemech.viewer import Body, Momentum, Motion, Scene
from liemech.viewer.chromium import Chromium

BODY = lm.RigidBody([1.0, 2.0, 3.0])
START = BODY.state(mu=[0.3, 1.0, 0.2], g=lm.SO3().exp([0.3, -0.8, 0.4]))
READY = "window.ready || window.failed"


@functools.cache
def run() -> lm.Trajectory:
    """The motion that is seen."""
    return lm.integrate(BODY, lm.ExactFreeBody(), START, h=0.1, steps=600, compiled=False)


@pytest.fixture(scope="module")
def tab(browser: Chromium, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    """The standard scene, body and momentum sphere, from disk."""
    page = Scene(run(), seconds=10.0).save(tmp_path_factory.mktemp("pages") / "body.html")
    with Tab.of(browser, page) as one:
        one.wait(READY)
        yield one


def is_blank(picture: np.ndarray) -> bool:
    """Is next to nothing but one colour to be seen above the bar?"""
    return bool((np.abs(picture[:-50] - picture[0, 0]).sum(axis=-1) > 60).mean() < 0.01)


def unlike(a: np.ndarray, b: np.ndarray) -> float:
    """The share of pixels that differ visibly."""
    return float((np.abs(a - b).sum(axis=-1) > 24).mean())


def test_it_draws_from_disk_and_asks_nobody(tab: Tab) -> None:
    assert not is_blank(tab.seek(20.0))
    assert tab.complaints() == []
    entries = tab.evaluate(
        "performance.getEntriesByType('resource').map(e => e.name).filter(n => !n.startsWith('data:'))"
    )
    assert entries == []


def test_time_decides_what_is_seen(tab: Tab) -> None:
    assert tab.evaluate("player.duration") == pytest.approx(run().t[-1], rel=1e-12)
    first, second, again = tab.seek(5.0), tab.seek(25.0), tab.seek(5.0)
    assert unlike(first, second) > 1e-3
    assert (first == again).all()


def test_what_is_seen_is_the_trajectory(tab: Tab) -> None:
    some = np.linspace(0, 600, 13).astype(int)
    t = run().t[some]
    body = tab.read("panel 1/run 1/body", t, "object.quaternion.toArray()")
    # whatever the sign of the quaternion: the axes of the body where they are seen
    turned = lm.SO3().Ad(run().g[some][:, None], np.eye(3))
    q, w = body[:, None, :3], body[:, None, 3:]
    seen = np.eye(3) + 2.0 * (w * np.cross(q, np.eye(3)) + np.cross(q, np.cross(q, np.eye(3))))
    assert np.abs(seen - turned).max() < 1e-5
    arrow = (
        "new MeshCat.THREE.Vector3(0, 0, 1).applyQuaternion(object.quaternion).multiplyScalar(object.scale.x).toArray()"
    )
    mu = tab.read("panel 2/run 1/mu", t, arrow)
    assert np.abs(mu - run().mu[some] / np.linalg.norm(run().mu[0])).max() < 1e-5
    space = tab.read("panel 1/run 1/spatial momentum", t, arrow)
    # it sticks out of the box
    assert np.abs(space - 1.15 * run().spatial_momentum[0] / np.linalg.norm(run().mu[0])).max() < 1e-5
    # it stands still: no track
    assert not tab.evaluate("player.tracks.some(t => t.path.endsWith('spatial momentum'))")


def test_the_trail_ends_at_the_arrow(tab: Tab) -> None:
    some = np.linspace(0, 600, 13).astype(int)
    path = "panel 2/run 1/mu trail"
    counts = tab.read(path, run().t[some], "inner.count")
    assert (counts == some).all()  # as many segments as there are steps up to then
    # and the last one ends at the tip of the arrow
    end = """(() => {
        const matrix = new MeshCat.THREE.Matrix4();
        inner.getMatrixAt(inner.count - 1, matrix);
        return new MeshCat.THREE.Vector3(0, 0, 1).applyMatrix4(matrix).toArray(); })()"""
    tip = tab.read(path, run().t[some[1:]], end)
    assert np.abs(tip / 1.003 - run().mu[some[1:]] / np.linalg.norm(run().mu[0])).max() < 1e-5


def test_between_two_samples_it_turns_evenly(tab: Tab) -> None:
    q = tab.read(
        "panel 1/run 1/body", run().t[100] + 0.1 * np.array([0.0, 0.25, 0.5, 1.0]), "object.quaternion.toArray()"
    )
    angle = 2.0 * np.arccos(np.clip(np.abs(q @ q[0]), 0.0, 1.0))
    assert angle[1:3] == pytest.approx(angle[3] * np.array([0.25, 0.5]), rel=1e-3)


def test_mouse_and_keys(tab: Tab) -> None:
    tab.evaluate("seekTo(0)")
    tab.click("#play")
    assert tab.evaluate("player.playing")
    tab.press(" ")
    assert not tab.evaluate("player.playing")
    tab.press(" ")
    tab.click("#time", across=0.5)
    assert not tab.evaluate("player.playing")
    t = tab.evaluate("player.time")
    assert 0.45 * run().t[-1] < t < 0.55 * run().t[-1]
    label = tab.evaluate("document.getElementById('label').textContent")
    assert label == f"t = {t:.1f} s"
    tab.press("Home")
    assert tab.evaluate("player.time") == 0.0
    tab.press("ArrowRight")
    assert tab.evaluate("player.time") == pytest.approx(run().t[-1] / 60.0)
    tab.press("End")
    assert tab.evaluate("player.time") == tab.evaluate("player.duration")


@pytest.mark.slow
def test_more_keys_and_what_has_the_focus(tab: Tab) -> None:
    tab.evaluate("seekTo(0)")
    for key, sample in ((".", 1), (".", 2), (",", 1), (",", 0), (",", 0)):
        tab.press(key)
        assert tab.evaluate("player.time") == pytest.approx(run().t[sample])
    for key, speed in (("+", 2.0), ("+", 5.0), ("+", 5.0), ("-", 2.0), ("-", 1.0)):
        tab.press(key)
        assert tab.evaluate("player.speed") == speed
    for shown in ("block", "none"):
        tab.press("?")
        assert tab.evaluate("getComputedStyle(document.getElementById('message')).display") == shown
    tab.evaluate("document.getElementById('loop').focus()")
    tab.press(" ")  # presses the button, and does not play
    assert tab.evaluate("player.loop") and not tab.evaluate("player.playing")
    tab.press(" ")
    tab.evaluate("document.activeElement.blur()")
    assert not tab.evaluate("player.loop")


@pytest.mark.slow
def test_a_link_leads_back_to_the_moment_and_the_view(browser: Chromium, tmp_path: Path) -> None:
    page = Scene(run(), seconds=10.0).save(tmp_path / "body.html")
    with Tab.of(browser, page) as tab:
        tab.wait(READY)
        first, home = tab.seek(17.0), tab.evaluate("player.viewer.camera.position.toArray()")
        tab.drag((150.0, 200.0), (210.0, 180.0))
        turned, eye = tab.drawn(), np.array(tab.evaluate("player.viewer.camera.position.toArray()"))
        tab.click("#link")
        address = tab.evaluate("location.href")
        assert "#t=17.0&view=" in address and address in tab.evaluate("document.getElementById('message').innerText")
        tab.click("#message")
        assert tab.evaluate("getComputedStyle(document.getElementById('message')).display") == "none"
    with Tab.of(browser, address) as tab:
        tab.wait(READY)
        assert tab.evaluate("player.time") == pytest.approx(17.0) and not tab.evaluate("player.playing")
        again = np.array(tab.evaluate("player.viewer.camera.position.toArray()"))
        assert np.linalg.norm(again - eye) < 2e-3 * np.linalg.norm(eye)  # a tenth of a degree
        assert unlike(tab.drawn(), turned) < 0.02 < unlike(first, turned)
        tab.click("#reset")  # the first view is that of the page
        assert unlike(tab.drawn(), first) < 1e-3
    with Tab.of(browser, address.partition("#")[0] + "#view=-90,90") as tab:  # as Scene(view=) says it
        tab.wait(READY)
        x, y, z = tab.evaluate("player.viewer.camera.position.toArray()")
        assert y > 100 * abs(x) and y > 100 * abs(z)  # from above: the second axis of three.js
    for nonsense in ("#view=abc", "#view=1,2,0&t=never", "#view="):
        with Tab.of(browser, address.partition("#")[0] + nonsense) as tab:
            tab.wait(READY)
            assert tab.evaluate("player.viewer.camera.position.toArray()") == pytest.approx(home)


@pytest.mark.slow
def test_the_page_writes_a_film(browser: Chromium, tmp_path: Path) -> None:
    """WebM by the browser's own recorder: the bytes with which every one begins (RFC 8794, section 11.2.1), and frames."""
    page = Scene(run(), seconds=1.0).save(tmp_path / "body.html")
    with Tab.of(browser, page) as tab:
        tab.wait(READY)
        tab.evaluate(  # the page may fetch nothing, not even itself
            "URL.createObjectURL = (blob) => { blob.arrayBuffer().then(b => window.film = new Uint8Array(b)); return ''; };"
            "HTMLAnchorElement.prototype.click = function () { window.saved = this.download; }; seekTo(0)"
        )
        tab.click("#film")
        assert tab.evaluate("document.getElementById('film').ariaPressed") == "true" and tab.evaluate("player.playing")
        tab.wait("window.saved && window.film.length", 30.0)
        assert tab.evaluate("player.time") == tab.evaluate("player.duration")
        assert tab.evaluate("window.saved") == "liemech.webm"
        assert tab.evaluate("document.getElementById('film').ariaPressed") == "false"
        size, head = tab.evaluate("[window.film.length, [...window.film.slice(0, 4)]]")
        assert head == [0x1A, 0x45, 0xDF, 0xA3] and size > 5_000
        tab.evaluate("window.saved = ''")
        tab.press("w")
        tab.press("Home")  # whoever moves in time ends it
        tab.press("Home")
        tab.wait("window.saved", 30.0)
        assert tab.complaints() == []


@pytest.mark.slow
def test_energy_and_length_of_the_momentum_follow_the_time(browser: Chromium, tmp_path: Path) -> None:
    poor = lm.integrate(BODY, lm.RKMK(order=2), START, h=0.2, steps=300, compiled=False)
    page = Scene(run(), name="exact").add(poor, name="RKMK2").save(tmp_path / "two.html")
    with Tab.of(browser, page) as tab:
        tab.wait(READY)
        names = tab.evaluate("[...document.querySelectorAll('#courses span')].map(s => s.textContent)")
        largest = np.abs(BODY.energy(poor.mu) - BODY.energy(poor.mu[0])).max()
        assert [name.partition(":")[0] for name in names] == ["energy", "|\u03bc|"]
        assert float(names[0].rpartition(" ")[2]) == pytest.approx(largest, rel=0.05)
        assert float(names[1].rpartition(" ")[2]) < 1e-13  # RKMK stays on the orbit
        curve = "document.querySelector('#courses .run1').getAttribute('points').split(',').map(Number)"
        points = np.array(tab.evaluate(curve)).reshape(-1, 2)
        assert points[:, 0] == pytest.approx(poor.t / poor.t[-1])
        assert -points[:, 1] * largest == pytest.approx(
            BODY.energy(poor.mu) - BODY.energy(poor.mu[0]), abs=1e-6 * largest
        )
        tab.click("#courses div", across=0.25)
        assert tab.evaluate("player.time") == pytest.approx(0.25 * run().t[-1], rel=0.02)
        marks = tab.evaluate("[...document.querySelectorAll('.now')].map(m => m.getAttribute('transform'))")
        assert marks == [f"translate({tab.evaluate('player.time / player.duration')})"] * 2
        tab.click("#legend button:nth-child(2)")
        assert tab.evaluate("getComputedStyle(document.querySelector('.run1')).display") == "none"
        assert tab.complaints() == []


@pytest.mark.slow
def test_what_a_screen_reader_is_told(tab: Tab) -> None:
    tab.seek(20.0)
    assert tab.evaluate("document.getElementById('time').getAttribute('aria-valuetext')") == "t = 20.0 s"
    for face in ("pause", "play"):
        tab.press(" ")
        assert tab.evaluate("document.getElementById('play').getAttribute('aria-label')") == face
    assert tab.evaluate("document.querySelectorAll('input').length") == 1  # the slider
    buttons = "[...document.querySelectorAll('button:not([hidden])')].map(b => b.ariaLabel || b.textContent)"
    assert all(tab.evaluate(buttons))


@pytest.mark.slow
def test_a_phone_has_a_long_slider_and_nothing_overlaps(tab: Tab) -> None:
    tab.resize(360, 740)
    tab.drawn()
    assert tab.evaluate("document.getElementById('time').getBoundingClientRect().width") > 230
    boxes = np.array(
        tab.evaluate(
            "[...document.getElementById('bar').children].map(e => e.getBoundingClientRect()).filter(r => r.width)"
            ".map(r => [r.left, r.right, r.top, r.bottom])"
        )
    )
    for k, (left, right, top, bottom) in enumerate(boxes):
        assert left >= 0 and right <= 360 and bottom <= 740
        others = np.delete(boxes, k, axis=0)
        beside = (others[:, 1] <= left) | (others[:, 0] >= right) | (others[:, 3] <= top) | (others[:, 2] >= bottom)
        assert beside.all()
    assert tab.evaluate(
        "document.getElementById('label').scrollWidth <= document.getElementById('label').clientWidth + 1"
    )
    bar = tab.evaluate("document.getElementById('bar').getBoundingClientRect().top")
    assert all(y + h <= bar for _, y, _, h in tab.evaluate("player.panels.map(panel => panel.rect)"))
    tab.resize(640, 480)
    tab.drawn()


def test_dragging_turns_every_panel(tab: Tab) -> None:
    eye = "player.viewer.camera.position.toArray()"
    before, picture = np.array(tab.evaluate(eye)), tab.seek(10.0)
    tab.drag((150.0, 200.0), (210.0, 180.0))
    after, turned = np.array(tab.evaluate(eye)), tab.drawn()
    # round the middle, neither nearer nor farther
    assert np.linalg.norm(after) == pytest.approx(np.linalg.norm(before))
    assert np.linalg.norm(after - before) > 0.1
    half = picture.shape[1] // 2
    assert unlike(picture[:, :half], turned[:, :half]) > 1e-3 and unlike(picture[:, half:], turned[:, half:]) > 1e-3
    tab.evaluate(f"player.viewer.camera.position.fromArray({before.tolist()}); player.viewer.controls.update()")


@pytest.mark.slow
def test_orbits_have_most_of_the_stage_and_the_legend_hides_a_run(browser: Chromium, tmp_path: Path) -> None:
    page = Scene(run(), name="one").add(run(), name="other").save(tmp_path / "two.html")
    with Tab.of(browser, page) as tab:
        tab.wait(READY)
        for width, height in ((1280, 720), (400, 800)):
            tab.resize(width, height)
            tab.drawn()
            both = tab.seek(20.0)
            *bodies, (left, top, w, h) = tab.evaluate("player.panels.map(panel => panel.rect)")
            wide = width > height
            others = tab.evaluate("['head', 'foot'].map(id => document.getElementById(id).offsetHeight)")
            assert (w if wide else h + 20.0) == pytest.approx(0.6 * (width if wide else height - sum(others) - 12.0))
            for x, y, across, down in bodies:  # beside it, or above
                assert x + across <= left + 1.0 if wide else y + down <= top
            tab.click("#legend button:nth-child(2)")
            one = tab.drawn()
            seen = "getComputedStyle(player.panels[1].caption).display"
            assert tab.evaluate(seen) == "none" and tab.evaluate("player.panels[1].object.visible")
            assert not tab.evaluate("player.viewer.scene_tree.find(['panel 3', 'run 2']).object.visible")
            assert (
                tab.evaluate("player.panels[0].rect[2] * player.panels[0].rect[3]") > 1.3 * bodies[0][2] * bodies[0][3]
            )
            tab.click("#legend button:nth-child(2)")
            assert unlike(both, one) > 1e-2 and unlike(both, tab.drawn()) < 1e-4


@pytest.mark.slow
def test_a_body_hides_the_letters_behind_it(browser: Chromium, tmp_path: Path) -> None:
    """The plate in front of its third axis covers the name of that, which is seen from the other side."""
    plate = Motion(BODY, np.zeros(1), {"g": np.eye(3)[None]})
    for name, elevation, seen in (("above", 80.0, True), ("below", -80.0, False)):
        page = Scene(plate, show="body", view=(35.0, elevation)).save(tmp_path / f"{name}.html")
        with Tab.of(browser, page) as tab:
            tab.wait(READY)
            with_letters = tab.drawn()
            tab.evaluate(
                "player.viewer.scene.traverse(o => { o.visible &&= !o.isSprite; }); player.viewer.needs_render = true"
            )
            middle = np.abs(with_letters - tab.drawn())[150:300, 250:390]
            assert bool(middle.max() > 60) == seen


@pytest.mark.slow
def test_speed_is_what_the_page_says(tab: Tab) -> None:
    def advance(speed: float) -> float:
        """Seconds of the motion in a second of the browser's clock; a picture that takes longer
        than 250 ms counts as that.
        """
        program = f"""new Promise(done => {{
            document.getElementById("speed").value = "{speed:g}"; document.getElementById("speed").onchange();
            seekTo(0); player.play();
            let last = null, from = 0, passed = 0, frames = 0;
            const look = now => {{
                if (last === null) from = player.time; else passed += Math.min((now - last) / 1000, 0.25);
                last = now;
                if (frames++ < 5) return requestAnimationFrame(look);
                player.pause();
                done((player.time - from) / passed);
            }};
            requestAnimationFrame(look);
        }})"""
        return float(tab.evaluate(program))

    assert advance(1.0) == pytest.approx(run().t[-1] / 10.0, rel=1e-6)  # the scene lasts ten seconds
    assert advance(5.0) == pytest.approx(5.0 * run().t[-1] / 10.0, rel=1e-6)
    tab.evaluate("document.getElementById('speed').value = '1'; document.getElementById('speed').onchange()")


@pytest.mark.slow
def test_nothing_is_drawn_while_it_stands(tab: Tab) -> None:
    tab.seek(10.0)
    before = tab.evaluate("player.drawn")
    time.sleep(0.5)
    assert tab.evaluate("player.drawn") == before


@pytest.mark.slow
def test_everything_fits_at_every_size(tab: Tab) -> None:
    corners = """player.panels.map(panel => {
        player.aim(panel);
        const camera = player.viewer.camera, [x, y, w, h] = panel.rect, found = [];
        camera.updateMatrixWorld();
        panel.object.traverse(o => {
            if (!o.geometry || !o.geometry.attributes.position) return;
            o.updateWorldMatrix(true, false);
            const p = o.geometry.attributes.position, v = new MeshCat.THREE.Vector3();
            for (let k = 0; k < p.count; k += 3) {
                v.fromBufferAttribute(p, k).applyMatrix4(o.matrixWorld).project(camera);
                found.push([v.x, v.y]);
            }
        });
        const xs = found.map(v => Math.abs(v[0])), ys = found.map(v => Math.abs(v[1]));
        return [xs.reduce((a, b) => Math.max(a, b), 0), ys.reduce((a, b) => Math.max(a, b), 0), x, y, x + w, y + h];
    })"""
    for width, height in ((420, 700), (640, 480), (1600, 900)):
        tab.resize(width, height)
        tab.drawn()
        for across, upright, left, top, right, bottom in tab.evaluate(corners):
            assert max(across, upright) < 1.0  # of its panel
            assert max(across, upright) > 0.6  # and not lost in it
            assert left >= 0 and top >= 0 and right <= width + 1 and bottom <= height - 44 + 1
    tab.resize(640, 480)


@pytest.mark.slow
def test_only_what_is_shown_exists(browser: Chromium, tmp_path: Path) -> None:
    momentum = {"mu": run().mu}
    page = Scene(Motion(BODY, run().t, momentum), show=Momentum(trail=False, levels=0, sphere=False)).save(
        tmp_path / "less.html"
    )
    with Tab.of(browser, page) as tab:
        tab.wait(READY)
        assert tab.has("panel 1/run 1/mu")
        others = ("run 1/body", "run 1/mu trail", "shared/levels", "shared/separatrix 1", "shared/sphere 1.000")
        for absent in ("panel 2", *(f"panel 1/{name}" for name in others)):
            assert not tab.has(absent), absent
        assert tab.evaluate("player.tracks.length") == 1
    full = Scene(run()).html()
    assert len(page.read_text(encoding="utf-8")) < len(full) - 150_000


@pytest.mark.slow
def test_compressed_in_a_sandboxed_frame_as_notebooks_show_it(browser: Chromium, tmp_path: Path) -> None:
    around = tmp_path / "notebook.html"
    around.write_text(f"<!DOCTYPE html><body style='margin:0'>{Scene(run())._repr_html_()}</body>", encoding="utf-8")
    with Tab.of(browser, around) as tab:
        until = time.monotonic() + 20.0
        while is_blank(picture := tab.pixels()) and time.monotonic() < until:
            time.sleep(0.1)
        assert not is_blank(picture)
        assert tab.complaints() == []


@pytest.mark.slow
def test_without_webgl_the_page_says_so(browser: Chromium, tmp_path: Path) -> None:
    page = Scene(run(), show="body").save(tmp_path / "body.html")
    with Chromium((640, 480), flags=("--disable-3d-apis",)) as other, Tab.of(other, page) as tab:
        tab.wait(READY)
        assert "WebGL" in tab.evaluate("document.getElementById('message').innerText")
        assert tab.evaluate("getComputedStyle(document.getElementById('message')).display") == "block"


@pytest.mark.slow
@pytest.mark.parametrize("samples", [1, 2])
def test_few_samples_and_texts_that_look_like_code(browser: Chromium, tmp_path: Path, samples: int) -> None:
    title = '</script><b>"it\'s" <!--scene--> \\u003c'
    few = Motion(BODY, run().t[:samples], {"mu": run().mu[:samples], "g": run().g[:samples]})
    page = Scene(few, title=title, name="<i>one</i>").save(tmp_path / "few.html")
    with Tab.of(browser, page) as tab:
        tab.wait(READY)
        assert not is_blank(tab.seek(0.0))
        assert tab.evaluate("document.title") == title
        assert tab.evaluate("document.querySelector('h1').textContent") == title
        assert tab.evaluate("document.querySelector('#legend button').textContent") == "<i>one</i>"
        assert tab.complaints() == []
    assert html.escape(title) in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_times_that_repeat_and_steps_that_are_not_joined(browser: Chromium, tmp_path: Path) -> None:
    t = np.array([0.0, 1.0, 1.0, 2.0])
    few = Motion(BODY, t, {"mu": run().mu[:4], "g": run().g[:4]})
    page = Scene(few, show="momentum", interpolate=False).save(tmp_path / "steps.html")
    with Tab.of(browser, page) as tab:
        tab.wait(READY)
        arrow = "new MeshCat.THREE.Vector3(0, 0, 1).applyQuaternion(object.quaternion).toArray()"
        seen = tab.read("panel 1/run 1/mu", [0.0, 0.9, 1.0, 1.9, 2.0], arrow)
        unit = run().mu[:4] / np.linalg.norm(run().mu[0])
        assert np.abs(seen - unit[[0, 0, 2, 2, 3]]).max() < 1e-5


@pytest.mark.slow
def test_an_ensemble_is_a_cloud_on_one_sphere(browser: Chromium, tmp_path: Path) -> None:
    momenta = np.random.default_rng(3).normal(size=(40, 3))
    momenta /= np.linalg.norm(momenta, axis=1)[:, None]
    many = lm.integrate(BODY, lm.RKMK(order=4), BODY.state(mu=momenta), h=0.1, steps=20, compiled=False)
    page = Scene(many).save(tmp_path / "cloud.html")
    with Tab.of(browser, page) as tab:
        tab.wait(READY)
        points = tab.read("panel 1/run 1/mu", many.t[[0, 10, 20]], "Array.from(inner.userData.cloud)")
        by_energy = np.argsort(BODY.energy(momenta))
        assert np.abs(points.reshape(3, 40, 3) / 1.003 - many.mu[[0, 10, 20]][:, by_energy]).max() < 2e-4
        assert not is_blank(tab.drawn()) and tab.complaints() == []


@pytest.mark.slow
def test_a_mesh_of_ones_own(browser: Chromium, tmp_path: Path) -> None:
    file = tmp_path / "corner.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n", encoding="utf-8")
    page = Scene(run(), show=Body(mesh=file, triad=False)).save(tmp_path / "mesh.html")
    with Tab.of(browser, page) as tab:
        tab.wait(READY)
        tab.seek(3.0)
        corners = tab.read("panel 1/run 1/body/mesh", [3.0], "inner.geometry.attributes.position.count")
        assert corners == 12  # of four triangles
        assert not is_blank(tab.drawn()) and tab.complaints() == []
