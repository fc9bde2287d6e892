"""Questions: what is answered, what is refused, and that nothing goes beyond its bounds or onto a network."""

import http.server
import math
import sys
import threading

import pyoxigraph as ox
import pytest
from graphs import ACTIONS, empty_map, random_map

from semrl.core.errors import SemrlError, UsageError
from semrl.knowledge import queries as asking
from semrl.knowledge.guard import guarded
from semrl.knowledge.queries import Answer, Limits, ask
from semrl.knowledge.store import to_store

GRAPH = random_map(1)


@pytest.fixture(scope="module")
def store():
    return to_store(GRAPH, ACTIONS)


def test_a_select_gives_plain_values(store):
    told = ask(
        store,
        """SELECT (1/0e0 AS ?endless) (1.50 AS ?decimal) (2e0 AS ?double) (7 AS ?whole) (true AS ?yes) (1/0 AS ?unbound)
        ("x"@en AS ?text) ("a"^^xsd:integer AS ?wrong) (semrl:State AS ?short) (<http://a/b> AS ?long) {}""",
    )
    assert told.variables[:3] == ("endless", "decimal", "double") and told.truth is None and not told.truncated
    expected = ("INF", 1.5, 2.0, 7, True, None, "x", "a", "semrl:State", "http://a/b")
    assert told.rows == (expected,)
    assert [type(value) for value in told.rows[0]] == [type(value) for value in expected]


def test_names_that_come_back_can_be_asked_again(store):
    labelled = ask(store, 'SELECT ?a { ?a rdfs:label "UP RIGHT" }').rows
    assert labelled == (("map:action-UP%20RIGHT",),)
    assert ask(store, "SELECT ?l { map:action-UP%20RIGHT rdfs:label ?l }").rows == (("UP RIGHT",),)


def test_an_ask_gives_a_truth(store):
    assert ask(store, "ASK { ?t a semrl:PositiveTransition }") == Answer(truth=True)
    assert ask(store, "ASK { ?t semrl:reward 77 }") == Answer(truth=False)
    assert ask(to_store(empty_map(), ACTIONS), "SELECT ?s { ?s a semrl:State }") == Answer(variables=("s",))


def test_rows_are_cut_at_the_limit(store):
    n_nodes = len(GRAPH)
    query = "SELECT ?s { ?s a semrl:State }"
    cut = ask(store, query, Limits(rows=n_nodes - 1))
    assert len(cut.rows) == n_nodes - 1 and cut.truncated
    whole = ask(store, query, Limits(rows=n_nodes))
    assert len(whole.rows) == n_nodes and not whole.truncated
    assert ask(store, query, Limits(answer_characters=100)).truncated


HARMLESS = [
    "SELECT ('FROM \\' LOAD \"' AS ?x) {}",
    'SELECT (\'\'\'LOAD \' FROM\'\'\' AS ?x) ("""LOAD " "" FROM""" AS ?y) {}',
    "SELECT ?from $load { ?from a $load } LIMIT 1",
    "SELECT * { ?s ?p <http://x/FROM> }",
    "PREFIX ex: <http://x/> SELECT * { ?s ex:serves ex:FROM, ex:Load ; a ex:a-server }",
    "# FROM <x>\nSELECT * {} # LOAD",
    "SELECT * { ?s ?p ?o FILTER(?o < 3 && ?o > 1) }",
    "SELECT * { ?s ?p ?o FILTER(?o<3&&?o>1) }",
    "SELECT * { ?s ?p ?o FILTER(?p IN (<urn:a#b>, rdf:type) || ?o = '1'^^<http://www.w3.org/2001/XMLSchema#int>) }",
    "SELECT * { ?s (semrl:leadsTo|^semrl:leadsTo)+ ?o . [] a <urn:a#b> } LIMIT 1",
    "SELECT ('\\u00e9' AS ?x) (\"caf\\U000000E9\" AS ?y) {}",
    "SELECT ?s (COUNT(*) AS ?n) { ?s semrl:outgoing ?t MINUS { ?t semrl:reward 0 } } GROUP BY ?s HAVING(?n > 1)",
    "SELECT * { VALUES (?a ?b) { (semrl:State <urn:b>) (UNDEF 'a#b') } }",
]


@pytest.mark.parametrize("query", HARMLESS)
def test_words_that_only_look_dangerous_are_answered(store, query):
    assert ask(store, query).truth is None


