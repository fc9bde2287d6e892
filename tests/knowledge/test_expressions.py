"""Class expressions mean what description logic says, in both syntaxes and on arrays."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import WORDS, closed_roles, members, of_scenes, of_things, scenes

from semrl.core.errors import UsageError
from semrl.knowledge.compiler import Classifier, entail, role_axioms
from semrl.knowledge.condition import read_condition
from semrl.knowledge.consistency import contradiction, satisfiable
from semrl.knowledge.distance import Distance
from semrl.knowledge.expressions import And, AtLeast, Facet, HasValue, Named, Not, Only, Or, Some, negation_normal
from semrl.knowledge.manchester import is_manchester, read_manchester
from semrl.knowledge.ontology import Definition
from semrl.knowledge.writing import write_condition, write_manchester

SEEDS = st.integers(0, 10_000)


@settings(max_examples=60, deadline=None)
@given(of_scenes(), SEEDS)
def test_arrays_decide_as_the_definition_does(expression, seed):
    scene = scenes(seed)
    pairs = closed_roles(scene)
    entail(scene, role_axioms(WORDS))
    held = Classifier(WORDS, {"q": expression})(scene)[0, -1]
    assert set(np.flatnonzero(held)) == members(expression, scene, pairs)


@settings(max_examples=30, deadline=None)
@given(of_things(), of_scenes(), SEEDS)
def test_defined_classes_decide_as_what_they_are_defined_as(inner, outer, seed):
    words = WORDS.having(Inner=Definition(expression=inner, sort="thing")).having(
        Outer=Definition(expression=And((outer, Some("contains", Named("Inner")))))
    )
    scene = scenes(seed)
    pairs = closed_roles(scene)
    entail(scene, role_axioms(words))
    classifier = Classifier(words)
    held = classifier.of_scenes(scene, ["Outer"])[0, 0]
    assert held == (0 in members(Named("Outer"), scene, pairs, words))


@pytest.mark.parametrize("seed", range(20))
def test_roles_are_closed_under_their_axioms(seed):
    scene = scenes(seed)
    pairs = closed_roles(scene)
    entail(scene, role_axioms(WORDS))
    for i, name in enumerate(WORDS.role_names):
        assert set(zip(*np.nonzero(scene.roles[0, i]), strict=True)) == pairs[name], name


@settings(max_examples=50, deadline=None)
@given(of_scenes(), SEEDS)
def test_distance_is_0_where_an_expression_holds_and_nowhere_else(expression, seed):
    some = scenes(seed, count=5)
    entail(some, role_axioms(WORDS))
    held = Classifier(WORDS, {"q": expression}).of_scenes(some, ["q"])[:, 0]
    np.testing.assert_array_equal(Distance(expression, WORDS)(some) == 0, held)


def test_distance_falls_on_the_way():
    scene = scenes(3, count=1)
    wanted = read_condition("ball.x < 10", WORDS)
    place = int(np.flatnonzero(scene.classes[0, 1])[0])
    found = []
    for x in (90, 60, 30, 5):
        scene.numbers[0, 0] = 99
        scene.numbers[0, 0, place] = x
        found.append(float(Distance(wanted, WORDS)(scene)[0]))
    assert found == sorted(found, reverse=True) and found[-1] == 0 and found[0] == pytest.approx(80, abs=0.1)


@settings(max_examples=50, deadline=None)
@given(of_things(), SEEDS)
def test_a_negation_normal_form_is_the_complement(expression, seed):
    scene = scenes(seed)
    pairs = closed_roles(scene)
    everyone = members(Not(expression), scene, pairs) | members(expression, scene, pairs)
    assert members(negation_normal(expression), scene, pairs) == members(expression, scene, pairs)
    assert members(negation_normal(expression, negated=True), scene, pairs) == everyone - members(
        expression, scene, pairs
    )


@settings(max_examples=80, deadline=None)
@given(of_scenes())
def test_a_condition_is_read_as_it_was_written(expression):
    assert read_condition(write_condition(expression, WORDS), WORDS) == expression


@settings(max_examples=80, deadline=None)
@given(of_things())
def test_a_condition_about_a_thing_is_read_as_it_was_written(expression):
    assert read_condition(write_condition(expression, WORDS, "thing"), WORDS, "thing") == expression


@settings(max_examples=80, deadline=None)
@given(of_things())
def test_manchester_syntax_is_read_as_it_was_written(expression):
    assert read_manchester(write_manchester(expression), WORDS) == expression


@pytest.mark.parametrize(
    ("condition", "manchester"),
    [
        ("ball", "contains some ball"),
        ("own.y <= 33", 'contains some (own and y some xsd:double[<= "33.0"^^xsd:double])'),
        ("33 >= own.y", "contains some (own and y some xsd:double[<= 33])"),
        ("20 < ball.x <= 50", "contains some (ball and x some xsd:double[> 20, <= 50])"),
        (
            "ball.x > 20 and ball.x <= 50",
            "contains some (ball and x some xsd:double[> 20] and x some xsd:double[<= 50])",
        ),
        ("own.y <= 33 and ball", "(contains some (own and y some xsd:double[<= 33])) and contains some ball"),
        ("not ball.x < 1", "not contains some (ball and x some xsd:double[< 1])"),
        ("ball.x < own.x", "contains some (ball and leftOf some own)"),
        ("touches(ball, own)", "contains some (ball and touches some own)"),
        ("approaches(ball, left_border)", "contains some (ball and approaches value left_border)"),
        ("count(ball) >= 2", "contains min 2 ball"),
        ("count(ball) > 2", "contains min 3 ball"),
        ("count(ball) < 2", "contains max 1 ball"),
        ("count(ball) == 1", "contains exactly 1 ball"),
        ("only(contains, ball or x < 3)", "contains only (ball or x some xsd:double[< 3])"),
        ("some(contains, itself(touches))", "contains some (touches Self)"),
        ("some(contains, value(approaches, left_border))", "contains some (approaches value left_border)"),
        ("true or false", "owl:Thing or owl:Nothing"),
        ("ball", "<http://example.org/words#contains> some :ball"),
    ],
)
def test_both_syntaxes_say_the_same(condition, manchester):
    assert is_manchester(manchester) or condition == "true or false"
    assert not is_manchester(condition)
    assert read_condition(condition, WORDS) == read_manchester(manchester, WORDS)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("own.y <=", "malformed"),
        ("", "malformed"),
        ("own.z < 3", "no number 'z'"),
        ("bal.x < 3", "did you mean 'ball'?"),
        ("tuches(ball, own)", "did you mean 'touches'?"),
        ("ball.x < '3'", "'3'"),
        ("ball.x < True", "True"),
        ("ball.x != 3", "compare with"),
        ("ball.x + 1 < 3", "cannot be compared"),
        ("ball.x < own.y", "compared with a literal"),
        ("count(ball) < 1.5", "whole number"),
        ("lambda: 0", "is no condition"),
        ("__import__('os').system('true')", "is no condition"),
        ("[ball for ball in own]", "is no condition"),
        ("(" * 300 + "ball" + ")" * 300, ""),
        ("not " * 5000 + "ball", ""),
        ("ball and " * 2000 + "ball", "10,000"),
        ("ball\x00", "malformed"),
        ("Scene.x < 3", "class of scenes"),
    ],
)
def test_a_wrong_condition_is_told_in_a_line(text, said):
    with pytest.raises(UsageError) as error:
        read_condition(text, WORDS)
    assert said in str(error.value) and "\n" not in str(error.value) and len(str(error.value)) < 300


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("contains some", "ends where"),
        ("contains some (ball", "')'"),
        ("contains some ball )", "malformed at character 20"),
        ("contains min two ball", "whole number"),
        ("contains some (x some xsd:double[= 3])", "malformed"),
        ('contains some (x some xsd:double[< "3"^^xsd:decimal])', "wrong type, xsd:decimal"),
        ('contains some (x some xsd:double[< "3"])', "wrong type, a string"),
        ('contains some (x some xsd:double[< "3,0"^^xsd:double])', "no xsd:double"),
        ("contains some (x some xsd:double[< 1e999])", "finite"),
        ("contains some (x only xsd:double)", "beyond the profile"),
        ("contains some bal", "did you mean 'ball'?"),
        ("contans some ball", "did you mean 'contains'?"),
        ("approaches value right_border", "did you mean 'left_border'?"),
        ("(" * 3000 + "ball", "nested too deeply"),
        ("contains some $", "malformed at character"),
    ],
)
def test_a_wrong_manchester_expression_is_told_in_a_line(text, said):
    with pytest.raises(UsageError) as error:
        read_manchester(text, WORDS)
    assert said in str(error.value) and "\n" not in str(error.value)


def test_cyclic_definitions_are_refused():
    words = WORDS.having(A=Definition(expression=Named("ball"), sort="thing"))
    words = words.having(B=Definition(expression=Named("A"), sort="thing"))
    with pytest.raises(UsageError, match="cyclic: A → B → A"):
        words.having(A=Definition(expression=Some("touches", Named("B")), sort="thing"))
    with pytest.raises(UsageError, match="cyclic: C → C"):
        words.having(C=Definition(expression=Not(Named("C"))))
    with pytest.raises(UsageError, match="word of the run already"):
        words.having(ball=Definition(expression=Named("own")))


@settings(max_examples=60, deadline=None)
@given(of_scenes(), SEEDS)
def test_what_holds_somewhere_is_never_called_unsatisfiable(expression, seed):
    some = scenes(seed, count=10)
    entail(some, role_axioms(WORDS))
    if Classifier(WORDS, {"q": expression}).of_scenes(some, ["q"]).any():
        assert satisfiable(expression, WORDS)


RANGED = WORDS.having(Upper=Definition(expression=Facet("y", "<", 30.0), sort="thing"))


@pytest.mark.parametrize(
    ("text", "axioms"),
    [
        ("ball.x < 3 and ball.x > 4", 0),
        ("ball.x < 3 and ball.x >= 3", 0),
        ("only(contains, not ball) and ball", 0),
        ("at_least(3, contains, ball) and at_most(2, contains, ball)", 0),
        ("at_most(0, contains, ball) and ball", 0),
        ("some(contains, ball and own)", 1),
        ("some(contains, ball and border)", 2),
        ("some(contains, touches_all) or false", None),
        ("some(contains, Upper and y > 40)", 0),
        ("some(contains, Scene)", 0),
        ("ball.x < 3 and not (own or ball.x < 5)", 0),
    ],
)
def test_contradictions_are_found_with_their_least_reason(text, axioms):
    if axioms is None:
        with pytest.raises(UsageError):
            read_condition(text, RANGED)
        return
    found = contradiction(read_condition(text, RANGED), RANGED)
    assert found is not None and len(found.axioms) == axioms
    assert not satisfiable(found.expression, RANGED)


def test_bounds_and_limits_of_what_was_seen_are_reasons():
    words = type(WORDS)(
        **{
            **{name: getattr(WORDS, name) for name in WORDS.__dataclass_fields__},
            "ranges": {("own", "x"): (80.0, 90.0), ("ball", "x"): (0.0, 100.0)},
            "limits": {"ball": 1},
        }
    )
    found = contradiction(read_condition("own.x < 50 and ball.x < 50 and own.y < 3", words), words)
    assert found is not None and found.axioms == ("own.x lies in 80 … 90",)
    assert found.expression == read_condition("own.x < 50", words)
    found = contradiction(read_condition("count(ball) >= 2", words), words)
    assert found is not None and found.axioms == ("there is 1 ball at most",)
    both = And(
        (
            Some("contains", And((Named("ball"), Facet("x", "<", 3.0)))),
            Some("contains", And((Named("ball"), Facet("x", ">", 5.0)))),
        )
    )
    assert contradiction(both, words) is not None and contradiction(both, WORDS) is None


def test_joining_and_splitting():
    a, b, c = Named("ball"), HasValue("approaches", "left_border"), AtLeast(2, "touches", Named("own"))
    assert And((a, b)).parts == (a, b)
    assert read_condition("ball or own or ball", WORDS, "thing") == Or((a, Named("own")))
    assert negation_normal(Not(Only("touches", c))) == Some("touches", negation_normal(c, negated=True))
