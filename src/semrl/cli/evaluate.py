"""``semrl eval``: play with a trained run."""

import contextlib
import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import PlayProgress, show_summary
from semrl.core.beside import processors
from semrl.core.strict_json import dumps
from semrl.evaluation import evaluate
from semrl.evaluation.player import Policy
from semrl.evaluation.video import recorder
from semrl.training import RunFolder
from semrl.training.config import ClassesMode
from semrl.training.loop import Step
from semrl.training.progress_lines import last_returns

REWARDS_SHOWN = 6
"""Of each sign."""


@dataclass(frozen=True, kw_only=True)
class EvalArguments:
    """Play with the agent of a run, greedily and from random starts, and write evaluation.json beside it."""

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    episodes: int | None = None
    """Episodes to play [default: what the run is configured for, 30]."""
    seed: int | None = None
    """Of the episodes [default: one that training did not use]."""
    policy: Policy = "agent"
    """Who decides: the agent, or the planner's best scenario alone (models with a map)."""
    exploration: float | None = None
    """Probability of a random action [default: what the run is configured for, 0]."""
    sticky_actions: float | None = None
    """Probability that a frame repeats the previous action [default: as in training]."""
    env_variant: str | None = None
    """How the game is altered, such as recoloured, mirrored or lazy_enemy+recoloured; "": as it is [default: as in
    training]."""
    classes: ClassesMode | None = None
    """Whether plans count classes of scenes that play taught, Danger and Chance; shuffled: their rules dealt out by
    chance, to compare [default: off]."""
    max_decisions: int | None = None
    """Decisions after which an episode is cut [default: what the run is configured for, 27000]."""
    at: int | None = None
    """Play as the agent was after so many decisions: one of the run's milestones [default: as it is now]."""
    video: Path | None = None
    """Write the first episode, with its objects marked, as an .mp4 or .gif file: 30 decisions a second, 5
    minutes at most."""
    workers: int | None = None
    """Processes that play [default: as many as there are processors]; what comes out is the same."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, play, print."""
    arguments = parse(EvalArguments, argv, command="eval")
    config = RunFolder.open(arguments.run).config()
    episodes = config.evaluation.episodes if arguments.episodes is None else arguments.episodes
    returns: list[float] = []
    finished = 0
    with contextlib.ExitStack() as stack:
        record = stack.enter_context(recorder(arguments.run, arguments.video))
        progress = stack.enter_context(PlayProgress("evaluate", episodes, "episodes"))

        def on_step(episode: int, step: Step) -> None:
            record(episode, step)
            note = partial(_now, returns, step.total)
            progress.update(len(returns), finished + step.number, note)

        def on_episode(total: float, decisions: int) -> None:
            nonlocal finished
            returns.append(total)
            finished += decisions
            progress.update(len(returns), finished, lambda: f"{_mean(returns)}{last_returns(returns)}")

        result = evaluate(
            arguments.run,
            episodes=episodes,
            seed=arguments.seed,
            policy=arguments.policy,
            exploration=arguments.exploration,
            sticky_actions=arguments.sticky_actions,
            variant=arguments.env_variant,
            max_decisions=arguments.max_decisions,
            classes=arguments.classes,
            at=arguments.at,
            workers=processors() if arguments.workers is None else arguments.workers,
            on_episode=on_episode,
            on_step=on_step,
        )
    if arguments.json:
        print(dumps(dataclasses.asdict(result)))
        return
    show_summary({
        "mean return": f"{result.mean:.2f} ± {result.std:.2f}",
        "episodes": result.episodes,
        "from … to": f"{result.min:.0f} … {result.max:.0f}",
        "decisions each": f"{min(result.lengths):,} … {max(result.lengths):,}",
        **({"changed by classes": f"{result.conditions['changed']:.1%}"} if "changed" in result.conditions else {}),
        **_rewards(result.rewards[0]),
        **({"video": arguments.video} if arguments.video else {}),
    })  # fmt: skip


def _now(returns: list[float], total: float) -> str:
    return f"{last_returns(returns)}, this one {total:g}"


def _mean(returns: Sequence[float]) -> str:
    return f"mean return {sum(returns) / len(returns):.1f}, "


def _rewards(first: Sequence[tuple[int, float]]) -> dict[str, object]:
    """Say which decisions of the first episode brought rewards: what one may want to have explained."""
    rows: dict[str, object] = {}
    for name, sign in (("losses", -1), ("gains", 1)):
        places = [str(decision) for decision, reward in first if sign * reward > 0]
        if places:
            more = f" and {len(places) - REWARDS_SHOWN} more" if len(places) > REWARDS_SHOWN else ""
            rows[f"{name} of episode 0"] = (
                f"decision{'s' * (len(places) > 1)} {', '.join(places[:REWARDS_SHOWN])}{more}"
            )
    return rows
