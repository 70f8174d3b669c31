"""The server of the studio: JSON over what the package can do, and the page.

Sheets, their steps and files live here; what is looked at and what the hand does lives in the
page. Every answer to a change is the whole state of the sheet.
"""

from __future__ import annotations

import asyncio
import gc
import json
import secrets
import socket
import traceback
from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Any

from anyio import to_thread
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, Response, StreamingResponse
from starlette.routing import Route
from starlette.staticfiles import StaticFiles

import blockmech
from blockmech.builders import Linkage, Opened, opened, read_text
from blockmech.ground.errors import BlockmechError, Problem, refused
from blockmech.model.diagram import Wire
from blockmech.studio import answers, state
from blockmech.studio.acts import acted
from blockmech.studio.diagram import diagram_of, kinds
from blockmech.studio.fields import CHOICES, Shown
from blockmech.studio.files import Desk, Filed, files_of
from blockmech.studio.forms import form_of
from blockmech.studio.gallery import words_of
from blockmech.studio.guard import HOST, Guard
from blockmech.studio.jobs import Job, Jobs
from blockmech.studio.live import live, module
from blockmech.studio.sharing import packed, unpacked
from blockmech.studio.sketching import posed
from blockmech.studio.turn import poses_of
from blockmech.testing.graph_files import gallery

WEB = Path(__file__).with_name("web")
FOREVER = {"Cache-Control": "private, max-age=31536000, immutable"}
FRESH = {"Cache-Control": "no-cache"}
BEAT = 15.0  # seconds after which a stream says that it lives
Body = Mapping[str, Any]
Moved = tuple[int, str, tuple[tuple[str, float], ...]]


@dataclass
class Open:
    """A sheet on the desk, and what was last worked out of it."""

    sheet: Filed
    key: Moved | None = None
    shown: state.Shown | None = None

    def of(self, body: Body) -> state.Shown:
        """What follows from the sheet as it is, and from where drivers were put by hand."""
        at = {str(d): float(q) for d, q in (body.get("held") or {}).items()}
        key = (self.sheet.now.number, str(body.get("moved", "")), tuple(sorted(at.items())))
        if self.key != key or self.shown is None:
            self.key, self.shown = key, state.Shown(self.sheet.now, key[1], at)
        return self.shown

    def question(self, body: Body) -> answers.Question:
        """A question of what is shown."""
        shown = self.of(body)
        ask = answers.Question.of(self.sheet.now, body)
        if shown.motion is not None:
            ask.__dict__["motion"] = shown.motion
        return ask

    def state(self, body: Body) -> dict[str, Any]:
        """All that the page shows, with curves where outputs are chosen."""
        shown = self.of(body)
        made = state.state_of(self.sheet, shown)
        if shown.motion is not None:
            body = {**body, "names": body.get("names") or made["drives"]}
            try:
                made["curves"] = answers.curves(self.question(body))
            except BlockmechError as error:
                made["curves"] = {"panels": [], "margins": [], "said": str(error), "along": None}
        return made


