# `make demo` and `make test` are all a user types on a fresh Debian machine; `make help` lists the rest.
SHELL := /bin/bash
.NOTPARALLEL:

PYTHON := .venv/bin/python3
RANKS := 2
SELECT := not slow
MECHANISMS := truss claw klann
DEMOS := $(MECHANISMS) characterize

# Debian's packages and nothing else: not the user's ~/.local, not a PYTHONPATH meant for another Python.
export PYTHONNOUSERSITE := 1
unexport PYTHONPATH PYTHONHOME

# Open MPI (OMPI_ up to version 4, PRTE_ from 5): may run as root and with more ranks than cores, which containers
# and small machines need; ranks are not bound to cores, so that two runs at once do not share one; they talk through
# shared memory, being on one machine.
export OMPI_ALLOW_RUN_AS_ROOT := 1
export OMPI_ALLOW_RUN_AS_ROOT_CONFIRM := 1
export OMPI_MCA_rmaps_base_oversubscribe := 1
export OMPI_MCA_hwloc_base_binding_policy := none
export OMPI_MCA_btl := ^tcp
export OMPI_MCA_btl_vader_single_copy_mechanism := none
export PRTE_MCA_rmaps_default_mapping_policy := :oversubscribe
export PRTE_MCA_hwloc_default_binding_policy := none

MPIRUN = OPENBLAS_NUM_THREADS=1 mpirun -n $(RANKS)
heading = @printf '\n--- %s\n' '$(1)'

.PHONY: help demo test install install-test lint test-serial test-parallel test-slow test-debian13 test-newest demos-quick hard-cases random-scenes bench clean

help: ## list the targets
	@sed -nE 's/^([a-z0-9-]+):.*## (.*)/\1\t\2/p' Makefile | expand -t 16

demo: install ## install what is missing and run the truss finger; pictures and summary.json in results/truss/
	$(PYTHON) demos/truss.py

test: lint test-serial test-parallel demos-quick test-debian13 ## everything but the slow tests

# Where the packages come from elsewhere (the Debian 13 root), INSTALL= switches the installation off.
INSTALL := yes

install: ## what `make demo` needs
	$(if $(INSTALL),@tools/install-debian.sh run)

install-test: ## what `make test` needs
	$(if $(INSTALL),@tools/install-debian.sh test)

lint: install-test ## style and layering: seconds
	$(call heading,lint)
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m pytest -q tests/test_layering.py

# The tests on one process in two runs side by side, of about the same length. The demos come first: the peak memory of
# a program starts from that of the process that calls it.
CORE := tests/design tests/effects tests/elasticity tests/joints tests/multibody \
    tests/mechanism tests/meshing
OTHERS := tests/equilibrium tests/simulation
AROUND := tests/demos tests/benchmarks tests/hard tests/oracles tests/plot \
    $(filter-out tests/test_layering.py,$(wildcard tests/test_*.py))
PYTEST = OPENBLAS_NUM_THREADS=1 $(PYTHON) -m pytest -p no:cacheprovider --durations=5 --durations-min=5 -m "$(SELECT)"

test-serial: install-test ## the tests on one process each
	$(call heading,tests on one process)
	@log=$$(mktemp); $(PYTEST) $(CORE) >"$$log" 2>&1 & core=$$!; \
	status=0; $(PYTEST) $(AROUND) $(OTHERS) || status=1; \
	wait $$core || status=1; cat "$$log"; rm -f "$$log"; exit $$status

test-parallel: install-test ## the tests marked `parallel`, on two MPI ranks
	$(call heading,tests on $(RANKS) ranks)
	$(MPIRUN) $(PYTHON) -m pytest --color=no -p no:cacheprovider -m "parallel and ($(SELECT))" \
	    $(CORE) $(OTHERS) $(AROUND)
	OPENBLAS_NUM_THREADS=1 mpirun -n 4 $(PYTHON) -m pytest --color=no -p no:cacheprovider tests/simulation/test_ranks.py

test-slow: install-test ## the tests marked `slow`
	$(call heading,slow tests)
	$(PYTHON) -m pytest -m slow

# Verdicts are kept: the same command goes on after an interruption.
N := 1000
SEED := 0

random-scenes: install-test ## N random scenes from SEED on (1000, 0), each checked independently; prints a table
	$(call heading,random scenes)
	OPENBLAS_NUM_THREADS=1 $(PYTHON) -m tests.hard.random_scenes --count $(N) --seed $(SEED)

# What can differ between versions of dolfinx, PETSc, gmsh and Python, in a few minutes; FULL=yes runs the rest as well.
FULL :=
CORE_SUITES := tests/elasticity tests/joints tests/multibody tests/mechanism
OTHERS_SUITES := tests/meshing tests/design/test_sensitivity.py tests/design/test_weights.py \
    $(patsubst %,tests/test_%.py,collective compat kernel_cache uncaught_errors) \
    tests/effects/test_contact_derivatives.py \
    $(patsubst %,tests/equilibrium/test_%.py,eigen factor lagrangian mixed_lagrangian newton path two_level) \
    $(patsubst %,tests/simulation/test_%.py,files memory ranks units)

# The same tests for every suite but the one at hand; Debian's newest moves by itself and is in no other target.
OTHER_SUITE = tools/debian.sh $(1) make --no-print-directory INSTALL= PYTHON=/usr/bin/python3 \
    SELECT="$(SELECT) and not calculix" AROUND= \
    $(if $(FULL),,CORE="$(CORE_SUITES)" OTHERS="$(OTHERS_SUITES)") test-serial test-parallel

test-debian13: install-test ## the tests of what versions change in a Debian 13 root (built once, about two minutes)
	$(call heading,tests in Debian 13)
	$(call OTHER_SUITE,trixie)

test-newest: install-test ## the same with Debian's newest (sid)
	$(call heading,tests in Debian sid)
	$(call OTHER_SUITE,sid)

demos-quick: $(DEMOS:%=demo-quick-%) ## every demo, coarse, in results/quick/

.PHONY: $(DEMOS:%=demo-quick-%)
$(DEMOS:%=demo-quick-%): demo-quick-%: install
	$(call heading,demo $*)
	$(PYTHON) demos/$*.py --quick --out results/quick/$*

hard-cases: install-test ## every case of tests/hard/, slow ones too, as the table in README.md
	$(PYTHON) -m tests.hard

# The tables that pages of the documentation include; `make bench` measures one, `make tables` all (hours).
BENCHMARKS := solvers work_precision accuracy_control large stopping performance effects optimisers
BENCH = OPENBLAS_NUM_THREADS=1 $(PYTHON) -m benchmarks

bench: install ## seconds per load step of every demo's initial design: 3D, on ranks, plane stress
	$(call heading,benchmark)
	$(BENCH).frames --write
	$(MPIRUN) $(PYTHON) -m benchmarks.frames --write
	$(BENCH).frames --space plane-stress --write

tables: bench $(BENCHMARKS:%=table-%) ## every benchmark, its table in docs/tables/ (hours)

.PHONY: tables $(BENCHMARKS:%=table-%)
$(BENCHMARKS:%=table-%): table-%: install
	$(call heading,benchmark $*)
	$(BENCH).$* --write

clean: ## remove what the targets above left in this tree
	rm -rf .venv results .pytest_cache .ruff_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
