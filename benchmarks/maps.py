"""How the cost of the state map grows with its size (§3.4.1, §3.4.2), on maps that are made for it.

The world is a torus of as many cells as the map shall have nodes, bent into eight dimensions, its cells 1 apart
and seen with a little noise; four actions lead to the neighbouring cells, few of them gain or lose. A tour that
takes every action in every cell fills the map. Then episodes of a random walk are learned, and after each one the
graph is read, routes are planned and decisions are looked up; times are medians of the episodes. At last decisions
are planned as the preset `semrl` does for `ram-map`: scenarios imagined by trees and ranked on the map. Everything runs
in one process on one thread.

    python benchmarks/maps.py [--sizes N ...] [--episodes N] [--json]
"""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import machine
import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from semrl.core import Floats, History, Ints, Trajectory
from semrl.planning import LongTermConfig, plan_routes
from semrl.planning.config import MEMORY_DECISIONS
from semrl.planning.module import PlanningModule
from semrl.planning.state_map import StateMap, StateMapConfig
from semrl.training import preset
from semrl.training.session import limited_threads

DIMENSION = 8
"""Numbers in a state."""

MOVES = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
"""What the actions do to row and column."""

TOUR = np.array([0, 1, 2, 3])
"""Up and back, left and back: done in every cell, this is every action of every cell."""

NOISE = 0.01
"""Standard deviation of each number of a state; cells are 1 apart."""

CONFIG = StateMapConfig(node_threshold=0.2 / DIMENSION, edge_threshold=0.3 / DIMENSION)
"""Radii in which one cell fits, but not two, and one transition, but not two."""

RESOLUTION = 0.25
"""Below it a difference means nothing to the trees: many times the noise, a part of a cell."""

GAINS, LOSSES = 0.002, 0.01
"""Shares of the transitions that gain and lose."""

EPISODE = 2000
"""Decisions in an episode."""

LOOKUPS = 1000
"""Decisions that are looked up after each episode."""

PLANS = 200
"""Decisions that are planned."""

