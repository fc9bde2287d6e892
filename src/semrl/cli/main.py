"""Choosing a command, and turning every foreseen failure into one line and an exit status."""

import difflib
import os
import sys
from collections.abc import Callable, Sequence

from semrl.errors import SemrlError, UsageError

Command = Callable[[Sequence[str]], None]


def _train(argv: Sequence[str]) -> None:
    from semrl.cli.train import main

    main(argv)


def _eval(argv: Sequence[str]) -> None:
    from semrl.cli.evaluate import main

    main(argv)


def _report(argv: Sequence[str]) -> None:
    from semrl.cli.report import main

    main(argv)


def _doctor(argv: Sequence[str]) -> None:
    from semrl.cli.doctor import main

    main(argv)


COMMANDS: dict[str, tuple[Command, str]] = {
    "train": (_train, "learn to see, then to play; resumable"),
    "eval": (_eval, "play with a trained run, with a video on request"),
    "report": (_report, "one self-contained HTML page about one or more runs"),
    "doctor": (_doctor, "versions, threads, what is missing and how to get it"),
}


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status: 0 did it, 1 failed, 2 the call was wrong."""
    argv = list(sys.argv[1:] if argv is None else argv)
    if not argv or argv[0] in ("-h", "--help"):
        print(_help())
        return 0
    if argv[0] == "--version":
        from semrl import __version__

        print(f"semrl {__version__}")
        return 0
    try:
        _command(argv[0])(argv[1:])
    except UsageError as error:
        return _complain(error, 2)
    except SemrlError as error:
        return _complain(error, 1)
    except KeyboardInterrupt:
        return _complain("stopped", 1)
    except BrokenPipeError:  # whoever read our output has gone
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    return 0


def _command(name: str) -> Command:
    if name not in COMMANDS:
        close = difflib.get_close_matches(name, COMMANDS, n=1)
        hint = f"; did you mean '{close[0]}'?" if close else f"; there are {', '.join(COMMANDS)}"
        raise UsageError(f"unknown command '{name}'{hint}")
    return COMMANDS[name][0]


def _complain(problem: object, status: int) -> int:
    print(f"semrl: {' '.join(str(problem).split())}", file=sys.stderr)
    return status


def _help() -> str:
    width = max(map(len, COMMANDS))
    lines = [f"  semrl {name:<{width}}  {text}" for name, (_, text) in COMMANDS.items()]
    return "\n".join([
        "Neuro-symbolic reinforcement learning: from raw frames to an agent that can explain itself.",
        "",
        *lines,
        "",
        "  semrl COMMAND --help     all about one command",
        "",
        "To begin:  semrl train --run runs/first && semrl eval runs/first --video first.mp4",
    ])  # fmt: skip
