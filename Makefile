# Everything a fresh machine needs: Python 3.11 or newer and make.
#   make demo         environment, a generated sequence, its check and report; says where things are
#   make test         format, lint, types, contracts, tests
#   make bench        speed and timing of the event sensor against a yardstick and the closed form: docs/benchmarks.md
#   make bench-cluster what gating many small sequences on a cluster costs: printed, for docs/cluster.md
#   make bench-costs  what each stream, effect, wind and world costs: docs/costs.md
#   make bench-flow   what reading frames between pixels costs, and how far it errs: docs/flow-interpolation.md
#   make bench-files  what checking files of 1440x1080 takes, against decoding them: docs/full-size.md; three quarters of an hour, 10 GB
#   make bench-releases what releases of known length cost to check: docs/release-costs.md; an hour, 12 GB
#   make bench-readings how many events are read, against time and limits: docs/event-readings.md
#   make bench-imu    what IMU against pose can tell, and whether its errors hold: docs/inertial-limits.md
#   make study-presets  the scenes called after the paper's sequences beside its tables: docs/presets.md; half an hour
#   make docs         writes the pages of checks, causes and datasets from what the code says of them, and the schemas
#   make site         the documentation as a site: out/site/index.html, readable without a network or a server
#   make kernels      lists the compiled loops that checks call, so that a first run compiles them on all cores
#   make power        350 clean and 2200 faulty files, what is found of them: docs/power-tables.md; 23 GB, an hour and a quarter
#   make power-off-grid  600 faulty files of sizes, directions, places and times at random: docs/power-off-grid.md; half an hour
#   make study-causes  every fault in four scenes: found, and named? docs/named-causes.md; two hours
#   make study-conventions  plain conventions of exporters, axes and units and orders: named? printed; some minutes
#   make study-composites  25 pairs of faults in one sequence: are both named? docs/named-composites.md; some minutes
#   make study-false-alarms  some hundred honest files through all checks: docs/false-alarms.md; about an hour
#   make study-foreign  correct files as others make them, 70 kinds: docs/foreign.md; hours
#   make study-named-foreign  faults of real pipelines, 283 kinds by code of their own: found, and named? docs/named-foreign.md; hours
#   make study-real-data PATHS='...'  samples of real data that are on this machine: printed, for docs/real-data.md; some minutes
#   make study-blind-spots  real faults of three scenes, from which size they are found: printed, for docs/blind-spots.md; some minutes
#   make study-trade  what each effort costs, and what it finds: docs/trade.md; an hour
#   make study-learning  what a dataset teaches, and what a fault costs a learner: docs/learning.md; hours; BUDGET=small: an hour
#   make study-learning-smoke  the same in two minutes, of so little data that it says nothing: out/learning-smoke.md
#   make mutation     random small changes of estimators and judgement: do their unit tests notice? docs/mutation.md; half an hour
#   make fuzz         100,000 mutants of a small file: nothing may crash, hang, eat memory, or be wrongly clean; hours
#   make lock         the development dependencies, pinned with their hashes: requirements/dev.lock
#   make test-lowest  the tests of layout, sequence and record with the lowest versions that pyproject.toml allows
#   make test-newest  the same with the newest versions that it allows, as of today
#   make audit        known vulnerabilities of what is locked;  make sbom  what is in it, as CycloneDX
#   make wheel        builds the wheel twice, and fails where the two differ in one byte
#   make same-results BASE=<commit>  do this code and a commit's measure and conclude the same, of some 470 files? 20 minutes
#   make study-mesh   how the rendered world differs from the exact one, and what 8 bits do to events; needs OpenGL

PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
READY := $(VENV)/.ready
READY_TO_USE := $(VENV)/.ready-to-use
OUT ?= out

# Every process that starts would compile all sources again, which takes 3 s, where the environment forbids to keep bytecode.
unexport PYTHONDONTWRITEBYTECODE

# The loops that checks call, which a first run compiles on all cores: fedora_qa/engine/compilation/kernels.json
.PHONY: kernels
kernels: $(READY)
	@mkdir -p $(OUT)
	$(BIN)/fedora-generate sequence park-day -o $(OUT)/kernels.h5 --duration 0.6 --size 270x200 --force
	$(BIN)/fedora-generate sequence park-noisy -o $(OUT)/kernels-noisy.h5 --duration 0.6 --size 180x136 --force
	$(BIN)/python -m fedora_qa.cli.kernel_list $(OUT)/kernels.h5 $(OUT)/kernels-noisy.h5

.PHONY: demo test lint compiled-generator compiled-checks docs fuzz lock same-results test-lowest test-newest audit sbom wheel study-causes study-composites study-conventions study-false-alarms study-foreign study-learning study-learning-smoke study-named-foreign study-real-data study-blind-spots study-mesh study-presets study-trade mutation bench bench-cluster bench-costs bench-files bench-flow bench-imu bench-readings bench-releases site clean

