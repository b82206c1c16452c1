"""The command line: `vgyro COMMAND`. One module a command; each is imported only when it runs."""

from vgyro.cli.entry import main as main
