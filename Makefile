# Everything a fresh machine needs: Python 3.11 or newer, and make.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
DEMO   := demo
# What the tests were last run with, on Python 3.11; CONSTRAINTS= for the newest there is.
CONSTRAINTS ?= constraints.txt

# Tests start Python a hundred times: keep what it compiles.
test test-all lint: export PYTHONDONTWRITEBYTECODE =

.PHONY: demo demo-live test test-all test-oldest oldest test-lerobot ready lint constraints dist docs ablation clean

# setuptools warns of every editable install.
PIP = PYTHONWARNINGS=ignore $(BIN)/python -m pip install --quiet --disable-pip-version-check
TESTED_WITH = $(addprefix -c ,$(CONSTRAINTS))

$(BIN)/python:
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)

# The package with what the demo draws and reports; again whenever pyproject.toml changes.
$(VENV)/.installed: pyproject.toml | $(BIN)/python
	$(PIP) -e '.[report]'
	@$(MAKE) --no-print-directory ready

# What editors read beside the code.
ready:
	@$(BIN)/tactograph schema > pipelines/pipeline.schema.json
	@touch $(VENV)/.installed

demo: $(VENV)/.installed
	@$(BIN)/tactograph demo --out $(DEMO)

# A simulated sensor, pressed by a moving ball, as a live stream of heights.
LIVE_SECONDS ?= 20
demo-live: $(VENV)/.installed
	TACTOGRAPH=$(BIN)/tactograph sh benchmarks/live.sh $(DEMO)/live $(LIVE_SECONDS)

# What 'make test' needs: few packages, and an OpenCL device that works.  Python compiles the third
# of their files that it imports; pip takes 20 seconds to compile all.  A pip of years ago, as
# Python 3.11 brings, takes 7 seconds longer than a new one to compare files with the platform.
$(VENV)/.tested: pyproject.toml $(CONSTRAINTS) | $(BIN)/python
	$(PIP) --no-compile --upgrade pip
	$(PIP) --no-compile $(TESTED_WITH) -e '.[test]'
	@$(MAKE) --no-print-directory ready
	sh tests/install_system.sh $(BIN) device
	@touch $@

# What 'make test-all' needs: all extras, VkFFT, a browser, a simulator, and ROS 2.
$(VENV)/.tested-all: $(VENV)/.tested
	sh tests/install_system.sh $(BIN) all
	sh tests/install_ros2.sh $(VENV)/ros2 $(BIN)/python
	VKFFT_BACKEND=opencl $(PIP) $(TESTED_WITH) -e '.[test-all]'
	@touch $@

# Two workers on two cores: threads of OpenBLAS would only wait for one another.  Each begins
# with a half of the tests, so that neighbours share what they make.
PYTEST = OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal

# Every statement about heights, graphs, kernels and pages, in five minutes from nothing.
test: $(VENV)/.tested
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/tactograph devices --require
	$(PYTEST) -m 'not slow and not realtime'

# The rest: all cases, types, ROS 2, browser, simulators, the site, and what needs a quiet machine.
test-all: $(VENV)/.tested-all lint test-oldest
	$(PYTEST) -m 'slow and not realtime'
	$(BIN)/python -m pytest -m realtime

# The lowest versions that pyproject.toml allows, in an environment of their own; tests of
# what packages give: arrays, files, commands, kernels.
OLDEST = .venv-oldest
OLDEST_TESTS = tests/graph/run tests/graph/files tests/graph/test_command.py tests/graph/compare \
    rings/batch/tests tests/nodes/capture tests/nodes/write tests/nodes/files tests/nodes/height
test-oldest:
	@$(MAKE) --no-print-directory VENV=$(OLDEST) CONSTRAINTS=tests/oldest.txt $(OLDEST)/.tested
	$(subst $(BIN),$(OLDEST)/bin,$(PYTEST)) -m 'not slow and not realtime' $(OLDEST_TESTS)

# What 'make test-oldest' installs: again whenever a bound of pyproject.toml moves.
oldest: $(VENV)/.tested
	$(PIP) uv
	$(BIN)/uv pip compile pyproject.toml --extra test --resolution lowest-direct \
	    --python-version 3.11 --no-header --no-annotate --upgrade --quiet -o tests/oldest.txt

# Types are read from the packages of some extras.
$(VENV)/.linted: $(VENV)/.tested
	$(PIP) $(TESTED_WITH) -e '.[lint]'
	@touch $@

# LeRobot brings PyTorch, several GB, and holds older versions of what is here: an environment of
# its own, 'make test-lerobot VENV=.venv-lerobot CONSTRAINTS='.
test-lerobot: $(VENV)/.tested
	$(PIP) -e '.[lerobot]'
	$(BIN)/python -m pytest -k lerobot rings/recording/tests

# mypy cannot follow an editable install, so it reads one of copied files.
lint: $(VENV)/.linted
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	rm -rf build/typed build/lib
	$(PIP) --no-deps --target build/typed .
	MYPYPATH=build/typed $(BIN)/mypy --python-executable $(BIN)/python -p tactograph

# Once all tests have passed with newer versions: make clean test-all CONSTRAINTS=, then this.
constraints: $(VENV)/.tested-all
	$(BIN)/python -m pip freeze --exclude-editable > constraints.txt

# Wheel and source in dist/; the wheel runs the demo in an environment that holds nothing else.
dist: $(VENV)/.installed
	rm -rf dist build/lib build/empty
	$(PIP) build
	$(BIN)/python -m build --outdir dist .
	$(PYTHON) -m venv build/empty
	build/empty/bin/python -m pip install --quiet --disable-pip-version-check "$$(ls $(CURDIR)/dist/*.whl)[report]"
	cd build/empty && bin/tactograph demo --out demo

# The documentation as a site, in build/site; links and commands are checked by the tests.
docs: $(VENV)/.tested-all
	DISABLE_MKDOCS_2_WARNING=true $(BIN)/python -m mkdocs build --strict --quiet
	@echo build/site/index.html

# The figures and pictures of docs/ablation.md; several minutes.
ablation: $(VENV)/.installed
	TACTOGRAPH=$(BIN)/tactograph PYTHON=$(BIN)/python sh benchmarks/ablation.sh out/ablation

clean:
	rm -rf $(VENV) $(OLDEST) $(DEMO) build dist *.egg-info
