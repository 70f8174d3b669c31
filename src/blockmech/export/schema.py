"""JSON Schema of a result file."""

from __future__ import annotations

from typing import Any

STATUS = ("ok", "no-assembly", "not-converged", "self-locked", "jammed")


def result_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of what `to_dict` gives."""
    number = {"type": ["number", "null"]}
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "blockmech result, version 1",
        **_result(number),
        "$defs": {
            "value": _value(number),
            "accuracy": _accuracy(number),
            "output": _output(),
            "quality": _quality(number),
            "event": _event(number),
            "motion": _motion(number),
            "flag": _flag(),
        },
    }


def _result(number: dict[str, Any]) -> dict[str, Any]:
    """The whole: what was run, and what it gave."""
    return _record(
        {
            "format": {"const": "blockmech/result"},
            "version": {"const": 1},
            "graph": {"type": "string", "description": "name of the mechanism"},
            "samples": {"type": "integer", "minimum": 0},
            "drivers": _map(_row({"type": "number"})),
            "time": {**_row(number), "description": "[s], where the request says it"},
            "events": {
                **_row(_def("event")),
                "description": "of a simulation, in the order of time",
            },
            "motion": _def("motion"),
            "accuracy": _def("accuracy"),
            "outputs": _map(_def("output")),
            "quality": _def("quality"),
        },
        optional=("time", "events", "motion", "accuracy"),
    )


def _value(number: dict[str, Any]) -> dict[str, Any]:
    """An output at one sample."""
    return {
        "description": "one sample: a number, [x, y], a matrix; null without an answer",
        "anyOf": [number, _row(_def("value"))],
    }


def _accuracy(number: dict[str, Any]) -> dict[str, Any]:
    """What was chosen for a wanted accuracy."""
    return _record(
        {
            "target": {"type": "number", "description": "wanted error"},
            "estimate": {**number, "description": "estimated error of the worst output"},
            "reached": {"type": "boolean"},
            "friction": {"type": "string"},
            "iterations": {"type": ["integer", "null"]},
            "precision": {"type": "string"},
            "why": {"type": "string"},
        }
    )


def _output() -> dict[str, Any]:
    """An output at all samples; a force says who acts on whom."""
    return _record(
        {
            "unit": {"type": "string", "description": "SI; empty where dimensionless"},
            "values": _row(_def("value")),
            "by": {"type": "string", "description": "the link that acts"},
            "on": {"type": "string", "description": "the link that is acted on"},
        },
        optional=("by", "on"),
    )


def _quality(number: dict[str, Any]) -> dict[str, Any]:
    """How good the samples are; by block where a map."""
    by_block = _map(_row(number))
    return _record(
        {
            "status": _row({"enum": list(STATUS)}),
            "margin": by_block,
            "iterations": _map(_row({"type": "integer"})),
            "residual": by_block,
            "contraction": by_block,
            "flags": _row(_def("flag")),
        }
    )


def _flag() -> dict[str, Any]:
    """A doubt about one sample."""
    return _record(
        {
            "sample": {"type": "integer", "minimum": 0},
            "code": {"type": "string"},
            "where": {"type": "string", "description": "a block or a joint"},
            "interval": {**_row({"type": "number"}), "minItems": 2, "maxItems": 2},
            "value": {"type": "number"},
        },
        optional=("interval", "value"),
    )


def _event(number: dict[str, Any]) -> dict[str, Any]:
    """Something that happened: beside kind and time the state, ``<driver>.q`` and ``.rate``."""
    return {
        "type": "object",
        "properties": {
            "kind": {"type": "string"},
            "time": {"type": "number", "description": "[s]"},
        },
        "required": ["kind", "time"],
        "additionalProperties": number,
    }


def _motion(number: dict[str, Any]) -> dict[str, Any]:
    """How a simulation moved."""
    return _record(
        {
            "method": {"type": "string"},
            "why": {"type": "string"},
            "regime": {"type": "string"},
            "status": {"enum": ["reached", "ended", "rest", "failed"]},
            "end": {"type": "string", "description": "the named reason"},
            "end_time": {**number, "description": "[s]"},
            "error": {**number, "description": "estimated bound [rad or m]"},
            "time_error": {**number, "description": "of the end [s]"},
            "accuracy": {**number, "description": "the target, null without one"},
            "reached": {"type": "boolean", "description": "whether the target is met"},
            "evaluations": {"type": "integer", "minimum": 0},
            "notes": _row({"type": "string"}),
            "facts": _facts(number),
        }
    )


def _facts(number: dict[str, Any]) -> dict[str, Any]:
    """Further numbers of a motion, with the units of those that have one."""
    from blockmech.dynamics.motion import FACT_UNITS, fact_unit

    def said(name: str) -> str:
        return " or ".join(dict.fromkeys(fact_unit(name, q) for q in ("rad", "m")))

    known = {name: {**number, "description": f"[{said(name)}]"} for name in FACT_UNITS}
    return {**_map(number), "properties": known}


def _record(properties: dict[str, Any], optional: tuple[str, ...] = ()) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": properties,
        "required": [name for name in properties if name not in optional],
        "additionalProperties": False,
    }


def _map(values: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "additionalProperties": values}


def _row(items: dict[str, Any]) -> dict[str, Any]:
    return {"type": "array", "items": items}


def _def(name: str) -> dict[str, Any]:
    return {"$ref": f"#/$defs/{name}"}
