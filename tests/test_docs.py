"""The documentation speaks of what is there: symbols exist, defaults are true, nothing is left out."""

import ast
import dataclasses
import importlib
import re
from functools import cache
from pathlib import Path

import pytest

from semrl import __version__
from semrl.cli.main import COMMANDS
from semrl.training import RunConfig, preset

ROOT = Path(__file__).parents[1]
THESIS = (ROOT / "docs" / "thesis.md").read_text()
README = ROOT / "README.md"

SYMBOLS = sorted(set(re.findall(r"`(semrl\.[\w.]+)`", THESIS)))
LAST_FIGURE = {1: 1, 2: 9, 3: 9, 4: 20}  # of each chapter


@cache
def resolve(symbol):
    """Return (owner, name, value) of a dotted name; value is None for a field without one on the class."""
    parts = symbol.split(".")
    for cut in range(len(parts), 0, -1):
        try:
            owner = importlib.import_module(".".join(parts[:cut]))
            break
        except ModuleNotFoundError:
            continue
    value, name = owner, ""
    for name in parts[cut:]:
        owner = value
        fields = {field.name for field in dataclasses.fields(owner)} if dataclasses.is_dataclass(owner) else ()
        value = getattr(owner, name, None) if name in fields else getattr(owner, name)
    return owner, name, value


def default(symbol):
    """Return the default of a dataclass field, or the value of a constant."""
    owner, name, value = resolve(symbol)
    if dataclasses.is_dataclass(owner):
        field = next(field for field in dataclasses.fields(owner) if field.name == name)
        return field.default if field.default_factory is dataclasses.MISSING else field.default_factory()
    return value


def parameters():
    """Yield (symbol, thesis's cell, default's cell) of each row of the tables that have defaults."""
    columns = []
    for line in THESIS.splitlines():
        if not line.startswith("|"):
            columns = []
            continue
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if not columns:
            columns = cells
        elif "Default" in columns and not set(line) <= set("|-"):
            row = dict(zip(columns, cells, strict=True))
            yield row["Symbol"].strip("`"), row.get("Thesis", ""), row["Default"]


def literal(cell):
    """Return the value of a cell that begins with a Python literal in backticks."""
    return ast.literal_eval(re.match(r"`([^`]+)`", cell).group(1))


PARAMETERS = list(parameters())


def leaves(kind):
    """Yield (class, field) of every setting in a tree of dataclasses."""
    for field in dataclasses.fields(kind):
        inner = field.default_factory if dataclasses.is_dataclass(field.default_factory) else None
        if inner:
            yield from leaves(inner)
        else:
            yield kind, field.name


@pytest.mark.parametrize("symbol", SYMBOLS)
def test_symbol_exists(symbol):
    assert resolve(symbol)


def test_a_wrong_symbol_would_be_noticed():
    for symbol in ("semrl.agents.DQNConfig.momentum", "semrl.nothing.Here", "semrl.agents.DQN.updates_made"):
        with pytest.raises(AttributeError):
            resolve(symbol)


@pytest.mark.parametrize(("symbol", "thesis", "cell"), PARAMETERS, ids=[row[0] for row in PARAMETERS])
def test_default_is_the_one_in_the_table(symbol, thesis, cell):
    assert default(symbol) == literal(cell)
    if thesis.startswith("`"):
        assert literal(cell) == literal(thesis), "a default that is not the thesis's"


def test_every_setting_of_a_run_is_documented():
    documented = {resolve(symbol)[:2] for symbol, _, _ in PARAMETERS}
    missing = [f"{kind.__name__}.{name}" for kind, name in leaves(RunConfig) if (kind, name) not in documented]
    assert not missing, f"add to the tables of docs/thesis.md: {missing}"


def test_preset_thesis_changes_nothing():
    assert preset("thesis") == RunConfig()


def test_every_figure_has_its_place():
    named = set()
    for text in re.findall(r"Figs?\. ((?:\d\.\d+(?: – | and |, )?)+)", THESIS):
        numbers = [tuple(map(int, number.split("."))) for number in re.findall(r"\d\.\d+", text)]
        if "–" in text:
            (chapter, first), (_, last) = numbers
            numbers = [(chapter, i) for i in range(first, last + 1)]
        named.update(numbers)
    figures = {(chapter, i) for chapter, last in LAST_FIGURE.items() for i in range(1, last + 1)}
    assert named == figures


def test_deviations_are_numbered_and_every_reference_has_one():
    head, body = THESIS.split("## Deviations")
    numbers = [int(number) for number in re.findall(r"^- \*\*D(\d+)\.", body, re.MULTILINE)]
    assert numbers == list(range(1, len(numbers) + 1))
    assert {int(number) for number in re.findall(r"\bD(\d+)\b", head)} <= set(numbers)


@pytest.mark.skipif(not README.exists(), reason="there is no README.md yet")
@pytest.mark.parametrize("command", COMMANDS)
def test_readme_mentions_command(command):
    assert f"semrl {command}" in README.read_text() + (ROOT / "docs" / "guide.md").read_text()


def test_the_citation_names_this_version():
    text = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert re.search(r"^version: (.+)$", text, re.MULTILINE).group(1) == __version__


def test_every_page_is_in_the_table_of_contents():
    docs = ROOT / "docs"
    listed = set(re.findall(r"^(?:.* <)?([\w/-]+)>?$", (docs / "index.md").read_text(encoding="utf-8"), re.MULTILINE))
    pages = {path.relative_to(docs).with_suffix("").as_posix() for path in docs.rglob("*.md")} - {"index"}
    assert pages <= listed, f"add to docs/index.md: {sorted(pages - listed)}"


def test_links_between_pages_lead_somewhere():
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
    links = [(page, link) for page in pages for link in re.findall(r"\]\(([^)#\s]+)", page.read_text(encoding="utf-8"))]
    lost = [f"{page.name}: {link}" for page, link in links if "://" not in link and not (page.parent / link).exists()]
    assert len(links) > 50 and not lost, lost
