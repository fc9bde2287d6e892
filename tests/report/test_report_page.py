import json
import re

import numpy as np
import pytest
from pages import Wellformed

from semrl.core.arrays import json_to_array, nest, ragged_to_arrays
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import read_arrays, write_arrays, write_text
from semrl.perception.config import PerceptionConfig
from semrl.perception.encoders import ENCODERS
from semrl.report import scenes, wording, write_report
from semrl.training import RunConfig, RunFolder
from semrl.training.config import to_dict
from semrl.training.metrics import MetricsFile, read_metrics

SEEN = PerceptionConfig(embedder="hashed")
RETURNS = [-21.0, -20.0, -18.0, -19.0, -12.0]


def make_run(path, *, model="semantic", seed=0, metrics=True, evaluation=True, gallery=True, decisions=10_000):
    config = RunConfig(model=model, seed=seed, decisions=decisions)
    folder = RunFolder.create(path, config)
    if metrics:
        write_metrics(folder.metrics_path)
    if evaluation:
        content = {"run": str(path), "policy": "agent", "episodes": 30, "returns": []}
        content |= {"mean": -12.3, "std": 3.5, "min": -19.0, "max": 4.0}
        content["conditions"] = {"decisions": 5900, "seed": 1, "max_noops": 30}
        write_text(path / "evaluation.json", json.dumps(content))
    if gallery:
        write_arrays(path / "gallery.npz", gallery_arrays())
    return path


def write_metrics(path):
    file = MetricsFile(path)
    for i in range(1, 301):
        stability = {"stability": 0.5 / (i - 250)} if i > 250 else {}
        file.write({"phase": "reduction", "decisions": i, "batches": i, **stability})
        agreement = {"stability": 0.9, "clusters": 12} if i > 250 else {"clusters": 12}
        file.write({"phase": "clustering", "decisions": 300 + i, "batches": i, **agreement})
    for i, value in enumerate(RETURNS):
        row = {"episode": i + 1, "policy": "agent", "return": value, "loss": float("nan"), "decisions": 1900 + 1000 * i}
        file.write({"phase": "agent", **row})
    file.close()


def gallery_arrays():
    rng = np.random.default_rng(0)
    boxes = [np.array([[10, 20, 4, 8], [40, 42, 3, 3]]), np.empty((0, 4), np.int64)]
    classes = [np.array([0, 11]), np.empty(0, np.int64)]
    edges = [np.array([[0, 1]]), np.empty((0, 2), np.int64)]
    return {
        "meta": json_to_array({"encoder": "scene", "names": [], "seed": 0, "decisions": 5900, "played": 1000}),
        "frames": rng.integers(0, 255, (2, 210, 168, 3), dtype=np.uint8),
        "greys": rng.integers(0, 255, (2, 84, 84), dtype=np.uint8),
        "vectors": rng.normal(size=(2, 10)).astype(np.float32),
        "palette": np.array([(1, 2, 3), (171, 205, 239)], np.uint8),
        "threshold": np.array(101.5),
        "explained_variance_ratio": np.array([0.75, 0.125]),
        "n_clusters": np.array(14),
        "class_numbers": np.array([0, 11]),
        "class_counts": np.array([9, 99]),
        "centres": rng.random((2, 8, 8)),
        **nest(
            boxes=ragged_to_arrays(boxes, like=np.empty((0, 4), np.int64)),
            classes=ragged_to_arrays(classes, like=np.empty(0, np.int64)),
            edges=ragged_to_arrays(edges, like=np.empty((0, 2), np.int64)),
        ),
    }


def page_of(*runs, defaults=True):
    out = runs[0].parent / "page.html"
    assert write_report(runs, out, defaults=to_dict(RunConfig()) if defaults else None) == out
    text = out.read_text()
    return text, Wellformed(text)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    run = make_run(tmp_path_factory.mktemp("runs") / "whole")
    (run / "video.mp4").write_bytes(b"not really a film")
    return page_of(run)


def test_the_answer_comes_first(whole):
    words = " ".join(whole[1].words.split())
    assert words.index("−12.3 ± 3.5") < words.index("Learning")
    for told in ("over 30 evaluation episodes", "up to 30 random no-op", "between −19 and 4", "semantic on Pong"):
        assert told in words
    assert "Mean return of the 5 training episodes: −18." in words
    assert "Trained for 5,900 decisions (23,600 frames)" in words


def test_numbers_of_perception_are_on_the_page(whole):
    words = " ".join(whole[1].words.split())
    for told in (
        "101.5",
        "87.5 %",
        "14",
        "goal 0.05",
        "goal 0.95",
        "after 300 batches",
        "0.01",
        "2 objects of 2 kinds",
    ):
        assert told in words
    assert words.index("99") < words.index("Path to stability")


