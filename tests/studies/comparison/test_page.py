"""The page in a real browser: it opens from a file, asks nobody for anything, and plays its films together."""

from __future__ import annotations

import dataclasses
import math
import os
import re
import shutil
import time

import pytest

from gasp_core.studies.comparison.page import page_of

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

NAMES = ("chromium", "chromium-browser", "google-chrome")
TIMES = "[...document.querySelectorAll('video')].map(film => film.currentTime)"


def chromium():
    own = os.environ.get("GASP_CHROMIUM")
    return own or next((path for name in NAMES if (path := shutil.which(name))), None)


# A browser is no Python package and `make test` cannot install one; the numbers behind the page are tested without.
needs_browser = pytest.mark.skipif(
    chromium() is None, reason=f"no browser: none of {', '.join(NAMES)} on PATH (set GASP_CHROMIUM)"
)


@pytest.fixture(scope="module")
def browser():
    with playwright.sync_playwright() as machine:
        browser = machine.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
        yield browser
        browser.close()


@pytest.fixture
def opened(browser, whole):
    """The page of the comparison in a window, what it complained about, and what it asked for."""

    def go(width, height):
        page = browser.new_page(viewport={"width": width, "height": height})
        complaints, requests = [], []
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: complaints.append(message.text))
        page.on("request", lambda request: requests.append(request.url))
        page.goto(whole.page.as_uri())
        until(page, "[...document.querySelectorAll('video')].every(film => film.readyState >= 2)")
        return page, complaints, requests

    return go


def until(page, condition):
    deadline = time.monotonic() + 30
    while not page.evaluate(condition):
        assert time.monotonic() < deadline, condition
        page.wait_for_timeout(20)


@needs_browser
@pytest.mark.thorough
def test_it_plays_all_films_together(opened, whole):
    page, complaints, requests = opened(1200, 900)
    assert page.evaluate(TIMES) == [0, 0]
    page.click("#play")
    until(page, f"{TIMES}.every(time => time > 0.2)")
    until(page, "document.getElementById('play').textContent === 'Play'")
    # To the end, which is where the last frame is: 0.8 s.
    assert all(0.8 <= now <= 0.84 for now in page.evaluate(TIMES))
    assert page.text_content("#now") == "0.84 s"
    assert page.evaluate("document.getElementById('time').value") == "0.84"
    # From the end it begins anew, and stops where it is told to.
    page.click("#play")
    until(page, f"{TIMES}.every(time => time > 0.05 && time < 0.8)")
    page.click("#play")
    until(page, "[...document.querySelectorAll('video')].every(film => film.paused)")
    assert complaints == []
    # The films are in the page: whatever else it asked for would be from elsewhere.
    assert [url for url in requests if not url.startswith("blob:")] == [whole.page.as_uri()]


@needs_browser
@pytest.mark.thorough
def test_the_slider_moves_all_of_them(opened):
    page, complaints, _ = opened(1200, 900)
    for wanted in (0.4, 0.12, 0.0):
        page.fill("#time", str(wanted))
        until(page, f"{TIMES}.every(time => Math.abs(time - {wanted}) < 0.01)")
        until(page, "[...document.querySelectorAll('video')].every(film => !film.seeking)")
        assert page.text_content("#now") == f"{wanted:.2f} s"
    assert complaints == []


@needs_browser
@pytest.mark.thorough
def test_names_are_text_and_nothing_else(opened):
    page, complaints, _ = opened(1200, 900)
    assert page.title() == "<script>alert(1)</script>: 3 engines"
    assert page.text_content("h1") == "<script>alert(1)</script>"
    assert page.locator("script").count() == 1
    captions = page.locator("figcaption").all_text_contents()
    assert any("toy <script>document.title = 'broken'</script> & $x_1$" in caption for caption in captions)
    assert complaints == []


@needs_browser
@pytest.mark.thorough
def test_it_fits_a_telephone(opened):
    page, complaints, _ = opened(400, 800)
    assert page.evaluate("document.documentElement.scrollWidth") == 400
    # Tables may be wider; they are moved by themselves.
    shown = "[...document.querySelectorAll('video, svg, .player, h1, p, dl')]"
    assert page.evaluate(f"{shown}.every(it => it.getBoundingClientRect().right <= 400)")
    assert complaints == []


@pytest.mark.thorough
def test_of_three_or_more_a_table_says_who_is_far_from_whom(whole):
    (pair,) = whole.pairs
    rows = tuple(dataclasses.replace(whole.rows[0], engine=name, film=None) for name in "abc")
    far = dataclasses.replace(pair.distance, rms=0.5 * pair.distance.diagonal)
    pairs = (
        dataclasses.replace(pair, first="a", second="b"),
        dataclasses.replace(pair, first="a", second="c", distance=far),
        dataclasses.replace(pair, first="b", second="c", distance=None, likeness=None, reason="of <other> shapes"),
    )
    text = page_of(dataclasses.replace(whole, rows=rows, pairs=pairs), {})
    table = re.search(r'<table id="matrix">.*?</table>', text, re.DOTALL)[0]
    cells = [re.findall(r"<td>(.*?)</td>", line) for line in re.findall(r"<tr><td.*?</tr>", table)]
    near = 100 * pair.distance.rms_share
    for found, expected in zip(cells, (["", near, 50], [near, "", ""], [50, "", ""])):
        assert len(found) == 3
        for cell, value in zip(found, expected):
            # Three figures are shown.
            assert cell == value == "" or math.isclose(float(cell), value, rel_tol=5e-3)
    assert "of &lt;other&gt; shapes" in text
    assert "<video" not in text
    assert "<svg" not in text


@pytest.mark.thorough
def test_it_is_one_file_that_names_no_other(whole):
    text = whole.page.read_text(encoding="utf-8")
    outside = re.findall(r"""(?:src|href|action|poster|xlink:href)\s*=\s*["']([^"']*)""", text)
    assert outside
    assert all(target.startswith(("#", "data:,")) for target in outside), outside
    assert "url(http" not in text
    # Every engine has a row, those that have frames a film and a line in each plot.
    assert text.count("<video ") == 2
    assert text.count("<svg ") == 4
    for name in ("ballistic", "frail", "away"):
        assert f"</span>{name}" in text
