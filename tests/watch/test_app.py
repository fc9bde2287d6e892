"""The server: only who has the address is let in, and what is wrong is said in one line."""

import json
import struct
import time

import pytest

pytest.importorskip("starlette", reason="the extra 'watch' is not installed")
pytest.importorskip("httpx", reason="httpx, which asks the application, is not installed")

from starlette.testclient import TestClient
from starlette.websockets import WebSocketDisconnect

from semrl.watch.app import make_app
from semrl.watch.driver import Driver

PORT, TOKEN = 8123, "t0ken"
HERE = f"http://127.0.0.1:{PORT}"
SOCKET = f"ws://127.0.0.1:{PORT}"
LIVE = f"{SOCKET}/{TOKEN}/live"


@pytest.fixture
def driver(session):
    return Driver(session)


@pytest.fixture
def client(driver):
    with TestClient(make_app(driver, token=TOKEN, port=PORT), base_url=HERE) as client:
        yield client


def read(message):
    """Return what a binary message holds: an object and a picture."""
    (length,) = struct.unpack(">I", message[:4])
    return json.loads(message[4 : 4 + length]), message[4 + length :]


def until(live, wanted):
    """Return the first moment that is as wanted."""
    for _ in range(200):
        message = live.receive()
        if message.get("bytes"):
            told, _ = read(message["bytes"])
            if told["type"] == "moment" and wanted(told):
                return told
    raise AssertionError("it did not come")


def problem(live):
    while "text" not in (message := live.receive()) or not message["text"]:
        pass
    told = json.loads(message["text"])
    assert told["type"] == "problem"
    return told["text"]


@pytest.mark.parametrize(
    "path", ["/", "/live", "/static/watch.js", "/wrong/", f"/{TOKEN}x/", f"/x/{TOKEN}/", "/explanation.html"]
)
def test_nothing_is_told_without_the_token(client, path):
    answer = client.get(path)
    assert answer.status_code == 403 and "needed, whole" in answer.text


@pytest.mark.parametrize(
    "headers", [{"host": f"evil.example:{PORT}"}, {"host": "127.0.0.1:1"}, {"origin": "http://evil.example"}]
)
def test_other_hosts_and_origins_are_refused(client, headers):
    assert client.get(f"/{TOKEN}/", headers=headers).status_code == 403
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(LIVE, headers=headers):
        pass


def test_a_web_socket_needs_the_token(client):
    with pytest.raises(WebSocketDisconnect), client.websocket_connect(f"{SOCKET}/live"):
        pass


@pytest.mark.parametrize(
    "path",
    ["", "static/watch.js", "static/watch.css", "static/drawing.js", "static/page.js", "static/teaching.js", "nothing"],
)
def test_every_answer_has_the_headers(client, path):
    answer = client.get(f"/{TOKEN}/{path}")
    assert answer.status_code == (404 if path == "nothing" else 200)
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy and "unsafe" not in policy and "http" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["referrer-policy"] == "no-referrer"
    assert "<script>" not in answer.text and "style=" not in answer.text and "innerHTML" not in answer.text


def test_a_page_is_told_all_and_obeyed(client, session):
    with client.websocket_connect(LIVE) as live:
        about = json.loads(live.receive_text())
        assert about["type"] == "about" and about["actions"] == list(session.player.action_names)
        told, picture = read(live.receive_bytes())
        assert told["number"] == 0 and not told["playing"] and picture.startswith(b"\x89PNG")
        live.send_json({"do": "step"})
        assert until(live, lambda m: m["number"] == 1)["decision"] == 1
        live.send_json({"do": "back"})
        until(live, lambda m: m["number"] == 0 and m["newest"] == 1)
        live.send_json({"do": "speed", "value": 20})
        live.send_json({"do": "play"})
        until(live, lambda m: m["playing"] and m["number"] > 5)
        live.send_json({"do": "pause"})
        still = until(live, lambda m: not m["playing"])
        live.send_json({"do": "show", "value": 2})
        assert until(live, lambda m: m["number"] == 2)["newest"] == still["number"]
        live.send_json({"do": "policy", "value": "planner"})
        until(live, lambda m: m["policy"] == "planner")


