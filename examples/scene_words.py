"""A frame as a graph, and the graph as words (§3.2.3)."""

import tyro
from classify import learn_to_see

from semrl.perception.embedding import WordsConfig, sentences


def main(batches: int = 100, objects: int = 3) -> None:
    """Print the words of the first few objects of a frame."""
    perception, game = learn_to_see(batches)
    graph = perception.scene(game.step(0).observation)
    print(f"{len(graph)} objects, {len(graph.edges)} pairs at most {perception.config.scene.proximity_px:.0f} px apart")
    for words in sentences(graph, WordsConfig())[:objects]:
        print(" ".join(words))


if __name__ == "__main__":
    tyro.cli(main)
