"""How far two models of the world see ahead that learned from the same play: trees about slots, and about concepts.

Perception is that of the preset ``semrl`` for the model ``objects-map``. Play is random; of games whose RAM tells where
ball and paddle are, every other episode is played by somebody who reads it and keeps the ball in play. Each model
learns from as many decisions of both, and is tested on episodes after them: share of the tracked objects within 4 px
of where they are 1, 5 and 20 decisions later, where no reward comes before and they are seen at both times; share of
first rewards within 20 decisions of which sign and time (within 2) are predicted; and how many of those predicted come.
``blind`` is the lifted model that is not told of what stands still in the background.

    python benchmarks/lifted.py [--game NAME] [--decisions N ...] [--seed S] [--json]
"""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import machine
import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from semrl.core import History, Trajectory
from semrl.core.things import GROUND, STILL
from semrl.envs import Game, make_env
from semrl.envs.ram import GAMES
from semrl.perception.encoders.objects import ObjectsEncoder
from semrl.training import RunConfig, preset
from semrl.training.session import limited_threads
from semrl.training.stored_play import learn_to_see
from semrl.world_model import LiftedWorld, TreeWorld
from semrl.world_model.protocol import WorldModel

HORIZONS = (1, 5, 20)
NEAR_PX = 4
LATE = 2
"""Decisions that a reward may come before or after its time."""

