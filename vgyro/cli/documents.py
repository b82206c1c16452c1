"""Write config/config.yaml, docs/architecture.md, docs/configuration.md and docs/file-formats.md from the code.

`python -m vgyro.cli.documents`, in the top folder. It overwrites them: keep a config.yaml of your
own elsewhere first.
"""

from __future__ import annotations

from pathlib import Path

from vgyro.cli.architecture import architecture
from vgyro.cli.formats_guide import file_formats
from vgyro.describe import config_yaml, configuration_guide
from vgyro.storage.tables import write_text

DOCUMENTS = {
    "config/config.yaml": config_yaml,
    "docs/architecture.md": architecture,
    "docs/configuration.md": configuration_guide,
    "docs/file-formats.md": file_formats,
}


def write_documents(top: Path) -> None:
    """Write every document below `top`."""
    for name, text in DOCUMENTS.items():
        write_text(top / name, text())


if __name__ == "__main__":
    write_documents(Path())