class Studio:
    """The API of a desk."""

    def __init__(self, desk: Desk) -> None:
        self.desk, self.jobs = desk, Jobs(desk.folder)
        self.open: dict[str, Open] = {}
        self.pictures: dict[str, bytes] = {}
        self.turned = asyncio.Condition()

    def routes(self) -> list[Route]:
        """All addresses."""
        sheet = "/api/documents/{id}"
        return [
            Route("/", self.page),
            Route("/api/about", self.about),
            Route("/api/documents", self.create, methods=["POST"]),
            Route(sheet, self.show, methods=["GET", "POST"]),
            Route(sheet + "/edit", self.edit, methods=["POST"]),
            Route(sheet + "/undo", self.undo, methods=["POST"]),
            Route(sheet + "/redo", self.redo, methods=["POST"]),
            Route(sheet + "/preview", self.preview, methods=["POST"]),
            Route(sheet + "/live", self.live, methods=["POST"]),
            Route(sheet + "/save", self.save, methods=["POST"]),
            Route(sheet + "/fields", self.fields, methods=["POST"]),
            Route(sheet + "/diagram", self.diagram, methods=["GET"]),
            Route(sheet + "/wire", self.wire, methods=["POST"]),
            Route(sheet + "/curves", self.curves, methods=["POST"]),
            Route(sheet + "/vectors", self.vectors, methods=["POST"]),
            Route(sheet + "/link", self.link, methods=["GET"]),
            Route(sheet + "/events", self.events, methods=["GET"]),
            Route(sheet + "/jobs", self.begin, methods=["POST"]),
            Route("/api/jobs/{job}/events", self.follow, methods=["GET"]),
            Route("/api/jobs/{job}/file", self.file, methods=["GET"]),
            Route("/api/jobs/{job}", self.stop, methods=["DELETE"]),
            Route("/api/files", self.files, methods=["GET"]),
            Route("/kernels/{name}.js", self.kernel),
            Route("/picture/{name}.svg", self.picture),
        ]

    # -- pages and what never changes ------------------------------------------------------

    async def page(self, _: Request) -> Response:
        """The page."""
        return Response((WEB / "index.html").read_bytes(), media_type="text/html", headers=FRESH)

    async def about(self, _: Request) -> Response:
        """What the page offers: kinds of blocks, formats, units, analyses."""
        return JSONResponse(
            {
                "version": blockmech.__version__,
                "kinds": kinds(),
                "formats": answers.formats(),
                "units": CHOICES,
                "analyses": {name: words for name, (words, _) in answers.ANALYSES.items()},
            }
        )

    async def kernel(self, request: Request) -> Response:
        """A module by the hash of its text."""
        text = module(request.path_params["name"])
        if text is None:
            return Response(status_code=404)
        return Response(text, media_type="text/javascript", headers=FOREVER)

    async def picture(self, request: Request) -> Response:
        """A mechanism of the gallery."""
        name = request.path_params["name"]
        if name not in gallery():
            return Response(status_code=404)
        if name not in self.pictures:
            job = self.jobs.begin({"what": "picture", "title": "a picture", "kind": name})
            while not job.over:
                await to_thread.run_sync(job.wait, job.turns, BEAT)
            if job.answer is None:
                return Response(status_code=404)
            self.pictures[name] = job.answer["data"]
        how = {"Cache-Control": "max-age=3600"}
        return Response(self.pictures[name], media_type="image/svg+xml", headers=how)

    async def files(self, _: Request) -> Response:
        """The first page: files of the folder, sheets that are not saved, the gallery."""
        left = [
            {"id": key, "name": s.form["name"], "step": s.undoable}
            for key, s in self.desk.sheets.items()
            if not s.saved
        ]
        cards = [{"name": n, "words": words_of(n)} for n in gallery() if "/" not in n]
        more = {"files": files_of(self.desk.folder), "left": left, "gallery": cards}
        return JSONResponse(more, headers=FRESH)

    # -- sheets ----------------------------------------------------------------------------

    async def create(self, request: Request) -> Response:
        """A sheet of a document: of the gallery, a file, a text, a link, or an empty one."""
        body = await _body(request)
        name = await to_thread.run_sync(self._put, body)
        sheet = self._opened(name)
        made = await to_thread.run_sync(sheet.state, body)
        return JSONResponse({"id": name, **made})

    def _put(self, body: Body) -> str:
        desk, examples = self.desk, gallery()
        readers: dict[str, Callable[[str], Opened]] = {
            "example": lambda name: opened(examples[name]),
            "text": lambda text: read_text(text, str(body.get("name", "the file"))),
            "link": unpacked,
            "new": lambda kind: Linkage() if kind == "joints" else blockmech.Graph(),
        }
        if "file" in body:
            return desk.open(str(body["file"]))
        key = next((key for key in readers if key in body), None)
        word = str(body.get(key or "", ""))
        if key is None or (key == "example" and word not in examples):
            raise refused(key or "body", f"{word or 'nothing'} is no document", "choose another")
        return desk.put(readers[key](word))

    def _opened(self, name: str) -> Open:
        sheet = self.desk.sheets.get(name)
        if sheet is None:
            raise Missing
        held = self.open.get(name)
        if held is None or held.sheet is not sheet:
            held = self.open[name] = Open(sheet)
        return held

    def _of(self, request: Request) -> Open:
        return self._opened(request.path_params["id"])

    async def show(self, request: Request) -> Response:
        """The state of a sheet."""
        held = self._of(request)
        body = await _body(request) if request.method == "POST" else {}
        return JSONResponse(await to_thread.run_sync(held.state, body), headers=FRESH)

    async def edit(self, request: Request) -> Response:
        """Do an act, as one step; ``base`` is the revision that it was thought for."""
        body = await _body(request)

        def change(sheet: Filed) -> None:
            if "base" in body and body["base"] != sheet.now.number:
                raise Stale
            sheet.change(*acted(sheet.now, body))

        return await self._changed(request, body, change)

    async def undo(self, request: Request) -> Response:
        """Take back the last step."""
        return await self._changed(request, await _body(request), lambda sheet: sheet.undo())

    async def redo(self, request: Request) -> Response:
        """Do a step again."""
        return await self._changed(request, await _body(request), lambda sheet: sheet.redo())

    async def save(self, request: Request) -> Response:
        """Write the file."""
        body = await _body(request)

        def write(sheet: Filed) -> None:
            sheet.save(str(body.get("name", "")), bool(body.get("replace")))

        return await self._changed(request, body, write)

    async def _changed(
        self, request: Request, body: Body, change: Callable[[Filed], Any]
    ) -> Response:
        held = self._of(request)

        def do() -> dict[str, Any]:
            with held.sheet.lock:
                change(held.sheet)
                return held.state(body)

        made = await to_thread.run_sync(do)
        async with self.turned:
            self.turned.notify_all()
        return JSONResponse(made)

    async def preview(self, request: Request) -> Response:
        """What an act would make: the numbers that the page's functions then have."""
        held, body = self._of(request), await _body(request)

        def do() -> dict[str, Any]:
            now = held.sheet.now
            made = held.sheet.read(acted(now, body).form)
            other = state.Shown(type(now)(now.number, made.to_data(), made))
            return {**other.data(), "live": _live(other)}

        return JSONResponse(await to_thread.run_sync(do))

    async def live(self, request: Request) -> Response:
        """The functions that move the mechanism; with ``poses`` those of a drag from there."""
        held, body = self._of(request), await _body(request)

        def do() -> Any:
            shown, now = held.of(body), held.sheet.now
            if body.get("poses"):
                made = held.sheet.read(posed(now.form, body["poses"]))
                shown = state.Shown(type(now)(now.number, made.to_data(), made))
            return _live(shown)

        return JSONResponse(await to_thread.run_sync(do))

    async def events(self, request: Request) -> Response:
        """The revision of a sheet whenever another window changes it."""
        sheet = self._of(request).sheet

        async def stream() -> AsyncIterator[str]:
            seen = -1
            while not await request.is_disconnected():
                if sheet.now.number != seen:
                    seen = sheet.now.number
                    yield f"data: {seen}\n\n"
                try:
                    async with self.turned:
                        await asyncio.wait_for(self.turned.wait(), BEAT)
                except TimeoutError:
                    yield ": \n\n"

        return StreamingResponse(stream(), media_type="text/event-stream", headers=FRESH)

    # -- what is asked of a sheet ----------------------------------------------------------

    async def fields(self, request: Request) -> Response:
        """The form of a part; ``edits`` were typed and are not sound yet."""
        now, body = self._of(request).sheet.now, await _body(request)
        shown = Shown.of(str(body.get("units", "")))

        def do() -> dict[str, Any]:
            part = tuple(map(str, body.get("part", ())))
            return form_of(now.document, now.form, part, shown, now.problems)

        return JSONResponse(await to_thread.run_sync(do))

    async def diagram(self, request: Request) -> Response:
        """The block diagram."""
        now = self._of(request).sheet.now
        return JSONResponse(await to_thread.run_sync(diagram_of, now))

    async def wire(self, request: Request) -> Response:
        """Whether a wire may be, and what travels on it in the shown pose."""
        held, body = self._of(request), await _body(request)
        document: Any = held.sheet.now.document
        wire = f"{body.get('from')} -> {body.get('to')}"
        if body.get("may"):
            problems = document.problems_of(Wire(body["from"], body["to"]))
            return JSONResponse({"said": " ".join(map(str, problems))})
        ask = held.question(body)
        return JSONResponse({"said": await to_thread.run_sync(answers.wire_text, ask, wire)})

    async def curves(self, request: Request) -> Response:
        """Curves of chosen outputs."""
        held, body = self._of(request), await _body(request)
        return JSONResponse(await to_thread.run_sync(lambda: answers.curves(held.question(body))))

    async def vectors(self, request: Request) -> Response:
        """Velocities, reactions or friction circles along the motion."""
        held, body = self._of(request), await _body(request)
        what = str(body.get("what", ""))
        made = await to_thread.run_sync(lambda: answers.vectors(held.question(body), what))
        return JSONResponse(made)

    async def link(self, request: Request) -> Response:
        """The document as what stands behind an address."""
        return JSONResponse({"link": packed(self._of(request).sheet.text())})

    # -- jobs ------------------------------------------------------------------------------

    async def begin(self, request: Request) -> Response:
        """Begin long work."""
        sheet, body = self._of(request).sheet, await _body(request)
        what = str(body.get("what", ""))
        task = {
            **body,
            "what": what,
            "title": f"{body.get('kind') or what} ...",
            "sheet": request.path_params["id"],
            "text": sheet.text(),
            "file": str(sheet.path or ""),
            "revision": sheet.now.number,
        }
        return JSONResponse({"job": self.jobs.begin(task).id})

    def _job(self, request: Request) -> Job:
        job = self.jobs.jobs.get(request.path_params["job"])
        if job is None:
            raise Missing
        return job

    async def follow(self, request: Request) -> Response:
        """What a job says, until it is over; who leaves ends it."""
        job = self._job(request)

        async def stream() -> AsyncIterator[str]:
            seen = -1
            try:
                while not job.over or seen < job.turns:
                    if seen < job.turns:
                        seen = job.turns
                        yield f"data: {json.dumps(_told(job))}\n\n"
                    else:
                        await to_thread.run_sync(job.wait, seen, 0.5)
                        if await request.is_disconnected():
                            break
            finally:
                if not job.over:
                    self.jobs.stop(job)

        return StreamingResponse(stream(), media_type="text/event-stream", headers=FRESH)

    async def file(self, request: Request) -> Response:
        """The file that a job has made."""
        answer: dict[str, Any] = self._job(request).answer or {}
        if "data" not in answer:
            raise Missing
        how = {"Content-Disposition": f'attachment; filename="{answer["name"]}"'}
        kind = "application/octet-stream"
        return Response(answer["data"], media_type=kind, headers=how)

    async def stop(self, request: Request) -> Response:
        """End a job."""
        self.jobs.stop(self._job(request))
        return JSONResponse({})


