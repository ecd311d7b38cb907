"""Pages: what every one of them is given, and how times are written."""

from __future__ import annotations

from datetime import UTC, datetime
from typing import Any

from litestar.response import Template

from dubins_traffic.service.office import Office
from dubins_traffic.service.web.viewer import Viewer

Form = dict[str, str]
TEMPLATES = "service/web/templates"


def page(office: Office, viewer: Viewer, template: str, title: str, /, **given: Any) -> Template:
    """Return a page by its template."""
    context = {"viewer": viewer, "site": office.settings.name, "title": title, "now": office.clock(), **given}
    return Template(f"{TEMPLATES}/{template}.html", context=context)


def moment(at: float | None) -> str:
    """Return a time as people read it, in UTC."""
    return "" if at is None else datetime.fromtimestamp(at, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
