# Everything from Python 3 and make: each target makes .venv and installs what it needs, once.

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
PIP := $(BIN)/python -m pip --disable-pip-version-check --quiet

.PHONY: help kernels wheel test coverage fuzz validate demo lint bench docs picture clean

help:
	@echo "make test     run the tests (two at a time)"
	@echo "make coverage run the tests compiled and uncompiled, and count the statements they reach"
	@echo "make fuzz     damaged files, odd command lines, forged packets: the long leg (an hour)"
	@echo "make validate simulate the tables of sigma.md, consistency.md, prefilter.md, in-motion.md and transfer.md anew (an hour)"
	@echo "make kernels  compile what the cache of kernels lacks, before the tests do"
	@echo "make demo     align a simulated truck and draw the report into out/"
	@echo "make lint     style, types, and which module imports which"
	@echo "make bench    time schuler beside its peers, into docs/benchmarks.md"
	@echo "make docs     run all examples, build the documentation into site/"
	@echo "make picture  redraw the README's picture"
	@echo "make wheel    a wheel in dist/ whose kernels are compiled already"
	@echo "make clean    remove .venv and everything that was built"

$(BIN)/python:
	@command -v $(PYTHON) >/dev/null || { \
	  echo "schuler needs Python 3.11 or newer, and there is no '$(PYTHON)' here:" \
	       "install it, or say where it is: make PYTHON=/path/to/python3"; exit 1; }
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	  echo "schuler needs Python 3.11 or newer, and '$(PYTHON)' is" \
	       "$$($(PYTHON) -c 'import platform; print(platform.python_version())'):" \
	       "say which to use: make PYTHON=python3.12"; exit 1; }
	@$(PYTHON) -m venv $(VENV) || { rm -rf $(VENV); \
	  echo "'$(PYTHON) -m venv' failed: on Debian and Ubuntu, install the package python3-venv"; \
	  exit 1; }

# One stamp for each set of extras: made again when pyproject.toml changes. Several processes compile
# what the first command would compile in one.
$(VENV)/.with-%: pyproject.toml | $(BIN)/python
	$(PIP) install -e '.[$*]'
	$(BIN)/python -m schuler.kernels.ahead --first
	@touch $@

# Several processes compile what each of pytest's would compile for itself.
kernels: $(VENV)/.with-dev
	$(BIN)/python -m schuler.kernels.ahead

test: kernels
	$(BIN)/python -m pytest -n 2 --dist worksteal $(PYTEST_ARGS)

# Compiled code is invisible to coverage: what holds kernels runs once more as Python.
coverage: $(VENV)/.with-dev
	COVERAGE_FILE=.coverage.compiled $(BIN)/python -m pytest -n 2 --dist worksteal --cov --cov-report=
	NUMBA_DISABLE_JIT=1 COVERAGE_FILE=.coverage.uncompiled $(BIN)/python -m pytest -n 2 \
	  --dist worksteal -m "not slow and not browser and not compiled" --cov --cov-report= \
	  tests/kernels tests/record tests/sensors tests/estimate tests/allan_variance tests/ins
	$(BIN)/python -m coverage combine -q .coverage.compiled .coverage.uncompiled
	$(BIN)/python -m coverage report --skip-covered --sort=cover --fail-under=92

fuzz: $(VENV)/.with-dev
	SCHULER_FUZZ_SCALE=$${SCHULER_FUZZ_SCALE:-50} $(BIN)/python -m pytest -n 2 --dist worksteal \
	  tests/fuzz $(PYTEST_ARGS)

validate: $(VENV)/.with-dev
	$(BIN)/python -m tests.alignment.sigma_table
	$(BIN)/python -m tests.alignment.good_and_faulty
	$(BIN)/python -m tests.prefilter.lowpass_table
	$(BIN)/python -m tests.prefilter.velocity_table
	$(BIN)/python -m tests.prefilter.blocks_table
	$(BIN)/python -m tests.published.conditions_check
	$(BIN)/python -m tests.navigation.aided_table
	$(BIN)/python -m tests.aiding.rest_table
	$(BIN)/python -m tests.alignment.moving.figures_table
	$(BIN)/python -m tests.alignment.moving.methods_table
	$(BIN)/python -m tests.alignment.moving.stream_table
	$(BIN)/python -m tests.alignment.moving.invariant_table
	$(BIN)/python -m tests.alignment.transfer.figures_table
	SCHULER_LONG=1 $(BIN)/python -m pytest -n 2 --dist worksteal tests/campaigns tests/centrifuge \
	  tests/aiding tests/alignment/stationary tests/fuzz/test_fuzz_interrupts.py $(PYTEST_ARGS)

demo: $(VENV)/.with-report
	$(BIN)/schuler demo --out out/

lint: $(VENV)/.with-dev
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy
	$(BIN)/lint-imports

bench: $(VENV)/.with-bench
	$(BIN)/python benchmarks/run.py

# Every example first: a manual that does not run is not built.
docs: $(VENV)/.with-docs
	$(BIN)/python -m pytest -n 2 --dist worksteal -k "page or example" tests/test_docs.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build --strict

picture: $(VENV)/.with-dev
	$(BIN)/python docs/make_picture.py

# With the kernels compiled for any x86-64 processor with AVX2, so that nobody's first command has to.
wheel: | $(BIN)/python
	$(PIP) wheel --no-deps --config-settings=compile=all --wheel-dir dist .

clean:
	rm -rf src/schuler/kernels/compiled $(VENV) .venv-lowest build dist site out .pytest_cache .hypothesis .mypy_cache .ruff_cache \
	  .import_linter_cache .coverage htmlcov
	find src tests benchmarks -name __pycache__ -type d -prune -exec rm -rf {} +
