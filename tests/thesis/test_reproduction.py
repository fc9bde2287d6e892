import contextlib
import io
import json
import sys
from dataclasses import replace

import pytest

from semrl.cli import main
from semrl.evaluation import evaluate
from semrl.training import train
from semrl_thesis import reproduction
from semrl_thesis.base import Context
from semrl_thesis.ledger import Ledger, read_ledger
from semrl_thesis.reproduction import discover
from semrl_thesis.results import Result, read_result, rows_of, write_result
from semrl_thesis.scores import SWEEPS

THESIS = {
    "pca/explained-variance": 99, "birch/batches": 577, "birch/leaves": 14, "birch/classes": 10,
    "clusters/silhouette": 0.887, "clusters/davies-bouldin": 0.528, "clusters/dunn": 0.114,
    "embedding/vocabulary": 9277,
    "embedding/pv-dm/exact": 0.138, "embedding/pv-dm/within-5": 0.218,
    "embedding/pv-dbow/exact": 0.965, "embedding/pv-dbow/within-5": 0.999,
    "embedding/pv-dbow/validation/within-5": 0.665, "embedding/pv-dbow/validation/within-100": 0.840,
    "embedding/pv-dbow/validation/within-200": 0.969,
    "embedding/direct-search/within-5": 0.843, "embedding/direct-search/within-100": 0.999,
    "embedding/direct-search/within-200": 1.0,
    "embedding/pv-dbow/ratio/within-5": 0.789, "embedding/pv-dbow/ratio/within-100": 0.841,
    "embedding/pv-dbow/ratio/within-200": 0.969,
    "embedding/pv-dbow/pearson": -0.463,
    "next-state/semantic/trained": 31.5, "next-state/ram/trained": 97.3,
    "reward/semantic/trained": 34.6, "reward/ram/trained": 33.3,
    "map/semantic/nodes": 2184, "map/semantic/edges": 6969, "map/semantic/diameter": 20, "map/semantic/radius": 9,
    "map/ram/nodes": 185, "map/ram/edges": 1966, "map/ram/diameter": 17, "map/ram/radius": 8,
    "planner-alone/ram-map/mean": -21, "planner-alone/semantic-map/mean": -21,
    **{
        f"table4.1/{model}/{name}": value
        for model, values in {
            "baseline": (20.8, 21, 20, 0.42), "otsu": (20.1, 21, 18, 1.19), "birch": (20.4, 21, 18, 0.96),
            "semantic": (13.6, 20, -10, 9.60), "semantic-map": (14.1, 21, 3, 6.26),
            "ram": (-6.4, 4, -12, 4.55), "ram-map": (-0.6, 8, -6, 4.76),
        }.items()
        for name, value in zip(("mean", "max", "min", "std"), values, strict=True)
    },
}  # fmt: skip
"""Numbers of chapter 4 that must have a row, under ids that others build on."""


@pytest.fixture(scope="module")
def out(tmp_path_factory):
    """A folder whose tiny runs are trained already, with all that is made of them."""
    folder = tmp_path_factory.mktemp("reproduced")
    for spec in SWEEPS["tiny"].runs():
        train(folder / "runs" / spec.id, spec.config())
        evaluate(folder / "runs" / spec.id, episodes=1, policy="planner")
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        assert main(["reproduce", "--scale", "tiny", "--out", str(folder), "--json"]) == 0
    (folder / "told.json").write_text(said.getvalue())
    return folder


def test_every_number_of_the_thesis_has_a_row():
    rows = {row.id: row for e in discover().values() for row in rows_of(e.numbers, {})}
    assert {id_: rows[id_].thesis for id_ in THESIS} == THESIS
    assert all(row.better in ("higher", "lower", "near") and row.ours is None for row in rows.values())


@pytest.mark.slow
def test_everything_is_measured_and_told(out):
    (line,) = (out / "told.json").read_text().splitlines()
    rows = {row["id"]: row for row in json.loads(line)["results"]}
    assert THESIS.keys() <= rows.keys()
    assert all(list(row) == ["id", "thesis", "ours", "unit", "better"] for row in rows.values())
    measured = {id_ for id_, row in rows.items() if row["ours"] is not None}
    assert {id_ for id_ in THESIS if id_.startswith(("pca", "birch", "clusters", "embedding"))} <= measured
    assert {f"{id_}@semrl" for id_ in THESIS if id_.startswith(("next-state", "reward", "map", "planner"))} <= measured
    frontier = {"objects/agent/mean", "objects-map/agent/sticky", "objects-map/planner/lowest-seed", "sb3-ram/sticky"}
    assert {f"frontier/{id_}" for id_ in frontier} | {"games/catch/planner/mean", "games/catch/minutes"} <= measured
    page = (out / "report.html").read_text()
    numbers = [f"3.{i}" for i in (1, 2, 3, 4, 6, 8, 9)] + [f"4.{i}" for i in range(1, 21)]
    assert [n for n in numbers if f"Fig. {n}:" not in page] == []


