"""How well objects are followed, scored against the emulator's RAM, and how long it takes.

Perception is that of the preset ``semrl`` for the model ``objects``, learned from random play as in a run. Then a
player that reads the RAM keeps the ball in play, so that there are rallies, and the slots are compared with the
RAM at every decision. A slot belongs to the coordinates of RAM that fit it best; RAM and image are related by one
straight line a coordinate, fitted by least squares where the object is seen.

    python benchmarks/tracking.py [--decisions N] [--seed S] [--json]
"""

import json
import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import machine
import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from semrl.core import IMAGE_SIZE_PX, Observation, Outcome
from semrl.envs import Game, make_env
from semrl.perception.encoders.objects import ObjectsEncoder
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.perception.tracking import SlotAssigner
from semrl.training import preset
from semrl.training.session import limited_threads

OBJECTS = {"ball": (54, 49), "player": (51, None), "enemy": (50, None)}
"""RAM addresses of each object's y and, where it moves sideways, x."""

ROW_PX, COLUMN_PX = IMAGE_SIZE_PX / 210, IMAGE_SIZE_PX / 160
AIM_PX = 6
"""The player aims at a place this far from the ball at most, in rows of RAM, so that rallies differ."""


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Score the tracking of objects in Pong."""

    decisions: int = 10_000
    """Decisions that are scored."""
    seed: int = 0
    """Of the game, the random play and the player."""
    json: bool = False
    """Print one JSON object and nothing else."""


@dataclass(frozen=True, kw_only=True)
class Recorded:
    """What was played: RAM and what perception made of it, decision by decision.

    Attributes
    ----------
    ram
        ``(t, 128)``.
    slots
        ``(t, k, 3)``: x and y in 0 … 1, and whether it is seen.
    ids
        ``(t, k)``: the identity of the track in each slot; −1 for none.
    rallies
        ``(t,)``: number of the rally, from one serve to the next.
    microseconds
        Mean processor time of each part.
    """

    ram: NDArray[np.int64]
    slots: NDArray[np.float64]
    ids: NDArray[np.int64]
    rallies: NDArray[np.int64]
    microseconds: dict[str, float]


def main(arguments: Arguments) -> None:
    """Learn to see, play, compare."""
    with limited_threads(1):
        game = Game(make_env(), seed=arguments.seed)
        rng = np.random.default_rng(arguments.seed)
        encoder, learning = learn_to_see(game, rng)
        perception = encoder.perception
        recorded = record(encoder, game, rng, arguments.decisions)
        told = {
            "seed": arguments.seed,
            "decisions": arguments.decisions,
            "perception_decisions": learning,
            "rallies": int(recorded.rallies[-1]),
            "slots": len(perception.slot_assigner.slots_),
            "objects": {name: score(recorded, perception.slot_assigner, name) for name in OBJECTS},
            "microseconds": recorded.microseconds,
            "machine": machine.describe(),
        }
    if arguments.json:
        print(json.dumps(told))
        return
    show(told)


def learn_to_see(game: Game, rng: np.random.Generator) -> tuple[ObjectsEncoder, int]:
    """Learn perception from random play; return it and the decisions that took."""
    config = preset("semrl", "objects")
    encoder = ObjectsEncoder(config.perception, rom="pong")
    schedule = PretrainingSchedule(encoder.stages(config.stability), config.stability)
    observation, action, decisions = game.reset(), None, 0
    while schedule.current is not None:
        schedule.learn(observation, action)
        action = int(rng.integers(game.n_actions))
        outcome = game.step(action)
        observation, decisions = outcome.observation, decisions + 1
        if outcome.done:
            observation, action = game.reset(), None
    return encoder, decisions


def record(encoder: ObjectsEncoder, game: Game, rng: np.random.Generator, decisions: int) -> Recorded:
    """Play and note what RAM and perception say."""
    ram, slots, ids, rallies, rally, in_play = [], [], [], [], 0, False
    clock, slots_in_use = Clock(encoder), encoder.perception.slot_assigner.slots_.tolist()
    for outcome, begins in play(game, rng, decisions):
        if begins:
            clock.begin()
        assert outcome.observation.ram is not None
        was, in_play = in_play, bool(has_ball(outcome.observation.ram))
        rally += in_play and (begins or not was)
        ram.append(outcome.observation.ram.astype(np.int64))
        slots.append(clock.encode(outcome.observation).reshape(-1, 3)[: len(slots_in_use)])
        tracks = clock.episode.tracks
        named = {int(r): int(i) for r, i in zip(tracks.roles, tracks.ids, strict=True)}
        ids.append([named.get(role, -1) for role in slots_in_use])
        rallies.append(rally)
    return Recorded(
        ram=np.stack(ram),
        slots=np.stack(slots).astype(np.float64),
        ids=np.array(ids),
        rallies=np.array(rallies),
        microseconds=clock.means(),
    )


class Clock:
    """Encodes observations and takes the processor time of each part."""

    def __init__(self, encoder: ObjectsEncoder) -> None:
        self.encoder = encoder
        self.begin()
        self.seconds = {"detect": 0.0, "PCA and Birch classes": 0.0, "follow and slots": 0.0, "encode": 0.0}
        self.n = 0

    def begin(self) -> None:
        """Begin an episode."""
        self.episode = self.encoder.begin()

    def encode(self, observation: Observation) -> NDArray[Any]:
        """Encode one observation; detecting and classifying are done once more, to be timed alone."""
        perception, start = self.encoder.perception, time.process_time()
        objects = perception.detector.detect(observation.frame)
        detected = time.process_time()
        perception.classes(objects)
        classified = time.process_time()
        encoded = self.episode.encode(observation).vector
        end = time.process_time()
        parts = {"detect": detected - start, "PCA and Birch classes": classified - detected, "encode": end - classified}
        parts["follow and slots"] = parts["encode"] - (classified - start)
        self.n += 1
        if self.n > 1:  # the first call compiles
            for name, seconds in parts.items():
                self.seconds[name] += seconds
        return encoded

    def means(self) -> dict[str, float]:
        """Return the mean times in microseconds."""
        return {name: round(seconds / max(self.n - 1, 1) * 1e6, 1) for name, seconds in self.seconds.items()}


def play(game: Game, rng: np.random.Generator, decisions: int) -> Iterator[tuple[Outcome, bool]]:
    """Follow the ball's y in RAM with an aim that changes now and then; yield outcomes and whether one begins."""
    outcome, begins, aim = first(game), True, 0
    for i in range(decisions):
        yield outcome, begins
        if i % 8 == 0:
            aim = int(rng.integers(-AIM_PX, AIM_PX + 1))
        ram = outcome.observation.ram
        assert ram is not None
        below = int(ram[OBJECTS["ball"][0]]) >= int(ram[OBJECTS["player"][0]]) + 8 + aim
        begins = outcome.done
        outcome = first(game) if begins else game.step(int(below))


