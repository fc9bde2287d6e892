import re
from dataclasses import replace

import numpy as np
import pytest

from semrl.core.errors import UsageError
from semrl_thesis.figures import Bars, Curve, Curves, Figure, Layers, Matrix, Network, Picture, Pictures, Scatter
from semrl_thesis.report import panels
from semrl_thesis.report.reproduction import write_reproduction
from semrl_thesis.results import Row, Section

TWO = np.array([0, 1])
CURVE = Curve(label="<p>", x=TWO, y=TWO)


def row(id_, thesis, ours, better="higher"):
    return Row(id=id_, thesis=thesis, ours=ours, unit="u", better=better)


def table(model, ours, suffix=""):
    thesis = {"mean": 13.6, "max": 20, "min": -10, "std": 9.6}
    return [
        row(f"table4.1/{model}/{name}{suffix}", thesis[name], value, "lower" if name == "std" else "higher")
        for name, value in zip(thesis, ours, strict=True)
    ]


FIGURE = Figure(
    number="4.5",
    title="A <title>",
    says="What it shows.",
    panels=(
        ("lines", Curves(xlabel="x", ylabel="y", curves=(CURVE, replace(CURVE, label="q")))),
        ("bars", Bars(xlabel="x", ylabel="y", labels=("p", "q"), heights=np.array([3, 400]), logarithmic=True)),
        ("points", Scatter(xlabel="x", ylabel="y", x=TWO, y=TWO, groups=TWO, weights=TWO + 1, line=(1.0, 0.0))),
        ("matrix", Matrix(labels=("-1", "+1"), values=np.array([[0.25, 0.75], [0, 1]]))),
        ("pictures", Pictures(pictures=(Picture(caption="<b>", image=np.zeros((8, 8), np.uint8)),))),
        ("map", Network(xlabel="x", ylabel="y", positions=np.eye(2), sources=TWO, targets=TWO, signs=-TWO)),
        ("layers", Layers(layers=(("input", "<i>"), ("output", "2 values")))),
    ),
)  # fmt: skip


def section(*rows, figures=(), notes=()):
    return Section(name="scores", title="Scores", place="§4.3", command="semrl reproduce scores --scale quick",
                   rows=tuple(rows), figures=figures, notes=notes)  # fmt: skip


@pytest.fixture
def page(tmp_path):
    def write(*sections, scale="full"):
        return write_reproduction(sections, tmp_path / "page.html", scale=scale).read_text()

    return write


def text_of(page):
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", page[page.index("<body>") :]))


def test_it_opens_with_table_41_ours_beside_the_thesis(page):
    written = page(
        section(*table("semantic", (15.0, 21.0, 3.0, 5.0)), *table("semantic", (9.0, 21.0, -8.0, 11.0), "@semrl"))
    )
    assert "semantic 13.6 ± 9.6 −10 … 20 15 ± 5 3 … 21 9 ± 11 −8 … 21" in text_of(written)
    assert "<b>15</b>" in written  # better than the thesis
    assert "<b>9</b>" not in written


def test_the_right_side_counts_as_better(page):
    rows = (
        row("a", 0.5, 0.6, "higher"),
        row("b", 0.5, 0.7, "lower"),
        row("c", 0.5, 0.8, "near"),
        row("d", 0.5, 0.4, "lower"),
    )
    assert set(re.findall(r"<b>([\d.]+)</b>", page(section(*rows)))) == {"0.6", "0.4"}


def test_what_nobody_knows_is_left_out(page):
    assert "nothing-known" not in page(section(row("nothing-known", None, None), row("known", 1, None)))


def test_it_needs_nothing_else_and_nothing_in_it_is_code(page):
    written = page(section(row("x", 1, 2), figures=(FIGURE,), notes=("mind <this>",)))
    assert not re.findall(r"(?:src|href)=\"(?!data:|#)[^\"]*", written)
    assert "url(http" not in written
    for word in ("<title>", "<p>", "<b>", "<i>", "<this>"):
        assert f"&lt;{word[1:-1]}&gt;" in written
    assert written.count("semrl reproduce scores --scale quick") >= 2  # at the section and at its figure
    assert "What it shows." in written


def test_a_small_budget_is_told(page):
    assert "reduced budget" in page(scale="quick")
    assert "reduced budget" not in page()


def test_lines_have_a_legend_where_there_are_several():
    assert [name for _, name in panels.legend(FIGURE.panels[0][1])] == ["<p>", "q"]
    assert panels.legend(FIGURE.panels[1][1]) == []


def test_a_page_that_cannot_be_written_is_told(tmp_path):
    with pytest.raises(UsageError, match="there is no folder"):
        write_reproduction([], tmp_path / "none" / "page.html", scale="full")


def test_where_table_41_is_not_known_the_page_does_not_open_with_it(page):
    text = page(section())
    assert "Scores" in text and 'class="table41"' not in text and "Table 4.1" not in text
