#: make setup   a Python environment in .venv with what `make run` needs
#: make run     set up if needed, then start the server      (ARGS="--help")
#: make arm     what else a robot with joints (`--robot so101`) needs in it
#: make test    set up for development and run every check: what CI does
#: make check   the same: lint, import rules, types, web client, all tests
#: make fast    as many tests as fit into 15 s, the cheapest of them   (FAST_S=60)
#: make fuzz    search each parser of outside bytes for 60 s   (FUZZ_SECONDS=600 ARGS=records)
#: make test-all  test, then long tests, counterparts and fuzz, and the watchdog in C as long
#: make bench   only the measurements, on a quiet machine
#: make mutants do tests notice small changes in what keeps a robot safe?  (ARGS="FILE --all")
#: make hooks   let git run the quick checks before each commit
#: make lock    write requirements/*.txt anew from pyproject.toml (UPGRADE=1: newest versions)
#: make image   build the container image and try it: by Docker, or by buildah without an engine
#: make wheels  all that an installation without internet needs, in dist/wheels
#: make clean   remove .venv, node_modules and caches
#: Needs Python 3.11 or later and make; uses uv where there is one. PYTHON=... picks the Python.

.DEFAULT_GOAL := help
.PHONY: help setup arm dev run test check static lint contracts types web kernels pytest fast bench
.PHONY: real robots pages quiet fast-server fast-others fuzz test-all counterparts mutants
.PHONY: hooks lock image wheels clean

BIN := .venv/bin
WEB := web_client/node_modules/.package-lock.json
UV := $(shell command -v uv)
export UV_SYSTEM_CERTS ?= true
export PIP_DISABLE_PIP_VERSION_CHECK ?= 1
RECENT := -c 'import sys; sys.exit(sys.version_info < (3, 11))'
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11; do \
	$$p $(RECENT) 2>/dev/null && echo $$p && break; done)

PIP := $(if $(UV),$(UV) pip install --python $(BIN)/python,$(BIN)/python -m pip install)
LOCKED := $(PIP) --require-hashes --only-binary :all: -r
PROJECT := $(PIP) --no-deps --no-build-isolation --editable .

help:
	@sed -n 's/^#: //p' Makefile

setup: .venv/core.stamp

dev: .venv/dev.stamp $(WEB)

$(BIN)/python:
	@"$(PYTHON)" $(RECENT) 2>/dev/null || { \
		echo "Lightleash needs Python 3.11 or later; here python3 is: $$(python3 --version 2>&1)." >&2; \
		echo "Install one, or name it: make PYTHON=/path/to/python3.12 $(MAKECMDGOALS)" >&2; exit 1; }
	$(if $(UV),$(UV) venv --no-python-downloads --python "$(PYTHON)" .venv,"$(PYTHON)" -m venv .venv)

.venv/core.stamp: requirements/core.txt pyproject.toml | $(BIN)/python
	$(LOCKED) requirements/core.txt
	$(PROJECT)
	$(BIN)/lightleash warm
	@touch $@

.venv/dev.stamp: requirements/dev.txt requirements/arm.txt pyproject.toml | $(BIN)/python
	$(LOCKED) requirements/dev.txt
	$(LOCKED) requirements/arm.txt --no-deps
	$(PROJECT)
	@touch $@

# What a robot with `[arm]` needs beside.
arm: setup
	$(LOCKED) requirements/arm.txt --no-deps

# Node is needed for the checks of the web client only, never to run Lightleash.
$(WEB): web_client/package.json web_client/package-lock.json
	@if command -v npm >/dev/null; then cd web_client && npm ci --ignore-scripts; \
	else echo "!!! npm is missing: the web client will not be checked" >&2; fi

run: setup
	$(BIN)/lightleash serve $(ARGS)

test: check

check: dev
	$(MAKE) --jobs=2 static
	$(MAKE) pytest

static: kernels lint contracts types web

lint: dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check

contracts: dev
	$(BIN)/lint-imports --no-logo

types: dev
	$(BIN)/mypy

web: dev
	@if [ -e $(WEB) ]; then cd web_client && npm run check && npm test; \
	else echo "!!! NOT TESTED: types and tests of the web client (npm is missing)" >&2; test -z "$$CI"; fi

# A fresh clone's kernels take a minute to compile: once, and not by each of the workers at once.
kernels: dev
	@$(BIN)/lightleash warm

# Tests start some hundred processes, each with a thousand modules: compiled once, not each time.
kernels pytest real robots pages quiet fast-server fast-others: export PYTHONDONTWRITEBYTECODE :=

