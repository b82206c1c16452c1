"""Pages in headless Chromium: drawn, quiet, offline, usable in both schemes and on a narrow screen."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import pytest

from vgyro.tasks.common import Task
from vgyro.tasks.pages import index, report

pytestmark = pytest.mark.browser
HERE = Path(__file__).parent
IN_SIGHT = (
    "[...document.querySelectorAll('figure.plot')].filter(f => {const r = f.getBoundingClientRect();"
    " return f.checkVisibility() && r.height && r.top < innerHeight && r.bottom > 0})"
)
ALLAN = "Bokeh.documents.flatMap(d => d.roots()).filter(p => p.id.startsWith('allan-rest-x.')).at(-1)"
SHADOWED = (
    "const all = n => [...n.querySelectorAll('*')].flatMap(e => [e, ...(e.shadowRoot ? all(e.shadowRoot) : [])]);"
)


def load(path: Path) -> ModuleType:
    """A module by its path: tests are no packages."""
    spec = importlib.util.spec_from_file_location(path.stem + "_by_path", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


driver = load(HERE / "chromium.py")


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder with bench.html and index.html."""
    folder = tmp_path_factory.mktemp("pages")
    task = load(HERE.parent / "report" / "conftest.py").build(folder)
    report.main(task)
    page = folder / "reports" / "index.html"
    index.main(Task({"headlines": [task.output("headline")]}, {"page": page}, {"problems": []}, ""))
    return folder / "reports"


@pytest.fixture
def browser(request: pytest.FixtureRequest) -> Iterator[object]:
    """An empty page; parameters: width and colour scheme."""
    chromium = driver.find_chromium()
    if chromium is None:
        pytest.skip("no Chromium here; install chromium to test the pages")
    width, scheme = getattr(request, "param", (1400, "light"))
    with driver.Page(chromium, width, 1000, scheme) as page:
        yield page


def test_a_page_draws_its_plots_without_errors_and_without_the_network(browser, pages: Path) -> None:  # type: ignore[no-untyped-def]
    browser.open(pages / "bench.html", "#allan-rest-x")
    browser.wait_for(f"{IN_SIGHT}.length > 0 && {IN_SIGHT}.every(f => f.dataset.drawn)")
    assert browser.run(f"(() => {{{SHADOWED} return all(document).filter(e => e.tagName === 'CANVAS').length}})()") > 0
    assert browser.errors == []
    assert browser.requests == []


def test_plots_are_drawn_when_they_come_into_sight(browser, pages: Path) -> None:  # type: ignore[no-untyped-def]
    browser.open(pages / "bench.html")
    total = browser.run("document.querySelectorAll('figure.plot').length")
    browser.wait_for("document.fonts.status === 'loaded'")
    assert browser.run(driver.DRAWN) < total / 2
    browser.run("document.querySelectorAll('details').forEach(d => d.open = true)")
    for _ in range(total):
        waiting = "[...document.querySelectorAll('figure.plot:not([data-drawn])')]"
        if not browser.run(f"{waiting}.length"):
            break
        browser.run(f"{waiting}[0].scrollIntoView()")
        browser.wait_for(f"{IN_SIGHT}.every(f => f.dataset.drawn)")
    assert browser.run(driver.DRAWN) == total
    assert browser.errors == []


def test_the_legend_hides_and_shows_a_series(browser, pages: Path) -> None:  # type: ignore[no-untyped-def]
    browser.open(pages / "bench.html", "#allan-rest-x")
    browser.wait_for("document.getElementById('allan-rest-x').dataset.drawn")
    visible = f"{ALLAN}.renderers.filter(r => r.name === 'median').map(r => r.visible)"
    button = "document.querySelector('#allan-rest-x button[data-series=\"median\"]')"
    assert set(browser.run(visible)) == {False}
    browser.run(f"{button}.click()")
    assert set(browser.run(visible)) == {True}
    assert browser.run(f"{button}.getAttribute('aria-pressed')") == "true"


