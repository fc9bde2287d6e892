"""The kinds of objects in Pong: PCA, then Birch, each until it is stable (§3.2.2, §3.2.3)."""

import numpy as np
import tyro

from semrl import Pipeline, make_env
from semrl.envs import Game
from semrl.perception.config import PipelineConfig
from semrl.perception.detection.grey import to_grey
from semrl.perception.pretraining.schedule import Schooling
from semrl.perception.pretraining.stability import StabilityConfig


def learn_to_see(batches: int) -> tuple[Pipeline, Game]:
    """Train perception on random play; stability is judged after so many batches (the thesis: 250)."""
    pipeline, game = Pipeline(PipelineConfig(embedding="hashed"), "embedding"), Game(make_env(), seed=0)
    schooling, rng = Schooling(pipeline, StabilityConfig(batches=batches)), np.random.default_rng(0)
    observation = game.reset()
    while schooling.current:
        schooling.learn(observation)
        outcome = game.step(int(rng.integers(game.n_actions)))
        observation = game.reset() if outcome.done else outcome.observation
    return pipeline, game


def main(batches: int = 100) -> None:
    """Print the kind of every object in the frame where learning ended."""
    pipeline, game = learn_to_see(batches)
    objects = pipeline.detector.detect(to_grey(game.step(0).observation.frame))
    variance = pipeline.pca.explained_variance_ratio_.sum()
    print(
        f"{variance:.1%} of the variance kept; {pipeline.birch.n_leaves_} leaves, {len(pipeline.birch.classes_)} kinds"
    )
    for number, (row, column) in zip(pipeline.classes(objects), objects.centres_px, strict=True):
        print(f"kind {number} at row {row:4.1f}, column {column:4.1f}")


if __name__ == "__main__":
    tyro.cli(main)
