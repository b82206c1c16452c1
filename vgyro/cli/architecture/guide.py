"""docs/architecture.md as text."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from vgyro.cli.architecture.rooms import FOUNDATION, PACKAGE, House, direct
from vgyro.cli.architecture.stages import Stage, makers, stages
from vgyro.cli.architecture.walk import WALK

TOP = Path(__file__).resolve().parents[3]

HEAD = """\
# Architecture

Files go in, a page comes out, and nothing flows back: a stage reads files of earlier stages and writes its own. This
page is written from the code (`python -m vgyro.cli.documents`): do not edit it by hand. How to add something is in
[extending](extending.md), what each file holds in [file formats](file-formats.md).

| from | to | where |
|---|---|---|
| dumps and logs | frames: counts or rates as they were sent, on the sensor's time | `vgyro/storage` |
| frames | rates, deg/s, one column for each gyro | `vgyro/calibration`, `vgyro/alignment` |
| rates | noise of each gyro, faults, volatility of rolling windows | `vgyro/fusion`, `vgyro/volatility` |
| these | virtual gyros, one for each method | `vgyro/fusion` |
| gyros and virtual gyros | figures with intervals, and a cross-check | `vgyro/metrics`, `vgyro/engine` |
| figures | conclusions and the page | `vgyro/report` |

Functions between the files take arrays and small frozen dataclasses and return them. Axis 0 of an array is time; rates
are in deg/s. Only `vgyro/storage`, `vgyro/tasks` and `vgyro/cli` touch files; only `vgyro/tasks` knows that Snakemake
exists; the report computes nothing.

## Stages

A stage is a rule of `workflow/rules/` and a module of `vgyro/tasks`, whose `main` reads, calls and writes. `SECTIONS`
of the module are the options that it may ask for: parts of `analysis` in config.yaml, the board, the manifest. A job
runs again when its files, these options, or code that its task imports at any depth have changed
(`vgyro/tasks/closure.py`). An arrow leads from a stage to one that reads its files; where a longer way does, too, it is
left out.

"""
STAGES_HEAD = """
| stage | what it makes | reads | writes | options | task |
|---|---|---|---|---|---|
"""
ROOMS_HEAD = """
## Rooms

An arrow leads from a room to one that it imports; where a longer way does, too, it is left out. `foundation` is the
modules that lie beside the packages and import none of them.

"""
LAYERS_HEAD = """
## Layers

A module imports only what is further down. Packages on one line do not import each other where `|` stands between them,
and may where `:` does (import-linter, `make lint`).

"""
WALK_HEAD = """
## A walk: one array of rates through `recommended`

Twelve files, in the order in which the rates pass them. What the method does, and why, is in [fusion](fusion.md).

