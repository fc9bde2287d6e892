"""What two runs know can stand in one store: the ontology is shared, states, transitions, actions and rules are not."""

import io
import itertools
import json
import re
import uuid

import pyoxigraph as ox
import pytest
from graphs import ACTIONS, random_map

from semrl.core.errors import UsageError
from semrl.knowledge.export import turtle
from semrl.knowledge.queries import ask
from semrl.knowledge.store import to_store
from semrl.knowledge.vocabulary import INSTANCES, PREFIXES, TERMS
from semrl.training import RunConfig, RunFolder
from semrl.world_model.rules import Rule

RULES = (Rule(about="ball vx", conditions=("x > 90",), value=-4.0, decisions=212, error=0.5),)
OWL = PREFIXES["owl"]
KINDS = ("State", "Transition", "Action", "Rule")
RUNS = [(1, 9, 25), (2, 9, 25), (3, 4, 7), (3, 4, 7)]
"""Seed, nodes and edges of a map; two of the four have learned the same."""


@pytest.fixture(scope="module")
def bases(tmp_path_factory):
    """Return the base IRI of each run; all four are configured alike."""
    at = tmp_path_factory.mktemp("runs")
    return [RunFolder.create(at / str(i), RunConfig()).base_iri for i in range(len(RUNS))]


@pytest.fixture(scope="module")
def merged(bases):
    store = ox.Store()
    for base, (seed, n_nodes, n_edges) in zip(bases, RUNS, strict=True):
        written = turtle(random_map(seed, n_nodes, n_edges), ACTIONS, RULES, base=base)
        store.load(written, format=ox.RdfFormat.TURTLE)
    return store


def test_every_run_has_a_base_of_its_own(bases):
    assert len(set(bases)) == len(RUNS)
    assert all(re.fullmatch(r"urn:uuid:[0-9a-f-]{36}#", base) for base in bases)


def test_merged_nothing_is_lost_and_nothing_has_two_values(merged):
    n_nodes, n_edges = (sum(run[i] for run in RUNS) for i in (1, 2))
    each = {"Action": len(ACTIONS), "Rule": len(RULES)}
    expected = {"State": n_nodes, "Transition": n_edges, **{kind: len(RUNS) * n for kind, n in each.items()}}
    for kind, n in expected.items():
        assert ask(merged, f"SELECT (COUNT(*) AS ?n) {{ ?x a semrl:{kind} }}").rows == ((n,),)
    for name in ("count", "number", "source", "target", "action", "reward", "support", "actionNumber"):
        twice = f"ASK {{ ?x semrl:{name} ?a, ?b FILTER(?a != ?b) }}"
        assert ask(merged, twice).truth is False, name


def test_no_statement_joins_two_runs(merged, bases):
    def run_of(term):
        return next((base for base in bases if str(term).startswith(f"<{base}")), None)

    for quad in merged:
        assert run_of(quad.subject) == run_of(quad.object) or None in {run_of(quad.subject), run_of(quad.object)}
        if quad.predicate.value.startswith(TERMS) and isinstance(quad.object, ox.NamedNode):
            assert run_of(quad.subject) == run_of(quad.object) is not None


def test_the_ontology_is_told_once(merged):
    assert ask(merged, "SELECT ?o { ?o a owl:Ontology }").rows == (("urn:semrl:ontology",),)
    assert ask(merged, "ASK { ?c rdfs:comment ?a, ?b FILTER(?a != ?b) }").truth is False


def test_each_run_is_asked_by_its_own_prefix(merged, bases):
    query = "SELECT ?n { map:state-3 semrl:count ?n }"
    for base, (seed, n_nodes, n_edges) in zip(bases, RUNS, strict=True):
        graph = random_map(seed, n_nodes, n_edges)
        assert ask(merged, query, base=base).rows == ((graph.node_counts[1],),)
        assert ("map:state-3",) in ask(merged, "SELECT ?s { ?s a semrl:State }", base=base).rows
    assert ask(merged, query).rows == ()


@pytest.mark.parametrize("base", [INSTANCES, "urn:uuid:3f0c8a7e-5a5b-4a43-9f3c-0d6a8d2f7c11#"])
def test_instances_are_named_individuals_and_terms_are_not(base):
    store = to_store(random_map(1), ACTIONS, RULES, base=base)
    individuals = {row[0] for row in ask(store, "SELECT ?x { ?x a owl:NamedIndividual }", base=base).rows}
    instances = set()
    for kind in KINDS:
        instances |= {row[0] for row in ask(store, f"SELECT ?x {{ ?x a semrl:{kind} }}", base=base).rows}
    assert individuals == instances and all(name.startswith("map:") for name in individuals)
    assert len(individuals) == 9 + 25 + len(ACTIONS) + 1


def test_owlready2_sees_the_individuals(merged):
    owlready2 = pytest.importorskip("owlready2", reason="owlready2 is not installed")
    file = io.BytesIO()
    merged.dump(file, format=ox.RdfFormat.N_TRIPLES, from_graph=ox.DefaultGraph())
    file.seek(0)
    seen = owlready2.World().get_ontology("urn:semrl:ontology#").load(fileobj=file)
    n_individuals = sum(nodes + edges + len(ACTIONS) + len(RULES) for _, nodes, edges in RUNS)
    assert len(list(seen.individuals())) == n_individuals


def test_the_base_is_kept_where_a_run_goes(tmp_path):
    run = RunFolder.create(tmp_path / "run", RunConfig())
    base = run.base_iri
    run.update_manifest(status="finished", hashes={"weights": "x"})
    assert RunFolder(run.path.rename(tmp_path / "elsewhere")).base_iri == base


def test_runs_older_than_ids_are_known_by_what_they_are(tmp_path):
    bases = set()
    for i, (seed, weights) in enumerate(itertools.product((0, 1), ("x", "y"))):
        run = RunFolder.create(tmp_path / str(i), RunConfig(seed=seed))
        manifest = run.manifest() | {"hashes": {"weights": weights}}
        del manifest["id"]
        run.write_manifest(manifest)
        assert run.base_iri == run.base_iri
        bases.add(run.base_iri)
    assert len(bases) == 4 and all(uuid.UUID(base[9:-1]) for base in bases)


@pytest.mark.parametrize("written", [7, None, "", "x> <y", [], "../.."])
def test_a_damaged_id_is_one_line(tmp_path, written):
    run = RunFolder.create(tmp_path / "run", RunConfig())
    run.manifest_path.write_text(json.dumps(run.manifest() | {"id": written}))
    with pytest.raises(UsageError, match="its id is no UUID"):
        _ = run.base_iri