@pytest.mark.parametrize("encoder", ENCODERS.names()[:7])
def test_every_encoder_has_a_sentence(tmp_path, encoder):
    run = make_run(tmp_path / "run", gallery=False)
    images = len(ENCODERS.load(encoder)(SEEN, rom="pong").space.shape) == 2
    arrays = gallery_arrays()
    meta = {"encoder": encoder, "names": [], "seed": 0, "decisions": 5900, "played": 1000}
    vectors = arrays.pop("vectors")
    shown = {"shown": arrays["greys"]} if images else {"vectors": vectors}
    write_arrays(run / "gallery.npz", {**arrays, **shown, "meta": json_to_array(meta)})
    text, page = page_of(run)
    assert wording.SEES[encoder] in page.words and text.count("What the agent is shown of it") == 2


def test_rules_stand_under_their_concepts_with_a_picture_of_each(tmp_path):
    run = make_run(tmp_path / "run", gallery=False)
    notes = {
        "encoder": "objects", "names": [], "seed": 0, "decisions": 5900, "played": 1000,
        "learned": [
            {"name": "the reward", "moved": "", "says": ["+1 by ball if it is lost  (2 of 3)"]},
            {"name": "ball", "moved": "autonomous",
             "says": ["vx := −vx if it touches <b>me</b>  (7 of 9)", "vy turns otherwise  (1 of 900)"]},
        ],
    }  # fmt: skip
    pictures = nest(pictures={"ball": np.zeros((4, 3, 3), np.uint8)})
    write_arrays(run / "gallery.npz", {**gallery_arrays(), **pictures, "meta": json_to_array(notes)})
    text, page = page_of(run)
    reward, ball = scenes.concepts(read_arrays(run / "gallery.npz"))
    assert (reward.name, reward.picture, len(reward.rules)) == ("the reward", None, 1)
    assert (ball.name, len(ball.rules)) == ("ball", 2) and ball.picture.startswith("data:image/png")
    assert "What it has learned of its world" in page.words and "vx := −vx if it touches <b>me</b>" in page.words
    assert "<b>me</b>" not in text, "names are text"
    other = make_run(tmp_path / "other")
    assert "What it has learned" not in page_of(other)[1].words


def test_it_needs_nothing_else(whole):
    assert all(url.startswith(("data:", "#")) for url in whole[1].fetched)
    assert not re.search(r"""(src|href)\s*=\s*["']?\s*(https?:)?//""", whole[0])
    assert not re.search(r"@import|url\((?!#)", whole[0])
    assert "data:video/mp4;base64," in whole[0]


def test_it_can_be_read_aloud(whole):
    page = whole[1]
    assert page.unlabelled == []
    assert len(page.ids) == len(set(page.ids))
    assert page.headings[0] == 1 and page.headings.count(1) == 1
    assert all(below <= above + 1 for above, below in zip(page.headings, page.headings[1:], strict=False))


def test_boxes_lie_where_the_frame_has_the_object(whole):
    # 84 × 84 to 168 × 210: twice as wide, 2.5 times as high; class 11 has colour 11 mod 2
    assert '<rect x="40.0" y="25.0" width="16.0" height="10.0" stroke="#010203"/>' in whole[0]
    assert '<rect x="84.0" y="100.0" width="6.0" height="7.5" stroke="#abcdef"/>' in whole[0]
    assert '<path class="joined" d="M48.0 30.0L87.0 103.8"/>' in whole[0]


def test_changed_settings_come_before_the_others(whole):
    changed, rest = whole[0].split("at their defaults</summary>")
    assert "<code>decisions</code></th><td>10000</td>" in changed
    assert "<code>dqn.batch_size</code>" in rest and "<code>dqn.batch_size</code>" not in changed


def test_provenance_is_folded_in(whole):
    for name in ("versions.numpy", "machine.cores", "threads", "seed", "status"):
        assert f"<code>{name}</code>" in whole[0]


def test_the_same_run_gives_the_same_page(tmp_path):
    run = make_run(tmp_path / "run")
    assert page_of(run)[0] == page_of(run)[0]


def test_what_is_missing_is_said(tmp_path):
    run = make_run(tmp_path / "new", metrics=False, evaluation=False, gallery=False)
    words = " ".join(page_of(run, defaults=False)[1].words.split())
    assert f"Not evaluated yet semrl eval {run}" in words
    for told in ("not measured anything", "no learning curve yet", "no gallery", f"--video {run}/video.mp4"):
        assert told in words


