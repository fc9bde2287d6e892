"""Choosing a command, and turning every expected failure into one line and an exit status."""

import ast
import difflib
import importlib
import importlib.util
import signal
import sys
from collections.abc import Callable, Sequence
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import FrameType, ModuleType

from semrl import __version__
from semrl.cli.output import complain, printing
from semrl.core.errors import SemrlError, UsageError
from semrl.core.signals import handling

COMMANDS = {
    "train": ("train", "learn to see, then to play; resumable"),
    "eval": ("evaluate", "play with a trained run, with a video on request"),
    "play": ("play", "play for a goal that is given, without training for it"),
    "plan": ("plan", "symbolic plans in discrete worlds, carried out and as PDDL"),
    "knowledge": ("knowledge", "what a run knows: concepts, roles, classes; edit and export it"),
    "report": ("report", "one self-contained HTML page about one or more runs"),
    "map": ("map", "what the map of a run looks like, and the map as a file"),
    "query": ("query", "ask the map of a run in SPARQL"),
    "rules": ("rules", "what a run has learned of its world, as rules to be checked"),
    "events": ("events", "what happens in an episode: contacts, bounces, rewards, lost lives"),
    "predict": ("predict", "how far a run's model of the world sees ahead, on new episodes"),
    "changes": ("changes", "what no longer holds in an altered world, and learning just that anew"),
    "explain": ("explain", "why a run took one decision, as text or as a page"),
    "compare": ("compare", "what two runs know and do differently"),
    "publish": ("publish", "a trained run as a folder to be shared, with a model card"),
    "export": ("export", "play as a data set to learn from offline, in Minari's format"),
    "sweep": ("sweep", "many runs side by side, on this machine or on many, and their scores"),
    "watch": ("watch", "a live page: what it sees, thinks and does, and you may take part"),
    "doctor": ("doctor", "versions, threads, what is missing and how to get it"),
    "completion": ("completion", "what bash or zsh needs to complete commands and options"),
}
"""Command → module of this package and what it does. Modules are imported when called: torch is slow to load."""

COMMAND_GROUP = "semrl.commands"
"""Entry points by which other packages add commands: name → module with a function ``main(argv)``."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status: 0 did it, 1 failed, 2 the call was wrong.

    Where nobody reads on (``semrl map RUN | head``), it ends quietly with 141, as programs that a shell ends do.
    """
    argv = list(sys.argv[1:] if argv is None else argv)
    with printing() as ended:
        ended.status = _run(argv)
    return ended.status


def _run(argv: Sequence[str]) -> int:
    if not argv or argv[0] in ("-h", "--help"):
        print(_help())
        return 0
    if argv[0] == "--version":
        print(f"semrl {__version__}")
        return 0
    try:
        return _call(argv[0], argv[1:])
    except SystemExit as leave:  # the help of a command was shown
        return int(leave.code or 0)


def _call(command: str, argv: Sequence[str]) -> int:
    try:
        with handling(_interrupt, signal.SIGTERM):
            load_command(command)(argv)
    except UsageError as error:
        return complain(error, 2)
    except SemrlError as error:
        return complain(error, 1)
    except ImportError as error:
        if (error.name or "semrl").partition(".")[0] == "semrl":
            raise
        return complain(_lacking(error), 1)
    except MemoryError as error:
        return complain(f"not enough memory: {error or 'try a smaller --dqn.replay-capacity'}", 1)
    except (KeyboardInterrupt, SystemError) as error:  # compiled code that is interrupted says so in its own way
        if isinstance(error, SystemError) and not isinstance(error.__cause__ or error.__context__, KeyboardInterrupt):
            raise
        return complain("stopped", 1)
    return 0


def _lacking(error: ImportError) -> str:
    """Say which package is missing, or is there and cannot be used."""
    package = str(error.name).partition(".")[0]
    problem = "is missing" if isinstance(error, ModuleNotFoundError) else f"cannot be used ({error})"
    return f"the package {package} {problem}; 'semrl doctor' says how to get what is needed"


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """Let SIGTERM end a command as Ctrl-C does: files half-written are removed, and one line says so."""
    raise KeyboardInterrupt


def _module(command: str) -> ModuleType:
    if command in COMMANDS:
        return importlib.import_module(f"semrl.cli.{COMMANDS[command][0]}")
    if command in _added():
        return importlib.import_module(_added()[command])
    known = [*COMMANDS, *_added()]
    close = difflib.get_close_matches(command, known, n=1)
    hint = f"; did you mean '{close[0]}'?" if close else f"; there are {', '.join(known)}"
    raise UsageError(f"unknown command '{command}'{hint}")


@cache
def _added() -> dict[str, str]:
    """Return the commands of other packages: name → module."""
    return {point.name: point.value for point in entry_points(group=COMMAND_GROUP)}


def _summary(module: str) -> str:
    """Return what the first line of a module says after its colon, without importing it."""
    spec = importlib.util.find_spec(module)
    if spec is None or spec.origin is None:
        return f"(the module {module} is missing)"
    first = (ast.get_docstring(ast.parse(Path(spec.origin).read_text(encoding="utf-8"))) or "").partition("\n")[0]
    return first.partition(": ")[2].rstrip(".") or first


def summaries() -> dict[str, str]:
    """Return what each command does, also those of other packages."""
    texts = {name: text for name, (_, text) in COMMANDS.items()}
    return texts | {name: _summary(module) for name, module in _added().items()}


def load_command(command: str) -> Callable[[Sequence[str]], None]:
    """Return the function of a command, which takes the words after it."""
    run: Callable[[Sequence[str]], None] = _module(command).main
    return run


def _help() -> str:
    texts = summaries()
    width = max(map(len, texts))
    lines = [f"  semrl {name:<{width}}  {text}" for name, text in texts.items()]
    return "\n".join([
        "Neuro-symbolic reinforcement learning: from raw frames to an agent that can explain itself.",
        "",
        *lines,
        "",
        "  semrl COMMAND --help     all about one command",
        "",
        "To begin:  semrl train --run runs/first && semrl eval runs/first --video first.mp4",
    ])  # fmt: skip
