"""The map of the extremes as a table: ``python -m tests.extremes``; kept in MAP.md."""

from __future__ import annotations

import math

from .friction import found, presses
from .measure import Row, measure
from .scenes import all_scenes

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
    print(
        "Driving moment of a press with friction by Newton, against its closed form in 60 digits.\n"
    )
    print("| press | precision | digits | told |\n|---|---|---|---|")
    for press in presses():
        for precision in ("complex128", "complex64"):
            cell = found(press, precision)
            told = ", ".join([cell.status, *cell.flags])
            digits = f"{_digits(cell.error)} ({_digits(cell.forced)})" if cell.balanced else "-"
            print(f"| {press.name} | {precision} | {digits} | {told} |")


def _cell(row: Row) -> str:
    return f"{_digits(row.error)} ({_digits(row.forced)})"


def _digits(error: float) -> str:
    return "all" if error == 0 else f"{-math.log10(error):.1f}"


if __name__ == "__main__":
    main()
