"""What a person asks of a watched run and adds to it: a goal to play for (§2.5), and knowledge that it lacks (§2.4)."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from semrl.core import Plan, Sight
from semrl.core.errors import UsageError
from semrl.evaluation.goals import GoalWatch
from semrl.evaluation.knowledge import log_edit
from semrl.evaluation.player import Player
from semrl.evaluation.rules import keys_of_rules
from semrl.evaluation.shield import keeping_out
from semrl.evaluation.words import RunWords, words_of_run
from semrl.knowledge.compiler import Classifier
from semrl.knowledge.edits import Edit, Edited, edited, enabled_forbidden, read_log, standing
from semrl.knowledge.goals import read_goal, require_possible_goal
from semrl.knowledge.writing import write_condition
from semrl.planning import reason
from semrl.planning.goal_planner import GoalPlanner
from semrl.planning.long_term import Routes
from semrl.training.loop import Step

State = Literal["sought", "reached", "lost"]


@dataclass(frozen=True, kw_only=True, slots=True)
class Pursuit:
    """How far a goal has come at a moment."""

    goal: str
    state: State
    """``lost``: what had to be kept was not, so that it can no longer be had in this episode."""
    decisions: int
    """Since it was asked for or, after that, since the episode began."""
    done: float
    """Share of its stages, 0 … 1."""
    ahead: int | None = None
    """Decisions until the plan reaches it; None where the plan does not."""
    distance: float | None = None
    """How far the plan stays from what is sought next, in percent of the image; 0 where it is met."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Changed:
    """The plan of one moment before and after a goal or an edit, as actions."""

    by: str
    """Which goal or edit."""
    before: tuple[int, ...]
    after: tuple[int, ...]


