# Two commands: `make run` (the embedded expedition) and `make test`. Both make the environment first if need be.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
CORES ?= 2

.PHONY: run test faults lint bench accuracy lock clean

run: .venv/ready
	$(BIN)/snakemake --cores $(CORES)

test: .venv/ready lint
	$(BIN)/python -m pytest --numprocesses $(CORES) --dist loadfile

# The slow tests of kills and full disks.
faults: .venv/ready
	$(BIN)/python -m pytest -m faults

lint: .venv/ready
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/snakefmt --check Snakefile workflow

bench: .venv/ready
	$(BIN)/python -m tests.bench

# About half an hour; writes docs/ACCURACY.md.
accuracy: .venv/ready
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.accuracy --write

.venv/ready: requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed")'
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

# Written anew from pyproject.toml; needs pip-tools. Hashes only: no address of where a package came from.
lock:
	pip-compile --extra dev --generate-hashes --no-emit-index-url --no-emit-trusted-host --no-header --no-annotate \
		--allow-unsafe --output-file requirements.lock pyproject.toml

clean:
	rm -rf results/* .snakemake captures/simulated
