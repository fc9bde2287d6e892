"""Doctor works where packages are missing, which is when it is called; other commands say which one and whom to ask."""

import json
import re
from importlib.metadata import requires

import pytest
from outside import semrl, without
from packaging.requirements import Requirement

from semrl.cli import doctor

NEEDED = [one.name for one in map(Requirement, requires("semrl")) if one.marker is None]


def module(package):
    return doctor.MODULES.get(package, package.replace("-", "_"))


def test_packages_that_are_imported_under_another_name_are_known():
    assert {"torch", "numba", "opencv-python-headless", "scikit-learn", "msgspec"} <= set(NEEDED)
    assert module("opencv-python-headless") == "cv2" and module("ale-py") == "ale_py"


@pytest.mark.parametrize("package", NEEDED)
def test_a_package_that_is_missing_is_told(package):
    """In a process where nothing else can be imported either, so that no command but doctor would begin."""
    every = without(*map(module, NEEDED))
    lies = f"import semrl.cli.doctor as d; d.requires = lambda _: ['{package}>=0.1', 'rich>=1']"
    done = semrl("doctor", "--json", before=f"{every}\n{lies}")
    told, err = json.loads(done.stdout), done.stderr.decode()
    assert done.returncode == 1 and [row["ok"] for row in told["packages"]] == [False, False]
    assert f"{package} (cannot be imported: {module(package)} is missing)" in err
    assert f"'{package}>=0.1'" in err and err.count("\n") == 1 and "Traceback" not in err


SLOW = pytest.mark.slow


@pytest.mark.parametrize(
    "names",
    [
        ("torch",),
        *(pytest.param(n, marks=SLOW) for n in (("rich", "tyro"), ("packaging",))),
        tuple(map(module, NEEDED)),
    ],
)
def test_people_are_told_how_to_get_it(names):
    done = semrl("doctor", before=without(*names))
    out, err = done.stdout.decode(), done.stderr.decode()
    assert done.returncode == 1 and err.startswith("semrl: semrl cannot work without ") and err.count("\n") == 1
    assert re.search(r"^To get what is missing: pip install --force-reinstall '", out, re.M)
    for name in names:
        assert f"(cannot be imported: {name} is missing)" in out


@pytest.mark.parametrize(
    ("argv", "package"),
    [
        (["map", "RUN"], "scipy"),
        (["train", "--help"], "tyro"),
        (["train", "--decisions", "2"], "torch"),
        (["train", "--decisions", "2"], "ale_py"),
        (["eval", "RUN"], "cv2"),
        (["compare", "RUN", "RUN"], "sklearn"),
        (["query", "RUN", "ASK {}"], "pyoxigraph"),
        (["report", "RUN"], "msgspec"),
        (["explain", "RUN", "--step", "1"], "numba"),
        (["bench"], "matplotlib"),
        (["reproduce", "method"], "rich"),
        (["predict", "RUN"], "numpy"),
    ],
)
def test_other_commands_name_the_package_and_doctor(argv, package, tmp_path):
    argv = [str(tmp_path / "run") if word == "RUN" else word for word in argv]
    done = semrl(*argv, before=without(package))
    said = f"semrl: the package {package} is missing; 'semrl doctor' says how to get what is needed\n"
    assert (done.returncode, done.stdout, done.stderr.decode()) == (1, b"", said)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("error", ["OSError('libGL.so.1: cannot open')", "ImportError('numpy.core is of another ABI')"])
def test_a_package_that_is_broken_is_told(error):
    broken = f"""
class Broken:
    def find_spec(self, name, path=None, target=None):
        if name == "cv2":
            raise {error}

sys.meta_path.insert(0, Broken())
import semrl.cli.doctor as d
d.requires = lambda _: ["opencv-python-headless>=4", "rich>=1"]
"""
    done = semrl("doctor", before=broken)
    assert done.returncode == 1 and b"opencv-python-headless (cannot be imported: " in done.stderr
    assert b"Traceback" not in done.stderr


@pytest.mark.parametrize(
    ("needed", "problems"),
    [
        (["numpy>=99", "torch>=1"], {"numpy": r".* is not >=99"}),
        (["no-such-thing>=2"], {"no-such-thing": "missing"}),
        (["no-such-thing[more]<3,>=2 ; extra == 'sb3'", "numpy"], {}),
        (["numpy~=99.0", "no-such-thing"], {"numpy": r".* is not ~=99.0", "no-such-thing": "missing"}),
    ],
)
def test_what_only_an_extra_needs_is_no_failure(call, monkeypatch, needed, problems):
    monkeypatch.setattr(doctor, "requires", lambda _: needed)
    result = call("doctor", "--json")
    rows = {row["package"]: row for row in json.loads(result.out)["packages"]}
    found = {name: row["problem"] for name, row in rows.items() if not row["ok"] and row["for"] == "semrl"}
    assert found.keys() == problems.keys()
    assert all(re.fullmatch(pattern, found[name]) for name, pattern in problems.items())
    assert result.status == bool(problems) and bool(result.err) == bool(problems)


def test_a_semrl_that_is_not_installed_is_told(call, monkeypatch):
    def none(_):
        raise doctor.PackageNotFoundError("semrl")

    monkeypatch.setattr(doctor, "requires", none)
    result = call("doctor")
    assert result.status == 1 and "pip install -e ." in result.message
