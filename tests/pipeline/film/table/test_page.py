"""The page of the table in a real browser, headless: by mouse, and by keyboard alone."""

from __future__ import annotations

import math
import os
import re
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from selenium import webdriver
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.common.keys import Keys
from selenium.webdriver.support.ui import WebDriverWait
from stand_in_session import COLUMNS, ROWS, Served, course

BROWSER, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
if os.environ.get("ISOCHRONY_BROWSER") != "required":
    pytestmark = pytest.mark.skipif(
        not (BROWSER and DRIVER), reason="chromium and its driver (Debian: chromium, chromium-driver) are not installed"
    )
OPTIONS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --window-size=1280,800"
)
RULER = 84  # px of the canvas that show times


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[webdriver.Chrome]:
    assert BROWSER, "chromium is required and not installed"
    assert DRIVER, "chromium-driver is required and not installed"
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for option in [*OPTIONS.split(), f"--user-data-dir={tmp_path_factory.mktemp('profile')}"]:
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options, webdriver.ChromeService(DRIVER))
    yield driver
    driver.quit()


class Page:
    """What a person does at the page, and what it shows."""

    def __init__(self, driver: webdriver.Chrome, served: Served) -> None:
        self.driver, self.session = driver, served.session
        driver.get(served.url)
        self.until(lambda: self.view["waiting"] == 0)

    def until(self, condition: Callable[[], Any]) -> Any:
        return WebDriverWait(self.driver, 60, 0.02).until(lambda _: condition())

    def find(self, selector: str) -> Any:
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def text(self, selector: str) -> str:
        return str(self.find(selector).text)

    def type(self, *keys: str) -> None:
        ActionChains(self.driver, 0).send_keys(*keys).perform()

    def press(self, key: str, times: int = 1, held: str = "") -> None:
        chain = ActionChains(self.driver, 0)
        chain = chain.key_down(held) if held else chain
        chain.send_keys(key * times)
        (chain.key_up(held) if held else chain).perform()

    @property
    def view(self) -> dict[str, float]:
        shown = self.driver.execute_script("return {...document.getElementById('film').dataset}")
        return {name: float(shown.get(name, "nan")) for name in ("row", "column", "zoom", "waiting")}

    def mouse(self, *places: tuple[float, float]) -> ActionChains:
        """Drag from the first place on the film [row, column] over the others; only click, where there is one."""
        view, film, chain = self.view, self.find("#film"), ActionChains(self.driver, 0)
        for number, (row, column) in enumerate(places):
            x, y = RULER / 2 + (column - view["column"]) * view["zoom"], (row - view["row"]) * view["zoom"]
            chain.move_to_element_with_offset(film, round(x), round(y))
            if number == 0:
                chain.click_and_hold()
        chain.release().perform()

    def edits(self, count: int) -> list[dict[str, Any]]:
        """All edits, as soon as there are so many and the page is no longer busy."""
        self.until(lambda: len(self.session.edits) == count and not self.find("#spinner").is_displayed())
        return self.session.edits

    def pixel(self, row: float, column: float) -> list[int]:
        """Red, green and blue of what is shown of the film there."""
        return self.driver.execute_script(
            "const film = document.getElementById('film'), {row, column, zoom} = film.dataset;"
            "const scale = devicePixelRatio;"
            "const x = (film.clientWidth + arguments[2]) / 2 + (arguments[1] - column) * zoom;"
            "const y = film.clientHeight / 2 + (arguments[0] - row) * zoom;"
            "return [...film.getContext('2d').getImageData(x * scale, y * scale, 1, 1).data].slice(0, 3)",
            row, column, RULER,
        )  # fmt: skip


@pytest.fixture
def page(browser: webdriver.Chrome, served: Served) -> Iterator[Page]:
    browser.get_log("browser")
    page = Page(browser, served)
    yield page
    told = [each["message"] for each in browser.get_log("browser")]
    assert not [each for each in told if "status of 422" not in each and "getImageData" not in each]
    browser.get("about:blank")


