# Everything here creates .venv and installs what it needs by itself; a second run is quick.
SHELL := /bin/bash
.SHELLFLAGS := -eu -o pipefail -c
.DEFAULT_GOAL := help
.DELETE_ON_ERROR:

BIN := .venv/bin
WORKERS ?= 4
LCM := scripts/lcm_messages.py src/dubins_traffic/transports/lcm/dubins_traffic_lcm.lcm
SETUP := pyproject.toml constraints.txt setup.py scripts/setup.sh $(LCM)

.PHONY: help setup demo test test-tools kernels tools test-all golden docs results experiments release check format schemas proofs bench clean

help: ## show this text
	@grep -E '^[a-z-]+:.*## ' $(MAKEFILE_LIST) | sed -E 's/^([a-z-]+):.*## /\1\t/' | expand -t 12

setup: .venv/.installed-dev ## install the package and everything that developers need into .venv

demo: .venv/.installed-plot ## three trials with two controllers, scored, drawn and replayed in demo-output/
	@$(BIN)/python examples/compare.py demo demo-output --controllers lanes simple --trials 3

test: .venv/.installed-dev ## all checks, then the tests that need nothing but Python: ten minutes
	@$(MAKE) --no-print-directory --jobs=2 check kernels
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal -m "not (tools or long)"

test-tools: .venv/.installed-dev ## the other tests: with tools, which are installed first, and those that take long: half an hour
	@$(MAKE) --no-print-directory --jobs=2 tools kernels
	$(BIN)/python -m pytest -n $(WORKERS) --dist worksteal -m "tools or long"

kernels: .venv/.installed-dev
	-@$(BIN)/dubins-traffic build

tools: .venv/.installed-dev
	@scripts/system-packages.sh
	@scripts/kernel.sh
	@scripts/crosscheck-tools.sh
	@scripts/gazebo.sh

test-all: export PYTEST_ADDOPTS := -o faulthandler_timeout=86400
test-all: test test-tools ## all tests, then those of which the suite runs a part, in full: hours
	DUBINS_TRAFFIC_TRIALS_2016=50 $(BIN)/python -m pytest tests/integration/test_ros1_2016.py
	DUBINS_TRAFFIC_TRIALS_ROS2=50 $(BIN)/python -m pytest tests/integration/test_rclpy.py
	DUBINS_TRAFFIC_MUTANTS=full $(BIN)/python -m pytest tests/integration/test_search_of_mutants.py -k mutant_stands
	DUBINS_TRAFFIC_SPECIFICATIONS=full $(BIN)/python -m pytest tests/crosscheck/test_game_specifications.py
	@scripts/crosscheck-tools.sh acacia
	$(BIN)/python -m pytest tests/crosscheck/acacia_winners.py
	@scripts/crosscheck-tools.sh learners
	$(BIN)/python -m pytest tests/crosscheck/learners.py
	$(BIN)/python -m tests.judge_trials 500
	$(BIN)/python -m tests.judge_trials 2000 bent
	DUBINS_TRAFFIC_CONTRACT=full $(BIN)/python -m pytest tests/conformance/test_contract.py \
		tests/integration/test_free_agents.py
	DUBINS_TRAFFIC_SUITE_TRIALS=2 $(BIN)/python -m pytest tests/integration/test_suite.py
	DUBINS_TRAFFIC_FAULTS=20 $(BIN)/python -m pytest tests/integration/test_service_faults.py \
		tests/integration/test_service_full_disks.py tests/integration/test_service_ray.py
	DUBINS_TRAFFIC_SERVED_TRIALS=1000 $(BIN)/python -m pytest tests/integration/test_served_frames.py
	DUBINS_TRAFFIC_ATTACKS=all $(BIN)/python -m pytest tests/sandbox/test_second_version.py
	DUBINS_TRAFFIC_PAGES=all $(BIN)/python -m pytest tests/integration/test_docs_code.py \
		tests/integration/test_readme.py -k runs
	DUBINS_TRAFFIC_PAGES=all $(BIN)/python -m pytest tests/integration/test_site.py -k both_widths
	DUBINS_TRAFFIC_ESTIMATES=full $(BIN)/python -m pytest tests/integration/test_falsify.py \
		tests/integration/test_falsify_targets.py tests/integration/test_splitting.py \
		-k "splitting or million or guides"
	$(BIN)/python -m experiments verify odd_egos rules towns

golden: .venv/.installed-dev ## compare what trials, batches, campaigns and games give with tests/golden/hashes.json
	$(BIN)/python -m tests.golden.hashes

docs: .venv/.installed-dev ## the site of the documentation, in build/site; warnings are errors
	$(BIN)/python website/build.py

results: .venv/.installed-dev ## run the shipped suites with the built-in controllers; the site shows what is in website/results: an hour
	$(BIN)/python website/results.py

experiments: tools kernels ## every experiment and every baseline again, stored, and their pages: days
	@scripts/experiments.sh

release: .venv/.installed-dev ## wheel and source distribution in dist/, each tried in an environment of its own for every Python here
	@scripts/release.sh

check: .venv/.installed-dev ## format, lint, types and layers
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/pyright
	$(BIN)/lint-imports

format: .venv/.installed-dev ## format the sources and mend what the linter can
	$(BIN)/ruff format .
	$(BIN)/ruff check --fix .

schemas: .venv/.installed-dev ## the JSON Schemas that the package ships, made from the models
	$(BIN)/python -m scripts.schemas

proofs: .venv/.installed-dev ## prove the lemmas of the shield and of the order of arrival, and refute planted flaws: minutes
	$(BIN)/python -m proofs --flaws

bench: .venv/.installed-dev ## speed, as ratios to limits measured in the same run: ten minutes
	@$(BIN)/python -m benchmarks

clean: ## remove .venv, the demo's output and everything that tools leave behind
	rm -rf .venv demo-output out build dist .pytest_cache .ruff_cache .hypothesis .import_linter_cache
	find src tests benchmarks experiments examples proofs -name __pycache__ -prune -exec rm -rf {} +
	rm -rf src/dubins_traffic.egg-info

.venv/.installed-plot: $(SETUP)
	@scripts/setup.sh plot

.venv/.installed-dev: $(SETUP)
	@scripts/setup.sh dev
