"""``blockmech limits``: the arcs that Python finds, as text and as JSON."""

from __future__ import annotations

import json

import blockmech as bm


def found(file, *driver, **more):
    """What Python finds."""
    return bm.Graph.load(file).compile().limits(*driver, **more)


def test_limits_prints_the_arcs_and_what_ends_them(call, short):
    said = call("limits", short)
    assert said.code == 0
    assert said.out == f"{found(short)}\n"
    assert "(dyad extended)" in said.out
    assert call("limits", short, "--deg").out == found(short).text(degrees=True) + "\n"


def test_each_driver_is_moved_with_the_others_held(call, fivebar):
    said = call("limits", fivebar, "--at", "left=0", "--at", "right=60deg", "--json")
    told = json.loads(said.out)["limits"]
    assert [t["driver"] for t in told] == ["left.q", "right.q"]
    assert told[1]["held"] == {"left.q": 0.0}
    one = call("limits", fivebar, "--driver", "right", "--at", "left=0", "--json")
    assert json.loads(one.out)["limits"] == told[1:]


def test_wrong_calls_say_what_to_do(call, fivebar, short):
    said = call("limits", fivebar)
    assert said.code == 2
    assert "nothing says where this driver is held" in said.err
    said = call("limits", fivebar, "--at", "left=0,1")
    assert said.code == 2
    assert "it names 2 places. give one number" in said.err
    said = call("limits", short, "--at", "1")
    assert said.code == 2
    assert "this driver is the one that moves" in said.err
    said = call("limits", short, "--json", "--deg")
    assert said.code == 2
    assert "JSON results are in SI units" in said.err
    said = call("limits", short, "--driver", "crnk")
    assert said.code == 2
    assert 'did you mean "crank"?' in said.err
