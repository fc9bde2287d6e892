"""One decision, laid open: rows that say what was seen, planned, done, and what came of it."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Literal

from semrl.core import Frame, Sight


@dataclass(frozen=True, kw_only=True, slots=True)
class MapLocation:
    """A node of the map, the state's own (§3.4.1)."""

    node: int
    """Its id."""
    states: int
    """How many states of play it stands for."""
    distance: float | None
    """Cost of the way to what is sought; None where none is known within the cut-off."""
    is_goal: bool
    """Whether that is right here."""
    sought: Literal["gain", "goal"] = "gain"
    """Whether ways lead to where the nearest gain begins, or to where a goal that was given is met."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PathEdge:
    """An edge of the path (§3.4.2)."""

    source: int
    target: int
    edge: int
    """Ids."""
    action: str
    share: float
    """The most frequent action of its transitions, and how large a share of them it has."""
    count: int
    """How many transitions of play it stands for."""
    reward: float
    """Their mean reward."""
    cost: float
    """What it adds to the path."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ImaginedScenario:
    """A scenario (§3.4.3)."""

    rank: int
    """MapLocation in the planner's order, from 1."""
    actions: tuple[str, ...]
    """The name of each."""
    rewards: tuple[float, ...]
    """Predicted sign of the reward of each."""
    predicted_return: float
    """Their sum, discounted as the planner does, with what is expected beyond, less what the uncertainty counts."""
    uncertainty: float | None
    """Standard deviation of the return among the models that were asked; None where there is only one."""
    end_node: int
    """Id of the node in which it ends."""
    progress: int | None
    """MapLocation of that node on the path, from 0; None off the path."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PlanFeature:
    """A part of the goal, as the agent was shown it (§3.4.4)."""

    part: str
    """Which one."""
    numbers: tuple[float, ...]
    """What the agent was given."""
    names: tuple[str, ...]
    """What they stand for: the actions of the scenario, or the features of its last state where they have names."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ActionChoice:
    """What was done."""

    action: str
    """The one taken."""
    agent: str
    planner: str
    """What either of them would do."""
    by_chance: bool
    """Whether evaluation's exploration put another action in the place of the decider's."""
    values: Mapping[str, float]
    """The agent's value of each action, by name."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Rollout:
    """What really came, for as many decisions as a scenario has."""

    actions: tuple[str, ...]
    rewards: tuple[float, ...]
    """Of each decision, this one first."""
    ended: bool
    """Whether the episode ended with the last of them."""
    predicted: tuple[float, ...]
    """Sign of each reward as the models predict it at this decision, for just these actions."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Explanation:
    """One decision of an evaluation episode, and why it was taken."""

    run: str
    model: str
    env: str
    trained_decisions: int
    """Who played what, and how long it had learned."""
    policy: str
    seed: int
    episode: int
    step: int
    """Which decision it is."""
    exploration: float
    """Probability with which evaluation acts at random."""
    return_so_far: float
    """Return before the decision."""
    frame: Frame
    sight: Sight
    """What was shown, and what perception made of it."""
    features: Mapping[str, float]
    """Names and values of the state's numbers, where they have names, as the rules give them: percent of the image, or
    the emulator's pixels."""
    place: MapLocation
    path: tuple[PathEdge, ...]
    cutoff: float
    """Where on the map, the way to what is sought (to a gain with the rewarding edge last), and the highest cost."""
    scenarios: tuple[ImaginedScenario, ...]
    n_scenarios: int
    n_imagined: int
    reason: str
    """The best, of equal ones the first, how many were compared, how many were imagined before some models chose among
    them, and why the first one is the first."""
    otherwise: tuple[ImaginedScenario, ...]
    """For each action that the first does not begin with: the best that was found when only it could begin."""
    plan_features: tuple[PlanFeature, ...]
    choice: ActionChoice
    rollout: Rollout
    """What the agent was shown, what was done, what came."""

    def to_json(self) -> dict[str, Any]:
        """Return everything but the frame, of what JSON knows; objects by box and class, joined ones by position."""
        rows = asdict(self)
        del rows["frame"], rows["sight"]
        classes = self.sight.classes.tolist() or [None] * len(self.sight.boxes_px)
        boxes = self.sight.boxes_px.tolist()
        objects = [{"class": kind, "box_px": box} for kind, box in zip(classes, boxes, strict=True)]
        cutoff = self.cutoff if math.isfinite(self.cutoff) else None  # JSON has no infinities
        seen = {"objects": objects, "joined": self.sight.edges.tolist(), "remarks": list(self.sight.remarks)}
        return rows | {"cutoff": cutoff} | seen