MEASURES = ("insert_s", "rebuild_s", "routes_s", "lookup_us", "plan_ms")


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Time the state map at several sizes."""

    sizes: tuple[int, ...] = (500, 1000, 2000, 5000, 10_000, 20_000, 50_000)
    """Cells of the worlds, which are the nodes of the maps, nearly."""
    episodes: int = 7
    """Episodes learned at each size; the median counts."""
    json: bool = False
    """Print one JSON object and nothing else."""


class Torus:
    """A world of about `cells` cells in rows and columns that close upon themselves."""

    def __init__(self, cells: int, seed: int = 0) -> None:
        self.rng = np.random.default_rng(seed)
        rows = round(np.sqrt(cells))
        self.shape = np.array([rows, round(cells / rows)])
        self.axes = np.linalg.qr(self.rng.normal(size=(DIMENSION, 4)))[0].T  # (4, 8)
        kinds = [GAINS, LOSSES, 1 - GAINS - LOSSES]
        self.rewards = self.rng.choice([1.0, -1.0, 0.0], size=(*self.shape, 4), p=kinds)

    def see(self, cells: Ints) -> Floats:
        """Return the states of cells given as ``(n, 2)`` rows and columns."""
        angles, radii = cells * (2 * np.pi / self.shape), self.shape / (2 * np.pi)
        circles = np.concatenate([radii * np.cos(angles), radii * np.sin(angles)], axis=1)  # (n, 4)
        noise = NOISE * self.rng.normal(size=(len(cells), DIMENSION))
        return (circles @ self.axes + noise).astype(np.float32)

    def follow(self, start: NDArray[Any], actions: Ints) -> Trajectory:
        """Take actions from a cell on."""
        cells = (start + np.concatenate([[[0, 0]], np.cumsum(MOVES[actions], axis=0)])) % self.shape
        rewards = self.rewards[cells[:-1, 0], cells[:-1, 1], actions]
        return Trajectory(states=self.see(cells), actions=actions, rewards=rewards.astype(np.float32))

    def tour(self) -> Trajectory:
        """Take every action in every cell."""
        right, down = np.array([3]), np.array([1])
        row = np.concatenate([np.concatenate([TOUR, right])] * int(self.shape[1]))
        return self.follow(np.zeros(2, np.int64), np.concatenate([row, down] * int(self.shape[0])))

    def walk(self, decisions: int) -> Trajectory:
        """Walk at random from any cell."""
        return self.follow(self.rng.integers(self.shape), self.rng.integers(4, size=decisions))


def main(arguments: Arguments) -> None:
    """Fill, measure, tell."""
    with limited_threads(1):
        measure(100, 1)  # warm: compiled code, caches of libraries
        rows = [measure(cells, arguments.episodes) for cells in arguments.sizes]
        kind = machine.describe()
    exponents = {name: exponent(rows, name) for name in MEASURES} if len(rows) > 1 else {}
    if arguments.json:
        print(json.dumps({"machine": kind, **vars(arguments), "rows": rows, "exponents": exponents}))
        return
    table = Table(
        "cells", "nodes", "edges", "insert, s", "rebuild, s", "routes, s", "look-up, µs", "plan, ms", "steps", box=None
    )
    for column in table.columns:
        column.justify = "right"
    for row in rows:
        counts = [f"{row[name]:,.0f}" for name in ("cells", "nodes", "edges")]
        times = [f"{row[name]:.4f}" for name in MEASURES[:3]]
        table.add_row(*counts, *times, f"{row['lookup_us']:.1f}", f"{row['plan_ms']:.2f}", f"{row['steps']:.1f}")
    if exponents:
        table.add_row("exponent", "", "", *(f"{exponents[name]:.2f}" for name in MEASURES), "")
    console = Console()
    console.print(table)
    console.print(
        f"Medians of {arguments.episodes} episodes of {EPISODE} decisions, {DIMENSION} numbers a state. A look-up is "
        "one decision's: locate the state, read the path, which has that many steps. A plan is one decision's as well: "
        "imagine scenarios, rank them, the median. Exponents are of the nodes.",
        highlight=False,
    )
    console.print(machine.sentence(kind), highlight=False)


def measure(cells: int, episodes: int) -> dict[str, float]:
    """Return sizes and median times of one map."""
    world = Torus(cells)
    state_map = StateMap(CONFIG, DIMENSION, len(MOVES), changes=True).partial_fit(world.tour())
    times: dict[str, list[float]] = {name: [] for name in MEASURES}
    for _ in range(episodes):
        episode, seen = world.walk(EPISODE), world.see(world.rng.integers(world.shape, size=(LOOKUPS, 2)))
        # The first half of `partial_fit`; with a single state, the second half is what takes time.
        times["insert_s"].append(seconds(lambda episode=episode: state_map._insert(episode)))
        single = world.walk(0)
        times["rebuild_s"].append(seconds(lambda single=single: state_map.partial_fit(single)))
        graph = state_map.graph_
        times["routes_s"].append(seconds(lambda graph=graph: plan_routes(graph, LongTermConfig())))
        routes = plan_routes(graph, LongTermConfig())
        start = time.perf_counter()
        lengths = [len(routes.path(int(state_map.locate(seen[i : i + 1])[0]))) for i in range(LOOKUPS)]
        times["lookup_us"].append((time.perf_counter() - start) / LOOKUPS * 1e6)
    times["plan_ms"] = plans(world, state_map)
    sizes = {"cells": float(world.shape.prod()), "nodes": float(len(graph)), "edges": float(len(graph.sources))}
    ways = [length - 1 for length in lengths if length]  # a small world may have no goal
    steps = sum(ways) / max(len(ways), 1)
    return sizes | {name: float(np.median(values)) for name, values in times.items()} | {"steps": steps}


def plans(world: Torus, state_map: StateMap) -> list[float]:
    """Return how many milliseconds each of some decisions takes to be planned."""
    given = preset("semrl", "ram-map").planning
    config = replace(given, state_map=CONFIG, velocity_weight=0.0, trees=replace(given.trees, resolution=RESOLUTION))
    planning = PlanningModule(config, DIMENSION, len(MOVES), seed=0)
    planning.learn(world.walk(EPISODE))
    planning.state_map, planning.routes = state_map, plan_routes(state_map.graph_, LongTermConfig())
    lived = world.walk(PLANS + MEMORY_DECISIONS)
    histories = [
        History(states=lived.states[t : t - MEMORY_DECISIONS : -1], actions=lived.actions[:t][::-1], number=t)
        for t in range(MEMORY_DECISIONS, PLANS + MEMORY_DECISIONS)
    ]
    return [1000 * seconds(lambda history=history: planning.plan(history)) for history in histories]


def seconds(call: Callable[[], object]) -> float:
    """Return how long a call took."""
    start = time.perf_counter()
    call()
    return time.perf_counter() - start


def exponent(rows: list[dict[str, float]], name: str) -> float:
    """Return b of the power a·nodesᵇ that fits best, on logarithmic axes."""
    nodes, values = (np.log([row[key] for row in rows]) for key in ("nodes", name))
    return float(np.polyfit(nodes, values, 1)[0])


if __name__ == "__main__":
    main(tyro.cli(Arguments))
