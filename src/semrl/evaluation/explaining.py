"""Explaining a decision: an evaluation episode is played up to it, and what the run thought there is written down."""

import contextlib
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from semrl.core import Floats, Plan, Sight
from semrl.core.errors import UsageError
from semrl.evaluation.explanation import (
    ActionChoice,
    Explanation,
    ImaginedScenario,
    MapLocation,
    PathEdge,
    PlanFeature,
    Rollout,
)
from semrl.evaluation.player import Player, Policy
from semrl.evaluation.rules import unit_of
from semrl.evaluation.scores import EVALUATION_SEED
from semrl.evaluation.shield import load_shielded
from semrl.evaluation.sight import look
from semrl.planning import edge_costs, edges_along, reason
from semrl.planning.goal_planner import GoalPlanner
from semrl.planning.module import PlanningModule
from semrl.training.loop import Step
from semrl.training.session import limited_threads

SCENARIOS_SHOWN = 5


def explain(
    run: str | Path,
    *,
    episode: int,
    step: int,
    seed: int | None = None,
    policy: Policy = "agent",
    at: int | None = None,
    **conditions: Any,
) -> Explanation:
    """Explain one decision of an evaluation of a run with a map (§3.4.4).

    Parameters
    ----------
    run
        Folder of the run.
    episode
        Of the evaluation, from 0.
    step
        The decision, from 0.
    seed
        Of the episodes; when None, that of `evaluate`.
    policy
        Who decides.
    at
        Decisions after which the run plays: one of its milestones; as it is now when None.
    conditions
        Fields of `EvaluationConfig` in which the evaluation was another than the run's own, such as ``sticky_actions``.

    Raises
    ------
    UsageError
        When there is no such run or milestone, it has no map, or the episode ends before that decision.

    Examples
    --------
    With the run of the page *Start*:

    >>> why = explain("runs/catch", episode=0, step=12, policy="planner")
    >>> why.choice.action in ("LEFT", "RIGHT"), why.step
    (True, 12)
    """
    if min(episode, step, seed or 0) < 0:
        raise UsageError(f"episode, step and seed must be 0 or more, not {episode}, {step} and {seed}")
    player = load_shielded(run, at, **conditions)
    player.require_predictions(run)
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    episodes = contextlib.closing(player.episode(episode, seed, policy))
    with limited_threads(player.config.threads), episodes as steps:
        played = _played(player, steps, step, f"episode {episode} of {run}")
        return _laid_open(player, played, run=str(run), policy=policy, seed=seed, episode=episode, step=step)


def explain_played(
    player: Player, steps: Sequence[Step], sight: Sight, *, run: str, policy: Policy, seed: int, episode: int
) -> Explanation:
    """Explain the first decision of steps that were played already.

    Parameters
    ----------
    player
        Played them, in the episode that its planning module is in.
    steps
        From the decision on, one or more decisions of one episode; no more of them count than scenarios have.
    sight
        What was seen at the first.
    run, policy, seed, episode
        Of the episode; see `explain`.

    Raises
    ------
    UsageError
        When the run has no map or cannot predict yet, or there is no decision.
    """
    depth = player.require_predictions(run).planner.depth
    shown = steps[: depth + 1]
    if len(shown) < 2:
        raise UsageError("there is no decision to explain: nothing was done here yet")
    played = _Played(steps=shown, sight=sight, ended=shown[-1].done)
    return _laid_open(player, played, run=run, policy=policy, seed=seed, episode=episode, step=shown[0].number)


def _laid_open(
    player: Player, played: "_Played", *, run: str, policy: Policy, seed: int, episode: int, step: int
) -> Explanation:
    """Write down what was seen, thought and done at the first of the decisions that were played."""
    planning = player.require_predictions(run)
    explained = _Explained(player, planning, played.steps[0])
    return Explanation(
        run=run,
        model=player.config.model,
        env=player.config.env,
        trained_decisions=player.decisions,
        policy=policy,
        seed=seed,
        episode=episode,
        step=step,
        exploration=player.config.evaluation.exploration,
        return_so_far=played.steps[0].total,
        frame=played.steps[0].observation.frame,
        sight=played.sight,
        features=explained.features(),
        place=explained.place(),
        path=explained.path(),
        cutoff=planning.config.long_term.cutoff,
        scenarios=explained.scenarios(),
        n_scenarios=explained.n_scenarios,
        n_imagined=planning.config.scenarios.scenarios or explained.n_scenarios,
        reason=reason(explained.plan),
        otherwise=explained.otherwise(),
        plan_features=explained.plan_features(),
        choice=explained.choice(played.actions[0], policy),
        rollout=explained.rollout(played),
    )


@dataclass(frozen=True, kw_only=True, slots=True)
class _Played:
    """What is seen at a decision and after it, for as many decisions as scenarios have or until the end."""

    steps: Sequence[Step]
    sight: Sight
    ended: bool

    @property
    def actions(self) -> list[int]:
        return [step.action for step in self.steps[1:] if step.action is not None]

    @property
    def rewards(self) -> list[float]:
        return [step.reward for step in self.steps[1:]]


def _played(player: Player, steps: Iterable[Step], first: int, what: str) -> _Played:
    """Play up to a decision, and so far beyond it that one knows whether the episode ends there."""
    planning = player.require_predictions(what)
    kept: list[Step] = []
    episode = player.encoder.begin()
    for step in steps:
        if step.number <= first:
            _, sight = look(episode, step.observation)
        if step.number >= first:
            kept.append(step)
        if len(kept) > planning.planner.depth + 1:
            return _Played(steps=kept[:-1], sight=sight, ended=False)
    if len(kept) < 2:
        last = step.number
        raise UsageError(f"{what} has {last} decisions, from 0 to {last - 1}, so there is no decision {first}")
    return _Played(steps=kept, sight=sight, ended=True)


