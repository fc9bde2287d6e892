"""The words of the knowledge base: what there is in a map, and how it hangs together (§3.4.1), in OWL's terms."""

from typing import NamedTuple

TERMS = "urn:semrl:ontology#"
"""Namespace of classes and properties."""
INSTANCES = "urn:semrl:map:"
"""Namespace of the states, transitions, actions and rules of a map that is of no run; a run has its own."""

PREFIXES = {
    "rdf": "http://www.w3.org/1999/02/22-rdf-syntax-ns#",
    "rdfs": "http://www.w3.org/2000/01/rdf-schema#",
    "owl": "http://www.w3.org/2002/07/owl#",
    "xsd": "http://www.w3.org/2001/XMLSchema#",
    "semrl": TERMS,
}
"""Prefix → namespace, of what all maps have in common."""


def prefixes(base: str = INSTANCES) -> dict[str, str]:
    """Return prefix → namespace, for a map whose instances have names that begin with `base`."""
    return {**PREFIXES, "map": base}


class Class(NamedTuple):
    """A class, its place below another one, and what it is for."""

    name: str
    parent: str | None
    comment: str


class Property(NamedTuple):
    """A property of the instances of a class; its range is a class, or a datatype when it begins with ``xsd:``."""

    name: str
    domain: str
    range: str
    comment: str
    inverse: str | None = None


CLASSES = (
    Class("Cluster", None, "What a clustering tree holds to be one: similar states or similar transitions."),
    Class("State", "Cluster", "A node of the map: a cluster of similar states."),
    Class("Transition", "Cluster", "An edge of the map: a cluster of similar transitions between two states."),
    Class("PositiveTransition", "Transition", "A transition whose reward, rounded, is 1."),
    Class("NegativeTransition", "Transition", "A transition whose reward, rounded, is -1."),
    Class("NeutralTransition", "Transition", "A transition whose reward, rounded, is 0."),
    Class("Action", None, "What the agent can do."),
    Class("Rule", None, "When all its conditions hold, what it is about changes by so much: a leaf of a pruned tree."),
)

PROPERTIES = (
    Property("source", "Transition", "State", "The state that a transition starts from.", "outgoing"),
    Property("target", "Transition", "State", "The state that a transition ends in.", "incoming"),
    Property("outgoing", "State", "Transition", "A transition that starts from a state.", "source"),
    Property("incoming", "State", "Transition", "A transition that ends in a state.", "target"),
    Property("leadsTo", "State", "State", "Some transition goes from the one state to the other."),
    Property("action", "Transition", "Action", "The action most often taken in a transition."),
    Property("actionShare", "Transition", "xsd:double", "How often that action was the one taken, 0 to 1."),
    Property("reward", "Transition", "xsd:double", "The mean reward of a transition."),
    Property("count", "Cluster", "xsd:integer", "How many states or transitions of the game a cluster stands for."),
    Property("number", "Cluster", "xsd:integer", "Number of a cluster in its tree; it stays as the map grows."),
    Property("actionNumber", "Action", "xsd:integer", "Number of an action in the environment."),
    Property("about", "Rule", "xsd:string", "The number of a state that a rule predicts, or the reward."),
    Property("condition", "Rule", "xsd:string", "What must hold; a rule may have several."),
    Property("change", "Rule", "xsd:double", "By how much the number changes, or the reward itself."),
    Property("support", "Rule", "xsd:integer", "For how many decisions of the play a rule held."),
    Property("error", "Rule", "xsd:double", "Root mean squared error of a rule in them."),
)