def _live(shown: state.Shown) -> dict[str, Any] | None:
    """The functions with which the page moves a mechanism, or the poses of all samples."""
    now, motion = shown.now, shown.motion
    if motion is None:
        return None
    made = live(now.document if now.mechanism else None, motion.mechanism)
    return {"poses": poses_of(motion)} if made is None else made.data()


def _told(job: Job) -> dict[str, Any]:
    """A job as the page hears of it; a file is fetched by itself."""
    answer = job.answer and {key: x for key, x in job.answer.items() if key != "data"}
    return {"state": job.state, "said": job.said, "answer": answer}


class Missing(Exception):
    """There is nothing at an address."""


class Stale(Exception):
    """An act was thought for a document that has changed since."""


async def _body(request: Request) -> dict[str, Any]:
    """The JSON object that was sent. Raises `RequestError` for anything else."""
    try:
        body = json.loads(await request.body() or b"{}")
    except ValueError:
        raise refused("body", "it is no JSON", "send an object") from None
    if not isinstance(body, dict):
        raise refused("body", "it is no JSON object", "send an object")
    return body


async def _refused(_: Request, error: Exception) -> Response:
    problems: tuple[Problem, ...] = getattr(error, "problems", ())
    said = [problem.to_dict() for problem in problems]
    return JSONResponse({"problems": said, "said": str(error)}, 422)