class _Explained:
    """What agent and planner make of a state, as rows."""

    def __init__(self, player: Player, planning: PlanningModule, step: Step) -> None:
        assert step.shown and step.record and step.record.plan, "where predictions can be made there are plans"
        self.player, self.planning, self.shown = player, planning, step.shown
        self.history, self.plan = step.record.history, step.record.plan
        self.graph, planner = planning.state_map.graph_, planning.planner
        self.routes = planner.towards(planning.knowledge) if isinstance(planner, GoalPlanner) else planning.routes
        self.action_names = player.action_names
        self.unit = unit_of(player)
        self.n_scenarios = len(self.plan.scenarios)

    def features(self) -> dict[str, float]:
        """Name the numbers of the state, where they have names, in the unit of the rules."""
        names = self.player.encoder.space.names
        return dict(zip(names, (self.history.states[0, : len(names)] / self.unit).tolist(), strict=True))

    def place(self) -> MapLocation:
        """Tell where on the map the state lies."""
        node, distance = self.plan.node, float(self.routes.distances[self.plan.node])
        return MapLocation(
            node=int(self.graph.node_ids[node]),
            states=int(self.graph.node_counts[node]),
            distance=distance if math.isfinite(distance) else None,
            is_goal=bool(self.routes.goals[node]),
            sought=self.sought,
        )

    @property
    def sought(self) -> Literal["gain", "goal"]:
        """Whether ways lead to gains, or to a goal that was given."""
        return "gain" if self.routes is self.planning.routes else "goal"

    def path(self) -> tuple[PathEdge, ...]:
        """Tell the way to what is sought, edge by edge."""
        config, graph = self.planning.config.long_term, self.graph
        costs, edges = edge_costs(graph, config), edges_along(graph, self.plan.path, config).tolist()
        return tuple(
            PathEdge(
                source=int(graph.node_ids[graph.sources[i]]),
                target=int(graph.node_ids[graph.targets[i]]),
                edge=int(graph.edge_ids[i]),
                action=self.action_names[graph.actions[i].argmax()],
                share=float(graph.actions[i].max()),
                count=int(graph.edge_counts[i]),
                reward=float(graph.rewards[i]),
                cost=float(costs[i]),
            )
            for i in (edges if self.sought == "gain" else edges[: len(self.plan.path) - 1])
        )

    def scenarios(self) -> tuple[ImaginedScenario, ...]:
        """Tell the best scenarios, of equal ones the first."""
        _, different = np.unique(self.plan.scenarios.actions, axis=0, return_index=True)
        return tuple(self._scenario(self.plan, i) for i in np.sort(different)[:SCENARIOS_SHOWN].tolist())

    def otherwise(self) -> tuple[ImaginedScenario, ...]:
        """Tell for each other action the best scenario that begins with it."""
        others = (action for action in range(len(self.action_names)) if action != self.plan.actions[0])
        plans = (self.planning.plan(self.history, first=action) for action in others)
        return tuple(self._scenario(plan, 0) for plan in plans if plan)

    def _scenario(self, plan: Plan, i: int) -> ImaginedScenario:
        """Tell the i-th best scenario of a plan."""
        progress = int(plan.progress[i])
        return ImaginedScenario(
            rank=i + 1,
            actions=self._names(plan.scenarios.actions[i]),
            rewards=tuple(plan.scenarios.rewards[i].tolist()),
            predicted_return=float(plan.returns[i]),
            uncertainty=None if plan.scenarios.uncertainties is None else float(plan.scenarios.uncertainties[i]),
            end_node=int(self.graph.node_ids[plan.end_nodes[i]]),
            progress=progress if progress >= 0 else None,
        )

    def plan_features(self) -> tuple[PlanFeature, ...]:
        """Tell what the agent was shown of the plan."""
        return tuple(
            PlanFeature(
                part=part,
                numbers=tuple((numbers / (self.unit if part == "state" else 1.0)).tolist()),
                names=self._part_names(part, numbers),
            )
            for part, numbers in self.planning.grounder.parts(self.shown.plan).items()
        )

    def choice(self, taken: int, policy: Policy) -> ActionChoice:
        """Tell what was done, and what agent and planner wanted."""
        wanted = {"agent": self.player.agent.best_action(self.shown), "planner": int(self.plan.actions[0])}
        values = self.player.agent.action_values(self.shown).tolist()
        return ActionChoice(
            action=self.action_names[taken],
            agent=self.action_names[wanted["agent"]],
            planner=self.action_names[wanted["planner"]],
            by_chance=taken != wanted[policy],
            values=dict(zip(self.action_names, values, strict=True)),
        )

    def rollout(self, played: _Played) -> Rollout:
        """Tell what came, and what the models predict for the actions that were taken."""
        actions = np.array([played.actions])
        predicted = self.planning.world_model.imagine(self.history, actions)
        return Rollout(
            actions=self._names(played.actions),
            rewards=tuple(played.rewards),
            ended=played.ended,
            predicted=tuple(predicted.rewards[0].tolist()),
        )

    def _part_names(self, part: str, numbers: Floats) -> tuple[str, ...]:
        if part == "actions":
            return self._names(numbers.reshape(-1, self.planning.n_actions).argmax(axis=1))
        return tuple(self.features()) if part == "state" else ()

    def _names(self, actions: Iterable[int]) -> tuple[str, ...]:
        return tuple(self.action_names[action] for action in actions)
