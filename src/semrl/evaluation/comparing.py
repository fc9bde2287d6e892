"""Comparing two trained runs: what they know, how they score, and where they part in one same game."""

import json
import re
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from sklearn.metrics import adjusted_mutual_info_score

from semrl.core import Outcome
from semrl.core.errors import SemrlError, UsageError
from semrl.evaluation.comparison import Comparison, Decider, MapComparison, Parting, RuleComparison, Score, Words
from semrl.evaluation.player import Player, Policy
from semrl.evaluation.rules import MOST, rules_of
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.evaluation.shield import load_shielded
from semrl.evaluation.statistics import interquartile_mean
from semrl.planning import reason
from semrl.training.config import to_dict
from semrl.training.loop import Step
from semrl.training.session import limited_threads
from semrl.world_model.rules import Rule

PARTINGS = 3
"""Decisions that are reported of a game, at most."""

SAME = 0.05
"""Two rules say the same when their values differ by at most this share of the larger one, or by less than either's
error."""

Pair = tuple[Player, Player]


def compare(
    first: str | Path,
    second: str | Path,
    *,
    policy: Policy = "agent",
    seed: int | None = None,
    decisions: int = 500,
    most: int = MOST,
) -> Comparison:
    """Compare two runs.

    Parameters
    ----------
    first, second
        Their folders; their newest checkpoints count.
    policy
        Who decides in the game that both watch: the first plays it.
    seed
        Of that game; when None, that of the first one's `evaluate`.
    decisions
        How long it is watched at most.
    most
        Rules for each number of a state, and for the reward.

    Raises
    ------
    UsageError
        When one is no run, has not learned anything yet, or has no planner where one is asked for.
    """
    if decisions < 1 or (seed or 0) < 0:
        raise UsageError(f"decisions must be 1 or more and seed 0 or more, not {decisions} and {seed}")
    runs = (str(first), str(second))
    players = (_load(runs[0], policy), _load(runs[1], policy))
    game = _why_not_one_game(players)
    steps: list[tuple[Step, Step]] = []
    partings: tuple[Parting, ...] = ()
    agreed = None
    seed = players[0].config.seed + EVALUATION_SEED if seed is None else seed
    if not game:
        with limited_threads(players[0].config.threads):
            steps, partings, agreed = _watched(players, seed, policy, decisions)
    return Comparison(
        runs=runs,
        models=(players[0].config.model, players[1].config.model),
        decisions=(players[0].decisions, players[1].decisions),
        settings=_settings(players),
        names=_words(*(player.encoder.space.names for player in players)),
        concepts=_words(*map(_concepts, players)),
        rules=_rules(*(rules_of(player, most=most) for player in players)),
        maps=_maps(players, steps),
        scores=tuple(_scores(runs)),
        policy=policy,
        seed=None if game else seed,
        watched=len(steps),
        agreed=agreed,
        partings=partings,
        no_game=game,
    )


def _load(run: str, policy: Policy) -> Player:
    player = load_shielded(run, exploration=0.0)
    if player.perceiving:
        raise UsageError(f"{run} has not learned to see yet, so there is no agent to compare: it needs more decisions")
    if policy == "planner":
        player.require_predictions(run)
    return player


def _settings(players: Pair) -> dict[str, tuple[Any, Any]]:
    """Return the settings in which they differ, by dotted name."""
    ours, theirs = (dict(_flat(to_dict(player.config))) for player in players)
    return {name: (ours[name], theirs[name]) for name in ours if name in theirs and ours[name] != theirs[name]}