class Teaching:
    """Takes goals and edits, and makes the player that heeds them.

    Parameters
    ----------
    player
        As it was trained. Its planner is exchanged, and nothing screened, while something is asked of it.
    folder
        Of its run, in which edits are kept.

    Attributes
    ----------
    words : RunWords or None
        What can be said of its scenes; None where nothing can, and `trouble` says why.
    log : tuple of Edit
        What people have added, oldest first.
    rules : dict of str to Rule
        By which it predicts, and which can be switched off.

    Raises
    ------
    UsageError
        When something was added to the run before that it cannot heed.
    """

    def __init__(self, player: Player, folder: Path) -> None:
        self.folder = folder
        self.words: RunWords | None = None
        self.trouble = ""
        self.log = tuple(read_log(folder))
        self._trained = player
        self._planner = player.planning.planner if player.planning else None
        self.rules = keys_of_rules(player)
        self._watch: GoalWatch | None = None
        self._goal_planner: GoalPlanner | None = None
        self._text = ""
        self._began = 0
        self._over: State | None = None
        try:
            self.words = words_of_run(player, folder)
        except UsageError as error:
            if standing(self.log):
                raise
            self.trouble = str(error)
        self._know(edited(self.words.words, self.log) if self.words else None)

    @property
    def seeks(self) -> bool:
        """Whether a goal is played for."""
        return self._watch is not None and self._over is None

    @property
    def routes(self) -> Routes | None:
        """The ways to the nodes of the map that meet the goal; None where no place is sought."""
        planning = self._trained.planning
        goal = self._goal_planner
        if not planning or not goal or not self.seeks:
            return None
        routes = goal.towards(planning.knowledge)
        return None if routes is planning.routes else routes

    def seek(self, text: str, now: Step) -> None:
        """Play for a goal from a step on, and keep out of what is forbidden; see `read_goal`.

        Raises
        ------
        UsageError
            When it is malformed, in unknown words, or cannot be had; the message says why.
        """
        words, known = self._required()
        goal = read_goal(text, known.words, forbidden=enabled_forbidden(known))
        require_possible_goal(goal, known.words)
        assert self._trained.planning is not None
        self._watch = GoalWatch(goal, replace(words, words=known.words), self._trained.planning)
        self._text, self._began, self._over = text, now.number, None

    def drop(self) -> None:
        """Seek nothing any more."""
        self._watch = self._over = None

    def add(self, edit: Edit) -> None:
        """Add an edit to the log; the run heeds it at once.

        Raises
        ------
        UsageError
            When it is refused, with the reason.
        """
        words, _ = self._required()
        self.log, now = log_edit(self.folder, words.words, edit, self.rules)
        self._know(now)

    def player(self) -> Player:
        """Make the player that heeds all that was asked and added; its planning module is the trained one's."""
        planning, words = self._trained.planning, self.words
        if planning is None or words is None or self.known is None:
            return self._trained
        assert self._planner is not None
        planning.planner, self._goal_planner = self._planner, None
        if self.seeks:
            assert self._watch is not None
            planning.planner = self._goal_planner = GoalPlanner(self._planner, self._watch, planning.config.long_term)
        planning.screen(not self.seeks)  # scenarios that promise no reward may reach the goal
        return keeping_out(self._trained, words, self.known)

    def begin(self) -> None:
        """Begin an episode: what was sought and not reached is sought anew."""
        if self._watch is not None and self._over != "reached":
            self._watch.begin()
            self._began, self._over = 0, None

    def follow(self, step: Step, before: Step, sight: Sight) -> bool:
        """Take note of a decision; return whether the goal came to its end by it."""
        if not self.seeks or step.state is None or before.state is None:
            return False
        watch = self._watch
        assert watch is not None
        watch.words.measure(sight)
        watch.observe(step.state.facts, before.state.facts)
        if watch.progress.broken[0]:
            self._over = "lost"
        elif watch.progress.reached[0] or (step.done and watch.progress.reached_at_end[0]):
            self._over = "reached"
        return self._over is not None

    def pursuit(self, step: Step) -> Pursuit | None:
        """Return how far the goal is at the newest step."""
        watch = self._watch
        if watch is None:
            return None
        stages = sum(len(task) for task in watch.goal.tasks)
        state: State = self._over or "sought"
        done = 1.0 if state == "reached" else float(watch.progress.share[0]) / stages
        so_far = Pursuit(goal=self._text, state=state, decisions=step.number - self._began, done=done)
        if not self.seeks or step.record is None or step.record.plan is None:
            return so_far
        imagined = step.record.plan.scenarios.states[:1]
        verdict = watch.judge(imagined, step.record.history.states[0])
        ahead = int(verdict.reached[0])
        distance = float(verdict.distances[0])
        return replace(
            so_far,
            ahead=ahead if ahead <= imagined.shape[1] else None,
            distance=distance if np.isfinite(distance) and distance < 1e5 else None,
        )

    def reason(self, plan: Plan, pursuit: Pursuit | None) -> str:
        """Say why the first scenario is the first: by the goal, what is forbidden, or the thesis's order."""
        if pursuit is not None and pursuit.state == "sought":
            if pursuit.ahead is None:
                return "No scenario reaches the goal; scenario 1 comes closest to it."
            return f"Scenario 1 reaches the goal soonest, after {pursuit.ahead} of its decisions."
        if self.known is not None and enabled_forbidden(self.known):
            return "Scenario 1 is the best of those that keep out of the forbidden classes most and longest."
        return reason(plan)

    def classes(self, step: Step, before: Step) -> list[dict[str, Any]]:
        """Describe the defined classes: what they are, whether they count, and of what of a step they hold."""
        if self.words is None or self.known is None or step.state is None or before.state is None:
            return []
        words = self.known.words
        if not words.definitions:
            return []
        scenes = self.words.reader.read(step.state.facts[None], before.state.facts[None])
        held = dict(zip(self._classifier.names, self._classifier(scenes)[0], strict=True))
        return [
            {
                "name": name,
                "condition": write_condition(one.expression, words, one.sort),
                "comment": one.comment,
                "origin": one.origin,
                "forbidden": name in self.known.forbidden,
                "on": name not in self.known.disabled,
                "holds": bool(held[name][0])
                if one.sort == "scene"
                else [who for who, holds in zip(scenes.names, held[name], strict=True) if holds and who],
            }
            for name, one in words.definitions.items()
        ]

    def _required(self) -> tuple[RunWords, Edited]:
        if self.words is None or self.known is None:
            raise UsageError(self.trouble)
        return self.words, self.known

    def _know(self, known: Edited | None) -> None:
        self.known = known
        if known is not None:
            self._classifier = Classifier(known.words)


def describe_edit(edit: Edit) -> str:
    """Describe an edit in a line."""
    match edit.do:
        case "add":
            return f"{'forbidden class' if edit.forbidden else 'class'} {edit.name}: {edit.text}"
        case "assert":
            return f"fact {edit.name}"
        case "disable" | "enable":
            return f"{edit.name} switched {'off' if edit.do == 'disable' else 'on'}"
        case "undo":
            return "the last one taken back"


def edit_of(value: object) -> Edit:
    """Read what a page adds to the run.

    Raises
    ------
    UsageError
        When it is no such thing.
    """
    match value:
        case {"class": str(name), "is": str(text), **rest}:
            return Edit(
                do="add",
                name=name.strip(),
                text=text,
                sort="thing" if rest.get("of_things") is True else "scene",
                forbidden=rest.get("forbidden") is True,
            )
        case {"class": str(name), "on": bool(on)}:
            return Edit(do="enable" if on else "disable", name=name)
        case {"fact": str(text)}:
            return Edit(do="assert", name=text)
        case {"undo": True}:
            return Edit(do="undo")
    raise UsageError("give a class and what it is, a class and whether it is on, a fact, or to undo")


def actions_of(plan: Plan | None) -> tuple[int, ...]:
    """Return the actions of a plan; none where there is none."""
    return () if plan is None else tuple(plan.actions.tolist())
