"""Numbers of a judge that take seconds, worked out once: ``tests/data/judged.json``.

A number is kept under the name of the function that works it out, with a digest of its arguments
and of all that it is worked out by: what was changed since is not kept. It is then worked out and a
warning says so, an error in the suite. To write the file anew:

    JUDGED=anew python -m pytest -n 0 tests/independent \
        tests/dynamics/test_other_formulations.py tests/dynamics/test_friction_states.py \
        tests/friction/test_enumeration.py
"""

from __future__ import annotations

import functools
import hashlib
import inspect
import json
import os
import warnings
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

FILE = Path(__file__).parents[1] / "data" / "judged.json"


def kept(*sources: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """A function whose answers are kept: numbers, or lists of such, by arguments that JSON has.

    sources : the modules that it is worked out by, and numbers that are no arguments
    """

    def of(function: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(function)
        def answer(*arguments: Any) -> Any:
            texts = [inspect.getsource(s) if isinstance(s, ModuleType) else repr(s)
                     for s in (*sources, inspect.getsource(function))]  # fmt: skip
            whole = json.dumps([*texts, arguments])
            digest = hashlib.sha256(whole.encode()).hexdigest()[:16]
            key = f"{function.__module__}.{function.__name__} {digest}"
            numbers = _numbers()
            if key not in numbers:
                numbers[key] = function(*arguments)
                if os.environ.get("JUDGED") == "anew":
                    text = json.dumps(dict(sorted(numbers.items())), indent=0)
                    FILE.with_suffix(".new").write_text(text + "\n", encoding="utf-8")
                    FILE.with_suffix(".new").replace(FILE)
                else:
                    warnings.warn(f"{key} is not kept: see tests/independent/kept.py", stacklevel=2)
            return json.loads(json.dumps(numbers[key]))

        return answer

    return of


@functools.cache
def _numbers() -> dict[str, Any]:
    """What is kept."""
    return json.loads(FILE.read_text("utf-8")) if FILE.exists() else {}
