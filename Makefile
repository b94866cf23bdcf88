# On a fresh Debian or Ubuntu machine with Python and make, each target installs what it needs:
#   make demo          installs omnisim alone, and renders a first image
#   make test          runs the quick tests
#   make test-all      runs linters and all tests
#   make validate      validates the geometry
#   make experiments   repeats the paper's experiments in self-localization
#   make bench         measures performance, also that of other renderers
#   make report-card   evaluates third-party odometry and SLAM on simulated drives

.PHONY: help demo test test-all validate experiments bench report-card docs readme gallery sheets live-image lint core setup \
	system clean

# The first Python that is new enough; override with PYTHON=...
PYTHON ?= $(shell for python in python3 python3.11 python3.12 python3.13 python3.14; do \
	"$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	&& { echo "$$python"; break; }; done)
VENV ?= .venv
# Packages are compiled when they are first imported, and must stay so.
unexport PYTHONDONTWRITEBYTECODE
BIN := $(VENV)/bin
SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo)

help:
	@echo "Each target first installs what it needs, demo omnisim alone, the others all there is."
	@echo "make demo         render a first image: out/courtyard.png"
	@echo "make test         run the quick tests"
	@echo "make test-all     run linters and all tests, of the documentation too"
	@echo "make lint         run ruff and mypy"
	@echo "make validate     validate the geometry: out/validation"
	@echo "make experiments  repeat the paper's experiments in self-localization: out/experiments"
	@echo "make bench        measure performance, also of other renderers: out/benchmarks"
	@echo "make report-card  evaluate third-party odometry and SLAM on simulated drives: out/report-card"
	@echo "make docs         build the documentation: out/docs"
	@echo "make readme       validate, and update measures and figures in the documentation"
	@echo "make gallery      render a scene through all cameras and optics: their galleries"
	@echo "make sheets       render every channel and degradation: omnisim/rendering/camera/sheets"
	@echo "make live-image   drive the live page in Chromium: docs/how-to/live.jpg, live.mp4"
	@echo "make clean        remove the environment and all outputs"

demo: core
	@mkdir -p out
	@$(BIN)/omnisim render courtyard --size 720 -o out/courtyard.png
	@echo "Your first image: $(CURDIR)/out/courtyard.png"
	@echo "Look around in a browser: $(BIN)/omnisim live soccer --robot p2at --open"

# Ends with the number of slow tests left out.
# Two processes that rasterize on their own thread take half the time of one with two threads more.
# Each gets half of the tests in their order, so that modules share fixtures, and at the end takes
# over part of the other's.
PYTEST := LP_NUM_THREADS=0 $(BIN)/python -m pytest -n 2 --dist worksteal

test: setup
	$(PYTEST) -m "not slow"
	@echo "Slow tests are left out: make test-all runs them, too"

test-all: setup lint
	$(PYTEST)

validate: setup
	@mkdir -p out
	$(BIN)/omnisim validate -o out/validation

experiments: setup
	@mkdir -p out
	$(BIN)/omnisim experiments -o out/experiments

# Fails if a bound does not hold, after all suites have run.
bench: setup
	$(BIN)/python -m benchmarks all -o out/benchmarks

# An interrupted card resumes. ORB-SLAM3 has an extra of its own, since its license is the GPL; without
# it, its rows of the report say so.
report-card: setup
	@mkdir -p out
	-$(PIP_INSTALL) --editable '.[orb-slam3]'
	$(BIN)/python .ci/make_report_card.py out/report-card

docs: setup
	$(BIN)/python -m sphinx -q -W -b html docs out/docs

readme: validate
	$(BIN)/python .ci/renew_readme.py out/validation

gallery: setup
	$(BIN)/python .ci/make_gallery.py
	$(BIN)/python .ci/make_optics_gallery.py

sheets: setup
	@mkdir -p omnisim/rendering/camera/sheets
	$(BIN)/python .ci/make_ground_truth_sheet.py omnisim/rendering/camera/sheets/ground-truth.jpg
	$(BIN)/python .ci/make_boxes_3d_sheet.py omnisim/rendering/camera/sheets/boxes-3d.jpg
	$(BIN)/python .ci/make_image_figures.py
	$(BIN)/python -m omnisim generate examples/plan.toml --preview 2 -o docs/how-to/data-set.jpg
	$(BIN)/python .ci/make_world_image.py docs/how-to/match.jpg
	$(BIN)/python .ci/make_catalog_sheet.py docs/how-to/catalog.jpg
	$(MAKE) live-image
	$(BIN)/python .ci/make_light_images.py docs/how-to/light.jpg
	$(BIN)/python .ci/make_baked_image.py docs/how-to/baked.jpg
	$(BIN)/python .ci/make_degradation_sheet.py omnisim/rendering/camera/sheets/degradations.jpg

live-image: setup
	$(BIN)/python .ci/make_live_images.py

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

# Python compiles modules when they are first imported: a quarter of the time and 55 MB less.
PIP_INSTALL := $(BIN)/python -m pip install --quiet --disable-pip-version-check --no-compile \
	--constraint constraints.txt

# What a user installs.
core: $(VENV)/.core

# That, every extra, and what tests, documentation and comparisons need.
setup: $(VENV)/.complete

# Each file is newer than what it was installed from: an install that was interrupted has none.
$(VENV)/.core: pyproject.toml constraints.txt | system
	@rm -f $@
	$(PYTHON) -m venv $(VENV)
	$(PIP_INSTALL) --editable .
	@touch $@

$(VENV)/.complete: $(VENV)/.core
	@rm -f $@
	$(PIP_INSTALL) --editable '.[all,dev,docs,oracles]'
	@touch $@

# System packages that pip cannot install: OpenGL, Mitsuba's libatomic, and on Debian Python's venv.
# Without missing ones this does nothing.
system:
	@if [ -z "$(PYTHON)" ]; then \
		echo "omnisim needs Python 3.11 or newer: sudo apt-get install python3"; exit 1; fi
	@missing=""; \
	libraries="$$(PATH="$$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null)"; \
	for pair in libEGL.so.1:libegl1 libGL.so.1:libgl1 libatomic.so.1:libatomic1; do \
		echo "$$libraries" | grep -q "$${pair%%:*}" || missing="$$missing $${pair##*:}"; done; \
	ls /usr/share/glvnd/egl_vendor.d/*.json /etc/glvnd/egl_vendor.d/*.json 2>/dev/null \
		| grep -qv mesa || ls /usr/lib/*/dri/swrast_dri.so /usr/lib/*/libgallium-*.so 2>/dev/null \
		| grep -q . || missing="$$missing libgl1-mesa-dri"; \
	"$(PYTHON)" -c 'import venv, ensurepip' 2>/dev/null || missing="$$missing python3-venv"; \
	[ -e /etc/ssl/certs/ca-certificates.crt ] || missing="$$missing ca-certificates"; \
	if [ -n "$$missing" ]; then \
		echo "Installing$$missing"; \
		if ! command -v apt-get >/dev/null; then \
			echo "There is no apt-get here: install these by hand, then run make again"; exit 1; fi; \
		$(SUDO) apt-get update -qq \
		&& DEBIAN_FRONTEND=noninteractive $(SUDO) apt-get install -qq -y \
			--no-install-recommends $$missing >/dev/null; fi

clean:
	rm -rf $(VENV) out .pytest_cache .ruff_cache .mypy_cache