PAST = 8
"""States that a model is shown."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Compare two models of the world on the same play."""

    game: str = "Pong"
    """Its name, as Gymnasium's environments have it."""
    decisions: tuple[int, ...] = (500, 3_000, 10_000)
    """That are learned from."""
    test: int = 4_000
    """Decisions of the test, of which every third is predicted from."""
    seed: int = 0
    """Of perception, play and models."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(arguments: Arguments) -> None:
    """Play, let both learn, test them."""
    config = preset("semrl", "objects-map", {"env": f"{arguments.game}NoFrameskip-v4", "seed": arguments.seed})
    with limited_threads(1):
        game = Game(make_env(config.env, config.environment), arguments.seed)
        encoder = ObjectsEncoder(config.perception, planning=True)
        learn_to_see(game, encoder, config.stability, np.random.default_rng(arguments.seed))
        pools = record(game, encoder, arguments)
        rows = [
            {"decisions": n, "model": name, **judge(name, config, encoder, game.n_actions, pools, n, arguments.test)}
            for n in sorted(arguments.decisions)
            for name in ("trees", "blind", "lifted")
        ]
        kind = machine.describe()
    told = {"game": arguments.game, "seed": arguments.seed, "rows": rows, "machine": kind}
    if arguments.json:
        print(json.dumps(told))
    else:
        show(told)


def record(game: Game, encoder: ObjectsEncoder, arguments: Arguments) -> list[list[Trajectory]]:
    """Play at random and, where RAM tells how, well: episodes of each, long enough for learning and the test."""
    rng = np.random.default_rng(arguments.seed + 1)
    skilled = arguments.game.lower() in GAMES
    each = (max(arguments.decisions) + arguments.test) // (1 + skilled)
    pools: list[list[Trajectory]] = [[] for _ in range(1 + skilled)]
    for plays_well, pool in enumerate(pools):
        while sum(map(len, pool)) < each:
            pool.append(play(game, encoder, rng, each - sum(map(len, pool)), bool(plays_well)))
    return pools


def play(game: Game, encoder: ObjectsEncoder, rng: np.random.Generator, most: int, plays_well: bool) -> Trajectory:
    """Play one episode, cut after so many decisions."""
    observation, episode, aim = game.reset(), encoder.begin(), int(rng.integers(-4, 9))
    states, actions, rewards, burst = [episode.encode(observation)], [], [], 0
    while len(actions) < most:
        ram = observation.ram
        burst = burst - 1 if burst else 4 * int(rng.random() < 0.02)
        if plays_well and not burst and ram is not None:
            action = int(int(ram[54]) >= int(ram[51]) + 4 + aim)
        else:
            action = int(rng.integers(game.n_actions))
        outcome = game.step(action)
        observation = outcome.observation
        states.append(episode.encode(observation))
        actions.append(action)
        rewards.append(outcome.reward)
        if outcome.done:
            break
    return Trajectory(
        states=np.array([state.facts for state in states], np.float32),
        actions=np.array(actions),
        rewards=np.array(rewards, np.float32),
        things=tuple(state.things for state in states),
    )


def judge(  # noqa: PLR0917
    name: str,
    config: RunConfig,
    encoder: ObjectsEncoder,
    n_actions: int,
    pools: list[list[Trajectory]],
    decisions: int,
    test: int,
) -> dict[str, Any]:
    """Let one model learn from so many decisions, half of each kind of play, and test it."""
    planning, space = config.planning, encoder.space
    once = {"first_decisions": decisions, "new_decisions": 10**9}
    world: WorldModel
    if name == "trees":
        world = TreeWorld(replace(planning.trees, **once), space.n_facts, discount=planning.discount, axes=space.axes)
    else:
        world = LiftedWorld(replace(planning.lifted, **once), space.n_facts, n_actions, discount=planning.discount)
    begun = time.process_time()
    for pool in pools:
        for trajectory in between(pool, 0, decisions // len(pools)):
            world.partial_fit(shown(trajectory, name))
    fitted = time.process_time() - begun
    each = test // len(pools)
    tested = [shown(t, name) for pool in pools for t in between(pool, sum(map(len, pool)) - each, each)]
    return {"fit_seconds": fitted, **score(world, tested, space.names[::3])}


def shown(trajectory: Trajectory, name: str) -> Trajectory:
    """Return an episode as a model of this name is told of it."""
    if name != "blind":
        return trajectory
    return replace(trajectory, things=tuple(things[things[:, STILL] != GROUND] for things in trajectory.things))


def between(pool: list[Trajectory], first: int, count: int) -> Iterator[Trajectory]:
    """Return the episodes, or parts of them, from a decision on, so many decisions."""
    for trajectory in pool:
        begin, end = max(first, 0), min(first + count, len(trajectory))
        if begin < end:
            yield Trajectory(
                states=trajectory.states[begin : end + 1],
                actions=trajectory.actions[begin:end],
                rewards=trajectory.rewards[begin:end],
                things=trajectory.things[begin : end + 1],
            )
        first -= len(trajectory)


def score(world: WorldModel, tested: list[Trajectory], names: tuple[str, ...]) -> dict[str, Any]:
    """Predict from every third decision and compare with what came."""
    near = {h: np.zeros((2, len(names))) for h in HORIZONS}
    came = right = told = right_told = asked = 0
    begun = time.process_time()
    for trajectory in tested:
        for t in range(PAST, len(trajectory) - max(HORIZONS), 3):
            scenario = world.imagine(history(trajectory, t), trajectory.actions[None, t : t + max(HORIZONS)])
            asked += 1
            first, sign = reward_of(trajectory.rewards[t : t + max(HORIZONS)])
            guess, its = reward_of(scenario.rewards[0])
            hit = first >= 0 <= guess and abs(first - guess) <= LATE and sign == its
            came, right, told, right_told = came + (first >= 0), right + hit, told + (guess >= 0), right_told + hit
            for horizon in HORIZONS:
                if first < 0 or first >= horizon:
                    count(near[horizon], trajectory.states[[t, t + horizon]], scenario.states[0, horizon - 1])
    shares = {
        h: {name: float(n[0, i] / n[1, i]) if n[1, i] else None for i, name in enumerate(names)}
        for h, n in near.items()
    }
    return {
        "near": shares,
        "recall": right / came if came else None,
        "precision": right_told / told if told else None,
        "rewards": came,
        "imagine_ms": 1000 * (time.process_time() - begun) / asked,
    }


def history(trajectory: Trajectory, t: int) -> History:
    """Return what a model is shown at a decision."""
    first = max(t - PAST + 1, 0)
    return History(
        states=trajectory.states[first : t + 1][::-1],
        actions=trajectory.actions[first:t][::-1],
        things=trajectory.things[first : t + 1][::-1],
        number=t,
    )


def reward_of(rewards: np.ndarray) -> tuple[int, int]:
    """Return when the first reward comes, −1 for never, and its sign."""
    places = np.flatnonzero(np.rint(rewards))
    return (int(places[0]), int(np.sign(rewards[places[0]]))) if len(places) else (-1, 0)


def count(near: np.ndarray, states: np.ndarray, predicted: np.ndarray) -> None:
    """Count which slots are near where they are predicted, of those that are seen at both times."""
    for i in range(near.shape[1]):
        at = slice(3 * i, 3 * i + 2)
        if states[0, 3 * i + 2] and states[1, 3 * i + 2]:
            near[1, i] += 1
            near[0, i] += 83 * np.abs(states[1, at] - predicted[at]).max() <= NEAR_PX


def show(told: dict[str, Any]) -> None:
    """Lay everything out for a person."""
    names = list(told["rows"][0]["near"][HORIZONS[0]])
    table = Table("decisions", "model", *names, "recall", "precision", "fit, s", "20 decisions, ms", box=None)
    for row in told["rows"]:
        cells = [" / ".join(f"{100 * (row['near'][h][name] or 0):.0f}" for h in HORIZONS) for name in names]
        rates = [f"{row[key]:.2f}" if row[key] is not None else "–" for key in ("recall", "precision")]
        times = f"{row['fit_seconds']:.1f}", f"{row['imagine_ms']:.1f}"
        table.add_row(f"{row['decisions']:,}", row["model"], *cells, *rates, *times)
    console = Console(width=160)
    console.print(
        f"{told['game']}, seed {told['seed']}: % within {NEAR_PX} px, {' / '.join(map(str, HORIZONS))} decisions ahead"
    )
    console.print(table)
    console.print(machine.sentence(told["machine"]), highlight=False)


if __name__ == "__main__":
    main(tyro.cli(Arguments))