def near(points: Any, expected: Any) -> None:
    """Within a pixel of the screen."""
    assert points == pytest.approx(expected, abs=1.1)


# ---- what is shown


def test_head_line_tells_gravity(page: Page) -> None:
    assert page.text("#name") == "ship.film.tif"
    assert page.text("#gravity") == "9.8123456 m/s\u00b2"
    assert page.text("#sigma") == "\u00b1 0.52 mGal"
    assert page.text("#samples") == "1\u202f250"
    assert "scan with more contrast" in page.find("#flags button").get_attribute("title")


def test_reading_is_laid_over_the_film_or_not(page: Page) -> None:
    place = 100.5, float(course(100.5, 1))
    red, _, blue = page.pixel(*place)
    assert blue > red + 60  # the trace's blue
    page.type("o")
    page.until(lambda: page.find("#overlay").get_attribute("aria-pressed") == "false")
    page.until(lambda: len(set(page.pixel(*place))) == 1)  # the film is grey
    assert page.pixel(*place)[0] < 160 < page.pixel(100.5, 20.0)[0]


def test_nothing_is_asked_of_others(page: Page, served: Served) -> None:
    asked = page.driver.execute_script("return performance.getEntriesByType('resource').map((each) => each.name)")
    assert len(asked) > 5
    assert all(each.startswith(f"http://127.0.0.1:{served.port}/") for each in asked)


def test_light_and_dark_follow_the_system(page: Page) -> None:
    grounds = []
    for scheme in ("dark", "light"):
        features = [{"name": "prefers-color-scheme", "value": scheme}]
        page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": features})
        ground = page.find("body").value_of_css_property("background-color")
        grounds.append(sum(map(int, re.findall(r"\d+", ground)[:3])))
    assert grounds[0] < 120 < 600 < grounds[1]


def test_the_page_fits_its_window(page: Page) -> None:
    assert page.driver.execute_script(
        "const {scrollWidth, scrollHeight, clientWidth, clientHeight} = document.documentElement;"
        "return scrollWidth <= clientWidth && scrollHeight <= clientHeight"
    )


# ---- moving about


def test_doubtful_places_come_in_order_of_harm(page: Page) -> None:
    items = page.driver.find_elements(By.CSS_SELECTOR, "#doubts button")
    assert [each.text.split("\n")[-1].split()[-1] for each in items] == ["2.3", "0.48", "?"]
    for key, chosen, row in (("n", 0, 4065.0), ("n", 1, 1280.0), ("p", 0, 4065.0), ("p", 2, 5120.0)):
        page.type(key)
        page.until(lambda row=row: page.view["row"] == row)
        assert [each.get_attribute("aria-current") == "true" for each in items].index(True) == chosen
    items[0].click()
    page.until(lambda: page.view["row"] == 4065.0)
    height = page.find("#film").size["height"]
    assert 0.5 * height < (4230.0 - 3900.0) * page.view["zoom"] < height
    assert "Doubtful place 1 of 3, 12:00:22.5, trace 1-2: lost in a scratch, 2.3 mGal" in page.text("#message")


@pytest.mark.parametrize(
    ("words", "row"), [("12:00", 1200.0), ("12:00:05.25", 1830.0), ("row 77", 77.0), ("4000", 4000.0)]
)
def test_goes_to_a_time_or_a_row(page: Page, words: str, row: float) -> None:
    page.type("g", words, Keys.ENTER)
    page.until(lambda: page.view["row"] == pytest.approx(row, abs=0.01))
    assert f"row {row:.0f}" in page.text("#place")


def test_place_that_is_none_is_refused(page: Page) -> None:
    page.type("g", "noon", Keys.ENTER)
    assert "neither a time of this film nor a row" in page.text("#refusal")


