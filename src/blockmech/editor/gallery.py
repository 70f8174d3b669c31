"""Mechanisms of the gallery to start from, with their pictures."""

from __future__ import annotations

import json
from functools import cache

from blockmech.builders import opened
from blockmech.figures.paper import rendered
from blockmech.testing.graph_files import gallery


def picture_of(name: str) -> bytes:
    """The mechanism of a gallery graph as SVG."""
    from blockmech.draw.mechanism import draw_tile

    return rendered(draw_tile(opened(gallery()[name]).compile()), ".svg")


@cache
def title_of(name: str) -> str:
    """What a mechanism of the gallery is, in a line."""
    title: str = json.loads(gallery()[name].read_text("utf-8")).get("title", "")
    return title