@pytest.mark.slow
def test_what_comes_with_the_package_needs_no_runs(out, tmp_path, monkeypatch, call):
    """Ledger and results count as done, and what was not asked for is on the page all the same."""

    def unless_kept(experiment, context):
        assert reproduction._kept(experiment, context.folders, reproduction._fingerprint(experiment, context))

    monkeypatch.setattr(reproduction, "SHIPPED", out)
    monkeypatch.setattr(reproduction, "SHIPPED_SCALE", "tiny")
    monkeypatch.setattr(reproduction, "_result", unless_kept)
    told = call("reproduce", "scores", "clusters", "--scale", "tiny", "--out", tmp_path, "--json")
    assert told.status == 0
    named = {row["id"].split("/")[0] for row in json.loads(told.out)["results"]}
    assert named == {"pca", "birch", "new-run", "clusters", "table4.1", "planner-alone"}
    assert (tmp_path / "report.html").read_text() == (out / "report.html").read_text()
    assert not (tmp_path / "runs").exists()


@pytest.mark.slow
def test_the_test_of_a_run_outlives_its_folder(out, tmp_path):
    ontology = discover()["ontology"]
    context = Context(scale="tiny", folder=tmp_path, ledger=read_ledger([out]), shipped=(out,))
    settings = ontology.settings["tiny"]
    kept = ontology.measure(settings, context)
    assert not (tmp_path / "runs").exists() and not any("was not tested" in note for note in kept.notes)
    assert kept.values == read_result(out / "ontology.npz").values
    assert {figure.number for figure in kept.figures} >= {"4.12", "4.15", "4.18"}
    again = ontology.measure(replace(settings, decisions=99), context)  # other settings: the folder is wanted, and gone
    assert not again.values and len(again.notes) == 2


def test_nothing_trained_is_told_on_the_page(tmp_path, call):
    assert call("reproduce", "ontology", "scores", "--scale", "tiny", "--out", tmp_path, "--workers", 0).status == 0
    page = (tmp_path / "report.html").read_text()
    assert "not finished yet: semrl-ram-map-0, semrl-semantic-map-0" in page
    assert "semrl-ram-map-0 was not tested" in page


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["clustres"], "unknown experiment 'clustres'; did you mean 'clusters'?"),
        (["scores", "--only", "semrl-chess*"], "no run matches 'semrl-chess*'; there are semrl-ram-map-0"),
        (["--scale", "huge"], "invalid choice 'huge'"),
        (["--workers", "3"], "invalid choice '3'"),
    ],
)
def test_wrong_calls(tmp_path, call, words, said):
    told = call(
        "reproduce", *words, *(["--scale", "tiny"] if "--scale" not in words else []), "--out", tmp_path / "out"
    )
    assert told.status == 2
    assert said in told.message
    assert not (tmp_path / "out").exists()


def test_a_folder_that_cannot_be(tmp_path, call):
    (tmp_path / "file").write_text("")
    told = call("reproduce", "--scale", "tiny", "--out", tmp_path / "file" / "out")
    assert told.status == 2
    assert "cannot make the folder" in told.message


def test_a_damaged_ledger(tmp_path, call):
    (tmp_path / "runs.csv").write_text("id,seed\n")
    told = call("reproduce", "scores", "--scale", "tiny", "--out", tmp_path)
    assert told.status == 1
    assert "runs.csv is damaged" in told.message


def test_without_runs_there_is_no_number(tmp_path):
    scores = discover()["scores"]
    context = Context(scale="tiny", folder=tmp_path, ledger=Ledger(scores={}, returns={}, outcomes={}))
    result = scores.measure(scores.settings["tiny"], context)
    assert not result.values
    assert not result.figures


def test_what_lacked_an_extra_is_measured_again_once_it_is_there(tmp_path, monkeypatch):
    experiment = discover()["frontier"]
    write_result(tmp_path / "frontier.npz", Result(values={"a": 1.0}, lacks=("sb3",)), "settings")
    monkeypatch.setitem(reproduction.EXTRAS, "sb3", "no_such_module")
    assert reproduction._kept(experiment, [tmp_path], "settings").values == {"a": 1.0}
    monkeypatch.setitem(reproduction.EXTRAS, "sb3", "json")
    assert reproduction._kept(experiment, [tmp_path], "settings") is None
    assert reproduction._kept(experiment, [tmp_path]) is not None  # to be shown


def test_of_several_results_the_one_of_these_settings_is_told(tmp_path):
    experiment = discover()["clusters"]
    here, shipped = tmp_path / "here", tmp_path / "shipped"
    context = Context(scale="tiny", folder=here, ledger=Ledger(scores={}, returns={}, outcomes={}), shipped=(shipped,))
    for folder, leaves, settings in (
        (here, 1.0, "older"),
        (shipped, 14.0, reproduction._fingerprint(experiment, context)),
    ):
        folder.mkdir()
        write_result(folder / "clusters.npz", Result(values={"birch/leaves": leaves}), settings)
    (section,) = reproduction._sections(context)
    assert {row.id: row.ours for row in section.rows}["birch/leaves"] == 14


def test_what_could_not_be_tested_is_tried_again(tmp_path):
    experiment = discover()["ontology"]
    write_result(tmp_path / "ontology.npz", Result(values={}, whole=False), "settings")
    assert reproduction._kept(experiment, [tmp_path], "settings") is None


@pytest.mark.slow
def test_without_an_extra_the_rest_is_measured(out, monkeypatch):
    """Stable-Baselines3 is not there."""
    monkeypatch.setitem(sys.modules, "stable_baselines3", None)
    experiment = discover()["frontier"]
    context = Context(scale="tiny", folder=out / "elsewhere", ledger=read_ledger([out]))
    result = experiment.measure(experiment.settings["tiny"], context)
    assert result.lacks == ("sb3",) and "pip install 'stable-baselines3>=" in result.notes[0]
