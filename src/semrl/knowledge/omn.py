"""An ontology in OWL's Manchester syntax, as people read it: what Protégé opens and writes too (§2.4)."""

from collections.abc import Iterator, Mapping

from semrl.knowledge.expressions import AtMost, Named
from semrl.knowledge.ontology import SCENE, Definition, Ontology
from semrl.knowledge.owl import PROV, SCENES, counted_roles
from semrl.knowledge.vocabulary import PREFIXES
from semrl.knowledge.writing import write_manchester


def write_omn(words: Ontology, base: str, *, about: str = "", provenance: Mapping[str, str] | None = None) -> str:
    """Return an ontology as a document in Manchester syntax; see `semrl.knowledge.owl.to_triples`."""
    parts = [
        *_head(base, about, provenance or {}),
        *_classes(words),
        *_roles(words),
        *_numbers(words),
        *_individuals(words),
    ]
    return "\n".join([*parts, ""])


def _head(base: str, about: str, provenance: Mapping[str, str]) -> Iterator[str]:
    yield f"Prefix: : <{base}>"
    for prefix, namespace in {**PREFIXES, "prov": PROV}.items():
        yield f"Prefix: {prefix}: <{namespace}>"
    yield f"\nOntology: <{base.rstrip('#/')}>"
    annotations = [*([f"rdfs:label {_quoted(about)}"] if about else [])]
    annotations += [f"prov:{name} {_quoted(value)}" for name, value in provenance.items()]
    if annotations:
        yield "    Annotations: " + ", ".join(annotations)
    for name in (*(f"prov:{name}" for name in provenance), "semrl:support", "semrl:error", "semrl:origin"):
        yield f"\nAnnotationProperty: {name}"


def _classes(words: Ontology) -> Iterator[str]:
    limits = [write_manchester(AtMost(most, "contains", Named(name))) for name, most in words.limits.items()]
    yield from _frame("Class", SCENE, SCENES, SubClassOf=limits)
    for name, comment in words.concepts.items():
        above = [up for low, up in words.parents if low == name and up != name]
        ranges = [
            f'{number} only xsd:double[>= "{low!r}"^^xsd:double, <= "{high!r}"^^xsd:double]'
            for (concept, number), (low, high) in words.ranges.items()
            if concept == name
        ]
        yield from _frame("Class", name, comment, SubClassOf=[*above, *ranges])
    for name, one in words.definitions.items():
        yield from _frame("Class", name, one.comment, _learned(one), EquivalentTo=[write_manchester(one.expression)])
    tops = [name for name in words.concepts if all(name != low or low == up for low, up in words.parents)]
    for group in (*words.disjoint, *((SCENE, top) for top in tops)):
        yield f"\nDisjointClasses: {', '.join(group)}"


def _learned(one: Definition) -> list[str]:
    annotations = [f"semrl:origin {_quoted(one.origin)}"]
    if one.support:
        annotations += [f"semrl:support {one.support}", f'semrl:error "{one.error!r}"^^xsd:double']
    return annotations


def _roles(words: Ontology) -> Iterator[str]:
    counted = counted_roles(words)
    yield from _frame("ObjectProperty", "contains", "From a scene to its things.", Domain=[SCENE])
    declared = {role.name: role for role in words.roles}
    for name in words.role_names[1:]:
        role = declared.get(name)
        if role is None:
            yield from _frame("ObjectProperty", name, "")
            continue
        simple = not counted.isdisjoint({role.name, role.inverse})
        kinds = ["Symmetric"] * role.symmetric + ["Transitive"] * (role.transitive and not simple)
        chains = [] if simple else [f"{one} o {other}" for one, other in role.chains]
        inverse = [role.inverse] if role.inverse else []
        yield from _frame("ObjectProperty", name, role.comment, Characteristics=kinds, InverseOf=inverse)
        for chain in chains:
            yield f"    SubPropertyChain: {chain}"


def _numbers(words: Ontology) -> Iterator[str]:
    for name, comment in words.numbers.items():
        yield from _frame("DataProperty", name, comment, Characteristics=["Functional"], Range=["xsd:double"])


def _individuals(words: Ontology) -> Iterator[str]:
    for name, concept in words.individuals.items():
        yield from _frame("Individual", name, "", Types=[concept])
    if len(words.individuals) > 1:
        yield f"\nDifferentIndividuals: {', '.join(words.individuals)}"


def _frame(
    kind: str, name: str, comment: str, annotations: list[str] | None = None, **sections: list[str]
) -> Iterator[str]:
    """Yield the lines of one frame; sections that are empty are left out."""
    yield f"\n{kind}: {name}"
    notes = [f"rdfs:label {_quoted(name.replace('_', ' '))}"]
    notes += [f"rdfs:comment {_quoted(comment)}"] if comment else []
    yield "    Annotations: " + ", ".join([*notes, *(annotations or [])])
    for section, values in sections.items():
        if values:
            yield f"    {section}: {', '.join(values)}"


def _quoted(text: str) -> str:
    escaped = " ".join(text.split()).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'
