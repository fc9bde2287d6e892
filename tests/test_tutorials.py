"""The documentation's pages do what they say: every command and every line of Python on them runs, page after page."""

import doctest
import importlib
import sys
from pathlib import Path

import pytest
from pages_run import blocks, run_page

import semrl
from semrl.core import registry

ROOT = Path(__file__).parents[1]
DOCS = ROOT / "docs"
START = DOCS / "start.md"
TUTORIALS = sorted((DOCS / "tutorials").glob("*.md"))
HOW_TO = sorted((DOCS / "howto").glob("*.md"))
PAGES = [*TUTORIALS, *HOW_TO]
SOURCES = [path for path in sorted((ROOT / "src").rglob("*.py")) if ">>> " in path.read_text(encoding="utf-8")]
MODULES = [".".join(path.relative_to(ROOT / "src").with_suffix("").parts) for path in SOURCES]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where a reader works: what the page Start leaves behind."""
    path = tmp_path_factory.mktemp("reader")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(path)
        patch.setattr(sys, "path", list(sys.path))
        printed = run_page(START, path)
        assert all(printed), "a block of Start prints nothing"
        yield path
    registry._added.cache_clear()


def test_start_leaves_what_the_other_pages_need(folder):
    assert (folder / "runs" / "catch" / "metrics.csv").stat().st_size > 0
    assert (folder / "why.html").stat().st_size > 0 and (folder / "catch.mp4").stat().st_size > 0


@pytest.mark.parametrize("page", PAGES, ids=[page.stem for page in PAGES])
def test_page_runs(folder, page):
    printed = run_page(page, folder)
    assert len(printed) == len(blocks(page))
    if page in TUTORIALS:
        assert any(text.strip() for text in printed)


@pytest.mark.parametrize("page", [START, *PAGES], ids=lambda page: page.stem)
def test_page_opens_with_what_one_has_at_the_end_and_how_long_it_takes(page):
    opening = page.read_text(encoding="utf-8").split("\n\n")[1]
    assert "**At the end you have**" in opening and "**It takes**" in opening


@pytest.mark.parametrize("module", MODULES)
def test_examples_in_docstrings_are_true(folder, module):
    result = doctest.testmod(importlib.import_module(module))
    assert result.attempted and not result.failed


def test_every_public_name_has_an_example():
    for name in semrl.__all__:
        assert ">>> " in (getattr(semrl, name).__doc__ or ""), name
