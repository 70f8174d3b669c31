"""The map of the extremes as a table: ``python -m tests.extremes``; kept in MAP.md."""

from __future__ import annotations

import math
import signal
from typing import Any

from . import edges, near
from .friction import found, presses, rockers, slopes, solved
from .measure import Row, measure
from .motions import all_motions, moved
from .scenes import all_scenes

PATIENCE = 20  # [s] of processor time for a motion
KINDS = ("p", "v", "a", "omega", "alpha", "reaction", "drive")


def main() -> None:
    """The table: correct digits per kind of output, and those that the data allow."""
    print("# Measured digits at the extremes\n")
    print("Correct decimal digits, relative to the largest of their kind, against the same plan in")
    print("60 digits; in brackets what half an ulp in the parameters leaves. Made by")
    print("`python -m tests.extremes`.\n")
    print("| scene | precision | margin | " + " | ".join(KINDS) + " |")
    print("|" + "---|" * (len(KINDS) + 3))
    for scene in all_scenes():
        for precision in scene.precisions:
            rows = {r.kind: r for r in measure(scene, precision)}
            cells = [_cell(rows[k]) if k in rows else "-" for k in KINDS]
            margin = next(iter(rows.values())).margin
            print(f"| {scene.name} | {precision} | {margin:.1e} | {' | '.join(cells)} |")

    print("\n## Joint friction\n")
    print("Driving moment of a press, and of a rocker by a dyad or a general group, with friction")
    print("by Newton, against its closed form in 60 digits.\n")
    print("| press | precision | digits | told |\n|---|---|---|---|")
    rubbing = [*presses(), *rockers()]
    for press in rubbing:
        for precision in ("complex128", "complex64"):
            cell = found(press, precision)
            told = ", ".join([cell.status, *cell.flags])
            digits = f"{_digits(cell.error)} ({_digits(cell.forced)})" if cell.balanced else "-"
            print(f"| {press.name} | {precision} | {digits} | {told} |")

    print("\n### All solutions\n")
    print("| press | solutions found | there are | digits | complete |\n|---|---|---|---|---|")
    for press in rubbing:
        all_of = solved(press)
        digits = f"{_digits(all_of.error)} ({_digits(all_of.forced)})" if all_of.true else "-"
        print(f"| {press.name} | {all_of.found} | {all_of.true} | {digits} | {all_of.proof} |")

    print("\n### Derivatives\n")
    print(
        "Of the driving moment, by lengths and the guide's coefficient; relative to the largest.\n"
    )
    print("| press | digits |\n|---|---|")
    for press in rubbing:
        if press.addresses and found(press, "complex128").balanced:
            error, forced = slopes(press)
            print(f"| {press.name} | {_digits(error)} ({_digits(forced)}) |")

    print("\n## Limits, modes, steady states\n")
    print("Ends of the arcs of a four-bar [rad], by limits and by modes.\n")
    print("| four-bar | error | forced | told |\n|---|---|---|---|")
    for bar in edges.turning():
        arcs = edges.ends_of(bar)
        told = ["turns fully" if arcs.told else "arcs", f"circuits {arcs.circuits}"]
        told += ["change point"] if arcs.change_point else []
        ended = arcs.left_out and not arcs.told
        errors = f"{arcs.error:.0e} | {arcs.forced:.0e}" if ended else "- | -"
        print(f"| {bar.name} | {errors} | {', '.join(told)} |")
    print("\nPeriod of the steady turn, relative: error, and what it says it is.\n")
    print("| wheel | error | estimate |\n|---|---|---|")
    for wheel in edges.wheels():
        state = edges.steady_of(wheel)
        print(f"| {wheel.name} | {state.error:.0e} | {state.estimate:.0e} |")

    print("\n## Beside change points, and joints almost in one place\n")
    print("Digits of a pin's place and velocity against their closed forms in 60 digits.\n")
    print("| pose | place | velocity | told |\n|---|---|---|---|")
    for case in near.cases():
        pin = near.found(case)
        digits = f"{_digits(pin.place)} | {_digits(pin.velocity)}"
        print(f"| {case.name} | {digits if pin.is_answer else '- | -'} | {pin.told} |")

    print("\n## Motions\n")
    print("Where a motion is at its end, against its closed form in 60 digits: error and estimate")
    print("[rad or m], evaluations, processor time, and what the user is told.\n")
    print(
        "| motion | error | estimate | evaluations | time [s] | told |\n|---|---|---|---|---|---|"
    )
    signal.signal(signal.SIGVTALRM, _too_long)
    for motion in all_motions():
        signal.setitimer(signal.ITIMER_VIRTUAL, PATIENCE)
        try:
            at = moved(motion)
            error = f"{at.error:.0e}" if at.is_answer else "-"
            cost = f"{at.evaluations} | {at.seconds:.1f}"
            print(f"| {motion.name} | {error} | {at.estimate:.0e} | {cost} | {at.told} |")
        except TimeoutError:
            print(f"| {motion.name} | - | - | - | > {PATIENCE} | its progress, by a bar |")
        finally:
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)


def _too_long(signum: int, frame: Any) -> None:
    raise TimeoutError


def _cell(row: Row) -> str:
    return f"{_digits(row.error)} ({_digits(row.forced)})"


def _digits(error: float) -> str:
    return "all" if error == 0 else f"{-math.log10(error):.1f}"


if __name__ == "__main__":
    main()
