# Everything a fresh machine needs: Python 3.11 or newer, and make.
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin
DEMO   := demo
# What the tests were last run with, on Python 3.11; CONSTRAINTS= for the newest there is.
CONSTRAINTS ?= constraints.txt

# Tests start Python a hundred times: keep what it compiles.
test lint: export PYTHONDONTWRITEBYTECODE =

.PHONY: demo demo-live test types lint constraints docs ablation clean

# The package and its dependencies; again whenever pyproject.toml changes.
$(VENV)/.installed: pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Python 3.11 or newer is needed: make PYTHON=python3.11")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -e .
	@$(MAKE) --no-print-directory types
	@# What editors read beside the shipped graphs; it follows from the nodes.
	@$(BIN)/tactograph schema > pipelines/pipeline.schema.json
	@touch $@

# Type checkers cannot follow an editable install: show them a folder that holds the package alone.
TYPING := $(CURDIR)/.typing
types:
	@test -L $(TYPING)/tactograph || { rm -rf $(TYPING); mkdir $(TYPING); ln -s ../tactograph $(TYPING); }
	@echo '$(TYPING)' > "$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))')/tactograph-types.pth"

demo: $(VENV)/.installed
	@$(BIN)/tactograph demo --out $(DEMO)

# A simulated sensor, pressed by a moving ball, as a live stream of heights.
LIVE_SECONDS ?= 20
demo-live: $(VENV)/.installed
	TACTOGRAPH=$(BIN)/tactograph sh benchmarks/live.sh $(DEMO)/live $(LIVE_SECONDS)

# What the tests need beyond that: VkFFT, an OpenCL device that works, a browser, and ROS 2.
$(VENV)/.tested: $(VENV)/.installed $(CONSTRAINTS)
	sh tests/install_system.sh $(BIN)
	sh tests/install_ros2.sh $(VENV)/ros2 $(BIN)/python
	VKFFT_BACKEND=opencl $(BIN)/python -m pip install --quiet --disable-pip-version-check $(addprefix -c ,$(CONSTRAINTS)) -e '.[test,lint,docs,vkfft]'
	@touch $@

test: $(VENV)/.tested lint
	$(BIN)/tactograph devices --require
	@# Two workers on two cores: threads of OpenBLAS would only wait for one another.  Each
	@# begins with a half of the tests, so that neighbours share what they make.
	OPENBLAS_NUM_THREADS=1 $(BIN)/python -m pytest -n 2 --dist worksteal -m 'not realtime'
	$(BIN)/python -m pytest -m realtime

lint: $(VENV)/.tested types
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	MYPYPATH=$(TYPING) $(BIN)/mypy -m tactograph -p tactograph.graph -p tactograph.nodes

# Once the tests have passed with newer versions: make clean test CONSTRAINTS=, then this.
constraints: $(VENV)/.tested
	$(BIN)/python -m pip freeze --exclude-editable > constraints.txt

# The documentation as a site, in build/site; links and commands are checked by the tests.
docs: $(VENV)/.tested
	DISABLE_MKDOCS_2_WARNING=true $(BIN)/python -m mkdocs build --strict --quiet
	@echo build/site/index.html

# The figures and pictures of docs/ablation.md; several minutes.
ablation: $(VENV)/.installed
	TACTOGRAPH=$(BIN)/tactograph PYTHON=$(BIN)/python sh benchmarks/ablation.sh out/ablation

clean:
	rm -rf $(VENV) .typing $(DEMO) build *.egg-info
