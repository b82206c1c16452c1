"""docs/boards.md says what the code does."""

from dataclasses import fields

from vgyro.storage.integrity import ChannelRecord, Damage, FileRecord, FrameCount, Gap, Integrity


def test_every_key_of_the_integrity_record_is_explained(root):
    page = (root / "docs" / "boards.md").read_text(encoding="utf-8")
    for record in (Integrity, FrameCount, FileRecord, Damage, Gap, ChannelRecord):
        for entry in fields(record):
            assert f"`{entry.name}`" in page, f"{record.__name__}.{entry.name}"


def test_every_shipped_board_is_listed(root):
    page = (root / "docs" / "boards.md").read_text(encoding="utf-8")
    for path in (root / "config" / "boards").glob("*.yaml"):
        assert f"`{path.stem}`" in page
