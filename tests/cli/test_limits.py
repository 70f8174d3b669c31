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
