"""The configuration of a run: composed here, read from TOML, never evaluated as code."""

import difflib
import importlib.resources
import tomllib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any, Literal, get_args

import msgspec
import tomli_w

from semrl.agents import AGENTS, DQNConfig
from semrl.agents.devices import Device
from semrl.core.errors import UsageError
from semrl.envs import EnvironmentConfig
from semrl.perception.config import PerceptionConfig
from semrl.perception.encoders import ENCODERS
from semrl.perception.pretraining.stability import StabilityConfig
from semrl.planning.config import PlanningConfig

PRESETS = ("semrl", "thesis")


@dataclass(frozen=True, kw_only=True, slots=True)
class Model:
    """An agent of Table 4.1, or one like them: what it is shown, and whether it plans."""

    encoder: str
    plans: bool = False


MODELS = {
    "baseline": Model(encoder="grey"),
    "otsu": Model(encoder="components"),
    "birch": Model(encoder="classes"),
    "semantic": Model(encoder="scene"),
    "semantic-map": Model(encoder="scene", plans=True),
    "objects": Model(encoder="objects"),
    "objects-map": Model(encoder="objects", plans=True),
    "ram": Model(encoder="ram"),
    "ram-map": Model(encoder="ram", plans=True),
}
"""The models of Table 4.1, and two on tracked objects."""

MAX_THREADS = 1024


ClassesMode = Literal["off", "on", "shuffled"]
"""Whether classes of scenes count in plans."""


@dataclass(frozen=True, kw_only=True)
class EvaluationConfig:
    """How a trained agent is tested."""

    episodes: int = 30
    """Episodes to play."""
    max_noops: int = 30
    """At most so many random no-op decisions at the start of an episode, in games that have an action for it."""
    exploration: float = 0.0
    """Probability of a random action; 0: the agent always does what it values most."""
    sticky_actions: float | None = None
    """Probability that a frame repeats the previous action (Machado et al. 2018); None: as in training."""
    variant: str | None = None
    """How the game is altered, see environment.variant; None: as in training."""
    classes: ClassesMode = "off"
    """Whether what is imagined counts by the classes Danger and Chance that were learned; shuffled: as if their rules
    had been dealt out among them by chance, to compare."""
    max_decisions: int = 27_000
    """Decisions after which an episode is cut: 108,000 frames at frame skip 4, as is usual for Atari games."""

    def __post_init__(self) -> None:
        if self.episodes < 1 or self.max_noops < 0:
            raise UsageError(
                f"evaluation.episodes must be 1 or more, evaluation.max_noops 0 or more; "
                f"not {self.episodes} and {self.max_noops}"
            )
        if self.max_decisions < 1:
            raise UsageError(f"evaluation.max_decisions must be 1 or more, not {self.max_decisions}")
        if self.classes not in get_args(ClassesMode):
            raise UsageError(f"evaluation.classes is one of {', '.join(get_args(ClassesMode))}, not {self.classes}")
        for name in ("exploration", "sticky_actions"):
            if not 0 <= (getattr(self, name) or 0) <= 1:
                raise UsageError(f"evaluation.{name} is a probability from 0 to 1, not {getattr(self, name)}")


