"""``semrl watch``: a live page of a run that plays, in the browser of this machine."""

import contextlib
import os
import secrets
import socket
import sys
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from semrl.cli.arguments import parse
from semrl.cli.progress import error_console
from semrl.core.errors import MissingExtraError, UsageError
from semrl.evaluation.player import Policy, load_player
from semrl.watch.driver import Driver
from semrl.watch.session import WatchSession

HOST = "127.0.0.1"


@dataclass(frozen=True, kw_only=True)
class WatchArguments:
    """Watch a run play, live in the browser: the game with what is seen in it, what the planner imagines and what came,
    what each action is worth, where on the map that is. It can be paused, stepped, played back; speed, who decides and
    the joystick are yours; the moment can be saved as a page or a video.

    The first line that is printed is the address. It opens on this machine only, and only whole: the word in it is made
    anew every time. Ctrl-C ends it. Episodes are those of semrl eval with the same seed.

    Example:  semrl watch runs/first
    """

    run: tyro.conf.Positional[Path]
    """Folder of the run."""
    port: int = 0
    """Port of the page; 0: one that is free."""
    browser: bool = True
    """Open the page in the browser."""
    policy: Policy = "agent"
    """Who decides: the agent, or the planner's best scenario alone."""
    seed: int | None = None
    """Of the episodes [default: that of semrl eval]."""
    episode: int = 0
    """The first episode, from 0."""
    at: int | None = None
    """Play as the run was after so many decisions: one of its milestones [default: as it is now]."""


def main(argv: Sequence[str]) -> None:
    """Parse, load, serve until Ctrl-C."""
    arguments = parse(WatchArguments, argv, command="watch")
    try:
        import uvicorn
        import websockets  # noqa: F401 - without it uvicorn answers no web socket

        from semrl.watch.app import make_app
    except ImportError:
        raise MissingExtraError("watch", "semrl watch") from None
    with contextlib.closing(_listen(arguments.port)) as listening:
        with error_console.status(f"loading {arguments.run}"):
            session = WatchSession(
                load_player(arguments.run, arguments.at, memory=True),  # from which classes are learned
                str(arguments.run),
                seed=arguments.seed,
                policy=arguments.policy,
                episode=arguments.episode,
                folder=arguments.run,
            )
        token, port = secrets.token_urlsafe(24), listening.getsockname()[1]
        with contextlib.closing(session):
            app = make_app(Driver(session), token=token, port=port)
            config = uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=2)
            address = f"http://{HOST}:{port}/{token}/"
            print(address, flush=True)
            if arguments.browser and _has_browser():
                webbrowser.open(address)
            with contextlib.suppress(KeyboardInterrupt):
                uvicorn.Server(config).run(sockets=[listening])


def _listen(port: int) -> socket.socket:
    """Take a port of this machine that nobody else can reach.

    Raises
    ------
    UsageError
        When there is no such port, or it is taken.
    """
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    try:
        if os.name != "nt":  # where it would let two programs have the same port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind((HOST, port))
        listening.listen()  # who comes before the server does waits
    except (OSError, OverflowError) as error:
        listening.close()
        reason = getattr(error, "strerror", None) or "ports go from 0 to 65535"
        raise UsageError(f"cannot use port {port}: {reason}") from None
    return listening


def _has_browser() -> bool:
    """Tell whether a browser has a screen here; one that has none would take the terminal."""
    return sys.platform in ("darwin", "win32") or any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
