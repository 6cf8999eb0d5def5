# Plumbline: `make fly` and `make test` each work from a fresh copy of the sources.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
STAMP := $(VENV)/.installed
DEV_STAMP := $(VENV)/.installed-dev
DOCS_STAMP := $(VENV)/.installed-docs
# uv installs in seconds what takes pip a minute; pip does it where uv is not available, or not configured for an index
# that pip is configured for. Bytecode is not compiled for whole packages: Python compiles what is imported, and keeps it
comma := ,
PIP := $(BIN)/pip install --quiet --disable-pip-version-check --no-compile
UV := VIRTUAL_ENV=$(VENV) $(BIN)/uv pip install --quiet
install = @{ $(PIP) 'uv>=0.4' && $(UV) --editable '.$(1)'; } || $(PIP) --editable '.$(1)'
export PYTHONDONTWRITEBYTECODE :=
# if colorama is installed, numba colours the error text of each candidate it tries, never shown: a twentieth of the time
export NUMBA_DISABLE_ERROR_MESSAGE_HIGHLIGHTING := 1

# an environment keeps the Python that it was made with, and PYTHON= would be ignored
ifeq ($(origin PYTHON),command line)
ifneq ($(wildcard $(BIN)/python),)
ifneq ($(filter-out help oldest clean,$(MAKECMDGOALS)),)
python_of = $(shell $(1) -c 'import sys; print("%d.%d" % sys.version_info[:2])')
made_with := $(call python_of,$(BIN)/python)
ifneq ($(call python_of,$(PYTHON)),$(made_with))
$(error $(VENV) is of Python $(made_with), which $(PYTHON) is not; make clean first)
endif
endif
endif
endif

.PHONY: help install fly test lint types docs oldest thesis figures pictures robustness renew bench clean

help: ## what can be made
	@grep -hE '^[a-z]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 12

install: $(STAMP) ## make .venv, install Plumbline in it and compile the flight software
	$(BIN)/gcs warmup

$(STAMP): pyproject.toml
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Plumbline needs Python 3.11 or newer; try make PYTHON=python3.11")'
	@echo "Installing Plumbline and what it needs in $(VENV): a minute at most, longer on a slow network"
	@$(PYTHON) -m venv $(VENV)
	$(call install)
	@touch $@

$(DEV_STAMP): $(STAMP)
	@echo "Installing what the tests and the checks need"
	$(call install,[dev$(comma)clients])
	@touch $@

$(DOCS_STAMP): $(STAMP)
	@echo "Installing what builds the documentation"
	$(call install,[docs])
	@touch $@

fly: $(STAMP) ## fly Case B through three real processes and show the report
	$(BIN)/gcs fly case-b --sensors lab

# tests marked `processes` run on the wall clock and mostly wait: they run beside the others, which leave the processor to
# them when they need it (all of it, at nice 19), and their output is printed after that of the others
test: $(DEV_STAMP) ## run the tests: a quarter of an hour on two idle cores
	@told=$$(mktemp); trap 'rm -f $$told' EXIT; \
	$(BIN)/pytest --numprocesses 2 --dist loadfile -m processes $$(grep -rl --include="*.py" mark.processes tests) >$$told 2>&1 & clocked=$$!; \
	nice -n 19 $(BIN)/pytest --numprocesses auto --maxprocesses 4 --dist worksteal -m 'not processes'; others=$$?; \
	wait $$clocked; with_processes=$$?; cat $$told; \
	test $$others = 0 && test $$with_processes = 0

lint: $(DEV_STAMP) ## ruff: lint and format
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .

types: $(DEV_STAMP) ## mypy, strict
	$(BIN)/mypy

docs: $(DOCS_STAMP) ## build the documentation as a site: site/index.html
	@echo "Flying the notebooks and building the site, some minutes. Their kernels warn of TCP: it is this machine's loopback"
	NO_MKDOCS_2_WARNING=1 RUN_NOTEBOOKS=true $(BIN)/mkdocs build --strict --quiet
	@echo "site/index.html"

oldest: $(STAMP) ## fly with the oldest versions of all libraries that pyproject.toml allows
	$(PYTHON) -m venv --clear $(VENV)-oldest
	VIRTUAL_ENV=$(VENV)-oldest $(BIN)/uv pip install --quiet --resolution lowest-direct --editable .
	$(VENV)-oldest/bin/gcs fly case-b --sensors lab --pictures
	$(VENV)-oldest/bin/gcs sweep case-b --seeds 4

thesis: $(STAMP) ## repeat the thesis's experiments and renew docs/thesis.md
	$(BIN)/gcs experiments thesis --docs docs/thesis.md

figures: $(DEV_STAMP) ## fly the figures of README and docs/control.md anew, and put them there
	$(BIN)/python benchmarks/figures.py
	$(BIN)/python tests/documentation/test_figures.py

pictures: $(DEV_STAMP) ## make the pictures of README and docs anew (needs chromium and its driver)
	$(BIN)/python benchmarks/pictures.py

robustness: $(DEV_STAMP) ## fly the sweeps of docs/robustness.md and renew its maps and what it says of them
	$(BIN)/python benchmarks/robustness.py
	$(BIN)/python tests/documentation/test_robustness.py

renew: thesis figures robustness pictures bench ## fly, draw and measure anew all that README and docs show (hours)
	$(BIN)/python benchmarks/realism.py --docs docs/realism.md

bench: $(STAMP) ## measure this machine
	$(BIN)/python benchmarks/plant_convergence.py
	$(BIN)/python benchmarks/cascade_margin.py
	$(BIN)/python benchmarks/thesis_assumptions.py
	$(BIN)/python benchmarks/performance.py --flights 1000 --real-time 60 --linear --docs docs/performance.md
	$(call install,[peers])
	$(BIN)/python benchmarks/peers.py --docs docs/performance.md

clean: ## remove what was made here
	rm -rf $(VENV) $(VENV)-oldest site build dist *.egg-info .mypy_cache .ruff_cache .pytest_cache .hypothesis
