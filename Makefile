# Everything symrefine needs goes into .venv; nothing outside this directory is changed.
#   make demo, make test    need Python >= 3.11 and a package index, and do their own set-up

# The interpreter to build .venv from; empty: the first one found that is new enough.
PYTHON ?=
# More for pytest, such as PYTEST_ARGS="-m slow" or PYTEST_ARGS="tests/test_axis.py -k phase".
PYTEST_ARGS ?=

# More for the benchmarks: BENCH_ARGS=--full goes to the ends of every range, in half an hour instead of minutes.
BENCH_ARGS ?=

VENV := .venv
PY := $(VENV)/bin/python
READY := $(VENV)/.ready
LOG := .make/setup.log
SHELL := /bin/sh
.DEFAULT_GOAL := help
.NOTPARALLEL:
.PHONY: help setup demo test bench fuzz reproduce docs wheel lint lock clean

help: ## what each target does
	@sed -n 's/^\([a-z]*\):.*## /  make \1\t/p' $(MAKEFILE_LIST)

setup: $(READY) ## build .venv with the pinned packages and this checkout
	@echo "Ready for: make demo, make test, make bench"

demo: $(READY) ## find, refine and show symmetries
	@$(PY) -m experiments.studies.demo

test: lint ## lint, then the test suite
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 MKL_NUM_THREADS=1 $(PY) -m pytest -n 2 $(PYTEST_ARGS)

bench: $(READY) ## measure against the stored baseline, and how cost grows; BENCH_ARGS=--full: all of it
	@$(PY) -m benchmarks.run $(BENCH_ARGS)

fuzz: $(READY) ## damage 100,000 files of every format, configs and command lines, and read them; the table in docs
	@OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1 $(PY) -m experiments.studies.fuzz --page docs/robustness.md

reproduce: $(READY) ## the paper's experiments beside the baseline, in minutes; the report, the README's table
	@$(PY) -m experiments.studies.reproduce

docs: $(VENV)/.docs ## build the site, its notebooks run, in out/site
	@NO_MKDOCS_2_WARNING=1 $(PY) -m mkdocs build --strict

wheel: $(READY) ## build wheel and sdist into out/dist, and try the wheel in an environment of its own
	@.ci/wheel

# Runs a command in silence; says what it said if it fails.
check = printf '%-26s' "$(1)"; if out=$$($(2) 2>&1); then echo ok; else echo FAILED; echo "$$out"; exit 1; fi

lint: $(READY) ## style, formatting, types, directions of imports
	@$(call check,ruff check,$(PY) -m ruff check .)
	@$(call check,ruff format --check,$(PY) -m ruff format --check .)
	@$(call check,mypy --strict,$(PY) -m mypy)
	@$(call check,lint-imports,$(VENV)/bin/lint-imports --no-logo --no-cache)

lock: $(READY) ## pin the newest packages that fit, for every platform
	@$(PY) -m venv .make/uv && .make/uv/bin/python -m pip install -q uv 2>$(LOG) || { cat $(LOG); exit 1; }
	@UV_CUSTOM_COMPILE_COMMAND="make lock" .make/uv/bin/uv pip compile --quiet --no-config --universal --fork-strategy fewest --upgrade \
	  --python-version 3.11 --extra dev --no-emit-index-url --no-emit-find-links -o requirements.lock pyproject.toml

clean: ## remove .venv and every cache; out/ stays
	@rm -rf $(VENV) .make build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis .import_linter_cache
	@find . -name __pycache__ -type d -prune -exec rm -rf {} +

NEW_ENOUGH := -c 'import sys; sys.exit(sys.version_info < (3, 11))'
PIP := PIP_USER=0 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore $(PY) -m pip install --no-input

# Fails with the end of the log and a remedy.
fail = { tail -n 40 $(LOG); echo "error: $(1); all of it in $(LOG)"; exit 1; } >&2

$(READY): requirements.lock pyproject.toml
	@mkdir -p .make; : > $(LOG); python=; \
	if ! { $(PY) $(NEW_ENOUGH) && $(PY) -m pip --version; } >/dev/null 2>&1; then \
	  for p in $(or $(PYTHON),python3 python3.14 python3.13 python3.12 python3.11 python); do \
	    if "$$p" $(NEW_ENOUGH) >/dev/null 2>&1; then python=$$p; break; fi; \
	  done; \
	  if [ -z "$$python" ]; then \
	    echo "error: symrefine needs Python 3.11 or newer, found $$($(or $(PYTHON),python3) --version 2>&1 | tail -n 1);" \
	      "install one, or name one: make setup PYTHON=/path/to/python3.11" >&2; exit 1; \
	  fi; \
	  "$$python" -m venv --clear $(VENV) >>$(LOG) 2>&1 \
	    || $(call fail,cannot create $(VENV) (Debian and Ubuntu keep what it takes in the package python3-venv)); \
	fi; \
	echo "Setting up .venv: pinned Python packages, 2 GB on disk, a few minutes the first time"; \
	$(PIP) -r requirements.lock >>$(LOG) 2>&1 || $(call fail,cannot install requirements.lock); \
	$(PIP) --no-deps --no-build-isolation -e . >>$(LOG) 2>&1 || $(call fail,cannot install symrefine itself)
	@touch $@

$(VENV)/.docs: $(READY)
	@echo "Adding what builds the site to .venv: 160 MB"
	@$(PIP) -c requirements.lock --no-build-isolation -e '.[docs]' >>$(LOG) 2>&1 || $(call fail,cannot install the extra docs)
	@touch $@
