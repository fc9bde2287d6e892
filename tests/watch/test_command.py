"""`semrl watch` as a person calls it: the first line is the address, and Ctrl-C is a good end."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path

import pytest

pytest.importorskip("starlette", reason="the extra 'watch' is not installed")
pytest.importorskip("uvicorn", reason="the extra 'watch' is not installed")

MAKEFILE = Path(__file__).parents[2] / "Makefile"


def status_of(address):
    try:
        with urllib.request.urlopen(address, timeout=60) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


@pytest.mark.skipif(os.name == "nt", reason="there is no SIGINT to send on Windows")
def test_the_first_line_is_the_address_and_it_ends_well(tracked_run):
    command = [sys.executable, "-m", "semrl", "watch", str(tracked_run), "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            address = process.stdout.readline().strip()
            assert address.startswith("http://127.0.0.1:") and address.endswith("/"), process.stderr.read()
            assert status_of(address) == 200
            host, token = address.rstrip("/").rsplit("/", 1)
            assert len(token) >= 32
            assert status_of(f"{host}/") == status_of(f"{host}/{token[:-1]}/") == 403
            process.send_signal(signal.SIGINT)
            out, error = process.communicate(timeout=60)
        finally:
            process.kill()
    assert (process.returncode, out, error) == (0, "", "")


def test_a_port_that_is_taken_is_one_line(call, tracked_run):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        told = call("watch", tracked_run, "--port", port, "--no-browser")
    assert told.status == 2 and f"port {port}" in told.message


@pytest.mark.parametrize(
    ("words", "said"),
    [(("--port", "99999"), "port 99999"), (("--episode", "-1"), "0 or more"), (("--seed", "-5"), "0 or more")],
)
def test_wrong_calls_are_one_line(call, tracked_run, words, said):
    told = call("watch", tracked_run, "--no-browser", *words)
    assert told.status == 2 and said in told.message


def test_a_missing_extra_is_one_line(call, tracked_run, monkeypatch):
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    told = call("watch", tracked_run, "--no-browser")
    assert told.status == 2 and "extra 'watch'" in told.message and "pip install" in told.message


@pytest.mark.skipif(not (MAKEFILE.exists() and shutil.which("make")), reason="there is no make, or no Makefile")
def test_the_demo_ends_with_an_offer_to_watch_its_run():
    told = subprocess.run(
        ["make", "-n", "--no-print-directory", "-o", "install", "demo", "RUN=runs/x y"],
        cwd=MAKEFILE.parent,
        env={name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))},
        capture_output=True,
        text=True,
        check=True,
    )
    assert told.stdout.splitlines()[-1].startswith("echo ") and "semrl watch runs/x y" in told.stdout.splitlines()[-1]


def test_there_must_be_a_run(call, tmp_path):
    told = call("watch", tmp_path / "nothing", "--no-browser")
    assert told.status == 2 and "nothing" in told.message