"""


def architecture() -> str:
    """The text of docs/architecture.md."""
    known, house = stages(TOP), House(TOP)
    contracts = tomllib.loads((TOP / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["importlinter"]["contracts"]
    return "".join([
        HEAD, *_flow(known), STAGES_HEAD, *map(_stage_row, known), WALK_HEAD, *_walk(),
        LAYERS_HEAD, *_layers(contracts), ROOMS_HEAD, *_rooms(house, _order(contracts)),
    ])  # fmt: skip


def _flow(known: Sequence[Stage]) -> Iterator[str]:
    before = direct({stage.name: makers(stage, known) for stage in known})
    yield from _drawn("LR", {name: sorted(others) for name, others in before.items()}, forward=True)


def _drawn(direction: str, edges: Mapping[str, Sequence[str]], *, forward: bool) -> Iterator[str]:
    """A graph in Mermaid. forward : arrows lead from the others to the name"""
    yield f"```mermaid\nflowchart {direction}\n"
    for name, others in edges.items():
        for other in others:
            first, last = (other, name) if forward else (name, other)
            yield f"    {first} --> {last}\n"
    yield "```\n"


def _stage_row(stage: Stage) -> str:
    reads = ", ".join(file.name for file in stage.reads)
    writes = ", ".join(f"`{_short(file.path)}`" for file in stage.writes)
    options = ", ".join(stage.sections) or "–"
    path = f"{PACKAGE}/tasks/{stage.task.replace('.', '/')}.py"
    return f"| {stage.name} | {stage.words} | {reads} | {writes} | {options} | [{stage.task}](../{path}) |\n"


def _short(path: str) -> str:
    """A path without the folders that all files of its kind lie in."""
    for folder in ("results/", "{dataset}/", "{recording}/", "{axis}/", "{definition}/"):
        path = path.removeprefix(folder)
    return path


def _walk() -> Iterator[str]:
    for number, (path, words) in enumerate(WALK, 1):
        yield f"{number}. [{path}](../{path}): {words}\n"


def _layers(contracts: Sequence[Mapping[str, object]]) -> Iterator[str]:
    for contract in contracts:
        if contract["type"] == "layers":
            yield "".join(f"    {line.replace(f'{PACKAGE}.', '')}\n" for line in _lines(contract, "layers"))
        else:
            source, forbidden = (
                ", ".join(f"`{name}`" for name in _lines(contract, key))
                for key in ("source_modules", "forbidden_modules")
            )
            yield f"\n{contract['name']}: {source} imports none of {forbidden}, at any depth.\n"


def _lines(contract: Mapping[str, object], key: str) -> list[str]:
    found = contract[key]
    assert isinstance(found, list)
    return [str(one) for one in found]


def _order(contracts: Sequence[Mapping[str, object]]) -> list[str]:
    """Names of packages and modules, from the highest layer down."""
    layers = next(contract for contract in contracts if contract["type"] == "layers")
    return [
        word.removeprefix(f"{PACKAGE}.")
        for line in _lines(layers, "layers")
        for word in line.replace("|", " ").replace(":", " ").split()
    ]


def _rooms(house: House, order: Sequence[str]) -> Iterator[str]:
    def place(name: str) -> int:
        return order.index(name) if name in order else len(order)

    edges = house.rooms_imported()
    rooms = sorted(house.rooms, key=place)
    above = {room: sorted(edges[room], key=place) for room in rooms}
    yield from _drawn("TB", direct(above), forward=False)
    folders = house.folders_imported()
    for room in rooms:
        yield from _room(house, room, above[room], folders)


def _room(house: House, room: str, imported: Sequence[str], others: Mapping[str, Sequence[str]]) -> Iterator[str]:
    inside = [name for name in house.modules if house.room_of(name) == room]
    if room == FOUNDATION:
        yield "\n### foundation\n\n"
        yield from _table(house, inside, "")
        return
    yield f"\n### {room}\n\n{house.words[room]}\n\nImports {', '.join(imported)}.\n\n"
    folders = [name for name in house.words if name.startswith(f"{room}.") and house.folder_of(name) == name]
    if folders:
        yield "| folder | what is in it | imports of this room |\n|---|---|---|\n"
        for folder in folders:
            mine = [one.removeprefix(f"{room}.") for one in others[folder] if one == room or one.startswith(f"{room}.")]
            yield f"| `{folder.removeprefix(f'{room}.')}` | {_cell(house.words[folder])} | {', '.join(mine)} |\n"
        yield "\n"
    if inside == [room]:
        yield f"One module: [{room}](../{PACKAGE}/{room}.py).\n"
        return
    yield f"<details><summary>Modules of {room}</summary>\n\n"
    yield from _table(house, inside, f"{room}/")
    yield "\n</details>\n"


def _table(house: House, names: Sequence[str], cut: str) -> Iterator[str]:
    yield "| module | what is in it |\n|---|---|\n"
    for name in names:
        path = name.replace(".", "/")
        yield f"| [{path.removeprefix(cut)}](../{PACKAGE}/{path}.py) | {_cell(house.words[name])} |\n"


def _cell(text: str) -> str:
    return text.replace("|", "\\|")
