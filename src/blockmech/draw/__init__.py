"""Pictures: block diagrams, mechanisms at poses and in motion, curves of a run.

matplotlib is imported when something is drawn, and nothing but it is needed. A file
is written whole or not at all; the same subject gives the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, TypeAlias

from blockmech.compiled import Compiled
from blockmech.draw.animation import MOVING, Animation
from blockmech.draw.boxes import graph_of
from blockmech.draw.centrodes import centrodes
from blockmech.draw.curves import Axis, abscissa, chosen_panels, pictures_of
from blockmech.draw.diagram import draw_diagram
from blockmech.draw.mechanism import draw_mechanism, draw_tile
from blockmech.draw.motion import moves, moves_of_result
from blockmech.draw.panels import draw_panels
from blockmech.draw.paper import STILL, rendered, suffix_of, write_figure
from blockmech.draw.schedule import draw_schedule
from blockmech.draw.structural import draw_structural_graph
from blockmech.ground.arguments import declared
from blockmech.ground.errors import Problem, RequestError, as_names, close_match, listed, refused
from blockmech.ground.files import AnyPath
from blockmech.ground.files import folder as whole_folder
from blockmech.ground.report import DEGREES
from blockmech.ground.runnable import Runnable
from blockmech.model.graph import Graph
from blockmech.result.result import Result

__all__ = [
    "Animation",
    "animate",
    "diagram_svg",
    "draw",
    "mechanism_svg",
    "plot",
    "run_pictures",
]


Subject: TypeAlias = Runnable
"""A graph, a linkage or a mechanism."""

KINDS = {
    "diagram": STILL,
    "mechanism": STILL,
    "animation": MOVING,
    "schedule": STILL,
    "structure": STILL,
    "centrodes": STILL,
    "tile": STILL,
}
Kind: TypeAlias = Literal[
    "diagram", "mechanism", "animation", "schedule", "structure", "centrodes", "tile"
]


@declared
def draw(
    subject: Subject,
    path: AnyPath,
    kind: Kind | None = None,
    at: Any = None,
    *,
    trace: Iterable[str] | None = None,
    degrees: bool = DEGREES,
    want: Iterable[str] | str = "*",
) -> Path:
    """Draw a graph, a linkage or a mechanism; the suffix of the path says the format.

    Parameters
    ----------
    subject : graph (for a diagram it need not be complete), linkage or mechanism
    path : .png, .svg or .pdf; .gif, .html or .mp4 (by ffmpeg) for an animation
    kind : "diagram" (default), "mechanism" at poses, "animation" (default for those),
        "schedule" of the kernel calls that some outputs take, "structure": groups with
        their number of links and the degrees of freedom they add, "centrodes" of links that
        ``want`` names, over ``at`` or the driver's range, "tile": a square mechanism without
        axes and words
    at : float or (n,) [rad or m], or a mapping driver -> (n,)
        Driver coordinates of the poses, the first in full; by default over the range
        of the drivers' laws of motion.
    trace : names of markers whose paths are drawn; by default the user's markers
    degrees : angles in the picture in degrees
    want : outputs of a schedule; links whose centrodes are drawn

    Raises
    ------
    RequestError for an unknown kind or suffix, a missing range, unknown names, or a
        place that cannot be written
    GraphError where a mechanism is wanted and the graph is not complete
    AssemblyError, SingularError where the first pose does not exist
    MissingEngineError for an .mp4 where there is no ffmpeg
    """
    if kind is None:
        kind = "animation" if Path(path).suffix.lower() in MOVING else "diagram"
    if kind not in KINDS:
        found, valid = f'no kind of picture "{kind}"', f"kinds: {listed(KINDS)}"
        near = close_match(str(kind), KINDS)
        raise refused("kind", found, near, valid, "unknown-kind")
    if kind == "animation":
        animate(subject, path, at, trace=trace, degrees=degrees)
        return Path(path)
    suffix = suffix_of(path, f"a {kind}", STILL)
    if kind == "centrodes":
        return write_figure(_centrodes_figure(subject.compile(), at, want, degrees), path, suffix)
    if kind == "mechanism":
        return write_figure(_mechanism_figure(subject, at, trace, degrees), path, suffix)
    if kind == "tile":
        return write_figure(draw_tile(subject.compile(), at), path, suffix)
    useless = "at" if at is not None else "trace" if trace is not None else ""
    if useless:
        found = f"a {'block diagram' if kind == 'diagram' else kind} has no poses"
        remedy = 'use it with kind="mechanism"'
        raise refused(useless, found, remedy, code="useless-setting")
    if kind == "diagram":
        return write_figure(_diagram_figure(subject), path, suffix)
    if kind == "structure":
        return write_figure(draw_structural_graph(subject.compile()), path, suffix)
    return write_figure(draw_schedule(subject.compile().plan(want)), path, suffix)


@declared
def diagram_svg(subject: Subject) -> str:
    """The block diagram as SVG text; the same graph gives the same text."""
    return rendered(_diagram_figure(subject), ".svg").decode()


@declared
def mechanism_svg(subject: Subject, at: Any = None, trace: Iterable[str] | None = None) -> str:
    """The mechanism at poses as SVG text; see `draw` for the arguments and errors."""
    return rendered(_mechanism_figure(subject, at, trace, True), ".svg").decode()


@declared
def animate(
    subject: Subject | Result,
    path: AnyPath | None = None,
    at: Any = None,
    *,
    frames: int = 72,
    seconds: float = 3.0,
    trace: Iterable[str] | None = None,
    degrees: bool = DEGREES,
) -> Animation:
    """Animate a mechanism over the range of its laws of motion, or the samples of a run.

    Parameters
    ----------
    subject : graph, linkage, mechanism or result
    path : .gif, .mp4 (by ffmpeg) or .html (one file, nothing is loaded from elsewhere); None only
        shows it
    at : driver coordinates of the frames, see `draw`
    frames : number of frames over the range, 2 to 2000
    seconds : time [s] that one cycle lasts on the screen
    trace, degrees : see `draw`

    Poses that do not close are left out; a motion that does not return to its start is
    played to and fro. Raises the errors of `draw`.
    """
    if path is not None:
        suffix_of(path, "an animation", MOVING)  # before anything is computed
    wrong: dict[str, tuple[object, str]] = {}
    if not isinstance(frames, int) or not 2 <= frames <= 2000:
        wrong["frames"] = frames, "a whole number from 2 to 2000"
    if not isinstance(seconds, int | float) or not 0 < seconds < math.inf:
        wrong["seconds"] = seconds, "a positive number of seconds"
    if wrong:
        raise RequestError(
            Problem("bad-value", name, f"got {value!r}", f"valid: {valid}", "")
            for name, (value, valid) in wrong.items()
        )
    if isinstance(subject, Result):
        motion = moves_of_result(subject)
    else:
        motion = moves(subject.compile(), at, samples=frames + 1)
    made = Animation(motion, seconds, trace, degrees)
    return made if path is None else made.save(path)


@declared
def run_pictures(
    result: Result, folder: AnyPath, *, over: Axis = "auto", degrees: bool = DEGREES
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
    along = abscissa(result, over, degrees)
    drawn = {name: draw_panels(panels, along) for name, panels in pictures_of(result).items()}
    with whole_folder(folder) as home:
        return [
            Path(folder) / write_figure(figure, home / f"{name}.png").name
            for name, figure in drawn.items()
        ]


@declared
def plot(
    result: Result,
    path: AnyPath,
    names: Iterable[str] | None = None,
    *,
    over: Axis = "auto",
    degrees: bool = DEGREES,
) -> Path:
    """Draw outputs of a run in one picture, one panel for each quantity.

    Parameters
    ----------
    names : outputs; by default all that the run wanted, or, if it wanted everything,
        those of `run_pictures`
    over, degrees : see `run_pictures`

    Raises `RequestError` for an unknown suffix or name, or too many curves.
    """
    suffix = suffix_of(path, "a plot", STILL)
    along = abscissa(result, over, degrees)
    if names is None and len(result) == len(result.mechanism.outputs):
        panels = tuple(p for group in pictures_of(result).values() for p in group)
    else:
        panels = chosen_panels(result, result if names is None else as_names("names", names))
    return write_figure(draw_panels(panels, along), path, suffix)


def _diagram_figure(subject: Subject) -> Any:
    """A block diagram, with the names of links and joints that it is made of."""
    if isinstance(subject, Graph):
        return draw_diagram(subject).figure
    mechanism = subject.compile()
    return draw_diagram(graph_of(mechanism), mechanism.names).figure


def _centrodes_figure(mechanism: Compiled, at: Any, want: Any, degrees: bool) -> Any:
    links = as_names("want", want)
    if links == ("*",):
        raise refused("want", "it does not name a link", 'e.g. want=["rod.i"]')
    curves = {
        name if len(links) == 1 else f"{name} of {link}": curve
        for link in links
        for name, curve in centrodes(mechanism, link, at).items()
    }
    taken = mechanism.samples(at, None if at is not None else 2, None, None, None)
    return draw_mechanism(mechanism, float(taken.inputs["q_0"][0]), None, degrees, curves).figure


def _mechanism_figure(subject: Subject, at: Any, trace: Iterable[str] | None, degrees: bool) -> Any:
    return draw_mechanism(subject.compile(), at, trace, degrees).figure
