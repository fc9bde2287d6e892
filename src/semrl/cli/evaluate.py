"""``semrl eval``: play with a trained run."""

import contextlib
import dataclasses
import json as json_format
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import console, progress_bars, summary
from semrl.evaluation import evaluate
from semrl.evaluation.player import Policy
from semrl.evaluation.video import recorder
from semrl.training import RunFolder
from semrl.training.loop import Step

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
    at: int | None = None
    """Play as the agent was after so many decisions: one of the run's milestones [default: as it is now]."""
    video: Path | None = None
    """Write the first episode, with its objects marked, as an .mp4 file: 30 decisions a second, 5 minutes at most."""
    json: bool = False
    """Print one JSON object as the only line of standard output."""


def main(argv: Sequence[str]) -> None:
    """Parse, play, tell."""
    arguments = parse(EvalArguments, argv, command="eval")
    config = RunFolder.open(arguments.run).config()
    episodes = config.evaluation.episodes if arguments.episodes is None else arguments.episodes
    returns: list[float] = []
    shown = [0.0]
    bars = progress_bars()
    with contextlib.ExitStack() as stack:
        record = stack.enter_context(recorder(arguments.run, arguments.video))

        def on_step(episode: int, step: Step) -> None:
            if not bars.tasks:  # nothing is shown before: a call that cannot work costs one line, the error's
                stack.enter_context(bars)
                bars.add_task("evaluate", total=episodes, note="")
            record(episode, step)
            if step.action is not None and time.monotonic() - shown[0] > 0.5:
                shown[0] = time.monotonic()
                mean = f"mean return {sum(returns) / len(returns):.1f}, " if returns else ""
                bars.update(bars.task_ids[0], note=f"{mean}this one {step.total:.0f}")

        def on_episode(total: float) -> None:
            returns.append(total)
            note = f"mean return {sum(returns) / len(returns):.1f}"
            bars.update(bars.task_ids[0], advance=1, note=note)

        result = evaluate(
            arguments.run,
            episodes=episodes,
            seed=arguments.seed,
            policy=arguments.policy,
            exploration=arguments.exploration,
            sticky_actions=arguments.sticky_actions,
            at=arguments.at,
            on_episode=on_episode,
            on_step=on_step,
        )
    if arguments.json:
        print(json_format.dumps(dataclasses.asdict(result)))
        return
    console.print(summary({
        "mean return": f"{result.mean:.2f} ± {result.std:.2f}",
        "episodes": result.episodes,
        "from … to": f"{result.min:.0f} … {result.max:.0f}",
        "decisions each": f"{min(result.lengths):,} … {max(result.lengths):,}",
        **_rewards(result.rewards[0]),
        **({"video": arguments.video} if arguments.video else {}),
    }))  # fmt: skip


def _rewards(first: Sequence[tuple[int, float]]) -> dict[str, object]:
    """Say which decisions of the first episode brought rewards: what one may want to have explained."""
    told: dict[str, object] = {}
    for name, sign in (("losses", -1), ("gains", 1)):
        places = [str(decision) for decision, reward in first if sign * reward > 0]
        if places:
            more = f" and {len(places) - REWARDS_SHOWN} more" if len(places) > REWARDS_SHOWN else ""
            told[f"{name} of episode 0"] = (
                f"decision{'s' * (len(places) > 1)} {', '.join(places[:REWARDS_SHOWN])}{more}"
            )
    return told
