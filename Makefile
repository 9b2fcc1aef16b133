# make demo | test | lint | bench | clean: each sets up what it needs first. VENV=DIR keeps the environment elsewhere.
SHELL := /bin/bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help

PYTHON ?= $(firstword $(foreach name,python3.11 python3.12 python3.13 python3,$(if $(shell command -v $(name)),$(name))))
VENV ?= .venv
BIN := $(VENV)/bin
JOBS ?= 2
# One stamp, named after what the environment was made from: a machine that is kept installs once.
STAMP := $(VENV)/.made-from-$(shell cat pyproject.toml <(pwd) | sha256sum | cut -c1-16)

# The docs site needs nothing of lhdmap: its pages are read from the sources.
DOCS = $(shell $(PYTHON) -c "import tomllib; print(*tomllib.load(open('pyproject.toml', 'rb'))['project']['optional-dependencies']['docs'])")

# The linear algebra of several libraries meets in one process: one thread each, or they fight for the cores.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: help setup system demo test lint format config readme bench wheel lock docs clean

help: ## List the targets
	@sed -nE 's/^([a-z]+):.*## (.*)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 16

setup: $(STAMP) ## Make the environment in .venv (Python 3.11 to 3.13), once

system: ## Install the system libraries that are missing (Debian, as root), or say which
	@sh tools/system_packages.sh $(PYTHON)

$(STAMP): pyproject.toml
	@sh tools/system_packages.sh $(PYTHON)
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[all,dev]'
	@rm -f $(VENV)/.made-from-* && touch $@

demo: $(STAMP) ## Simulate the sample drive, build its map, evaluate it: demo/ (anew each time)
	$(BIN)/lhdmap demo --output demo --force

test: $(STAMP) ## Run all tests
	$(BIN)/python -m pytest -n $(JOBS) --dist worksteal

lint: $(STAMP) ## Check style, formatting and types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

format: $(STAMP) ## Format the code
	$(BIN)/ruff check --fix .
	$(BIN)/ruff format .

config: $(STAMP) ## Write pipelines/default.toml anew from the settings in the code
	$(BIN)/lhdmap config > pipelines/default.toml.new && mv pipelines/default.toml.new pipelines/default.toml

readme: $(STAMP) ## Write the figures and pictures of README.md anew (needs chromium)
	$(BIN)/python -m tools.readme_figures
	$(BIN)/python -m tools.pictures

bench: $(STAMP) ## Measure speed and memory
	$(BIN)/python -m tools.bench

wheel: $(STAMP) ## Build the wheel: dist/
	$(BIN)/python -m pip wheel --quiet --disable-pip-version-check --no-deps --wheel-dir dist .

docs: ## Build the docs site: site/ (into an environment of its own)
	test -x $(VENV)-docs/bin/mkdocs || { $(PYTHON) -m venv $(VENV)-docs && $(VENV)-docs/bin/python -m pip install --quiet --disable-pip-version-check $(DOCS); }
	NO_MKDOCS_2_WARNING=1 $(VENV)-docs/bin/mkdocs build --strict --quiet --clean

lock: $(STAMP) ## Pin requirements/core.txt and all.txt anew, with hashes
	$(BIN)/python -m tools.lock

clean: ## Remove what was made, the environment too; the maps in demo/ stay
	rm -rf $(VENV) $(VENV)-docs site dist build .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
