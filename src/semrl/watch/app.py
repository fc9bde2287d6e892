"""The page's server, an ASGI application: for this machine alone, and for who knows its address."""

import asyncio
import contextlib
import json
import secrets
import struct
import tempfile
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from semrl.core.errors import SemrlError
from semrl.core.strict_json import dumps
from semrl.report.explanation import render_explanation
from semrl.watch.driver import Driver, Shown

STATIC = Path(__file__).parent / "static"

VIDEO_MOMENTS = {"gif": 180, "mp4": 600}
"""Moments before the one that is shown that a video of it has at most, by kind of file."""

HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
"""Of every answer: nothing is fetched from elsewhere, nothing is sent to others, nothing is kept."""

EXPLANATION_POLICY = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; sandbox"
"""Of a page that has its style and pictures within it."""

LONGEST_MESSAGE = 4096
ANSWERED = ("goal", "edit")
"""Commands that are confirmed to the page: something was typed for them."""
REFUSED = 4403
"""What a web socket without the token is closed with."""


def make_app(driver: Driver, *, token: str, port: int) -> ASGIApp:
    """Make the application; it starts and ends the driver's thread.

    Parameters
    ----------
    driver
        Plays.
    token
        The first part of every address; whatever has it not is refused with 403.
    port
        At which it is served; requests that name another host are refused, since a name may be made to lead here.
    """
    hub = _Hub()

    @contextlib.asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        hub.loop = asyncio.get_running_loop()
        driver.on_shown = hub.publish
        driver.start()
        yield
        await asyncio.to_thread(driver.stop)

    page = _Page(driver, hub)
    within = [
        Route("/", page.index),
        Route("/explanation.html", page.explanation),
        Route("/moment.{kind:str}", page.video),
        WebSocketRoute("/live", page.live),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    return Guard(Starlette(routes=[Mount(f"/{token}", routes=within)], lifespan=lifespan), token=token, port=port)


class Guard:
    """Lets through what has the token, comes from this machine and names it, and puts the headers on every answer."""

    def __init__(self, app: ASGIApp, *, token: str, port: int) -> None:
        self.app = app
        self.token = token.encode()
        self.hosts = {f"{name}:{port}" for name in ("127.0.0.1", "localhost")}

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request; see the ASGI specification."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return

        async def with_headers(message: Any) -> None:
            if message["type"] == "http.response.start":
                given = [(name, value) for name, value in message.get("headers", ())]
                known = {name.lower() for name, _ in given}
                own = [(name.encode(), value.encode()) for name, value in HEADERS.items()]
                message = {**message, "headers": [*given, *(pair for pair in own if pair[0] not in known)]}
            await send(message)

        if self._is_let_in(scope):
            await self.app(scope, receive, with_headers)
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": REFUSED})  # before it was accepted: 403
        else:
            refusal = "403: the address that semrl watch printed is needed, whole\n"
            await PlainTextResponse(refusal, status_code=403)(scope, receive, with_headers)

    def _is_let_in(self, scope: Scope) -> bool:
        headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in scope["headers"]}
        origin = headers.get("origin")
        known = headers.get("host") in self.hosts
        ours = origin is None or origin.removeprefix("http://") in self.hosts
        first = scope["path"].split("/")[1] if "/" in scope["path"] else ""
        return known and ours and secrets.compare_digest(first.encode(), self.token)


class _Hub:
    """Hands the newest moment to every page that is open; who is slow misses some."""

    def __init__(self) -> None:
        self.loop: asyncio.AbstractEventLoop | None = None
        self.newest: Shown | None = None
        self._waiting: set[asyncio.Event] = set()

    @property
    def pages(self) -> int:
        """How many pages are open."""
        return len(self._waiting)

    def publish(self, shown: Shown) -> None:
        """Take a moment from the thread that plays."""
        assert self.loop is not None
        with contextlib.suppress(RuntimeError):  # the server has ended
            self.loop.call_soon_threadsafe(self._take, shown)

    def _take(self, shown: Shown) -> None:
        self.newest = shown
        for event in self._waiting:
            event.set()

    async def moments(self) -> AsyncIterator[Shown]:
        """Yield what is shown now, and each moment that comes as soon as the one before was dealt with."""
        event = asyncio.Event()
        event.set()
        self._waiting.add(event)
        try:
            while True:
                await event.wait()
                event.clear()
                if self.newest is not None:
                    yield self.newest
        finally:
            self._waiting.discard(event)


