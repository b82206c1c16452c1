"""Pages from artefacts: it reads what the stages wrote, arranges and words it, and computes no figure."""
