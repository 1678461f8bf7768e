# `make up` and `make test` need only Python 3.11+ and make.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
FILE ?= configs/up.toml
ARGS ?=

.PHONY: up security test check tests test-compose test-devices soak coverage wheel bench quality configs lock sbom fuzz figures screenshots clean

# make up SECURE=security: with the certificates in that folder
ifdef SECURE
override ARGS += --secure $(SECURE)
endif

ifdef SOURCE
export ZV_CAMERA_SOURCE := $(SOURCE)
endif

# Without bytecode every program that the tests start would compile zv, and every pytest the tests;
# without buffers, which few users' shells switch off, a test sees no output that was not flushed.
unexport PYTHONDONTWRITEBYTECODE PYTHONUNBUFFERED

## up: start and supervise router, camera, tracker, edge detector and viewer (SOURCE=..., FILE=...)
up: $(VENV)/.runtime
	@$(BIN)/zv up $(FILE) $(ARGS)

## security: make certificates for every node and user in the folder security (ARGS="--camera back")
security: $(VENV)/.runtime
	@$(BIN)/zv security init security $(ARGS)

## test: everything that CI checks
test: check tests wheel
# What `check` has run already.
test: DONE := --ignore=tests/zv/viewer/page/test_lint.py

## check: format, lint, types, import layers, spelling; the page's modules by Debian's tsc
check: $(VENV)/.dev
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/codespell
	$(BIN)/python -m pytest -q tests/zv/viewer/page/test_lint.py

# Tests marked `quiet` measure times: they run after the others, five at a time; those marked
# `alone` also fill the machine, and run last, one at a time. Each run is made, whatever the one
# before it said; status 5 means that ARGS selected no test in it.
# A test that hangs ends its process (pyproject.toml); one other process goes on.
HUNG := --max-worker-restart 1
marked = $(or $(ARGS),$$(grep -rl --include='test_*.py' 'mark\.$(1)\b' tests))
define run_tests
failed=0; selected=0; \
	run() { $(BIN)/pytest "$$@"; case $$? in 0) selected=1 ;; 5) ;; *) failed=1 ;; esac; }; \
	run -m "not compose and not devices and not quiet and not alone" -n 6 --dist loadfile $(HUNG) $(DONE) $(1) $(ARGS); \
	run -m quiet -n 5 --maxschedchunk 1 $(HUNG) $(2) $(call marked,quiet); \
	run -m alone $(3) $(call marked,alone); \
	[ $$failed$$selected = 01 ]
endef

# Six workers and a thousand programs would compile all modules again where this is set.
tests test-compose test-devices: export PYTHONDONTWRITEBYTECODE :=

## tests: pytest, six at a time; then the `quiet` ones (ARGS=... to select)
tests: $(VENV)/.dev
	@$(call run_tests)

## test-compose: start the containers and break them (needs Docker; about 20 minutes)
# The limit of time is for a test, not for the images that the first one has to build.
test-compose: $(VENV)/.dev
	$(BIN)/pytest -m compose -o timeout_func_only=true -o faulthandler_timeout=0 tests/compose $(ARGS)

## test-devices: real camera drivers in a virtual machine (needs QEMU; about 6 minutes)
test-devices: $(VENV)/.dev
	$(BIN)/python -m tests.devices.machine --loopback 1 -- \
		$(BIN)/pytest -m devices -p no:cacheprovider tests/devices $(ARGS)

## soak: 20 minutes of all containers with a random fault every 10 s, and a report
soak: $(VENV)/.dev
	$(BIN)/python -m tests.compose.soak $(ARGS)

## lock: write the hashes of what make up and the image install (after a change of dependencies)
lock: $(VENV)/.supply
	@$(call lock,pyproject.toml,runtime)
	@$(call lock,pyproject.toml --extra shm,shm)
	@$(call lock,--group pyproject.toml:build,build)

# Removed first: uv keeps the versions that are in it.
lock = rm -f requirements/$(2).txt && $(BIN)/uv pip compile --quiet $(1) -c constraints.txt --universal \
	--python-version 3.11 --generate-hashes --no-header --no-annotate -o requirements/$(2).txt

## sbom: list what is installed at run time, as CycloneDX, in dist/zenoh-vision.cdx.json
sbom: $(VENV)/.supply
	@mkdir -p dist
	@$(BIN)/cyclonedx-py requirements requirements/shm.txt --pyproject pyproject.toml \
		--mc-type application --output-reproducible --of JSON -o dist/zenoh-vision.cdx.json
	@echo wrote dist/zenoh-vision.cdx.json

## fuzz: try bytes on a decoder of what strangers send (TARGET=message SECONDS=3600)
TARGET ?= message
SECONDS ?= 60
fuzz: $(VENV)/.dev $(VENV)/.supply
	$(BIN)/python -m tests.fuzz $(TARGET) -max_total_time=$(SECONDS) -rss_limit_mb=2000 -timeout=10

## coverage: line coverage, including the services' own processes
coverage: $(VENV)/.dev
	@$(call run_tests,--cov --cov-report=,--cov --cov-append --cov-report=,--cov --cov-append \
		--cov-report=term:skip-covered)

## wheel: build the wheel, with and without the weights of `learned`, install it, run it
wheel: $(VENV)/.dev
	PYTHON=$(BIN)/python ZV_WEIGHTS=yes tests/smoke_wheel.sh & \
	PYTHON=$(BIN)/python ZV_WEIGHTS= tests/smoke_wheel.sh; without=$$?; \
	wait $$! && exit $$without

## bench: measure speed relative to a minimum of the same run
bench: $(VENV)/.dev
	$(BIN)/python -m benchmarks $(ARGS)

## quality: measure results against ground truth (ARGS="tracker --only vtest"; see --help)
quality: $(VENV)/.quality
	$(BIN)/python -m benchmarks.quality $(ARGS)

## configs: regenerate configs/*.toml, and tables in docs/
configs: $(VENV)/.dev
	$(BIN)/python -m docs.generate

## figures: render the pictures of README and docs again, and the tables of measurements in docs/edges.md
figures: $(VENV)/.dev
	$(BIN)/python -m docs.images.make_edges
	$(BIN)/python -m docs.images.make_overview
	$(BIN)/python -m docs.images.make_tuning

## screenshots: render docs/images/viewer.png again (needs Debian's chromium-headless-shell or chromium)
screenshots: $(VENV)/.dev
	$(BIN)/python -m docs.images.make_viewer

clean:
	rm -rf $(VENV) dist build

# Frames go through shared memory where its library has a wheel; without it they go as JPEG.
define install_shm
@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes \
	--only-binary iceoryx2 -r requirements/shm.txt || echo "no wheel of iceoryx2 here: frames go as JPEG" >&2
endef

$(VENV)/bin/python:
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "Python 3.11 or newer is needed; name one with: make PYTHON=/path/to/python3.12" >&2; exit 1; }
	$(PYTHON) -m venv $(VENV)

$(VENV)/.runtime: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes \
		-r requirements/build.txt -r requirements/runtime.txt
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-build-isolation --no-deps -e .
	$(install_shm)
	@touch $@

$(VENV)/.dev: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e . --group dev
	$(install_shm)
	@touch $@ $(VENV)/.runtime

$(VENV)/.supply: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt --group supply
	@touch $@

$(VENV)/.quality: pyproject.toml constraints.txt | $(VENV)/bin/python
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --upgrade 'pip>=25.1'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e . --group quality
	@touch $@ $(VENV)/.runtime
