# The commands of this project; `make help` lists them. `make demo`, `make test` and `make docs` each work as the first
# command on a machine with Python 3.11+ and a C++ compiler.

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

.PHONY: help versions demo setup check test harden clients commonroad browser bench reproduce ablations real train gap maps recordings recorded statistics pages docs format clean

help: ## these lines
	@sed -nE 's/^([a-z]+):.*## (.*)/\1\t\2/p' $(MAKEFILE_LIST) | expand -t 14

demo: $(VENV)/.package ## from the recordings that ship: crossing orders ranked, pictures, an error table (out/demo)
	$(RUN) -m experiments.demo --recordings $(RECORDINGS) $(if $(MAP),--map $(firstword $(MAP)))

setup: $(VENV)/.development ## everything for development, into .venv

check: setup ## ruff, mypy, clang-format
	$(VENV)/bin/ruff check .
	$(VENV)/bin/ruff format --check .
	$(VENV)/bin/mypy
	$(VENV)/bin/clang-format --dry-run -Werror $(CXX_SOURCES)

test: setup ## all tests
	$(RUN) -m pytest -n 2

# The core made to fail: sanitizers, fuzzers, valgrind, clang, ARM64, a long soak; trainings shared by Ray; obedience;
# and the documentation, which takes a minute.
harden: setup ## sanitizers, fuzzing, valgrind, other compilers; needs more packages (CONTRIBUTING.md)
	bash .ci/harden

versions: $(VENV)/.tools ## the wheel with the lowest and the newest versions of what it needs, in environments of their own
	bash .ci/versions

# The examples that learn with other libraries, each in an environment of its own (out/clients), which takes a while.
clients: setup ## runs the examples with other libraries, each in an environment of its own
	$(RUN) -m tests.clients $(CLIENTS)

# CommonRoad's protobuf files, written by versions of its own library, each in an environment of its own (out/commonroad).
commonroad: setup ## reads scenarios that commonroad-io wrote, and compares them with their XML
	$(RUN) -m tests.commonroad

# The viewer in Chromium, which must be there: apt-get install chromium chromium-driver.
browser: setup ## tries the viewer in a real browser (Chromium)
	$(RUN) -m pytest -m browser -s tests/viewer

bench: $(VENV)/.bench ## times all beside others' work; AGAINST=revision: beside that, pair by pair
	$(RUN) -m experiments.bench$(if $(AGAINST),.against $(AGAINST))

maps: setup ## compiles the maps that ship
	$(RUN) -m intersection_env.maps --shipped

recordings: setup ## simulates the recordings that ship
	$(RUN) -m data.sumo

# The scenes that ship in the wheel, from the recordings that ship.
recorded: $(VENV)/.package ## makes the scenes that ship
	$(RUN) -m data.build data/recordings --out intersection_env/scenes

# Every table and figure of the paper: trains, measures, writes experiments/results/report.html. Goes on where it was
# interrupted.
reproduce: setup ## every table and figure of the paper; goes on where it was interrupted
	$(RUN) -m experiments.reproduce --recordings $(RECORDINGS) $(MAPS) --seeds $(SEEDS)

# What each part is worth, on the development recordings; trains first what is not trained yet.
ablations: setup ## what each part is worth
	$(RUN) -m experiments.reproduce.ablations --recordings $(RECORDINGS) $(MAPS) --seeds $(SEEDS)

# All that ships, scored on somebody's recordings, on one page: out/real/real.html.
real: setup ## all that ships, scored on somebody's recordings: RECORDINGS=folder MAP=mine.json
	$(RUN) -m experiments.real --recordings $(RECORDINGS) $(MAPS)

# The training half of `make reproduce`, whose policies then ship.
train: setup ## the policies that ship
	$(RUN) -m experiments.reproduce --recordings $(RECORDINGS) $(MAPS) --seeds $(SEEDS) --only training --ship

# The gap network alone.
gap: setup ## the gap network alone, into runs/gap
	rm -rf out/scenes
	$(RUN) -m data.build $(RECORDINGS) $(MAPS) --out out/scenes
	$(RUN) -m agents.gap default --scenes out/scenes/*.npz $(MAPS) --run runs/gap $(RESUME)
	@echo "The gap.policy that ships stays as it is: forecasts belong to it (make train makes them anew, and ships)."

statistics: $(VENV)/.package ## what recordings are like
	rm -rf out/scenes
	$(RUN) -m data.build $(RECORDINGS) $(MAPS) --out out/scenes
	$(RUN) -m data.describe.statistics out/scenes/*.npz $(MAPS)

# Measures anew, and makes the pages of docs/ that are generated: results files and pictures first, then the pages.
pages: demo reproduce bench ## measures anew and makes the pages of docs/ that are generated
	cp out/demo/errors.csv experiments/results/errors.csv
	cp out/demo/positions.png docs/pictures/positions.png
	cp out/demo/forecast.png docs/pictures/forecast.png
	$(RUN) -m intersection_env.plots bendplatz --out docs/pictures/bendplatz.png
	$(RUN) -m intersection_env.plots t_junction --out docs/pictures/t_junction.png
	$(RUN) -m intersection_env.plots crossroads --out docs/pictures/crossroads.png
	$(RUN) -m intersection_env.plots all_way_stop --out docs/pictures/all_way_stop.png
	$(RUN) -m intersection_env.plots roundabout --out docs/pictures/roundabout.png
	$(RUN) -m data.build $(RECORDINGS) --map bendplatz --out out/scenes.npz
	$(RUN) -m experiments.gap --scenes out/scenes.npz --out out --figure docs/pictures/gap_acceptance.png
	$(RUN) -m experiments.documentation.environments
	$(RUN) -m experiments.documentation.viewer
	$(RUN) -m experiments.documentation.results

# Read anew each time, since what Sphinx warned of once it does not say again.
docs: $(VENV)/.docs ## the documentation as a site (out/docs/index.html): notebooks executed, links checked
	rm -rf out/docs
	$(RUN) -m sphinx -c docs -E -W --keep-going -n -q -d out/doctrees . out/docs
	@echo "written: out/docs/index.html"

format: setup ## formats Python and C++
	$(VENV)/bin/ruff check --fix .
	$(VENV)/bin/ruff format .
	$(VENV)/bin/clang-format -i $(CXX_SOURCES)

clean: ## removes .venv, build, dist and out
	rm -rf $(VENV) build dist out

$(VENV)/.tools: constraints.txt
	$(PYTHON) -m venv $(VENV)
	$(PIP) scikit-build-core nanobind cmake ninja
	touch $@

$(VENV)/.package: $(VENV)/.tools pyproject.toml $(CORE)
	$(PIP) --no-build-isolation -e '.[data,render]'
	touch $@

$(VENV)/.docs: $(VENV)/.package
	$(PIP) --no-build-isolation -e '.[data,render,docs]'
	touch $@

$(VENV)/.development: $(VENV)/.package
	$(PIP) --no-build-isolation -e '.[data,render,sumo,train,tensorboard,ray,dev]'
	touch $@

$(VENV)/.bench: $(VENV)/.development
	$(PIP) --no-build-isolation -e '.[data,render,sumo,train,tensorboard,ray,dev,bench]'
	touch $@