def test_an_early_run_has_no_path_yet(tmp_path):
    run = make_run(tmp_path / "early", metrics=False)
    file = MetricsFile(run / "metrics.csv")
    file.write({"phase": "reduction", "decisions": 1, "batches": 1})
    file.close()
    words = page_of(run)[1].words
    assert "Reduction has not been compared yet" in words
    assert "has not finished an episode yet" in words


def test_a_run_with_a_map_tells_how_far_it_sees_ahead(tmp_path):
    def words(run):
        return " ".join(page_of(run)[1].words.split())

    run = make_run(tmp_path / "run", model="ram-map")
    assert "semrl predict" not in words(make_run(tmp_path / "other"))
    file = MetricsFile(run / "metrics.csv")
    file.write({"phase": "agent", "decisions": 9000, "episode": 6, "return": 1.0, "map_nodes": 12})
    file.close()
    assert f"semrl predict {run}" in words(run)
    told = {"decisions": 2345, "explained": {"1": 0.99, "20": -0.5}, "balanced_accuracy": 0.9}
    told["confusion"] = [[7, 1, 0], [2, 2300, 3], [0, 4, 28]]
    write_text(run / "predictions.json", json.dumps(told))
    tested = words(run)
    assert "on 2,345 decisions" in tested
    assert "losses predicted 7 of 8 gains predicted 28 of 32 false alarms 5 Rewards, one decision ahead" in tested
    assert f"semrl rules {run}" in tested and "Share of the variance of the states" in page_of(run)[0]


def test_games_of_the_planner_are_not_the_agents(tmp_path):
    run = make_run(tmp_path / "run", model="ram-map")
    before = page_of(run)[1].words
    file = MetricsFile(run / "metrics.csv", n_rows=len(read_metrics(run / "metrics.csv")))
    for i in range(10):
        row = {"episode": 6 + i, "policy": "planner", "return": 21.0, "decisions": 9000 + i}
        file.write({"phase": "agent", **row})
    file.close()
    after = page_of(run)[1].words
    assert "Mean return of the 5 training episodes: −18." in before and "Mean return of the 5 training" in after
    assert "a ring that of one which the planner played" in after and "a ring" not in before


def test_a_large_video_stays_outside(tmp_path):
    run = make_run(tmp_path / "long")
    with (run / "video.mp4").open("wb") as file:
        file.truncate(8_000_000)
    text, page = page_of(run)
    assert "too large for this page" in page.words and len(text) < 1_000_000


def test_several_runs_share_one_chart(tmp_path):
    runs = [make_run(tmp_path / f"seed{seed}", seed=seed, evaluation=seed > 0) for seed in range(3)]
    _, page = page_of(*runs)
    assert "3 runs compared" in page.words
    assert page.words.count("−12.3 ± 3.5") == 4  # in the table and at each of the two evaluated
    assert page.words.count("not yet") == 1
    assert all(f"run-{i}" in page.ids for i in (1, 2, 3))
    assert "#run-3" in page.fetched
    assert len(page.ids) == len(set(page.ids))


def test_runs_of_one_name_are_told_apart(tmp_path):
    runs = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        runs.append(make_run(tmp_path / name / "run", gallery=False))
    _, page = page_of(*runs)
    assert all(str(run) in page.words for run in runs)
    assert len(page.ids) == len(set(page.ids))


def test_hostile_names_are_text(tmp_path):
    name = '<script>alert("$x^2$")</script>&'
    parent = tmp_path / "a'b"
    parent.mkdir()
    run = make_run(parent / name.replace("/", "∕"), evaluation=False)
    manifest = RunFolder.open(run)
    manifest.update_manifest(model="<img src=x onerror=alert(1)>", status='"><b>')
    text, page = page_of(run, run)
    assert "<script" not in text and "<img src=x" not in text and "<b>" not in text.replace("<b>−", "")
    assert "<img src=x onerror=alert(1)>" in page.words


def test_wrong_calls_are_told(tmp_path):
    run = make_run(tmp_path / "run")
    with pytest.raises(UsageError, match="at least one run"):
        write_report([], tmp_path / "page.html")
    with pytest.raises(UsageError, match="is not a run"):
        write_report([tmp_path], tmp_path / "page.html")
    with pytest.raises(UsageError, match="there is no folder"):
        write_report([run], tmp_path / "nowhere" / "page.html")
    (run / "evaluation.json").write_text("{")
    with pytest.raises(SemrlError, match=r"evaluation\.json is damaged"):
        write_report([run], tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()
