"""The kinds of objects in Pong: PCA, then Birch, each until it is stable (§3.2.2, §3.2.3)."""

import numpy as np
import tyro

from semrl import make_env
from semrl.envs import Game
from semrl.perception.config import PerceptionConfig
from semrl.perception.encoders.scene import SceneEncoder
from semrl.perception.perception import Perception
from semrl.perception.pretraining.schedule import PretrainingSchedule
from semrl.perception.pretraining.stability import StabilityConfig


def learn_to_see(batches: int) -> tuple[Perception, Game]:
    """Train perception on random play; stability is judged after so many batches (the thesis: 250)."""
    encoder, config = SceneEncoder(PerceptionConfig(embedder="hashed")), StabilityConfig(batches=batches)
    game, rng = Game(make_env(), seed=0), np.random.default_rng(0)
    schedule, observation = PretrainingSchedule(encoder.stages(config), config), game.reset()
    while schedule.current:
        schedule.learn(observation)
        outcome = game.step(int(rng.integers(game.n_actions)))
        observation = game.reset() if outcome.done else outcome.observation
    return encoder.perception, game


def main(batches: int = 100) -> None:
    """Print the kind of every object in the frame where learning ended."""
    perception, game = learn_to_see(batches)
    objects = perception.detector.detect(game.step(0).observation.frame)
    clusterer = perception.clusterer
    print(
        f"{perception.reducer.dimension} numbers an object; "
        f"{clusterer.n_clusters_} clusters, joined to {len(clusterer.classes_)} kinds"
    )
    for number, (row, column) in zip(perception.classes(objects), objects.centres_px, strict=True):
        print(f"kind {number} at row {row:4.1f}, column {column:4.1f}")


if __name__ == "__main__":
    tyro.cli(main)
