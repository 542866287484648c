"""Chromium without a screen, and a page in it as a person uses it. The tests of the pages use it too."""

from __future__ import annotations

import base64
import json
import shutil
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from gymnasium.error import DependencyNotInstalled

CHROMIUM = ("chromium", "chromium-browser", "google-chrome")
"""Names of the program."""


def open_chromium(*arguments: str) -> Any:
    """Start Chromium; the driver of selenium.

    Args:
        arguments: of its command line.

    Raises:
        DependencyNotInstalled: selenium, Chromium or its driver are missing.
    """
    try:
        from selenium import webdriver
    except ImportError as error:
        raise DependencyNotInstalled('a browser is driven by selenium: pip install -e ".[dev]"') from error
    chromium = next(filter(None, map(shutil.which, CHROMIUM)), None)
    chromedriver = shutil.which("chromedriver")
    if chromium is None or chromedriver is None:
        raise DependencyNotInstalled("Chromium and its driver are needed: apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for argument in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--hide-scrollbars", *arguments):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(chromedriver))


SPY = """
window.sockets = [];
window.WebSocket = class extends WebSocket {
  constructor(...address) {
    super(...address);
    window.sockets.push(this);
    this.addEventListener("message", ({ data }) => {
      const message = typeof data === "string" ? JSON.parse(data) : {};
      if (message.type === "state") window.state = message;
    });
  }
};
"""
"""Runs before the page's own scripts: its sockets, and the last state that it was sent, can be seen then."""


class Browser:
    """A page.

    Args:
        driver: of selenium.
        downloads: where files go to.
    """

    def __init__(self, driver: Any, downloads: Path) -> None:
        self.driver, self.downloads = driver, downloads
        self.allowed_errors = ["willReadFrequently"]  # which `pixel` does
        """What may stand in the console: parts of texts."""
        self._hosts: set[str] = set()
        self._host = ""
        driver.execute_cdp_cmd(
            "Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": str(downloads), "eventsEnabled": False}
        )
        self._spy = driver.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": SPY})["identifier"]

    # What a person does -----------------------------------------------------------------------------------------

    def open(self, address: str) -> None:
        """Load a page."""
        self._host = urlsplit(address).netloc
        self.driver.get(address)

    def leave(self) -> None:
        """Load nothing."""
        self._collect()
        self._devtools("Page.removeScriptToEvaluateOnNewDocument", identifier=self._spy)
        self.driver.get("about:blank")

    def resize(self, width: int, height: int, *, dark: bool = False, touch: bool = False, scale: float = 1.0) -> None:
        """Another screen."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": touch}
        self._devtools("Emulation.setDeviceMetricsOverride", **metrics)
        self._devtools("Emulation.setTouchEmulationEnabled", enabled=touch)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self._devtools("Emulation.setEmulatedMedia", features=[scheme])

    def click(self, name: str) -> None:
        """Click the element with this id."""
        self.element(name).click()

    def point(self, x: float, y: float) -> None:
        """Move the mouse to a pixel of the page."""
        self._devtools("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)

    def touch(self, kind: str, *points: tuple[float, float]) -> None:
        """A finger on the screen: kind is "touchStart", "touchMove" or "touchEnd"."""
        self._devtools("Input.dispatchTouchEvent", type=kind, touchPoints=[{"x": x, "y": y} for x, y in points])

    def key(self, kind: str, code: str, key: str = "") -> None:
        """Press ("keyDown") or release ("keyUp") a key."""
        self._devtools("Input.dispatchKeyEvent", type=kind, code=code, key=key or code)

    def choose(self, name: str, value: object) -> None:
        """Set an input's value, as its user would."""
        self.run(
            "const field = document.getElementById(arguments[0]); field.value = arguments[1];"
            "for (const kind of ['input', 'change']) field.dispatchEvent(new Event(kind, { bubbles: true }));",
            name, value,
        )  # fmt: skip

    # What a person sees -----------------------------------------------------------------------------------------

    def element(self, name: str) -> Any:
        """The element with this id."""
        return self.driver.find_element("id", name)

    def text(self, name: str) -> str:
        """The text of the element with this id, shown or not."""
        return str(self.run("return document.getElementById(arguments[0]).textContent", name))

    def run(self, script: str, *arguments: object) -> Any:
        """Run JavaScript on the page."""
        return self.driver.execute_script(script, *arguments)

    def pixel(self, x: float, y: float) -> tuple[int, int, int]:
        """The colour of the table's canvas at a pixel of the page."""
        color = self.run(
            "const canvas = document.getElementById('table'), box = canvas.getBoundingClientRect();"
            "const ratio = canvas.width / box.width;"
            "const at = [(arguments[0] - box.left) * ratio, (arguments[1] - box.top) * ratio].map(Math.round);"
            "return [...canvas.getContext('2d').getImageData(...at, 1, 1).data]",
            x, y,
        )  # fmt: skip
        return color[0], color[1], color[2]

    def wait(self, holds: Callable[[], Any], what: str, seconds: float = 20.0) -> Any:
        """Wait until something holds; what it returned."""
        end = time.monotonic() + seconds
        while not (result := holds()):
            assert time.monotonic() < end, what
            time.sleep(0.02)
        return result

    def download(self) -> Path:
        """The file that is being downloaded."""
        return self.wait(lambda: next(self.downloads.glob("*.npz"), None), "no download")

    def picture(self) -> bytes:
        """A picture of the page, as of a .png file."""
        return base64.b64decode(self._devtools("Page.captureScreenshot", format="png")["data"])

    # What nobody may see ----------------------------------------------------------------------------------------

    def forget(self) -> None:
        """Forget the console's errors and the requests so far."""
        self.driver.get_log("browser")
        self.driver.get_log("performance")

    def check(self) -> None:
        """The console has no errors, and nothing was asked of any other host."""
        severe = [entry["message"] for entry in self._console if entry["level"] in ("SEVERE", "WARNING")]
        unexpected = [text for text in severe if not any(part in text for part in self.allowed_errors)]
        assert not unexpected, unexpected
        assert self._hosts <= {self._host}, self._hosts

    def _collect(self) -> None:
        self._console = self.driver.get_log("browser")
        for entry in self.driver.get_log("performance"):
            event = json.loads(entry["message"])["message"]
            if event["method"] == "Network.requestWillBeSent":
                url = event["params"]["request"]["url"]
            elif event["method"] == "Network.webSocketCreated":
                url = event["params"]["url"]
            else:
                continue
            if urlsplit(url).scheme not in ("data", "blob", "about", "chrome"):
                self._hosts.add(urlsplit(url).netloc)

    def _devtools(self, command: str, **arguments: object) -> Any:
        return self.driver.execute_cdp_cmd(command, arguments)
