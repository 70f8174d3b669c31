"""The API of the studio, without a browser: acts, refusals, guard, jobs, two windows."""

import base64
import json
import socket
import time

import numpy as np
import pytest

import blockmech as bm
from blockmech.builders import opened
from blockmech.editor.jobs import Jobs
from blockmech.editor.sheets import Desk, packed, unpacked
from blockmech.exchange.page.files import Link
from blockmech.testing.graph_files import gallery
from tests.exchange import corpus

starlette = pytest.importorskip("starlette", reason="the extra studio is not installed")
TOKEN, HOST = "token", "http://127.0.0.1:5000"


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of the tool that tests are run with
        from starlette.testclient import TestClient
    from blockmech.editor.server import application

    app = application(Desk(tmp_path_factory.mktemp("folder")), TOKEN, 5000)
    browser = TestClient(app, HOST)
    entry = browser.get(f"/{TOKEN}/", follow_redirects=False)
    assert (entry.status_code, entry.headers["location"]) == (303, "/")
    assert "open the address in a browser" in entry.text
    yield browser
    jobs = app.app.state.studio.jobs
    process = jobs._process
    jobs.end()
    for stream in (process.stdin, process.stdout) if process else ():
        stream.close()


def sheet(client, example="joints/ruiz_fourbar"):
    reply = client.post("/api/documents", json={"example": example})
    assert reply.status_code == 200
    state = reply.json()
    return f"/api/documents/{state['id']}", state


def test_strangers_are_refused(client):
    cookie = {"Cookie": f"blockmech_5000={TOKEN}"}
    assert client.get("/api/files", headers=cookie).status_code == 200
    wrong = [
        {"Cookie": "blockmech_5000=guess"},
        {**cookie, "Host": "evil.example:5000"},
        {**cookie, "Origin": "http://evil.example"},
        {**cookie, "Origin": "null"},
    ]
    for headers in wrong:
        reply = client.get("/api/files", headers=headers)
        assert reply.status_code == 403
        assert "open the address" in reply.text
    across = {**cookie, "Sec-Fetch-Site": "cross-site"}
    assert client.post("/api/documents", json={}, headers=across).status_code == 403


def test_what_every_answer_says_to_the_browser(client):
    for path in ("/", "/api/files", "/api/nothing", "/web/app.css"):
        headers = client.get(path).headers
        policy = headers["content-security-policy"]
        assert "script-src 'self'" in policy
        assert "unsafe" not in policy
        assert headers["x-frame-options"] == "DENY"
        assert headers["referrer-policy"] == "no-referrer"


@pytest.mark.parametrize("path", ["/web/../server.py", "/web/%2e%2e/server.py", "/kernels/x.js"])
def test_nothing_else_is_served(client, path):
    assert client.get(path).status_code == 404


def test_no_answer_waits_until_its_headers_are_acknowledged():
    """A connection sends at once what it has; a browser acknowledges after 40 ms."""
    from blockmech.editor.server import bound

    with bound(0) as listener, socket.create_connection(listener.getsockname()):
        connection, _ = listener.accept()
        with connection:
            assert connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY)


@pytest.mark.parametrize("body", [b"{", b"[]", b"\xff"])
def test_a_wrong_body_is_a_sentence(client, body):
    reply = client.post("/api/documents", content=body)
    assert reply.status_code in (400, 422)
    assert reply.json()["said"]


def test_a_body_that_is_too_large_is_refused(client):
    assert client.post("/api/documents", content=b" " * (33 << 20)).status_code == 413


@pytest.mark.parametrize("name", ["joints/ruiz_fourbar", "excavator", "motions/clock"])
def test_the_state_of_a_sheet(client, name):
    path, state = sheet(client, name)
    assert state["problems"] == []
    assert state["motion"]["n"] == len(next(iter(state["motion"]["q"].values())))
    assert {pin["at"][0] for pin in state["drawing"]["pins"]} <= {*state["drawing"]["poses"]}
    live = client.post(f"{path}/live", json={}).json()
    text = client.get(f"/kernels/{live['hash']}.js")
    assert text.headers["content-type"].startswith("text/javascript")
    assert "immutable" in text.headers["cache-control"]
    panels = state["curves"]["panels"]
    assert [panel["quantity"] for panel in panels]
    json.dumps(state, allow_nan=False)


