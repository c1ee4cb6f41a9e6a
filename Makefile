PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin

.PHONY: demo test thorough check lock lint typecheck seeds flags foresight paper frames shown confusion confusion-records written-gain structural sensors localization localization-records rivals several counting bench many-devices jitter device-offsets log-crash weimar real tracking oma-speed oma-frequency oma-selection oma-accuracy oma-faults scale false-alarms site-kinds trends soak web-load unit fuzz mutants clean

demo: $(VENV)/.done
	$(BIN)/modalwatch demo

# What computes shares the processors, the long files first; what runs in real time comes after it, for it waits more than it
# computes: only files with such tests are imported then. Modules are compiled once, whatever the environment says: these
# tests start some hundred processes.
test: export OPENBLAS_NUM_THREADS = 1
test: export PYTHONDONTWRITEBYTECODE =
test: $(VENV)/.done
	$(BIN)/python -m pytest -m "not live and not thorough" --numprocesses auto --dist loadfile --no-loadscope-reorder
	$(BIN)/python -m pytest -m live --numprocesses 4 --dist loadgroup $$(grep -rlE 'mark\.live\b' tests --include='test_*.py')

# More draws of what the tests cover: other seeds, other structures, pairs of causes.
thorough: export OPENBLAS_NUM_THREADS = 1
thorough: export PYTHONDONTWRITEBYTECODE =
thorough: $(VENV)/.done
	$(BIN)/python -m pytest -m thorough --numprocesses auto

check: $(VENV)/.done
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports
	$(BIN)/deptry .
	$(BIN)/vulture
	$(BIN)/python .ci/audit

# requirements.lock with hashes, and requirements-dev.lock, from what is installed in .venv; some minutes.
lock:
	$(BIN)/python .ci/lock

# Five demos with five seeds; writes the table in docs/seeds.md.
seeds: $(VENV)/.done
	$(BIN)/python benchmarks/monitor/demo_seeds.py

# False flags of the one-step update and what it flags of masses: the tables in docs/updater.md, some minutes.
flags: $(VENV)/.done
	$(BIN)/python benchmarks/updater/false_flags.py

# The paper's tables and figures, its stiffness twin and the sweep of masses: docs/paper.md and its pictures, ten minutes.
paper: $(VENV)/.done
	$(BIN)/python examples/paper_t_structure.py docs
	$(BIN)/python examples/paper_stiffness.py docs
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/paper/sweep.py docs
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/paper/reference.py 30

# The frame element beside published answers: the tables in docs/structure.md, two seconds.
frames: $(VENV)/.done
	$(BIN)/python benchmarks/updater/frame_elements.py

# Our SLCAN bus beside python-can's, DBC sensors beside cantools, decoders, plugs pulled: the tables in docs/daq.md, two minutes.
bench: $(VENV)/.done
	$(BIN)/python benchmarks/daq/can_bus.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/daq/can_dbc.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/daq/decode.py
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/daq/serial_ports.py

# What recording 32 serial devices costs: the table in docs/daq.md, ten minutes a line.
many-devices: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/daq/many_devices.py 600 epson-uart
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/daq/many_devices.py 600 modalwatch-node
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/daq/many_devices.py 600 epson-uart 50

# How exact the times of scans are over an hour behind USB adapters: the table in docs/daq.md, a minute.
jitter: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/daq/jitter.py

# How exactly phases of modes tell offsets between devices: the table in docs/daq.md, ten minutes.
device-offsets: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/oma/device_offsets.py

# What kills and power cuts cost a log, its size, how quickly it is mended: the tables in docs/daq.md, six minutes.
log-crash: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/daq/log_crash.py

# Whether what `structure --target` foresees comes true: the tables in docs/foresight.md, a quarter of an hour.
foresight: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/foresight.py

# What a diagnosis shows on three records, and how near residual forces point: docs/diagnosis_shown.md, two minutes.
shown: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/diagnosis_shown.py docs

# What is done against what `diagnose` says of its modes, drawn by a code of its own: the tables of docs/diagnosis.md.
# It goes on where it was stopped (confusion.jsonl); `make confusion ARGUMENTS="--minutes 30"`, `--elsewhere`: other structures.
confusion: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/confusion/modes.py $(ARGUMENTS)

# The same from accelerations through the log, five specimens at 120 s and at 600 s.
confusion-records: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/confusion/records.py $(ARGUMENTS)

# The gain that is stated against that of the written file, loaded and diagnosed again; some minutes a draw of all cells.
written-gain: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/written_gain.py $(ARGUMENTS)

# How near stretches, props and axial forces are placed and sized, and whether their deviations hold: two minutes.
structural: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/structural_causes.py

sensors: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/sensor_faults.py

# How often one and two masses are counted rightly, and how near the worse is placed: prints a table, half an hour.
several: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/localization/several_masses.py

