# make run: environment, demo data, pipeline, report.   make test: environment, all tests.
# `make help` lists the rest.

PYTHON ?= python3
CORES ?= 2
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
# Whole files, in their order: what a module shares is then made once.
SPREAD := --dist loadfile --no-loadscope-reorder
LOCK := requirements/lock.txt
NATIVE := $(wildcard vgyro/engine/native/*.pyx vgyro/engine/native/c/*)

export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: help env run test test-full lint papers accuracy lock clean

help:
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/:.*## / \t/' | expand -t 12

env: $(READY)  ## make or update the environment in .venv

$(READY): $(LOCK) requirements/uv.txt pyproject.toml setup.py workflow/setup.sh $(NATIVE)
	@echo "Making the environment in $(VENV): a minute or two, quietly"
	@PYTHON=$(PYTHON) sh workflow/setup.sh $(VENV) requirements/uv.txt $(LOCK)
	@touch $@

run: $(READY) raw/demo/dataset.yaml  ## simulate the demo board's dumps, run the pipeline, say where the report is
	snakemake --cores $(CORES)
	@echo
	@echo "The demo board's report (simulated data):  $(CURDIR)/reports/demo.html"
	@echo "The overview of all data sets:             $(CURDIR)/reports/index.html"

raw/demo/dataset.yaml: | $(READY)
	vgyro simulate demo --out raw/demo

# Compiled tests and modules are kept, whatever the shell says: else every worker and every job compiles them again.
test test-full: export PYTHONDONTWRITEBYTECODE =

test: $(READY)  ## every test but the long Monte-Carlo ones
	pytest -n $(CORES) $(SPREAD) -m "not full"

test-full: $(READY)  ## every test
	pytest -n $(CORES) $(SPREAD) --timeout 7200

lint: $(READY)  ## formatting, style, types, layers, workflow
	ruff check .
	ruff format --check .
	mypy
	lint-imports
	snakefmt --check Snakefile workflow
	snakemake --lint

papers: $(READY)  ## the tables of the two papers, regenerated
	snakemake --cores $(CORES) papers
	@echo
	@echo "The papers' tables (simulated data):  $(CURDIR)/reports/papers/jiang2012.html"
	@echo "                                      $(CURDIR)/reports/papers/liu2015.html"

accuracy: $(READY)  ## the accuracy of every fusion method on simulated recordings: docs/accuracy.md
	python -m benchmarks.accuracy --processes $(CORES) --docs

lock: $(READY)  ## resolve the dependencies again
	uv pip compile --universal --generate-hashes --no-emit-index-url --no-header --python-version 3.11 --upgrade \
	    --extra dev --extra logs pyproject.toml -o $(LOCK)
	sed -n '/^uv==/,/^[^ ]/p' $(LOCK) | sed '$$d' > requirements/uv.txt

clean:  ## remove the environment and everything that was computed; raw/ stays
	rm -rf $(VENV) .snakemake results/* reports/*
	git checkout -- results reports 2>/dev/null || true
