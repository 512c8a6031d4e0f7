# Every target prepares the machine first (scripts/setup): on a fresh Debian 12 or 13 that installs what
# is missing, as root or with sudo; afterwards it takes a fraction of a second. `make help` lists them.

# Processes for `make drape` and for the tests marked mpi; 1 runs the drape without mpirun.
RANKS ?= 2
# Processes that share the files of tests; more than one test file at a time may compile and start ranks.
WORKERS ?= 2
# What `make image` builds with; podman works as well.
DOCKER ?= docker

VENV := .venv/bin
# By its full name: the launcher has to be that of the MPI which Debian's dolfinx is linked to.
MPIRUN := $(if $(filter-out 1,$(RANKS)),/usr/bin/mpirun -n $(RANKS))
PYTEST := $(VENV)/python -m pytest

export RANKS
# Open MPI refuses to run as root, as in a container, and on fewer cores than ranks, unless told so.
# Version 4 (Debian 12) reads the names with OMPI, version 5 (Debian 13) also those with PRTE.
export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1
export OMPI_MCA_rmaps_base_oversubscribe := 1
export PRTE_MCA_rmaps_default_mapping_policy := :oversubscribe
# All ranks run on this machine and talk through its memory. Without this they also look for one another
# by TCP, and complain where there is no network.
export OMPI_MCA_btl := ^tcp
# The parallelism is MPI's: threads of BLAS on top of it only get in each other's way.
export OMP_NUM_THREADS := 1
# Some versions of dolfinx name a compiled form by an order that depends on the hash seed: with a fixed
# one, a second run and the other ranks find what the first has compiled.
export PYTHONHASHSEED := 0
# A user's ~/.local comes before the system's packages and could hold another numpy.
export PYTHONNOUSERSITE := 1
# VTK tries an X server first and complains when there is none. Pictures are drawn off-screen anyway.
export VTK_DEFAULT_OPENGL_WINDOW ?= vtkEGLRenderWindow

.DEFAULT_GOAL := help
.PHONY: help setup drape test test-slow check reference docs bench image clean

help: ## list the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1\t\2/p' $(MAKEFILE_LIST) | expand -t 12

setup: ## install what is missing and prepare .venv
	@scripts/setup

drape: setup ## drape a sheet over a hemisphere into results/drape (RANKS=2)
	$(MPIRUN) $(VENV)/fabric-fenicsx run demos/drape.yaml --out results/drape

# Both halves run, so that one call shows all failures. Finding no test is a failure too.
test: setup ## run the tests, then those marked mpi on RANKS processes, without the slow ones
	@status=0; \
	$(PYTEST) tests -m 'not slow' -n $(WORKERS) --dist loadfile || status=1; \
	scripts/mpi-test tests -m 'mpi and not slow' || status=1; \
	exit $$status

# There may be no test that is both slow and mpi: then there is no second half.
test-slow: setup ## run the slow tests, which take minutes each
	@status=0; \
	$(PYTEST) tests -m slow || status=1; \
	if $(PYTEST) tests -m 'mpi and slow' --collect-only -q >/dev/null; then \
	  scripts/mpi-test tests -m 'mpi and slow' || status=1; \
	fi; \
	exit $$status

check: setup ## lint, formatting and types
	$(VENV)/ruff check .
	$(VENV)/ruff format --check .
	$(VENV)/mypy

reference: setup ## compute the table of verified numbers anew, docs/reference.md
	$(VENV)/python scripts/reference_page.py

bench: setup ## time the benchmark problems against other solvers (PEERS=a file, see the script)
	$(VENV)/python tests/benchmarks/side_by_side.py $(PEERS)

docs: setup ## build the pages into build/docs, with their pictures
	$(VENV)/python -c 'import mkdocs' 2>/dev/null || $(VENV)/python -m pip install --quiet --editable '.[docs]'
	$(VENV)/python scripts/gallery.py
	$(VENV)/mkdocs build --quiet
	@echo build/docs/index.html

image: ## build the container image fabric-fenicsx
	$(DOCKER) build -t fabric-fenicsx .

clean: ## remove caches and build files; results/ and .venv stay
	rm -rf build dist *.egg-info .pytest_cache .ruff_cache .mypy_cache
	find . -path ./.venv -prune -o -name __pycache__ -type d -exec rm -rf {} +
