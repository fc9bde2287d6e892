"""What the trees have learned, as rules that a person can read and check.

A forest's trees have hundreds of leaves; most of them correct a few cases. Pruned from below where the least is lost
(cost-complexity pruning, Breiman et al. 1984) the few that say most are left.
"""

import hashlib
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from semrl.core import Floats, History
from semrl.core.errors import UsageError
from semrl.world_model.nearest import names_of_nearest
from semrl.world_model.switching import Region, SwitchedOff
from semrl.world_model.tree_kernels import Relations
from semrl.world_model.trees import Tree


@dataclass(frozen=True, kw_only=True, slots=True)
class Rule:
    """If all conditions hold, a number changes by so much."""

    about: str
    """The number that is predicted."""
    conditions: tuple[str, ...]
    """In words; none when it always holds."""
    value: float
    """The change, or the reward."""
    decisions: int
    """For which it held."""
    error: float
    """Root mean squared error in them."""
    claim: str = ""
    """What happens, in words, where that is no change by the value."""
    right: int | None = None
    """Of the decisions in which the conditions held, those in which the claim did; None where nothing is claimed."""

    @property
    def key(self) -> str:
        """A name by which it can be switched off: the same for the same conditions about the same number."""
        said = "\n".join((self.about, *self.conditions))
        return "r" + hashlib.sha256(said.encode()).hexdigest()[:7]

    def __str__(self) -> str:
        """Say it in one line."""
        return f"{self.about}: {sentence(self)}"


@dataclass(frozen=True, kw_only=True, slots=True)
class TreeRules:
    """The rules of one tree, and which of them holds where."""

    tree: Tree
    by_leaf: Mapping[int, Rule]
    """Node at which the pruned tree ends → its rule."""
    regions: Mapping[int, Region]
    """The same node → where its rule holds."""

    @property
    def by_support(self) -> list[Rule]:
        """The rules, those that hold most often first."""
        return sorted(self.by_leaf.values(), key=lambda rule: -rule.decisions)

    def at(self, row: Floats) -> Rule:
        """Return the rule whose conditions hold for what the tree sees of a decision, ``(f,)``."""
        node = 0
        while node not in self.by_leaf:
            right = row[self.tree.columns[node]] > self.tree.cuts[node]
            node = int(self.tree.left[node]) + int(right)
        return self.by_leaf[node]


@dataclass(frozen=True, kw_only=True, slots=True)
class RuleBook:
    """All rules of a world model, to be asked at decisions."""

    trees: tuple[TreeRules, ...]
    """Of each number that changes, of the reward, and of the return."""
    see: Callable[[History, int], Floats]
    """Returns what trees see of a decision, ``(f,)``, from the history in which it was taken and the action."""

    def fired(self, history: History, action: int) -> list[Rule]:
        """Return the rule of each number that holds when an action is taken where a history ends."""
        row = self.see(history, action)
        return [rules.at(row) for rules in self.trees]

    def named(self, keys: Collection[str]) -> list[SwitchedOff]:
        """Return where the rules of some names hold; those that are not here are left out."""
        return [
            SwitchedOff(target, rules.regions[node])
            for target, rules in enumerate(self.trees)
            for node, rule in rules.by_leaf.items()
            if rule.key in keys
        ]


def feature_names(names: Sequence[str], past_states: int, past_actions: int, relations: Relations) -> list[str]:
    """Name the columns of `semrl.world_model.tree_kernels.lay_out`."""
    changes = [
        f"the last change of {name}" if h == 0 else f"the change of {name} {h + 1} decisions ago"
        for h in range(past_states - 1)
        for name in names
    ]
    pairs, distances, nearest = relations
    compared = [
        text
        for one, other in ((names[i], names[j]) for i, j in pairs.tolist())
        for text in (
            f"{one} − {other}",
            f"{one} − {other}, if both go on,",
            *((f"|{one} − {other}|", f"|{one} − {other}|, if both go on,") if distances else ()),
        )
    ]
    for x, y, _ in nearest.columns.tolist():
        compared += names_of_nearest(names[x] if x >= 0 else "its x", names[y] if y >= 0 else "its y")
    actions = ["the action", *(f"the action {k + 1} before" for k in range(past_actions))]
    return [*names, *(f"{name}, if it goes on," for name in names), *changes, *compared, *actions]


