PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
BENCH := .venv-bench
DOCS := .venv-docs
BENCHMARKS := filters filters_particle filters_alpha learned propagation real_field scaling machine campaigns
# Small matrices are slower on many BLAS threads, and two workers share the cores.
export OPENBLAS_NUM_THREADS ?= 1
# Tests start many processes, which need not compile the same modules each time.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: help setup demo reproduce reproduce-full reproduce-docs inverse test types kernels check-slow docs bench scale scenarios schema clean

help:  ## List the targets
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /  make \1|/' | column -t -s '|'

# Of what is installed most modules are never imported; those that relnav imports are compiled by doing so.
$(VENV)/installed: pyproject.toml
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile --editable '.[dev]'
	$(BIN)/python -c 'import matplotlib.pyplot, numba, scipy.stats; from relnav_sim import *'
	touch $@

setup: $(VENV)/installed  ## Create .venv and install relnav with its development tools

demo: setup  ## Run the demo campaign and write its report
	$(BIN)/relnav run campaigns/demo.yaml
	$(BIN)/relnav report results/demo.h5

reproduce: setup  ## Replicate three papers, claim by claim: compute some runs again and compare them with the committed summaries
	$(BIN)/python -m replication

reproduce-full: setup  ## Compute every campaign of the replication at full size and renew replication/full; goes on where it stopped
	$(BIN)/python -m replication --full

reproduce-docs: setup  ## Write the replication's pages from replication/full, renewed with what reproduce-full has completed
	$(BIN)/python -m replication --docs docs

inverse: setup  ## Find which settings give the papers' printed numbers, and write docs/replication-settings.md; goes on where it stopped
	$(BIN)/python -m replication.inverse bank alpha_kf --size 22000
	$(BIN)/python -m replication.inverse bank two_step_kf --size 20000
	$(BIN)/python -m replication.inverse bank mf_upf --size 20000
	$(BIN)/python -m replication.inverse bank mf_upf_learned --size 20000
	for paper in alpha_kf two_step_kf mf_upf mf_upf_learned; do \
		$(BIN)/python -m replication.inverse infer $$paper && $(BIN)/python -m replication.inverse check $$paper || exit 1; done
	$(BIN)/python -m replication.inverse page

# Types are checked while kernels are compiled, which together keeps two cores busy.
test: setup  ## Lint, check types and import rules, run the tests
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(MAKE) --jobs=2 --no-print-directory types kernels
	$(BIN)/python -m pytest -n 2 --dist worksteal -m 'not slow'

types: setup
	$(BIN)/mypy
	$(BIN)/lint-imports

kernels: setup
	$(BIN)/python -m relnav_sim.kernels

check-slow: kernels docs  ## Run the long checks, and build the site of the documents
	$(BIN)/python -m pytest -m slow

$(DOCS)/installed: pyproject.toml
	$(PYTHON) -m venv $(DOCS)
	$(DOCS)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[docs]'
	touch $@

docs: $(DOCS)/installed  ## Write the site of the documents to build/site, in an environment of its own; a dead link is an error
	NO_MKDOCS_2_WARNING=1 PYTHONPATH=. $(DOCS)/bin/mkdocs build --strict --quiet
	$(DOCS)/bin/python -m website.self_contained build/site

$(BENCH)/installed: pyproject.toml
	$(PYTHON) -m venv $(BENCH)
	$(BENCH)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[bench]'
	touch $@

bench: $(BENCH)/installed  ## Measure docs/speed.md beside other libraries, in an environment of its own; 10 minutes on a quiet machine
	mkdir -p build
	for script in $(BENCHMARKS); do $(BENCH)/bin/python benchmarks/$$script.py --docs $(BENCH_OPTIONS) || exit 1; done

scale: setup  ## Measure how commands grow with runs, cases, filters and epochs, for docs/clusters.md; SCALE_OPTIONS takes a part
	PYTHONPATH=benchmarks $(BIN)/python -m scale $(SCALE_OPTIONS)

scenarios: setup  ## Fly the library of campaigns and write docs/scenarios.md anew; three minutes of processor time
	$(BIN)/python benchmarks/scenarios.py

schema: setup  ## Write campaigns/schema.json and the tables of docs/campaign-file.md from the models
	$(BIN)/relnav schema --out campaigns/schema.json --overwrite
	$(BIN)/python -m relnav_sim.campaign.reference docs/campaign-file.md

clean:  ## Remove the virtual environment and caches, keep results
	rm -rf $(VENV) $(BENCH) $(DOCS) build .mypy_cache .ruff_cache .pytest_cache .hypothesis