def test_moves_by_mouse_wheel_and_keys(page: Page) -> None:
    before = page.view
    page.mouse((300.0, 60.0), (200.0, 60.0))
    page.until(lambda: page.view["row"] == pytest.approx(before["row"] + 100.0, abs=1.5))
    page.type(Keys.END)
    page.until(lambda: page.view["row"] == ROWS)
    page.type(Keys.HOME, Keys.PAGE_DOWN, Keys.ARROW_RIGHT)
    page.until(lambda: page.view["row"] > 300.0 and page.view["column"] > COLUMNS / 2)
    zoom = page.view["zoom"]
    ActionChains(page.driver, 0).scroll_from_origin(_over(page), 0, -300).perform()
    page.until(lambda: page.view["zoom"] > 1.2 * zoom)
    page.type("-", "-", "-", "-", "-", "-", "-", "-")
    page.until(lambda: page.view["zoom"] < 0.5 * zoom and page.view["waiting"] == 0)
    page.type("0")
    page.until(lambda: page.view["zoom"] == zoom)


def _over(page: Page) -> Any:
    from selenium.webdriver.common.actions.wheel_input import ScrollOrigin

    return ScrollOrigin.from_element(page.find("#film"))


# ---- edits by mouse


def test_mask_is_dragged(page: Page) -> None:
    page.find("#tool-mask").click()
    page.mouse((200.0, 250.0), (260.0, 400.0), (300.0, 450.0))
    (edit,) = page.edits(1)
    assert edit["kind"] == "mask"
    near(edit["points"][0], [200.0, 250.0])
    near(edit["points"][1], [300.0, 450.0])
    assert page.find("#tool-mask").get_attribute("aria-pressed") == "false"


def test_mask_of_corners_is_clicked(page: Page) -> None:
    corners = [(200.0, 250.0), (220.0, 400.0), (300.0, 330.0)]
    page.type("m")
    for corner in corners:
        page.mouse(corner)
    page.type(Keys.ENTER)
    near(
        [each for point in page.edits(1)[0]["points"] for each in point], [each for point in corners for each in point]
    )


def test_mark_is_moved_by_its_tick_and_back(page: Page) -> None:
    column = float(course(187.0, 2))
    page.mouse((187.0, column), (190.0, column), (199.0, column))
    gone, new = page.edits(2)
    assert (gone["kind"], gone["row"], gone["trace"]) == ("no-mark", 187.0, 2)
    assert (new["kind"], new["trace"]) == ("mark", 2)
    assert new["row"] == pytest.approx(199.0, abs=1.1)
    page.find("#undo").click()
    page.edits(0)
    page.type("r")
    page.edits(2)


def test_no_mark_takes_the_tick_at_hand(page: Page) -> None:
    page.type("x")
    page.mouse((185.0, float(course(187.0, 2)) + 3.0))
    edit = page.edits(1)[0]
    assert (edit["kind"], edit["row"], edit["trace"]) == ("no-mark", 187.0, 2)


def test_trace_is_ignored_where_rows_are_dragged(page: Page) -> None:
    page.type("2", "i")
    page.mouse((300.0, 300.0), (200.0, 310.0))
    edit = page.edits(1)[0]
    assert (edit["kind"], edit["trace"]) == ("ignore", 2)
    near([edit["first_row"], edit["last_row"]], [200.0, 300.0])


def test_whole_trace_is_ignored(page: Page) -> None:
    page.type("i")
    page.find("#whole").click()
    assert {key: page.edits(1)[0].get(key) for key in ("trace", "first_row")} == {"trace": 1, "first_row": None}


# ---- edits by keyboard alone


