"""An ontology in OWL 2 DL, as RDF triples: what Protégé opens and a description logic reasoner reads (§2.4)."""

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import pyoxigraph as ox

from semrl.knowledge.expressions import (
    And,
    AtLeast,
    AtMost,
    Bottom,
    Expression,
    Facet,
    HasSelf,
    HasValue,
    Named,
    Not,
    Only,
    Or,
    Some,
    Top,
    walk,
)
from semrl.knowledge.ontology import SCENE, Ontology
from semrl.knowledge.vocabulary import PREFIXES

PROV = "http://www.w3.org/ns/prov#"
_FACETS = {"<": "maxExclusive", "<=": "maxInclusive", ">": "minExclusive", ">=": "minInclusive"}
_FORMATS = {".ttl": ox.RdfFormat.TURTLE, ".owl": ox.RdfFormat.RDF_XML}
SCENES = "What is seen at one decision, as a whole."
"""What the class of scenes is, in words."""

_Term = ox.NamedNode | ox.BlankNode | ox.Literal


@dataclass
class Triples:
    """Triples of one ontology; blank nodes are numbered, so that equal ontologies give equal files."""

    base: str
    found: list[ox.Triple] = field(default_factory=list)
    blanks: int = 0

    def add(self, subject: ox.NamedNode | ox.BlankNode, predicate: str, value: _Term) -> None:
        """Note a triple."""
        self.found.append(ox.Triple(subject, node(predicate), value))

    def blank(self) -> ox.BlankNode:
        """Return the next blank node."""
        self.blanks += 1
        return ox.BlankNode(f"b{self.blanks}")

    def own(self, name: str) -> ox.NamedNode:
        """Return the node of a name of the ontology's own."""
        return ox.NamedNode(self.base + name)

    def list_of(self, members: Sequence[_Term]) -> _Term:
        """Return the head of an RDF list."""
        rest: _Term = node("rdf:nil")
        for member in reversed(members):
            head = self.blank()
            self.add(head, "rdf:first", member)
            self.add(head, "rdf:rest", rest)
            rest = head
        return rest

    def restriction(self, role: str, **said: _Term) -> ox.BlankNode:
        """Return the class of what is said of a property."""
        blank = self.blank()
        self.add(blank, "rdf:type", node("owl:Restriction"))
        self.add(blank, "owl:onProperty", self.own(role))
        for predicate, value in said.items():
            self.add(blank, f"owl:{predicate}", value)
        return blank

    def bounded(self, bounds: Sequence[tuple[str, float]]) -> ox.BlankNode:
        """Return the data range of doubles within bounds."""
        blank, facets = self.blank(), []
        for comparison, bound in bounds:
            facets.append(self.blank())
            self.add(facets[-1], f"xsd:{_FACETS[comparison]}", _double(bound))
        self.add(blank, "rdf:type", node("rdfs:Datatype"))
        self.add(blank, "owl:onDatatype", node("xsd:double"))
        self.add(blank, "owl:withRestrictions", self.list_of(facets))
        return blank

    def of(self, expression: Expression) -> _Term:  # noqa: PLR0911 - one case a constructor
        """Return the node of a class expression."""
        match expression:
            case Named(name):
                return self.own(name)
            case Top() | Bottom():
                return node("owl:Thing" if isinstance(expression, Top) else "owl:Nothing")
            case And(parts) | Or(parts):
                joint = "owl:intersectionOf" if isinstance(expression, And) else "owl:unionOf"
                return self.combined(joint, self.list_of([self.of(part) for part in parts]))
            case Not(part):
                return self.combined("owl:complementOf", self.of(part))
            case Some(role, filler):
                return self.restriction(role, someValuesFrom=self.of(filler))
            case Only(role, filler):
                return self.restriction(role, allValuesFrom=self.of(filler))
            case AtLeast(number, role, filler):
                return self.restriction(role, minQualifiedCardinality=_count(number), onClass=self.of(filler))
            case AtMost(number, role, filler):
                return self.restriction(role, maxQualifiedCardinality=_count(number), onClass=self.of(filler))
            case HasValue(role, individual):
                return self.restriction(role, hasValue=self.own(individual))
            case HasSelf(role):
                return self.restriction(role, hasSelf=ox.Literal(True))
            case Facet(number, comparison, bound):
                return self.restriction(number, someValuesFrom=self.bounded([(comparison, bound)]))

    def combined(self, joint: str, value: _Term) -> ox.BlankNode:
        """Return the class that a predicate such as ``owl:unionOf`` makes of a value."""
        blank = self.blank()
        self.add(blank, "rdf:type", node("owl:Class"))
        self.add(blank, joint, value)
        return blank


def to_triples(
    words: Ontology, base: str, *, about: str = "", provenance: Mapping[str, str] | None = None
) -> list[ox.Triple]:
    """Return an ontology as RDF.

    Parameters
    ----------
    words
        The ontology.
    base
        What all its names begin with, ending in ``#`` or ``/``.
    about
        What it is, in words.
    provenance
        What it was learned from: name → value, written as annotations of the ontology.

    Notes
    -----
    OWL 2 DL counts along simple roles only, so that what makes a role that is counted along transitive, or follow from
    chains, is left out.
    """
    triples = Triples(base)
    _ontology(triples, about, provenance or {})
    _classes(triples, words)
    _roles(triples, words)
    _individuals(triples, words)
    return triples.found


