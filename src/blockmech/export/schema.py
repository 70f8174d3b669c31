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
                "outputs": _map({"$ref": "#/$defs/output"}),
                "quality": {"$ref": "#/$defs/quality"},
            },
            optional=("time",),
        ),
        "$defs": {
            "value": value,
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


def _record(properties: dict[str, Any], optional: tuple[str, ...] = ()) -> dict[str, Any]:
    return {
        "type": "object",
        "properties": properties,
        "required": [name for name in properties if name not in optional],
        "additionalProperties": False,
    }


def _map(values: dict[str, Any]) -> dict[str, Any]:
    return {"type": "object", "additionalProperties": values}