# First flights, whose phones and robots share the machine with nobody: what runs beside them, and be
# it only when nobody else wants to, makes a virtual machine's processors wait. A machine that is too
# weak for them in real time flies them in slow motion. Then what else is real, one at a time: a
# browser and a flight beside each other starve both, and it would end no sooner, as what no clock
# hurries takes what they leave, and is the last to end.
pytest: dev
	$(BIN)/python -m tests.slow_motion $(BIN)/pytest -m flight $(ARGS)$(MAYBE_NONE); flown=$$?; \
	$(MAKE) --jobs=2 --keep-going --output-sync real quiet && exit $$flown

real: dev
	$(MAKE) --jobs=1 --keep-going robots pages

robots: dev
	$(BIN)/pytest -m "(e2e or bench) and not flight and not page and not counterpart" $(ARGS)$(MAYBE_NONE)

pages: dev
	$(BIN)/pytest -m "page and not flight" $(ARGS)$(MAYBE_NONE)

quiet: dev
	$(WHEN_IDLE) $(BIN)/pytest -n auto --dist worksteal $(ARGS) \
		-m "not e2e and not bench and not long and not counterpart"$(MAYBE_NONE)

WHEN_IDLE := $(if $(shell command -v chrt),chrt --idle 0,nice -n 19)
# Not each of them has one of somebody's choice of tests.
MAYBE_NONE = $(if $(ARGS), || test $$? = 5)

# Beside each other, each collecting its own half alone; what needs a browser is not even imported.
# The cheapest tests that fit into so much CPU time of each after collecting (5 s), as measured here.
FAST_S ?= 5
FAST := $(BIN)/pytest -q -m "not e2e and not bench and not slow and not counterpart" --within-s $(FAST_S)
SERVER := tests/server/ tests/web/
OTHERS := $(filter-out $(SERVER) tests/e2e/ tests/bench/ tests/data/,$(wildcard tests/[a-z]*/ tests/test_*.py))

fast: dev
	$(MAKE) --jobs=2 fast-server fast-others

fast-server: dev
	$(FAST) $(SERVER) $(ARGS)

fast-others: dev
	$(FAST) $(OTHERS) $(ARGS)

FUZZ_SECONDS ?= 60

fuzz: dev
	$(BIN)/python -m tests.fuzz --seconds $(FUZZ_SECONDS) $(ARGS)

# Programs of others, fetched and built by the tests themselves.
counterparts: dev
	$(BIN)/pytest -m counterpart $(ARGS)

test-all:
	$(MAKE) test
	$(BIN)/pytest -n auto --dist worksteal -m long
	$(MAKE) counterparts
	$(MAKE) fuzz
	LIGHTLEASH_FUZZ_S=60 $(BIN)/pytest tests/hardware/link/test_watchdog_fuzz.py

bench: dev
	$(BIN)/lightleash experiments loop
	$(BIN)/lightleash experiments loop --live
	-$(BIN)/lightleash bench vision --jobs 2 --learn 5
	for name in control control_law ekf estimators link relative virtual_camera; do $(BIN)/python -m tests.bench.bench_$$name || exit 1; done
	-$(BIN)/python -m tests.bench.bench_browser
	-$(BIN)/python -m tests.bench.bench_rtc
	-$(BIN)/python -m tests.bench.bench_flights

# Needs gcc for the watchdog in C.
mutants: dev
	$(BIN)/python -m tests.mutants $(ARGS)

hooks: dev
	git config core.hooksPath .githooks

lock: dev
	$(BIN)/uv pip compile $(COMPILE) --group build pyproject.toml -o requirements/core.txt
	$(BIN)/uv pip compile $(COMPILE) --group dev -c requirements/core.txt pyproject.toml \
		-o requirements/dev.txt
	$(BIN)/uv pip compile $(COMPILE) --group arm --no-deps -o requirements/arm.txt
	cd web_client && npm install --package-lock-only --ignore-scripts

COMPILE := --quiet --universal --python-version 3.11 --only-binary :all: --generate-hashes \
	--no-emit-index-url --no-emit-find-links --custom-compile-command "make lock" \
	$(if $(UPGRADE),--upgrade)

image:
	deploy/make_image.sh

# For this machine's Python and processor: make them on one like the lab's.
wheels:
	rm -rf dist/wheels
	"$(PYTHON)" -m pip download --quiet --require-hashes --only-binary :all: -r requirements/core.txt --dest dist/wheels
	"$(PYTHON)" -m pip wheel --quiet --no-deps . --wheel-dir dist/wheels

clean:
	rm -rf .venv web_client/node_modules build dist .mypy_cache .pytest_cache .ruff_cache \
		.import_linter_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
