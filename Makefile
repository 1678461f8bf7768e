# `make up` and `make test` need only Python 3.11+ and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
FILE ?= configs/up.toml
ARGS ?=

.PHONY: up test check tests test-compose soak coverage wheel bench quality configs figures screenshots clean

ifdef SOURCE
export ZV_CAMERA_SOURCE := $(SOURCE)
endif

# Without bytecode every program that the tests start would compile zv, and every pytest the tests;
# without buffers, which few users' shells switch off, a test sees no output that was not flushed.
unexport PYTHONDONTWRITEBYTECODE PYTHONUNBUFFERED

## up: start and supervise router, camera, tracker, edge detector and viewer (SOURCE=..., FILE=...)
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

# Tests marked `quiet` measure times: they run after the others, three at a time; those marked
# `alone` also fill the machine, and run last, one at a time. Each run is made, whatever the one
# before it said; status 5 means that ARGS selected no test in it.
define run_tests
failed=0; selected=0; \
	run() { $(BIN)/pytest "$$@"; case $$? in 0) selected=1 ;; 5) ;; *) failed=1 ;; esac; }; \
	run -m "not compose and not quiet and not alone" -n 6 --dist loadfile --no-loadscope-reorder $(1); \
	run -m quiet -n 3 --maxschedchunk 1 $(2); \
	run -m alone $(3); \
	[ $$failed$$selected = 01 ]
endef

## tests: pytest, six at a time, since most tests wait; then the `quiet` ones (ARGS=... to select)
tests: $(VENV)/.dev
	@$(call run_tests,$(ARGS),$(ARGS),$(ARGS))

## test-compose: start the containers and break them (needs Docker; about 20 minutes)
test-compose: $(VENV)/.dev
	$(BIN)/pytest -m compose tests/compose $(ARGS)

## soak: 20 minutes of all containers with a random fault every 10 s, and a report
soak: $(VENV)/.dev
	$(BIN)/python -m tests.compose.soak $(ARGS)

## coverage: line coverage, including the services' own processes
coverage: $(VENV)/.dev
	@$(call run_tests,--cov --cov-report= $(ARGS),--cov --cov-append --cov-report= $(ARGS),--cov \
		--cov-append --cov-report=term:skip-covered $(ARGS))

## wheel: build the wheel, install it in an empty environment, run it
wheel: $(VENV)/.dev
	PYTHON=$(BIN)/python tests/smoke_wheel.sh

## bench: measure speed relative to a minimum of the same run
bench: $(VENV)/.dev
	$(BIN)/python -m benchmarks $(ARGS)

## quality: measure results against ground truth (ARGS="tracker --only vtest"; see --help)
quality: $(VENV)/.quality
	$(BIN)/python -m benchmarks.quality $(ARGS)

## configs: regenerate configs/*.toml, docs/configuration.md and docs/cli.md
configs: $(VENV)/.dev
	$(BIN)/python -m zv.cli.generate

## figures: render docs/images/edges again, and the tables of measurements in docs/edges.md
figures: $(VENV)/.dev
	$(BIN)/python -m docs.images.make_edges

## screenshots: render docs/images/viewer.png again (needs Debian's chromium-headless-shell or chromium)
screenshots: $(VENV)/.dev
	$(BIN)/python -m docs.images.make_viewer

clean:
	rm -rf $(VENV) dist build

# Frames go through shared memory where its library has a wheel; without it they go as JPEG.
define install_shm
@$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt \
	--only-binary iceoryx2 -e '.[shm]' || echo "no wheel of iceoryx2 here: frames go as JPEG" >&2
endef

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; name one with: make PYTHON=/path/to/python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e .
	$(install_shm)
	@touch $@

$(VENV)/.dev: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e . --group dev
	$(install_shm)
	@touch $@ $(VENV)/.runtime

$(VENV)/.quality: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e . --group quality
	@touch $@ $(VENV)/.runtime
