"""Drafts of manifests: what is in the files, and dataset.yaml from it."""
