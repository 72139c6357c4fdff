# Everything runs in .venv from locked versions. Paths stay relative: a checkout path may contain spaces.
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help run env test bench check consistency pictures format lock clean distclean

RECENT = import sys; sys.exit(sys.version_info < (3, 11))
# The first interpreter that is new enough; `make PYTHON=... env` overrides.
PYTHON ?= $(shell for p in python3 python3.14 python3.13 python3.12 python3.11 python; do \
	  $$p -c '$(RECENT)' 2>/dev/null && echo $$p && exit; done; echo python3)
PY := .venv/bin/python
ENV := .venv/.installed
DEV := .venv/.installed-dev
ARGS ?=
PIP := $(PY) -m pip --disable-pip-version-check --quiet

# A second BLAS thread beside a browser or another test costs far more than it gives.
test bench consistency pictures: export OPENBLAS_NUM_THREADS := 1

help:
	@echo 'make run [ARGS="..."]   start the page; ARGS are flags of `serve` or another command, e.g. ARGS="run --preset line"'
	@echo 'make env                only make the environment, in .venv (PYTHON=... picks the interpreter)'
	@echo 'make test [ARGS="..."]  all tests; ARGS go to pytest, e.g. ARGS="-k quaternion"'
	@echo 'make check              ruff, pyright, import-linter'
	@echo 'make bench              speed figures'
	@echo 'make consistency        the full statistics over seeds'
	@echo 'make pictures           take the pictures of the documentation again (needs chromium)'
	@echo 'make format             let ruff format and fix'
	@echo 'make lock               resolve the versions again'
	@echo 'make clean, distclean   remove caches; and .venv too'

# Flags alone mean `serve`.
run: $(ENV)
	@$(PY) app.py $(if $(filter-out -%,$(firstword $(ARGS))),,serve) $(ARGS)

env: $(ENV)

test: $(DEV)
	@tests/run.sh $(ARGS)

bench: $(ENV)
	@$(PY) -m benchmarks $(ARGS)

consistency: $(ENV)
	@$(PY) -m scene_core.session.study $(ARGS)

pictures: $(DEV)
	@$(PY) -m tools.pictures $(ARGS)

check: $(DEV)
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	PYRIGHT_PYTHON_IGNORE_WARNINGS=1 $(PY) -m pyright
	.venv/bin/lint-imports --no-logo

format: $(DEV)
	$(PY) -m ruff check --fix .
	$(PY) -m ruff format .

# Universal: one lock for every system and every Python from 3.11 on.
LOCK = $(PY) -m uv pip compile --universal --python-version 3.11 --upgrade --quiet \
	--annotation-style line --custom-compile-command "make lock" pyproject.toml
lock: $(DEV)
	$(PIP) install uv
	$(LOCK) --group build -o requirements.txt >/dev/null
	$(LOCK) --group dev -c requirements.txt -o requirements-dev.txt >/dev/null

clean:
	rm -rf .pytest_cache .ruff_cache .hypothesis .import_linter_cache dist *.egg-info
	find . -path ./.venv -prune -o -name __pycache__ -type d -prune -exec rm -rf {} +

distclean: clean
	rm -rf .venv

$(PY):
	@"$(PYTHON)" -c '$(RECENT)' || { \
	  echo 'Scene needs Python 3.11 or newer; "$(PYTHON)" is' \
	    "$$("$(PYTHON)" --version 2>&1 || true). Install one, or name it: make PYTHON=/path/to/python3.12 env" >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo '"$(PYTHON)" cannot make a virtual environment: its venv or ensurepip module is missing.' \
	    'On Debian or Ubuntu: apt-get install python3-venv' >&2; exit 1; }
	@"$(PYTHON)" -m venv --clear .venv

$(ENV): $(PY) requirements.txt pyproject.toml
	@echo 'Installing into .venv ...'
	@$(PIP) install -r requirements.txt
	@$(PIP) install --no-deps --no-build-isolation --editable .
	@touch $@

$(DEV): $(ENV) requirements-dev.txt
	@echo 'Installing the development tools into .venv ...'
	@$(PIP) install -r requirements-dev.txt
	@touch $@
