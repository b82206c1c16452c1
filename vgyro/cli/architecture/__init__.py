"""docs/architecture.md, drawn from the code: stages of the workflow, rooms of the package, layers, and a walk."""

from vgyro.cli.architecture.guide import architecture as architecture