def first(game: Game) -> Outcome:
    """Begin an episode."""
    return Outcome(observation=game.reset(), reward=0.0, training_reward=0.0, terminated=False, truncated=False)


def score(recorded: Recorded, roles: SlotAssigner, name: str) -> dict[str, Any]:
    """Compare one object with the slot that fits it best."""
    y, x = OBJECTS[name]
    ram = recorded.ram
    there = has_ball(ram)
    slot = int(np.argmax([likeness(recorded, slot, there, y, x) for slot in range(recorded.slots.shape[1])]))
    error, ids = errors(recorded, slot, there, y, x)[there], recorded.ids[there, slot]
    seen = recorded.slots[there, slot, 2] > 0
    same_rally = np.diff(recorded.rallies[there]) == 0
    role = roles.slots_[slot]
    return {
        "frames": int(there.sum()),
        "seen": float(seen.mean()),
        "within_1_px": float((error <= 1).mean()),
        "mean_px": float(error.mean()),
        "max_px": float(error.max()),
        "switches": int((np.diff(ids)[same_rally] != 0).sum()),
        "slot": slot,
        "influence": float(roles.controllability_[role]),
        "controlled": bool(roles.controlled_[role]),
    }


def has_ball(ram: NDArray[Any]) -> NDArray[np.bool_]:
    """Tell whether the ball is in play, ``(..., 128)`` → ``(...)``: otherwise one of its coordinates is 0."""
    return np.asarray((ram[..., OBJECTS["ball"]] > 0).all(axis=-1))


def likeness(recorded: Recorded, slot: int, there: NDArray[np.bool_], y: int, x: int | None) -> float:
    """Return how well a slot goes with RAM: the correlation of its coordinates, the worse of the two."""
    seen = there & (recorded.slots[:, slot, 2] > 0)
    pairs = [(recorded.ram[seen, a], recorded.slots[seen, slot, n]) for a, n in ((y, 1), (x, 0)) if a is not None]
    varies = seen.sum() > 1 and all(np.ptp(place) > 0 for _, place in pairs)
    return min(float(np.corrcoef(place, value)[0, 1]) for value, place in pairs) if varies else -1.0


def errors(recorded: Recorded, slot: int, there: NDArray[np.bool_], y: int, x: int | None) -> NDArray[np.float64]:
    """Return how far a slot is from where RAM has an object, ``(t,)`` in pixels."""
    seen = there & (recorded.slots[:, slot, 2] > 0)
    total = np.zeros(len(seen))
    for address, number in ((y, 1), (x, 0)):
        place = recorded.slots[:, slot, number] * (IMAGE_SIZE_PX - 1)
        if address is None or seen.sum() < 2:
            continue
        line = np.polyfit(recorded.ram[seen, address], place[seen], 1)
        total += np.square(np.polyval(line, recorded.ram[:, address]) - place)
    return np.sqrt(total) if seen.any() else np.full(len(seen), np.inf)


def show(told: dict[str, Any]) -> None:
    """Print a table."""
    names = ("frames", "seen", "within_1_px", "mean_px", "max_px", "switches", "influence")
    table = Table("object", *names, box=None, padding=(0, 2, 0, 0))
    for name, row in told["objects"].items():
        table.add_row(name, *(f"{row[key]:.4f}" if isinstance(row[key], float) else str(row[key]) for key in names))
    console = Console()
    console.print(table)
    console.print(
        f"{told['decisions']:,} decisions in {told['rallies']} rallies, seed {told['seed']}, {told['slots']} slots; "
        f"perception took {told['perception_decisions']:,} decisions of random play",
        highlight=False,
    )
    for name, microseconds in told["microseconds"].items():
        console.print(f"{name}: {microseconds} µs", highlight=False)
    console.print(machine.sentence(told["machine"]), highlight=False)


if __name__ == "__main__":
    main(tyro.cli(Arguments))
