# Every target does its own set-up: it finds a Python, makes a virtual environment and installs the
# package into it, again whenever a source file changed. The install is not editable, because an
# editable one would leave out the launchers and the ament index that `ros2 run` reads.

ARGS ?=
# The tests are shared among three workers: on two cores, as one often waits for other processes. A
# few of them are over before a second worker is there.
WORKERS ?= $(if $(ARGS),0,3)
VENV ?= .venv$(if $(ROS_DISTRO),-$(ROS_DISTRO))
ENV_PYTHON = $(VENV)/bin/python

# A python3.N on the PATH may be a shim that only prints an error, so each candidate is run.
find_python = for python in python3 python3.14 python3.13 python3.12 python3.11; do \
	"$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 \
	&& echo "$$python" && break; done
PYTHON ?= $(shell $(find_python))

ifneq ($(ROS_DISTRO),)
# A ROS 2 installation is sourced: its rclpy and messages are used, not the wheels. They were built
# against the system's numpy 1, whose binary interface numpy 2 does not keep.
VENV_FLAGS = --system-site-packages
DEMO_INSTALL = '.[nodes,display]' 'numpy<2'
TEST_INSTALL = '.[nodes,study,checks]' 'numpy<2'
BENCH_INSTALL = '.[bench]' 'numpy<2'
STUDY_INSTALL = '.[study]' 'numpy<2'
DOCS_INSTALL = '.[docs]' 'numpy<2'
else
VENV_FLAGS =
DEMO_INSTALL = '.[ros,display]'
TEST_INSTALL = '.[ros,test]'
BENCH_INSTALL = '.[bench]'
STUDY_INSTALL = '.[study]'
DOCS_INSTALL = '.[docs]'
unexport PYTHONPATH
endif
# Set by the ROS wheels in every process they start; it must not leak into another environment.
unexport _ROS_WHEELS_BOOTSTRAP_COMPLETE

# Folders are listed too, so that a deleted file counts as a change.
SOURCES := pyproject.toml setup.py setup.cfg package.xml $(shell find proximity_monitor scripts launch config \
	rviz resource -name __pycache__ -prune -o -print)

# The environment's launchers say `env python3`, hence the PATH. PYTHONSAFEPATH keeps the checkout
# from shadowing the installed package, in child processes as well.
RUN = PATH="$(abspath $(VENV))/bin:$$PATH" PYTHONSAFEPATH=1 \
	AMENT_PREFIX_PATH="$(abspath $(VENV))$${AMENT_PREFIX_PATH:+:$$AMENT_PREFIX_PATH}"

.NOTPARALLEL:
.PHONY: help demo test test-long indices bench robots latency accuracy docs lint format clean

help:
	@echo 'make demo [ARGS="--seconds 10"]   watch the bundled scene: a table here, a page in the browser'
	@echo 'make test [ARGS="-k scene"]       run the tests but the long ones (ARGS go to pytest instead)'
	@echo 'make test-long                    run the long ones (MARKS: which; default long)'
	@echo 'make indices                      ask every question under a check of every index'
	@echo 'make bench [ARGS="--quick"]        time the engine beside FCL and coal (--pqp DIR: PQP too)'
	@echo 'make robots [ARGS="--quick"]       all links of real robots against pinocchio and coal'
	@echo 'make latency [ARGS="--quick"]      from a pose to its closest points, across processes'
	@echo 'make accuracy [ARGS="--quick"]     what accuracy costs in time: data, figures and a page'
	@echo 'make docs                         build the site of the documents into build/docs'
	@echo 'make lint                         run the linter and check the format'
	@echo 'make format                       let the linter mend what it can, and format'
	@echo 'make clean                        remove the virtual environments and caches'
	@echo 'Variables: PYTHON (an interpreter, 3.11 or newer), VENV (default $(VENV)),'
	@echo '           WORKERS (of the tests; default 3, and 0 with ARGS: none but pytest itself).'

demo: $(VENV)/.installed-demo
	@$(RUN) $(ENV_PYTHON) -m proximity_monitor demo $(ARGS)

# The check of indices compiles all kernels once more, for itself alone.
INDICES = test/engine/test_bounds_check.py

PYTEST = $(RUN) $(ENV_PYTHON) -m pytest -n $(WORKERS) --dist loadfile --no-loadscope-reorder

test: $(VENV)/.installed-test
	$(PYTEST) $(if $(ARGS),$(ARGS),-m "not long")

MARKS ?= long

test-long: $(VENV)/.installed-test
	$(PYTEST) --ignore=$(INDICES) -m "$(MARKS)"

indices: $(VENV)/.installed-test
	$(RUN) $(ENV_PYTHON) -m pytest $(INDICES)

