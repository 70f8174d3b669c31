"""How a result leaves: JSON, NumPy file, pandas, xarray, and what `Exported` derives of them.

Every format is derived from the result's own declarations (`Output`), so names and units are the
same everywhere.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Sequence
from importlib import resources
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic_core import to_json

from blockmech.ground.arguments import declared
from blockmech.ground.errors import needed
from blockmech.ground.files import AnyPath, writing
from blockmech.ground.report import as_json
from blockmech.ground.units import shown_in
from blockmech.result import spreadsheet
from blockmech.result.columns import Column, Labelled, columns, components
from blockmech.result.motion import Motion
from blockmech.result.tables import html_table, table
from blockmech.typing import Array, Data, Real

if TYPE_CHECKING:
    from pandas import DataFrame

FORMAT, VERSION = "blockmech/result", 1


def to_dict(result: Labelled) -> Data:
    """The whole result as JSON data; its schema is `result_schema`.

    SI units. Vectors are [x, y] pairs, matrices nested lists, a number of the whole
    run a list of one; a sample without an answer is None, with its reason in
    ``quality``. ``time`` [s] stands beside ``drivers`` where the request says it.

    >>> result.to_dict()["format"]
    'blockmech/result'
    """
    return {
        **_head(result),
        "outputs": {name: _output(result, name) for name in result},
        "quality": result._judged.to_dict(),
    }


def json_chunks(result: Labelled) -> Iterator[str]:
    """The JSON text of `to_dict` in pieces, one output after the other, in ASCII."""
    yield "{"
    for key, value in _head(result).items():
        yield f"{_text(key)}: {_text(value)},\n "
    yield '"outputs": {'
    for i, name in enumerate(result):
        yield (",\n  " if i else "\n  ") + f"{_text(name)}: {_text(_output(result, name))}"
    yield f'}},\n "quality": {_text(result._judged.to_dict())}}}\n'


@declared
def to_npz(result: Labelled, path: AnyPath) -> None:
    """Write all arrays to one NumPy file, atomically.

    The arrays have the outputs' names and the shapes of `Result`; ``time``, the
    driver coordinates, ``quality.status`` and ``quality.margin.<block>`` are beside
    them, ``units`` (k, 2) lists names and units. Nothing needs pickle.

    Raises `RequestError` if the path cannot be written.

    >>> to_npz(result, "run.npz")
    >>> np.load("run.npz")["crank.q"]
    array([0.5, 1. ])
    """
    arrays: Data = dict(result.drivers)
    units = {name: result._unit_of_driver(name) for name in arrays}
    time = result._known_time()
    if time is not None:
        arrays["time"], units["time"] = time, "s"
    for name in result:
        arrays[name], units[name] = np.asarray(result[name]), result._output(name).unit
    quality = result.quality
    arrays["quality.status"] = np.array(quality.status, dtype=str)
    for block, margin in quality.margin.items():
        arrays[f"quality.margin.{block}"] = margin
    arrays["units"] = np.array(list(units.items()), dtype=str)
    with writing(path) as stream:
        np.savez(stream, **arrays)


def to_dataframe(result: Labelled) -> DataFrame:
    """The columns of the CSV as a pandas DataFrame; units are in ``attrs["units"]``.

    Raises `MissingEngineError` without pandas.

    >>> result.to_dataframe().shape[0]
    2
    """
    return dataframe(columns(result), result.quality.status)


def to_xarray(result: Labelled) -> Any:
    """The result as an `xarray.Dataset` over the samples, with units.

    The dimension is the coordinate of the only driver, else "sample"; drivers' coordinates and
    the time are coordinates of the set. Vectors are complex, x + iy, with real ``.x`` and ``.y``
    beside them; ``attrs["units"]`` is spelled as pint reads it, "kg m**2". Raises
    `MissingEngineError` without xarray (extra ``study``).

    >>> result.to_xarray()["crank.drive"].attrs["units"]
    'N m'
    """
    xarray = needed("xarray", "to_xarray", "study", "a NumPy file, .npz, needs nothing")
    drivers, time = dict(result.drivers), result._known_time()
    rising = len(drivers) == 1 and len(np.unique(next(iter(drivers.values())))) == result.n
    dim = next(iter(drivers)) if rising else "sample"
    data = {name: result[name] for name in result}
    rows = {n: x for n, x in data.items() if np.ndim(x) == 1 and len(x) == result.n}
    units = {name: result._output(name).unit for name in rows}
    units |= {name: result._unit_of_driver(name) for name in drivers}
    for name in [name for name, x in rows.items() if np.iscomplexobj(x)]:
        parts = components(name, rows[name])
        rows, units = rows | parts, units | dict.fromkeys(parts, units[name])
    coords = drivers | ({} if time is None else {"time": time})
    units |= {"time": "s"} if "time" in coords else {}
    factors = {name: shown_in(unit, result._display) for name, unit in units.items()}
    variables = {n: (dim, factors[n][0] * x) for n, x in (rows | coords).items()}
    dataset = xarray.Dataset(variables, attrs={n: x for n, x in data.items() if np.ndim(x) == 0})
    for name, (_, unit) in factors.items():
        dataset[name].attrs["units"] = pint_unit(unit)
    return dataset.set_coords([*coords])


def pint_unit(unit: str) -> str:
    """A unit as pint spells it.

    >>> pint_unit("kg m2/rad")
    'kg m**2/rad'
    """
    return re.sub(r"([A-Za-z])(\d)", r"\1**\2", unit)


def dataframe(table: Sequence[Column], status: Sequence[str]) -> DataFrame:
    """Columns and a last one of words as a pandas DataFrame; see `to_dataframe`."""
    pandas = needed("pandas", "to_dataframe", "study", "to_csv needs nothing")
    frame = pandas.DataFrame({column.name: column.values for column in table})
    frame["status"] = list(status)
    frame.attrs["units"] = {column.name: column.unit for column in table}
    return frame


def _head(result: Labelled) -> Data:
    head: Data = {
        "format": FORMAT,
        "version": VERSION,
        "graph": result.mechanism.name,
        "samples": result.n,
        "drivers": {name: _values(q) for name, q in result.drivers.items()},
    }
    time = result._known_time()
    if time is not None:
        head["time"] = _values(time)
    if result.motion is not None:
        head |= _motion(result, result.motion)
    if result.accuracy is not None:
        head["accuracy"] = result.accuracy.to_dict()
    return head


def _motion(result: Labelled, motion: Motion) -> Data:
    """How a simulation moved: its events, and method, error and what ended it."""
    names = list(result.drivers)
    events = []
    for event in motion.events:
        q, qd = np.atleast_1d(event.q), np.atleast_1d(event.qd)
        states = {
            name.replace(".q", ending): x
            for values, ending in ((q, ".q"), (qd, ".rate"))
            for name, x in zip(names, values, strict=True)
        }
        events.append(as_json({"kind": event.kind, "time": event.t, **states}))
    return {"events": events, "motion": motion.to_dict()}


def _output(result: Labelled, name: str) -> Data:
    output = result._output(name)
    data = {"unit": output.unit, "values": _values(result[name])}
    if output.on:
        data |= {"by": output.by, "on": output.on}
    return data


def _values(raw: Real) -> list[object]:
    """Samples as JSON data; a sample that is not finite in any part is None."""
    table: Array = np.atleast_1d(np.asarray(raw))
    if np.iscomplexobj(table):
        table = np.stack([table.real, table.imag], axis=-1)
    table = table.astype(np.float64, copy=False)
    values: list[object] = table.tolist()
    finite = np.isfinite(table).all(axis=tuple(range(1, table.ndim)))
    for i in np.flatnonzero(~finite):
        values[i] = None
    return values


def _text(value: object) -> str:
    # The standard library takes seven times as long for long lists of numbers.
    text = to_json(value, inf_nan_mode="null").decode()
    if text.isascii():
        return text
    return re.sub(r"[^\x00-\x7f]", lambda match: json.dumps(match[0])[1:-1], text)


class Exported(Labelled):
    """Export methods of a result; each is the function of that name."""

    to_csv = spreadsheet.to_csv
    to_dataframe = to_dataframe
    to_dict = to_dict
    to_xarray = to_xarray
    _repr_html_ = html_table

    def __str__(self) -> str:
        return table(self)


def result_schema() -> Data:
    """JSON Schema (2020-12) of what `to_dict` gives."""
    text = resources.files("blockmech.result").joinpath("result.schema.json").read_text("utf-8")
    schema: Data = json.loads(text)
    return schema
