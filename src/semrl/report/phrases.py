"""Words of an explanation: the same sentences in the terminal and on the page."""

import math
from collections import Counter
from collections.abc import Iterable, Sequence
from itertools import groupby

from semrl.evaluation.explanation import Explanation, ImaginedScenario, PathEdge, PlanFeature
from semrl.report.wording import number

_HOPS_SHOWN = 8
_OTHERS_SHOWN = 3


def runs_of(actions: Iterable[str]) -> list[tuple[str, int]]:
    """Return each action with how many times it is repeated in a row."""
    return [(action, len(list(same))) for action, same in groupby(actions)]


def compact(actions: Iterable[str]) -> str:
    """Write a sequence of actions in short: ``RIGHT ×3, LEFT``, and ``(RIGHT, LEFT) ×2`` where two take turns."""
    said, runs, at = [], list(runs_of(actions)), 0
    while at < len(runs):
        pair, turns = runs[at : at + 2], 1
        while runs[at + 2 * turns : at + 2 * turns + 2] == pair:
            turns += 1
        if turns > 1 and [n for _, n in pair] == [1, 1]:
            said.append(f"({pair[0][0]}, {pair[1][0]}) ×{turns}")
            at += 2 * turns
        else:
            action, n = runs[at]
            said.append(action if n == 1 else f"{action} ×{n}")
            at += 1
    return ", ".join(said)


def signed(value: float) -> str:
    """Write a number with its sign; 0 has none."""
    return f"{'+' if value > 0 else ''}{number(value, 2)}"


def rewards(values: Sequence[float]) -> str:
    """Say which of a sequence of rewards are not 0, and when they fall: ``−1 after 2, +1 after 5–7 decisions``."""
    said, last = [], 0
    for value, same in groupby(enumerate(values, 1), key=lambda item: item[1]):
        if value:
            places = [i for i, _ in same]
            last = places[-1]
            said.append(f"{signed(value)} after {places[0]}{f'–{last}' if len(places) > 1 else ''}")
    return f"{', '.join(said)} decision{'' if last == 1 else 's'}" if said else "no reward"


def plural(n: int, noun: str) -> str:
    """Count something."""
    return f"{number(n)} {noun}{'' if n == 1 else 's'}"


def which(e: Explanation) -> str:
    """Say which decision is explained."""
    return f"episode {e.episode}, decision {e.step}, return so far {number(e.return_so_far)}"


def seen(e: Explanation) -> str:
    """Say what is seen: the state's numbers by name, or how many objects of which kind."""
    if e.features:
        return ", ".join(f"{name} {value}" for name, value in features(e))
    said = [f"{n} of kind {kind}" for kind, n in kinds(e)]
    said.append(f"{plural(len(e.sight.edges), 'pair')} joined")
    return f"{plural(len(e.sight.boxes_px), 'object')}: {', '.join(said)}"


def features(e: Explanation) -> list[tuple[str, str]]:
    """Write the state's numbers by name: percent and pixels as whole ones, shares of 1 with two decimals."""
    digits = 0 if max(map(abs, e.features.values()), default=0) > 1 else 2
    return [(name, number(value, digits)) for name, value in e.features.items()]


def kinds(e: Explanation) -> list[tuple[int, int]]:
    """Return each kind of object that is seen and how many there are of it, the most frequent first."""
    return Counter(e.sight.classes.tolist()).most_common()


def named(values: Iterable[tuple[str, float]]) -> str:
    """Write numbers with their names."""
    return ", ".join(f"{name} {number(value, 2)}" for name, value in values)


def shown_scenarios(e: Explanation) -> str:
    """Say how many scenarios are shown, of how many."""
    before = f", chosen from {number(e.n_imagined)}" if e.n_imagined > e.n_scenarios else ""
    return f"best {len(e.scenarios)} of {number(e.n_scenarios)} scenarios{before}"


def otherwise(e: Explanation) -> str:
    """Say what it would bring at best to begin with another action; of many, the best few."""
    best = sorted(e.otherwise, key=lambda scenario: -scenario.predicted_return)
    said = [
        f"{scenario.actions[0]} now brings {signed(scenario.predicted_return)} at best, {rewards(scenario.rewards)}"
        for scenario in best[:_OTHERS_SHOWN]
    ]
    if len(best) > len(said):
        said.append(f"none of the other {number(len(best) - len(said))} brings more")
    return f"{'; '.join(said)}."