demo: $(READY_TO_USE)
	@mkdir -p $(OUT)
	$(BIN)/fedora-generate sequence park-day -o $(OUT)/park-day.h5 --duration 2 --size 540x400 --force
	$(BIN)/fedora-qa check $(OUT)/park-day.h5 --json $(OUT)/park-day.json --markdown $(OUT)/park-day.md \
	  --html $(OUT)/park-day.html
	@echo
	@echo "report    $(OUT)/park-day.html (opens in any browser, without a network)"
	@echo "sequence  $(OUT)/park-day.h5"
	@echo "record    $(OUT)/park-day.json (schema and meaning: docs/record.md)"
	@echo "summary   $(OUT)/park-day.md"

bench: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks

bench-costs: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.generation_costs

bench-flow: $(READY)
	OMP_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.flow_interpolation

bench-files: $(READY)
	$(BIN)/python -m tests.benchmarks.full_size.study

# Numbers of sequences in the releases that are gated, and of workers (WORKERS=2; as many as cores without).
COUNTS ?= 40 200 1000

bench-cluster: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.cluster.study $(COUNTS) $(if $(WORKERS),--workers $(WORKERS))

bench-releases: $(READY)
	$(BIN)/python -m tests.benchmarks.release_costs.study

bench-readings: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.event_readings

bench-imu: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.inertial_limits

docs: $(READY)
	$(BIN)/python -m fedora_qa.cli.generated_files docs/checks

study-causes: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.named_causes --fresh

study-conventions: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.conventions.study

study-composites: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.composite_faults

# A dozen causes in depth, the rest about their limits. Small and short, so that a file takes 7 MB and two seconds to check;
# but that events are late takes longer to tell, and more edges.
POWER_SCENES := --scenes park-day,fast-turn,racetrack,park-noisy --spread
POWER_DEEP := events:spatial_offset,depth:spatial_offset,events:threshold_misdeclared,events:hot_pixels,imu:time_offset,$\
  flow_gain,metadata:intrinsics_focal,imu:gyro_bias,exposure_or_gamma,pose:teleport
POWER_CORPUS := $(POWER_SCENES) --clean 75 --trials 13 --deep $(POWER_DEEP) --deep-trials 60 --size 180x136 --duration 0.5
POWER_LATE := $(POWER_SCENES) --clean 12 --trials 60 --causes events:time_offset,rgb:time_offset --size 270x200 \
  --duration 1 --seed 1000
POWER_FULL_SIZE := --scenes park-day,park-noisy --spread --clean 1 --trials 4 --causes flow_gain,events:time_offset \
  --size 1440x1080 --duration 0.4 --seed 2000
JOBS ?= 2

.PHONY: power
power: export OMP_NUM_THREADS = 1
power: export NUMBA_NUM_THREADS = 1
power: $(READY)
	@mkdir -p $(OUT)
	$(BIN)/fedora-generate corpus --jobs $(JOBS) -o $(OUT)/power-corpus $(POWER_CORPUS)
	$(BIN)/fedora-generate corpus --jobs $(JOBS) -o $(OUT)/power-late $(POWER_LATE)
	$(BIN)/fedora-generate corpus --jobs $(JOBS) -o $(OUT)/power-full-size $(POWER_FULL_SIZE)
	$(BIN)/fedora-qa power $(OUT)/power-corpus $(OUT)/power-late $(OUT)/power-full-size --jobs $(JOBS) \
	  --json $(OUT)/power.json --html $(OUT)/power.html --markdown docs/power-tables.md --svg docs/power-tables.svg \
	  --publish fedora_qa/power/published.json --publish-confidence fedora_qa/diagnosis/confidence.json

# Faults whose size, direction, region and time are drawn at random: shifts by fractions of a pixel, and local faults of each kind.
POWER_RANDOM := events:time_offset,imu:time_offset,rgb:spatial_offset,flow:spatial_offset,events:spatial_offset,depth:spatial_offset,$\
  flow_gain,metadata:intrinsics_focal,metadata:intrinsics_centre,metadata:extrinsic_rotation,imu:gyro_bias,imu:accel_bias,$\
  exposure_or_gamma,events:threshold_misdeclared,pose:teleport,events:dropped_samples,rgb:vignetting,events:dead_region,$\
  events:hot_pixels