U = "<http://127.0.0.1/>"
HOSTILE = [
    ("SELECT * { SERVICE %s { ?s ?p ?o } }", "SERVICE"),
    ("SELECT * { service silent %s { ?s ?p ?o } }", "SERVICE"),
    ("SELECT * { SeRvIcE?x{ ?s ?p ?o } }", "SERVICE"),
    ("PREFIX ex: %s SELECT * { SERVICEex:x { ?s ?p ?o } }", "SERVICE"),
    ("PREFIX ex: %s SELECT * { SERVICESILENTex:x { ?s ?p ?o } }", "SERVICE"),
    ("PREFIX ex: %s SELECT * { ?s ?p ex:.SERVICE %s { ?s ?p ?o } }", "SERVICE"),
    ("SELECT * { ?s ?p trueSERVICE %s { ?s ?p ?o } }", "SERVICE"),
    ("SELECT * { ?s ?p 1SERVICE %s { ?s ?p ?o } }", "SERVICE"),
    ("PREFIX e: <http://x:8> SELECT * { ?s ?p e:SERVICE %s { ?s ?p ?o } }", "SERVICE"),
    ("BASE <http://x:8> PREFIX e: <> SELECT * { ?s e:trueSERVICE %s { ?s ?p ?o } }", "SERVICE"),
    ("SELECT * { \\u0053ERVICE %s { ?s ?p ?o } }", "SERVICE"),
    ("SELECT * { S\\U00000045RVICE %s { ?s ?p ?o } }", "SERVICE"),
    ("SELECT * { \\u005Cu0053ERVICE %s { ?s ?p ?o } }", "codepoint escape"),
    ("SELECT * { # \\u000A SERVICE %s { ?s ?p ?o }\n}", "SERVICE"),
    ("SELECT * { # comment\rSERVICE %s { ?s ?p ?o }\n}", "SERVICE"),
    ("SELECT * { #\nSERVICE#\n%s { ?s ?p ?o } }", "SERVICE"),
    ("SELECT * { ?s ?p '\\u0027 SERVICE %s { ?s ?p ?o } #' }", "SERVICE"),
    ("SELECT * { ?s ?p 'a' SERVICE %s { ?s ?p 'b' } }", "SERVICE"),
    ("SELECT * { ?s ?p 'a\\\\' SERVICE %s {} #'\n}", "SERVICE"),
    ("PREFIX ex: %s SELECT * { ?s ?p ex:a\\' SERVICE %s {} #'\n}", "SERVICE"),
    ("SELECT * { ?s ?p <http://x/'> SERVICE %s {} #'\n}", "SERVICE"),
    ("SELECT * { ?s ?p ?o FILTER(?o<'>') SERVICE %s {} #'\n}", "SERVICE"),
    ("SELECT * { ?s ?p ?o FILTER(?o<#>'''\n?p) SERVICE %s {} #'''\n}", "SERVICE"),
    ("SELECT * { ?s ?p ?o FILTER(?o<(?s>2)||'a'<#>'''\n1) SERVICE %s {} #'''\n}", "SERVICE"),
    ("SELECT * { ?s ?p ?o FILTER(?o<<urn:'>) SERVICE %s {} #'\n}", "SERVICE"),
    ("SELECT * { <<?s?p'>'>> SERVICE %s {} #'\n}", "SERVICE"),
    ("SELECT ('\\uD83D' AS ?x) {}", "does not exist"),
    ("SELECT ('\\U00110000' AS ?x) {}", "does not exist"),
    ("SELECT ('\\u12' AS ?x) {}", "codepoint escape"),
    ('SELECT ("SERVICE" AS ?x) {}', "SERVICE"),
    ("SELECT * {} # service", "SERVICE"),
]


@pytest.mark.parametrize(("query", "said"), HOSTILE)
def test_hostile_queries_are_refused_by_name_before_the_store_sees_them(store, monkeypatch, query, said):
    monkeypatch.setattr(asking, "_run", lambda *_: pytest.fail("the store was asked"))
    with pytest.raises(UsageError) as refused:
        ask(store, query.replace("%s", U))
    assert said in str(refused.value) and "\n" not in str(refused.value)


UPDATES = [
    "LOAD <file:///etc/passwd>",
    "LOAD SILENT <http://x> INTO GRAPH <urn:x>",
    "PREFIX a: <urn:a>LOAD<http://x>",
    "CONSTRUCT { ?s ?p ?o } { ?s ?p ?o }",
    "construct where { ?s ?p ?o }",
    "DESCRIBE <urn:x>",
    "INSERT DATA { <urn:a> <urn:b> 1 }",
    "DELETE WHERE { ?s ?p ?o }",
    "WITH <urn:g> DELETE { ?s ?p ?o } WHERE { ?s ?p ?o }",
    "SELECT * { ?s ?p ?o } ; DROP ALL",
    "CLEAR ALL",
    "CREATE GRAPH <urn:x>",
    "COPY DEFAULT TO <urn:x>",
    "MOVE DEFAULT TO <urn:x>",
    "ADD DEFAULT TO <urn:x>",
]


@pytest.mark.parametrize("query", UPDATES)
def test_what_does_not_only_read_is_not_answered(store, query):
    before = store.dump(format=ox.RdfFormat.N_QUADS)
    with pytest.raises(UsageError, match="the query cannot be answered: "):
        ask(store, query)
    assert store.dump(format=ox.RdfFormat.N_QUADS) == before


