"""Symbols, plans and goals for somebody else's agent, learned as it plays: a Gymnasium wrapper."""

from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import gymnasium as gym
import numpy as np

from semrl.core import Floats, Frame, Outcome
from semrl.core.arrays import array_to_json, json_to_array, nest, unnest
from semrl.core.errors import SemrlError, UsageError
from semrl.core.files import read_arrays, write_arrays
from semrl.envs import Game, action_meanings, observation_of, rom_name
from semrl.envs.actions import Env
from semrl.envs.game import checked_reward
from semrl.envs.lives import SIGNAL
from semrl.perception.encoders import ENCODERS
from semrl.planning.module import PlanRecord
from semrl.training import RunConfig, preset
from semrl.training.config import from_dict, to_dict
from semrl.training.crowd import needed_slots, with_room
from semrl.training.loop import EpisodeView, Step
from semrl.training.parts import make_planning
from semrl.training.stored_play import learn_to_see
from semrl.world_model.protocol import RuleBased
from semrl.world_model.rules import Rule

Shown = dict[str, Floats]


class SemanticEnv(gym.Wrapper[Shown, Any, Frame, Any], gym.utils.RecordConstructorArgs):
    """An environment whose observations are a state, the features of a plan, and a goal.

    Perception learns first, from random play (some 500 decisions in the preset ``semrl``, which are played twice to the
    same seeds: first to count what moves), when it is made. Then map, world model and rules are learned from what the
    agent does, whoever it is, and plans are made with them.

    Parameters
    ----------
    env
        Discrete actions, RGB frames; see `make_env`.
    config
        Which encoder, planner and world model; by default the preset ``semrl`` for ``objects-map``. How its own agent
        would learn plays no part.
    plan
        Whether ``plan`` and ``goal`` are shown. Without them decisions are several times cheaper; map, world model and
        rules are learned all the same.
    learn
        Whether map and world model go on learning.

    Attributes
    ----------
    observation_space : Dict
        ``state``: the state's vector and its difference to the one before, ``(2 d,)``, or for images both as
        channels, ``(84, 84, 2)``, float32. ``plan``: features of the best scenario (§3.4.4), ``(p,)``, zeros until
        something can be predicted. ``goal``: ``(k + 1,)``, 1 and the facts of the place where the next gain begins on
        the map, or zeros where no way to one is known.
    feature_names : tuple of str
        Of the facts, where they have names.
    record : PlanRecord or None
        The newest plan, for those who ask why.
    pretraining_decisions : int
        Decisions of random play that perception has learned from.

    Raises
    ------
    UsageError
        When the encoder of the configuration shows nothing to plan with.

    Examples
    --------
    >>> from semrl import make_env, preset
    >>> quick = {"stability": {"decisions": 60}, "perception": {"foreground": {"background_frames": 30},
    ...          "slot_assigner": {"frames": 30}}}
    >>> env = SemanticEnv(make_env("semrl/Catch-v0"), preset("semrl", "objects-map", quick))
    >>> shown, info = env.reset(seed=0)
    >>> sorted(shown)
    ['goal', 'plan', 'state']
    """

    def __init__(
        self,
        env: Env,
        config: RunConfig | None = None,
        *,
        plan: bool = True,
        learn: bool = True,
    ) -> None:
        config = preset("semrl", "objects-map") if config is None else config
        slots = needed_slots(config, env, game_seed=config.seed, seed=config.seed)
        config = replace(config, perception=with_room(config.perception, slots))
        self._make(env, config, plan=plan, learn=learn)
        rng = np.random.default_rng(self.config.seed)
        game = Game(env, self.config.seed)
        self.pretraining_decisions = learn_to_see(game, self.encoder, self.config.stability, rng, self.planning)
        self._describe()

    def _make(self, env: Env, config: RunConfig, *, plan: bool, learn: bool) -> None:
        # Gymnasium makes a wrapped environment again from its recorded arguments.
        gym.utils.RecordConstructorArgs.__init__(self, config=config, plan=plan, learn=learn, _disable_deepcopy=True)
        gym.Wrapper.__init__(self, env)
        self.config, self.plan, self.learn = config, plan, learn
        self.encoder = ENCODERS.load(config.encoder_name)(config.perception, rom=rom_name(env), planning=True)
        n_actions = int(env.action_space.n)  # type: ignore[attr-defined]
        self.planning = make_planning(config, self.encoder.space, n_actions, seed=config.seed)
        self.action_names = tuple(action_meanings(env))
        self.pretraining_decisions = 0
        self.record: PlanRecord | None = None
        self._view: EpisodeView | None = None
        self._step: Step | None = None

    def _describe(self) -> None:
        """Say what is shown, now that it is known."""
        space, unbounded = self.encoder.space, (-np.inf, np.inf)
        shape = (*space.shape, 2) if len(space.shape) > 1 else (2 * space.shape[0],)
        spaces: dict[str, gym.Space[Any]] = {"state": gym.spaces.Box(*unbounded, shape, np.float32)}
        if self.plan:
            spaces["plan"] = gym.spaces.Box(*unbounded, (self.planning.plan_size,), np.float32)
            spaces["goal"] = gym.spaces.Box(*unbounded, (space.n_facts + 1,), np.float32)
        self.observation_space = gym.spaces.Dict(spaces)  # type: ignore[assignment]
        self.feature_names = space.names

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Shown, dict[str, Any]]:
        """Begin an episode; what an agent that broke the last one off has done is not learned from."""
        frame: Any
        frame, info = self.env.reset(seed=seed, options=options)
        self._view = EpisodeView(self.encoder, self.planning, learning=self.learn, plans=self.plan)
        return self._show(self._view.begin(observation_of(self.env, frame))), info

    def step(self, action: Any) -> tuple[Shown, float, bool, bool, dict[str, Any]]:
        """Take a decision, show what it led to, and learn from the episode when it is over.

        Raises
        ------
        UsageError
            Before `reset`, and when the environment gives a reward that is no finite number.
        """
        if self._view is None or self._step is None:
            raise UsageError("call reset before step")
        frame: Any
        frame, reward, terminated, truncated, info = self.env.step(action)
        brought = checked_reward(reward, f"decision {self._step.number}")
        outcome = Outcome(
            observation=observation_of(self.env, frame),
            reward=brought,
            training_reward=float(info.get(SIGNAL, brought)),
            terminated=terminated,
            truncated=truncated,
        )
        step = self._view.follow(self._step, int(action), outcome)
        shown = self._show(step)
        if step.done:
            self._finish(step)
        return shown, brought, terminated, truncated, info

    def rules(self, most: int = 8) -> list[Rule]:
        """Return what was learned in rules: about concepts where things are followed, else of the world model's trees.

        There are none before the first episode has ended, nor where the world model has no trees.
        """
        if found := self.planning.concept_rules.rules(self.action_names, most=most):
            return found
        world = self.planning.world_model
        if not (isinstance(world, RuleBased) and world.is_fitted):
            return []
        return world.rules(self.encoder.space.fact_names, self.action_names, most=most, unit=self.encoder.space.unit)

    def save(self, path: str | Path) -> None:
        """Write all that was learned, and the configuration, into one file, ``.npz``."""
        notes = {"config": to_dict(self.config), "pretraining_decisions": self.pretraining_decisions}
        parts = nest(encoder=self.encoder.to_arrays(), planning=self.planning.to_arrays())
        write_arrays(Path(path), {"notes": json_to_array(notes), **parts})

    @classmethod
    def load(cls, path: str | Path, env: Env, *, plan: bool = True, learn: bool = True) -> Self:
        """Make the wrapper again around an environment of the same kind; it goes on learning where it was saved.

        Raises
        ------
        SemrlError
            When the file is missing, damaged, or no such file.
        """
        arrays = read_arrays(Path(path))
        new = cls.__new__(cls)
        try:
            notes = array_to_json(arrays["notes"])
            new._make(env, from_dict(notes["config"], source=str(path)), plan=plan, learn=learn)
            new.encoder.from_arrays(unnest(arrays, "encoder"))
            new.planning.from_arrays(unnest(arrays, "planning"))
            new.pretraining_decisions = int(notes["pretraining_decisions"])
        except (KeyError, ValueError, TypeError) as error:
            raise SemrlError(f"{path} does not hold a semantic environment ({error})") from error
        new._describe()
        return new

    def _show(self, step: Step) -> Shown:
        assert step.shown is not None and step.state is not None
        self._step, self.record = step, step.record
        now, before = step.shown.vectors.astype(np.float32)
        if now.ndim > 1:
            now, before = now / 255, before / 255
            shown = {"state": np.stack([now, now - before], axis=-1)}
        else:
            shown = {"state": np.concatenate([now, now - before])}
        if step.record is not None:
            shown |= {"plan": step.record.features, "goal": self._goal(step.record)}
        return shown

    def _goal(self, record: PlanRecord) -> Floats:
        """Return the facts of the place on the map that is sought, behind a 1; zeros where there is none."""
        n_facts = self.encoder.space.n_facts
        goal = np.zeros(n_facts + 1, np.float32)
        if record.plan is not None and len(record.plan.path):
            goal[0] = 1
            goal[1:] = self.planning.state_map.graph_.node_means[record.plan.path[-1], :n_facts]
        return goal

    def _finish(self, step: Step) -> None:
        assert step.state is not None
        self._view = None
        if self.learn:
            self.planning.end_episode(step.state.facts, step.state.things)
        else:
            self.planning.begin_episode()
