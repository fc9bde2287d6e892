"""How fluent the live page is: frames that a browser shows in a second, and what that costs; and pictures of the page.

`semrl watch` plays a run as it does for a person, headless Chromium shows the page, without a GPU. Counted are the
pictures of the game that the page draws, and the decisions that are played; cores are processor seconds in a second, of
`semrl watch`, of all processes of the browser, and of all others, which tell how busy the machine is otherwise. It runs
on Linux, with `chromium` and `chromedriver`.

    python benchmarks/watch.py RUN [--speeds 1 20] [--seconds N] [--policy planner] [--pictures FOLDER] [--json]
"""

import base64
import contextlib
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import machine
import tyro
from rich.console import Console
from rich.table import Table
from selenium import webdriver
from selenium.webdriver.support.ui import WebDriverWait

from semrl.core.files import write_atomic

COUNTING = """
window.drawn = 0;
const draw = CanvasRenderingContext2D.prototype.drawImage;
CanvasRenderingContext2D.prototype.drawImage = function (...rest) {
  window.drawn += this.canvas.id === "screen";
  return draw.apply(this, rest);
};
"""
SIZES = {"desk": (1280, 900), "tablet": (768, 1024), "phone": (390, 844)}
"""Names of pictures, and how wide and high the window is."""
TALLEST_PX = 2000
LOADING_SECONDS = 120
TICKS = os.sysconf("SC_CLK_TCK")


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """What is measured."""

    run: tyro.conf.Positional[Path]
    """Folder of the run; with --pictures, a copy of it that may be edited."""
    speeds: tuple[float, ...] = (1.0, 20.0)
    """As multiples of the game's own."""
    seconds: float = 10.0
    """At each speed."""
    policy: str = "planner"
    """Who decides."""
    pictures: Path | None = None
    """Also show the page in light and dark at three widths, with a goal and a class, and save that here."""
    json: bool = False
    """Print one JSON object."""


def main(arguments: Arguments) -> None:
    """Measure, tell, take pictures."""
    with _watching(arguments) as (process, address), _browsing() as browser:
        browser.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument", {"source": COUNTING})
        browser.get(address)
        _until(browser, "return window.drawn > 5")
        rows = [_measured(arguments, browser, process.pid, speed) for speed in arguments.speeds]
        if arguments.pictures:
            _take_pictures(browser, arguments.pictures)
    kind = machine.describe()
    if arguments.json:
        print(json.dumps({"machine": kind, "rows": rows}))
        return
    columns = ("speed", "frames a second", "decisions a second", "semrl, cores", "browser, cores", "others, cores")
    table = Table(*columns, box=None)
    for row in rows:
        table.add_row(
            f"{row['speed']:g}", f"{row['frames_per_second']:.1f}", f"{row['decisions_per_second']:.1f}",
            f"{row['semrl_cores']:.2f}", f"{row['browser_cores']:.2f}", f"{row['other_cores']:.2f}",
        )  # fmt: skip
    console = Console()
    console.print(table)
    console.print(machine.sentence(kind), highlight=False)


