"""Pictures: block diagrams, mechanisms at poses and in motion, curves of a run.

matplotlib is imported when something is drawn, and nothing but it is needed. A file
is written whole or not at all; the same subject gives the same bytes.
"""

from __future__ import annotations

import html
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias

from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.files import AnyPath, writing
from blockmech.files import folder as whole_folder

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.draw.animation import Reel
    from blockmech.draw.curves import Axis
    from blockmech.result import Result

    class Document(Protocol):
        """A graph or linkage."""

        def compile(self) -> Compiled: ...

    Subject: TypeAlias = Document | Compiled

__all__ = [
    "Animation",
    "animate",
    "diagram_svg",
    "draw",
    "mechanism_svg",
    "plot",
    "run_pictures",
]

STILL = (".png", ".svg", ".pdf")
MOVING = (".gif", ".html")
KINDS = {"diagram": STILL, "mechanism": STILL, "animation": MOVING, "schedule": STILL}


def draw(
    subject: Subject,
    path: AnyPath,
    kind: Literal["diagram", "mechanism", "animation", "schedule"] | None = None,
    at: Any = None,
    *,
    trace: Iterable[str] | None = None,
    degrees: bool = True,
    want: Iterable[str] | str = "*",
) -> Path:
    """Draw a graph, a linkage or a mechanism; the suffix of the path says the format.

    Parameters
    ----------
    subject : graph (for a diagram it need not be complete), linkage or mechanism
    path : .png, .svg or .pdf; .gif or .html for an animation
    kind : "diagram" (default), "mechanism" at poses, "animation" (default for .gif, .html),
        "schedule" of the kernel calls that some outputs take
    at : float or (n,) [rad or m], or a mapping driver -> (n,)
        Driver coordinates of the poses, the first in full; by default over the range
        of the drivers' laws of motion.
    trace : names of markers whose paths are drawn; by default the user's markers
    degrees : angles in the picture in degrees
    want : outputs of a schedule

    Raises
    ------
    RequestError for an unknown kind or suffix, a missing range, unknown names, or a
        place that cannot be written
    GraphError where a mechanism is wanted and the graph is not complete
    AssemblyError, SingularError where the first pose does not exist
    """
    what, suffix = _kind_and_suffix(path, kind)
    if what == "animation":
        animate(subject, path, at, trace=trace, degrees=degrees)
        return Path(path)
    useless = "at" if at is not None else "trace" if trace is not None else ""
    if what != "mechanism" and useless:
        remedy = 'use it with kind="mechanism"'
        found = f"a {'block diagram' if what == 'diagram' else what} has no poses"
        raise RequestError(Problem("useless-setting", useless, found, "", remedy))
    if what == "diagram":
        figure = _diagram(subject)
    elif what == "schedule":
        from blockmech.draw.schedule import draw_schedule

        figure = draw_schedule(_mechanism(subject).plan(want))
    else:
        figure = _pose(subject, at, trace, degrees)
    return write_figure(figure, path, suffix)


def diagram_svg(subject: Subject) -> str:
    """The block diagram as SVG text; the same graph gives the same text."""
    return _svg(_diagram(subject))


def mechanism_svg(subject: Subject, at: Any = None, trace: Iterable[str] | None = None) -> str:
    """The mechanism at poses as SVG text; see `draw` for the arguments and errors."""
    return _svg(_pose(subject, at, trace, True))


class Animation:
    """An animation; a notebook shows its player. ``path`` is its file, if there is one."""

    def __init__(self, reel: Reel, path: Path | None = None) -> None:
        self.path = path
        self._reel = reel

    @cached_property
    def html(self) -> str:
        """The player as one HTML document that loads nothing from elsewhere."""
        from blockmech.draw.animation import player

        return player(self._reel)

    def save(self, path: AnyPath) -> Animation:
        """The animation in a .gif or .html file; raises the errors of `draw`."""
        from blockmech.draw.animation import gif

        suffix = _kind_and_suffix(path, "animation")[1]
        with writing(path) as stream:
            stream.write(self.html.encode() if suffix == ".html" else gif(self._reel))
        return Animation(self._reel, Path(path))

    def _repr_html_(self) -> str:
        inside = html.escape(self.html, quote=True)
        return f'<iframe srcdoc="{inside}" width="100%" height="560" frameborder="0"></iframe>'


def animate(
    subject: Subject | Result,
    path: AnyPath | None = None,
    at: Any = None,
    *,
    frames: int = 72,
    seconds: float = 3.0,
    trace: Iterable[str] | None = None,
    degrees: bool = True,
) -> Animation:
    """Animate a mechanism over the range of its laws of motion, or the samples of a run.

    Parameters
    ----------
    subject : graph, linkage, mechanism or result
    path : .gif or .html (one file, nothing is loaded from elsewhere); None only shows it
    at : driver coordinates of the frames, see `draw`
    frames : number of frames over the range, 2 to 2000
    seconds : time [s] that one cycle lasts on the screen
    trace, degrees : see `draw`

    Poses that do not close are left out; a motion that does not return to its start is
    played to and fro. Raises the errors of `draw`.
    """
    from blockmech.draw.animation import reel_of
    from blockmech.result import Result

    if path is not None:
        _kind_and_suffix(path, "animation")  # before anything is computed
    mover = subject if isinstance(subject, Result) else _mechanism(subject)
    reel = reel_of(mover, at, frames=frames, seconds=seconds, trace=trace, degrees=degrees)
    made = Animation(reel)
    return made if path is None else made.save(path)


