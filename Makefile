# Two commands: `make run` (the embedded expedition) and `make test`. Both make the environment first if need be.
PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
CORES ?= 2

.PHONY: run test faults lint bench accuracy cluster cluster-test lock clean

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
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.accuracy --write --cores $(CORES)

# The Slurm executor beside the rest, for `snakemake --profile profiles/slurm` (docs/CLUSTER.md).
cluster: .venv/cluster-ready

# Starts a Slurm of one node on this machine and stops it again. Debian, as root: installs slurm-wlm and munge if need be.
cluster-test: .venv/cluster-ready
	tests/cluster/install.sh
	$(BIN)/python -m pytest -m cluster tests/cluster

.venv/cluster-ready: .venv/ready requirements-cluster.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements-cluster.lock
	touch $@

.venv/ready: requirements.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed")'
	test -x $(BIN)/python || $(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation --editable .
	touch $@

# Written anew from pyproject.toml; needs pip-tools. Hashes only: no address of where a package came from.
PIP_COMPILE := pip-compile --generate-hashes --no-emit-index-url --no-emit-trusted-host --no-emit-find-links \
	--no-header --no-annotate --allow-unsafe
lock:
	$(PIP_COMPILE) --extra dev --output-file requirements.lock pyproject.toml
	$(PIP_COMPILE) --extra cluster --constraint requirements.lock --output-file requirements-cluster.lock pyproject.toml

clean:
	rm -rf results/* .snakemake captures/simulated
