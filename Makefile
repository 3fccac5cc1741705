# make demo   installs into .venv and makes the made-up shop's weekly report
# make check  formatting, lint, types and the fast tests, within a minute on two cores: before each commit
# make test   installs the test extra and runs everything but the long proofs, in half an hour on two cores
# make prove  the long proofs, whose tables are in docs/
# make bench  this machine beside other tools
# make performance  every number of docs/performance.md; QUICK=1 tries it with small sets
# make docs   writes the pages of docs/ and the JSON Schema of vsd.toml, which are made from the code
# make site  builds the documentation as a site into site/, without a network
# make sbom  what the program is made of, with licences, into dist/
# make screenshots  the pictures of the documentation, from the demo (needs a Chromium)
PYTHON ?= python3
VENV   ?= .venv
BIN    := $(VENV)/bin

# Python saves the compiled modules and tests: compiling them anew takes each of the two workers ten seconds.
unexport PYTHONDONTWRITEBYTECODE

.PHONY: demo check test prove bench docs lint screenshots site sbom clean

demo: $(VENV)/.installed
	rm -rf vsd-demo
	$(BIN)/vsd demo vsd-demo

# What `make check` runs: folders and files without a demo project, a browser or a loop over simulated weeks.
FAST := $(addprefix tests/, test_architecture.py test_light_imports.py cli/test_site_commands.py config \
        docs/test_contributing.py docs/test_docs.py docs/test_words.py figures/test_figures_catalogue.py geometry \
        report/pages report/story sql stats)

# Files of these folders that report weeks, write files or draw worlds a hundred times.
SLOW := $(addprefix tests/, config/test_count_checks.py config/test_door_counts.py config/test_drawing.py \
        config/test_opening_changes.py config/test_place_edits.py geometry/test_owners.py \
        report/pages/test_lines_section.py report/pages/test_single_figures.py report/pages/test_today_page.py \
        stats/test_decomposition.py stats/test_gatherings.py stats/test_logged_changes_at_once.py \
        stats/test_stats_levels.py)

check: $(VENV)/.installed-check $(VENV)/.linted-sql
	$(BIN)/ruff format --check --quiet .
	$(BIN)/ruff check --quiet .
	$(BIN)/mypy --num-workers 2
	$(BIN)/python -m pytest -n 2 --dist loadfile -m "not browser and not realdata and not simulation and not long" \
		$(SLOW:%=--ignore=%) $(FAST)

test: $(VENV)/.installed-test lint
	$(BIN)/python -m pytest -n 2 --dist loadfile --no-loadscope-reorder

lint: $(VENV)/.installed-test $(VENV)/.linted-sql
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy --num-workers 2

