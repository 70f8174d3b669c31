"""JSON Schema of a result file."""

from __future__ import annotations

from typing import Any

STATUS = ("ok", "no-assembly", "not-converged", "self-locked", "jammed")


def result_schema() -> dict[str, Any]:
    """JSON Schema (2020-12) of what `to_dict` gives."""
    number = {"type": ["number", "null"]}
    value = {
        "description": "one sample: a number, [x, y], a matrix; null without an answer",
        "anyOf": [
            number,
            {"type": "array", "items": {"$ref": "#/$defs/value"}},
        ],
    }
    by_block = _map({"type": "array", "items": number})
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "blockmech result, version 1",
        **_record(
            {
                "format": {"const": "blockmech/result"},
                "version": {"const": 1},
                "graph": {"type": "string", "description": "name of the mechanism"},
                "samples": {"type": "integer", "minimum": 0},
                "drivers": _map({"type": "array", "items": {"type": "number"}}),
                "time": {
                    "type": "array",
                    "items": number,
                    "description": "[s], where the request says it",
                },
                "events": {
                    "type": "array",
                    "items": {"$ref": "#/$defs/event"},
                    "description": "of a simulation, in the order of time",
                },
                "motion": {"$ref": "#/$defs/motion"},
                "accuracy": {"$ref": "#/$defs/accuracy"},
                "outputs": _map({"$ref": "#/$defs/output"}),
                "quality": {"$ref": "#/$defs/quality"},
            },
            optional=("time", "events", "motion", "accuracy"),
        ),
        "$defs": {
            "value": value,
            "accuracy": _record(
                {
                    "target": {"type": "number", "description": "wanted error"},
                    "estimate": {**number, "description": "estimated error of the worst output"},
                    "reached": {"type": "boolean"},
                    "friction": {"type": "string"},
                    "iterations": {"type": ["integer", "null"]},
                    "precision": {"type": "string"},
                    "why": {"type": "string"},
                }
            ),
            "output": _record(
                {
                    "unit": {"type": "string", "description": "SI; empty where dimensionless"},
                    "values": {"type": "array", "items": {"$ref": "#/$defs/value"}},
                    "by": {"type": "string", "description": "the link that acts"},
                    "on": {"type": "string", "description": "the link that is acted on"},
                },
                optional=("by", "on"),
            ),
            "quality": _record(
                {
                    "status": {"type": "array", "items": {"enum": list(STATUS)}},
                    "margin": by_block,
                    "iterations": _map({"type": "array", "items": {"type": "integer"}}),
                    "residual": by_block,
                    "contraction": by_block,
                    "flags": {"type": "array", "items": {"$ref": "#/$defs/flag"}},
                }
            ),
            "event": _event(number),
            "motion": _motion(number),
            "flag": _record(
                {
                    "sample": {"type": "integer", "minimum": 0},
                    "code": {"type": "string"},
                    "where": {"type": "string", "description": "a block or a joint"},
                    "interval": {
                        "type": "array",
                        "items": {"type": "number"},
                        "minItems": 2,
                        "maxItems": 2,
                    },
                    "value": {"type": "number"},
                },
                optional=("interval", "value"),
            ),
        },
    }


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
            "notes": {"type": "array", "items": {"type": "string"}},
            "facts": _map(number),
        }
    )


def _record(properties: dict[str, Any], optional: tuple[str, ...] = ()) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": properties,
        "required": [name for name in properties if name not in optional],
        "additionalProperties": False,
    }


def _map(values: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "additionalProperties": values}
