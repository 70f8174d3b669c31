"""Pictures: block diagrams, mechanisms at poses and in motion, curves of a run.

matplotlib is imported when something is drawn, and nothing but it is needed. A file
is written whole or not at all; the same subject gives the same bytes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from blockmech.compiled import Compiled
from blockmech.draw.animation import Animation
from blockmech.draw.boxes import graph_of
from blockmech.draw.diagram import draw_diagram
from blockmech.draw.mechanism import centrodes, draw_mechanism, draw_result, draw_tile
from blockmech.draw.motion import moves, moves_of_result
from blockmech.draw.schedule import draw_schedule
from blockmech.draw.structural import draw_structural_graph
from blockmech.figures.curves import Axis, abscissa, pictures_of, plot, with_reversals
from blockmech.figures.panels import draw_panels
from blockmech.figures.paper import MOVING, STILL, put_in, suffix_of, svg, write_figure
from blockmech.ground.arguments import declared
from blockmech.ground.errors import (
    among,
    as_names,
    listed,
    refused,
)
from blockmech.ground.files import AnyPath
from blockmech.ground.files import folder as whole_folder
from blockmech.ground.runnable import Runnable
from blockmech.model.graph import Graph
from blockmech.model.joints.linkage import Linkage
from blockmech.result.result import Result
from blockmech.typing import Coordinates

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["Animation", "animate", "draw", "plot", "run_pictures", "svg"]
__dir__ = __all__.copy  # completion shows these alone


Subject: TypeAlias = Runnable
"""A graph, a linkage or a mechanism."""


class Kind(NamedTuple):
    """A kind of picture.

    about : what it is, in a few words
    figure : draws a subject
    takes : the arguments of `draw` that it takes
    """

    about: str
    figure: Callable[..., Any]
    takes: tuple[str, ...] = ()


def default_kind(subject: Subject, path: AnyPath | None, posed: bool) -> str:
    """The kind of picture that suits a file, poses where some are asked for, and a document."""
    if path is not None and Path(path).suffix.lower() in MOVING:
        return "animation"
    names = subject.names if isinstance(subject, Compiled) else None
    by_links = isinstance(subject, Linkage) or names is not None
    return "mechanism" if posed or by_links else "diagram"


@declared
def draw(
    subject: Subject,
    path: AnyPath | None = None,
    kind: str | None = None,
    at: Coordinates | None = None,
    *,
    trace: Iterable[str] | None = None,
    unit: Iterable[str] | str = (),
    want: Iterable[str] | str = "*",
    ax: Axes | None = None,
) -> Any:
    """Draw a graph, a linkage or a mechanism; the suffix of the path says the format.

    Parameters
    ----------
    subject : graph (for a diagram it need not be complete), linkage or mechanism
    path : .png, .svg or .pdf; .gif, .html or .mp4 (by ffmpeg) for an animation; by default
        no file is written
    kind : one of `KINDS`: "diagram" (default of blocks), "mechanism" (default of links and
        joints, and with ``at``, ``trace`` or ``unit``), "animation" (default for its suffixes),
        "schedule", "structure", "centrodes", "tile"
    at : float or (n,) [rad or m], or a mapping driver -> (n,)
        Driver coordinates of the poses, the first in full; by default over the range
        of the drivers' laws of motion.
    trace : names of markers whose paths are drawn; by default the user's markers
    unit : units of the lengths and angles in the picture, e.g. "mm"; by default m and degrees
    want : outputs of a schedule; links whose centrodes are drawn
    ax : axes to put the picture in; those of a mechanism then have its unit of length

    Returns matplotlib's figure, or the `Animation`.

    Raises
    ------
    RequestError for an unknown kind or suffix, a missing range, unknown names, or a path that
        cannot be written
    GraphError for a picture of a mechanism whose graph is incomplete
    AssemblyError, SingularError where the first pose does not exist
    MissingEngineError for an .mp4 where there is no ffmpeg

    >>> figure = bm.draw.draw(mech, "pose.svg", at="30deg")
    """
    posed = at is not None or trace is not None or bool(unit)
    kind = kind or default_kind(subject, path, posed)
    among(KINDS, "kind", kind, "unknown-kind", "kind")
    moving = kind == "animation"
    suffix = ""
    if path is not None:  # before anything is computed
        suffix = suffix_of(path, f"a{'n' * moving} {kind}", MOVING if moving else STILL)
    arguments = {"at": at, "trace": trace, "want": want, "unit": unit}
    requested = {"at": at is not None, "trace": trace is not None, "want": want != "*"}
    requested |= {"unit": bool(unit), "ax": moving and ax is not None}
    for name, is_requested in requested.items():
        if is_requested and name not in KINDS[kind].takes:
            takers = listed(f'kind="{k}"' for k in KINDS if name in KINDS[k].takes)
            message = f'a picture of the kind "{kind}" takes no {name}='
            remedy = f"use it with {takers}" if takers else "leave it out"
            raise refused(name, message, remedy, code="useless-setting")
    figure = KINDS[kind].figure(subject, **{name: arguments[name] for name in KINDS[kind].takes})
    if path is not None:
        figure.save(path) if moving else write_figure(figure, path, suffix)
    return figure if ax is None else put_in(figure, ax)


@declared
def animate(
    subject: Subject | Result,
    path: AnyPath | None = None,
    at: Coordinates | None = None,
    *,
    frames: int = 72,
    seconds: float = 3.0,
    trace: Iterable[str] | None = None,
    unit: Iterable[str] | str = (),
) -> Animation:
    """Animate a mechanism over the range of its laws of motion, or the samples of a run.

    Parameters
    ----------
    subject : graph, linkage, mechanism or result
    path : .gif, .mp4 (by ffmpeg) or .html (one self-contained file); None shows it without a file
    at : driver coordinates of the frames, see `draw`
    frames : number of frames over the range, 2 to 2000
    seconds : duration [s] of one cycle on the screen
    trace, unit : see `draw`; of a result the units are those of `Result.to`

    Poses that do not close are left out; a motion that does not return to its start is played
    forwards and backwards. Raises the errors of `draw`.

    >>> bm.draw.animate(mech, "turn.html", frames=4)
    <Animation of ruiz_fourbar: 4 frames>
    """
    if path is not None:
        suffix_of(path, "an animation", MOVING)  # before anything is computed
    if not 2 <= frames <= 2000:
        raise refused("frames", f"got {frames!r}", "give a whole number from 2 to 2000")
    if not 0 < seconds < math.inf:
        raise refused("seconds", f"got {seconds!r}", "give a positive number of seconds")
    if isinstance(subject, Result):
        motion = moves_of_result(subject)
    else:
        motion = moves(subject.compile(), at, samples=frames + 1)
        if at is None and motion.result.n == 1:
            message = "no law of motion says how far its drivers move"
            remedy = "give every driver a law, poses by at=, or animate the result of simulate()"
            raise refused(motion.mechanism.name, message, remedy, code="no-range")
    units = as_names("unit", unit) or motion.display
    animation = Animation(motion.to(*units), seconds, trace)
    return animation if path is None else animation.save(path)


@declared
def run_pictures(result: Result, folder: AnyPath, *, over: Axis = "auto") -> list[Path]:
    """Write the pictures of a run: one for each kind of curve that it has.

    ``drive.png``, ``friction_power.png`` and ``reactions.png`` ([R10] Figs. 12-14), with
    the curves without friction beside; ``kinematics.png`` for a mechanism without forces;
    ``mechanism.png``, the mechanism in poses of the run.

    Parameters
    ----------
    result : the run; outputs that it did not compute are not drawn
    folder : made if it is missing
    over : driver coordinate or time; "auto" takes the one by which the samples were requested

    Raises `RequestError` where the folder cannot be written, or times are not known.

    >>> [path.name for path in bm.draw.run_pictures(result, "pictures")]
    ['drive.png', 'friction_power.png', 'reactions.png', 'mechanism.png']
    """
    curves = with_reversals(result)
    axis = abscissa(curves, over)
    figures = {name: draw_panels(row, axis) for name, row in pictures_of(curves).items()}
    if len(result.quality.gaps) < result.n:
        figures["mechanism"] = draw_result(result).figure
    with whole_folder(folder) as home:
        return [
            Path(folder) / write_figure(figure, home / f"{name}.png").name
            for name, figure in figures.items()
        ]


def _diagram(subject: Subject) -> Any:
    """A block diagram, with the names of links and joints that it is made of."""
    if isinstance(subject, Graph):
        return draw_diagram(subject).figure
    mechanism = subject.compile()
    return draw_diagram(graph_of(mechanism), mechanism.names).figure


def _mechanism(subject: Subject, unit: Iterable[str] | str = (), **poses: Any) -> Any:
    return draw_mechanism(subject.compile(), **poses, display=as_names("unit", unit)).figure


def _schedule(subject: Subject, want: Iterable[str] | str) -> Any:
    return draw_schedule(subject.compile().plan(want))


def _structure(subject: Subject) -> Any:
    return draw_structural_graph(subject.compile())


def _tile(subject: Subject, at: Coordinates | None) -> Any:
    return draw_tile(subject.compile(), at)


def _centrodes(subject: Subject, at: Coordinates | None, want: Any, unit: Any) -> Any:
    mechanism: Compiled = subject.compile()
    links = as_names("want", want)
    if links == ("*",):
        raise refused("want", "it does not name a link", 'e.g. want=["rod.i"]')
    curves = {
        name if len(links) == 1 else f"{name} of {link}": curve
        for link in links
        for name, curve in centrodes(mechanism, link, at).items()
    }
    samples = mechanism.samples(at, None if at is not None else 2, None, None, None)
    pose = float(samples.inputs["q_0"][0])
    return draw_mechanism(mechanism, pose, None, curves, display=as_names("unit", unit)).figure


KINDS: Mapping[str, Kind] = {
    "diagram": Kind("the block diagram", _diagram),
    "mechanism": Kind("the mechanism at poses", _mechanism, ("at", "trace", "unit")),
    "animation": Kind("the mechanism in motion", animate, ("at", "trace", "unit")),
    "schedule": Kind("the kernel calls that some outputs take", _schedule, ("want",)),
    "structure": Kind("groups, their links and the degrees of freedom they add", _structure),
    "centrodes": Kind("centrodes of links over poses", _centrodes, ("at", "want", "unit")),
    "tile": Kind("a square mechanism without axes and words", _tile, ("at",)),
}
