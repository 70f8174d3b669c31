"""Pictures: block diagrams, mechanisms at poses and in motion, curves of a run.

matplotlib is imported when something is drawn, and nothing but it is needed. A file
is written whole or not at all; the same subject gives the same bytes.
"""

from __future__ import annotations

import html
from collections.abc import Iterable
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from blockmech.errors import Problem, RequestError, close_match, listed
from blockmech.files import AnyPath, writing

if TYPE_CHECKING:
    from blockmech.compiled import Compiled
    from blockmech.draw.animation import Reel
    from blockmech.draw.mechanism import Scale
    from blockmech.model.graph import Graph
    from blockmech.model.joints.linkage import Linkage
    from blockmech.model.naming import Names
    from blockmech.result import Result

    Subject: TypeAlias = Graph | Linkage | Compiled

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
KINDS = {"diagram": STILL, "mechanism": STILL, "animation": MOVING}


def draw(
    subject: Subject,
    path: AnyPath,
    kind: Literal["diagram", "mechanism", "animation"] | None = None,
    at: Any = None,
    *,
    trace: Iterable[str] | None = None,
    degrees: bool = True,
) -> Path:
    """Draw a graph, a linkage or a mechanism; the suffix of the path says the format.

    Parameters
    ----------
    subject : graph (for a diagram it need not be complete), linkage or mechanism
    path : .png, .svg or .pdf; .gif or .html for an animation
    kind : "diagram" (default), "mechanism" at poses, "animation" (default for .gif, .html)
    at : float or (n,) [rad or m], or a mapping driver -> (n,)
        Driver coordinates of the poses, the first in full; by default over the range
        of the drivers' laws of motion.
    trace : names of markers whose paths are drawn; by default the user's markers
    degrees : angles in the picture in degrees

    Returns
    -------
    Path of the file

    Raises
    ------
    RequestError for an unknown kind or suffix, a missing range, unknown names, or a
        place that cannot be written
    GraphError where a mechanism is wanted and the graph is not complete
    AssemblyError, SingularError where the first pose does not exist
    """
    what, suffix = _kind_and_suffix(path, kind)
    if what == "diagram" and (at is not None or trace is not None):
        raise RequestError(
            Problem(
                "useless-setting",
                "at" if at is not None else "trace",
                "a block diagram has no poses",
                "",
                'use it with kind="mechanism"',
            )
        )
    if what == "animation":
        animate(subject, path, at, trace=trace, degrees=degrees)
        return Path(path)
    from blockmech.draw.paper import rendered

    if what == "diagram":
        from blockmech.draw.diagram import draw_diagram

        figure = draw_diagram(*_diagram_of(subject)).figure
    else:
        from blockmech.draw.mechanism import draw_mechanism

        figure = draw_mechanism(_mechanism(subject), at, trace, degrees).figure
    return _write(path, rendered(figure, suffix))


def diagram_svg(subject: Subject) -> str:
    """The block diagram as SVG text; the same graph gives the same text."""
    from blockmech.draw.diagram import draw_diagram
    from blockmech.draw.paper import rendered

    return rendered(draw_diagram(*_diagram_of(subject)).figure, ".svg").decode()


def mechanism_svg(subject: Subject, at: Any = None, trace: Iterable[str] | None = None) -> str:
    """The mechanism at poses as SVG text; see `draw` for the arguments and errors."""
    from blockmech.draw.mechanism import draw_mechanism
    from blockmech.draw.paper import rendered

    return rendered(draw_mechanism(_mechanism(subject), at, trace).figure, ".svg").decode()


class Animation:
    """An animation; a notebook shows its player. ``path`` is its file, if there is one."""

    def __init__(self, reel: Reel, scale: Scale, path: Path | None = None) -> None:
        self.path = path
        self._reel = reel
        self._scale = scale

    @cached_property
    def html(self) -> str:
        """The player as one HTML document that loads nothing from elsewhere."""
        from blockmech.draw.animation import page

        return page(self._reel, self._scale)

    def save(self, path: AnyPath) -> Animation:
        """The animation in a .gif or .html file; raises the errors of `draw`."""
        from blockmech.draw.animation import gif

        suffix = _kind_and_suffix(path, "animation")[1]
        data = self.html.encode() if suffix == ".html" else gif(self._reel, self._scale)
        return Animation(self._reel, self._scale, _write(path, data))

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
    reel, scale = reel_of(mover, at, frames=frames, seconds=seconds, trace=trace, degrees=degrees)
    made = Animation(reel, scale)
    return made if path is None else made.save(path)


def run_pictures(
    result: Result,
    folder: AnyPath,
    *,
    over: Literal["auto", "coordinate", "time"] = "auto",
    degrees: bool = True,
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
    from blockmech.draw.paper import rendered

    along = abscissa(result, over, degrees)
    drawn = {
        f"{name}.png": rendered(draw_panels(panels, along).figure, ".png")
        for name, panels in pictures_of(result).items()
    }
    home = _folder(folder)
    return [_write(home / name, data) for name, data in drawn.items()]


def plot(
    result: Result,
    path: AnyPath,
    names: Iterable[str] | None = None,
    *,
    over: Literal["auto", "coordinate", "time"] = "auto",
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
    from blockmech.draw.paper import rendered

    suffix = _suffix(path, STILL, "a plot")
    along = abscissa(result, over, degrees)
    everything = names is None and len(result) == len(result.mechanism.outputs)
    if everything:
        panels = tuple(p for group in pictures_of(result).values() for p in group)
    else:
        panels = chosen_panels(result, result if names is None else names)
    return _write(path, rendered(draw_panels(panels, along).figure, suffix))


# -- subjects and files --------------------------------------------------------------------


def _diagram_of(subject: Subject) -> tuple[Graph, Names | None]:
    """The graph of a subject, and the names of the links and joints that it was made of."""
    from blockmech.draw.boxes import graph_of
    from blockmech.model.graph import Graph

    if isinstance(subject, Graph):
        return subject, None
    mechanism = _mechanism(subject)
    return graph_of(mechanism), mechanism.names


def _mechanism(subject: Subject) -> Compiled:
    from blockmech.compiled import Compiled

    return subject if isinstance(subject, Compiled) else Compiled.of(subject)


def _kind_and_suffix(path: AnyPath, kind: str | None) -> tuple[str, str]:
    if kind is None:
        kind = "animation" if Path(path).suffix.lower() in MOVING else "diagram"
    if kind not in KINDS:
        raise RequestError(
            Problem(
                "unknown-kind",
                "kind",
                f'no kind of picture "{kind}"',
                f"kinds: {listed(KINDS)}",
                close_match(str(kind), KINDS),
            )
        )
    return kind, _suffix(path, KINDS[kind], f"{'an' if kind == 'animation' else 'a'} {kind}")


def _suffix(path: AnyPath, valid: tuple[str, ...], what: str) -> str:
    suffix = Path(path).suffix.lower()
    if suffix not in valid:
        raise RequestError(
            Problem(
                "unknown-suffix",
                str(path),
                f'{what} cannot be written as "{suffix}"' if suffix else "the name has no suffix",
                f"suffixes for {what}: {listed(valid)}",
                "choose one of them",
            )
        )
    return suffix


def _folder(path: AnyPath) -> Path:
    home = Path(path)
    try:
        home.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        why = "it is a file, not a directory" if home.is_file() else error.strerror
        raise RequestError(
            Problem("cannot-write", str(path), str(why), "", "choose another folder")
        ) from None
    return home


def _write(path: AnyPath, data: bytes) -> Path:
    with writing(path) as stream:
        stream.write(data)
    return Path(path)
