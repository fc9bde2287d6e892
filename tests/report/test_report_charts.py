import re

import numpy as np
import pytest

from semrl.report.charts import learning_curve, stability_path
from semrl.report.record import Series
from semrl.report.wording import duration, number
from semrl.training.metrics import running_mean


def series(*values):
    return Series(x=np.arange(1.0, len(values) + 1), y=np.array(values, dtype=float))


def test_running_mean_is_the_mean_of_what_is_there():
    values = np.random.default_rng(0).normal(size=25)
    expected = [values[max(0, i - 9) : i + 1].mean() for i in range(25)]
    assert running_mean(values) == pytest.approx(expected)
    assert len(running_mean(values[:0])) == 0


def test_charts_take_their_colours_and_font_from_the_page():
    chart = learning_curve([("a", series(1, 2, 3), series()), ("b", series(3, 2), series(1))], wide=True)
    assert "var(--chart-ink)" in chart and "var(--chart-line)" in chart
    assert "DejaVu" not in chart and "<style" not in chart and "<metadata" not in chart
    assert "#010203" not in chart


def test_every_run_has_its_line():
    returns = {"a": series(1, 2, 3), "b": series(3, 2, 2), "c": series(0, 1, 1)}
    chart = learning_curve([(name, its, series()) for name, its in returns.items()], wide=False)
    assert len(set(re.findall(r"stroke: (#\w{6}); stroke-width: 2", chart))) == 3


def test_the_goal_is_a_line_with_its_number():
    chart = stability_path(series(0.4, 0.2, 0.04), goal=0.05, ylabel="difference", title='"<PCA>"')
    assert "goal 0.05" in chart and "stroke-dasharray" in chart
    assert 'aria-label="&#34;&lt;PCA&gt;&#34;"' in chart


def test_charts_on_one_page_keep_their_ids_apart():
    first, second = (learning_curve([("a", series(*values), series())], wide=True) for values in ((1, 2), (1, 3)))
    ids = [set(re.findall(r'id="([^"]+)"', chart)) for chart in (first, second)]
    assert ids[0] and not ids[0] & ids[1]
    for chart, known in zip((first, second), ids, strict=True):
        assert set(re.findall(r'url\(#([^)]+)\)|href="#([^"]+)"', chart)) <= {
            pair for name in known for pair in ((name, ""), ("", name))
        }


@pytest.mark.parametrize(
    ("value", "text"), [(-20.95, "−20.9"), (3.0, "3"), (12345, "12,345"), (-0.01, "0"), (100, "100")]
)
def test_numbers_are_written_for_people(value, text):
    assert number(value) == text


def test_durations_have_the_unit_that_fits():
    assert [duration(s) for s in (0.4, 45, 600, 7200, 200_000)] == [
        "0 seconds", "45 seconds", "10 minutes", "2 hours", "2.3 days",
    ]  # fmt: skip


def test_numbers_at_the_axes_are_not_cut_off():
    chart = stability_path(series(0.025, 0.125, 0.075), goal=0.1, ylabel="y", title="t")
    assert {"0.025", "0.075", "0.125"} <= set(re.findall(r">([\d.]+)</text>", chart))