def test_an_act_is_a_step_and_a_refusal_leaves_the_sheet(client):
    path, state = sheet(client)
    (pin,) = (pin for pin in state["drawing"]["pins"] if pin["name"] == "B")
    moved = {"act": "move", "pins": {"B": [0.3, 1.9]}, "base": state["revision"]}
    after = client.post(f"{path}/edit", json=moved).json()
    assert (after["undoable"], after["revision"]) == ("move B", state["revision"] + 1)
    stale = client.post(f"{path}/edit", json=moved)
    assert stale.status_code == 409
    assert "another window" in stale.json()["said"]
    wrong = client.post(f"{path}/edit", json={"act": "Link", "pins": ["A", "B"]})
    assert wrong.status_code == 422
    assert "already" in wrong.json()["problems"][0]["found"]
    back = client.post(f"{path}/edit", json={"act": "undo"}).json()
    assert [p for p in back["drawing"]["pins"] if p["name"] == "B"] == [pin]
    assert client.post(f"{path}/edit", json={"act": "redo"}).json()["drawing"] == after["drawing"]
    assert client.post(f"{path}/edit", json={"act": "fly"}).status_code == 422


def test_a_preview_is_what_an_edit_makes(client):
    path, state = sheet(client, "watt_sixbar")
    pin = next(pin for pin in state["drawing"]["pins"] if pin["held"] and not pin["ground"])
    x, y, _ = state["drawing"]["poses"][pin["at"][0]]
    act = {"act": "drag", "name": pin["name"], "to": [x + 0.01, y], "q": state["motion"]["home"]}
    preview = client.post(f"{path}/preview", json=act)
    assert preview.status_code == 200
    assert client.post(path, json={}).json()["revision"] == state["revision"]
    after = client.post(f"{path}/edit", json=act).json()
    assert after["drawing"] == preview.json()["drawing"]
    assert client.post(f"{path}/live", json={}).json() == preview.json()["live"]


def test_a_drag_in_another_pose_stands_the_drawing_there(client):
    path, _ = sheet(client)
    poses = {"crank": [0.0, 0.0, 1.0], "coupler": [1.08, 1.68, 0.2], "rocker": [5.5, 0.0, 0.9]}
    act = {"act": "move", "pins": {"B": [1.1, 1.7]}, "poses": poses}
    after = client.post(f"{path}/edit", json=act).json()
    assert after["motion"]["home"]["motor"] == pytest.approx(1.0)
    assert after["drawing"]["poses"]["crank"] == [0.0, 0.0, 1.0]


def test_a_driver_is_moved_by_hand_with_the_others_held(client):
    path, state = sheet(client, "excavator")
    at = {driver: q[0] for driver, q in state["motion"]["q"].items()} | {"arm": 3.2}
    moved = client.post(path, json={"moved": "arm", "held": at}).json()["motion"]["q"]
    assert len({*moved["boom"]}) == 1
    assert min(moved["arm"]) < 3.2 < max(moved["arm"])


def test_curves_have_forces_without_friction_beside_them(client):
    path, _ = sheet(client, "joints/excavator")
    names = ["driver.lift.drive"]
    curves = client.post(f"{path}/curves", json={"names": names, "friction": "newton"}).json()
    (panel,) = curves["panels"]
    assert (panel["quantity"], panel["unit"]) == ("drive", "kN")
    assert len(panel["curves"]) == len(panel["without"]) == 1
    result = opened(gallery()["joints/excavator"]).run(want=names, friction="newton", samples=361)
    assert panel["curves"][0][1] == pytest.approx(result[names[0]] / 1e3, rel=1e-12)
    bare = client.post(f"{path}/curves", json={"names": names, "friction": "none"}).json()
    assert bare["panels"][0]["curves"][0][1] == pytest.approx(panel["without"][0][1], rel=1e-12)


@pytest.mark.parametrize("what", ["velocities", "reactions", "friction circles"])
def test_arrows_stand_at_joints(client, what):
    path, _ = sheet(client, "joints/excavator")
    rows = client.post(f"{path}/vectors", json={"what": what}).json()
    assert rows
    assert all(np.isfinite(row["at"] + row["vector"]).all() for row in rows)
    assert client.post(f"{path}/vectors", json={"what": "wishes"}).status_code == 422


def test_a_wire_says_what_travels_on_it_and_whether_it_may_be(client):
    path, _ = sheet(client, "ruiz_fourbar")
    text = client.post(f"{path}/wire", json={"from": "crank.B", "to": "dyad.B"}).json()["said"]
    assert text.startswith("→ p = (")
    assert "\n← F = (" in text
    wrong = {"from": "dyad.C", "to": "crank.A", "may": True}
    assert client.post(f"{path}/wire", json=wrong).json()["said"]


def test_files_links_and_what_is_not_saved(client):
    path, state = sheet(client)
    link = client.get(f"{path}/link").json()["link"]
    assert unpacked(link).to_json() == opened(gallery()["joints/ruiz_fourbar"]).to_json()
    again = client.post("/api/documents", json={"link": link}).json()
    assert again["drawing"] == state["drawing"]
    assert (
        client.post(f"{path}/edit", json={"act": "save", "name": "../out.json"}).status_code == 422
    )
    saved = client.post(f"{path}/edit", json={"act": "save", "name": "four.json"}).json()
    assert (saved["saved"], saved["file"]) == (True, "four.json")
    listed = client.get("/api/files").json()
    assert listed["files"] == ["four.json"]
    opened_again = client.post("/api/documents", json={"file": "four.json"}).json()
    assert opened_again["id"] == state["id"]
    client.post(f"{path}/edit", json={"act": "pin", "at": [1.0, 2.0]})
    assert state["id"] in [unsaved["id"] for unsaved in client.get("/api/files").json()["left"]]