# Reliability of the stated number of masses, one to three of them: the tables in docs/localization.md, an hour;
# it continues where it was stopped (count_masses.jsonl): `make counting ARGUMENTS="--minutes 10 --seed 1"`.
counting: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/localization/count_masses.py $(ARGUMENTS)

# One added mass at 1000 random places a line, from modes with known noise: the table in docs/localization.md, an hour.
localization: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/localization/modes.py

# The same from accelerations, 200 places a length of record: half an hour.
localization-records: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/localization/records.py

# Other methods on the same modes: a quarter of an hour.
rivals: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/other_methods.py

# Identities of modes through simulated months: the table in docs/oma.md, some minutes.
tracking: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/oma/tracking.py

# Set-ups of a measured steel frame merged: the tables of docs/weimar.md; `make weimar DATA=folder`, a second.
weimar: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/oma/weimar.py $(DATA)

# Two measured structures and what their simulations get wrong: the tables of docs/beam_six_masses.md and docs/soton.md
# with their pictures; `make real DATA=folder above beam-six-masses and soton-3storey-frf`, six minutes.
real: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/measured/six_masses.py $(DATA)/beam-six-masses docs/beam_six_masses.png
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/updater/measured/three_storeys.py $(DATA)/soton-3storey-frf docs/soton.png

# FDD, EFDD, FSDD and pLSCF beside pyOMA2's and the smallest possible errors: the tables in docs/oma.md, half an hour.
oma-frequency: $(VENV)/.done
	$(BIN)/python benchmarks/oma/frequency_domain.py

# Subspace identification beside pyOMA2 and koma: the table in docs/oma.md. SIZES=ab takes minutes, all four an hour.
oma-speed: $(VENV)/.done
	$(BIN)/python benchmarks/oma/speed.py $(SIZES)

# Unattended selection beside pyOMA2's on 100 windows a line: the table in docs/oma.md, a quarter of an hour.
oma-selection: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/oma/selection.py

# Errors over the smallest possible ones, and coverage: the table in docs/oma.md, a quarter of an hour.
oma-accuracy: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/oma/accuracy.py

# Faulty channels, missing samples, drift: the table in docs/oma.md, some minutes.
oma-faults: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/oma/faults.py

# Modes, eq. 7, increments and localization up to 1e5 degrees of freedom: the tables in docs/scale.md, some minutes.
scale: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 OMP_NUM_THREADS=1 $(BIN)/python benchmarks/updater/scale.py

# False alarms over simulated years of weather, and how late masses are found: the tables of docs/detection.md,
# some minutes a line; `make false-alarms ARGUMENTS="SITES DAYS"`.
false-alarms: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/monitor/false_alarms.py $(ARGUMENTS)

# False alarms and delays by kind of site: the table in docs/detection.md, half an hour; `make site-kinds ARGUMENTS="--sites 8 --days 90"`.
site-kinds: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/monitor/site_kinds.py $(ARGUMENTS)

# Rates of slow trends by kind of site: the table in docs/detection.md, some minutes; `make trends ARGUMENTS="--drift 0 quiet"`.
trends: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/monitor/trends.py $(ARGUMENTS)

# The service through every fault of a rig's life, ten minutes: docs/soak.md; `make soak ARGUMENTS="--minutes 120"`, `--devices 32`.
soak: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/monitor/soak/run.py $(ARGUMENTS)

# Latency of the status page under half-sent requests and many that ask: the table in docs/security.md, ten seconds.
web-load: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python benchmarks/monitor/web_load.py

# The unit of `install-service` run by systemd itself: the table in docs/service.md, half a minute; as root, or with delegated groups.
unit: $(VENV)/.done
	$(BIN)/python benchmarks/monitor/systemd_unit.py

# Mutated files for every reader, 2000 each, in hours: `make fuzz ARGUMENTS="site log --first 500 --minutes 10"`.
fuzz: $(VENV)/.done
	OPENBLAS_NUM_THREADS=1 $(BIN)/python tests/fuzz/run.py $(ARGUMENTS)

# Small faults put into modules, and the tests that should notice: the table in CONTRIBUTING.md, some minutes a module;
# it goes on where it was stopped (mutants.jsonl); `make mutants ARGUMENTS="oma/tracking/tracker.py --sample 60 --again"`.
mutants: export OPENBLAS_NUM_THREADS = 1
mutants: $(VENV)/.done
	$(BIN)/python tests/mutants/run.py $(ARGUMENTS)

$(VENV)/.done: requirements.lock requirements-dev.lock pyproject.toml
	$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11) and "modalwatch needs Python 3.11 or newer: make PYTHON=python3.11 ...")'
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --require-hashes -r requirements.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps -r requirements-dev.lock
	$(BIN)/python -m pip install --quiet --disable-pip-version-check --no-deps --editable .
	touch $@

clean:
	rm -rf $(VENV) demo-output build dist .mypy_cache .ruff_cache .pytest_cache .hypothesis