class _Page:
    """What is answered to requests."""

    def __init__(self, driver: Driver, hub: _Hub) -> None:
        self.driver = driver
        self.hub = hub

    async def index(self, _: Request) -> Response:
        return FileResponse(STATIC / "index.html")

    async def explanation(self, _: Request) -> Response:
        """Send the page about the decision that is shown."""
        made, problem = await self._made(lambda: render_explanation(self.driver.session.explain()))
        if problem is not None:
            return problem
        headers = _named(f"why-{self.driver.session.moment.step.number}.html")
        headers["content-security-policy"] = EXPLANATION_POLICY
        return Response(made, media_type="text/html", headers=headers)

    async def video(self, request: Request) -> Response:
        """Send a film of the moments up to the one that is shown."""
        kind = request.path_params["kind"]
        if kind not in VIDEO_MOMENTS:
            return PlainTextResponse(f"there is no {kind}, but {' and '.join(VIDEO_MOMENTS)}\n", status_code=404)
        made, problem = await self._made(lambda: self._film(kind))
        return problem or Response(
            made, media_type="video/mp4" if kind == "mp4" else "image/gif", headers=_named(f"moment.{kind}")
        )

    def _film(self, kind: str) -> bytes:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"moment.{kind}"
            self.driver.session.write_video(path, VIDEO_MOMENTS[kind])
            return path.read_bytes()

    async def _made(self, make: Callable[[], Any]) -> tuple[Any, Response | None]:
        """Have something made by the thread that plays; return it, or what is to be answered."""
        try:
            return await asyncio.wrap_future(self.driver.do(make)), None
        except SemrlError as error:
            return None, PlainTextResponse(f"{error}\n", status_code=409)

    async def live(self, socket: WebSocket) -> None:
        """Send moments and obey, until the page is closed."""
        await socket.accept()
        await socket.send_text(self.driver.about)
        sending = asyncio.create_task(self._send(socket))
        try:
            while True:
                await self._obey(socket, await socket.receive_text())
        except (WebSocketDisconnect, KeyError):  # KeyError: bytes in place of text
            pass
        finally:
            sending.cancel()
            if self.hub.pages == 1:  # nobody else looks
                self.driver.obey("pause")
                self.driver.obey("hold", [])
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError):
                await sending

    async def _send(self, socket: WebSocket) -> None:
        async for shown in self.hub.moments():
            text = shown.text.encode()
            await socket.send_bytes(struct.pack(">I", len(text)) + text + shown.picture)

    async def _obey(self, socket: WebSocket, message: str) -> None:
        """Carry out a command, such as ``{"do": "speed", "value": 2}``; say in one line what is wrong with it."""
        about = None
        try:
            command = json.loads(message) if len(message) <= LONGEST_MESSAGE else None
            if not isinstance(command, dict):
                raise SemrlError('a command is a JSON object, such as {"do": "pause"}')
            about = command.get("do")
            await asyncio.wrap_future(self.driver.obey(about, command.get("value")))
            if about in ANSWERED:
                await socket.send_text(dumps({"type": "done", "about": about}))
        except json.JSONDecodeError:
            await self._complain(socket, 'a command is a JSON object, such as {"do": "pause"}')
        except SemrlError as error:
            await self._complain(socket, str(error), about)

    async def _complain(self, socket: WebSocket, problem: str, about: object = None) -> None:
        command = about if isinstance(about, str) else None
        await socket.send_text(dumps({"type": "problem", "text": problem, "about": command}))


def _named(name: str) -> dict[str, str]:
    """Have a file saved in place of being shown: it would have the rights of our page."""
    return {"content-disposition": f'attachment; filename="{name}"'}
