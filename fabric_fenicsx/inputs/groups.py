"""What every group of keys in a case file has in common."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, field_validator
from pydantic_core import PydanticCustomError

__all__ = ["LARGEST", "Keys", "NotNegative", "Positive"]

#: Largest size of a number, and the smallest one's inverse: far beyond any quantity in any unit, so
#: that powers and products of a few of them are still numbers of the machine.
LARGEST = 1e30

Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]


class Keys(BaseModel):
    """A group of keys: unknown ones are an error, numbers must be finite and of a usual size."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    @field_validator("*")
    @classmethod
    def _of_a_usual_size(cls, value: Any) -> Any:
        """The value; a number so large or small that its powers would be none is an error."""
        number = isinstance(value, (int, float)) and value != 0
        if number and not 1.0 / LARGEST <= abs(value) <= LARGEST:
            raise PydanticCustomError("size", "a number of a usual size")
        return value
