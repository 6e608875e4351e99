# `make demo` and `make test` are all a user types on a fresh Debian machine; `make help` lists the rest.
SHELL := /bin/bash
.NOTPARALLEL:

PYTHON := .venv/bin/python3
RANKS := 2
SELECT := not slow
MECHANISMS := truss claw klann
DEMOS := $(MECHANISMS) characterise constant_force snap switch gripper suspension

# Debian's packages and nothing else: not the user's ~/.local, not a PYTHONPATH meant for another Python.
# Compiled modules are kept: collecting the tests without them takes twice as long, on each process.
export PYTHONNOUSERSITE := 1
unexport PYTHONPATH PYTHONHOME PYTHONDONTWRITEBYTECODE

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

.PHONY: help demo live live-pictures test check install install-test install-docs lint test-serial test-parallel test-thorough \
    test-debian13 test-newest demos-quick hard-cases random-scenes random-scenes-check effectivity docs bench clean

help: ## list the targets
	@sed -nE 's/^([a-z0-9-]+):.*## (.*)/\1\t\2/p' Makefile | expand -t 16

demo: install ## install what is missing and run the truss finger; pictures and summary.json in results/truss/
	$(PYTHON) demos/truss.py

live: install ## the live page: a mechanism to hold in your hand, on this machine
	$(PYTHON) -m fenicsmech.live

live-pictures: install-test ## pictures of the live page in docs/static/
	$(PYTHON) tools/live_pictures.py

test: lint test-serial test-parallel ## style, types, layers; fast tests on one process; on two ranks

# Debian's newest moves by itself, so it is not part of this.
# Every hard case is among its tests.
check: test-thorough random-scenes-check docs test-debian13 ## everything that `make test` leaves out

# Where the packages come from elsewhere (the Debian 13 root), INSTALL= switches the installation off.
INSTALL := yes

install: ## what `make demo` needs
	$(if $(INSTALL),@tools/install-debian.sh run)

install-test: ## what `make test` needs
	$(if $(INSTALL),@tools/install-debian.sh test)

install-docs: install-test ## what `make docs` needs
	$(if $(INSTALL),@tools/install-debian.sh docs)

lint: install-test ## style, types and layering: seconds
	$(call heading,lint)
	$(PYTHON) -m ruff check .
	$(PYTHON) -m ruff format --check .
	$(PYTHON) -m mypy & types=$$!; $(PYTHON) -m pytest -q tests/test_layering.py; layers=$$?; wait $$types && exit $$layers

# Two processes side by side, half of the tests each; the one that is done first takes over tests of the other. What is
# marked `parallel` runs on ranks instead.
PYTEST = OPENBLAS_NUM_THREADS=1 $(PYTHON) -m pytest -p no:cacheprovider --durations=5 --durations-min=5
SERIAL = $(PYTEST) -n 2 --dist worksteal --ignore tests/test_layering.py
TESTS := tests
RANK_TESTS = $(TESTS)

test-serial: install-test ## the fast tests on one process each
	$(call heading,tests on one process)
	$(SERIAL) -m "not parallel and not thorough and $(SELECT)" $(TESTS)

test-parallel: install-test ## the fast tests marked `parallel`, on two MPI ranks
	$(call heading,tests on $(RANKS) ranks)
	$(MPIRUN) $(PYTHON) -m pytest --color=no -p no:cacheprovider -m "parallel and not thorough and $(SELECT)" $(RANK_TESTS)

test-thorough: install-test ## those marked `thorough` or `slow`; on ranks what is `parallel` and not slow
	$(call heading,thorough tests)
	$(SERIAL) -m "slow or (thorough and not parallel)" $(TESTS)
	$(MPIRUN) $(PYTHON) -m pytest --color=no -p no:cacheprovider -m "parallel and thorough and $(SELECT)" $(TESTS)
	OPENBLAS_NUM_THREADS=1 mpirun -n 4 $(PYTHON) -m pytest --color=no -p no:cacheprovider -m "not thorough" tests/simulation/test_ranks.py

# Results are kept: the same command continues after an interruption.
N := 1000
SEED := 0

random-scenes: install-test ## N random scenes from SEED on (1000, 0), each checked independently; tables in docs/tables/
	$(call heading,random scenes)
	OPENBLAS_NUM_THREADS=1 $(PYTHON) -m tests.hard.random_scenes --count $(N) --seed $(SEED) --write

