"""Pages that run: their programs are executed, and what these print and draw is what they show.

The programs of a page share one namespace and one folder, in which `graphs` is the gallery.
What stands under a file's name in backquotes is that file. A line `print(x)  # 3.14 m`
promises that number to its digits; what other lines print is shown below the program. Lines
that start with `blockmech ` in a block marked `sh` are commands. By hand:

    python docs/snippets.py docs/motion.md FOLDER
"""

import ast
import contextlib
import io
import os
import re
import shlex
import sys
from collections.abc import Iterator
from multiprocessing import Pool
from pathlib import Path
from tempfile import TemporaryDirectory

ROOT = Path(__file__).resolve().parents[1]
FENCE = re.compile(
    r"(?:`(?P<file>[\w.]+)`:\n\n)?^(?P<indent> *)```(?P<language>python|sh|json)\n"
    r"(?P<code>.*?)^(?P=indent)```$",
    re.DOTALL | re.MULTILINE,
)
PROMISE = re.compile(r"^print\(.*\)  # +(-?\d[\d.]*(?:e-?\d+)?)")
OUTSIDE = re.compile(r"(!?)\[([^\]]*)\]\(\.\./[^)]*\)")  # a link to a file of the repository


class BrokenPage(Exception):
    """A program of a page fails, or prints another number than it says."""


def run(text: str, name: str = "page") -> list[str]:
    """Execute the programs of a page in the current folder; what each of them shows."""
    space: dict = {"__name__": "__main__"}
    return [_shown(fence, space, f"{name}:{_line(fence)}") for fence in FENCE.finditer(text)]


def _line(fence: re.Match[str]) -> int:
    return fence.string.count("\n", 0, fence.start("code")) + 1


def _shown(fence: re.Match[str], space: dict, where: str) -> str:
    indent = fence["indent"]
    code = "".join(x.removeprefix(indent) for x in fence["code"].splitlines(keepends=True))
    try:
        if fence["file"]:
            Path(fence["file"]).write_text(code, encoding="utf-8")
            return ""
        if fence["language"] == "python":
            return "".join(_statements(code, space))
        if fence["language"] == "sh":
            return "".join(_commands(code))
    except Exception as error:
        raise BrokenPage(f"{where}: {type(error).__name__}: {error}") from error
    return ""


def _statements(code: str, space: dict) -> Iterator[str]:
    """Run statement by statement; what is printed without a promise."""
    lines = code.splitlines()
    for node in ast.parse(code).body:
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(compile(ast.Module([node], []), "<page>", "exec"), space)
        promise = PROMISE.match(lines[(node.end_lineno or node.lineno) - 1])
        if promise:
            _keep(promise[1], out.getvalue())
        else:
            yield out.getvalue()


def _keep(said: str, printed: str) -> None:
    """Raise unless the first word printed is the number said, to the digits said."""
    mantissa, _, power = said.partition("e")
    digits = len(mantissa.partition(".")[2]) - int(power or 0)
    found = float(printed.split()[0].strip("(),"))
    if not abs(found - float(said)) <= 0.51 * 10.0**-digits:
        raise ValueError(f"prints {found!r} where it says {said}")


def _commands(code: str) -> Iterator[str]:
    """Run the commands of a block, if it has no others; what they print."""
    from blockmech.cli import main

    lines = code.splitlines()
    if not all(line.startswith("blockmech ") for line in lines):
        return
    for line in lines:
        with contextlib.redirect_stdout(io.StringIO()) as out:
            status = main(shlex.split(line)[1:])
        if status:
            raise ValueError(f"{line} ends with {status}")
        yield out.getvalue()


@contextlib.contextmanager
def workplace(folder: Path) -> Iterator[Path]:
    """The folder as the current one, with the gallery in it and its files importable."""
    if not (folder / "graphs").exists():
        os.symlink(ROOT / "graphs", folder / "graphs", target_is_directory=True)
    path, modules = sys.path[:], set(sys.modules)
    sys.path.insert(0, str(folder))
    try:
        with contextlib.chdir(folder):
            yield folder
    finally:
        sys.path[:] = path
        for name in set(sys.modules) - modules:
            if str(getattr(sys.modules[name], "__file__", "")).startswith(str(folder)):
                del sys.modules[name]


def alone(text: str, name: str, folder: Path) -> tuple[list[str], str]:
    """Run a page in a new folder; what its programs show, or what is wrong with it."""
    folder.mkdir(parents=True, exist_ok=True)
    with workplace(folder):
        try:
            return run(text, name), ""
        except BrokenPage as error:
            return [], str(error)


# ---- the site: hooks of mkdocs -----------------------------------------------------------

_shown_on: dict[str, list[str]] = {}


def on_files(files, config):
    """Run all pages, each in a process and a folder of its own; their pictures join the site."""
    from mkdocs.exceptions import PluginError
    from mkdocs.structure.files import File

    sys.path.insert(0, str(ROOT))  # the processes know this file by its own name
    import blockmech.cli  # noqa: F401  once, for all processes that are forked
    from docs.snippets import alone

    pages = files.documentation_pages()
    with TemporaryDirectory() as home, Pool(maxtasksperchild=1) as pool:
        folders = [Path(home) / str(number) for number, _ in enumerate(pages)]
        tasks = [(x.content_string, x.src_uri, at) for x, at in zip(pages, folders, strict=True)]
        ran = pool.starmap(alone, tasks, chunksize=1)
        for page, folder, (shown, wrong) in zip(pages, folders, ran, strict=True):
            if wrong:
                raise PluginError(wrong)
            _shown_on[page.src_uri] = shown
            for picture in re.findall(
                r"\]\(([\w/-]+\.(?:svg|png|gif|html))\)", page.content_string
            ):
                uri, made = (Path(page.src_uri).parent / picture).as_posix(), folder / picture
                if files.get_file_from_path(uri):  # in the repository, made by a test
                    if made.exists():
                        raise PluginError(f"{page.src_uri}: there is another picture {uri}")
                    continue
                if not made.exists():
                    raise PluginError(f"{page.src_uri}: no program of the page makes {picture}")
                files.append(File.generated(config, uri, content=made.read_bytes()))
    return files


def on_page_markdown(markdown, page, config, files):
    """What the programs print goes below them; what is not on the site loses its link."""
    outputs = iter(_shown_on.get(page.file.src_uri, []))

    def with_output(fence: re.Match[str]) -> str:
        shown = next(outputs).rstrip()
        if not shown:
            return fence[0]
        block = f"\n\n``` {{ .text .printed }}\n{shown}\n```"
        return fence[0] + block.replace("\n", f"\n{fence['indent']}")

    return OUTSIDE.sub(r"\2", FENCE.sub(with_output, markdown))


def on_post_page(output, page, config):
    """The site works without a network: no page loads anything from elsewhere."""
    from mkdocs.exceptions import PluginError

    loaded = re.findall(
        r"<(?:script|link|img|iframe)\b[^>]*(?:src|href)=\"?(https?://[^\s\">]+)", output
    )
    if loaded:
        raise PluginError(f"{page.file.src_uri} loads {', '.join(loaded)}")
    return output


if __name__ == "__main__":
    source, target = (Path(argument).resolve() for argument in sys.argv[1:])
    shown, wrong = alone(source.read_text(encoding="utf-8"), source.name, target)
    sys.exit(wrong or print(*filter(None, shown), sep="\n"))
