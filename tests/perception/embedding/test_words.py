import hashlib
import os
import subprocess
import sys

import numpy as np
import pytest

from semrl.core import SceneGraph
from semrl.core.errors import UsageError
from semrl.perception.embedding import WordsConfig, build_scene_graph, document, sentences, wl_hashes

# The words of one object as the thesis prints them in §3.2.3, but the last, whose surroundings are unknown.
PRINTED = [
    "8", "pos_x4", "pos_y21", "apr_pos_x0", "apr_pos_y4", "8pos_x4", "8pos_y21", "8apr_pos_x0", "8apr_pos_y4",
    "8apr_pos_x0apr_pos_y4", "8pos_x48pos_y21", "apr_pos_x0apr_pos_y4", "pos_x48pos_y21",
]  # fmt: skip
PRINTED_HASH = "dab5edacccee84e7f5d123489f3e151c"


def digest(text: str) -> str:
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def random_scene(seed: int, count: int = 25, kinds: int = 4) -> SceneGraph:
    rng = np.random.default_rng(seed)
    return build_scene_graph(rng.integers(0, kinds, count), rng.uniform(0, 84, (count, 2)), 20.0)


def test_the_printed_example_word_by_word() -> None:
    centres = [[4.9, 21.5], [5, 10], [5, 15], [5, 27], [5, 33], [15, 21]]
    scene = build_scene_graph(np.array([8, 1, 1, 1, 1, 1]), np.array(centres), 20.0)
    words = document(scene, WordsConfig())
    assert words[:13] == PRINTED
    assert words[13] == PRINTED_HASH
    assert len(sentences(scene, WordsConfig())[0]) == WordsConfig().words_per_object == 15


def test_the_sentences_of_pv_dm() -> None:
    scene = build_scene_graph(np.array([8]), np.array([[4.9, 21.5]]), 20.0)
    config = WordsConfig(form="pv-dm")
    assert document(scene, config)[:5] == PRINTED[:5]
    assert document(scene, config)[5:] == [digest("8"), digest(digest("8"))]
    assert config.words_per_object == 7


def test_coarse_cells_have_the_width_asked_for() -> None:
    scene = build_scene_graph(np.array([3]), np.array([[59.0, 60.0]]), 20.0)
    words = sentences(scene, WordsConfig(form="pv-dm", coarse_px=10))[0]
    assert words[3:5] == ("apr_pos_x5", "apr_pos_y6")


def test_hashes_of_a_path_by_hand() -> None:
    # 5 ─ 7 ─ 5, the ends too far from each other
    scene = build_scene_graph(np.array([5, 7, 5]), np.array([[0, 0], [0, 15], [0, 30]]), 20.0)
    end, middle = digest("57"), digest("755")
    assert wl_hashes(scene, 2) == [
        (end, digest(end + middle)),
        (middle, digest(middle + end + end)),
        (end, digest(end + middle)),
    ]
    assert wl_hashes(scene, 0) == [(), (), ()]


@pytest.mark.parametrize("seed", range(5))
def test_hashes_are_those_of_networkx(seed: int) -> None:
    networkx = pytest.importorskip("networkx")
    scene = random_scene(seed)
    graph = networkx.Graph()
    graph.add_nodes_from((i, {"kind": str(kind)}) for i, kind in enumerate(scene.classes.tolist()))
    graph.add_edges_from(scene.edges.tolist())
    theirs = networkx.weisfeiler_lehman_subgraph_hashes(graph, node_attr="kind", iterations=3, digest_size=16)
    assert [tuple(theirs[i]) for i in range(len(scene))] == wl_hashes(scene, 3)


@pytest.mark.parametrize("seed", range(5))
def test_renumbering_the_objects_reorders_their_words_and_changes_none(seed: int) -> None:
    scene = random_scene(seed)
    order = np.random.default_rng(seed).permutation(len(scene))
    other = build_scene_graph(scene.classes[order], scene.centres_px[order], 20.0)
    words = sentences(scene, WordsConfig())
    assert sentences(other, WordsConfig()) == [words[i] for i in order]


def test_hashes_tell_surroundings_within_k_edges_and_nothing_beyond() -> None:
    centres = np.array([[0, 15 * i] for i in range(6)], dtype=np.float32)
    before = wl_hashes(build_scene_graph(np.array([1, 1, 1, 1, 1, 1]), centres, 20.0), 2)
    after = wl_hashes(build_scene_graph(np.array([1, 1, 1, 1, 1, 2]), centres, 20.0), 2)
    changed = [[a != b for a, b in zip(old, new, strict=True)] for old, new in zip(before, after, strict=True)]
    # object 4 is one edge away from the change, object 3 two, the others farther
    assert changed == [[False, False]] * 3 + [[False, True], [True, True], [True, True]]


def test_a_document_is_the_sentences_in_the_order_of_objects() -> None:
    scene = random_scene(1)
    texts = sentences(scene, WordsConfig())
    assert [text[0] for text in texts] == [str(kind) for kind in scene.classes]
    assert document(scene, WordsConfig()) == [word for text in texts for word in text]


def test_a_class_may_be_any_integer_and_a_scene_empty() -> None:
    scene = build_scene_graph(np.array([-1, 123]), np.array([[0.0, 0.0], [80.0, 80.0]]), 20.0)
    assert [text[0] for text in sentences(scene, WordsConfig())] == ["-1", "123"]
    nothing = build_scene_graph(np.zeros(0, dtype=int), np.zeros((0, 2)), 20.0)
    assert document(nothing, WordsConfig()) == []


def test_words_are_the_same_in_every_process() -> None:
    code = (
        "import numpy as np; from semrl.perception.embedding import *\n"
        "scene = build_scene_graph(np.arange(6) % 3, np.arange(12.0).reshape(6, 2) * 4, 20.0)\n"
        "print(document(scene, WordsConfig()))"
    )
    runs = [
        subprocess.run(
            [sys.executable, "-c", code],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    ]
    scene = build_scene_graph(np.arange(6) % 3, np.arange(12.0).reshape(6, 2) * 4, 20.0)
    assert runs == [f"{document(scene, WordsConfig())}\n"] * 2


@pytest.mark.parametrize("settings", [{"form": "bag"}, {"wl_iterations": -1}, {"coarse_px": 0}])
def test_bad_settings_are_refused(settings: dict) -> None:
    with pytest.raises(UsageError):
        WordsConfig(**settings)
