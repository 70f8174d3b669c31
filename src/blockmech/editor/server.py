"""The server of the studio: sheets, jobs and the page over HTTP, all answers in JSON."""

from __future__ import annotations

import asyncio
import gc
import json
import secrets
import socket
import traceback
from collections.abc import AsyncIterator, Callable, Mapping
from functools import cache
from pathlib import Path
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
from blockmech.editor.curves import curves, vectors, wire_text
from blockmech.editor.diagram import diagram_of
from blockmech.editor.exports import formats
from blockmech.editor.fields import CHOICES, Units
from blockmech.editor.forms import form_of
from blockmech.editor.gallery import title_of
from blockmech.editor.guard import HOST, Guard
from blockmech.editor.jobs import Job, Jobs
from blockmech.editor.live import live, module, remember
from blockmech.editor.revision import Question, Revision
from blockmech.editor.sharing import link_of, packed
from blockmech.editor.sheets import Desk, Sheet, files_of
from blockmech.editor.sketching import posed
from blockmech.editor.state import View, drives_of, names_of, state_of
from blockmech.editor.turn import poses_of
from blockmech.exchange.page.files import bundle, embeddable
from blockmech.ground.errors import BlockmechError, Problem, refused
from blockmech.model.diagram import Wire
from blockmech.testing.graph_files import gallery
from blockmech.typing import Data, Record

WEB = Path(__file__).with_name("web")
FOREVER = {"Cache-Control": "private, max-age=31536000, immutable"}
FRESH = {"Cache-Control": "no-cache"}
BEAT = 15.0  # seconds after which a stream sends a sign of life
Body = Record
Answer = Data
ViewKey = tuple[int, str, tuple[tuple[str, float], ...]]


class Stale(Exception):
    """An act was meant for a document that has changed since."""


class OpenSheet:
    """A sheet, and the view of its newest revision; public methods are names of the API."""

    CHANGES = ("edit", "undo", "redo", "save")
    QUESTIONS = (
        *("state", "preview", "live", "names", "fields", "diagram"),
        *("wire", "curves", "vectors", "link"),
    )

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self._key: ViewKey | None = None
        self._view: View | None = None

    def view(self, body: Body) -> View:
        """What follows from the sheet, and from where drivers were put by hand."""
        coordinates = {str(d): float(q) for d, q in (body.get("held") or {}).items()}
        now, moved = self.sheet.now, str(body.get("moved", ""))
        key = (now.number, moved, tuple(sorted(coordinates.items())))
        if self._key != key or self._view is None:
            self._key, self._view = key, View(now, moved, coordinates)
        return self._view

    def question(self, body: Body) -> Question:
        """A question about the motion of the view."""
        return Question(self.sheet.now, body, computed=self.view(body).motion)

    # -- changes -----------------------------------------------------------------------------

    def edit(self, body: Body) -> Answer:
        """Do an act, as one step; ``base`` is the revision that it is meant for."""

        def act(sheet: Sheet) -> None:
            if "base" in body and body["base"] != sheet.now.number:
                raise Stale
            sheet.change(*acted(sheet.now, body))

        return self._change(body, act)

    def undo(self, body: Body) -> Answer:
        """Take back the last step."""
        return self._change(body, Sheet.undo)

    def redo(self, body: Body) -> Answer:
        """Do a step again."""
        return self._change(body, Sheet.redo)

    def save(self, body: Body) -> Answer:
        """Write the file."""
        name, replace = str(body.get("name", "")), bool(body.get("replace"))
        return self._change(body, lambda sheet: sheet.save(name, replace))

    def _change(self, body: Body, change: Callable[[Sheet], Any]) -> Answer:
        with self.sheet.lock:
            change(self.sheet)
            return self.state(body)

    # -- questions ---------------------------------------------------------------------------

    def state(self, body: Body) -> Answer:
        """All that the page shows, with curves where something moves."""
        view = self.view(body)
        data = {**self.sheet.data(), **state_of(view), "names": []}
        if view.motion is not None:
            data["names"] = self.question(body).names or drives_of(view.motion)
            try:
                data["curves"] = self.curves({**body, "names": data["names"]})
            except BlockmechError as error:
                data["curves"] = {"panels": [], "margins": [], "said": str(error), "along": None}
        return data

    def preview(self, body: Body) -> Answer:
        """The drawing that an act would make, and the functions that move it."""
        view = self._view_of(acted(self.sheet.now, body).form)
        return {**view.data, "live": _functions(view)}

    def live(self, body: Body) -> Answer | None:
        """The functions that move the mechanism.

        With ``poses`` those of a drag from there, with ``hold`` those of the drag of a joint of
        blocks in a pose: its name, and coordinates.
        """
        poses = body.get("poses")
        view = self._view_of(posed(self.sheet.form, poses)) if poses else self.view(body)
        return _functions(view, body.get("hold"))

    def _view_of(self, form: Answer) -> View:
        document = self.sheet.read(form)
        return View(Revision(self.sheet.now.number, document.to_data(), document))

    def names(self, body: Body) -> Answer:
        """What can be chosen of the mechanism."""
        return names_of(self.view(body))

    def fields(self, body: Body) -> Answer:
        """The form of a part."""
        now, part = self.sheet.now, tuple(map(str, body.get("part", ())))
        units = Units.of(str(body.get("units", "")))
        return form_of(now.document, now.form, part, units, now.problems)

    def diagram(self, _: Body) -> Answer:
        """The block diagram."""
        return diagram_of(self.sheet.now)

    def wire(self, body: Body) -> Answer:
        """What travels on a wire in the shown pose; with ``may`` why it may not be, or ""."""
        wire = f"{body['from']} -> {body['to']}"
        document: Any = self.sheet.now.document
        if body.get("may"):
            problems = document.problems_of(Wire(body["from"], body["to"]))
            return {"said": " ".join(map(str, problems))}
        return {"said": wire_text(self.question(body), wire)}

    def curves(self, body: Body) -> Answer:
        """Curves of chosen outputs."""
        return curves(self.question(body))

    def vectors(self, body: Body) -> list[Answer]:
        """Velocities, reactions or friction circles along the motion."""
        return vectors(self.question(body))

    def link(self, body: Body) -> Answer:
        """The document, with what moves it, as what stands behind an address."""
        names = tuple(map(str, body.get("names", ())))
        return {"link": packed(link_of(self.sheet.now, names))}


