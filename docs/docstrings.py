"""What the reference makes of docstrings, which are written to be read in a terminal.

There, what a parameter is stands behind its name, shapes and units and all; the sections of
results and errors are sentences; remarks and examples follow without a heading. The parser
of numpy's style wants each under a name or a heading of its own.
"""

import re

import griffe

SECTION = re.compile(r"^(\w+)\n-+\n(.*?)(?=^\w+\n-+\n|\Z)", re.DOTALL | re.MULTILINE)
ITEM = re.compile(r"^(\w[\w, ]*) : (.*)\n((?: +\S.*\n)*)", re.MULTILINE)
REMARK = re.compile(r"\n\n(?=[A-Z`])", re.MULTILINE)  # a sentence after the last item
RESULT = re.compile(r"(\w+)[,;]? (.*)")
ERROR = re.compile(r"((?:\w+, )*\w+Error) (.*)")


def _item(item: re.Match[str]) -> str:
    """Each name with what is said of it, the text behind the names first."""
    names, text, more = item.groups()
    stop = "." if re.match(r" +[A-Z]", more) else ""
    return "".join(f"{name}\n    {text}{stop}\n{more}" for name in names.split(", "))


def _section(section: re.Match[str]) -> str:
    name, body = section.groups()
    if name in ("Parameters", "Attributes"):
        items, *remarks = REMARK.split(body, 1)
        body = ITEM.sub(_item, items.rstrip() + "\n\n")
        body += "".join(f"Notes\n-----\n{remark}" for remark in remarks)
    elif name in ("Returns", "Raises"):
        body = _sentences(body, RESULT if name == "Returns" else ERROR, only=name == "Returns")
    return f"{name}\n{'-' * len(name)}\n{body}"


def _sentences(body: str, start: re.Pattern[str], only: bool) -> str:
    """What begins with a type, each as that type and one line of text below it."""
    said: list[str] = []
    for line in body.split("\n"):
        begun = None if only and said else start.match(line)
        if begun:
            said += [begun[1], f"    {begun[2]}"]
        elif said:
            said[-1] += f" {line.strip()}"
        else:
            return body
    return "\n".join(said).rstrip() + "\n\n"


class Plain(griffe.Extension):
    """Docstrings in the form that the parser of numpy's style takes apart."""

    def on_object(self, *, obj: griffe.Object, **_: object) -> None:
        """Change the text of one docstring."""
        if obj.docstring is None:
            return
        before, prompt, examples = obj.docstring.value.partition(">>> ")
        text = SECTION.sub(_section, before.removesuffix("Examples\n--------\n").rstrip() + "\n")
        heading = f"\nExamples\n--------\n{prompt}{examples}" if prompt else ""
        obj.docstring.value = f"{text.rstrip()}\n{heading}".rstrip()
