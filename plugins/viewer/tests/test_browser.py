"""The page in a real browser: headless Chromium looks at what `gasp view` serves, as a user would."""

from __future__ import annotations

import io
import os
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")

NAMES = ("chromium", "chromium-browser", "google-chrome")
SIZE = {"width": 820, "height": 440}
SMALL = {"width": 420, "height": 300}
PANEL = 340
"""Pixels on the right that belong to the panel."""
BENIGN = (
    # viser draws splats as squares whose corners have two coordinates, and Three.js asks for the third.
    "THREE.BufferGeometry.computeBoundingSphere(): Computed radius is NaN",
)


def chromium():
    own = os.environ.get("GASP_CHROMIUM")
    return own or next((path for name in NAMES if (path := shutil.which(name))), None)


pytestmark = pytest.mark.skipif(
    chromium() is None, reason=f"no browser: none of {', '.join(NAMES)} on PATH (set GASP_CHROMIUM)"
)


class Server:
    """`gasp view` in a process of its own."""

    def __init__(self, path, *options):
        command = [sys.executable, "-m", "gasp_core.cli.main", "view", path, "--no-open", "--port", "0", *options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:\d+", line)
        if found is None:
            self.process.kill()
            raise AssertionError(f"no address in {line!r}; {self.process.communicate()[1]}")
        self.address = found.group()

    def interrupt(self):
        """Press Ctrl-C; gives the status and what was printed."""
        self.process.send_signal(signal.SIGINT)
        out, err = self.process.communicate(timeout=30)
        return self.process.returncode, out, err


@pytest.fixture
def serve():
    servers = []

    def go(path, *options):
        servers.append(Server(path, *options))
        return servers[-1]

    yield go
    for server in servers:
        if server.process.poll() is None:
            server.process.kill()
            server.process.communicate()


@pytest.fixture
def browse():
    """Opens an address in a browser of its own; returns the page and the list of what it complained about."""
    with playwright.sync_playwright() as machine:
        browsers = []

        def go(address, size=SIZE):
            browser = machine.chromium.launch(
                executable_path=chromium(),
                args=["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
            )
            browsers.append(browser)
            page = browser.new_page(viewport=size)
            errors = []
            page.on("pageerror", lambda error: errors.append(str(error)))
            page.on(
                "console",
                lambda message: (
                    errors.append(message.text)
                    if message.type == "error" and not message.text.startswith(BENIGN)
                    else None
                ),
            )
            page.goto(address)
            page.wait_for_selector("canvas")
            page.get_by_role("slider").first.wait_for()
            # viser remarks on a browser without a GPU, in front of the picture.
            page.locator(".mantine-Notification-closeButton").click()
            page.get_by_text("Software WebGL").wait_for(state="detached")
            return page, errors

        yield go
        for browser in browsers:
            browser.close()


def picture(page, path):
    """What the page shows beside its panel, (H, W, 3) in 0..1; kept to be looked at."""
    raw = page.screenshot()
    path.write_bytes(raw)
    return np.asarray(Image.open(io.BytesIO(raw)).convert("RGB"))[:, : SIZE["width"] - PANEL] / 255


def until(condition, what):
    deadline = time.monotonic() + 40
    while not (result := condition()):
        assert time.monotonic() < deadline, f"{what}: it does not come"
        time.sleep(0.1)
    return result


def is_fur(image):
    """Pixels of the toy's brown: much more red than blue, which neither floor nor grid nor ball has."""
    return image[:, :, 0] - image[:, :, 2] > 0.2


def frame_on_page(page):
    return int(page.get_by_role("slider").first.get_attribute("aria-valuenow"))


@pytest.mark.thorough
def test_a_run_is_seen_moved_and_played_and_the_server_outlives_the_browser(serve, browse, toy_run, tmp_path):
    server = serve(toy_run)
    page, errors = browse(server.address)

    # The toy appears, as something other than the background, inside the picture.
    def seen(name):
        image = picture(page, tmp_path / f"{name}.png")
        return [image] if is_fur(image).sum() > 500 else []

    (first,) = until(lambda: seen("first"), "the toy")
    rows = np.flatnonzero(is_fur(first).any(axis=1))
    assert rows[0] > 0 and rows[-1] < SIZE["height"] - 1

    # The timeline, moved by keys as one would, shows another frame: 0.2 s later it has fallen and turned.
    timeline = page.get_by_role("slider").first
    timeline.focus()
    timeline.press("End")
    until(lambda: "5 of 5" in page.inner_text("body"), "the facts of the last frame")

    def fallen():
        return [image for image in seen("last") if np.flatnonzero(is_fur(image).any(axis=1))[0] > rows[0]]

    (last,) = until(fallen, "the last frame")
    where = is_fur(first) | is_fur(last)
    # Fur or not is a step of 0.2 in a channel at least; a tenth is beyond what the antialiasing of an edge moves.
    assert (np.abs(first - last).max(axis=2)[where] > 0.1).mean() > 0.1

    # It plays: the timeline moves by itself, to and fro between its ends.
    page.get_by_role("button", name="Play").click()
    page.get_by_role("button", name="Pause").wait_for()
    frames = set()
    until(lambda: frames.add(frame_on_page(page)) or len(frames) >= 3, "three frames of the film")
    assert errors == []

    # A browser that goes away in the middle leaves a server that plays on for the next.
    page.context.browser.close()
    second, second_errors = browse(server.address, SMALL)
    frames = set()
    until(lambda: frames.add(frame_on_page(second)) or len(frames) >= 2, "it plays on")
    second.get_by_role("button", name="Pause").click()
    second.get_by_role("button", name="Play").wait_for()

    # Two browsers at once see the same, and each works the other's film.
    third, third_errors = browse(server.address, SMALL)
    assert frame_on_page(third) == frame_on_page(second)
    third.get_by_role("button", name="Play").click()
    frames = set()
    until(lambda: frames.add(frame_on_page(second)) or len(frames) >= 2, "the second follows the third")
    assert second_errors == third_errors == []

    status, out, err = server.interrupt()
    assert (status, out, err) == (130, "", "gasp: interrupted\n")


@pytest.mark.thorough
def test_points_in_the_colours_of_a_quantity_have_a_legend(serve, browse, toy_run, tmp_path):
    server = serve(toy_run, "--layer", "points", "--colour", "displacement")
    page, errors = browse(server.address)
    timeline = page.get_by_role("slider").first
    timeline.focus()
    timeline.press("End")

    def coloured():
        image = picture(page, tmp_path / "points.png")
        # The upper half of viridis is green and yellow; nothing moves at first, and all is violet.
        return int((image[:, :, 1] - image[:, :, 2] > 0.2).sum()) > 500

    until(coloured, "coloured points")
    text = page.inner_text("body")
    assert "displacement" in text and "0 m" in text and "≥" in text
    assert errors == []
    assert server.interrupt()[0] == 130