@pytest.mark.parametrize("dataset", ["FROM <urn:x>", "FROM NAMED <urn:x>", "FROM <http://127.0.0.1:9/>"])
def test_no_dataset_but_the_map_is_read(store, dataset):
    asked = "SELECT (COUNT(*) AS ?n) %s { ?s ?p ?o }"
    assert ask(store, asked % dataset) == ask(store, asked % "")


@pytest.mark.parametrize(
    ("query", "said"),
    [
        ("", "error at 1:1"),
        ("SELECT", "error at 1:7"),
        ("SELECT * { ?s ?p }", "error at 1:"),
        ("SELECT *\n{ ?s ?p ?o }\nGROUPBY", "error at 3:"),
        ("SELECT * { ?s ex:unknown ?o }", "Prefix not found"),
        ("SELECT * { ?s <relative> ?o }", "error at 1:"),
        ("SELECT (<urn:function>(1) AS ?x) {}", "custom function <urn:function> is not supported"),
        ("\x00", "error at 1:"),
        ("SELECT * { ?s ?p 'open }", "error at 1:"),
    ],
)
def test_malformed_queries_are_one_line_with_a_reason(store, query, said):
    with pytest.raises(UsageError, match="the query cannot be answered: ") as refused:
        ask(store, query)
    assert said in str(refused.value) and "\n" not in str(refused.value) and len(str(refused.value)) < 250


def test_a_long_query_is_refused():
    assert guarded("ASK{}".ljust(10_000), 10_000)
    with pytest.raises(UsageError, match="has 10,001 characters; at most 10,000"):
        guarded("ASK{}".ljust(10_001), 10_000)


EVERYTHING = "?a ?b ?c . ?d ?e ?f . ?g ?h ?i . ?j ?k ?l"


def test_time_is_bounded_even_before_the_first_row(store):
    with pytest.raises(UsageError, match="took longer than 2 seconds"):
        ask(store, f"SELECT (COUNT(*) AS ?n) {{ {EVERYTHING} FILTER(?c != ?l) }}", Limits(seconds=2.0))


@pytest.mark.skipif(sys.platform != "linux", reason="memory is bounded on Linux only")
def test_memory_is_bounded(store):
    with pytest.raises(UsageError, match="needs more than 400 MB"):
        ask(store, f"SELECT * {{ {EVERYTHING} }} ORDER BY ?c ?f", Limits(memory_mb=400))


def test_a_nest_too_deep_ends_only_the_process_that_parses_it(store):
    with pytest.raises(UsageError, match="nested too deeply"):
        ask(store, f"SELECT ({'(' * 4900}1{')' * 4900} AS ?x) {{}}")


def test_a_process_that_fails_otherwise_is_no_fault_of_the_query(store, monkeypatch, tmp_path):
    monkeypatch.setattr(asking, "_SANDBOX", tmp_path / "none.py")
    with pytest.raises(SemrlError, match=r"failed: .*none.py") as failed:
        ask(store, "ASK {}")
    assert not isinstance(failed.value, UsageError)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    with pytest.raises(SemrlError, match="no process can be started"):
        ask(store, "ASK {}")


@pytest.mark.parametrize("limit", [{"rows": 0}, {"seconds": 0.0}, {"seconds": math.nan}, {"seconds": math.inf}])
def test_limits_are_limits(limit):
    with pytest.raises(UsageError, match=next(iter(limit))):
        Limits(**limit)


@pytest.fixture
def asked():
    """Serve on this machine; yields the address and the list of what was asked for."""
    paths = []

    class Handler(http.server.BaseHTTPRequestHandler):
        def do_POST(self):
            paths.append(self.path)
            self.send_error(500)

        do_GET = do_POST

        def log_message(self, *_):
            pass

    with http.server.HTTPServer(("127.0.0.1", 0), Handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/", paths
        server.shutdown()


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such bound; there the guard stands alone")
def test_there_is_no_network_even_where_the_guard_sees_nothing(store, asked, monkeypatch):
    address, paths = asked
    monkeypatch.setattr(asking, "guarded", lambda query, _: query)
    with pytest.raises(UsageError, match="cannot be answered"):
        ask(store, f"SELECT * {{ SERVICE <{address}> {{ ?s ?p ?o }} }}")
    ask(store, f"SELECT * {{ SERVICE SILENT <{address}> {{ ?s ?p ?o }} }}")
    with pytest.raises(OSError, match="500"):  # the store itself would ask
        list(store.query(f"SELECT * {{ SERVICE <{address}seen> {{ ?s ?p ?o }} }}"))
    assert paths == ["/seen"]


def test_what_is_neither_select_nor_ask_is_not_answered(store, monkeypatch):
    monkeypatch.setattr(asking, "guarded", lambda query, _: query)
    with pytest.raises(UsageError, match="only SELECT and ASK"):
        ask(store, "CONSTRUCT WHERE { ?s ?p ?o }")
