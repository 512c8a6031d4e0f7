"""Laws in a case: one group of keys for each, made of the law's own declarations.

Moments of a crossing are per area of fabric, as everywhere in a case, and bending moments per
width; angles in degrees.
"""

from __future__ import annotations

from dataclasses import MISSING
from functools import reduce
from operator import or_
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal, cast

from pydantic import Field, ValidationInfo, create_model, field_validator, model_validator

from ..errors import InputError
from ..inputs.groups import Keys
from ..inputs.python_file import classes_of, run_file
from ..inputs.validation import mistakes
from ..mechanics.bending_laws import BENDING_LAWS, BendingLaw
from ..mechanics.laws import LAWS
from ..mechanics.laws.law import CrossingLaw, Declared
from ..mechanics.laws.trial import try_out

__all__ = ["BendingLawKeys", "ShearLawKeys"]


class LawKeys(Keys):
    """Keys of a law."""

    of: ClassVar[type[Declared]]

    @model_validator(mode="after")
    def _goes_together(self) -> LawKeys:
        self.build(1.0)
        return self

    def build(self, area: float = 1.0) -> Any:
        """The law, of a crossing one that stands for ``area`` [mm²]."""
        return self.of.of_case(self.model_dump(), area)


def _keys(of: type[Declared], **more: Any) -> type[LawKeys]:
    """The model of a law's keys."""
    given: dict[str, Any] = more | {
        number.key: (
            number.allowed,
            Field(... if number.default is MISSING else number.default, description=number.meaning),
        )
        for number in of.numbers().values()
    }
    model = create_model(f"{of.__name__}Keys", __base__=LawKeys, **given)
    model.of = of
    return model


def _named(of: type[CrossingLaw] | type[BendingLaw]) -> type[LawKeys]:
    """The keys of a law that has a name in a case; what it is says its docstring."""
    about = (of.__doc__ or of.law).partition("\n\n")[0].removesuffix(".")
    return _keys(of, law=(Literal[of.law], Field(description=about)))


class OwnLawKeys(Keys):
    """A law of the user's own."""

    law: Literal["own"] = Field(description="A law of your own, see docs/laws.md")
    file: str = Field(
        description="Python file with a subclass of CrossingLaw, from the case's folder. Is run"
    )
    name: str | None = Field(None, description="of the class, where the file has several")
    values: dict[str, Any] = Field({}, description="of the keys that the law declares")

    @field_validator("file")
    @classmethod
    def _from_the_case(cls, file: str, info: ValidationInfo) -> str:
        return str((info.context or {}).get("base", Path()) / file)

    @model_validator(mode="after")
    def _goes_together(self) -> OwnLawKeys:
        try:
            self.build(1.0)
        except InputError as error:
            raise ValueError(error) from error
        return self

    def build(self, area: float) -> CrossingLaw:
        """The law of a crossing that stands for ``area`` [mm²].

        Raises:
            InputError: the file cannot be run, or its law does not take these values, or has no
                moment with them.
        """
        path = Path(self.file)
        found = classes_of(run_file(path, "a subclass of CrossingLaw"), CrossingLaw)
        laws = [law for law in found if self.name in (None, law.__name__)]
        if len(laws) != 1:
            names = ", ".join(law.__name__ for law in found) or "none"
            named = "" if self.name is None else f" of the name {self.name}"
            raise InputError(f"{path}: {names}, allowed is one subclass of CrossingLaw{named}")
        keys, problems = mistakes(_keys(laws[0]), self.values)
        if problems:
            raise InputError(f"values: {problems[0][1]}")
        law: CrossingLaw = cast(LawKeys, keys).build(area)
        try:
            try_out(law)
        except ValueError as error:
            raise InputError(f"{path}: {error}") from error
        return law


NAMED = {of.__name__ + "Keys": _named(of) for of in LAWS.values()}
BENDING = {of.__name__ + "Keys": _named(of) for of in BENDING_LAWS.values()}
# A case goes from rank to rank by pickle, which looks classes up in their module.
globals().update(NAMED | BENDING)

if TYPE_CHECKING:
    ShearLawKeys = LawKeys | OwnLawKeys
    BendingLawKeys = LawKeys
else:
    BendingLawKeys = Annotated[reduce(or_, BENDING.values()), Field(discriminator="law")]
    ShearLawKeys = Annotated[reduce(or_, [*NAMED.values(), OwnLawKeys]), Field(discriminator="law")]