def _flat(values: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in values.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value


def _words(ours: Sequence[str], theirs: Sequence[str]) -> Words:
    return Words(
        both=tuple(word for word in ours if word in theirs),
        first=tuple(word for word in ours if word not in theirs),
        second=tuple(word for word in theirs if word not in ours),
    )


def _concepts(player: Player) -> tuple[str, ...]:
    known = player.planning.concepts if player.planning else None
    return known.table_.names if known and known.is_fitted else ()


def _rules(ours: Sequence[Rule], theirs: Sequence[Rule]) -> RuleComparison:
    """Pair rules that predict the same number under conditions on the same numbers, whatever the bounds are."""
    candidates = defaultdict(list)
    for rule in theirs:
        candidates[_shape(rule)].append(rule)
    lost, changed, same = [], [], 0
    for rule in ours:
        alike = candidates[_shape(rule)]
        if not alike:
            lost.append(rule)
            continue
        other = min(alike, key=lambda one: abs(one.value - rule.value))
        alike.remove(other)
        within = max(SAME * max(abs(other.value), abs(rule.value)), min(other.error, rule.error))
        if abs(other.value - rule.value) <= within:
            same += 1
        else:
            changed.append((rule, other))
    added = tuple(rule for rule in theirs if any(rule is left for left in candidates[_shape(rule)]))
    return RuleComparison(same=same, lost=tuple(lost), added=added, changed=tuple(changed))


def _shape(rule: Rule) -> tuple[str, ...]:
    """Return what a rule is about and on what it depends, without the bounds."""
    bound = re.compile(r"(?<= [≤>] )-?\d\S*|^-?\d\S*(?= <)")
    return rule.about, *sorted(bound.sub("…", condition) for condition in rule.conditions)


def _maps(players: Pair, steps: Sequence[tuple[Step, Step]]) -> MapComparison | None:
    """Compare the maps, and how they divide the states of the game that both watched."""
    if not all(player.planning and len(player.planning.state_map.graph_) for player in players):
        return None
    graphs = [player.planning.state_map.graph_ for player in players if player.planning]
    both = ((_node(one), _node(other)) for one, other in steps)
    nodes = [(ours, theirs) for ours, theirs in both if ours is not None and theirs is not None]
    met = tuple(len(set(side)) for side in zip(*nodes, strict=True)) if nodes else (0, 0)
    return MapComparison(
        nodes=(len(graphs[0]), len(graphs[1])),
        edges=(len(graphs[0].edge_ids), len(graphs[1].edge_ids)),
        met=(met[0], met[1]),
        agreement=_agreement(nodes) if nodes else None,
    )


def _agreement(nodes: Sequence[tuple[int, int]]) -> float:
    ours, theirs = zip(*nodes, strict=True)
    if len(set(ours)) == len(set(theirs)) == 1:
        return 1.0  # undivided, both
    return min(1.0, float(adjusted_mutual_info_score(ours, theirs)))  # rounding may carry it beyond


def _node(step: Step) -> int | None:
    plan = step.record.plan if step.record else None
    return plan.node if plan else None


def _scores(runs: tuple[str, str]) -> Iterator[Score]:
    """Sum up evaluations of the same kind that both runs, or one of them, have kept."""
    found = [{path.stem: path for path in sorted(Path(run).glob("evaluation*.json"))} for run in runs]
    for name in dict.fromkeys([*found[0], *found[1]]):
        sides = [_returns(side[name]) if name in side else None for side in found]
        measured = [interquartile_mean([side]) if side is not None else None for side in sides]
        yield Score(
            name=name,
            episodes=(0 if sides[0] is None else len(sides[0]), 0 if sides[1] is None else len(sides[1])),
            iqm=(measured[0], measured[1]),
        )


def _returns(path: Path) -> np.ndarray[Any, np.dtype[np.float64]]:
    try:
        returns = np.array(json.loads(path.read_text(encoding="utf-8"))["returns"], np.float64)
        if returns.ndim != 1 or not len(returns):
            raise ValueError("it has no returns")
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise SemrlError(f"{path} is damaged: {error!r}; delete it and evaluate again") from None
    return returns


def _why_not_one_game(players: Pair) -> str:
    """Say why both cannot watch the same game; empty when they can."""
    first, second = players
    if first.config.env != second.config.env:
        return f"they play other games: {first.config.env} and {second.config.env}"
    if first.world != second.world or first.config.environment != second.config.environment:
        return "the game is played in another way by each of them: see the settings under environment"
    return ""


def _watched(
    players: Pair, seed: int, policy: Policy, decisions: int
) -> tuple[list[tuple[Step, Step]], tuple[Parting, ...], float]:
    """Let the first play and the second look on; return what both saw, where they part, and the share they agree on."""
    steps: list[tuple[Step, Step]] = []
    partings: list[Parting] = []
    agreed, n_agreed = True, 0
    for one, other in islice(_side_by_side(players, seed, policy), decisions):
        wanted = players[0].choose(one, policy), players[1].choose(other, policy)
        parted = wanted[0] != wanted[1]
        if parted and agreed and len(partings) < PARTINGS:
            partings.append(_parting(players, (one, other), wanted))
        agreed = not parted
        n_agreed += agreed
        steps.append((one, other))
    return steps, tuple(partings), n_agreed / len(steps)


def _side_by_side(players: Pair, seed: int, policy: Policy) -> Iterator[tuple[Step, Step]]:
    """Yield what each makes of every state of a game that the first one plays, but for its end."""
    view, other = players[1].view(), None
    for one in players[0].episode(0, seed, policy):
        if other is None or one.action is None:
            other = view.begin(one.observation)
        else:
            outcome = Outcome(
                observation=one.observation,
                reward=one.reward,
                training_reward=one.training_reward,
                terminated=one.terminated,
                truncated=one.truncated,
            )
            other = view.follow(other, one.action, outcome)
        if not one.done:
            yield one, other


def _parting(players: Pair, steps: tuple[Step, Step], wanted: tuple[int, int]) -> Parting:
    sides = [_decider(player, step, action) for player, step, action in zip(players, steps, wanted, strict=True)]
    return Parting(
        step=steps[0].number,
        return_so_far=steps[0].total,
        frame=steps[0].observation.frame,
        deciders=(sides[0], sides[1]),
    )


def _decider(player: Player, step: Step, action: int) -> Decider:
    """Say what one of them would do, and why."""
    assert step.shown is not None
    names = player.action_names
    plan = step.record.plan if step.record else None
    values = player.agent.action_values(step.shown).tolist()
    return Decider(
        action=names[action],
        values=dict(zip(names, values, strict=True)),
        planned=names[int(plan.actions[0])] if plan else None,
        predicted_return=float(plan.returns[0]) if plan else None,
        reason=reason(plan) if plan else None,
    )