.PHONY: power-off-grid
power-off-grid: export OMP_NUM_THREADS = 1
power-off-grid: export NUMBA_NUM_THREADS = 1
power-off-grid: $(READY)
	@mkdir -p $(OUT)
	$(BIN)/fedora-generate corpus --jobs $(JOBS) -o $(OUT)/power-off-grid $(POWER_SCENES) --off-grid --clean 2 --trials 24 \
	  --causes $(POWER_RANDOM) --size 180x136 --duration 0.5 --seed 7000
	$(BIN)/fedora-qa power $(OUT)/power-off-grid --jobs $(JOBS) --json $(OUT)/power-off-grid.json \
	  --markdown docs/power-off-grid.md --svg docs/power-off-grid.svg

# Networks are trained in an environment of their own. PyTorch for the CPU has an index of its own, and takes 1 GB with the rest; with
# TORCH_INDEX= (empty) it is that of PyPI, which may need a GPU. PARTS chooses parts, and results that are there are not repeated.
LEARNING := $(OUT)/learning-env
TORCH ?= torch
TORCH_INDEX ?= https://download.pytorch.org/whl/cpu
BUDGET ?= full
PARTS ?= a,b,c,price
LEARN := OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 PYTHONPATH=. $(LEARNING)/bin/python -m

$(LEARNING)/.ready: pyproject.toml
	test -x $(LEARNING)/bin/python || $(PYTHON) -m venv $(LEARNING)
	$(LEARNING)/bin/python -m pip install --quiet --disable-pip-version-check \
	  $(if $(TORCH_INDEX),--extra-index-url $(TORCH_INDEX)) '$(TORCH)'
	$(LEARNING)/bin/python -m pip install --quiet --disable-pip-version-check --editable . pytest
	touch $@

study-learning: $(LEARNING)/.ready
	$(LEARN) tests.benchmarks.learning.study --budget $(BUDGET) --parts $(PARTS) --processes $(JOBS) \
	  --publish fedora_qa/scoring/fault_prices.json

study-learning-smoke: $(LEARNING)/.ready
	$(LEARN) pytest -q --noconftest tests/benchmarks/learning/network_tests.py
	$(LEARN) tests.benchmarks.learning.study --budget smoke --fresh --processes $(JOBS) --page $(OUT)/learning-smoke.md

study-false-alarms: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.false_alarms.study --fresh

study-blind-spots: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.blind_spots

study-foreign: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.foreign.study --fresh --all

study-named-foreign: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.foreign_faults.study --fresh --held-out \
	  --processes $(JOBS) --page docs/named-foreign.md

# PATHS are samples of real data; docs/real-data.md states which were used. A path may end in @640x480, or in @pose=/topic.
study-real-data: $(READY)
	@test -n "$(PATHS)" || { echo 'Expected paths of samples: make study-real-data PATHS="a.raw@640x480 b.aedat4"' >&2; exit 2; }
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.real_data.study $(PATHS)

mutation: $(READY)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[dev,mutation]'
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.mutation

# EVERY=6 takes a sixth of the faulty files of small frames: a third of the time.
EVERY ?= 1

same-results: $(READY)
	@test -n "$(BASE)" || { echo 'Expected the commit to compare with: make same-results BASE=<commit>' >&2; exit 2; }
	$(BIN)/python -m tests.same_results --base $(BASE) --every $(EVERY) --jobs $(JOBS)

study-mesh: $(READY)
	$(BIN)/python -m tests.benchmarks.mesh_study

study-trade: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.trade.study --fresh

study-presets: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 $(BIN)/python -m tests.benchmarks.presets

fuzz: $(READY)
	OMP_NUM_THREADS=1 NUMBA_NUM_THREADS=1 PYTHONPATH=. $(BIN)/python -m tests.fuzz --jobs $(JOBS) --out $(OUT)/fuzz

# What the supply chain needs lies in an environment of its own, so that it neither enters nor disturbs what is locked.
TOOLS := $(OUT)/tools
LOCK := $(TOOLS)/bin/uv pip compile --quiet pyproject.toml --universal --python-version 3.11 --no-header

$(TOOLS)/.ready:
	$(PYTHON) -m venv $(TOOLS)
	$(TOOLS)/bin/python -m pip install --quiet --disable-pip-version-check uv pip-audit cyclonedx-bom build 'hatchling>=1.25'
	touch $@

lock: $(TOOLS)/.ready
	$(LOCK) --extra dev --generate-hashes --upgrade --output-file requirements/dev.lock
	$(LOCK) --extra reports --resolution lowest-direct --upgrade --output-file requirements/lowest.lock

# The site has an environment of its own as well. REPOSITORY is its web address: links to sources lead there.
SITE_TOOLS := $(OUT)/site-tools
REPOSITORY ?=

$(SITE_TOOLS)/.ready: pyproject.toml
	test -x $(SITE_TOOLS)/bin/python || $(PYTHON) -m venv $(SITE_TOOLS)
	$(SITE_TOOLS)/bin/python -m pip install --quiet --disable-pip-version-check --editable '.[site]'
	touch $@