def test_line_is_drawn_by_keys(page: Page) -> None:
    start = page.view
    page.type("2", "d", Keys.ENTER)
    page.press(Keys.ARROW_DOWN, 20)
    page.press(Keys.ARROW_RIGHT, 5)
    page.type(Keys.ENTER)
    page.press(Keys.ARROW_DOWN, 1, Keys.SHIFT)
    page.type(Keys.ENTER, Keys.BACKSPACE)
    page.press(Keys.ARROW_LEFT, 10)
    page.type(Keys.ENTER, Keys.ENTER)
    (edit,) = page.edits(1)
    assert (edit["kind"], edit["trace"]) == ("follow", 2)
    steps = [(0, 0), (40, 10), (80, -10)]
    expected = [
        (start["row"] + down / start["zoom"], start["column"] + across / start["zoom"]) for down, across in steps
    ]
    assert edit["points"] == [pytest.approx(point, abs=0.11) for point in expected]


def test_mark_is_moved_by_keys(page: Page) -> None:
    page.type("g", "row 180", Keys.ENTER, "v")
    page.until(lambda: page.view["row"] == 180.0)
    away = float(course(180.0, 1)) - page.view["column"]
    page.press(Keys.ARROW_LEFT if away < 0 else Keys.ARROW_RIGHT, math.floor(abs(away) / 40), Keys.SHIFT)
    page.type(Keys.ENTER)
    page.until(lambda: "Mark on trace 1 taken" in page.text("#message"))
    page.press(Keys.ARROW_DOWN, 3)
    page.type(Keys.ENTER)
    assert [(each["kind"], each["row"]) for each in page.edits(2)] == [("no-mark", 180.0), ("mark", 186.0)]


def test_mark_bears_clock_time_note_and_name(page: Page) -> None:
    page.find("#who").send_keys("Ada", Keys.TAB)
    page.until(lambda: page.session.who == "Ada")
    page.type(Keys.ESCAPE, "k", "t", "12:00:01", Keys.TAB, "by the log", Keys.ENTER, Keys.ENTER)
    edit = page.edits(1)[0]
    assert {**edit, "row": 0, "at": ""} == {
        "kind": "mark", "row": 0, "trace": 1, "time": "12:00:01", "note": "by the log", "by": "Ada", "at": ""
    }  # fmt: skip
    listed = page.text("#edits")
    assert all(words in listed for words in ("mark 12:00:01", "by the log", "Ada, 1937-01-02 12:00"))


def test_break_undo_redo_by_keys(page: Page) -> None:
    page.type("b", Keys.ENTER)
    page.edits(1)
    for key, held, count in (("u", "", 0), ("r", "", 1), ("z", Keys.CONTROL, 0), ("y", Keys.CONTROL, 1)):
        page.press(key, 1, held)
        page.edits(count)


def test_escape_takes_points_then_the_tool(page: Page) -> None:
    page.type("m", Keys.ENTER, Keys.ESCAPE)
    assert page.find("#tool-mask").get_attribute("aria-pressed") == "true"
    page.type(Keys.ESCAPE)
    assert page.find("#tool-mask").get_attribute("aria-pressed") == "false"
    assert page.session.edits == []


def test_all_is_reached_by_tab_with_visible_focus(page: Page) -> None:
    reached, active = (
        [],
        "const e = document.activeElement; return [e.id || e.closest('[id]')?.id, getComputedStyle(e).outlineStyle]",
    )
    page.find("body").click()
    for _ in range(40):
        page.type(Keys.TAB)
        name, outline = page.driver.execute_script(active)
        if name is not None:
            assert outline != "none", name
        reached.append(name)
    wanted = {
        "csv",
        "help-button",
        "done",
        "tool-mask",
        "tool-ignore",
        "traces",
        "overlay",
        "film",
        "where",
        "doubts",
        "who",
    }
    assert wanted <= set(reached)


# ---- what comes of an edit


def test_gravity_is_told_politely(page: Page) -> None:
    page.type("b", Keys.ENTER)
    page.edits(1)
    assert page.find("#message").get_attribute("aria-live") == "polite"
    assert page.text("#message") == (
        "Break set. Gravity 9.8123425 m/s\u00b2 \u00b1 0.52 mGal, changed by \u22120.31 mGal"
    )
    assert page.text("#change") == "\u22120.31 mGal"