# The benchmark's modules lie beside its scripts, so PYTHONSAFEPATH must not hide them.
bench: $(VENV)/.installed-bench
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/compare.py $(ARGS)
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/assembly.py $(if $(findstring --quick,$(ARGS)),--quick)
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/welding.py $(if $(findstring --quick,$(ARGS)),--quick)
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/points.py
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/surfaces.py $(if $(findstring --quick,$(ARGS)),--quick)
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/revolution.py $(if $(findstring --quick,$(ARGS)),--quick)
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/depth.py $(if $(findstring --quick,$(ARGS)),--quick)
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/budget.py $(if $(findstring --quick,$(ARGS)),--quick)
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/startup.py

robots: $(VENV)/.installed-bench
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/robots.py $(ARGS)
	@$(RUN) PYTHONSAFEPATH= $(ENV_PYTHON) benchmark/cylinders.py $(if $(findstring --quick,$(ARGS)),--quick)

latency: $(VENV)/.installed-demo
	@$(RUN) $(ENV_PYTHON) benchmark/latency.py $(ARGS)

accuracy: $(VENV)/.installed-study
	@$(RUN) $(ENV_PYTHON) -m proximity_monitor.study accuracy $(ARGS)

# The keys of a scene file come from the schema; the theme prints an announcement unless told not to.
docs: $(VENV)/.installed-docs
	@$(ENV_PYTHON) tools/write_scene_keys.py
	@NO_MKDOCS_2_WARNING=1 $(ENV_PYTHON) -m mkdocs build --quiet --strict
	@echo 'The first page is build/docs/index.html'

lint: $(VENV)/.installed-test
	$(ENV_PYTHON) -m ruff check .
	$(ENV_PYTHON) -m ruff format --check .

format: $(VENV)/.installed-test
	$(ENV_PYTHON) -m ruff check --fix .
	$(ENV_PYTHON) -m ruff format .

# setuptools packs whatever an earlier build left in build/lib, deleted modules included.
define install
	@echo 'Installing into $(VENV) (the first time takes a few minutes) ...'
	@rm -rf build/lib build/bdist.* proximity_monitor.egg-info
	@$(ENV_PYTHON) -m pip install --quiet --disable-pip-version-check $(1)
	@rm -rf build/lib build/bdist.* proximity_monitor.egg-info
	@rmdir build 2>/dev/null || true
	@touch $@
endef

$(VENV)/.installed-demo: $(ENV_PYTHON) $(SOURCES)
	$(call install,$(DEMO_INSTALL))

$(VENV)/.installed-test: $(ENV_PYTHON) $(SOURCES)
	$(call install,$(TEST_INSTALL))

$(VENV)/.installed-bench: $(ENV_PYTHON) $(SOURCES)
	$(call install,$(BENCH_INSTALL))

$(VENV)/.installed-study: $(ENV_PYTHON) $(SOURCES)
	$(call install,$(STUDY_INSTALL))

$(VENV)/.installed-docs: $(ENV_PYTHON) $(SOURCES)
	$(call install,$(DOCS_INSTALL))

$(ENV_PYTHON):
	@test -n "$(PYTHON)" || { \
	echo 'No Python 3.11 or newer found on the PATH.' >&2; \
	echo 'Install one, or name it: make PYTHON=/path/to/python3.12 $(MAKECMDGOALS)' >&2; exit 1; }
	@"$(PYTHON)" -c 'import sys; sys.exit(sys.version_info < (3, 11))' || { \
	echo '$(PYTHON) does not run, or is older than 3.11.' >&2; exit 1; }
	@"$(PYTHON)" -c 'import ensurepip, venv' 2>/dev/null || { \
	echo '$(PYTHON) cannot make virtual environments: its ensurepip module is missing.' >&2; \
	echo 'On Debian and Ubuntu: sudo apt install python3-venv' >&2; exit 1; }
	@test -z "$(ROS_DISTRO)" || "$(PYTHON)" -c 'import rclpy' || { \
	echo 'ROS 2 $(ROS_DISTRO) is sourced, but $(PYTHON) cannot import its rclpy (see above).' >&2; \
	echo 'Use its interpreter (make PYTHON=/usr/bin/python3), or a shell without ROS.' >&2; exit 1; }
	@echo 'Making $(VENV) with '"$$("$(PYTHON)" --version)"' ...'
	@"$(PYTHON)" -m venv --clear $(VENV_FLAGS) "$(VENV)" || { rm -rf "$(VENV)"; exit 1; }

clean:
	rm -rf .venv .venv-* build proximity_monitor.egg-info .hypothesis .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
