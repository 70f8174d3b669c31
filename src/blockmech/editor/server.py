"""The server of the studio: sheets, jobs and the page over HTTP, all answers in JSON."""

from __future__ import annotations

import asyncio
import base64
import gc
import json
import secrets
import socket
import traceback
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from functools import cache, partial
from pathlib import Path
from queue import Empty
from string import Template
from threading import Thread
from typing import Any

from anyio import to_thread
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.staticfiles import StaticFiles

from blockmech.builders import Linkage, Opened, opened
from blockmech.editor.acts import acted
from blockmech.editor.analyses import ANALYSES
from blockmech.editor.curves import curves_or_reason, vectors, wire_text
from blockmech.editor.diagram import diagram_of
from blockmech.editor.drawing import names_of, picture_of, state_of
from blockmech.editor.exports import formats
from blockmech.editor.fields import CHOICES, Units
from blockmech.editor.forms import form_of
from blockmech.editor.guard import HOST, Guard
from blockmech.editor.jobs import Jobs
from blockmech.editor.live import live, module, remember
from blockmech.editor.revision import Question
from blockmech.editor.sheets import Desk, Sheet, files_of, link_of, packed, title_of
from blockmech.editor.sketching import posed
from blockmech.editor.turn import fault_of, poses_of
from blockmech.exchange.page.files import bundle, embeddable
from blockmech.ground.errors import BlockmechError, Problem, refused
from blockmech.ground.progress import PATIENCE
from blockmech.model.diagram import Wire
from blockmech.testing.graph_files import gallery
from blockmech.typing import Data, Record

WEB = Path(__file__).with_name("web")
FOREVER = {"Cache-Control": "private, max-age=31536000, immutable"}
FRESH = {"Cache-Control": "no-cache"}
BEAT = PATIENCE / 2  # seconds between two looks of a stream, also at whether somebody still listens


class Stale(Exception):
    """An act was meant for a document that has changed since."""


# -- what is asked of a sheet ------------------------------------------------------------------


def change(sheet: Sheet, body: Record) -> Data:
    """Do an act, as one step, for the revision ``base``; or undo, redo, save."""
    with sheet.lock:
        match body.get("act"):
            case "undo":
                sheet.undo()
            case "redo":
                sheet.redo()
            case "save":
                sheet.save(str(body.get("name", "")), bool(body.get("replace")))
            case _ if body.get("base", sheet.now.number) != sheet.now.number:
                raise Stale
            case _:
                sheet.change(*acted(sheet.now, body))
        return state(sheet, body)


def state(sheet: Sheet, body: Record) -> Data:
    """All that the page shows, with curves where something moves."""
    data = {**sheet.data(), **state_of(Question(sheet.now, body))}
    if data["motion"] is not None:
        data["curves"] = curves_or_reason(Question(sheet.now, {**body, "names": data["names"]}))
    return data


def functions_of(ask: Question, hold: Any = None) -> Data | None:
    """The functions with which the page moves a mechanism, or the poses of all samples.

    With ``hold`` those of the drag of a joint of blocks in a pose: its name, and coordinates.
    """
    motion, _ = ask.outcome
    if motion is None:
        return None
    functions = live(ask.now, motion.mechanism, hold)
    return {"poses": poses_of(motion)} if functions is None else functions.data()


def preview(sheet: Sheet, body: Record) -> Data:
    """The drawing that an act would make, and the functions that move it."""
    ask = Question(sheet.changed(acted(sheet.now, body).form), {})
    return {**picture_of(ask), "live": functions_of(ask)}


def functions(sheet: Sheet, body: Record) -> Data | None:
    """The functions that move the mechanism, with ``poses`` those of a drag from there."""
    poses = body.get("poses")
    if poses:
        return functions_of(Question(sheet.changed(posed(sheet.form, poses)), {}))
    return functions_of(Question(sheet.now, body), body.get("hold"))


def fields(sheet: Sheet, body: Record) -> Data:
    """The form of a part."""
    now, part = sheet.now, tuple(map(str, body.get("part", ())))
    return form_of(now.document, now.form, part, Units.of(str(body.get("units", ""))), now.problems)


def wire(sheet: Sheet, body: Record) -> Data:
    """What travels on a wire in the shown pose; with ``may`` why it may not be, or ""."""
    if body.get("may"):
        document: Any = sheet.now.document
        return {"said": " ".join(map(str, document.problems_of(Wire(body["from"], body["to"]))))}
    return {"said": wire_text(Question(sheet.now, body), f"{body['from']} -> {body['to']}")}


def link(sheet: Sheet, body: Record) -> Data:
    """The document, with what moves it, as what stands behind an address."""
    return {"link": packed(link_of(sheet.now, tuple(map(str, body.get("names", ())))))}


QUESTIONS: Mapping[str, Callable[[Sheet, Record], Any]] = {
    "state": state,
    "preview": preview,
    "live": functions,
    "names": lambda sheet, body: names_of(Question(sheet.now, body)),
    "fields": fields,
    "diagram": lambda sheet, _: diagram_of(sheet.now),
    "gap": lambda sheet, body: {"said": fault_of(Question(sheet.now, body).motion)},
    "wire": wire,
    "curves": lambda sheet, body: curves_or_reason(Question(sheet.now, body)),
    "vectors": lambda sheet, body: vectors(Question(sheet.now, body)),
    "link": link,
}