@contextlib.contextmanager
def _watching(arguments: Arguments) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Start ``semrl watch``; give its process and its address."""
    command = [sys.executable, "-m", "semrl", "watch", str(arguments.run), "--no-browser", "--policy", arguments.policy]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        if not address:
            sys.exit("semrl watch did not start")
        try:
            yield process, address
        finally:
            process.terminate()


@contextlib.contextmanager
def _browsing() -> Iterator[webdriver.Chrome]:
    """Start a browser without a window."""
    driver = shutil.which("chromedriver")
    chromium = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if not (driver and chromium):
        sys.exit("there is no Chromium with its driver: apt-get install chromium chromium-driver")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for option in (
        "--headless=new",
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--disable-gpu",
        "--window-size=1280,900",
    ):
        options.add_argument(option)
    with webdriver.Chrome(options=options, service=webdriver.ChromeService(driver)) as browser:
        yield browser


def _measured(arguments: Arguments, browser: webdriver.Chrome, pid: int, speed: float) -> dict[str, Any]:
    """Play at a speed and count; the first second does not count."""
    _slide(browser, speed)
    _until(browser, f"return Math.abs(parseFloat(document.getElementById('speed-says').textContent) - {speed}) < 0.01")
    if browser.execute_script("return document.getElementById('play').textContent") == "Play":
        browser.find_element("id", "play").click()
    time.sleep(1)
    before, began = _counted(browser, pid), time.monotonic()
    time.sleep(arguments.seconds)
    after, took = _counted(browser, pid), time.monotonic() - began
    frames, decisions, ours, theirs, all_ = ((new - old) / took for new, old in zip(after, before, strict=True))
    return {
        "speed": speed, "frames_per_second": frames, "decisions_per_second": decisions, "semrl_cores": ours,
        "browser_cores": theirs, "other_cores": all_ - ours - theirs,
        "seconds": took, "policy": arguments.policy, "run": arguments.run.name,
    }  # fmt: skip


def _slide(browser: webdriver.Chrome, speed: float) -> None:
    browser.execute_script(
        "const slider = document.getElementById('speed'); slider.value = Math.log10(arguments[0]);"
        "slider.dispatchEvent(new Event('input'));",
        speed,
    )


def _counted(browser: webdriver.Chrome, pid: int) -> tuple[float, float, float, float, float]:
    """Return pictures drawn, the newest moment, and processor seconds of semrl, of the browser, of all that runs."""
    drawn, newest = browser.execute_script("return [window.drawn, Number(document.getElementById('moment').max)]")
    service = browser.service.process
    browsers = sum(_seconds(one) for one in _family(service.pid))
    busy = [int(ticks) / TICKS for ticks in Path("/proc/stat").read_text().split("\n", 1)[0].split()[1:]]
    return float(drawn), float(newest), _seconds(pid), browsers, sum(busy[:3]) + sum(busy[5:7])


def _family(pid: int) -> list[int]:
    """Return a process and all below it."""
    parents = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                parents[int(entry.name)] = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
    found = [pid]
    for one in found:
        found += [child for child, parent in parents.items() if parent == one]
    return found


def _seconds(pid: int) -> float:
    """Return the processor seconds of a process; 0 where it has ended."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / TICKS


def _take_pictures(browser: webdriver.Chrome, folder: Path) -> None:
    """Type a class and a goal, let it play a little, and save the page in both schemes and all sizes."""
    folder.mkdir(parents=True, exist_ok=True)
    _slide(browser, 1)
    words = browser.execute_script("return document.getElementById('goal').placeholder")
    for name, text in (("class-name", "Nearby"), ("class-is", words), ("goal", f"always({words})")):
        browser.find_element("id", name).send_keys(text)
    browser.find_element("css selector", "#class-form button").click()
    _until(browser, "return document.querySelectorAll('#edits li').length > 0")
    browser.find_element("css selector", "#goal-form button").click()
    time.sleep(3)
    browser.find_element("id", "play").click()
    _until(browser, "return document.getElementById('play').textContent === 'Play'")
    for scheme in ("light", "dark"):
        feature = {"name": "prefers-color-scheme", "value": scheme}
        browser.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": [feature]})
        for name, (width, height) in SIZES.items():
            size = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": name == "phone"}
            browser.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", size)
            time.sleep(1)
            taken = browser.execute_cdp_cmd(
                "Page.captureScreenshot", {"captureBeyondViewport": True, "clip": _whole(browser)}
            )
            data = base64.b64decode(taken["data"])
            write_atomic(folder / f"watch-{name}-{scheme}.png", lambda file, data=data: file.write(data))


def _whole(browser: webdriver.Chrome) -> dict[str, float]:
    """Return where the page is, down to its end or to the goal and what it knows."""
    width, height = browser.execute_script("return [innerWidth, document.documentElement.scrollHeight]")
    return {"x": 0, "y": 0, "width": width, "height": min(height, TALLEST_PX), "scale": 1}


def _until(browser: webdriver.Chrome, script: str) -> None:
    WebDriverWait(browser, LOADING_SECONDS, poll_frequency=0.05).until(lambda _: browser.execute_script(script))


if __name__ == "__main__":
    main(tyro.cli(Arguments, description=__doc__))
