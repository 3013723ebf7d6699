# Everything runs in .venv, which is made from the hashed locks. `make` alone lists the targets.

PYTHON ?= python3
SCENARIO ?= sensor-coverage
BASE ?= HEAD~1
VENV := .venv
BIN := $(VENV)/bin
UV ?= uv

RUN_READY := $(VENV)/.run-ready
DEV_READY := $(VENV)/.dev-ready
COMPILED := $(VENV)/.compiled

PIP := $(BIN)/python -m pip --disable-pip-version-check
COMPILE := $(UV) pip compile --quiet --universal --python-version 3.11 --generate-hashes \
	--no-emit-index-url --no-annotate --no-header --no-config pyproject.toml --extra record --extra study --group build

.DEFAULT_GOAL := help
APT_TOOLS := iproute2 nftables ffmpeg chromium

.PHONY: help setup dev tools run test lint format pages docs bench regressions fidelity package lock clean

help:  ## list the targets
	@awk -F ':.*## ' '/^[a-z]+:.*## / {printf "  make %-8s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

setup: $(RUN_READY) $(COMPILED)  ## make .venv with the zwerm command in it

dev: $(DEV_READY) $(COMPILED)  ## add what tests, linters and documentation need

tools:  ## install what the twin on a real network, MP4 and the test of the search need (as root, with apt-get; else say so)
	@missing=; for each in ip tc nft ffmpeg chromium; do command -v $$each >/dev/null || missing=1; done; \
	if [ -z "$$missing" ]; then echo "tools: all there"; \
	elif [ "$$(id -u)" != 0 ]; then echo "tools: skipped, because installing $(APT_TOOLS) needs root"; \
	elif ! command -v apt-get >/dev/null; then echo "tools: skipped, because there is no apt-get: install $(APT_TOOLS)"; \
	elif { apt-get update -qq && DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $(APT_TOOLS); } \
	  >/dev/null 2>&1; then echo "tools: installed $(APT_TOOLS)"; \
	else echo "tools: skipped, because apt-get could not install $(APT_TOOLS)"; fi

run: setup  ## run a scenario (SCENARIO=name; default sensor-coverage)
	$(BIN)/zwerm run $(SCENARIO)

test: dev  ## run the tests, two files at a time
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

lint: dev  ## check style, types and import boundaries
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache

format: dev  ## rewrite the code in the project's format
	$(BIN)/ruff check --fix-only .
	$(BIN)/ruff format .

pages: dev  ## write the generated parts of the documentation into its pages
	$(BIN)/python docs/pages.py

docs: dev  ## build the documentation into site/
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict --quiet

bench: dev  ## run the benchmarks
	@for each in benchmarks/*/bench_*.py; do \
	  module=$$(echo "$${each%.py}" | tr / .); echo "== $$module"; $(BIN)/python -m "$$module" || exit 1; done

regressions: dev  ## compare the speed with that of the commit before (BASE=revision), and name what is 10 % slower
	$(BIN)/python -m benchmarks.speed.regressions --base $(BASE)

fidelity: dev  ## hold every model of the radio against its 99 % confidence interval, a million packets each
	$(BIN)/python -m benchmarks.reliability.bench_fidelity

package:  ## build the package, and try it in a fresh environment
	@.ci/package

lock:  ## resolve the dependencies anew (needs uv)
	$(COMPILE) --upgrade --output-file requirements.txt
	$(COMPILE) --extra cluster --extra evolve --extra frames --group dev --constraint requirements.txt --upgrade --output-file requirements-dev.txt

clean:  ## remove .venv and everything that was built
	rm -rf $(VENV) build dist site *.egg-info zwerm/maths/*.so .mypy_cache .ruff_cache .pytest_cache .hypothesis

$(RUN_READY): requirements.txt pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null || \
	  { echo "make: Zwerm needs Python 3.11 or newer; name one with: make setup PYTHON=python3.12" >&2; exit 1; }
	@test -x $(BIN)/pip || { rm -rf $(VENV) && $(PYTHON) -m venv $(VENV); }
	@echo "Installing what requirements.txt locks into $(VENV) (the first time takes about a minute)"
	@$(PIP) install --quiet --require-hashes -r requirements.txt
	@$(PIP) install --quiet --no-deps --no-build-isolation --editable .
	@touch $@

$(DEV_READY): $(RUN_READY) requirements-dev.txt
	@echo "Installing what requirements-dev.txt locks into $(VENV)"
	@$(PIP) install --quiet --require-hashes -r requirements-dev.txt
	@touch $@

# The extension counts, once it is there, in place of its source: so a change of the source makes it anew.
$(COMPILED): $(RUN_READY) setup.py zwerm/maths/cached_voronoi_cell.py zwerm/maths/polygons.py
	@rm -f zwerm/maths/*.so
	@if [ "$(INTERPRETED)" = 1 ]; then echo "INTERPRETED=1: Voronoi coverage stays interpreted"; \
	elif ZWERM_COMPILE=1 $(BIN)/python setup.py -q build_ext --inplace >$(VENV)/compile.log 2>&1; then echo "Compiled the inner loop of Voronoi coverage"; \
	else rm -f zwerm/maths/*.so; echo "No C extension could be made ($(VENV)/compile.log says why): Voronoi coverage stays interpreted, with the same traces"; fi
	@rm -rf build
	@touch $@
