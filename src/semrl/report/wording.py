"""Words and numbers of the page: how results, durations and settings are said."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from semrl.report.record import RunRecord
from semrl.training.metrics import RUNNING_MEAN_EPISODES

SEES = {
    "grey": "The agent is shown the grey image as it is; nothing is detected.",
    "ram": "The agent reads coordinates from the emulator's memory; no image is looked at.",
    "components": "Whatever is brighter than the threshold is an object; the agent is shown each in a grey of its own.",
    "classes": "Objects are sorted into kinds; the agent is shown each pixel in the grey of its object's kind.",
    "scene": "Objects are sorted into kinds and joined to a graph; the agent is shown the graph as a vector.",
    "tracked_scene": "Objects are followed through time, and those that move joined to a graph; the agent is shown the "
    "graph as a vector.",
    "objects": "Objects are followed through time; the agent is shown where those that move are, and which it sees.",
}
"""What the agent is shown, by encoder."""


def number(value: float, digits: int = 1) -> str:
    """Write a number with a real minus sign and thin grouping; whole ones without decimals."""
    text = f"{value:,.{digits}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return (text if text != "-0" else "0").replace("-", "−")


def interval(value: float | None, low: float | None, high: float | None) -> tuple[str, str]:
    """Write a value and the ends of its interval; a dash for what is not known."""
    ends = "–" if low is None or high is None else f"{number(low, 2)} to {number(high, 2)}"
    return "–" if value is None else number(value, 2), ends


def duration(seconds: float) -> str:
    """Write a duration in the unit that fits."""
    for size, unit in ((86400, "days"), (3600, "hours"), (60, "minutes")):
        if seconds >= 1.5 * size:
            return f"{number(seconds / size)} {unit}"
    return f"{number(seconds, 0)} seconds"


def game(run: RunRecord) -> str:
    """Return the short name of the environment."""
    name = str(run.manifest.get("env", run.config.get("env", "?")))
    return name.rpartition("/")[2].partition("NoFrameskip")[0].removesuffix("-v5")


def trained(run: RunRecord) -> str:
    """Say what was trained for how long with which result, in one or two sentences."""
    if not run.began:
        return "Training has not measured anything yet."
    returns = run.returns().y
    text = (
        f"Trained for {number(run.decisions)} decisions ({number(run.decisions * run.frame_skip)} frames) "
        f"in {duration(run.seconds)}."
    )
    if run.manifest.get("status") != "finished":
        text += f" The run is not finished: its status is “{run.manifest.get('status')}”."
    if not len(returns):
        return text + " The agent has not finished an episode yet."
    last = returns[-RUNNING_MEAN_EPISODES:]
    if len(returns) == 1:
        return f"{text} Return of the one training episode: {number(last[0])}."
    which = f"last {len(last)} of {len(returns)}" if len(returns) > len(last) else str(len(returns))
    return f"{text} Mean return of the {which} training episodes: {number(last.mean())}."


def tested(run: RunRecord) -> str:
    """Say how the evaluation was done."""
    if run.evaluation is None:
        return ""
    with_ = run.evaluation.get("conditions") or {}
    least, most = (number(run.evaluation[key]) for key in ("min", "max"))
    one = run.evaluation["episodes"] == 1
    text = (
        "return of one evaluation episode"
        if one
        else (f"mean return ± standard deviation over {run.evaluation['episodes']} evaluation episodes")
    )
    if with_.get("max_noops"):
        text += f", {'' if one else 'each '}begun with up to {with_['max_noops']} random no-op decisions"
    text += (
        "."
        if one
        else f"; the returns lie between {least} and {most}."
        if least != most
        else "; all returns are the same."
    )
    if "decisions" in with_ and run.began and with_["decisions"] != run.decisions:
        text += f" The agent that played had trained for {number(with_['decisions'])} decisions."
    return text


def settings(run: RunRecord, defaults: Mapping[str, Any]) -> tuple[list[tuple[str, str, str]], list[tuple[str, str]]]:
    """Return the settings that differ from the defaults (name, value, default), and all others."""
    usual = dict(flat(defaults))
    changed, rest = [], []
    for name, value in flat(run.config):
        if name in usual and value != usual[name]:
            changed.append((name, value, usual[name]))
        else:
            rest.append((name, value))
    return changed, rest


def provenance(run: RunRecord) -> list[tuple[str, str]]:
    """Return what the manifest says of versions, machine, threads, seed and hashes."""
    return list(flat({key: value for key, value in run.manifest.items() if key not in ("result", "format")}))


def flat(values: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, str]]:
    """Yield nested values under dotted names, as TOML would write them."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