def _functions(view: View, hold: Any = None) -> Answer | None:
    """The functions with which the page moves a mechanism, or the poses of all samples."""
    now, motion = view.now, view.motion
    if motion is None:
        return None
    functions = live(now, motion.mechanism, hold)
    return {"poses": poses_of(motion)} if functions is None else functions.data()


class Studio:
    """The addresses of a desk."""

    def __init__(self, desk: Desk) -> None:
        self.desk, self.jobs = desk, Jobs(desk.folder)
        self.open: dict[str, OpenSheet] = {}
        self.pictures: dict[str, bytes] = {}
        self.changed = asyncio.Condition()

    def routes(self) -> list[Route]:
        """All addresses."""
        sheet, job = "/api/documents/{id}", "/api/jobs/{job}"
        return [
            Route("/", self.page),
            Route("/api/files", self.files),
            Route("/api/documents", self.create, methods=["POST"]),
            Route(sheet, self.ask, methods=["GET", "POST"]),
            Route(sheet + "/events", self.events),
            Route(sheet + "/jobs", self.begin, methods=["POST"]),
            Route(sheet + "/{name}", self.ask, methods=["GET", "POST"]),
            Route(job + "/events", self.follow),
            Route(job + "/file", self.file),
            Route(job, self.stop, methods=["DELETE"]),
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
            job = self.jobs.begin({"what": "picture", "title": "a picture", "kind": name})
            while not job.over:
                await to_thread.run_sync(job.wait, job.turns, BEAT)
            if job.answer is None:
                raise Missing
            self.pictures[name] = job.answer["data"]
        cache = {"Cache-Control": "max-age=3600"}
        return Response(self.pictures[name], media_type="image/svg+xml", headers=cache)

    # -- sheets --------------------------------------------------------------------------------

    async def create(self, request: Request) -> Response:
        """A sheet of a document: of the gallery, a file, a text, a link, or an empty one."""
        body = await _body(request)
        name = await to_thread.run_sync(self.desk.create, body)
        state = await to_thread.run_sync(self._opened(name).state, body)
        return JSONResponse({"id": name, **state})

    def _opened(self, name: str) -> OpenSheet:
        sheet = self.desk.sheets.get(name)
        if sheet is None:
            raise Missing
        return self.open.setdefault(name, OpenSheet(sheet))

    async def ask(self, request: Request) -> Response:
        """A question or a change by its name; without one the state."""
        sheet, name = self._opened(request.path_params["id"]), request.path_params.get("name")
        changes = name in OpenSheet.CHANGES and request.method == "POST"
        if name and not changes and name not in OpenSheet.QUESTIONS:
            raise Missing
        body = await _body(request)
        answer = await to_thread.run_sync(getattr(sheet, name or "state"), body)
        if changes:
            async with self.changed:
                self.changed.notify_all()
        return JSONResponse(answer, headers=FRESH)

    async def events(self, request: Request) -> Response:
        """The revision of a sheet whenever another window changes it."""
        sheet = self._opened(request.path_params["id"]).sheet

        async def stream() -> AsyncIterator[str]:
            revision = -1
            while not await request.is_disconnected():
                if sheet.now.number != revision:
                    revision = sheet.now.number
                    yield f"data: {revision}\n\n"
                try:
                    async with self.changed:
                        await asyncio.wait_for(self.changed.wait(), BEAT)
                except TimeoutError:
                    yield ": \n\n"

        return StreamingResponse(stream(), media_type="text/event-stream", headers=FRESH)

    # -- jobs ----------------------------------------------------------------------------------

    async def begin(self, request: Request) -> Response:
        """Begin long work."""
        name, body = request.path_params["id"], await _body(request)
        sheet, kind = self._opened(name).sheet, str(body.get("what", ""))
        document = {"text": sheet.text(), "file": str(sheet.path or ""), "sheet": name}
        title = f"{body.get('kind') or kind} ..."
        task = {**body, "what": kind, "title": title, "revision": sheet.now.number, **document}
        return JSONResponse({"job": self.jobs.begin(task).id})

    def _job(self, request: Request) -> Job:
        job = self.jobs.jobs.get(request.path_params["job"])
        if job is None:
            raise Missing
        return job

    async def follow(self, request: Request) -> Response:
        """The states of a job, until it is over; a listener who leaves ends it."""
        job = self._job(request)

        async def stream() -> AsyncIterator[str]:
            turn = -1
            try:
                while not job.over or turn < job.turns:
                    if turn < job.turns:
                        turn = job.turns
                        yield f"data: {json.dumps(_job_data(job))}\n\n"
                    else:
                        await to_thread.run_sync(job.wait, turn, 0.5)
                        if await request.is_disconnected():
                            break
            finally:
                if not job.over:
                    self.jobs.stop(job)

        return StreamingResponse(stream(), media_type="text/event-stream", headers=FRESH)

    async def file(self, request: Request) -> Response:
        """The file of an export."""
        answer: Data = self._job(request).answer or {}
        if "data" not in answer:
            raise Missing
        headers = {"Content-Disposition": f'attachment; filename="{answer["name"]}"'}
        return Response(answer["data"], media_type="application/octet-stream", headers=headers)

    async def stop(self, request: Request) -> Response:
        """End a job."""
        self.jobs.stop(self._job(request))
        return JSONResponse({})


def _job_data(job: Job) -> Data:
    """A job for the page; a file is fetched by itself."""
    answer = job.answer and {key: x for key, x in job.answer.items() if key != "data"}
    return {"state": job.state, "said": job.said, "answer": answer}


async def _body(request: Request) -> Data:
    """The JSON object that was sent. Raises `RequestError` for anything else."""
    try:
        body = json.loads(await request.body() or b"{}")
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
    KeyError: (400, "the request is not understood: {error!r}"),
    ValueError: (400, "the request is not understood: {error!r}"),
    TypeError: (400, "the request is not understood: {error!r}"),
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
    for name in ("joints/ruiz_fourbar", "ruiz_fourbar"):
        sheet = OpenSheet(Sheet(opened(gallery()[name])))
        for question in (sheet.state, sheet.live, sheet.diagram, sheet.fields):
            question({})
    gc.collect()
    gc.freeze()


def in_notebook(document: Any) -> str:
    """The address of a copy of a document; its server ends with the program."""
    addresses: list[str] = []
    copy = Linkage() if document is None else document.snapshot()
    run = started(Path.cwd(), copy, 0, addresses.append, framed=True)
    Thread(target=run, daemon=True).start()
    return addresses[0]
