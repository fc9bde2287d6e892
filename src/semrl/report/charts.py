"""The charts of a run: its learning curve, its paths to stability, and how far it sees ahead."""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
from markupsafe import Markup

from semrl.evaluation.statistics import Profile
from semrl.report.record import Series
from semrl.report.svg import STYLE, as_svg, label_axes, new_figure
from semrl.training.metrics import running_mean

RUN_COLOURS = ("#2f7fd8", "#d9822b", "#2c9c69", "#c9484b", "#8a63c9", "#1f9aa3", "#c2568f", "#8b8b2a")
"""A colour for each run, readable on white and on near-black; more runs begin again."""


FEW = 10
"""Points up to which each is marked: a line of one point is nothing to see."""

HEADROOM = 1.15
"""Of the axis above a goal, for its label."""


def learning_curve(runs: Sequence[tuple[str, Series, Series]], *, wide: bool) -> Markup:
    """Draw the return of each episode over decisions, and the running mean of the agent's, one colour a run.

    Parameters
    ----------
    runs
        Name of each, returns of the agent (dots) and of the planner (rings).
    wide
        For a desktop or for a phone.
    """
    with mpl.rc_context(STYLE):
        figure, axes = new_figure((700, 330) if wide else (360, 260))
        for i, (_, returns, planned) in enumerate(runs):
            colour = RUN_COLOURS[i % len(RUN_COLOURS)]
            axes.plot(planned.x, planned.y, "o", color=colour, alpha=0.5, markersize=4.5, fillstyle="none")
            axes.plot(returns.x, returns.y, "o", color=colour, alpha=0.5, markersize=5.5, markeredgewidth=0)
            axes.plot(returns.x, running_mean(returns.y), color=colour, linewidth=2)
        axes.set_xlim(left=0)
        label_axes(axes, "decisions", "return")
        runs_text = ", ".join(name for name, _, _ in runs)
        return as_svg(figure, f"Return of every episode and running mean of 10 over decisions: {runs_text}")


def stability_path(values: Series, *, goal: float, ylabel: str, title: str) -> Markup:
    """Draw the value of a stability test at each batch, with its goal as a line (Figs. 4.1 and 4.2)."""
    with mpl.rc_context(STYLE):
        figure, axes = new_figure((360, 240))
        axes.plot(
            values.x, values.y, "o-" if len(values) < FEW else "-", color=RUN_COLOURS[0], linewidth=1.6, markersize=5
        )
        axes.axhline(goal, color=RUN_COLOURS[3], linewidth=1.2, dashes=(4, 3))
        axes.annotate(
            f"goal {goal:g}", (0, goal), xycoords=("axes fraction", "data"), xytext=(4, 4),
            textcoords="offset points", ha="left", color=RUN_COLOURS[3], fontsize=11,
        )  # fmt: skip
        bottom, top = axes.get_ylim()
        axes.set_ylim(min(0, bottom), max(top, HEADROOM * goal))
        label_axes(axes, "batches", ylabel)
        return as_svg(figure, title)


def prediction_path(explained: Mapping[int, float], *, title: str) -> Markup:
    """Draw which share of the states' variance was predicted, by decisions ahead."""
    with mpl.rc_context(STYLE):
        figure, axes = new_figure((360, 240))
        axes.plot(list(explained), list(explained.values()), "o-", color=RUN_COLOURS[0], linewidth=1.6, markersize=5)
        axes.set_xlim(left=0)
        axes.set_ylim(min(0, *explained.values()), 1.05)
        label_axes(axes, "decisions ahead", "share predicted")
        return as_svg(figure, title)


def profile_chart(profiles: Mapping[str, Profile], *, colours: Sequence[str], xlabel: str, title: str) -> Markup:
    """Draw which share of each agent's runs scores more than a threshold, with its interval as a band."""
    with mpl.rc_context(STYLE):
        figure, axes = new_figure((360, 260))
        for profile, colour in zip(profiles.values(), colours, strict=True):
            axes.fill_between(
                profile.thresholds, profile.low, profile.high, step="post", color=colour, alpha=0.18, lw=0
            )
            axes.step(profile.thresholds, profile.share, where="post", color=colour, linewidth=1.8)
        axes.set_ylim(-0.02, 1.05)
        label_axes(axes, xlabel, "share of runs above", integer=False)
        return as_svg(figure, title)