@dataclass(frozen=True, kw_only=True)
class RunConfig:
    """Everything that decides the result of a run; the defaults are the thesis's."""

    model: str = "semantic"
    """Which agent of the thesis's Table 4.1, or objects, objects-map, which see what is tracked: an encoder, and a
    planner for those with a map."""
    encoder: str = "auto"
    """What the agent is shown, when it is not what the model's name says (auto): another registered encoder."""
    agent: str = "dqn"
    """Which agent learns."""
    device: Device = "auto"
    """Where its networks compute: auto takes a GPU where there is one."""
    env: str = "PongNoFrameskip-v4"
    """Environment as `gymnasium.make` takes it: an id, or module:Id-v0."""
    decisions: int = 2_000_000
    """Budget in decisions, perception included; one decision takes environment.frame-skip emulator frames."""
    seed: int = 0
    """Of everything random that is played or learned: episodes, exploration, weights, replay."""
    threads: int = 1
    """Processor threads; results repeat exactly for the same number."""
    checkpoint_seconds: float = 120.0
    """Seconds between two checkpoints; does not change the result."""
    environment: EnvironmentConfig = field(default_factory=EnvironmentConfig)
    """How the game is played."""
    perception: PerceptionConfig = field(default_factory=PerceptionConfig)
    """How frames become states."""
    stability: StabilityConfig = field(default_factory=StabilityConfig)
    """When perception has learned enough."""
    dqn: DQNConfig = field(default_factory=DQNConfig)
    """How deep Q-learning learns."""
    planning: PlanningConfig = field(default_factory=PlanningConfig)
    """How models with a map plan."""
    evaluation: EvaluationConfig = field(default_factory=EvaluationConfig)
    """How the agent is tested."""
    milestones: tuple[int, ...] = ()
    """Decisions after which the agent, as it is then, is kept for `semrl eval --at`; does not change the result."""
    options: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Parameters of agents that other packages add: name of the agent → parameter → value."""

    def __post_init__(self) -> None:
        if self.model not in MODELS:
            raise UsageError(f"unknown model '{self.model}'; there are {', '.join(MODELS)}")
        if self.encoder != "auto":
            ENCODERS.check(self.encoder)
        AGENTS.check(self.agent)
        if self.decisions < 1:
            raise UsageError(f"decisions must be 1 or more, not {self.decisions}")
        if not 0 <= self.seed < 1 << 63:
            raise UsageError(f"seed must lie between 0 and 2^63 - 1, not {self.seed}")
        if not 1 <= self.threads <= MAX_THREADS:
            raise UsageError(f"threads must lie between 1 and {MAX_THREADS}, not {self.threads}")
        if any(not 1 <= milestone <= self.decisions for milestone in self.milestones):
            raise UsageError(f"milestones are decisions, 1 to the budget's {self.decisions:,}, not {self.milestones}")
        if not self.checkpoint_seconds >= 0:
            raise UsageError(f"checkpoint_seconds must be 0 or more, not {self.checkpoint_seconds}")

    @property
    def plans(self) -> bool:
        """Whether this model has a map and a planner."""
        return MODELS[self.model].plans

    @property
    def encoder_name(self) -> str:
        """Which encoder shows the agent what it sees."""
        return MODELS[self.model].encoder if self.encoder == "auto" else self.encoder


def preset(name: str, model: str | None = None, overrides: Mapping[str, Any] | None = None) -> RunConfig:
    """Return the configuration of a preset for a model, changed by overrides.

    Parameters
    ----------
    name
        ``"thesis"`` or ``"semrl"``; a file of this name lies in ``presets/``. It may hold a table
        ``[models.NAME]`` with what differs for one model.
    model
        A model of Table 4.1; the preset's own when None.
    overrides
        Nested values, as a TOML file gives them; they may hold such tables as well.

    Raises
    ------
    UsageError
        When the preset, the model or a key is unknown, or a value has the wrong type.

    Examples
    --------
    >>> config = preset("semrl", "objects-map", {"env": "semrl/Catch-v0", "decisions": 1_500})
    >>> config.decisions, config.planning.world_model
    (1500, 'trees')
    """
    if name not in PRESETS:
        raise UsageError(f"unknown preset '{name}'; there are {', '.join(PRESETS)}")
    text = importlib.resources.files("semrl").joinpath("presets", f"{name}.toml").read_text(encoding="utf-8")
    values = tomllib.loads(text)
    special = values.pop("models", {})
    overrides = dict(overrides or {})
    chosen = model or overrides.get("model") or values.get("model", RunConfig().model)
    if not isinstance(chosen, str) or chosen not in MODELS:
        raise UsageError(f"unknown model '{chosen}'; there are {', '.join(MODELS)}")
    own = overrides.pop("models", {})
    if not isinstance(own, Mapping) or not all(isinstance(table, Mapping) for table in own.values()):
        raise UsageError(f"preset {name}: 'models' holds a table for each model, [models.NAME]")
    _check_keys(own, dict.fromkeys(MODELS), f"preset {name}", "models.")
    layers = (values, special.get(chosen, {}), overrides, own.get(chosen, {}), {"model": chosen})
    merged: dict[str, Any] = {}
    for layer in layers:
        merged = merge(merged, layer)
    return from_dict(merged, source=f"preset {name}")


def from_dict(values: Mapping[str, Any], *, source: str) -> RunConfig:
    """Make a configuration from nested values; what they leave out keeps its default.

    Raises
    ------
    UsageError
        When a key is unknown or a value has the wrong type; the message names ``source``.
    """
    _check_keys(values, to_dict(RunConfig()), source)
    try:
        return msgspec.convert(values, RunConfig)
    except (msgspec.ValidationError, ValueError, UsageError) as error:
        raise UsageError(f"{source}: {error}") from None


def to_dict(config: RunConfig) -> dict[str, Any]:
    """Return the configuration as nested dictionaries of TOML types."""
    return asdict(config)  # msgspec would leave out what has its default, and defaults may change


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    UsageError
        When it is missing or no TOML.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UsageError(f"cannot read {path}: {error.strerror}") from None
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise UsageError(f"{path} is not valid TOML: {error}") from None


def write_toml(config: RunConfig) -> str:
    """Return the configuration as TOML text; what is None is left out, which TOML has no word for."""
    return tomli_w.dumps(_without_none(to_dict(config)))


def _without_none(values: Mapping[str, Any]) -> dict[str, Any]:
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
        for key, value in values.items()
        if value is not None
    }


def merge(below: Mapping[str, Any], above: Mapping[str, Any]) -> dict[str, Any]:
    """Put nested values on top of others."""
    merged = dict(below)
    for key, value in above.items():
        old = merged.get(key)
        merged[key] = merge(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return merged


def _check_keys(values: Mapping[str, Any], known: Mapping[str, Any], source: str, path: str = "") -> None:
    for key, value in values.items():
        if key not in known:
            close = difflib.get_close_matches(key, known, n=1)
            hint = f"; did you mean '{path}{close[0]}'?" if close else ""
            raise UsageError(f"{source}: unknown setting '{path}{key}'{hint}")
        if key != "options" and isinstance(known[key], Mapping) and isinstance(value, Mapping):
            _check_keys(value, known[key], source, f"{path}{key}.")
