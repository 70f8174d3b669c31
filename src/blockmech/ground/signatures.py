"""What inspect, notebooks and editors show of a model: its fields, as a call takes them."""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING

from pydantic import BaseModel


class FieldsByKeyword(type(BaseModel)):  # type: ignore[misc]
    """The class of models, whose signature is what a call of theirs takes."""

    @property
    def __signature__(cls) -> inspect.Signature:
        kind, empty = inspect.Parameter.KEYWORD_ONLY, inspect.Parameter.empty
        fields = [(n, x) for n, x in cls.model_fields.items() if n != cls.kind_key]
        fields.sort(key=lambda field: not field[1].is_required())
        defaults = {
            name: empty if x.is_required() else x.get_default(call_default_factory=True)
            for name, x in fields
        }
        parameters = [inspect.Parameter(n, kind, default=x) for n, x in defaults.items()]
        return inspect.Signature(parameters)

    @__signature__.setter
    def __signature__(cls, signature: object) -> None:
        """Leave pydantic's own, which repeats the checks of each field, unused."""


if TYPE_CHECKING:  # type checkers know pydantic's class alone
    Signed = BaseModel
else:

    class Signed(BaseModel, metaclass=FieldsByKeyword):
        """A model that shows its fields as a function shows its arguments."""
