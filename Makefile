# `make up` and `make test` need Python 3.11+ and make, nothing else.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
FILE ?= configs/up.toml
ARGS ?=

.PHONY: up test check tests test-compose soak coverage wheel bench configs screenshots clean

ifdef SOURCE
export ZV_CAMERA_SOURCE := $(SOURCE)
endif

## up: start router, camera, tracker and edge detector, and watch them (SOURCE=..., FILE=...)
up: $(VENV)/.runtime
	@$(BIN)/zv up $(FILE) $(ARGS)

## test: everything that CI checks
test: check tests wheel

## check: format, lint, types, import layers, spelling
check: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell

## tests: pytest, three at a time, since most wait (ARGS=... to choose); what fails beside another is run again alone
tests: $(VENV)/.dev
	$(BIN)/pytest -n 3 --dist worksteal $(ARGS) || $(BIN)/pytest --last-failed --last-failed-no-failures none $(ARGS)

## test-compose: start the containers and break them (needs Docker; about 15 minutes)
test-compose: $(VENV)/.dev
	$(BIN)/pytest -m compose tests/compose $(ARGS) || \
		$(BIN)/pytest -m compose tests/compose --last-failed --last-failed-no-failures none $(ARGS)

## soak: 20 minutes of all containers with a random fault every 10 s, and a report
soak: $(VENV)/.dev
	$(BIN)/python -m tests.compose.soak $(ARGS)

## coverage: line coverage, the services' own processes included
coverage: $(VENV)/.dev
	$(BIN)/pytest -n 3 --dist worksteal --cov --cov-report=term:skip-covered $(ARGS)

## wheel: build the wheel, install it in an empty environment, run it
wheel: $(VENV)/.dev
	PYTHON=$(BIN)/python tests/smoke_wheel.sh

## bench: speed against a floor measured in the same run
bench: $(VENV)/.dev
	$(BIN)/python -m benchmarks $(ARGS)

## configs: write configs/*.toml, docs/configuration.md and docs/cli.md anew from options and commands
configs: $(VENV)/.dev
	$(BIN)/python -m services.cli.defaults

## screenshots: write docs/images/viewer.png anew (needs Debian's chromium)
screenshots: $(VENV)/.dev
	$(BIN)/python docs/images/make_viewer.py

clean:
	rm -rf $(VENV) dist build

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; name one with: make PYTHON=/path/to/python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	@touch $@

$(VENV)/.dev: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e . --group dev
	@touch $@ $(VENV)/.runtime
