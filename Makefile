# Everything runs in .venv; `make` alone says what there is.
PYTHON ?= python3
BIN := .venv/bin
PIP = $(BIN)/pip install --quiet --disable-pip-version-check -c constraints.txt
RUN ?= runs/demo
DECISIONS ?= 50000
export OMP_NUM_THREADS ?= 1

.DEFAULT_GOAL := help
.PHONY: help install demo test test-slow check docs format bench clean

help:  ## say what there is
	@grep -E '^[a-z-]+:.*##' $(MAKEFILE_LIST) | sed 's/:.*##/\t/' | expand -t 14

install: .venv/.installed  ## make .venv with what tests, checks and pages need

.venv/.installed: .venv/.plays
	$(PIP) -e '.[dev,docs,thesis,sb3,tensorboard,watch,optuna,minari]'
	touch $@

# What training, evaluation, report and live page need. Its modules are compiled when they are first imported, and kept.
unexport PYTHONDONTWRITEBYTECODE
.venv/.plays: pyproject.toml constraints.txt
	test -d .venv || $(PYTHON) -m venv .venv
	$(PIP) --no-compile -e '.[watch]'
	touch $@

# While the first core compiles and learns perception, the second compiles what plans are made with.
COMPILE_PLANNING := $(BIN)/semrl train --run .venv/compiling --model ram-map --decisions 700 --dqn.learning-starts 400 \
	--planning.trees.first-decisions 300

demo: .venv/.plays  ## train on Pong for a few minutes, evaluate, write a report
	@test -e .venv/compiling || $(COMPILE_PLANNING) >/dev/null 2>&1 &
	@$(BIN)/semrl train --run $(RUN) $(if $(wildcard $(RUN)),--resume,--decisions $(DECISIONS))
	@$(BIN)/semrl eval $(RUN) --episodes 5 --video $(RUN)/video.mp4
	@$(BIN)/semrl report $(RUN)
	@echo "Next, watch it think, live in the browser:  $(BIN)/semrl watch $(RUN)"

test: install  ## the test suite, a few minutes
	$(BIN)/pytest -q -n 2

test-slow: install  ## the long tests as well: twenty kills, learning on the real game
	$(BIN)/pytest -q -n 2 -m 'slow or not slow'

check: install  ## format, lint, types, import layers
	$(BIN)/ruff format --check src tests benchmarks examples
	$(BIN)/ruff check src tests benchmarks examples
	$(BIN)/mypy
	$(BIN)/lint-imports

docs: install  ## the documentation site, build/site/index.html; a warning is an error
	$(BIN)/sphinx-build -q -W --keep-going -b html -d build/doctrees docs build/site

format: install  ## put the code in shape
	$(BIN)/ruff format src tests benchmarks examples
	$(BIN)/ruff check --fix src tests benchmarks examples

bench: install  ## time every stage, the training of every model, and maps as they grow
	$(BIN)/semrl bench --peers
	$(BIN)/python benchmarks/agents.py
	$(BIN)/python benchmarks/training.py
	$(BIN)/python benchmarks/maps.py

clean:  ## remove what is made again
	rm -rf .venv build src/*.egg-info .mypy_cache .ruff_cache .pytest_cache .import_linter_cache