@pytest.mark.parametrize("browser", [(1400, "light"), (1400, "dark")], indirect=True)
def test_text_and_plots_have_contrast_in_both_schemes(browser, pages: Path) -> None:  # type: ignore[no-untyped-def]
    browser.open(pages / "bench.html", "#allan-rest-x")
    browser.wait_for("document.getElementById('allan-rest-x').dataset.drawn")
    paper = luminance(variable(browser, "paper"))
    for name in ["ink", "muted", "accent", "good", "bad", "warn", *(f"s{i}" for i in range(8))]:
        colour = luminance(variable(browser, name))
        contrast = (max(colour, paper) + 0.05) / (min(colour, paper) + 0.05)
        # WCAG 2.1: 4.5 for text, 3 for graphics; an orange that passes 3 on white would no longer be one.
        assert contrast >= (2.4 if name.startswith("s") else 4.5), (name, contrast)
    assert browser.run(f"{ALLAN}.left[0].axis_label_text_color") == variable(browser, "muted")


def variable(browser, name: str) -> str:  # type: ignore[no-untyped-def]
    """A CSS variable of the page."""
    return browser.run(f"getComputedStyle(document.documentElement).getPropertyValue('--{name}').trim()")


def luminance(colour: str) -> float:
    """Relative luminance of #rrggbb (WCAG 2.1)."""
    shares = [int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [share / 12.92 if share <= 0.03928 else ((share + 0.055) / 1.055) ** 2.4 for share in shares]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("browser", [(420, "light")], indirect=True)
@pytest.mark.parametrize("name", ["bench.html", "index.html"])
def test_a_narrow_screen_does_not_scroll_sideways(browser, pages: Path, name: str) -> None:  # type: ignore[no-untyped-def]
    browser.open(pages / name)
    browser.run("document.querySelectorAll('details').forEach(d => d.open = true)")
    assert browser.run("document.documentElement.scrollWidth") <= 420
    assert browser.errors == []
    assert browser.requests == []


def test_a_change_of_scheme_redraws_the_plots(browser, pages: Path) -> None:  # type: ignore[no-untyped-def]
    browser.open(pages / "bench.html", "#allan-rest-x")
    browser.wait_for("document.getElementById('allan-rest-x').dataset.drawn")
    colour = f"{ALLAN}.left[0].axis_label_text_color"
    before = browser.run(colour)
    browser.set_scheme("dark")
    browser.wait_for(f"{colour} !== {before!r}")
    assert browser.errors == []


@pytest.mark.parametrize("browser", [(1400, "dark")], indirect=True)
def test_a_certificate_is_printed_alone_and_light_and_the_page_comes_back(browser, pages: Path) -> None:  # type: ignore[no-untyped-def]
    browser.open(pages / "bench.html", "#certificate-x")
    browser.wait_for("document.getElementById('scale-residuals-x').dataset.drawn")
    seen = (
        "window.print = () => { window.printed = {paper: getComputedStyle(document.body).backgroundColor,"
        " drawn: document.querySelectorAll('.printed figure[data-drawn]').length,"
        " width: document.querySelector('.printed').offsetWidth} }"
    )
    browser.run(seen)
    browser.run("document.querySelector('#certificate-x button.print').click()")
    browser.wait_for("window.printed")
    printed = browser.run("window.printed")
    assert printed["paper"] == "rgb(255, 255, 255)"
    assert printed["drawn"] == 3
    assert printed["width"] < 720
    assert browser.run("document.body.className") == ""
    assert browser.run("getComputedStyle(document.body).backgroundColor") != "rgb(255, 255, 255)"
    assert browser.errors == []


@pytest.mark.parametrize("browser", [(718, "dark")], indirect=True)
def test_a_certificate_fits_a_sheet_of_paper(browser, pages: Path) -> None:  # type: ignore[no-untyped-def]
    browser.open(pages / "bench.html")
    browser.run("document.body.classList.add('alone')")
    browser.run("document.getElementById('certificate-x').classList.add('printed')")
    browser.call("Emulation.setEmulatedMedia", {"media": "print"})
    # A4 less 10 mm margins is 718 px wide.
    assert browser.run("document.documentElement.scrollWidth") <= 718
    assert browser.run("[...document.querySelectorAll('h2, nav, footer')].filter(e => e.checkVisibility()).length") == 0
    assert browser.run("document.querySelectorAll('#certificate-x table').length") == 1
