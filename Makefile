# `make quickstart`: from nothing to an estimated material. `make test`: lint and the suite.
# Both make .venv and install into it what they need; outside this folder only caches are written
# (pip's, and Dr.Jit's kernels in ~/.drjit).

PYTHON ?= $(shell command -v python3.11 || command -v python3)
BIN := .venv/bin
RUN := runs/quickstart
CORPUS := $(RUN)/corpus
TRAIN_COUNT := 960
TEST_COUNT := 160
PRETRAINED := lime_keras/pretrained

# `make ship WEIGHTS=runs/mine NAME=mine`: a trained run among the weights that come with the package.
# `make weights NAME=live DATA=data/`: the set of that recipe, from nothing, and among them.
WEIGHTS :=
NAME :=
DATA :=

.PHONY: quickstart test test-slow fuzz stability rooms docs commands pictures readme results graphs ship weights lint llvm clean
.DELETE_ON_ERROR:

quickstart: llvm
	$(BIN)/lime-render $(CORPUS) --split train --count $(TRAIN_COUNT)
	$(BIN)/lime-render $(CORPUS) --split test --count $(TEST_COUNT)
	$(BIN)/lime-train $(CORPUS) --out $(RUN) --preset smoke
	$(BIN)/lime-eval $(CORPUS) --weights $(RUN) --out $(RUN)
	$(BIN)/lime-export $(RUN)/exported --format savedmodel --weights $(RUN)
	$(BIN)/lime-export $(RUN)/exported --format onnx --weights $(RUN)
	$(BIN)/lime-estimate $(RUN)/examples/*.png --weights $(RUN) --out $(RUN)/materials --overwrite
	@echo "Open $(RUN)/report.html in a browser. For the commands: source .venv/bin/activate"

test: llvm lint
	$(BIN)/python -m pytest -n auto --dist loadfile --no-loadscope-reorder --durations=25

test-slow: .venv/development
	$(BIN)/python -m pytest -m slow

# Damaged inputs through every door of the program: `make fuzz MINUTES=60`; see tests/fuzz.
fuzz: MINUTES := 10
fuzz: .venv/development
	$(BIN)/python -m tests.fuzz --minutes $(MINUTES)

# Every numeric part at its extremes, with WEIGHTS as the system, if given; see tests/stability.
stability: OUT := runs/stability
stability: .venv/development
	$(BIN)/python -m tests.stability $(if $(WEIGHTS),--weights $(WEIGHTS)) --out $(OUT)

# The graphs of the weights that come with the package, which hold these weights, anew; after every
# change of what connects the subnetworks. Where nothing has changed, not a byte of them does.
graphs: .venv/installed
	for set in $(wildcard $(PRETRAINED)/*/); do \
	  $(BIN)/lime-export $$set --format graphs --weights $$set || exit 1; done

# Written in float16, then as graphs, which hold the same weights, so that those alone stay.
ship: .venv/installed
	@test -n "$(WEIGHTS)" -a -n "$(NAME)" \
	  || { echo 'error: which, and how called? make ship WEIGHTS=runs/mine NAME=mine'; exit 1; }
	$(BIN)/lime-export $(PRETRAINED)/$(NAME) --format weights --weights "$(WEIGHTS)"
	$(BIN)/lime-export $(PRETRAINED)/$(NAME) --format graphs --weights $(PRETRAINED)/$(NAME)
	rm $(PRETRAINED)/$(NAME)/model/*.weights.h5

# Hours; stopped, it goes on. What ships is of one clean commit. REUSE=runs/live takes over what is the
# same in another recipe's run.
weights: llvm
	@test -n "$(NAME)" || { echo 'error: which? make weights NAME=live DATA=data/'; exit 1; }
	@git diff --quiet HEAD -- \
	  || { echo 'error: what ships is made by a clean commit: commit or stash your changes'; exit 1; }
	$(BIN)/lime-train --recipe $(NAME) $(if $(DATA),--data "$(DATA)") \
	  $(if $(REUSE),--reuse "$(REUSE)") --out runs/$(NAME)
	$(MAKE) ship WEIGHTS=runs/$(NAME) NAME=$(NAME)

# The site, in docs/_build/index.html, with the demo in docs/_build/live. What Sphinx warns of is an
# error.
docs: .venv/docs
	$(BIN)/python -m sphinx --builder html --fail-on-warning --keep-going --quiet docs docs/_build
	$(BIN)/python docs/demo.py docs/_build/live

# The help of the commands, as text in docs/reference/commands.md.
commands: .venv/installed
	$(BIN)/python docs/command_help.py

# The pictures and clips of README and docs, from the weights that ship:
# `make pictures PICTURES="--photos photos/ --mesh teapot.ply"`.
PICTURES :=
pictures: llvm .venv/development
	$(BIN)/python docs/pictures $(PICTURES)

# The picture of the rooms in CONTRIBUTING.md, from the imports.
rooms: .venv/installed
	$(BIN)/python docs/pictures/rooms.py

# The figures of README and docs/results.md, from docs/results/*.json.
readme: .venv/installed
	$(BIN)/python docs/figures.py

# Measures again each file of docs/results whose weights, corpus or benchmark have changed, and goes
# on where it was stopped: `make results DATA=folder`, which holds the corpora. RESULTS=--list names them.
RESULTS :=
results: .venv/installed
	$(BIN)/python benchmarks/results.py $(or $(DATA),.) $(RESULTS)

lint: .venv/development .venv/typed
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# The fast renderer needs a libLLVM; where none works, one is unpacked into .venv (see docs).
llvm: .venv/installed
	$(BIN)/python -m lime_keras.render.mitsuba_setup.fetch_llvm

.venv/installed: setup.py
	@$(PYTHON) -c 'import sys; sys.exit(not (3, 11) <= sys.version_info < (3, 14))' \
	  || { echo "error: $(PYTHON) is not Python 3.11 to 3.13: install one, or pass PYTHON=..."; exit 1; }
	@$(PYTHON) -c 'import ensurepip' 2>/dev/null \
	  || { echo "error: $(PYTHON) cannot make environments: apt-get install python3-venv"; exit 1; }
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --upgrade pip
	$(BIN)/python -m pip install --editable '.[all]'
	@touch $@

# What the site takes: no TensorFlow, no Mitsuba. In an environment that has all, nothing is added.
.venv/docs:
	$(PYTHON) -m venv .venv
	$(BIN)/python -m pip install --quiet --editable '.[docs,web]'
	@touch $@

.venv/development: .venv/installed
	$(BIN)/python -m pip install --quiet --editable '.[dev]'
	@touch $@

# Where mypy finds lime_keras.render and the like, as setup.py maps them.
.venv/typed: setup.py
	mkdir -p $@/lime_keras
	ln -sfn ../../../render ../../../train ../../../eval $@/lime_keras
	@touch $@

clean:
	rm -rf .venv build *.egg-info