def write_owl(triples: Sequence[ox.Triple], base: str, suffix: str) -> bytes:
    """Write triples as Turtle (``.ttl``) or RDF/XML (``.owl``)."""
    file = io.BytesIO()
    ox.serialize(triples, file, _FORMATS[suffix], prefixes={**PREFIXES, "prov": PROV, "run": base})
    return file.getvalue()


def _ontology(triples: Triples, about: str, provenance: Mapping[str, str]) -> None:
    head = ox.NamedNode(triples.base.rstrip("#/"))
    triples.add(head, "rdf:type", node("owl:Ontology"))
    if about:
        triples.add(head, "rdfs:label", ox.Literal(about))
    for name, value in provenance.items():
        triples.add(head, f"prov:{name}", ox.Literal(value))
    for annotation in (*(f"prov:{name}" for name in provenance), "semrl:support", "semrl:error", "semrl:origin"):
        triples.add(node(annotation), "rdf:type", node("owl:AnnotationProperty"))


def _classes(triples: Triples, words: Ontology) -> None:
    for name, comment in {SCENE: SCENES, **words.concepts}.items():
        _named(triples, name, "owl:Class", comment)
    for below, above in words.parents:
        triples.add(triples.own(below), "rdfs:subClassOf", triples.own(above))
    tops = [name for name in words.concepts if all(name != below for below, _ in words.parents)]
    for group in (*words.disjoint, *((SCENE, top) for top in tops)):
        blank = triples.blank()
        triples.add(blank, "rdf:type", node("owl:AllDisjointClasses"))
        triples.add(blank, "owl:members", triples.list_of([triples.own(name) for name in group]))
    for (concept, number), (low, high) in words.ranges.items():
        within = triples.bounded([(">=", low), ("<=", high)])
        triples.add(triples.own(concept), "rdfs:subClassOf", triples.restriction(number, allValuesFrom=within))
    for concept, most in words.limits.items():
        triples.add(triples.own(SCENE), "rdfs:subClassOf", triples.of(AtMost(most, "contains", Named(concept))))
    for name, definition in words.definitions.items():
        _named(triples, name, "owl:Class", definition.comment)
        triples.add(triples.own(name), "owl:equivalentClass", triples.of(definition.expression))
        triples.add(triples.own(name), "semrl:origin", ox.Literal(definition.origin))
        if definition.support:
            triples.add(triples.own(name), "semrl:support", ox.Literal(definition.support))
            triples.add(triples.own(name), "semrl:error", _double(definition.error))


def _roles(triples: Triples, words: Ontology) -> None:
    counted = counted_roles(words)
    _named(triples, "contains", "owl:ObjectProperty", "From a scene to its things.")
    triples.add(triples.own("contains"), "rdfs:domain", triples.own(SCENE))
    comments = {role.name: role.comment for role in words.roles}
    for name in words.role_names[1:]:
        _named(triples, name, "owl:ObjectProperty", comments.get(name, ""))
    for role in words.roles:
        own = triples.own(role.name)
        if role.inverse:
            triples.add(own, "owl:inverseOf", triples.own(role.inverse))
        if role.symmetric:
            triples.add(own, "rdf:type", node("owl:SymmetricProperty"))
        if counted.isdisjoint({role.name, role.inverse}):
            if role.transitive:
                triples.add(own, "rdf:type", node("owl:TransitiveProperty"))
            for chain in role.chains:
                triples.add(own, "owl:propertyChainAxiom", triples.list_of([triples.own(name) for name in chain]))
    for name, comment in words.numbers.items():
        _named(triples, name, "owl:DatatypeProperty", comment)
        triples.add(triples.own(name), "rdf:type", node("owl:FunctionalProperty"))
        triples.add(triples.own(name), "rdfs:range", node("xsd:double"))


def counted_roles(words: Ontology) -> set[str]:
    """Return the roles that definitions count along, or ask to lead back to where they start."""
    every = (part for one in words.definitions.values() for part in walk(one.expression))
    return {part.role for part in every if isinstance(part, AtLeast | AtMost | HasSelf)}


def _individuals(triples: Triples, words: Ontology) -> None:
    for name, concept in words.individuals.items():
        _named(triples, name, "owl:NamedIndividual", "")
        triples.add(triples.own(name), "rdf:type", triples.own(concept))
    if len(words.individuals) > 1:
        blank = triples.blank()
        triples.add(blank, "rdf:type", node("owl:AllDifferent"))
        triples.add(blank, "owl:distinctMembers", triples.list_of([triples.own(name) for name in words.individuals]))


def _named(triples: Triples, name: str, kind: str, comment: str) -> None:
    triples.add(triples.own(name), "rdf:type", node(kind))
    triples.add(triples.own(name), "rdfs:label", ox.Literal(name.replace("_", " ")))
    if comment:
        triples.add(triples.own(name), "rdfs:comment", ox.Literal(comment))


def _count(number: int) -> ox.Literal:
    return ox.Literal(str(number), datatype=node("xsd:nonNegativeInteger"))


def _double(number: float) -> ox.Literal:
    return ox.Literal(repr(float(number)), datatype=node("xsd:double"))


def node(name: str) -> ox.NamedNode:
    """Return the node of a prefixed name of OWL, RDF, XSD, PROV-O or semrl."""
    prefix, _, local = name.partition(":")
    return ox.NamedNode((PROV if prefix == "prov" else PREFIXES[prefix]) + local)
