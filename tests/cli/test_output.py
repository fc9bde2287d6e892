"""Standard output and standard error of any encoding, full, closed or with nobody to read them."""

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from outside import semrl

from semrl.cli.output import NOBODY_READS, complain, printing
from semrl.core.errors import SemrlWarning

PRINTING = [["--help"], ["--version"], ["doctor", "--help"], ["map", "--help"]]
UNBUFFERED = [{}, {"PYTHONUNBUFFERED": "1"}]


@pytest.mark.parametrize("argv", PRINTING)
@pytest.mark.parametrize("environ", UNBUFFERED)
def test_nobody_reads(argv, environ):
    reading, writing = os.pipe()
    os.close(reading)
    done = semrl(*argv, stdout=writing, **environ)
    os.close(writing)
    assert done.returncode in (0, NOBODY_READS) and done.stderr == b""


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
@pytest.mark.parametrize("argv", PRINTING)
@pytest.mark.parametrize("environ", UNBUFFERED)
def test_a_full_disk_is_one_line(argv, environ):
    with open("/dev/full", "wb") as full:  # noqa: PTH123
        done = semrl(*argv, stdout=full, **environ)
    assert done.returncode == 1
    assert done.stderr == b"semrl: cannot write the output: No space left on device\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no full device")
@pytest.mark.parametrize("environ", UNBUFFERED)
def test_what_goes_wrong_decides_the_status_even_where_it_cannot_be_said(environ):
    with open("/dev/full", "wb") as full:  # noqa: PTH123
        assert semrl("trian", stderr=full, **environ).returncode == 2
        assert semrl("--version", stderr=full, **environ).returncode == 0


@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&-"])
def test_closed_streams_are_no_failure(closed):
    code = "import sys; from semrl.cli import main; sys.exit(main(['--help']))"
    done = subprocess.run(
        ["sh", "-c", f'exec "$0" -c "{code}" {closed}', sys.executable], check=False, capture_output=True
    )
    assert done.returncode == 0 and done.stderr == b""


@pytest.mark.parametrize(
    "environ",
    [
        {"PYTHONIOENCODING": "ascii"},
        {"PYTHONIOENCODING": "latin-1"},
        {"PYTHONIOENCODING": "cp437:strict"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    ],
)
@pytest.mark.parametrize("argv", [["map", "RUN"], ["map", "--help"], ["map", "RUN/Ω→"]])
def test_any_encoding_will_do(environ, argv, map_run):
    done = semrl(*(word.replace("RUN", str(map_run)) for word in argv), **environ)
    assert b"Traceback" not in done.stderr and b"UnicodeEncodeError" not in done.stderr
    lacking = argv[-1].endswith("→")
    assert done.returncode == (2 if lacking else 0), done.stderr
    assert (b"there is no run at" in done.stderr) is lacking


def test_streams_get_back_what_they_did_with_characters_they_lack(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii", errors="strict")
    monkeypatch.setattr(sys, "stdout", stream)
    with printing():
        print("a → b")
    assert stream.buffer.getvalue() == b"a ? b\n" and stream.errors == "strict"


def test_an_error_that_names_a_file_is_one_line(capsys):
    with printing() as ended:
        Path("/dev/null/none").read_text()
    assert ended.status == 1 and capsys.readouterr().err == "semrl: /dev/null/none: Not a directory\n"


def test_warnings_are_one_line_each(capsys):
    import warnings

    with printing():
        for text in ("one\nwarning", "one\nwarning", "two"):
            warnings.warn(text, SemrlWarning, stacklevel=1)
    said = capsys.readouterr().err.splitlines()
    assert said == ["semrl: warning: one warning", "semrl: warning: one warning", "semrl: warning: two"]
    assert complain("a\n b", 2) == 2 and capsys.readouterr().err == "semrl: a b\n"