# SQL files that changed since the last run without a fault; all of them, which takes half a minute, after new rules.
$(VENV)/.linted-sql: pyproject.toml $(wildcard sql/*/*.sql) | $(VENV)/.installed-check
	$(BIN)/sqlfluff lint --disable-progress-bar --processes 2 $(if $(filter pyproject.toml,$?),sql,$?)
	touch $@

prove: $(VENV)/.installed-test
	$(BIN)/python -m pytest -n 2 --dist loadfile -m long
	$(BIN)/python tests/stats/prove_intervals.py --weeks 1000
	$(BIN)/python tests/stats/prove_intervals.py --people 10
	$(BIN)/python tests/stats/prove_skewed_days.py --weeks 2000
	$(BIN)/python tests/stats/prove_verdicts.py
	$(BIN)/python tests/stats/prove_unlike_worlds.py --sites 1000
	$(BIN)/python tests/stats/prove_hotspots.py --floors 1000 --people 400 --stored 40
	$(BIN)/python tests/stats/prove_before_after.py --sites 1000
	$(BIN)/python tests/stats/prove_changes.py --sites 1000
	$(BIN)/python tests/stats/prove_spill.py --sites 400
	$(BIN)/python tests/report/story/prove_words.py --sites 40
	$(BIN)/python tests/report/prove_flagship.py
	$(BIN)/python tests/report/story/prove_twelve_weeks.py
	$(BIN)/python tests/report/story/prove_sceptic.py --sites 20
	$(BIN)/python tests/stats/prove_decomposition.py
	$(BIN)/python tests/stats/prove_forecast.py --worlds 20
	$(BIN)/python tests/stats/prove_groups.py --weeks 3000 --days 2
	$(BIN)/python tests/stats/prove_durations.py --weeks 1000
	$(BIN)/python tests/stats/prove_sites.py --worlds 300
	$(BIN)/python tests/stats/prove_switchback.py --worlds 2000
	$(BIN)/python tests/stats/prove_dwell.py --sites 300
	$(BIN)/python tests/stats/prove_flow.py --sites 300
	$(BIN)/python tests/stats/prove_links.py --sites 100
	$(BIN)/python tests/stats/prove_queue.py --sites 120
	$(BIN)/python tests/stats/prove_queue_forecast.py --sites 60
	$(BIN)/python tests/stats/prove_cameras.py --sites 8
	$(BIN)/python tests/invariances/prove_frame_rate.py
	$(BIN)/python tests/ingest/prove_opening_hours.py --files 120
	$(BIN)/python tests/ingest/prove_second_deliveries.py
	PYTHONPATH=tests $(BIN)/python tests/warehouse/prove_accelerated.py 300
	$(BIN)/python tests/packaging/prove_dependencies.py
	$(BIN)/python tests/benchmarks/bench_demo.py
	$(BIN)/python tests/benchmarks/bench_marts.py
	$(BIN)/python tests/benchmarks/bench_report.py
	$(BIN)/python tests/benchmarks/bench_history.py --cameras 2 --hours 4 --interval 20
	$(BIN)/python tests/benchmarks/bench_live.py
	PYTHONPATH=tests $(BIN)/python tests/cluster/prove_cluster.py --engine dask
	PYTHONPATH=tests $(BIN)/python tests/cluster/prove_bucket.py
	$(BIN)/python tests/cluster/prove_nodes.py --rounds 3 --steps 40 --frames 60
	$(BIN)/python tests/service/prove_server.py --seconds 20 --connections 300
	$(BIN)/python tests/faults/prove_crashes.py
	$(BIN)/python tests/faults/prove_power_cut.py
	$(BIN)/python tests/faults/prove_parallel.py --minutes 5
	$(BIN)/python tests/live/prove_soak.py --hours 24 --seed 1 --rate 2000
	$(BIN)/python tests/live/prove_engine_live.py --minutes 60
	$(BIN)/python tests/retention/prove_purge_crashes.py
	$(BIN)/python tests/privacy/prove_hidden_counts.py --seeds 11 --weeks 10
	$(BIN)/python tests/benchmarks/bench_ingest.py --rows 1000000
	$(BIN)/python tests/fuzz/prove_fuzz.py --inputs 100000 --seed 0
	$(BIN)/python tests/fuzz/prove_limits.py --inputs 25000 --seed 0
	$(BIN)/python tests/hostile/hostile_tries.py --check
	$(BIN)/python tests/realdata/prove_cameras.py
	$(BIN)/python tests/realdata/prove_thinning.py
	$(BIN)/python tests/realdata/prove_atc.py
	$(BIN)/python tests/realdata/prove_crowding.py
	$(BIN)/python tests/realdata/prove_whatif.py
	$(BIN)/python tests/realdata/prove_standers.py
	$(BIN)/python tests/realdata/prove_lines.py
	$(BIN)/python tests/realdata/prove_joined_views.py
	$(BIN)/python tests/stats/prove_context.py
	$(BIN)/python tests/warehouse/prove_staff.py
	$(BIN)/python tests/whatif/prove_scenes.py
	$(BIN)/python tests/whatif/prove_october.py
	$(BIN)/python tests/engine/prove_engine.py
	$(BIN)/python tests/engine/prove_tracks.py
	$(BIN)/python tests/engine/prove_tracks_of_walks.py
	$(BIN)/python tests/engine/prove_monoloco.py
	$(BIN)/python tests/engine/prove_subsets.py
	$(BIN)/python tests/engine/prove_walking_skeletons.py
	$(BIN)/python tests/engine/prove_detector.py
	$(BIN)/python tests/engine/prove_box_or_torso.py
	$(BIN)/python tests/benchmarks/bench_detector.py

bench: $(VENV)/.installed-test
	$(BIN)/python tests/benchmarks/bench_tools.py

performance: $(VENV)/.installed-test
	$(BIN)/python tests/benchmarks/every_number.py $(if $(QUICK),--quick)

docs: $(VENV)/.installed-test
	$(BIN)/python docs/generate_reference.py docs

screenshots: $(VENV)/.installed-test
	$(BIN)/python docs/screenshots.py

site: $(VENV)/.installed-docs
	NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict

sbom: $(VENV)/.installed-release
	rm -rf build/sbom
	$(PYTHON) -m venv build/sbom
	build/sbom/bin/python -m pip install --quiet .
	mkdir -p dist
	$(BIN)/cyclonedx-py environment --pyproject pyproject.toml --output-reproducible --output-file dist/sbom.cdx.json build/sbom/bin/python
	$(BIN)/python docs/licence_list.py dist/sbom.cdx.json > dist/LICENCES.md

$(VENV)/.installed-release: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[release]'
	touch $@

$(VENV)/.installed-docs: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[docs]'
	touch $@

$(VENV)/.installed: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable .
	touch $@

$(VENV)/.installed-test: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[test]'
	touch $@ $(VENV)/.installed $(VENV)/.installed-check

$(VENV)/.installed-check: pyproject.toml
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --editable '.[check]'
	touch $@ $(VENV)/.installed

clean:
	rm -rf $(VENV) vsd-demo dist build site
