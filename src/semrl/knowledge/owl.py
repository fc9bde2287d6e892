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
class _Triples:
    """Triples of one ontology; blank nodes are numbered, so that equal ontologies give equal files."""

    base: str
    found: list[ox.Triple] = field(default_factory=list)
    blanks: int = 0

    def add(self, subject: ox.NamedNode | ox.BlankNode, predicate: str, told: _Term) -> None:
        self.found.append(ox.Triple(subject, node(predicate), told))

    def blank(self) -> ox.BlankNode:
        self.blanks += 1
        return ox.BlankNode(f"b{self.blanks}")

    def own(self, name: str) -> ox.NamedNode:
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
        blank = self.blank()
        self.add(blank, "rdf:type", node("owl:Restriction"))
        self.add(blank, "owl:onProperty", self.own(role))
        for predicate, told in said.items():
            self.add(blank, f"owl:{predicate}", told)
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
                return self._class(joint, self.list_of([self.of(part) for part in parts]))
            case Not(part):
                return self._class("owl:complementOf", self.of(part))
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

    def _class(self, joint: str, told: _Term) -> ox.BlankNode:
        blank = self.blank()
        self.add(blank, "rdf:type", node("owl:Class"))
        self.add(blank, joint, told)
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
        What it was learned from: name → value, told as annotations of the ontology.

    Notes
    -----
    OWL 2 DL counts along simple roles only, so that what makes a role that is counted along transitive, or follow from
    chains, is left out.
    """
    told = _Triples(base)
    _ontology(told, about, provenance or {})
    _classes(told, words)
    _roles(told, words)
    _individuals(told, words)
    return told.found


def write_owl(triples: Sequence[ox.Triple], base: str, suffix: str) -> bytes:
    """Write triples as Turtle (``.ttl``) or RDF/XML (``.owl``)."""
    file = io.BytesIO()
    ox.serialize(triples, file, _FORMATS[suffix], prefixes={**PREFIXES, "prov": PROV, "run": base})
    return file.getvalue()


def _ontology(told: _Triples, about: str, provenance: Mapping[str, str]) -> None:
    head = ox.NamedNode(told.base.rstrip("#/"))
    told.add(head, "rdf:type", node("owl:Ontology"))
    if about:
        told.add(head, "rdfs:label", ox.Literal(about))
    for name, value in provenance.items():
        told.add(head, f"prov:{name}", ox.Literal(value))
    for annotation in (*(f"prov:{name}" for name in provenance), "semrl:support", "semrl:error", "semrl:origin"):
        told.add(node(annotation), "rdf:type", node("owl:AnnotationProperty"))


def _classes(told: _Triples, words: Ontology) -> None:
    for name, comment in {SCENE: SCENES, **words.concepts}.items():
        _named(told, name, "owl:Class", comment)
    for below, above in words.parents:
        told.add(told.own(below), "rdfs:subClassOf", told.own(above))
    tops = [name for name in words.concepts if all(name != below for below, _ in words.parents)]
    for group in (*words.disjoint, *((SCENE, top) for top in tops)):
        blank = told.blank()
        told.add(blank, "rdf:type", node("owl:AllDisjointClasses"))
        told.add(blank, "owl:members", told.list_of([told.own(name) for name in group]))
    for (concept, number), (low, high) in words.ranges.items():
        within = told.bounded([(">=", low), ("<=", high)])
        told.add(told.own(concept), "rdfs:subClassOf", told.restriction(number, allValuesFrom=within))
    for concept, most in words.limits.items():
        told.add(told.own(SCENE), "rdfs:subClassOf", told.of(AtMost(most, "contains", Named(concept))))
    for name, definition in words.definitions.items():
        _named(told, name, "owl:Class", definition.comment)
        told.add(told.own(name), "owl:equivalentClass", told.of(definition.expression))
        told.add(told.own(name), "semrl:origin", ox.Literal(definition.origin))
        if definition.support:
            told.add(told.own(name), "semrl:support", ox.Literal(definition.support))
            told.add(told.own(name), "semrl:error", _double(definition.error))


def _roles(told: _Triples, words: Ontology) -> None:
    counted = counted_roles(words)
    _named(told, "contains", "owl:ObjectProperty", "From a scene to its things.")
    told.add(told.own("contains"), "rdfs:domain", told.own(SCENE))
    comments = {role.name: role.comment for role in words.roles}
    for name in words.role_names[1:]:
        _named(told, name, "owl:ObjectProperty", comments.get(name, ""))
    for role in words.roles:
        own = told.own(role.name)
        if role.inverse:
            told.add(own, "owl:inverseOf", told.own(role.inverse))
        if role.symmetric:
            told.add(own, "rdf:type", node("owl:SymmetricProperty"))
        if counted.isdisjoint({role.name, role.inverse}):
            if role.transitive:
                told.add(own, "rdf:type", node("owl:TransitiveProperty"))
            for chain in role.chains:
                told.add(own, "owl:propertyChainAxiom", told.list_of([told.own(name) for name in chain]))
    for name, comment in words.numbers.items():
        _named(told, name, "owl:DatatypeProperty", comment)
        told.add(told.own(name), "rdf:type", node("owl:FunctionalProperty"))
        told.add(told.own(name), "rdfs:range", node("xsd:double"))


def counted_roles(words: Ontology) -> set[str]:
    """Return the roles that definitions count along, or ask to lead back to where they start."""
    every = (part for one in words.definitions.values() for part in walk(one.expression))
    return {part.role for part in every if isinstance(part, AtLeast | AtMost | HasSelf)}


def _individuals(told: _Triples, words: Ontology) -> None:
    for name, concept in words.individuals.items():
        _named(told, name, "owl:NamedIndividual", "")
        told.add(told.own(name), "rdf:type", told.own(concept))
    if len(words.individuals) > 1:
        blank = told.blank()
        told.add(blank, "rdf:type", node("owl:AllDifferent"))
        told.add(blank, "owl:distinctMembers", told.list_of([told.own(name) for name in words.individuals]))


def _named(told: _Triples, name: str, kind: str, comment: str) -> None:
    told.add(told.own(name), "rdf:type", node(kind))
    told.add(told.own(name), "rdfs:label", ox.Literal(name.replace("_", " ")))
    if comment:
        told.add(told.own(name), "rdfs:comment", ox.Literal(comment))


def _count(number: int) -> ox.Literal:
    return ox.Literal(str(number), datatype=node("xsd:nonNegativeInteger"))


def _double(number: float) -> ox.Literal:
    return ox.Literal(repr(float(number)), datatype=node("xsd:double"))


def node(name: str) -> ox.NamedNode:
    """Return the node of a prefixed name of OWL, RDF, XSD, PROV-O or semrl."""
    prefix, _, local = name.partition(":")
    return ox.NamedNode((PROV if prefix == "prov" else PREFIXES[prefix]) + local)
