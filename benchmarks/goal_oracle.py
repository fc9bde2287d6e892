"""Whether a goal can be had from where a trial begins, found by a long search in the environment itself.

Nothing is predicted: courses of actions are played from the trial's own start, most of them the best so far up to some
decision and chance from there on, each action held for a while. What is found can be had; what is not may still be.
"""

from dataclasses import dataclass, field

import numpy as np

from semrl.core import Floats, Ints
from semrl.evaluation.goals import GoalTrials
from semrl.training.loop import Step

LONGEST_HOLD = 24
"""Decisions for which an action is held at most."""

FRESH = 0.25
"""Share of the courses that are drawn from the start on."""


@dataclass
class _Course:
    """What is done, and what came of it."""

    actions: Ints
    states: list[Floats] = field(default_factory=list)

    def choose(self, step: Step) -> int:
        return int(self.actions[step.number])

    def note(self, step: Step) -> None:
        assert step.state is not None
        self.states.append(step.state.facts)


def search(trials: GoalTrials, trial: int, *, most: int, courses: int, seed: int = 0) -> int | None:
    """Return after how many decisions some course reaches the goal; None where none of them does.

    Parameters
    ----------
    trials
        Of the goal.
    trial
        Which of them.
    most
        Decisions of a trial.
    courses
        That are played at most.
    """
    rng = np.random.default_rng([seed, trial])
    n_actions = len(trials.player.action_names)
    best: Ints = np.zeros(0, np.int64)
    best_score = (0.0, -np.inf)
    for _ in range(courses):
        keep = 0 if rng.random() < FRESH else int(rng.integers(len(best) + 1))
        course = _Course(np.concatenate([best[:keep], _drawn(rng, n_actions, most - keep)]))
        reached = trials.play(trial, most, choose=course.choose, on_step=course.note)
        if reached is not None:
            return reached
        score = _score(trials, np.stack(course.states))
        if score >= best_score:
            best_score, best = score, course.actions[: len(course.states) - 1]
    return None


def _drawn(rng: np.random.Generator, n_actions: int, length: int) -> Ints:
    """Return random actions, each held for 1 … `LONGEST_HOLD` decisions."""
    held = rng.integers(1, LONGEST_HOLD + 1, size=length)
    return np.repeat(rng.integers(n_actions, size=length), held)[:length]


def _score(trials: GoalTrials, states: Floats) -> tuple[float, float]:
    """Return how far a course came: what was done of the goal, then how near it stayed to what was sought."""
    if len(states) < 2:
        return 0.0, -np.inf
    trials.watch.begin()
    verdicts = trials.watch.judge(states[None, 1:], states[0])
    return float(verdicts.progress[0]), -float(verdicts.distances[0])