def test_an_address_of_pmks_plus_is_read(client):
    machine = corpus.MACHINES["rocker"]
    reply = client.post("/api/documents", json={"address": corpus.pmks_plus(machine)}).json()
    assert reply["kind"] == "joints"
    assert reply["problems"] == []
    assert len(reply["drawing"]["pins"]) == len(machine.points)
    for wrong in ("https://example.org/", "/etc/hostname", "file:///etc/hostname"):
        assert client.post("/api/documents", json={"address": wrong}).status_code == 422


@pytest.mark.parametrize("wrong", ["", "AAAA", "=", "\u00e9", "x" * 1000])
def test_a_link_that_holds_no_document_is_refused(client, wrong):
    reply = client.post("/api/documents", json={"link": f"#doc={wrong}"})
    assert reply.status_code == 422
    assert "copy the whole link again" in reply.json()["said"]


def test_a_link_of_a_large_document_is_unpacked_up_to_a_limit():
    with pytest.raises(bm.RequestError, match="larger than a document may be"):
        unpacked(packed(Link("x" * (5 << 20), "a.json", None)))


def answer(client, path, **task):
    """What a job says in the end, and all states that it went through."""
    lines = client.get(f"{path}/work", params={"ask": json.dumps(task)}).text.splitlines()
    states = [json.loads(line[6:]) for line in lines if line.startswith("data: ")]
    return states[-1], states


def test_analyses_motions_and_files_are_jobs(client):
    """One process answers them all, and the page is told of its progress."""
    path, _ = sheet(client, "joints/fivebar_falling")
    end, states = answer(client, path, what="Limits")
    assert end["state"] == "done"
    assert "arc" in end["answer"]["text"] or "turns fully" in end["answer"]["text"]
    assert end["answer"]["picture"].startswith("<?xml")
    end, states = answer(client, path, what="simulate", until="time=0.2")
    assert end["state"] == "done", end["said"]
    assert end["answer"]["motion"]["time"][-1] == pytest.approx(0.2)
    assert any(report["state"] == "running" for report in states)
    names = list(end["answer"]["motion"]["poses"])
    assert "left_crank" in names
    end, _ = answer(client, path, what="export", kind="document .json")
    assert end["answer"]["name"] == "fivebar_falling.json"
    assert json.loads(base64.b64decode(end["answer"]["data"]))["name"] == "fivebar_falling"
    end, _ = answer(client, path, what="Sensitivity", names=[])
    assert end["state"] == "failed"
    assert "none is chosen under Curves" in end["said"]
    end, _ = answer(client, path, what="Wishes")
    assert end["state"] == "failed"


def test_stop_ends_work_within_a_second(tmp_path):
    """Also work that tells nothing of its progress; the next job begins another process."""
    document = opened(gallery()["joints/excavator"])
    task = {
        "what": "Friction solutions", "title": "work", "sheet": "a", "text": document.to_json(),
        "file": "", "revision": 1, "names": ["driver.lift.drive"],
    }  # fmt: skip
    jobs = Jobs(tmp_path)
    job = jobs.begin(task)
    assert job.states.get(timeout=60)[0] == "running"
    process, start = jobs._process, time.monotonic()
    jobs.stop(job)
    assert process.wait(5) != 0
    assert time.monotonic() - start < 1.0
    assert job.over
    while not job.states.empty():
        end = job.states.get()
    assert end == ("stopped", "stopped", None)
    after = jobs.begin({**task, "what": "Limits"})
    end = after.states.get(timeout=60)
    while end[0] == "running":
        end = after.states.get(timeout=60)
    assert end[0] == "done", end
    again = jobs._process
    jobs.end()
    again.stdin.close()
    again.stdout.close()


def test_a_notebook_shows_a_frame_with_a_key_of_its_own(monkeypatch, tmp_path):
    import urllib.request

    monkeypatch.chdir(tmp_path)
    frame = bm.studio(opened(gallery()["ruiz_fourbar"]))
    assert 'src="http://127.0.0.1:' in frame._repr_html_()
    address, _, query = frame.address.partition("?")
    with urllib.request.urlopen(f"{address}?{query}") as page:
        assert (
            "frame-ancestors 'self' http://localhost:*" in page.headers["Content-Security-Policy"]
        )
        assert b'src="kernels/' in page.read()
    with urllib.request.urlopen(f"{address}api/documents/{query.removeprefix('sheet=')}") as state:
        assert json.load(state)["name"] == "ruiz_fourbar"
    wrong = address.replace(address.split("/")[3], "guess")
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(f"{wrong}api/files")
