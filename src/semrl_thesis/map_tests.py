"""Ontology and planner tests (§4.2): how well the lower line predicts a new run, and what its map is like."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from sklearn.decomposition import PCA

import semrl
from semrl.core import Trajectory
from semrl.core.errors import UsageError
from semrl.evaluation import load_player
from semrl.evaluation.player import Player
from semrl.evaluation.scores import EVALUATION_SEED, PROBING
from semrl.knowledge.description import describe
from semrl.planning.module import PlanningModule
from semrl.planning.state_map import StateMap
from semrl.training.config import MODELS
from semrl.world_model import EpisodeRecord
from semrl_thesis.base import Context, Experiment
from semrl_thesis.figures import Figure, Matrix, Network, Panel
from semrl_thesis.prediction import SIGNS, examine
from semrl_thesis.results import Number, Result, digest, joined, read_result, write_result
from semrl_thesis.scores import SWEEPS
from semrl_thesis.sweep import RunSpec

STATES = {"semantic-map": "semantic", "ram-map": "ram"}
"""Model → its states, as the ids of numbers call them."""

THESIS: dict[str, dict[str, dict[str, float]]] = {
    "semantic": {
        "new-run": {"decisions": 3875, "gains": 21, "losses": 14},
        "next-state": {
            "trained": 31.5, "scratch": 75.3, "folds": 2.5, "folds-128": 17.9, "scratch-128": 49.9, "updated": 69.3,
        },
        "reward": {"trained": 34.6, "scratch": 83.2, "folds": 72.1, "updated": 36.2},
        "map": {
            "nodes": 2184, "edges": 6969, "run-nodes": 960, "run-edges": 1213, "scratch-nodes": 321,
            "scratch-edges": 744, "positive": 1.6, "negative": 2.5, "diameter": 20, "radius": 9, "two-components": 10.8,
        },
    },
    "ram": {
        "new-run": {"decisions": 9022, "gains": 12, "losses": 21},
        "next-state": {
            "trained": 97.3, "scratch": 97.4, "folds": 98.1, "folds-128": 97.8, "scratch-128": 97.2, "updated": 98.6,
        },
        "reward": {"trained": 33.3, "scratch": 77.3, "folds": 77.3, "updated": 33.3},
        "map": {
            "nodes": 185, "edges": 1966, "run-nodes": 146, "run-edges": 802, "scratch-nodes": 79,
            "scratch-edges": 373, "positive": 1.8, "negative": 3.1, "diameter": 17, "radius": 8, "two-components": 66.4,
        },
    },
}  # fmt: skip
"""What §4.2 says: states → test → number."""

UNITS = {"next-state": "% R²", "reward": "% balanced accuracy", "positive": "% of edges", "negative": "% of edges",
         "two-components": "% of variance", "diameter": "steps", "radius": "steps"}  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Settings:
    """How much is looked at.

    Attributes
    ----------
    decisions
        Most decisions of the new run; None for a whole episode of the agent.
    """

    decisions: int | None = None


@dataclass(frozen=True, kw_only=True)
class _Tested:
    """The tests of one trained run: values by ``test/number``, confusion matrices, the map drawn."""

    values: dict[str, float | None]
    matrices: Mapping[str, Matrix]
    map: Network


def measure(settings: Settings, context: Context) -> Result:
    """Test the map models of every preset that were trained."""
    result = joined([_of_run(spec, settings, context) for spec in RUNS[context.scale]])
    return replace(result, notes=(*result.notes, *_fewer_kinds(result.values)))


def _fewer_kinds(values: Mapping[str, float | None]) -> list[str]:
    """Say of which runs a balanced accuracy is one of two kinds: the same guess everywhere has 50 % there, not 33.3."""
    notes = []
    for id_ in (id_ for id_, count in values.items() if id_.startswith("new-run/") and count == 0):
        _, states, what = id_.partition("@")[0].split("/")
        preset = id_.partition("@")[2] or "thesis"
        notes.append(
            f"reward/{states}, preset {preset}: the run had no {what}; who always predicts nothing has 50 % there, "
            "where the thesis's had 33.3 of three kinds"
        )
    return notes


def _of_run(spec: RunSpec, settings: Settings, context: Context) -> Result:
    """Test a run, or tell what was kept of its test: that outlives the folder of the run."""
    score = context.ledger.score(spec)
    if score is None:
        return Result(values={}, notes=(f"{spec.id} was not tested: it is not finished yet",))
    name, known = f"ontology-{spec.id}.npz", digest(semrl.__version__, settings, score)
    kept = read_result(path, known) if (path := context.kept(name)).exists() else None
    if kept:
        return kept
    context.say(f"next states, rewards and map of {spec.id}")
    try:
        player = load_player(context.run_folder(spec), memory=True).under(exploration=PROBING)
        planning = player.require_predictions(spec.id)
    except UsageError as error:
        return Result(values={}, notes=(f"{spec.id} was not tested: {error}",), whole=False)
    test = _test(planning, new_run(player, planning, settings.decisions))
    states, suffix = STATES[spec.model], "" if spec.preset == "thesis" else f"@{spec.preset}"
    values = {}
    for id_, value in test.values.items():
        kind, _, what = id_.partition("/")
        values[f"{kind}/{states}/{what}{suffix}"] = value
    result = Result(values=values, figures=_figures(states, spec.preset, test))
    write_result(context.folder / name, result, known)
    return result


def new_run(player: Player, planning: PlanningModule, most: int | None) -> Trajectory:
    """Let the agent play one episode that nothing is learned from, cut after so many decisions."""
    steps = player.episode(0, player.config.seed + EVALUATION_SEED)
    step = next(steps)
    record = EpisodeRecord(planning.dimension)
    for decisions, after in enumerate(steps, 1):
        assert step.state is not None and after.action is not None
        record.add(step.state.facts, after.action, after.reward)
        step = after
        if decisions == most:
            break
    assert step.state is not None
    return record.so_far(step.state.facts)


def _test(planning: PlanningModule, run: Trajectory) -> _Tested:
    next_states, rewards, matrices = examine(planning, run)
    described, drawn = _map(planning, run)
    tests: dict[str, Mapping[str, float | None]] = {
        "new-run": {
            "decisions": len(run),
            "gains": int((run.rewards > 0).sum()),
            "losses": int((run.rewards < 0).sum()),
        },
        "next-state": next_states,
        "reward": rewards,
        "map": described,
    }
    labels = tuple(f"{sign:+d}" if sign else "0" for sign in SIGNS)
    return _Tested(
        values={f"{kind}/{what}": value for kind, values in tests.items() for what, value in values.items()},
        matrices={name: Matrix(labels=labels, values=matrix) for name, matrix in matrices.items()},
        map=drawn,
    )


def _map(planning: PlanningModule, run: Trajectory) -> tuple[dict[str, float | None], Network]:
    """Describe the map, alone and by a run, and place its nodes by two principal components."""
    learned, on_map = planning.state_map, planning.on_map(run)
    graph, described = learned.graph_, describe(learned.graph_)
    scratch = StateMap(learned.config, learned.dimension, learned.n_actions, changes=learned.changes).partial_fit(
        on_map
    )
    pca = PCA(min(2, *graph.node_means.shape))
    placed = pca.fit_transform(graph.node_means)
    positions = np.pad(placed, ((0, 0), (0, 2 - placed.shape[1])))
    values = {
        "nodes": described.nodes,
        "edges": described.edges,
        "run-nodes": len(np.unique(learned.locate(on_map.states))),
        "run-edges": len(np.unique(learned.locate_transitions(on_map))),
        "scratch-nodes": len(np.unique(scratch.locate(on_map.states))),
        "scratch-edges": len(np.unique(scratch.locate_transitions(on_map))),
        "positive": 100 * described.positive_share,
        "negative": 100 * described.negative_share,
        "diameter": described.diameter,
        "radius": described.radius,
        "two-components": 100 * float(np.nansum(pca.explained_variance_ratio_)),
    }
    drawn = Network(
        xlabel="first component",
        ylabel="second component",
        positions=positions.astype(np.float32),
        sources=graph.sources,
        targets=graph.targets,
        signs=graph.reward_signs,
    )
    return values, drawn


def _figures(states: str, preset: str, test: _Tested) -> tuple[Figure, ...]:
    """Draw the test of one run: what Figs. 4.12 – 4.18 show of its states."""

    def each(*names: str) -> tuple[tuple[str, Panel], ...]:
        return tuple(
            (f"preset {preset}" + (f", {name}" if len(names) > 1 else ""), test.matrices[name])
            for name in names
            if name in test.matrices  # trees are not grown from a short run
        )

    said = "Each row is what the reward was, each column what was predicted; rows sum to 1."
    learned = "learned from the new run alone"
    the_map = ((f"preset {preset}", test.map),)
    figures: tuple[Figure, ...]
    if states == "semantic":
        figures = (
            Figure(number="4.12", title="Rewards of semantic states, as trained", says=said, panels=each("trained")),
            Figure(number="4.13", title=f"Rewards of semantic states, {learned}", says=said, panels=each("scratch")),
            Figure(number="4.14", title="Rewards of semantic states, updated with the new run", says=said,
                   panels=each("updated")),
            Figure(number="4.15", title="The map of semantic states", says="Nodes are clusters of states, placed by "
                   "their two principal components; edges are green where they bring a gain, red where a loss.",
                   panels=the_map),
        )  # fmt: skip
    else:
        figures = (
            Figure(number="4.16", title=f"Rewards of RAM states, {learned}", says=said, panels=each("scratch")),
            Figure(number="4.17", title="Rewards of RAM states, as trained and updated", says=said,
                   panels=each("trained", "updated")),
            Figure(number="4.18", title="The map of RAM states", says="As Fig. 4.15, of four coordinates.",
                   panels=the_map),
        )  # fmt: skip
    return tuple(figure for figure in figures if figure.panels)


def _numbers() -> tuple[Number, ...]:
    return tuple(
        Number(
            id=f"{kind}/{states}/{what}",
            thesis=thesis,
            unit=UNITS.get(kind, UNITS.get(what, what.split("-")[-1])),
            better="higher" if kind in ("next-state", "reward") else "near",
        )
        for states, tests in THESIS.items()
        for kind, numbers in tests.items()
        for what, thesis in numbers.items()
    )


def _runs(specs: tuple[RunSpec, ...]) -> tuple[RunSpec, ...]:
    """Return the runs that are tested: of each map model the first seed of each preset."""
    return tuple(spec for spec in specs if MODELS[spec.model].plans and spec.seed == 0)


RUNS = {scale: _runs(sweep.runs()) for scale, sweep in SWEEPS.items()}

EXPERIMENT = Experiment(
    name="ontology",
    place=3,
    title="Ontology and planner",
    section="§4.2",
    numbers=_numbers(),
    settings={"full": Settings(), "quick": Settings(decisions=4000), "tiny": Settings(decisions=250)},
    measure=measure,
    runs=RUNS,
)
