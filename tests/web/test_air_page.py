"""The air table's page in a real browser."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from airhockey_env.air_table import METHODS
from airhockey_env.web.scenes import SCENES, SIZE, Scene
from benchmarks.web.browser import Browser
from tests.web.test_air import engine_contact

PLACE = """
const box = document.getElementById(arguments[0]).getBoundingClientRect();
const [x, y, length, width] = [...arguments].slice(1);
const scale = Math.min(box.width / (length + 0.13), box.height / (width + 0.13));
return [box.left + box.width / 2 + x * scale, box.top + box.height / 2 - y * scale];
"""
"""The pixel of the page for a place, m, on a table that lies."""

CLOCK = "return document.querySelector('.chosen output').textContent"


def begin(browser: Browser, address: str, scene: str) -> None:
    """Open a scene and let it stand still at its start."""
    browser.open(f"{address}/air#{scene}")
    browser.wait(lambda: browser.run("return window.state"), "nothing moves")
    browser.click("run")
    browser.click("restart")
    browser.wait(
        lambda: "0.000 s" in browser.run("return document.querySelector('.chosen output').textContent"), "start"
    )


def number(browser: Browser, name: str) -> float:
    """A number of the contact on the page, in its unit."""
    return float(browser.text(f"number-{name}").rstrip("°").split()[0])


def shown_scene(browser: Browser) -> Scene:
    """The scene of the link."""
    return Scene.parse(browser.run("return decodeURIComponent(location.hash.slice(1))"))


def mouse(browser: Browser, kind: str, *place: float, method: str = "continuous") -> None:
    """Press, move or release the mouse at a place of a table, m."""
    x, y = browser.run(PLACE, f"table-{method}", *place, *SIZE)
    browser.driver.execute_cdp_cmd(
        "Input.dispatchMouseEvent",
        {"type": f"mouse{kind}", "x": x, "y": y, "button": "left", "buttons": 1, "clickCount": 1},
    )


def drag(browser: Browser, *path: tuple[float, float]) -> None:
    """Drag the mouse over places of a table, m."""
    mouse(browser, "Pressed", *path[0])
    for place in path[1:]:
        mouse(browser, "Moved", *place)
    mouse(browser, "Released", *path[-1])


@pytest.mark.parametrize("method", METHODS)
def test_the_numbers_on_the_page_are_the_engines(method: str, browser: Browser, address: str) -> None:
    scene = SCENES["pool_shot"]
    begin(browser, address, f"{scene.text.rpartition('&')[0]}&phase=0.4")
    scene = shown_scene(browser)
    browser.run(
        "document.querySelector(`#table-${arguments[0]}`).closest('figure').querySelector('button').click()", method
    )
    browser.click("contact")
    browser.wait(lambda: browser.text("number-tick").endswith("ms"), "no contact")
    _, exact = engine_contact(scene, "continuous")
    _, approximate = engine_contact(scene, "overlap")
    _, used = engine_contact(scene, method)
    angles = [np.degrees(np.arctan2(row["ny"], row["nx"])) for row in (exact, approximate, used)]
    assert number(browser, "penetration_time") == pytest.approx(1e3 * (scene.tick - exact["time"]), abs=6e-5)
    assert [number(browser, name) for name in ("ideal", "approximate", "used")] == pytest.approx(angles, abs=6e-4)
    assert number(browser, "between") == pytest.approx(abs(angles[0] - angles[1]), abs=6e-4)
    assert number(browser, "hypotenuse") == pytest.approx(100.0, abs=6e-4)
    assert number(browser, "shared_leg") == pytest.approx(60.0, abs=6e-4)
    assert browser.text("number-penetration_time") in browser.text("said")  # for those who do not see the picture


def test_a_puck_is_moved_and_aimed(browser: Browser, address: str) -> None:
    begin(browser, address, "scene=pool_shot")
    drag(browser, (0.0, 0.0), (0.2, -0.1), (0.4, -0.3))
    browser.wait(lambda: abs(shown_scene(browser).pucks[1].x - 0.4) < 0.01, "it is not moved")
    assert shown_scene(browser).pucks[1].y == pytest.approx(-0.3, abs=0.01)
    browser.run("document.querySelector('details').open = true")
    browser.choose("drag", "velocity")
    drag(browser, (0.4, -0.3), (0.4, -0.2), (0.4, -0.14))
    browser.wait(lambda: abs(shown_scene(browser).pucks[1].vy - 2.0) < 0.2, "it is not aimed")


def test_a_puck_is_grabbed_and_thrown_while_time_runs(browser: Browser, address: str) -> None:
    browser.open(f"{address}/air#pucks=0,0,0,0,0.1,1")
    browser.wait(lambda: browser.run("return window.state?.playing"), "time does not run")
    mouse(browser, "Pressed", 0.0, 0.0)
    mouse(browser, "Moved", 0.3, 0.2)
    browser.wait(
        lambda: np.allclose(browser.run("return window.state.positions"), [[0.3, 0.2]] * 3, atol=0.01), "it is not held"
    )
    for x in [-0.3, 0.3] * 20:  # a pointer that rests before it lets go, as on a slow machine, throws nothing
        mouse(browser, "Moved", x, 0.2)
        mouse(browser, "Released", x, 0.2)
        if browser.run("return Math.abs(window.state.velocities[0][0])") > 0.0:
            break
        mouse(browser, "Pressed", x, 0.2)
    before = browser.run("return window.state.positions[0][0]")
    browser.wait(lambda: abs(browser.run("return window.state.positions[0][0]") - before) > 0.1, "it does not fly on")


def test_pucks_are_changed_with_the_keyboard_and_the_fields(browser: Browser, address: str) -> None:
    begin(browser, address, "scene=pool_shot")
    browser.run("document.getElementById('table-continuous').focus()")
    browser.key("keyDown", "BracketRight", "]")
    browser.wait(lambda: "Puck 2" in browser.text("said"), "no other puck")
    browser.key("keyDown", "ArrowUp")
    browser.wait(
        lambda: len(browser.run("return location.hash")) > 40 and shown_scene(browser).pucks[1].y == 0.01, "up"
    )
    browser.choose("mass", 2.5)
    browser.wait(lambda: shown_scene(browser).pucks[1].mass == 2.5, "no other mass")
    browser.key("keyDown", "NumpadAdd", "+")
    browser.wait(lambda: len(shown_scene(browser).pucks) == 3, "no other puck")
    browser.key("keyDown", "Delete")
    browser.wait(lambda: len(shown_scene(browser).pucks) == 2, "it stays")
    browser.choose("radius", 90)
    browser.wait(lambda: "Radius" in browser.text("said"), "no reason")
    assert shown_scene(browser).pucks[1].radius == 0.05


def test_time_is_turned_round(browser: Browser, address: str) -> None:
    begin(browser, address, "scene=reversal")
    browser.choose("speed", 0.6)
    for _ in range(3):
        browser.click("contact")
        browser.wait(lambda: browser.text("said").startswith("Pucks"), "no contact")
    browser.click("reverse")
    browser.wait(lambda: browser.text("said").startswith("Back at the start"), "it does not come back")
    assert browser.text("run") == "Run"
    assert browser.run(CLOCK) == "0.000 s"


def test_the_phases_are_fanned_out(browser: Browser, address: str) -> None:
    begin(browser, address, "scene=pool_shot")
    browser.click("fan")
    text = "return document.querySelector('#table-overlap').closest('figure').querySelector('output').textContent"
    browser.wait(lambda: " mm apart" in browser.run(text), "no fan")
    browser.choose("phase", 0.5)
    browser.wait(lambda: shown_scene(browser).phase == 0.5, "no other phase")


def test_the_contact_stays_in_view_while_the_phase_is_swept(browser: Browser, address: str) -> None:
    begin(browser, address, "scene=pool_shot")
    browser.click("contact")
    browser.wait(lambda: browser.text("number-tick").endswith("ms"), "no contact")
    for phase in (0.2, 0.5, 0.9):
        browser.choose("phase", phase)
        _, exact = engine_contact(replace(SCENES["pool_shot"], phase=phase), "continuous")
        browser.wait(
            lambda exact=exact: (
                browser.text("number-tick").endswith("ms")
                and abs(number(browser, "penetration_time") - 1e3 * (0.02 - exact["time"])) < 6e-5
            ),
            "another contact",
        )
    assert browser.run("return document.getElementById('phase').getAttribute('aria-valuetext')") == "90 %"


def test_a_named_scene_keeps_its_name_and_says_what_there_is_to_see(browser: Browser, address: str) -> None:
    texts = []
    for name in SCENES:
        browser.driver.get("about:blank")
        begin(browser, address, f"scene={name}")  # which restarts it
        assert browser.run("return document.getElementById('scenes').value") == name
        assert browser.run("return location.hash") == f"#scene={name}"
        texts.append(browser.text("about"))
    browser.choose("tick", 30)
    browser.wait(lambda: browser.run("return document.getElementById('scenes').value") == "", "it keeps the name")
    assert len({"", *texts, browser.text("about")}) == len(SCENES) + 2


def test_after_a_restart_there_are_no_contacts_to_go_to(browser: Browser, address: str) -> None:
    begin(browser, address, "scene=pool_shot")
    for _ in range(2):
        browser.run("document.getElementById('said').textContent = ''")
        browser.click("contact")
        browser.wait(lambda: browser.text("said").startswith("Pucks"), "no contact")
    browser.wait(lambda: browser.element("earlier").is_enabled(), "there is no earlier one")
    browser.click("restart")
    browser.wait(lambda: not browser.element("earlier").is_enabled(), "there is still an earlier one")
    assert not browser.text("number-tick").endswith("ms")


def test_a_link_that_is_none_is_explained(browser: Browser, address: str) -> None:
    browser.open(f"{address}/air#pucks=0,0,0,0,5,1")
    browser.wait(lambda: "radius" in browser.text("line"), "no reason")
    browser.click("again")
    browser.wait(lambda: browser.run("return window.state"), "no scene")
    assert shown_scene(browser) == SCENES["pool_shot"]


def test_everything_has_a_name(browser: Browser, address: str) -> None:
    begin(browser, address, "scene=pool_shot")
    nameless = browser.run(
        "return [...document.querySelectorAll('input, select, button, canvas')].filter((e) =>"
        "!(e.labels?.length || e.getAttribute('aria-label') || e.textContent.trim())).map((e) => e.outerHTML)"
    )
    assert nameless == []


def test_a_scene_that_may_have_many_contacts_runs_too(browser: Browser, address: str) -> None:
    browser.open(f"{address}/air#{SCENES['large_and_small'].text.replace('restitution=1', 'restitution=0.5')}")
    browser.wait(lambda: float(browser.run(CLOCK).split()[0] if browser.run(CLOCK) else 0) > 0.5, "it does not run")
    assert shown_scene(browser).restitution == 0.5