def place(e: Explanation) -> str:
    """Say where on the map the state lies, and how far what is sought is."""
    here = f"Node {e.place.node}, which stands for {plural(e.place.states, 'state')} of play."
    gain = e.place.sought == "gain"
    if e.place.is_goal:
        return f"{here} {'A gain is known to start right here' if gain else 'The goal is met here'}."
    if e.place.distance is None:
        dear = f" that costs {number(e.cutoff)} or less" if math.isfinite(e.cutoff) else ""
        return f"{here} No way to {'a gain' if gain else 'the goal'} is known{dear}."
    hops = plural(len(e.path) - gain, "step")
    nearest = "The nearest known gain starts" if gain else "The nearest known place where the goal is met lies"
    return f"{here} {nearest} {hops} away, at a cost of {number(e.place.distance)}."


def shortened(path: Sequence[PathEdge]) -> tuple[Sequence[PathEdge], int, Sequence[PathEdge]]:
    """Leave out the middle of a long path: its beginning, how many hops are left out, and its end."""
    if len(path) <= _HOPS_SHOWN + 1:
        return path, 0, ()
    half = _HOPS_SHOWN // 2
    return path[:half], len(path) - 2 * half, path[-half:]


def way(e: Explanation) -> str:
    """Write a path that is not empty as a line: nodes, and the actions that lead from one to the next."""
    first, omitted, last = shortened(e.path)
    between = f"… {plural(omitted, 'step')} … " if omitted else ""
    end = e.path[-1]
    gain = f" ({signed(end.reward)})" if e.place.sought == "gain" else ""
    return f"{_links(first)}{between}{_links(last)}{end.target}{gain}"


def _links(hops: Iterable[PathEdge]) -> str:
    return "".join(f"{hop.source} ─{hop.action}→ " for hop in hops)


def uncertainty(scenario: ImaginedScenario) -> str:
    """Say how far the models differ about a scenario."""
    return "" if scenario.uncertainty is None else f"± {round(scenario.uncertainty, 4):.2g}"


def ending(e: Explanation, scenario: ImaginedScenario) -> str:
    """Say where a scenario ends."""
    if not e.path:
        return f"node {scenario.end_node}"
    nodes = len(e.path) + (e.place.sought == "goal")  # a gain is one edge more
    where = "off the path" if scenario.progress is None else f"{scenario.progress + 1} of {nodes} on the path"
    return f"node {scenario.end_node}, {where}"


def plan_feature(part: PlanFeature) -> str:
    """Say a part of what the agent is shown of the plan."""
    if part.part == "actions":
        return compact(part.names)
    if part.names:
        return named(zip(part.names, part.numbers, strict=False))  # empty slots at the end have no names
    return signed(part.numbers[0]) if len(part.numbers) == 1 else f"a vector of {len(part.numbers)} numbers"


def choice(e: Explanation) -> str:
    """Say what was done by whom, and what the others would have done."""
    d, planned = e.choice, e.policy == "planner"
    decider, wanted, other, others = (
        ("planner", d.planner, "agent", d.agent) if planned else ("agent", d.agent, "planner", d.planner)
    )
    if d.by_chance:
        both = f"agent and planner wanted {wanted}"
        wishes = both if wanted == others else f"the {decider} wanted {wanted}, the {other} {others}"
        return f"Chance took {d.action}, as in {number(100 * e.exploration)} % of an evaluation's decisions; {wishes}."
    why = "with which its best scenario begins" if planned else f"whose value is the highest: {named(d.values.items())}"
    then = "do the same" if wanted == others else f"take {others}"
    return f"The {decider} took {d.action}, {why}; the {other} would {then}."


def rollout(e: Explanation) -> str:
    """Say what really came, and what the planner had predicted of it."""
    a = e.rollout
    text = f"{compact(a.actions)}: {rewards(a.rewards)}{', then the episode ended' if a.ended else ''}."
    return f"{text} For these actions the models predicted {rewards(a.predicted)}."
