"""The moving body of the site's first page, whose motion is in closed form in the page's own JavaScript."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from browser import Tab

import liemech as lm
from liemech.viewer.chromium import Chromium

SITE = Path(__file__).parent.parent.parent / "docs" / "site" / "static"
PAGE = f"""<!DOCTYPE html><meta charset="utf-8"><link rel="stylesheet" href="{(SITE / "liemech.css").as_uri()}">
<div class="flip"></div><script src="{(SITE / "flip.js").as_uri()}"></script>"""

BODIES = {
    "about the middle axis": ([1.0, 2.0, 3.0], [0.01, 1.0, 0.01]),
    "about the first axis": ([1.0, 2.0, 2.6], [-1.0, 0.3, 0.2]),
    "about the third axis, moments in another order": ([2.2, 2.6, 1.1], [0.3, 0.1, -1.4]),
    "close to the separatrix": ([1.0, 2.0, 3.0], [1e-5, -1.0, 1e-6]),
    "through a principal plane": ([1.0, 3.0, 2.0], [0.0, 1.0, 0.7]),
    "of two equal moments": ([2.0, 1.0, 1.0], [0.3, -0.4, 0.5]),
    "of two equal moments, across": ([1.0, 1.0, 2.0], [0.3, 0.4, 0.0]),
    "of three equal moments": ([2.0, 2.0, 2.0], [0.3, -0.4, 0.5]),
    "at rest in the body": ([1.0, 2.0, 3.0], [0.0, 0.0, -1.0]),
}


@pytest.fixture
def page(browser: Chromium, tmp_path: Path) -> Tab:
    file = tmp_path / "flip.html"
    file.write_text(PAGE, encoding="utf-8")
    return Tab.of(browser, file)


@pytest.mark.parametrize("case", BODIES)
def test_its_motion_is_the_exact_one(page: Tab, case: str) -> None:
    moments, mu = BODIES[case]
    body, times = lm.RigidBody(moments), np.linspace(-20.0, 60.0, 41)
    start = body.state(mu=mu, g=np.eye(3))
    with page:
        found = page.evaluate(
            f"(({{ period, at }}) => [period, {times.tolist()}.map(at)])(freeBody({json.dumps(moments)}, {json.dumps(mu)}))"
        )
    period, states = found
    exact = body.exact(start, times)
    np.testing.assert_allclose([x["mu"] for x in states], exact.mu, rtol=0.0, atol=1e-9 * np.linalg.norm(mu))
    np.testing.assert_allclose([x["g"] for x in states], exact.g, rtol=0.0, atol=1e-9)
    if body.period(start):  # of a momentum that moves
        assert period == pytest.approx(body.period(start), rel=1e-9)


def test_sliders_keys_and_clicks_change_what_is_seen(page: Tab) -> None:
    with page:
        page.evaluate("document.querySelector('.flip').seek(1.0)")
        before = page.drawn()
        page.evaluate("document.querySelector('#flip-J3').focus()")
        page.press("ArrowLeft")
        assert page.evaluate("document.querySelector('#flip-J3').getAttribute('aria-valuetext')") == "2.59 kg m²"
        page.evaluate("document.querySelector('.flip').seek(1.0)")
        slid = page.drawn()
        assert (slid != before).any()
        page.click("canvas + canvas", 0.4)
        aimed = page.evaluate("['aim', 'about'].map(name => Number(document.querySelector(`#flip-${name}`).value))")
        assert aimed != [2.0, 60.0]
        assert (page.drawn() != slid).any()
        page.click("button")
        page.click("button")
        assert page.evaluate("document.querySelector('button').textContent") in ("pause", "play")
        assert page.complaints() == []


def test_it_plays_until_it_is_paused(page: Tab) -> None:
    told = "parseFloat(document.querySelector('.flip p span').textContent.slice(4))"
    with page:
        page.wait(f"{told} > 0.2")
        page.click("button")
        paused = page.evaluate(told)
        page.browser.listen(0.3)
        assert page.evaluate(told) == paused


def test_moments_of_no_solid_body_are_told(page: Tab) -> None:
    with page:
        page.evaluate(
            "(input => { input.value = 0.5; input.dispatchEvent(new Event('input')); })(document.querySelector('#flip-J1'))"
        )
        assert "no solid body" in page.evaluate("document.querySelector('.flip p span').textContent")
