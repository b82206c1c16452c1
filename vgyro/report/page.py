"""The frame that every page has: head, contents, sections, the plots' script once.

A page is one file: it asks the network for nothing, and the same sections give the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from markupsafe import Markup

from vgyro.report.html import environment

EMPTY = Markup("")
FOOTER = "vgyro: every figure is computed by the pipeline; this page lays artefacts out."


@dataclass(frozen=True)
class Section:
    """A part of a page. id : anchor, unique in the page;  html : its content

    children : parts that open on demand, listed in the contents below this one;  aside : small print beside the title
    opened   : of a child, whether it is open when the page loads
    """

    id: str
    title: str
    html: Markup = EMPTY
    children: tuple[Section, ...] = ()
    aside: str | Markup = ""
    opened: bool = False


def render_page(
    title: str,
    sections: Sequence[Section],
    *,
    simulated: bool | str = False,
    subtitle: str | Markup = "",
    home: str = "index.html",
    contents: bool = True,
) -> str:
    """A whole page as text.

    simulated : true, or words that say what made the data; the page then carries the mark SIMULATED
    home      : link back to the index, relative; empty for none;  contents : whether there is a list of contents
    raises    : ValueError if two sections have one id
    """
    names = [part.id for section in sections for part in (section, *section.children)]
    if len(set(names)) != len(names):
        raise ValueError(f"two sections have one id: {sorted(name for name in set(names) if names.count(name) > 1)}")
    has_plots = any(
        '<figure class="plot"' in part.html for section in sections for part in (section, *section.children)
    )
    return environment().get_template("page.html").render(
        title=title, sections=tuple(sections), simulated=simulated, subtitle=subtitle, home=home, contents=contents,
        footer=FOOTER, bokeh=_bokeh_script() if has_plots else "",
    ) + "\n"  # fmt: skip


@cache
def _bokeh_script() -> Markup:
    """bokeh.min.js of the installed package; "</script" in it would end the page's script early."""
    path = files("bokeh").joinpath("server", "static", "js", "bokeh.min.js")
    return Markup(path.read_text(encoding="utf-8").replace("</script", "<\\/script"))
