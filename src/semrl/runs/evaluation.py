"""Playing with a trained run, without learning."""

import json
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import numpy as np

from semrl.agent import DQN
from semrl.arrays import unnest
from semrl.errors import SemrlError, UsageError
from semrl.pipeline import Pipeline
from semrl.runs.config import RunConfig
from semrl.runs.files import write_text
from semrl.runs.folder import RunFolder
from semrl.runs.session import build_trainer, limited_threads
from semrl.state import Game, action_meanings, make_env
from semrl.types import Observation

EVALUATION_SEED = 1_000_000
"""Added to a run's seed for its evaluation."""


@dataclass(frozen=True, kw_only=True)
class EvaluationResult:
    """Returns of the evaluation episodes."""

    run: str
    policy: str
    episodes: int
    mean: float
    std: float
    min: float
    max: float
    returns: list[float]


@dataclass(frozen=True, kw_only=True, slots=True)
class Step:
    """What is seen after a decision, and the return so far."""

    observation: Observation
    total: float


@dataclass(frozen=True, kw_only=True)
class Player:
    """A trained agent with the perception it was trained with."""

    config: RunConfig
    pipeline: Pipeline
    agent: DQN
    decisions: int
    perceiving: bool
    """Whether perception was still being learned at this checkpoint."""

    def new_game(self, seed: int) -> Game:
        """Make the game that it was trained on, begun at random where the game has an action for waiting."""
        environment = self.config.environment
        env = make_env(self.config.env, environment)
        noops = self.config.evaluation.max_noops
        if noops and "NOOP" in action_meanings(env.unwrapped):
            env = make_env(self.config.env, replace(environment, max_noops=noops))
        return Game(env, seed)

    def play(self, game: Game, rng: np.random.Generator) -> Iterator[Step]:
        """Play one episode and yield every decision of it, beginning with the first observation."""
        observation = game.reset()
        encoded = self.pipeline.encode(observation)
        state = np.stack([encoded, encoded])
        yield Step(observation=observation, total=0.0)
        total, done = 0.0, False
        while not done:
            explore = rng.random() < self.config.evaluation.exploration
            action = int(rng.integers(game.n_actions)) if explore else self.agent.best_action(state)
            outcome = game.step(action)
            state = np.stack([self.pipeline.encode(outcome.observation), state[0]])
            total += outcome.reward
            done = outcome.done
            yield Step(observation=outcome.observation, total=total)


def evaluate(
    run: str | Path,
    *,
    episodes: int | None = None,
    seed: int | None = None,
    on_episode: Callable[[float], None] = lambda _: None,
    on_step: Callable[[int, Step], None] = lambda _episode, _step: None,
) -> EvaluationResult:
    """Play a run's agent greedily and write ``evaluation.json`` into its folder.

    Parameters
    ----------
    run
        Folder of the run; its newest checkpoint plays.
    episodes
        How many; the run's ``evaluation.episodes`` when None.
    seed
        Of the episodes; when None, one that training did not use.
    on_episode
        Is told the return of each episode.
    on_step
        Is told the number of the episode and every decision; for videos.

    Raises
    ------
    UsageError
        When there is no such run, its agent has not begun to learn, or there is nothing to play.
    """
    if (episodes is not None and episodes < 1) or (seed is not None and seed < 0):
        raise UsageError(f"episodes must be 1 or more and seed 0 or more, not {episodes} and {seed}")
    player = load_player(run)
    if player.perceiving:
        raise UsageError(f"{run} has not learned to see yet, so there is no agent to play with: it needs more frames")
    seed = player.config.seed + EVALUATION_SEED if seed is None else seed
    rng = np.random.default_rng(seed)
    returns: list[float] = []
    with limited_threads(player.config.threads):
        game = player.new_game(seed)
        for episode in range(episodes or player.config.evaluation.episodes):
            for step in player.play(game, rng):
                on_step(episode, step)
            returns.append(step.total)
            on_episode(step.total)
    result = EvaluationResult(
        run=str(run),
        policy="agent",
        episodes=len(returns),
        mean=float(np.mean(returns)),
        std=float(np.std(returns, ddof=1)) if len(returns) > 1 else 0.0,
        min=min(returns),
        max=max(returns),
        returns=returns,
    )
    provenance = {"decisions": player.decisions, "seed": seed, **asdict(player.config.evaluation)}
    write_text(Path(run) / "evaluation.json", json.dumps(asdict(result) | {"with": provenance}, indent=2) + "\n")
    return result


def load_pipeline(run: str | Path) -> Pipeline:
    """Return the trained perception of a run.

    Raises
    ------
    UsageError
        When there is no run, or it has not learned anything yet.
    """
    return load_player(run).pipeline


def load_player(run: str | Path) -> Player:
    """Return the agent and the perception of a run, as of its newest checkpoint."""
    folder = RunFolder.open(Path(run))
    config = folder.config()
    checkpoint = folder.load(prefixes=("pipeline/", "agent/network/", "schooling/position", "decisions"))
    if checkpoint is None:
        raise UsageError(f"{run} has no checkpoint yet; go on with: semrl train --run {run} --resume")
    trainer = build_trainer(replace(config, agent=replace(config.agent, replay_capacity=config.agent.n_steps + 1)))
    try:
        trainer.pipeline.from_arrays(unnest(checkpoint.arrays, "pipeline"))
        trainer.agent.load_network(unnest(checkpoint.arrays, "agent/network"))
    except (KeyError, ValueError, RuntimeError) as error:
        raise SemrlError(f"the checkpoint of {run} does not fit its configuration ({error})") from error
    position = checkpoint.arrays.get("schooling/position")
    return Player(
        config=config,
        pipeline=trainer.pipeline,
        agent=trainer.agent,
        decisions=int(checkpoint.arrays["decisions"]),
        perceiving=position is not None and int(position) < len(trainer.schooling.stages),
    )
