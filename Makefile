# Two commands do everything on a fresh Debian or Ubuntu machine with Python and make:
#   make demo   installs what is missing and renders a first picture
#   make test   installs what is missing and runs the tests
# And one proves the geometry:
#   make validate
# And one repeats the paper's experiments, a robot that finds itself:
#   make experiments
# And one tells what it costs, and races others:
#   make bench

.PHONY: help demo test validate experiments bench readme gallery sheets lint setup system clean

# The first Python that is new enough; say PYTHON=... to choose another.
PYTHON ?= $(shell for python in python3 python3.11 python3.12 python3.13 python3.14; do \
	"$$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2>/dev/null \
	&& { echo "$$python"; break; }; done)
VENV ?= .venv
BIN := $(VENV)/bin
SUDO := $(shell [ "$$(id -u)" = 0 ] || echo sudo)

help:
	@echo "Each installs what is missing first."
	@echo "make demo         render a first picture"
	@echo "make test         run the tests"
	@echo "make validate     prove the geometry: out/validation"
	@echo "make experiments  repeat the paper's experiments: out/experiments"
	@echo "make bench        the paper's Fig. 10, and the race against others: out/benchmarks"
	@echo "make readme       prove the geometry, and put numbers and figures into README"
	@echo "make gallery      render one scene through every camera model: omnisim/cameras/gallery"
	@echo "make sheets       every channel of ground truth, every degradation: omnisim/sensors/sheets"
	@echo "make clean        remove what these made"

demo: setup
	@mkdir -p out
	@$(BIN)/omnisim render courtyard --size 720 -o out/courtyard.png
	@echo "Your first picture: $(CURDIR)/out/courtyard.png"

test: setup lint
	$(BIN)/python -m pytest

validate: setup
	@mkdir -p out
	$(BIN)/omnisim validate -o out/validation

experiments: setup
	@mkdir -p out
	$(BIN)/omnisim experiments -o out/experiments

# Ends with an error where a bound does not hold, after all suites have run.
bench: setup
	$(BIN)/python -m benchmarks all -o out/benchmarks

readme: validate
	$(BIN)/python .ci/renew_readme.py out/validation

gallery: setup
	$(BIN)/python .ci/make_gallery.py

sheets: setup
	@mkdir -p omnisim/sensors/sheets
	$(BIN)/python -m omnisim.plots.ground_truth_sheet omnisim/sensors/sheets/ground-truth.jpg
	$(BIN)/python -m omnisim.plots.degradation_sheet omnisim/sensors/sheets/degradations.jpg

lint: setup
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy

setup: $(VENV)/.installed

$(VENV)/.installed: pyproject.toml constraints.txt | system
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check \
		--constraint constraints.txt --editable '.[dev,oracles,video]'
	@touch $@

# What pip cannot install: OpenGL, what Mitsuba needs, and on Debian also Python's own venv. Nothing
# is installed where nothing is missing.
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
