"""Tests of a trained run, as data."""

import json
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from semrl.core.errors import SemrlError
from semrl.evaluation.player import Policy
from semrl.evaluation.scores import EVALUATION_SEED, evaluate, result_path
from semrl.training import RunFolder
from semrl.training.loop import Step
from semrl.training.progress_lines import ProgressLines, append_line, last_returns


@dataclass(frozen=True, kw_only=True)
class Trial:
    """Some games that a trained run plays without learning; see `semrl.evaluation.evaluate`."""

    policy: Policy = "agent"
    episodes: int = 30
    sticky_actions: float | None = None
    at: int | None = None

    @property
    def name(self) -> str:
        """What it is called, such as ``planner-sticky-0.25``."""
        stem = self.path(Path()).stem.removeprefix("evaluation").removeprefix("-")
        return stem if stem.startswith("planner") else "-".join(part for part in ("agent", stem) if part)

    def path(self, run: Path) -> Path:
        """Return where its result is, or would be."""
        return result_path(run, policy=self.policy, sticky_actions=self.sticky_actions, at=self.at)

    def was_held(self, run: Path) -> bool:
        """Tell whether its result is there; one of somebody's shorter games, or with another seed, is not."""
        config = RunFolder.open(run).config()
        decisions = config.decisions if self.at is None else self.at
        wanted = {"decisions": decisions, "seed": config.seed + EVALUATION_SEED, "episodes": self.episodes}
        try:
            conditions = json.loads(self.path(run).read_text(encoding="utf-8"))["conditions"]
            return bool(wanted.items() <= conditions.items())
        except FileNotFoundError:
            return False
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            raise damaged(self.path(run), error) from None

    def hold(self, run: Path) -> None:
        """Play; a line every half minute goes into the log of the run."""
        returns: list[float] = []
        finished = 0
        lines = ProgressLines(partial(append_line, RunFolder(run).log_path))

        def on_step(_episode: int, step: Step) -> None:
            decisions, note = finished + step.number, partial(last_returns, returns)
            lines.update(self.name, len(returns), self.episodes, unit="episodes", decisions=decisions, note=note)

        def on_episode(total: float, decisions: int) -> None:
            nonlocal finished
            returns.append(total)
            finished += decisions

        evaluate(run, **asdict(self), on_episode=on_episode, on_step=on_step)
        lines.close()


def damaged(path: Path, error: Exception) -> SemrlError:
    """Say that the result of a trial cannot be read."""
    return SemrlError(f"{path} is damaged: {error!r}; delete it to play again")
