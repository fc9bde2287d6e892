"""The boxes that the thesis names as alternatives, beside its own: the tests of §4.1 on the same objects.

Otsu's threshold and PCA are learned from random play as in a run of the model ``birch``. Then every clusterer learns,
frame by frame, from the objects of the same further random play, and tells the classes of those of a new episode.
There the validation indices are computed, the Dunn index on every tenth object, as in §4.1.2. "rand" is the adjusted
Rand index with Birch's classes. `SVMClassifier` learns the classes of a Birch of its own; the share of objects to
which it gives its teacher's class is printed, over all objects and as a mean over classes. Both detectors are compared
by what they find in a frame of the new episode.

    python benchmarks/clusterers.py [--env NAME] [--preset NAME] [--seed S] [--decisions N] [--json]
"""

import json
import time
from dataclasses import dataclass
from itertools import islice
from typing import Any

import machine
import numpy as np
import tyro
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from sklearn.metrics import adjusted_rand_score

from semrl.core import Image, Ints
from semrl.perception.clustering import Birch
from semrl.perception.clustering.kmeans import KMeans
from semrl.perception.clustering.protocol import Clusterer
from semrl.perception.clustering.som import SelfOrganisingMap
from semrl.perception.clustering.svm import SVMClassifier
from semrl.perception.detection.grey import to_grey
from semrl.perception.detection.segmentation import KMeansDetector
from semrl.perception.pretraining.stability import label_agreement
from semrl.training import RunConfig, preset
from semrl.training.session import limited_threads
from semrl_thesis.cluster_indices import davies_bouldin, dunn, silhouette
from semrl_thesis.clusters import DUNN_EVERY
from semrl_thesis.perception import PLAY_SEED, Schooled, new_run, random_play, school


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """Compare clusterers and detectors."""

    env: str = "PongNoFrameskip-v4"
    """The game."""
    preset: str = "thesis"
    """Of detection, PCA and Birch."""
    seed: int = 0
    """Of the random play."""
    decisions: int = 1_000
    """Decisions of random play that each clusterer learns from."""
    test_decisions: int = 1_000
    """Most decisions of the new episode."""
    every: int = 1
    """Silhouette and Davies–Bouldin take every so many objects."""
    json: bool = False
    """Print one JSON object and nothing else."""


def main(arguments: Arguments) -> None:
    """Learn to see, let every box learn from the same play, test them on the same episode."""
    with limited_threads(1):
        config = preset(arguments.preset, "birch", {"env": arguments.env, "seed": arguments.seed})
        schooled = school(config, "classes")
        play = random_play(config, arguments.seed + PLAY_SEED)
        learned = [to_grey(each.frame) for each in islice(play, arguments.decisions)]
        new = [to_grey(each.frame) for each in new_run(config, arguments.test_decisions)]
        result = {
            "env": arguments.env,
            "preset": arguments.preset,
            "seed": arguments.seed,
            "decisions": len(learned),
            "test_decisions": len(new),
            **compare_clusterers(config, schooled, learned, new, arguments.every),
            "detectors": compare_detectors(schooled, learned, new),
            "machine": machine.describe(),
        }
    if arguments.json:
        print(json.dumps(result))
    else:
        show(result)


def compare_clusterers(
    config: RunConfig, schooled: Schooled, learned: list[Image], new: list[Image], every: int
) -> dict[str, Any]:
    """Return each clusterer's row of the table, and how well the SVM agrees with its teacher."""
    settings = config.pipeline.birch
    svm = SVMClassifier(teacher=Birch(settings))
    boxes: dict[str, Clusterer] = {
        "Birch": Birch(settings),
        "k-means": KMeans(),
        "SOM": SelfOrganisingMap(),
        "SVM": svm,
    }
    batches, rows = reduced(schooled, learned), np.concatenate(reduced(schooled, new))
    found: dict[str, Any] = {}
    by_birch: Ints | None = None
    for name, box in boxes.items():
        start = time.process_time()
        for batch in batches:
            box.partial_fit(batch)
        seconds = time.process_time() - start
        classes = box.predict(rows)
        by_birch = classes if by_birch is None else by_birch
        found[name] = {
            "clusters": box.n_clusters_,
            "classes": len(np.unique(classes)),
            "objects": len(rows),
            "silhouette": silhouette(rows[::every], classes[::every]),
            "davies_bouldin": davies_bouldin(rows[::every], classes[::every]),
            "dunn": dunn(rows[::DUNN_EVERY], classes[::DUNN_EVERY]),
            "rand": float(adjusted_rand_score(by_birch, classes)),
            "ms_a_frame": 1e3 * seconds / len(batches),
        }
    return {"clusterers": found, "svm_agreement": agreement_with_teacher(svm, rows)}


def agreement_with_teacher(pupil: SVMClassifier, rows: NDArray[np.float32]) -> dict[str, float]:
    """Return the share of rows with the teacher's class, over all and as a mean over classes."""
    truth, classes = pupil.teacher.predict(rows), pupil.predict(rows)
    return {"all": float((truth == classes).mean()), "mean_over_classes": label_agreement(truth, classes)}


def reduced(schooled: Schooled, images: list[Image]) -> list[NDArray[np.float32]]:
    """Return the reduced objects of each image that has some."""
    objects = [schooled.pipeline.detector.detect(image) for image in images]
    return [schooled.pipeline.pca.transform(each.features) for each in objects if len(each)]


def compare_detectors(schooled: Schooled, learned: list[Image], new: list[Image]) -> dict[str, dict[str, float]]:
    """Return each detector's row of the table."""
    by_clusters = KMeansDetector()
    for image in learned:
        by_clusters.partial_fit(image)
    found = {}
    for name, detector in (("Otsu", schooled.pipeline.detector), ("k-means", by_clusters)):
        objects = np.array([len(detector.detect(image)) for image in new])
        components = np.array([detector.components(image).max() for image in new])
        found[name] = {
            "objects": float(objects.mean()),
            "objects_min": int(objects.min()),
            "objects_max": int(objects.max()),
            "components": float(components.mean()),
        }
    return found


def show(result: dict[str, Any]) -> None:
    """Print the two tables."""
    console = Console()
    for heading, what in (("clusterer", "clusterers"), ("a frame", "detectors")):
        rows = result[what]
        names = list(next(iter(rows.values())))
        table = Table(heading, *(name.replace("_", "\n") for name in names), box=None, padding=(0, 1, 0, 0))
        for name, row in rows.items():
            table.add_row(name, *(f"{row[key]:.3f}" if isinstance(row[key], float) else str(row[key]) for key in names))
        console.print(table)
    agreement = result["svm_agreement"]
    console.print(
        f"the SVM agrees with its teacher on {agreement['all']:.4f} of the objects, "
        f"{agreement['mean_over_classes']:.4f} as a mean over classes",
        highlight=False,
    )
    console.print(
        f"{result['env']}, preset {result['preset']}, seed {result['seed']}: "
        f"learned from {result['decisions']:,} decisions, "
        f"tested on {result['test_decisions']:,}",
        highlight=False,
    )
    console.print(machine.sentence(result["machine"]), highlight=False)


if __name__ == "__main__":
    main(tyro.cli(Arguments))
