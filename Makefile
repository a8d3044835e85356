# make demo, make test: each sets up everything it needs in .venv first.

.DEFAULT_GOAL := help
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
OWN := . plugins/reference_mpm plugins/mpm_host plugins/taichi_mpm plugins/warp_mpm plugins/mujoco_flex plugins/genesis_mpm plugins/blender plugins/renderer plugins/viewer conformance_tests
NAMES := gasp-core gasp-reference-mpm gasp-mpm-host gasp-taichi-mpm gasp-warp-mpm gasp-mujoco-flex gasp-genesis-mpm gasp-blender gasp-renderer gasp-viewer gasp-conformance
# What the suite judges in `make test`, `make test-thorough` and `make test-slow`, two at a time; ":" stands for a space,
# \" for what keeps two words together. The engine of the first in two halves, bodies that touch and all else.
# Of the reference, which takes half an hour, the first two judge the contract alone: each engine's own tests compare it
# with the reference, number by number, in every material, and the suite does so with those that it judges whole.
# Taichi's compiler, which takes most of its time, is told not to improve its own code in the second; the last judges
# what users get.
ORACLE := --oracle:reference-mpm
# In make test Warp is compared with the reference in one law alone; there too all are held against closed forms.
BODIES := warp-mpm:$(ORACLE):-k:test_bodies
QUICK := $(BODIES) 'warp-mpm:$(ORACLE):-k:\"not:test_bodies:and:not:(test_agreement:and:not:elastic)\"'
# In make test beside the check of types, which leaves a core idle for as long.
CONTRACT := reference-mpm:-k:core
QUICK_THOROUGH := taichi-mpm:$(ORACLE):--precision:float64 $(BODIES) 'warp-mpm:$(ORACLE):-k:\"not:test_bodies\"' $(CONTRACT)
QUICK_SLOW := reference-mpm warp-mpm:$(ORACLE):--precision:float64 taichi-mpm:$(ORACLE)
# Status 3: nothing failed of what was chosen.
JUDGE := tr : ' ' | xargs -P 2 -I{} sh -c 'found=$$($(BIN)/gasp-conformance {} --quick 2>&1); code=$$?; echo "$$found"; exit $$((code == 3 ? 0 : code))'
# A room is a folder of tests/, a plugin, or the suite; make test ROOM=reduction runs what concerns it alone.
ROOM_TESTS = $(firstword $(wildcard tests/$(ROOM) plugins/$(ROOM)/tests $(if $(filter conformance,$(ROOM)),conformance_tests/tests)))
GASP_DATA ?= ../shared/data
export GASP_DATA
export ENABLE_TAICHI_HEADER_PRINT := 0
# Where Python is told to keep no bytecode, each of the hundreds of processes that tests start compiles all of gasp_core
# anew: 1.3 s of a processor to import gasp_core.simulation instead of .7.
export PYTHONDONTWRITEBYTECODE :=
# Two processes that share the tests out leave no core idle, and NumPy's matrix products, in a thread for every core, then
# wait for each other: 37 ms and more instead of 2 for the product of 300,000 points and a rotation.
test test-thorough test-slow test-minimum: export OPENBLAS_NUM_THREADS := 1

# The first interpreter that really runs and is new enough; PYTHON=... overrides.
PYTHON ?= $(shell for name in python3.11 python3.12 python3.13 python3 python; do \
	$$name -c 'import sys; sys.exit(not (3, 11) <= sys.version_info[:2] <= (3, 13))' >/dev/null 2>&1 && echo $$name && break; done)

.PHONY: help
help: ## Show what there is
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/  make \1\t\2/p' $(MAKEFILE_LIST) | expand -t 22

