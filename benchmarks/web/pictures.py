"""Pictures of the pages, for the docs."""

from __future__ import annotations

import io
import tempfile
import time
from pathlib import Path

from PIL import Image

from airhockey_env.files import replace
from airhockey_env.kernel.state import LEFT
from airhockey_env.live import LiveMatch
from airhockey_env.replay import Replay, play_back_game
from benchmarks.web.browser import Browser, open_chromium
from benchmarks.web.serving import serving

LAPTOP, PHONE, PROJECTOR = (1280, 720), (390, 844), (1920, 1080)


def draw(folder: Path, run: Path | None = None) -> list[Path]:
    """Write the pictures.

    Args:
        folder: where to.
        run: the folder of a training run to be shown; None: there is no picture of one.

    Returns:
        The files.
    """
    driver = open_chromium()
    try:
        with serving(runs=() if run is None else (str(run),)) as address, tempfile.TemporaryDirectory() as place:
            browser = Browser(driver, Path(place))
            files = [
                _play(browser, address, folder / "web_play.png", LAPTOP, dark=False),
                _play(browser, address, folder / "web_phone.png", PHONE, dark=True),
                _replay(browser, address, folder / "web_contacts.png", Path(place) / "match.npz"),
                _air(browser, address, folder / "web_air.png"),
            ]
            if run is not None:
                files.append(_run(browser, address, folder / "web_run.png"))
            browser.leave()
    finally:
        driver.quit()
    return files


def _play(browser: Browser, address: str, path: Path, size: tuple[int, int], *, dark: bool) -> Path:
    """A match against the expert, some seconds after it has begun."""
    browser.resize(*size, dark=dark, touch=size == PHONE)
    browser.open(address)
    browser.wait(lambda: browser.driver.find_elements("id", "begin"), "the page does not load")
    browser.choose("opponent", "expert")
    browser.click("begin")
    browser.wait(lambda: not browser.element("banner").is_displayed(), "the match does not begin")
    time.sleep(2.0)
    return _save(browser, path)


def _replay(browser: Browser, address: str, path: Path, file: Path) -> Path:
    """The hardest hit of a replayed match, with its normal and its impulse."""
    match = LiveMatch("expert", left="adept", points=3, seed=1, recorded=True)
    now = 0.0
    while not match.over and now < 120.0:
        now += 0.05
        match.advance(now)
    match.replay().save(file)
    hits = [
        (float(contact["impulse"]), (step - 1) / match.game.control_hz + float(contact["time"]))
        for step, game in enumerate(play_back_game(Replay.load(file)))
        for contact in game.contacts_of(0)
        if contact["a"] == LEFT
    ]
    browser.resize(*LAPTOP)
    browser.open(f"{address}/watch")
    browser.wait(lambda: browser.text("left-name"), "nobody plays")
    for name in ("contacts", "normals", "impulses"):
        browser.click(name)
    browser.element("file").send_keys(str(file))
    browser.wait(lambda: browser.element("timeline").is_displayed(), "the replay does not open")
    browser.click("pause")
    browser.choose("scrubber", max(hits)[1] + 0.004)
    time.sleep(0.5)
    return _save(browser, path)


def _air(browser: Browser, address: str, path: Path) -> Path:
    """The pool shot at its contact, from all phases of the tick, with the triangles."""
    browser.resize(1280, 900)
    browser.open(f"{address}/air#scene=pool_shot")
    browser.wait(lambda: browser.run("return window.state"), "the page does not load")
    browser.click("run")
    browser.click("restart")
    browser.click("fan")
    browser.wait(lambda: browser.text("said").startswith("Paths"), "the paths are not fanned out")
    browser.click("contact")
    browser.wait(lambda: browser.text("said").startswith("Pucks"), "there is no contact")
    browser.choose("phase", 0.5)
    browser.wait(lambda: browser.text("number-penetration_time").startswith("11.6667"), "it is another phase")
    time.sleep(0.5)
    return _save(browser, path)


def _run(browser: Browser, address: str, path: Path) -> Path:
    """A training run."""
    browser.resize(*LAPTOP, dark=True)
    browser.open(f"{address}/watch")
    browser.wait(lambda: "steps" in browser.text("run-note"), "the run is not shown")
    time.sleep(3.0)
    browser.wait(lambda: not browser.element("banner").is_displayed(), "the match rests")
    return _save(browser, path)


def _save(browser: Browser, path: Path) -> Path:
    picture = Image.open(io.BytesIO(browser.picture())).convert("RGB")
    replace(path, lambda part: picture.save(part, format="PNG", optimize=True))
    return path