class Studio:
    """The addresses of a desk."""

    def __init__(self, desk: Desk) -> None:
        self.desk, self.jobs = desk, Jobs(desk.folder)
        self.pictures: dict[str, bytes] = {}

    def routes(self) -> list[Route]:
        """All addresses."""
        sheet = "/api/documents/{id}"
        return [
            Route("/", self.page),
            Route("/api/files", self.files),
            Route("/api/documents", self.create, methods=["POST"]),
            Route(sheet, self.ask, methods=["GET", "POST"]),
            Route(sheet + "/events", self.events),
            Route(sheet + "/work", self.work),
            Route(sheet + "/edit", self.edit, methods=["POST"]),
            Route(sheet + "/{name}", self.ask, methods=["GET", "POST"]),
            Route("/kernels/{name}.js", self.kernel),
            Route("/picture/{name}.svg", self.picture),
        ]

    # -- the page and what it offers -----------------------------------------------------------

    async def page(self, _: Request) -> Response:
        """The page, with its script's address, formats, units and analyses."""
        about = {
            "formats": formats(),
            "units": CHOICES,
            "analyses": {name: about for name, (about, _) in ANALYSES.items()},
        }
        page = Template((WEB / "index.html").read_text("utf-8")).substitute(
            script=remember(_script()), about=embeddable(about)
        )
        return Response(page, media_type="text/html", headers=FRESH)

    async def files(self, _: Request) -> Response:
        """The first page: files of the folder, sheets that are not saved, the gallery."""
        unsaved = [
            {"id": key, "name": sheet.form["name"], "step": sheet.undoable}
            for key, sheet in self.desk.sheets.items()
            if not sheet.saved
        ]
        cards = [{"name": n, "words": title_of(n)} for n in gallery() if "/" not in n]
        listing = {"files": files_of(self.desk.folder), "left": unsaved, "gallery": cards}
        return JSONResponse(listing, headers=FRESH)

    async def kernel(self, request: Request) -> Response:
        """A module by the hash of its text."""
        text = module(request.path_params["name"])
        if text is None:
            raise Missing
        return Response(text, media_type="text/javascript", headers=FOREVER)

    async def picture(self, request: Request) -> Response:
        """A mechanism of the gallery."""
        name = request.path_params["name"]
        if name not in gallery():
            raise Missing
        if name not in self.pictures:
            job, answer = self.jobs.begin({"what": "picture", "title": name, "kind": name}), None
            while not job.over or not job.states.empty():
                _, _, answer = await to_thread.run_sync(job.states.get)
            if answer is None:
                raise Missing
            self.pictures[name] = answer["data"]
        cache = {"Cache-Control": "max-age=3600"}
        return Response(self.pictures[name], media_type="image/svg+xml", headers=cache)

    # -- sheets --------------------------------------------------------------------------------

    async def create(self, request: Request) -> Response:
        """A sheet of a document: of the gallery, a file, a text, a link, or an empty one."""
        body = await _body(request)
        name = await to_thread.run_sync(self.desk.create, body)
        answer = await to_thread.run_sync(state, self.desk.sheets[name], body)
        return JSONResponse({"id": name, **answer})

    def _sheet(self, request: Request) -> Sheet:
        sheet = self.desk.sheets.get(request.path_params["id"])
        if sheet is None:
            raise Missing
        return sheet

    async def ask(self, request: Request) -> Response:
        """A question by its name; without one the state."""
        question = QUESTIONS.get(request.path_params.get("name", "state"))
        if question is None:
            raise Missing
        answer = await to_thread.run_sync(question, self._sheet(request), await _body(request))
        return JSONResponse(answer, headers=FRESH)

    async def edit(self, request: Request) -> Response:
        """A change of a sheet."""
        return JSONResponse(
            await to_thread.run_sync(change, self._sheet(request), await _body(request))
        )

    async def events(self, request: Request) -> Response:
        """The revision of a sheet whenever another window changes it."""
        sheet = self._sheet(request)

        async def stream() -> AsyncIterator[str]:
            revision = -1
            while not await request.is_disconnected():
                if sheet.now.number != revision:
                    revision = sheet.now.number
                    yield f"data: {revision}\n\n"
                await asyncio.sleep(BEAT)

        return StreamingResponse(stream(), media_type="text/event-stream", headers=FRESH)

    async def work(self, request: Request) -> Response:
        """The states of long work, ``ask``, until it is over; a listener who leaves ends it."""
        sheet, task = self._sheet(request), _object(request.query_params.get("ask", ""))
        document = {"text": sheet.text(), "file": str(sheet.path or "")}
        name, kind = request.path_params["id"], str(task.get("what", ""))
        title = f"{task.get('kind') or kind} ..."
        job = self.jobs.begin({**task, **document, "what": kind, "title": title, "sheet": name})

        async def stream() -> AsyncIterator[str]:
            try:
                while not (await request.is_disconnected() or (job.over and job.states.empty())):
                    with suppress(Empty):
                        state = await to_thread.run_sync(partial(job.states.get, timeout=BEAT))
                        yield f"data: {json.dumps(_job_data(*state))}\n\n"
            finally:
                self.jobs.stop(job)

        return StreamingResponse(stream(), media_type="text/event-stream", headers=FRESH)


