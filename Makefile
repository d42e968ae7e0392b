# Everything that is done with rthstrack, in one place. Needed: Python 3.11 or newer, a Rust toolchain with its linker.
SHELL := bash
.SHELLFLAGS := -euo pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:
.NOTPARALLEL:
MAKEFLAGS += --no-builtin-rules --no-print-directory

PYTHON ?= python3
BIN := .venv/bin
OUT := build
PEERS := $(OUT)/peers
PREFIX ?= /usr/local
SCRIPTS := $(filter-out %.min.js,$(wildcard python/rthstrack/assets/*.js python/rthstrack/assets/*/*.js))
# One interpreter for every cargo command: with another, cargo would build the bindings anew each time.
export PYO3_PYTHON := $(CURDIR)/$(BIN)/python
export MPLBACKEND := Agg

RUST_SOURCES := $(shell find crates -name '*.rs' -o -name Cargo.toml) Cargo.toml $(wildcard Cargo.lock) pyproject.toml
ifeq (,$(wildcard python/rthstrack/_core.*))
BUILT_STAMP_IS_STALE := $(shell rm -f .venv/built)
endif

say = @printf '\n\033[1m== %s\033[0m\n' "$(1)"
# cargo succeeds when a filter leaves nothing to run; this does not.
ran_some = awk '/^test result: ok/ {n += $$4} END {if (n == 0) {print "make: no test ran in $(1)"; exit 1}; print n " passed"}' $(1)

.PHONY: help
help: ## this list
	@awk -F ':.*## ' '/^[a-z-]+:.*## / {printf "  make %-14s %s\n", $$1, $$2}' $(MAKEFILE_LIST)

.PHONY: setup
setup: .venv/built ## the virtual environment, with the package built into it

.PHONY: demo
demo: .venv/built ## evaluates a record of a test: printed verdict and HTML report
	@$(BIN)/python examples/demo.py

.PHONY: demo-live
demo-live: .venv/built ## a test sent at its own pace, watched by the monitor: table here, live page in the browser
	@$(BIN)/python examples/live/demo.py

.PHONY: test
test: lint test-rust test-stubs test-doctests test-examples test-python ## every check; what continuous integration runs

