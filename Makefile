# The commands of this project. `make demo` and `make test` each work as the first command on a machine
# with Python 3.11+ and a C++ compiler.

PYTHON ?= python3
VENV := .venv
RUN := $(VENV)/bin/python
PIP := $(VENV)/bin/pip install --quiet --disable-pip-version-check -c constraints.txt
CORE := $(shell find intersection_env/core -type f)
CXX_SOURCES := $(filter %.hpp %.cpp,$(CORE)) $(wildcard examples/*/*.cpp tests/hardening/*/*.hpp tests/hardening/*/*.cpp)
RECORDINGS ?= data/recordings
# Maps of one's own: their files (.json, .map), or names of maps that ship. Without, every one that ships and has recordings.
MAP ?=
MAPS := $(if $(MAP),--map $(MAP))
SEEDS ?= 0 1 2

.PHONY: demo setup check test harden clients bench reproduce ablations real train gap maps recordings recorded statistics pages format clean

demo: $(VENV)/.package
	$(RUN) -m experiments.demo --recordings $(RECORDINGS) $(if $(MAP),--map $(firstword $(MAP)))

setup: $(VENV)/.development

check: setup
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/clang-format --dry-run -Werror $(CXX_SOURCES)

test: setup
	$(RUN) -m pytest -n 2

# The core made to fail: sanitizers, fuzzers, valgrind, clang, ARM64, a long soak; trainings shared by Ray; obedience.
harden: setup
	bash .ci/harden

# The examples that learn with other libraries, each in an environment of its own (out/clients), which takes a while.
clients: setup
	$(RUN) -m tests.clients $(CLIENTS)

bench: $(VENV)/.bench
	$(RUN) -m experiments.bench

maps: setup
	$(RUN) -m intersection_env.maps

recordings: setup
	$(RUN) -m data.sumo

# The scenes that ship in the wheel, from the recordings that ship.
recorded: $(VENV)/.package
	$(RUN) -m data.build data/recordings --out intersection_env/scenes

# Every table and figure of the paper: trains, measures, writes experiments/results/report.html. Goes on where it was
# interrupted.
reproduce: setup
	$(RUN) -m experiments.reproduce --recordings $(RECORDINGS) $(MAPS) --seeds $(SEEDS)

# What each part is worth, on the development recordings; trains first what is not trained yet.
ablations: setup
	$(RUN) -m experiments.reproduce.ablations --recordings $(RECORDINGS) $(MAPS) --seeds $(SEEDS)

# All that ships, scored on somebody's recordings, on one page: out/real/real.html.
real: setup
	$(RUN) -m experiments.real --recordings $(RECORDINGS) $(MAPS)

# The training half of `make reproduce`, whose policies then ship.
train: setup
	$(RUN) -m experiments.reproduce --recordings $(RECORDINGS) $(MAPS) --seeds $(SEEDS) --only training --ship

# The gap network alone.
gap: setup
	rm -rf out/scenes
	$(RUN) -m data.build $(RECORDINGS) $(MAPS) --out out/scenes
	$(RUN) -m agents.gap default --scenes out/scenes/*.npz $(MAPS) --run runs/gap $(RESUME)
	cp runs/gap/gap.policy intersection_env/policies/gap.policy

statistics: $(VENV)/.package
	rm -rf out/scenes
	$(RUN) -m data.build $(RECORDINGS) $(MAPS) --out out/scenes
	$(RUN) -m data.describe.statistics out/scenes/*.npz $(MAPS)

# Measures anew, and makes the pages of docs/ that are generated: results files and pictures first, then the pages.
pages: demo reproduce bench
	cp out/demo/errors.csv experiments/results/errors.csv
	cp out/demo/positions.png docs/pictures/positions.png
	cp out/demo/forecast.png docs/pictures/forecast.png
	$(RUN) -m intersection_env.plots bendplatz --out docs/pictures/bendplatz.png
	$(RUN) -m intersection_env.plots t_junction --out docs/pictures/t_junction.png
	$(RUN) -m intersection_env.plots crossroads --out docs/pictures/crossroads.png
	$(RUN) -m data.build $(RECORDINGS) --map bendplatz --out out/scenes.npz
	$(RUN) -m experiments.gap --scenes out/scenes.npz --out out --figure docs/pictures/gap_acceptance.png
	$(RUN) -m experiments.documentation.environments
	$(RUN) -m experiments.documentation.results

format: setup
	$(VENV)/bin/ruff check --fix .
	$(VENV)/bin/ruff format .
	$(VENV)/bin/clang-format -i $(CXX_SOURCES)

clean:
	rm -rf $(VENV) build dist out

$(VENV)/.tools: constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(PIP) scikit-build-core nanobind cmake ninja
	touch $@

$(VENV)/.package: $(VENV)/.tools pyproject.toml $(CORE)
	$(PIP) --no-build-isolation -e '.[data,render]'
	touch $@

$(VENV)/.development: $(VENV)/.package
	$(PIP) --no-build-isolation -e '.[data,render,sumo,train,tensorboard,ray,dev]'
	touch $@

$(VENV)/.bench: $(VENV)/.development
	$(PIP) --no-build-isolation -e '.[data,render,sumo,train,tensorboard,ray,dev,bench]'
	touch $@