def run_pictures(
    result: Result, folder: AnyPath, *, over: Axis = "auto", degrees: bool = True
) -> list[Path]:
    """Write the pictures of a run: one for each kind of curve that it has.

    ``drive.png``, ``friction_power.png`` and ``reactions.png`` ([R10] Figs. 12-14), with
    the curves without friction beside; ``kinematics.png`` for a mechanism without forces.

    Parameters
    ----------
    result : the run; outputs that it did not compute are not drawn
    folder : made if it is missing
    over : driver coordinate or time; "auto" takes what the samples were named by
    degrees : driver angles in degrees

    Raises `RequestError` where the folder cannot be written, or times are not known.
    """
    from blockmech.draw.curves import abscissa, pictures_of
    from blockmech.draw.panels import draw_panels

    along = abscissa(result, over, degrees)
    drawn = {
        f"{name}.png": draw_panels(panels, along).figure
        for name, panels in pictures_of(result).items()
    }
    with whole_folder(folder) as home:
        return [Path(folder) / write_figure(f, home / name).name for name, f in drawn.items()]


def plot(
    result: Result,
    path: AnyPath,
    names: Iterable[str] | None = None,
    *,
    over: Axis = "auto",
    degrees: bool = True,
) -> Path:
    """Draw outputs of a run in one picture, one panel for each quantity.

    Parameters
    ----------
    names : outputs; by default all that the run wanted, or, if it wanted everything,
        those of `run_pictures`
    over, degrees : see `run_pictures`

    Raises `RequestError` for an unknown suffix or name, or too many curves.
    """
    from blockmech.draw.curves import abscissa, chosen_panels, pictures_of
    from blockmech.draw.panels import draw_panels

    suffix = still_suffix(path)
    along = abscissa(result, over, degrees)
    if names is None and len(result) == len(result.mechanism.outputs):
        panels = tuple(p for group in pictures_of(result).values() for p in group)
    else:
        panels = chosen_panels(result, result if names is None else names)
    return write_figure(draw_panels(panels, along).figure, path, suffix)


# -- subjects and files --------------------------------------------------------------------


def _diagram(subject: Subject) -> Any:
    """The figure of a block diagram, with the names of links and joints that it is made of."""
    from blockmech.draw.boxes import graph_of
    from blockmech.draw.diagram import draw_diagram
    from blockmech.model.graph import Graph

    if isinstance(subject, Graph):
        return draw_diagram(subject).figure
    mechanism = _mechanism(subject)
    return draw_diagram(graph_of(mechanism), mechanism.names).figure


def _pose(subject: Subject, at: Any, trace: Iterable[str] | None, degrees: bool) -> Any:
    from blockmech.draw.mechanism import draw_mechanism

    return draw_mechanism(_mechanism(subject), at, trace, degrees).figure


def _mechanism(subject: Subject) -> Compiled:
    from blockmech.compiled import Compiled

    return subject if isinstance(subject, Compiled) else subject.compile()


def _svg(figure: Any) -> str:
    from blockmech.draw.paper import rendered

    return rendered(figure, ".svg").decode()


def write_figure(figure: Any, path: AnyPath, suffix: str = ".png") -> Path:
    """Write a figure as the suffix says."""
    from blockmech.draw.paper import rendered

    data = rendered(figure, suffix)
    with writing(path) as stream:
        stream.write(data)
    return Path(path)


def still_suffix(path: AnyPath) -> str:
    """The suffix of a plot's file; raises `RequestError` for one that is no picture's."""
    return _suffix(path, STILL, "a plot")


def _kind_and_suffix(path: AnyPath, kind: str | None) -> tuple[str, str]:
    if kind is None:
        kind = "animation" if Path(path).suffix.lower() in MOVING else "diagram"
    if kind not in KINDS:
        found, valid = f'no kind of picture "{kind}"', f"kinds: {listed(KINDS)}"
        near = close_match(str(kind), KINDS)
        raise RequestError(Problem("unknown-kind", "kind", found, valid, near))
    return kind, _suffix(path, KINDS[kind], f"{'an' if kind == 'animation' else 'a'} {kind}")


def _suffix(path: AnyPath, valid: tuple[str, ...], what: str) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in valid:
        found = f'{what} cannot be written as "{suffix}"' if suffix else "the name has no suffix"
        known = f"suffixes for {what}: {listed(valid)}"
        raise RequestError(Problem("unknown-suffix", str(path), found, known, "choose one of them"))
    return suffix
