"""Small ontologies and scenes for tests, and what an expression means, written plainly."""

import operator

import numpy as np
from hypothesis import strategies as st

from semrl.knowledge.expressions import (
    And,
    AtLeast,
    AtMost,
    Bottom,
    Facet,
    HasSelf,
    HasValue,
    Named,
    Not,
    Only,
    Or,
    Some,
    Top,
    conjunction,
    disjunction,
)
from semrl.knowledge.interpretation import Interpretation
from semrl.knowledge.ontology import Ontology, Role

WORDS = Ontology(
    concepts={"thing": "", "ball": "", "own": "", "border": ""},
    parents=(("ball", "thing"), ("own", "thing")),
    disjoint=(("ball", "own"), ("thing", "border")),
    roles=(
        Role(name="leftOf", inverse="rightOf", transitive=True),
        Role(name="touches", symmetric=True),
        Role(name="approaches"),
        Role(name="threatens", chains=(("approaches", "touches"),)),
    ),
    numbers={"x": "", "y": ""},
    individuals={"left_border": "border"},
)

COMPARE = {"<": operator.lt, "<=": operator.le, ">": operator.gt, ">=": operator.ge}
BOUNDS = st.sampled_from([-5.0, 0.0, 20.0, 33.3, 50.0, 1e-05, 100.0])


def _facets():
    return st.builds(Facet, st.sampled_from(list(WORDS.numbers)), st.sampled_from(list(COMPARE)), BOUNDS)


def _with_roles(inner):
    roles, few = st.sampled_from(WORDS.role_names), st.integers(0, 3)
    return st.one_of(
        st.builds(Some, roles, inner),
        st.builds(Only, roles, inner),
        st.builds(AtLeast, few, roles, inner),
        st.builds(AtMost, few, roles, inner),
    )


def _combined(inner):
    several = st.lists(inner, min_size=2, max_size=3)
    return st.one_of(
        several.map(lambda parts: conjunction(*parts)),
        several.map(lambda parts: disjunction(*parts)),
        st.builds(Not, inner),
    )


def of_things():
    """Draw expressions about a thing."""
    leaves = st.one_of(
        _facets(),
        st.sampled_from([Named(name) for name in WORDS.concepts]),
        st.sampled_from([Top(), Bottom(), HasSelf("touches"), HasValue("approaches", "left_border")]),
    )
    return st.recursive(leaves, lambda inner: st.one_of(_with_roles(inner), _combined(inner)), max_leaves=5)


def of_scenes():
    """Draw expressions about a scene."""
    return st.recursive(
        st.one_of(_with_roles(of_things()), st.sampled_from([Top(), Named("Scene")])), _combined, max_leaves=4
    )


def scenes(seed, count=1, things=4, words=WORDS):
    """Draw scenes; roles are not closed under their axioms yet."""
    rng = np.random.default_rng(seed)
    n = 1 + len(words.individuals) + things
    first = n - things
    present = np.ones((count, n), np.bool_)
    present[:, first:] = rng.random((count, things)) < 0.8
    classes = np.zeros((count, len(words.concepts), n), np.bool_)
    place = {name: i for i, name in enumerate(words.concepts)}
    classes[:, place["border"], 1:first] = True
    classes[:, place["thing"], first:] = True
    is_ball = rng.random((count, things)) < 0.5
    classes[:, place["ball"], first:] = is_ball
    classes[:, place["own"], first:] = ~is_ball & (rng.random((count, things)) < 0.6)
    classes &= present[:, None, :]
    roles = np.zeros((count, len(words.role_names), n, n), np.bool_)
    roles[:, 0, 0, first:] = present[:, first:]
    both = present[:, None, 1:, None] & present[:, None, None, 1:]
    roles[:, 1:, 1:, 1:] = (rng.random((count, len(words.role_names) - 1, n - 1, n - 1)) < 0.2) & both
    numbers = np.full((count, len(words.numbers), n), np.nan)
    numbers[:, :, first:] = np.where(
        present[:, None, first:], rng.choice([0, 20, 33.3, 40, 50], (count, 2, things)), np.nan
    )
    return Interpretation(present=present, classes=classes, roles=roles, numbers=numbers)


def closed_roles(scene, words=WORDS):
    """Return role → pairs of a scene (the first of some), with all that its axioms entail, found step by step."""
    pairs = {name: set(zip(*np.nonzero(scene.roles[0, i]), strict=True)) for i, name in enumerate(words.role_names)}
    while True:
        before = {name: set(found) for name, found in pairs.items()}
        for role in words.roles:
            own = pairs[role.name]
            if role.inverse:
                pairs[role.inverse] |= {(b, a) for a, b in own}
                own |= {(b, a) for a, b in pairs[role.inverse]}
            if role.symmetric:
                own |= {(b, a) for a, b in own}
            chains = [*role.chains, *([(role.name, role.name)] if role.transitive else [])]
            for one, other in chains:
                own |= {(a, d) for a, b in pairs[one] for c, d in pairs[other] if b == c}
        if pairs == before:
            return pairs


def members(expression, scene, pairs, words=WORDS):  # noqa: PLR0911, PLR0912 - one case a constructor
    """Return who is of an expression, by its definition."""
    everyone = {i for i in range(scene.present.shape[1]) if scene.present[0, i]}

    def of(part):
        return members(part, scene, pairs, words)

    def count(role, filler):
        inside = of(filler)
        return {i: sum((i, j) in pairs[role] for j in inside) for i in everyone}

    match expression:
        case Top():
            return everyone
        case Bottom():
            return set()
        case Named("Scene"):
            return {0}
        case Named(name) if name in words.definitions:
            return of(words.definitions[name].expression)
        case Named(name):
            return {i for i in everyone if scene.classes[0, list(words.concepts).index(name), i]}
        case And(parts):
            return set.intersection(*map(of, parts))
        case Or(parts):
            return set.union(*map(of, parts))
        case Not(part):
            return everyone - of(part)
        case Some(role, filler):
            return {i for i, n in count(role, filler).items() if n}
        case Only(role, filler):
            return {i for i, n in count(role, Not(filler)).items() if not n}
        case AtLeast(number, role, filler):
            return {i for i, n in count(role, filler).items() if n >= number}
        case AtMost(number, role, filler):
            return {i for i, n in count(role, filler).items() if n <= number}
        case HasSelf(role):
            return {i for i in everyone if (i, i) in pairs[role]}
        case HasValue(role, name):
            place = 1 + list(words.individuals).index(name)
            return {i for i in everyone if (i, place) in pairs[role]}
        case Facet(number, comparison, bound):
            values = scene.numbers[0, list(words.numbers).index(number)]
            return {i for i in everyone if COMPARE[comparison](values[i], bound)}
    raise AssertionError(expression)