async def _odd(_: Request, error: Exception) -> Response:
    """A request that lacks something, or has it of another kind."""
    return JSONResponse({"problems": [], "said": f"the request is not understood: {error!r}"}, 400)


async def _failed(_: Request, error: Exception) -> Response:
    """An error of ours: whoever started the studio sees it, and the page a sentence."""
    traceback.print_exception(error)
    said = f"an error of blockmech, see the server's window: {error!r}"
    return JSONResponse({"problems": [], "said": said}, 500)


async def _missing(_: Request, error: Exception) -> Response:
    return JSONResponse({"problems": [], "said": "there is none"}, 404)


async def _stale(_: Request, error: Exception) -> Response:
    said = "the sheet was changed in another window; it is shown as it is now"
    return JSONResponse({"problems": [], "said": said}, 409)


def application(desk: Desk, token: str, port: int, framed: bool = False) -> Guard:
    """The whole of the server, behind its guard."""
    studio = Studio(desk)
    app = Starlette(
        routes=studio.routes(),
        exception_handlers={
            BlockmechError: _refused,
            Missing: _missing,
            Stale: _stale,
            KeyError: _odd,
            ValueError: _odd,
            TypeError: _odd,
            Exception: _failed,
        },
    )
    app.mount("/web", StaticFiles(directory=WEB))
    app.state.studio = studio
    return Guard(app, token, port, framed)