def _job_data(state: str, message: str, answer: Data | None) -> Data:
    """A state of a job for the page; the content of a file in base 64."""
    if answer and "data" in answer:
        answer = {**answer, "data": base64.b64encode(answer["data"]).decode()}
    return {"state": state, "said": message, "answer": answer}


async def _body(request: Request) -> Data:
    return _object(await request.body() or b"{}")


def _object(text: str | bytes) -> Data:
    """The JSON object that was sent. Raises `RequestError` for anything else."""
    try:
        body: Data = json.loads(text)
    except ValueError:
        raise refused("body", "it is no JSON", "send an object") from None
    if not isinstance(body, dict):
        raise refused("body", "it is no JSON object", "send an object")
    return body


# -- errors --------------------------------------------------------------------------------------


class Missing(Exception):
    """There is nothing at an address."""


ERRORS: Mapping[type[Exception], tuple[int, str]] = {
    BlockmechError: (422, "{error}"),
    Missing: (404, "there is none"),
    Stale: (409, "the sheet was changed in another window; it is shown as it is now"),
    **dict.fromkeys(
        (KeyError, ValueError, TypeError), (400, "the request is not understood: {error!r}")
    ),
    Exception: (500, "an error of blockmech, see the server's window: {error!r}"),
}
"""Statuses and sentences by the kind of an error."""


async def _refusal(_: Request, error: Exception) -> Response:
    """An error as a sentence; of one in blockmech the server's window has the traceback."""
    status, sentence = next(ERRORS[kind] for kind in type(error).__mro__ if kind in ERRORS)
    if status == 500:
        traceback.print_exception(error)
    problems: tuple[Problem, ...] = getattr(error, "problems", ())
    data = {"problems": [p.to_dict() for p in problems], "said": sentence.format(error=error)}
    return JSONResponse(data, status)


# -- the server ----------------------------------------------------------------------------------


def application(desk: Desk, token: str, port: int, framed: bool = False) -> Guard:
    """The server's application, behind its guard."""
    studio = Studio(desk)
    app = Starlette(routes=studio.routes(), exception_handlers=dict.fromkeys(ERRORS, _refusal))
    app.mount("/web", StaticFiles(directory=WEB))
    app.state.studio = studio
    return Guard(app, token, port, framed)


def bound(port: int) -> socket.socket:
    """A socket on this machine; port 0 is one that is free.

    Raises `RequestError` for a port that cannot be had.
    """
    try:
        listener = socket.create_server((HOST, port))
    except OSError as error:
        raise refused("port", f"{port}: {error}", "choose another, or leave it out") from None
    # asyncio does this only for sockets that name their protocol; without it each answer waits
    # 40 ms for the acknowledgement of its headers.
    listener.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return listener


def started(
    folder: Path,
    document: str | Opened | None,
    port: int,
    announce: Callable[[str], None],
    framed: bool = False,
) -> Callable[[], None]:
    """A server of the studio, as the function that answers until its end.

    ``announce`` is called with its address, which shows ``document``, a file of the folder or a
    document; without one the gallery. Raises like `Sheet.open` for the file, and `RequestError`
    for a port that cannot be had.
    """
    import uvicorn

    desk, token = Desk(folder), secrets.token_urlsafe(16)
    sheet = desk.open(document) if isinstance(document, str) else document and desk.put(document)
    listener = bound(port)
    port = listener.getsockname()[1]
    app = application(desk, token, port, framed)
    config = uvicorn.Config(
        app, log_level="critical", lifespan="off", ws="none", timeout_graceful_shutdown=1
    )
    server = uvicorn.Server(config)
    Thread(target=_prepare, daemon=True).start()
    announce(f"http://{HOST}:{port}/{token}/" + (f"?sheet={sheet}" if sheet else ""))

    def run() -> None:
        try:
            server.run(sockets=[listener])
        finally:
            app.app.state.studio.jobs.end()

    return run


@cache
def _script() -> str:
    """The page's modules as one, so that they come at once."""
    return bundle(WEB / "main.js")


def _prepare() -> None:
    """Import and cache what a first sheet needs, and keep the garbage collector from it.

    Modules and schemas live until the end; each search of them took longer than opening a
    four-bar.
    """
    _script()
    for example in ("joints/ruiz_fourbar", "ruiz_fourbar"):
        sheet = Sheet(opened(gallery()[example]))
        for name in ("state", "live", "diagram", "fields"):
            QUESTIONS[name](sheet, {})
    gc.collect()
    gc.freeze()


def in_notebook(document: Any) -> str:
    """The address of a copy of a document; its server ends with the program."""
    addresses: list[str] = []
    copy = Linkage() if document is None else document.snapshot()
    Thread(target=started(Path.cwd(), copy, 0, addresses.append, framed=True), daemon=True).start()
    return addresses[0]