def read_tree(
    tree: Tree,
    about: str,
    names: Sequence[str],
    actions: Sequence[str],
    *,
    most: int = 8,
    scale: float = 1.0,
    value_scale: float = 1.0,
) -> TreeRules:
    """Read the rules of a tree.

    Parameters
    ----------
    tree
        For one number.
    about
        Name of that number.
    names
        Of the columns, as `feature_names` gives them.
    actions
        Names of the actions.
    most
        Rules that are left.
    scale, value_scale
        What one unit of the columns, and one of what the tree predicts, is called.

    Raises
    ------
    UsageError
        When less than one rule is asked for.
    """
    if most < 1:
        raise UsageError(f"at least one rule must be asked for, not {most}")
    leaves = _pruned(tree, most)
    found: dict[int, Rule] = {}
    regions: dict[int, Region] = {}
    open_nodes: list[tuple[int, dict[int, tuple[float, float]]]] = [(0, {})]
    while open_nodes:
        node, bounds = open_nodes.pop()
        if node in leaves:
            conditions = tuple(_condition(names[column], *bound, actions, scale) for column, bound in bounds.items())
            found[node] = Rule(
                about=about,
                conditions=conditions,
                value=value_scale * float(tree.means[node]),
                decisions=int(tree.rows[node]),
                error=value_scale * float(np.sqrt(tree.errors[node])),
            )
            regions[node] = tuple((column, *bound) for column, bound in bounds.items())
            continue
        column, cut = int(tree.columns[node]), float(tree.cuts[node])
        low, high = bounds.get(column, (-np.inf, np.inf))
        open_nodes.append((int(tree.left[node]), bounds | {column: (low, min(high, cut))}))
        open_nodes.append((int(tree.left[node]) + 1, bounds | {column: (max(low, cut), high)}))
    return TreeRules(tree=tree, by_leaf=found, regions=regions)


def sentence(rule: Rule) -> str:
    """Say a rule: what changes, when, and in how many decisions it was seen."""
    if rule.claim and rule.right is not None:
        when = " and ".join(rule.conditions)
        when = when if when == "otherwise" else f"if {when}"
        return f"{rule.claim} {when}  ({rule.right:,} of {rule.decisions:,})"
    when = f", if {' and '.join(rule.conditions)}" if rule.conditions else ", always"
    within = "exactly" if rule.error == 0 else f"± {rule.error:.2g}"
    value = round(rule.value, 3) + 0.0  # never −0
    return f"{value:+.3g}{when}  ({rule.decisions:,} decisions, {within})"


def _pruned(tree: Tree, most: int) -> set[int]:
    """Return the nodes that are leaves when a tree is pruned to so many."""
    inner = tree.columns >= 0
    loss = tree.rows * tree.errors  # of a node as a leaf
    leaves = set(np.flatnonzero(~inner).tolist())
    parents = {int(child): node for node in np.flatnonzero(inner).tolist() for child in _children(tree, node)}
    candidates = {
        node: loss[node] - loss[list(_children(tree, node))].sum()
        for node in np.flatnonzero(inner).tolist()
        if leaves.issuperset(_children(tree, node))
    }
    while len(leaves) > most and candidates:
        node = min(candidates, key=lambda one: candidates[one])
        del candidates[node]
        leaves -= set(_children(tree, node))
        leaves.add(node)
        parent = parents.get(node)
        if parent is not None and leaves.issuperset(_children(tree, parent)):
            candidates[parent] = loss[parent] - loss[list(_children(tree, parent))].sum()
    return leaves


def _children(tree: Tree, node: int) -> tuple[int, int]:
    return int(tree.left[node]), int(tree.left[node]) + 1


def _condition(name: str, low: float, high: float, actions: Sequence[str], scale: float) -> str:
    """Say between which bounds a number lies, or which actions are meant."""
    if name.startswith("the action"):
        meant = [action for i, action in enumerate(actions) if low < i <= high]
        return f"{name} is {' or '.join(meant) or 'not there yet'}"
    low, high = scale * low, scale * high
    if not np.isfinite(low):
        return f"{name} ≤ {high:.4g}"
    if not np.isfinite(high):
        return f"{name} > {low:.4g}"
    return f"{low:.4g} < {name} ≤ {high:.4g}"