def bound(port: int) -> socket.socket:
    """A socket on this machine; port 0 is one that is free.

    Raises `RequestError` for a port that cannot be had.
    """
    try:
        return socket.create_server((HOST, port))
    except OSError as error:
        raise refused("port", f"{port}: {error}", "choose another, or leave it out") from None


def started(
    folder: Path,
    shown: str | Opened | None,
    port: int,
    told: Callable[[str], None],
    framed: bool = False,
) -> Callable[[], None]:
    """A server of the studio, as the function that answers until its end.

    ``told`` hears its address; ``shown`` is a file of the folder, or a document, that the
    address shows; without one it shows the gallery. Raises like `Filed.open` for the file, and
    `RequestError` for a port that cannot be had.
    """
    import uvicorn

    desk, token = Desk(folder), secrets.token_urlsafe(16)
    start = desk.open(shown) if isinstance(shown, str) else shown and desk.put(shown)
    held = bound(port)
    own = held.getsockname()[1]
    app = application(desk, token, own, framed)
    config = uvicorn.Config(
        app, log_level="critical", lifespan="off", ws="none", timeout_graceful_shutdown=1
    )
    server = uvicorn.Server(config)
    Thread(target=_prepare, daemon=True).start()
    told(f"http://{HOST}:{own}/{token}/" + (f"?sheet={start}" if start else ""))

    def run() -> None:
        try:
            server.run(sockets=[held])
        finally:
            app.app.state.studio.jobs.end()

    return run


def _prepare() -> None:
    """Make what is made once before the first sheet is opened, and let nobody search it again.

    Python looks for what is no longer used among all that a program holds; modules and schemas
    are used until the end, and each search of them took longer than opening a four-bar.
    """
    for name in ("joints/ruiz_fourbar", "ruiz_fourbar"):
        held = Open(Filed(opened(gallery()[name])))
        held.state({})
        _live(held.of({}))
        diagram_of(held.sheet.now)
        form_of(held.sheet.now.document, held.sheet.form, (), Shown(), ())
    gc.collect()
    gc.freeze()


class Framed:
    """What a notebook shows: the page of a sheet, in a frame."""

    def __init__(self, address: str, height: int) -> None:
        self.address, self.height = address, height

    def _repr_html_(self) -> str:
        look = f"width:100%;height:{self.height}px;border:0"
        return f'<iframe src="{self.address}" style="{look}" title="blockmech studio"></iframe>'


def in_notebook(document: Any, height: int) -> Framed:
    """The page of a copy of a document; its server ends with the program."""
    heard: list[str] = []
    shown = Linkage() if document is None else document.snapshot()
    run = started(Path.cwd(), shown, 0, heard.append, framed=True)
    Thread(target=run, daemon=True).start()
    return Framed(heard[0], height)