def test_better_gravity_is_told_when_it_is_there(page: Page) -> None:
    page.session.refining = True
    page.type("b", Keys.ENTER)
    page.until(lambda: page.text("#method") == "gravity by joint, being reduced anew")
    page.until(lambda: page.text("#message").endswith("being reduced anew\u2026"))
    page.session.refining, page.session.sigma = False, 0.49
    page.until(lambda: page.text("#method") == "gravity by joint")
    assert page.text("#sigma") == "\u00b1 0.49 mGal"
    assert page.text("#message").startswith("Reduced anew. Gravity 9.8123425")


def test_refusal_is_shown_whole_and_the_tool_kept(page: Page) -> None:
    page.type("k", "t", "25:99", Keys.ENTER, Keys.ENTER)
    page.until(lambda: page.find("#refusal").is_displayed())
    assert "edits[0]: the time '25:99' is no time; write it as '12:03:00'" in page.text("#refusal")
    assert page.find("#refusal").get_attribute("role") == "alert"
    page.type(Keys.ESCAPE)
    assert not page.find("#refusal").is_displayed()
    page.type("t", "12:00:01", Keys.ENTER, Keys.ENTER)
    assert page.edits(1)[0]["time"] == "12:00:01"


def test_film_may_be_moved_while_it_is_read_anew(page: Page) -> None:
    page.session.gate.clear()
    page.type("b", Keys.ENTER)
    page.until(lambda: page.find("#spinner").is_displayed())
    assert not page.find("#tool-mask").is_enabled()
    page.type(Keys.END, "m")
    page.until(lambda: page.view["row"] == ROWS and page.view["waiting"] == 0)
    assert page.find("#tool-mask").get_attribute("aria-pressed") == "false"
    page.session.gate.set()
    page.edits(1)
    assert page.find("#tool-mask").is_enabled()


def test_reading_without_gravity_says_why(page: Page, monkeypatch: pytest.MonkeyPatch) -> None:
    state = page.session.state()
    state["gravity"] |= {"value_m_s2": None, "sigma_mgal": None, "change_mgal": None, "refused": "one trace is left"}
    monkeypatch.setattr(page.session, "state", lambda: state | {"revision": 9, "doubtful": []})
    page.driver.execute_script("dispatchEvent(new Event('focus'))")  # asks for the state: what an edit brings is known
    page.until(lambda: page.text("#gravity") == "none")
    page.type("b", Keys.ENTER)
    page.until(lambda: page.text("#message").startswith("Break set. "))
    assert page.text("#gravity") == "none"
    assert page.text("#refused") == page.text("#message").removeprefix("Break set. ") == "No gravity: one trace is left"
    assert page.text("#doubts") == "None."


def test_readings_are_saved_as_a_table(page: Page, tmp_path: Path) -> None:
    behaviour = {"behavior": "allow", "downloadPath": str(tmp_path)}
    page.driver.execute_cdp_cmd("Browser.setDownloadBehavior", behaviour)
    page.find("#csv").click()
    table = tmp_path / "ship.readings.csv"
    page.until(table.exists)
    page.until(lambda: table.read_text() == page.session.csv())


def test_keys_are_listed(page: Page) -> None:
    page.type("?")
    assert all(key in page.text("#keys").split() for key in [*"mdkvxbiuronpgt0", "Enter", "Backspace", "Esc"])
    page.type(Keys.ESCAPE)
    page.until(lambda: not page.find("#help").is_displayed())


def test_done_ends_the_server(page: Page, served: Served) -> None:
    page.find("#done").click()
    page.until(lambda: "the edits are in /films/ship.edits.toml" in page.text("body"))
    served.thread.join(10)
    assert not served.thread.is_alive()
