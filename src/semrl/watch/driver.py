"""The thread in which a watched run plays: it keeps time, obeys, and hands out what is to be shown."""

import contextlib
import json
import queue
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from functools import partial
from typing import Any

from semrl.core import Frame
from semrl.core.errors import SemrlError, UsageError
from semrl.training.session import limited_threads
from semrl.watch.session import WatchSession
from semrl.watch.snapshot import about, objects_between, of_moment, picture
from semrl.watch.teaching import edit_of

SLOWEST, FASTEST = 0.1, 20.0
"""Speeds, as multiples of the game's own."""
PICTURES_PER_SECOND = 40
"""Most moments that are shown in a second; at higher speeds some are played and not shown."""
FRAMES_PER_SECOND = 60
"""Of a game that does not say."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Shown:
    """A moment as it goes to the page."""

    text: str
    """A JSON object."""
    picture: bytes
    """The frame, as PNG or JPEG."""


class Driver:
    """Plays a session in a thread of its own.

    Parameters
    ----------
    session
        Is touched by that thread alone, once it has begun.
    on_shown
        Is called from that thread with every moment that is to be shown.

    Attributes
    ----------
    about
        What the page is sent first.
    """

    def __init__(self, session: WatchSession, on_shown: Callable[[Shown], None] = lambda _: None) -> None:
        self.session = session
        self.on_shown = on_shown
        self.about = json.dumps(about(session), allow_nan=False)
        self.playing = False
        self.speed = 1.0
        self.trouble: str | None = None
        self.per_second = _decisions_per_second(session)
        self._orders: queue.SimpleQueue[tuple[Callable[[], Any], Future[Any]] | None] = queue.SimpleQueue()
        self._film: deque[tuple[float, Callable[[], Shown]]] = deque()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="watch", daemon=True)
        self.commands: dict[str, Callable[[Any], object]] = {
            "play": lambda _: self._play(True),
            "pause": lambda _: self._play(False),
            "step": lambda _: self._stand(self.session.step),
            "back": lambda _: self._stand(self.session.back),
            "show": lambda value: self._stand(lambda: self.session.show(_number(value))),
            "newest": lambda _: self.session.show(self.session.kept[1]),
            "episode": lambda _: self.session.new_episode(),
            "speed": self._set_speed,
            "policy": self.session.decide_by,
            "person": self._set_person,
            "hold": self._hold,
            "goal": self._seek,
            "edit": lambda value: self.session.edit(edit_of(value)),
        }

    def start(self) -> None:
        """Begin to play."""
        self._thread.start()

    def stop(self) -> None:
        """End the thread."""
        self._orders.put(None)
        self._thread.join()

    def do(self, work: Callable[[], Any]) -> "Future[Any]":
        """Have something done in the thread, between two decisions."""
        done: Future[Any] = Future()
        self._orders.put((work, done))
        if self._ended.is_set():
            self._refuse()
        return done

    def obey(self, name: object, value: object = None) -> "Future[Any]":
        """Have a command carried out.

        Raises
        ------
        UsageError
            When there is no such command; what else is wrong with it, the future raises.
        """
        command = self.commands.get(name) if isinstance(name, str) else None
        if command is None:
            raise UsageError(f"unknown command {name!r}; there are {', '.join(self.commands)}")
        return self.do(lambda: command(value))

    def shown(self) -> Shown:
        """Return what is to be shown now; call it in the thread, by `do`."""
        controls = {"playing": self.playing, "speed": self.speed, "trouble": self.trouble}
        message = of_moment(self.session) | controls
        return Shown(
            text=json.dumps(message, allow_nan=False), picture=picture(self.session.moment.step.observation.frame)
        )

    def _run(self) -> None:
        try:
            with limited_threads(self.session.player.config.threads):
                self._go_on()
        finally:
            self._ended.set()
            self._refuse()

    def _go_on(self) -> None:
        due, last_shown = time.monotonic(), 0.0
        self.on_shown(self.shown())
        while self._serve(self._next(due) - time.monotonic() if self.playing else None):
            now = time.monotonic()
            if self._film and self.playing and now >= self._film[0][0]:
                self.on_shown(self._film.popleft()[1]())
                last_shown = now
            if self.playing and now >= due:
                if self._film:  # late: what is left of it would be over before its end is shown
                    self.on_shown(self.shown())
                self._step()
                seconds = 1 / (self.per_second * self.speed)
                due = max(due + seconds, now - 0.1)  # what was missed is not made up for
                self._film = self._filmed(now, seconds)
            if not self.playing:
                self._film.clear()
            if not self._film and (not self.playing or now - last_shown >= 1 / PICTURES_PER_SECOND):
                self.on_shown(self.shown())
                last_shown = now

    def _next(self, due: float) -> float:
        """Return when there is something to do: a decision that is due, or a picture before it."""
        return min(due, self._film[0][0]) if self._film else due

    def _filmed(self, began: float, seconds: float) -> deque[tuple[float, Callable[[], Shown]]]:
        """Spread what was shown during a decision over the time until the next one, its own moment the last.

        There is nothing to spread where decisions come as fast as pictures can be shown.
        """
        frames = self.session.frames_between
        count = min(len(frames) + 1, int(PICTURES_PER_SECOND * seconds))
        if count < 2 or time.monotonic() - began > seconds:
            return deque()
        film: deque[tuple[float, Callable[[], Shown]]] = deque()
        for i in range(1, count):
            place = i * (len(frames) + 1) // count
            film.append((began + (i - 1) * seconds / count, partial(self._between, frames[place - 1], i / count)))
        film.append((began + (count - 1) * seconds / count, self.shown))
        return film

    def _between(self, frame: Frame, share: float) -> Shown:
        """Return a picture between two moments, with the boxes so far on their way."""
        message = {"type": "between", "objects": objects_between(self.session, share)}
        return Shown(text=json.dumps(message, allow_nan=False), picture=picture(frame))

    def _step(self) -> None:
        """Play on, or stand still and say why that cannot be."""
        try:
            self.session.step()
        except SemrlError as error:
            self.playing, self.trouble = False, str(error)

    def _refuse(self) -> None:
        """Tell whoever waits that nothing will be done any more."""
        with contextlib.suppress(queue.Empty):
            while True:
                order = self._orders.get_nowait()
                if order is not None and not order[1].done():
                    order[1].set_exception(SemrlError("the run is no longer being watched"))

    def _serve(self, seconds: float | None) -> bool:
        """Carry out the next order, waiting for it so long at most; return whether to go on."""
        try:
            order = self._orders.get(timeout=seconds) if seconds is None or seconds > 0 else self._orders.get_nowait()
        except queue.Empty:
            return True
        if order is None:
            return False
        work, done = order
        self.trouble = None
        if done.set_running_or_notify_cancel():
            try:
                done.set_result(work())
            except Exception as error:
                done.set_exception(error)
        return True

    def _play(self, on: bool) -> None:
        self.playing = on

    def _stand(self, move: Callable[[], Any]) -> None:
        self.playing = False
        move()

    def _set_speed(self, value: object) -> None:
        if isinstance(value, bool) or not isinstance(value, int | float) or not SLOWEST <= value <= FASTEST:
            raise UsageError(f"speed must be a number from {SLOWEST:g} to {FASTEST:g}")
        self.speed = float(value)

    def _set_person(self, value: object) -> None:
        self.session.person = value is True
        self.session.held = frozenset()
        self.session.show(self.session.kept[1])  # what was cannot be played again

    def _seek(self, value: object) -> None:
        if value is not None and not isinstance(value, str):
            raise UsageError("a goal is a text, or null for none")
        self.session.seek(value)

    def _hold(self, value: object) -> None:
        if not isinstance(value, list) or not all(isinstance(key, str) for key in value):
            raise UsageError("keys must be a list of their names")
        self.session.held = frozenset(value)


def _number(value: object) -> int:
    if isinstance(value, bool) or not isinstance(value, int):
        raise UsageError("a moment is named by its number")
    return value


def _decisions_per_second(session: WatchSession) -> float:
    """Return how many decisions a second a person would see who played the game itself."""
    return FRAMES_PER_SECOND / session.player.world.frame_skip
