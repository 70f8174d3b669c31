"""A page of each machine of the gallery, written from its file when the site is built.

What it is, its picture, its film where motion is the point, the command that computes it with
what this prints, and with what the numbers are compared that its file expects.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

GRAPHS = Path(__file__).resolve().parents[1] / "graphs"
FILMS = {
    "engine",
    "oldham_coupling",
    "planetary_hoist",
    "scotch_yoke",
    "toggle_press",
    "valve_engine",
    "whitworth_shaper",
}
HEAD = "---\nsearch:\n  boost: 0.1\n---"


def on_files(files, config):
    """The pages join the site; their commands run with the programs of the other pages."""
    from mkdocs.structure.files import File

    for file in sorted(GRAPHS.glob("*.json")):
        text = page(file.stem, json.loads(file.read_text("utf-8")))
        files.append(File.generated(config, f"machines/{file.stem}.md", content=text))
    return files


def page(name: str, document: dict[str, Any]) -> str:
    """The page of a machine: Markdown, whose commands make its pictures."""
    title, _, rest = document["title"].partition(": ")
    pictures = [f"{name}.svg", *([f"{name}.html"] if name in FILMS else [])]
    commands = [f"blockmech draw graphs/{name}.json -o {picture}" for picture in pictures]
    paragraphs = [
        HEAD,
        f"# {title}",
        f"{rest[:1].upper()}{rest[1:]}." if rest else "",
        document.get("notes", ""),
        f"![{document['title']}]({name}.svg)",
        f"[Film of the motion]({name}.html)" if name in FILMS else "",
        "\n".join(["```sh", *commands, compute(name, document), "```"]),
        "\n".join(comparisons(document)),
        f"`blockmech new {name} mine.json` copies the file, `blockmech studio mine.json` opens it.",
        "[Gallery](../gallery.md)",
    ]
    return "\n\n".join(filter(None, paragraphs))


def compute(name: str, document: dict[str, Any]) -> str:
    """The command for what the first expectation of the file is about: a motion, or poses."""
    motion = next(iter(document.get("expect", [])), {}).get("simulate")
    if motion:
        return f"blockmech simulate graphs/{name}.json --until {motion['until']}"
    return f"blockmech run graphs/{name}.json"


def comparisons(document: dict[str, Any]) -> Iterator[str]:
    """Lines of the table of what the file expects: outputs, sources and tolerances."""
    for number, entry in enumerate(document.get("expect", [])):
        if number == 0:
            yield "| outputs | compared with | tolerance |\n|---|---|---|"
        outputs = ", ".join(f"`{output}`" for output in entry["want"])
        relative = f"{entry['rtol']:.0e} of the value" if "rtol" in entry else ""
        absolute = f"{entry['atol']:.0e} in SI units" if "atol" in entry else ""
        tolerance = ", ".join(filter(None, [relative, absolute]))
        yield f"| {outputs} | {entry['source']} | {tolerance} |"