.PHONY: lint
lint: .venv/ready toolchain ## formatting, lints and types of Rust and Python; which room imports which
	$(call say,format and lints: Rust)
	@cargo fmt --all --check
	@cargo clippy --workspace --all-targets --locked --quiet -- -D warnings
	$(call say,format and lints: Python)
	@$(BIN)/ruff check
	@$(BIN)/ruff format --check
	@$(BIN)/mypy -p rthstrack
	@$(BIN)/mypy --strict reference/*.py
	$(call say,rooms of the Python package)
	@PYTHONPATH=python $(BIN)/lint-imports --no-logo --no-cache
	$(call say,format and lints: JavaScript)
	@$(BIN)/oxlint --deny-warnings $(SCRIPTS)
	@$(BIN)/oxfmt --check $(SCRIPTS)

.PHONY: test-rust
test-rust: .venv/ready toolchain ## Rust tests and doctests
	$(call say,Rust tests)
	@mkdir -p $(OUT)
	@cargo test --workspace --locked --quiet --lib --bins --tests 2>&1 | tee $(OUT)/rust-tests.log
	@$(call ran_some,$(OUT)/rust-tests.log)
	$(call say,Rust doctests)
	@cargo test --workspace --locked --quiet --doc 2>&1 | tee $(OUT)/rust-doctests.log
	@$(call ran_some,$(OUT)/rust-doctests.log)

.PHONY: test-stubs
test-stubs: .venv/built ## the stub of the compiled module against the module
	$(call say,stub of rthstrack._core)
	@$(BIN)/python -m mypy.stubtest rthstrack._core

.PHONY: test-doctests
test-doctests: .venv/built ## examples in Python docstrings
	$(call say,Python doctests)
	@$(BIN)/pytest --doctest-modules python/rthstrack

.PHONY: test-examples
test-examples: .venv/built ## every file of examples/, run as it is
	$(call say,examples)
	@mkdir -p $(OUT)/examples; root=$$PWD; n=0; \
	for file in examples/*.py; do \
		[ -e "$$file" ] || continue; \
		echo "$$file"; \
		(cd $(OUT)/examples && "$$root/$(BIN)/python" -W error "$$root/$$file" > "$$(basename "$$file" .py).log"); \
		n=$$((n + 1)); \
	done; \
	[ $$n -gt 0 ] || { echo "make: there is no file in examples/"; exit 1; }; \
	echo "$$n run"

.PHONY: test-python
test-python: .venv/built ## Python tests; browser tests where there is a Chromium
	$(call say,Python tests)
	@command -v chromium || command -v chromium-browser || command -v google-chrome \
		|| echo "NO CHROMIUM FOUND: the browser tests will be skipped (Debian: apt-get install chromium)"
	@$(BIN)/pytest -n auto --dist loadfile

.PHONY: install-c
install-c: toolchain ## C interface: header, libraries, pkg-config file under PREFIX (/usr/local unless given)
	@crates/capi/install.sh "$(PREFIX)"

.PHONY: fuzz
fuzz: .venv/built toolchain ## odd input at length: 1,000,000 for the monitor's parsers, 200,000 for our readers and the evaluation, 5,000 for each library's reader
	$(call say,fuzz tests)
	@mkdir -p $(OUT)
	@RTHSTRACK_FUZZ=200000 cargo test --workspace --exclude rthstrack-live --locked --test fuzz 2>&1 | tee $(OUT)/fuzz.log
	@RTHSTRACK_FUZZ=1000000 cargo test --package rthstrack-live --locked --test fuzz 2>&1 | tee -a $(OUT)/fuzz.log
	@$(call ran_some,$(OUT)/fuzz.log)
	@RTHSTRACK_FUZZ=5000 RTHSTRACK_FUZZ_OWN=200000 $(BIN)/pytest tests/test_readers_damage.py tests/test_tdm.py

.PHONY: test-peers
test-peers: $(PEERS)/ready .venv/built ## virtual tests beside OpenSees; downloads openseespy into an environment of its own
	$(call say,virtual tests beside OpenSees)
	@$(PEERS)/bin/python -m pytest peers

.PHONY: bench
bench: .venv/built ## benchmark beside SciPy; writes docs/benchmarks.md
	@$(BIN)/python benchmarks/bench.py

.PHONY: accuracy
accuracy: .venv/built ## gain and delay beside the truth, and their intervals; writes docs/accuracy.md and figures
	@$(BIN)/python benchmarks/accuracy.py

.PHONY: online
online: .venv/built ## how soon a reading follows a step and a ramp in delay; writes docs/online-response.md and its figure
	@$(BIN)/python benchmarks/online_response.py

.PHONY: load
load: .venv/built ## eight actuators at 4096 Hz for ten minutes, garbage beside them in the second half: what is lost, what it takes
	@$(BIN)/python benchmarks/online_load.py

.PHONY: soak
soak: .venv/ready toolchain ## 10^8 samples through the monitor: the last reading has the bits of an early one
	@mkdir -p $(OUT)
	@RTHSTRACK_SOAK=100000000 cargo test --package rthstrack --locked --test monitor nothing_drifts 2>&1 \
		| tee $(OUT)/soak.log
	@$(call ran_some,$(OUT)/soak.log)

.PHONY: docs
docs: .venv/ready toolchain ## documentation of the Rust core, in target/doc
	@RUSTDOCFLAGS="-D warnings" cargo doc --workspace --no-deps --locked

.PHONY: settings
settings: .venv/built ## writes Python's settings and docs/settings.md anew from the core's table
	@$(BIN)/python reference/make_settings.py
	@$(BIN)/ruff format --quiet python/rthstrack/evaluation/settings.py

.PHONY: shown
shown: .venv/built ## writes anew what the Python of README and docs is shown to print
	@$(BIN)/python tests/documents.py

.PHONY: golden
golden: .venv/ready ## writes tests/golden anew from the NumPy twin
	@$(BIN)/python reference/make_golden.py

.PHONY: format
format: .venv/ready toolchain ## formats Rust and Python
	@cargo fmt --all
	@$(BIN)/ruff format
	@$(BIN)/ruff check --fix
	@$(BIN)/oxfmt --write $(SCRIPTS)

.PHONY: clean
clean: ## removes whatever was built, the virtual environment too
	@rm -rf .venv target $(OUT) out .mypy_cache .pytest_cache .ruff_cache .hypothesis python/rthstrack/_core.*so

.PHONY: toolchain
toolchain:
	@for tool in "" fmt clippy; do \
		cargo $$tool --version > /dev/null 2>&1 || { \
			echo "make: 'cargo $$tool' does not run: a Rust toolchain with rustfmt and clippy is needed (https://rustup.rs)"; \
			exit 1; \
		}; \
	done

.venv/ready: constraints.txt
	@command -v $(PYTHON) > /dev/null || { echo "make: $(PYTHON) not found: Python 3.11 or newer is needed"; exit 1; }
	@$(PYTHON) -c 'import sys; v = sys.version_info[:2]; v >= (3, 11) or sys.exit("make: $(PYTHON) is Python %d.%d: \
	3.11 or newer is needed, choose one with make PYTHON=python3.x ..." % v)'
	@$(BIN)/python -m pip --version > /dev/null 2>&1 || $(PYTHON) -m venv .venv \
		|| { echo "make: '$(PYTHON) -m venv .venv' failed (Debian: apt-get install python3-venv)"; exit 1; }
	$(call say,virtual environment)
	@$(BIN)/python -m pip install --quiet --disable-pip-version-check --requirement constraints.txt
	@touch $@

.venv/built: .venv/ready $(RUST_SOURCES) | toolchain
	$(call say,building rthstrack._core)
	@PIP_QUIET=1 VIRTUAL_ENV="$(CURDIR)/.venv" $(BIN)/maturin develop --release --locked --quiet
	@touch $@

# The packages of .venv are seen from here, ours too; nothing is added to them.
$(PEERS)/ready: peers/constraints.txt .venv/ready
	$(call say,virtual environment of the peers)
	@rm -rf $(PEERS)
	@$(BIN)/python -m venv $(PEERS)
	@$(PEERS)/bin/python -m pip install --quiet --disable-pip-version-check --only-binary :all: \
		--requirement peers/constraints.txt || { \
			echo "make: no wheel of openseespy could be had (above: why); nothing was compared with OpenSees"; exit 1; }
	@site=$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))'); \
	here=$$($(PEERS)/bin/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))'); \
	printf 'import site; site.addsitedir(%s)\n' "'$$site'" > "$$here/rthstrack-environment.pth"
	@touch $@
