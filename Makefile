PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test test-live test-computed thorough check docs lock bench soak fuzz mutants clean

demo: $(VENV)/.done
	$(BIN)/modalwatch demo --force

# Tests in real time first, and alone: devices and hosts that wait for the processor lose samples. Then the others, the long
# files first. Modules are compiled once, whatever the environment says: these tests start some hundred processes.
test: $(VENV)/.done
	@$(MAKE) --no-print-directory --keep-going test-live test-computed

test-%: export OPENBLAS_NUM_THREADS = 1
test-%: export PYTHONDONTWRITEBYTECODE =

# Only files with such tests are imported.
test-live: $(VENV)/.done
	$(BIN)/python -m pytest -m "live and not thorough" --numprocesses 3 --dist loadgroup \
		$$(grep -rlE 'mark\.live\b' tests --include='test_*.py')

test-computed: $(VENV)/.done
	$(BIN)/python -m pytest -m "not live and not thorough" --numprocesses auto --dist loadfile --no-loadscope-reorder

# More draws of what the tests cover: other seeds, other structures, pairs of causes.
thorough: export OPENBLAS_NUM_THREADS = 1
thorough: export PYTHONDONTWRITEBYTECODE =
thorough: $(VENV)/.done
	$(BIN)/python -m pytest -m thorough --numprocesses auto

check: $(VENV)/.done
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports --no-cache
	$(BIN)/python .ci/house
	$(BIN)/deptry .
	$(BIN)/vulture
	$(BIN)/python .ci/audit

# The documentation site, build/docs/index.html; a broken link or an undocumented name is an error.
docs: $(VENV)/.done
	$(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet --doctree-dir build/doctrees docs build/docs

# requirements.lock with hashes, and requirements-dev.lock, from what is installed in .venv; some minutes.
lock:
	$(BIN)/python .ci/lock

# The benchmarks with what they show and how long they take; `make bench-NAME ARGUMENTS="..."` runs one (benchmarks/catalogue.toml).
bench: $(VENV)/.done
	@$(BIN)/python -m benchmarks

bench-%: $(VENV)/.done
	$(BIN)/python -m benchmarks $* $(ARGUMENTS)

# The service through every fault of a rig's life, ten minutes: docs/validation/service/soak.md; `make soak ARGUMENTS="--minutes 120"`, `--devices 32`.
soak: bench-soak

# Mutated files for every reader, 2000 each, in hours: `make fuzz ARGUMENTS="site log --first 500 --minutes 10"`.
fuzz: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python tests/fuzz/run.py $(ARGUMENTS)

# Small faults put into modules, and the tests that should notice: the table in CONTRIBUTING.md, some minutes a module;
# it goes on where it was stopped (mutants.jsonl); `make mutants ARGUMENTS="oma/tracking/tracker.py --sample 60 --again"`.
mutants: export OPENBLAS_NUM_THREADS = 1
mutants: $(VENV)/.done
	$(BIN)/python tests/mutants/run.py $(ARGUMENTS)

$(VENV)/.done: requirements.lock requirements-dev.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "modalwatch needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -r requirements-dev.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

clean:
	rm -rf $(VENV) demo-output build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
