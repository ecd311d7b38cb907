"""Turns the errors of pydantic into `InputError`: file, field, value, expectation."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar, cast

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from dubins_traffic.errors import InputError

M = TypeVar("M", bound=BaseModel)
_EXPECTED = {
    "missing": "this key",
    "int_type": "an integer",
    "int_parsing_size": "an integer",
    "float_type": "a number",
    "finite_number": "a finite number",
    "string_type": "a text",
    "bool_type": "true or false",
    "list_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
    "model_attributes_type": "an object",
    "greater_than": "a number > {gt}",
    "greater_than_equal": "a number >= {ge}",
    "less_than": "a number < {lt}",
    "less_than_equal": "a number <= {le}",
    "too_short": "at least {min_length} items",
    "too_long": "at most {max_length} items",
    "string_pattern_mismatch": "a text matching {pattern}",
    "literal_error": "{expected}",
}
ALIKE = 0.8
"""Similarity of two keys (2 matches / characters) from which one counts as the other misspelt."""


class Strict(BaseModel):
    """Base of all models: exact types (no true for 1, no 1.0 for 1), finite numbers, unknown keys refused."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)


class Open(Strict):
    """Base of models of documents whose unknown keys are kept."""

    model_config = ConfigDict(extra="allow")


class Careful(Open):
    """Like `Open`, but a key that looks like a known one misspelt is refused, since it would have no effect."""

    @model_validator(mode="before")
    @classmethod
    def _spelt(cls, document: object) -> object:
        if isinstance(document, dict):
            keys = cast(dict[object, object], document)
            known = [info.alias or name for name, info in cls.model_fields.items()]
            for key, value in keys.items():
                near = get_close_matches(str(key), known, n=1, cutoff=ALIKE)
                if near and key not in known and near[0] not in keys:
                    raise fault("unknown key", f"{near[0]}, or a key less like it", str(key), value)
        return cast(object, document)


def fault(problem: str, expected: str, field: str = "", value: object = None) -> PydanticCustomError:
    """Return the error that a validator raises: what is wrong, and what would have been right.

    `field` and `value` say which part of the validated value is to blame, if not all of it.
    """
    context = {"problem": problem, "expected": expected, "field": field, "value": value}
    return PydanticCustomError("fault", "{problem}", context)


def more_faults(count: int) -> str:
    """Return the end of a message about the first of several faults: how many more there are."""
    return f" (and {count} more fault{'s' if count > 1 else ''})"


def parse(model: type[M], document: object, *, file: str | None = None, field: str | None = None) -> M:
    """Return `document` as a `model`.

    Raises
    ------
    InputError
        For the first thing wrong, below `field`; says how many more there are. A key that is unknown comes before one
        that is missing, which it may be, misspelt.
    """
    try:
        return model.model_validate(document)
    except ValidationError as error:
        details = sorted(error.errors(include_url=False), key=lambda one: one["type"] == "missing")
        first = _translate(model, details[0])
        if len(details) > 1:
            first.problem += more_faults(len(details) - 1)
        raise first.within(file=file, field=field) from None


def field_path(location: Sequence[int | str]) -> str:
    """Return a path such as ``rnd.segments[3]``.

    Examples
    --------
    >>> field_path(("e-agents", 0, "name"))
    'e-agents[0].name'
    """
    path = ""
    for part in location:
        if isinstance(part, int):
            path += f"[{part}]"
        else:
            path += f".{part}" if path else part
    return path


def _translate(model: type[BaseModel], detail: ErrorDetails) -> InputError:
    kind = detail["type"]
    context: Mapping[str, Any] = detail.get("ctx", {})
    field = field_path(detail["loc"]) or None
    if kind == "missing":
        return InputError("missing", field=field, expected=_description(model, detail["loc"]))
    if kind == "fault":
        below = context["field"]
        error = InputError(
            context["problem"],
            field=below or None,
            value=context["value"] if below else detail["input"],
            expected=context["expected"],
        )
        return error.within(field=field)
    if kind == "extra_forbidden":
        problem, expected = "unknown key", _known_keys(model, detail["loc"])
    else:
        problem = "wrong value"
        expected = _EXPECTED.get(kind, detail["msg"]).format(**context)
    return InputError(problem, field=field, value=detail["input"], expected=expected)


def _owner(model: type[BaseModel], location: Sequence[int | str]) -> type[BaseModel] | None:
    """Return the model in which the last key of `location` stands."""
    current: type[BaseModel] | None = model
    for part in location[:-1]:
        if isinstance(part, int) or current is None:
            continue
        known = [info for name, info in current.model_fields.items() if (info.alias or name) == part]
        current = _inner(known[0].annotation) if known else None
    return current


def _inner(annotation: Any) -> type[BaseModel] | None:
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return annotation
    for argument in getattr(annotation, "__args__", ()):
        model = _inner(argument)
        if model is not None:
            return model
    return None


def _known_keys(model: type[BaseModel], location: Sequence[int | str]) -> str:
    owner = _owner(model, location)
    names = [info.alias or name for name, info in owner.model_fields.items()] if owner else []
    near = get_close_matches(str(location[-1]), names, n=1)
    if near:
        return ", or one of ".join((near[0], ", ".join(name for name in names if name != near[0])))
    return "one of " + ", ".join(names) if names else "no such key"


def _description(model: type[BaseModel], location: Sequence[int | str]) -> str:
    owner = _owner(model, location)
    if owner is not None:
        for name, info in owner.model_fields.items():
            if (info.alias or name) == location[-1] and info.description:
                return info.description
    return _EXPECTED["missing"]


def version_of(document: Mapping[str, Any], file: str | None = None, known: Sequence[int] = (0, 1)) -> int:
    """Return the version of `document`.

    Raises
    ------
    InputError
        If there is none or it is not one of `known`.
    """
    expected = " or ".join(str(version) for version in known)
    if "version" not in document:
        raise InputError("missing", file=file, field="version", expected=expected)
    version: object = document["version"]
    if isinstance(version, bool) or not isinstance(version, int) or version not in known:
        raise InputError("unknown version", file=file, field="version", value=version, expected=expected)
    return version