random-scenes-check: install-test ## a fixed block, the hundred seeds from 10000 on, afresh
	$(call heading,a hundred random scenes)
	OPENBLAS_NUM_THREADS=1 $(PYTHON) -m tests.hard.random_scenes --count 100 --seed 10000 --out "$$(mktemp -d)"

effectivity: install-test ## error estimates of 300 random scenes from seed 20000 on, against finer elements and space
	$(call heading,effectivity of error estimates)
	OPENBLAS_NUM_THREADS=1 $(PYTHON) -m tests.hard.random_scenes.effectivity --write

# What can differ between versions of dolfinx, PETSc, gmsh, MPI and Python, little of it on ranks; FULL=yes runs
# everything that is fast.
FULL :=
VERSION_TESTS := tests/meshing $(patsubst %,tests/elasticity/test_%.py,body carried derivatives mixed_derivatives patch) \
    $(patsubst %,tests/mechanism/test_%.py,cards purity) tests/joints/test_kinds.py tests/multibody/test_invariance.py \
    tests/quantities/test_sensitivity.py tests/design/test_weights.py \
    $(patsubst %,tests/test_%.py,collective compat kernel_cache uncaught_errors) \
    tests/effects/test_contact_derivatives.py \
    $(patsubst %,tests/equilibrium/test_%.py,blocks factor lagrangian mixed_lagrangian newton two_level) \
    $(patsubst %,tests/continuation/test_%.py,eigen load_steps) \
    $(patsubst %,tests/simulation/test_%.py,files units)
VERSION_RANK_TESTS := $(patsubst %,tests/test_%.py,collective compat) tests/simulation/test_files.py \
    $(patsubst %,tests/simulation/test_ranks.py::test_%,claw link_that_cannot_be_meshed_is_refused_on_all_ranks \
    one_rank_decides_on_motions_and_ranks_of_constraints)
OTHER_SUITE = tools/debian.sh $(1) make --no-print-directory INSTALL= PYTHON=/usr/bin/python3 \
    SELECT="$(SELECT) and not calculix" $(if $(FULL),,TESTS="$(VERSION_TESTS)" \
    RANK_TESTS="$(VERSION_RANK_TESTS)") test-serial test-parallel

test-debian13: install-test ## the tests of what versions change in a Debian 13 root (built once, about two minutes)
	$(call heading,tests in Debian 13)
	$(call OTHER_SUITE,trixie)

test-newest: install-test ## the same with Debian's newest (sid), which moves by itself
	$(call heading,tests in Debian sid)
	$(call OTHER_SUITE,sid)

docs: install-docs ## the pages in docs/_build/html; warnings are errors
	$(call heading,documentation)
	$(PYTHON) -m sphinx -q -W --keep-going -j auto -b html docs docs/_build/html

demos-quick: $(DEMOS:%=demo-quick-%) ## the demos that optimise or fit, coarse, in results/quick/

.PHONY: $(DEMOS:%=demo-quick-%)
$(DEMOS:%=demo-quick-%): demo-quick-%: install
	$(call heading,demo $*)
	$(PYTHON) demos/$*.py --quick --out results/quick/$*

hard-cases: install-test ## every case of tests/hard/, slow ones too, as a table
	$(PYTHON) -m tests.hard

# The tables that pages of the documentation include; `make bench` measures one, `make tables` all (hours).
BENCHMARKS := verification solvers work_precision accuracy_control large stopping performance effects optimisers constrained closeness handles parts stress laws live
BENCH = OPENBLAS_NUM_THREADS=1 $(PYTHON) -m benchmarks

bench: install ## seconds per load step of every demo's initial design: 3D, on ranks with whole designs, plane stress
	$(call heading,benchmark)
	$(BENCH).frames --write
	$(MPIRUN) $(PYTHON) -m benchmarks.frames --designs --write
	$(BENCH).frames --space plane-stress --write

tables: bench $(BENCHMARKS:%=table-%) ## every table of the documentation, in docs/tables/ (hours)
	$(PYTHON) -m tests.hard --write
	OPENBLAS_NUM_THREADS=1 $(PYTHON) -m tests.hard.random_scenes --count $(N) --seed $(SEED) --write

.PHONY: tables $(BENCHMARKS:%=table-%)
$(BENCHMARKS:%=table-%): table-%: install
	$(call heading,benchmark $*)
	$(BENCH).$* --write

# a browser, CalculiX, the tests
table-live table-verification tables: install-test

clean: ## remove what the targets above left in this tree
	rm -rf .venv results docs/_build .pytest_cache .ruff_cache .mypy_cache .hypothesis
	find . -name __pycache__ -prune -exec rm -rf {} +
