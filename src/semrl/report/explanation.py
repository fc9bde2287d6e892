"""The page about one decision: what was seen, where that is on the map, what might come, what was done and why."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from semrl.core.files import require_writable, write_text
from semrl.evaluation.explanation import Explanation, ImaginedScenario
from semrl.evaluation.sight import CLASS_COLOURS
from semrl.report import phrases
from semrl.report.charts import RUN_COLOURS
from semrl.report.scenes import css_colours, scene
from semrl.report.templates import render_page


def write_explanation(explanation: Explanation, out: Path) -> Path:
    """Write one page about a decision; it needs nothing else.

    Raises
    ------
    UsageError
        When the page may not be written there.
    SemrlError
        When writing fails (full disk).
    """
    require_writable(out)
    write_text(out, render_explanation(explanation))
    return out


def render_explanation(explanation: Explanation) -> str:
    """Return the page as HTML text."""
    e, sight = explanation, explanation.sight
    colours = {name: RUN_COLOURS[i % len(RUN_COLOURS)] for i, name in enumerate(e.choice.values)}
    palette = css_colours(CLASS_COLOURS)
    return render_page(
        "explanation.html",
        title=f"Why {e.choice.action}?",
        e=e,
        phrases=phrases,
        scene=scene(e.frame, sight.boxes_px, sight.classes, sight.edges, palette),
        kinds=[(kind, palette[kind % len(palette)], n) for kind, n in phrases.kinds(e)],
        bars=_bars(e.choice.values),
        path=phrases.shortened(e.path),
        colours=colours,
        scenarios=[(scenario, strip(scenario.actions, scenario.rewards, colours)) for scenario in e.scenarios],
        came=[
            (name, rewards, strip(e.rollout.actions, rewards, colours))
            for name, rewards in (("what came", e.rollout.rewards), ("predicted", e.rollout.predicted))
        ],
        ends_at={node: ranks for node in range(len(e.path)) if (ranks := _ends_at(e.scenarios, node))},
    )


def strip(actions: Sequence[str], rewards: Sequence[float], colours: Mapping[str, str]) -> dict[str, Any]:
    """Lay a sequence of actions out as a strip, for the template.

    Returns
    -------
    dict
        ``blocks``: action, repetitions and colour of each; ``marks``: percent of the width, sign and text of each
        reward.
    """
    return {
        "blocks": [(action, n, colours[action]) for action, n in phrases.runs_of(actions)],
        "marks": [
            (100 * (i + 1) / len(actions), "gain" if value > 0 else "loss", phrases.signed(value))
            for i, value in enumerate(rewards)
            if value
        ],
    }


def _bars(values: Mapping[str, float]) -> list[tuple[str, float, float, float]]:
    """Lay values out around zero: name, value, percent at which the bar begins, percent of its length."""
    low, high = min(0.0, *values.values()), max(0.0, *values.values())
    per_cent = 100 / ((high - low) or 1.0)
    return [(name, v, (min(v, 0.0) - low) * per_cent, abs(v) * per_cent) for name, v in values.items()]


def _ends_at(scenarios: Sequence[ImaginedScenario], node: int) -> str:
    """List the scenarios that end in a node of the path."""
    return ", ".join(str(scenario.rank) for scenario in scenarios if scenario.progress == node)