$(STAMP): requirements.lock pyproject.toml $(wildcard plugins/*/pyproject.toml) conformance_tests/pyproject.toml
	@test -n "$(PYTHON)" || { echo "make: no Python 3.11, 3.12 or 3.13 found; install one or give PYTHON=/path/to/python" >&2; exit 2; }
	@echo "Setting up $(VENV) with $$($(PYTHON) --version) (a few minutes the first time)"
	@$(PYTHON) -m venv $(VENV)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --require-hashes -r requirements.lock
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --no-build-isolation $(addprefix -e ./,$(OWN))
	@touch $@

.PHONY: install
install: $(STAMP) ## Build the environment in .venv

.PHONY: demo
demo: $(STAMP) ## Drop a soft toy: a film, key frames, splats
	@$(BIN)/gasp demo

.PHONY: check
check: $(STAMP) ## Lint, types, who may import whom
	@$(BIN)/ruff check .
	@$(BIN)/ruff format --check .
	@$(BIN)/basedpyright --level error
	@$(BIN)/lint-imports --no-cache

ifdef ROOM
.PHONY: test
test: $(STAMP)
	@test -n "$(ROOM_TESTS)" || { echo "make: no room $(ROOM): choose a folder of tests/, a plugin's folder or conformance" >&2; exit 2; }
	@$(BIN)/python -m pytest -m "not slow and not thorough" -n 2 --dist worksteal $(ROOM_TESTS)
else
.PHONY: test
test: $(STAMP) ## What has to be true, in some twenty minutes on two cores; ROOM=reduction: one room in 20 s
	@$(MAKE) --no-print-directory -j2 check contract
	@TI_ADVANCED_OPTIMIZATION=0 $(BIN)/python -m pytest -m "not slow and not thorough" -n 2 --dist loadgroup
	@printf '%s\n' $(QUICK) | $(JUDGE)

.PHONY: contract
contract: $(STAMP)
	@printf '%s\n' $(CONTRACT) | $(JUDGE)
endif

.PHONY: test-thorough
test-thorough: check ## That and what shows more of the same: every mutant, company and capture; 45 minutes
	@$(BIN)/python -m pytest -m "not slow" -n 2 --dist loadgroup
	@export TI_ADVANCED_OPTIMIZATION=0; printf '%s\n' $(QUICK_THOROUGH) | $(JUDGE)

COUNT ?= 20000
.PHONY: fuzz
fuzz: $(STAMP) ## Damaged splats, scenes, cameras, recordings, messages: read or refused; COUNT=100000 of each
	@$(BIN)/python tests/fuzz/harness.py --count $(COUNT) --first $$(date +%s) --keep build/fuzz

.PHONY: rooms
rooms: $(STAMP) ## Which room takes how long to test, and which tests cost most
	@$(BIN)/python benchmarks/test_rooms.py

.PHONY: matrix
matrix: $(STAMP) ## The whole suite on every engine that is ready; its verdicts go into the README
	@mkdir -p build/conformance
	-@$(BIN)/gasp-conformance reference-mpm --json build/conformance/reference-mpm.json
	-@$(BIN)/gasp-conformance mujoco-flex --json build/conformance/mujoco-flex.json
	-@for precision in float32 float64; do for engine in taichi-mpm warp-mpm; do \
		$(BIN)/gasp-conformance $$engine --oracle reference-mpm --precision $$precision --json build/conformance/$$engine-$$precision.json; done; done
	-@for engine in $$($(BIN)/gasp engines | sed -n 's/^\(genesis-mpm\|blender\) *ready.*/\1/p'); do \
		$(BIN)/gasp-conformance $$engine --json build/conformance/$$engine.json; done
	@$(BIN)/python -m gasp_conformance.matrix build/conformance/*.json --into README.md

.PHONY: template
template: $(STAMP) ## Copy the reference engine outside the tree, build wheels, run the suite on it
	@$(BIN)/python conformance_tests/tests/template_outside.py

.PHONY: test-slow
test-slow: $(STAMP) ## The checks that take minutes each
	@$(BIN)/python -m pytest -m slow
	@printf '%s\n' $(QUICK_SLOW) | $(JUDGE)

MINIMUM := .venv-minimum
.PHONY: test-minimum
test-minimum: $(STAMP) ## The quick tests with the lowest version of everything that pyproject.toml promises
	@test -n "$(PYTHON)" || { echo "make: no Python 3.11, 3.12 or 3.13 found; install one or give PYTHON=/path/to/python" >&2; exit 2; }
	@$(BIN)/python -m pip install --quiet uv
	@mkdir -p build
	@printf -- '-e ./%s\n' '.[dev]' $(wordlist 2,99,$(OWN)) | $(BIN)/uv pip compile --quiet --resolution lowest-direct \
		--python $(PYTHON) --no-emit-index-url --no-header --no-annotate $(foreach own,$(NAMES),--no-emit-package $(own)) \
		--output-file build/minimum.txt - >/dev/null
	@$(PYTHON) -m venv --clear $(MINIMUM)
	@$(BIN)/uv pip install --quiet --python $(MINIMUM) -r build/minimum.txt
	@$(BIN)/uv pip install --quiet --python $(MINIMUM) --no-deps --no-build-isolation $(addprefix -e ./,$(OWN))
	@$(MINIMUM)/bin/python -m pytest -m "not slow and not thorough" -n 2 --dist loadgroup

.PHONY: test-environments
test-environments: $(STAMP) ## Build the environments of Genesis and Blender (5 GB), and test both engines in them
	@for engine in genesis-mpm blender; do $(BIN)/gasp engines install $$engine || exit 1; done
	@$(BIN)/python -m pytest plugins/genesis_mpm plugins/blender
	@for engine in genesis-mpm blender; do $(BIN)/gasp-conformance $$engine --quick || failed=1; done; exit $${failed:-0}

.PHONY: bench
bench: $(STAMP) ## Print the tables that README and docs quote; many want real captures (GASP_DATA)
	@for script in $(filter-out benchmarks/accuracy_pages.py benchmarks/test_rooms.py,$(wildcard benchmarks/*.py)); do echo "== $$script"; $(BIN)/python $$script || failed=1; done; exit $${failed:-0}

.PHONY: lock
lock: $(STAMP) ## Pin every dependency anew
	@$(BIN)/python -m pip install --quiet uv
	@printf -- '-e ./%s\n' '.[dev]' $(wordlist 2,99,$(OWN)) | $(BIN)/uv pip compile --quiet --upgrade --universal --python-version 3.11 \
		--generate-hashes --no-emit-index-url --no-header --no-annotate $(foreach own,$(NAMES),--no-emit-package $(own)) \
		--output-file requirements.lock -

.PHONY: clean
clean: ## Remove the environment and what was made
	rm -rf $(VENV) $(MINIMUM) gasp-demo*
