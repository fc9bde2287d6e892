"""Scenes as vectors, and how alike two scenes are (§3.2.3, §4.1.3)."""

import numpy as np
import tyro
from classify import learn_to_see

from semrl.perception.embedding import HashedEmbedding


def main(batches: int = 100, decisions: int = 10) -> None:
    """Print the cosine similarity of each two adjacent frames of a game."""
    perception, game = learn_to_see(batches)
    embedding = HashedEmbedding()
    before = embedding.transform(perception.scene(game.step(0).observation))
    for decision in range(decisions):
        after = embedding.transform(perception.scene(game.step(0).observation))
        cosine = before @ after / max(np.linalg.norm(before) * np.linalg.norm(after), 1e-9)
        print(f"decision {decision + 1:2}: cosine similarity {cosine:.3f}")
        before = after


if __name__ == "__main__":
    tyro.cli(main)
