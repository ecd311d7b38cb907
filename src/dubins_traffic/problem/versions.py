"""The `version` of a document, which decides how the rest is read."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dubins_traffic.errors import InputError


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
