"""Pieces of HTML: Jinja2 templates, with every value escaped unless it is Markup."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from vgyro.report import colours


@cache
def environment() -> Environment:
    """The one environment of all templates."""
    made = Environment(
        loader=PackageLoader("vgyro.report"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=False,
    )
    made.globals["light"] = colours.variables(dark=False)
    made.globals["dark"] = colours.variables(dark=True)
    made.globals["colour_marks"] = colours.marks()
    return made


def macro(name: str, **values: object) -> Markup:
    """HTML of one macro of templates/fragments.html."""
    return Markup(getattr(environment().get_template("fragments.html").module, name)(**values).strip())


def paragraph(text: str, tone: str = "") -> Markup:
    """A paragraph. tone : "", note, warn, bad"""
    return macro("paragraph", text=text, tone=tone)


def bullets(texts: Sequence[str], tone: str = "") -> Markup:
    """A list of sentences; empty text for an empty list."""
    return macro("bullets", texts=tuple(texts), tone=tone) if texts else Markup("")


def definitions(pairs: Sequence[tuple[str, str]]) -> Markup:
    """Names and what they stand for."""
    return macro("definitions", pairs=tuple(pairs))


def heading(text: str, level: int = 3, identifier: str = "") -> Markup:
    """A heading inside a section."""
    return macro("heading", text=text, level=level, identifier=identifier)


def details(summary: str, html: Markup, *, opened: bool = False, identifier: str = "", badge: str = "") -> Markup:
    """A part that opens on demand."""
    return macro("details", summary=summary, html=html, opened=opened, identifier=identifier, badge=badge)


def badge(text: str, tone: str = "") -> Markup:
    """A short word in a box. tone : "", good, bad, warn"""
    return macro("badge", text=text, tone=tone)


def link(text: str, target: str) -> Markup:
    """A link to an identifier of this page (#…) or to a file beside it."""
    return macro("link", text=text, target=target)


def print_button(text: str, target: str) -> Markup:
    """A button that prints one part of the page alone. target : identifier of the part"""
    return macro("print_button", text=text, target=target)


def join(*parts: Markup | str) -> Markup:
    """Pieces one after the other; plain strings are escaped."""
    return Markup("\n").join(part for part in parts if part)