# A sequence whose events are 3 ms late, checked.
$(OUT)/sample-report.html: $(SITE_TOOLS)/.ready
	$(SITE_TOOLS)/bin/fedora-generate sequence park-day -o $(OUT)/sample.h5 --duration 2 --size 720x540 --force
	$(SITE_TOOLS)/bin/fedora-generate fault $(OUT)/sample.h5 time_offset --magnitude 3 -o $(OUT)/late.h5 --force
	$(SITE_TOOLS)/bin/fedora-qa check $(OUT)/late.h5 --quiet --html $@ || test $$? -eq 1

site: $(SITE_TOOLS)/.ready $(OUT)/sample-report.html
	rm -rf $(OUT)/site-pages $(OUT)/site
	$(SITE_TOOLS)/bin/python -m fedora_qa.cli.site_pages $(OUT)/site-pages $(REPOSITORY)
	cp $(OUT)/sample-report.html $(OUT)/site-pages
	NO_MKDOCS_2_WARNING=1 $(SITE_TOOLS)/bin/python -m mkdocs build --quiet --strict --site-dir $(CURDIR)/$(OUT)/site
	$(SITE_TOOLS)/bin/python -m tests.built_site $(OUT)/site

VERSION_TESTS := tests/layout tests/sequence tests/record/test_json_io.py tests/hostile

test-lowest: $(TOOLS)/.ready
	$(TOOLS)/bin/uv venv --quiet --clear --python 3.11 $(OUT)/lowest
	$(TOOLS)/bin/uv pip install --quiet --python $(OUT)/lowest/bin/python -r requirements/lowest.lock pytest hypothesis filelock
	PYTHONPATH=.:generator:reports $(OUT)/lowest/bin/python -m pytest -q -W default $(VERSION_TESTS)

test-newest: $(TOOLS)/.ready
	$(TOOLS)/bin/uv venv --quiet --clear --python 3.13 $(OUT)/newest
	$(TOOLS)/bin/uv pip install --quiet --upgrade --resolution highest --python $(OUT)/newest/bin/python --requirements pyproject.toml \
	  --extra reports pytest hypothesis filelock
	PYTHONPATH=.:generator:reports $(OUT)/newest/bin/python -m pytest -q -W default $(VERSION_TESTS)

audit: $(TOOLS)/.ready
	$(TOOLS)/bin/pip-audit --require-hashes --disable-pip --strict --requirement requirements/dev.lock

sbom: $(TOOLS)/.ready
	$(TOOLS)/bin/cyclonedx-py requirements requirements/dev.lock --pyproject pyproject.toml --output-reproducible \
	  --output-format JSON --output-file $(OUT)/sbom.cdx.json

wheel: $(TOOLS)/.ready
	rm -rf $(OUT)/wheel-1 $(OUT)/wheel-2
	for number in 1 2; do $(TOOLS)/bin/python -m build --wheel --no-isolation --outdir $(OUT)/wheel-$$number >$(OUT)/wheel.log || exit 1; done
	cmp $(OUT)/wheel-1/*.whl $(OUT)/wheel-2/*.whl
	sha256sum $(OUT)/wheel-1/*.whl

# Each process of the run uses one thread: threads of several processes wait for each other.
test: export OMP_NUM_THREADS = 1
test: export OPENBLAS_NUM_THREADS = 1
test: export LP_NUM_THREADS = 1
# Some tests wait for a limit of time, a browser or a process: one process more than cores keeps the cores busy.
TEST_PROCESSES ?= $(shell $(PYTHON) -c 'import os; print(1 + (os.cpu_count() or 1))')
# Types are checked in one process; other cores compile meanwhile.
test: $(READY)
	$(MAKE) --jobs 2 lint compiled-generator compiled-checks
	$(BIN)/pytest --numprocesses $(TEST_PROCESSES) --dist worksteal

compiled-generator compiled-checks: compiled-%: $(READY)
	$(BIN)/python -m tests.compiled $*

lint: $(READY)
	$(BIN)/ruff format --check .
	$(BIN)/ruff check .
	$(BIN)/mypy
	$(BIN)/lint-imports

# $(READY_TO_USE) holds what users install, $(READY) what tests need besides.
$(READY_TO_USE): EXTRAS := reports,generator
$(READY): EXTRAS := dev

# uv takes a third of the time of pip, which knows indices that are set for pip alone.
$(READY_TO_USE) $(READY): pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "Expected Python 3.11 or newer, got " + sys.version)'
	test -x $(BIN)/python || $(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check uv
	$(BIN)/uv pip install --quiet --python $(BIN)/python --editable '.[$(EXTRAS)]' || \
	  $(BIN)/python -m pip install --quiet --disable-pip-version-check --editable '.[$(EXTRAS)]'
	touch $@

clean:
	rm -rf $(VENV) $(OUT)
