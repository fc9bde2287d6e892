"""The page in a real browser: it plays, pauses, steps, goes back, hands over the joystick; names are text."""

import contextlib
import shutil
import socket
import threading
import time
from dataclasses import replace

import pytest

from semrl.evaluation.player import load_player
from semrl.knowledge.edits import read_log
from semrl.watch.driver import Driver
from semrl.watch.session import WatchSession

uvicorn = pytest.importorskip("uvicorn", reason="the extra 'watch' is not installed")
serving = pytest.importorskip("semrl.watch.app", reason="the extra 'watch' is not installed", exc_type=ImportError)
webdriver = pytest.importorskip("selenium.webdriver", reason="selenium, which drives the browser, is not installed")
waiting = pytest.importorskip("selenium.webdriver.support.ui", reason="selenium is not installed")
ID, TAG, CSS = "id", "tag name", "css selector"

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
CHROMEDRIVER = shutil.which("chromedriver")
HOSTILE = "<img src=x onerror=\"document.title='taken'\"><script>document.title='taken'</script>"
SECONDS = 60

pytestmark = pytest.mark.skipif(
    not (CHROMIUM and CHROMEDRIVER),
    reason="there is no Chromium with its driver: apt-get install chromium chromium-driver",
)


@pytest.fixture(scope="module")
def browser():
    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM
    for argument in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--disable-gpu",
        "--window-size=1280,900",
    ):
        options.add_argument(argument)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    with webdriver.Chrome(options=options, service=webdriver.ChromeService(CHROMEDRIVER)) as browser:
        yield browser


@pytest.fixture
def folder(tracked_run, tmp_path):
    """A copy of a run, whose knowledge may be edited."""
    shutil.copytree(tracked_run, tmp_path / "run")
    return tmp_path / "run"


@pytest.fixture
def address(folder):
    """Serve a run with hostile names."""
    player = load_player(folder)
    names = tuple(f"{name}{HOSTILE}" for name in player.action_names)
    player = replace(player, world=replace(player.world, actions=names))
    with (
        contextlib.closing(WatchSession(player, f"run {HOSTILE}", folder=folder)) as session,
        socket.socket() as listening,
    ):
        listening.bind(("127.0.0.1", 0))
        listening.listen()  # whoever comes before the server is ready waits
        port = listening.getsockname()[1]
        app = serving.make_app(Driver(session), token="t0ken", port=port)
        server = uvicorn.Server(uvicorn.Config(app, log_level="error", timeout_graceful_shutdown=1))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [listening]})
        thread.start()
        try:
            yield f"http://127.0.0.1:{port}/t0ken/"
        finally:
            server.should_exit = True
            thread.join(SECONDS)


def waiter(browser):
    return lambda condition: waiting.WebDriverWait(browser, SECONDS, poll_frequency=0.05).until(lambda _: condition())


def press(browser, selector, key="\n"):
    """By key: what lies above may grow while a mouse is on its way, so that its click meets nothing."""
    browser.find_element(CSS, selector).send_keys(key)


