"""Text logs: delimited, labelled, JSON lines, several kinds of lines in one file; any encoding, .gz and .zst.

encoding : bytes → UTF-8;  blocks : whole lines, a block at a time;  cells, delimiter, dates, header, kinds, form : what
the head's lines show;  fast : columns by the engine's kernel;  slow : lines whose cells have no fixed order
"""

from vgyro.storage.logs.text.encoding import looks_like_text
from vgyro.storage.logs.text.opened import TextLog, open_log

__all__ = ["TextLog", "looks_like_text", "open_log"]