@pytest.mark.parametrize(
    ("message", "said"),
    [
        ('{"do": "explode"}', "unknown command 'explode'; there are play, pause, step"),
        ('{"do": ["play"]}', "unknown command"),
        ("{}", "unknown command None"),
        ("[]", "JSON object"),
        ("not json", "JSON object"),
        ('{"do": "%s"}' % ("x" * 5000), "JSON object"),
        ('{"do": "speed", "value": 0.01}', "from 0.1 to 20"),
        ('{"do": "speed", "value": NaN}', "from 0.1 to 20"),
        ('{"do": "speed", "value": "fast"}', "from 0.1 to 20"),
        ('{"do": "policy", "value": "chance"}', "agent or the planner"),
        ('{"do": "show", "value": "x"}', "by its number"),
        ('{"do": "hold", "value": [1]}', "list of their names"),
        ('{"do": "goal", "value": 3}', "a goal is a text"),
        ('{"do": "goal", "value": "nowhere"}', "there is no class 'nowhere'"),
        ('{"do": "edit", "value": "x"}', "give a class"),
        ('{"do": "edit", "value": {"fact": "x"}}', "assert disjoint"),
    ],
)
def test_a_wrong_command_has_one_clear_answer_and_changes_nothing(client, message, said):
    with client.websocket_connect(LIVE) as live:
        live.receive_text()
        live.send_text(message)
        told = problem(live)
        assert said in told and "\n" not in told
        live.send_json({"do": "step"})
        assert until(live, lambda m: m["number"] == 1)["speed"] == 1


def test_the_moment_is_saved_as_page_and_film(client):
    page = client.get(f"/{TOKEN}/explanation.html")
    assert page.status_code == 200 and "Why " in page.text
    assert "attachment" in page.headers["content-disposition"] and "sandbox" in page.headers["content-security-policy"]
    film = client.get(f"/{TOKEN}/moment.gif")
    assert film.headers["content-type"] == "image/gif" and film.content.startswith(b"GIF")
    assert client.get(f"/{TOKEN}/moment.exe").status_code == 404


def test_what_cannot_be_explained_is_said(client, session):
    session.person, session.held = True, session.keys[0] or session.keys[1]
    answer = client.get(f"/{TOKEN}/explanation.html")
    assert answer.status_code == 409 and answer.text.count("\n") == 1 and "a person took" in answer.text


@pytest.mark.parametrize("speed", [2.0, 10.0])
def test_it_keeps_time(driver, speed):
    driver.start()
    driver.obey("speed", speed).result()
    driver.obey("play").result()
    before, began = driver.do(lambda: driver.session.kept[1]).result(), time.monotonic()
    time.sleep(0.8)
    after = driver.do(lambda: driver.session.kept[1]).result()
    wanted = driver.per_second * speed * (time.monotonic() - began)
    driver.stop()
    assert after - before <= wanted + 2
    assert after - before >= min(wanted, 20) / 4, "it hardly moved"


def test_slow_play_shows_what_was_between_decisions(client, driver):
    with client.websocket_connect(LIVE) as live:
        live.receive_text()
        live.send_json({"do": "speed", "value": 0.5})
        live.send_json({"do": "play"})
        kinds, began = [], time.monotonic()
        while kinds.count("moment") < 6 and time.monotonic() - began < 20:
            message = live.receive()
            if message.get("bytes"):
                told, picture = read(message["bytes"])
                kinds.append(told["type"])
                assert picture.startswith(b"\x89PNG")
        live.send_json({"do": "pause"})
        until(live, lambda m: not m["playing"])
    assert "between" in kinds and kinds.count("moment") == 6


def test_work_that_fails_unforeseen_fails_for_who_waits_and_nobody_else(driver):
    def fill_the_disk():
        raise OSError("no space left on device")

    waiting = driver.do(lambda: time.sleep(0.2))
    given_up = driver.do(lambda: 1)
    assert given_up.cancel()
    driver.start()
    with pytest.raises(OSError, match="no space left"):
        driver.do(fill_the_disk).result(timeout=30)
    assert driver.do(lambda: 2).result(timeout=30) == 2 and waiting.done()
    driver.stop()