def test_a_person_uses_the_page(browser, address):
    wait = waiter(browser)

    def text(name):
        return browser.find_element(ID, name).text

    def decision():
        return int(text("decision").split()[0].replace("–", "-1"))

    browser.get(address)
    wait(lambda: decision() > 3)  # it plays by itself
    press(browser, "#play")
    wait(lambda: text("play") == "Play")
    time.sleep(0.3)
    stood = decision()
    press(browser, "#back")
    wait(lambda: decision() == stood - 1 and text("moment-says") == "1 back")
    press(browser, "#step")
    wait(lambda: decision() == stood and text("moment-says") == "newest")
    browser.find_element(TAG, "body").send_keys(".")
    wait(lambda: decision() == stood + 1)

    for name in ("run", "action", "values", "keys"):
        assert "<img src=x" in browser.find_element(ID, name).get_attribute("textContent"), "names are shown as text"
    assert not browser.find_elements(TAG, "img") and browser.title != "taken"
    assert len(browser.find_elements(CSS, "#facts tr")) > 2
    assert browser.find_elements(CSS, "#rules li") and text("reason")
    learned = browser.find_element(ID, "learned").text
    assert "the reward" in learned or "if the action is" in learned
    assert (
        browser.execute_script(
            "const pixels = document.getElementById('screen').getContext('2d').getImageData(0, 0, 400, 300).data;"
            "return new Set(new Uint32Array(pixels.buffer)).size"
        )
        > 2
    ), "a game is drawn"

    unnamed = browser.execute_script(
        "return [...document.querySelectorAll('button, input, select, a, canvas')].filter((e) =>"
        "!(e.getAttribute('aria-label') || e.textContent.trim() || e.labels?.length)).map((e) => e.outerHTML)"
    )
    assert not unnamed, "everything that can be used has a name"

    press(browser, "#person", " ")
    wait(lambda: browser.find_element(ID, "keys").is_displayed())
    press(browser, "#step")
    wait(lambda: text("by") in ("person", "agent"))

    browser.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": 390, "height": 844, "deviceScaleFactor": 1, "mobile": True}
    )
    wait(lambda: browser.execute_script("return innerWidth") == 390)
    assert browser.execute_script("return document.documentElement.scrollWidth") <= 390, "nothing sticks out of a phone"
    browser.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert_quiet(browser)


def test_a_person_teaches_it(browser, address, folder):
    wait = waiter(browser)

    def text(name):
        return browser.find_element(ID, name).get_attribute("textContent")

    def shown(name):
        return browser.find_element(ID, name).is_displayed()

    def send(form, **typed):
        for name, value in typed.items():
            field = browser.find_element(ID, name)
            field.clear()
            field.send_keys(value)
        press(browser, f"#{form} button")

    browser.get(address)
    wait(lambda: text("play") == "Pause" and "autonomous" in text("words"))
    press(browser, "#play")
    wait(lambda: text("play") == "Play")
    send("goal-form", goal="thing.x < -50")
    wait(lambda: "cannot be had" in text("goal-problem"))
    assert shown("goal-problem") and not shown("goal-now")
    assert browser.find_element(ID, "goal").get_attribute("aria-invalid") is not None
    send("goal-form", goal=HOSTILE)
    wait(lambda: "malformed" in text("goal-problem"))
    assert "<img src=x" in text("goal-problem"), "what is typed is shown as text"
    send("goal-form", goal="always(true)")
    wait(lambda: shown("goal-now") and "Sought for" in text("goal-says") and not shown("goal-problem"))
    assert browser.find_element(ID, "policy").get_attribute("value") == "planner"
    press(browser, "#goal-drop")
    wait(lambda: not shown("goal-now"))

    send("class-form", **{"class-name": "High", "class-is": "thing.z < 3"})
    wait(lambda: "thing.z" in text("class-problem") or "number" in text("class-problem"))
    press(browser, "#class-forbidden", " ")
    send("class-form", **{"class-name": "High", "class-is": "thing.y < 60"})
    wait(lambda: "High thing.y < 60" in text("classes") and "forbidden" in text("classes"))
    wait(lambda: "High" in text("changed-says") and not shown("class-problem"))
    assert "forbidden class High" in text("edits")
    press(browser, "#classes input", " ")
    wait(lambda: "off" in browser.find_element(CSS, "#classes li > span").text)
    send("fact-form", fact="disjoint(thing, autonomous)")
    wait(lambda: "nothing could be of the class" in text("fact-problem"))
    for left in ("One edit stands", "Nothing was added"):
        press(browser, "#undo")
        wait(lambda left=left: left in text("edits-says"))
    assert [edit.do for edit in read_log(folder)] == ["add", "disable", "undo", "undo"]
    assert not browser.find_elements(TAG, "img") and browser.title != "taken"
    assert_quiet(browser)


def assert_quiet(browser):
    complaints = [entry["message"] for entry in browser.get_log("browser") if entry["level"] == "SEVERE"]
    assert not complaints, "no error, and nothing that the content policy had to refuse"
