# Everything runs in .venv, which is made on first use from requirements.lock.
PYTHON ?= python3
UV ?= $(shell if [ -x .venv/bin/uv ]; then echo .venv/bin/uv; else echo uv; fi)
LOCKFLAGS ?=
BIN := .venv/bin
READY := .venv/.ready

.DEFAULT_GOAL := help
.PHONY: help venv demo test test-faults lint lint-ruff lint-format lint-types lint-imports lock clean

help: ## List the targets.
	@awk -F ':.*## ' '/^[a-z][a-z-]*:.*## / { printf "  %-13s %s\n", $$1, $$2 }' $(firstword $(MAKEFILE_LIST))

venv: $(READY) ## Make .venv with the locked dependencies and sloshpy, editable.

$(READY): requirements.lock pyproject.toml
	@command -v $(PYTHON) >/dev/null || { echo "error: '$(PYTHON)' not found; sloshpy needs Python 3.11 or newer: try make PYTHON=python3.12" >&2; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { echo "error: '$(PYTHON)' is $$($(PYTHON) -V 2>&1); sloshpy needs Python 3.11 or newer: try make PYTHON=python3.12" >&2; exit 1; }
	$(PYTHON) -m venv --clear .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation -e .
	@touch $@

demo: $(READY) ## Assess the shipped upper stage and write upper_stage.html.
	$(BIN)/sloshpy assess src/sloshpy/data/upper_stage.toml --report upper_stage.html
	@echo "Report: upper_stage.html"

test: $(READY) ## Run the tests.
	$(BIN)/python -m pytest -n auto --dist loadfile

test-faults: $(READY) ## Run the long tests of kills, crashes and hangs.
	$(BIN)/python -m pytest -m faults

lint: lint-ruff lint-format lint-types lint-imports ## Run every check that is not a test.

lint-ruff: $(READY) ## Check the code with ruff.
	$(BIN)/ruff check .

lint-format: $(READY) ## Check the layout with ruff.
	$(BIN)/ruff format --check .

lint-types: $(READY) ## Check the types with mypy.
	$(BIN)/mypy

lint-imports: $(READY) ## Check the import order of the rooms.
	$(BIN)/lint-imports

lock: ## Renew requirements.lock with uv; LOCKFLAGS=--upgrade takes newer versions.
	$(UV) pip compile --quiet --universal --python-version 3.11 --fork-strategy fewest --generate-hashes \
		--no-emit-index-url --no-emit-find-links --no-annotate --no-header $(LOCKFLAGS) \
		--group dev --output-file requirements.lock pyproject.toml

clean: ## Remove everything made here, .venv included.
	rm -rf .venv dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	rm -f upper_stage.html upper_stage*.png
	find src tests docs benchmarks -name __pycache__ -type d -prune -exec rm -rf {} + 2>/dev/null || true
