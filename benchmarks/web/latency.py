"""How late the picture is in Chromium: from the pointer to changed pixels; and how many pictures there are a second."""

from __future__ import annotations

import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.web.browser import Browser, open_chromium
from benchmarks.web.serving import serving

SIZE = (1280, 720)
"""Pixels of the page."""
TABLE = (2.362, 1.144, 0.12)
"""m: length, width and rim of the table in the picture."""

WATCH = """
// After the page's own drawing of a picture: has the patch around the paddle changed?
window.late = [];
window.patch = null;
const canvas = document.getElementById("table");
const context = canvas.getContext("2d");
const look = () => context.getImageData(...window.patch.box, 1).data.join();
canvas.addEventListener("pointermove", (event) => {
  if (window.patch?.before) window.patch.pointed ??= event.timeStamp;
});
const after = () => {
  const patch = window.patch;
  if (patch && !document.getElementById("banner").hidden) {
    window.late.push(null); // the match rests, and so does the paddle: this trial tells nothing
    window.patch = null;
  } else if (patch) {
    patch.before ??= look();
    if (patch.pointed && look() !== patch.before) {
      window.late.push(performance.now() - patch.pointed);
      window.patch = null;
    }
  }
  requestAnimationFrame(after);
};
requestAnimationFrame(after);
"""

COUNT = """
const done = arguments[0], begin = performance.now();
let pictures = 0;
const next = (time) => {
  pictures += 1;
  time - begin < 5000 ? requestAnimationFrame(next) : done(1000 * pictures / (time - begin));
};
requestAnimationFrame(next);
"""


def place(x: float, y: float, height: float, top: float) -> tuple[float, float]:
    """The pixel of a page for a place on the table, m; the stage has this height and top, px."""
    length, width, rim = TABLE
    scale = min(SIZE[0] / (length + 2 * rim), height / (width + 2 * rim))
    return 0.5 * SIZE[0] + x * scale, top + 0.5 * height - y * scale


def _wait_for(browser: Browser, trial: int) -> None:
    """Wait until this trial is over."""
    browser.wait(lambda: browser.run("return window.late.length") > trial, "the paddle stays where it is")


def measure(trials: int = 60) -> dict[str, Any]:
    """Move the pointer by 0.2 m, again and again, and wait for the paddle to move.

    Args:
        trials: how often.

    Returns:
        `median_ms` and `p95_ms` from the pointer's event to the first drawn picture in which the paddle has moved, and
        `pictures_per_second`.
    """
    driver = open_chromium()
    try:
        with serving() as address, tempfile.TemporaryDirectory() as folder:
            browser = Browser(driver, Path(folder))
            browser.resize(*SIZE)
            browser.open(address)
            browser.wait(lambda: driver.find_elements("id", "begin"), "the page does not load")
            browser.choose("opponent", "idle")
            browser.choose("points", 99)
            browser.click("begin")
            browser.wait(lambda: not browser.element("banner").is_displayed(), "the match does not begin")
            box = browser.run(
                "const b = document.getElementById('table').getBoundingClientRect(); return [b.top, b.height]"
            )
            top, height = box
            browser.point(*place(-0.9, 0.1, height, top))
            time.sleep(0.5)
            browser.run(WATCH)
            places = [(-0.9, 0.1), (-0.9, -0.1)]
            for trial in range(trials):
                x, y = place(*places[trial % 2], height, top)
                browser.run("window.patch = { box: [arguments[0] - 30, arguments[1], 60] }", round(x), round(y - top))
                time.sleep(0.1 + 0.0137 * (trial % 5))  # at all moments of a picture
                browser.point(*place(*places[(trial + 1) % 2], height, top))
                _wait_for(browser, trial)
                time.sleep(0.4)
            late = [time for time in browser.run("return window.late") if time is not None]
            driver.set_script_timeout(30)
            pictures = driver.execute_async_script(COUNT)
            browser.leave()
    finally:
        driver.quit()
    median, p95 = np.percentile(late, [50, 95])
    return {"median_ms": float(median), "p95_ms": float(p95), "pictures_per_second": float(pictures)}
