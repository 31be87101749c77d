# Every target sets up what it needs: a .venv with the pinned packages and the `garden` command.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
INSTALLED := $(VENV)/.installed
export PREFECT_SERVER_ANALYTICS_ENABLED = false

.PHONY: install demo test check lint faults server worker sample clean

install: $(INSTALLED)

$(INSTALLED): pyproject.toml constraints.txt
	@$(PYTHON) -c 'import sys; sys.exit(sys.version_info < (3, 11))' || \
		{ echo "GARDEN needs Python 3.11 or newer; set PYTHON=/path/to/python3.11"; exit 1; }
	$(PYTHON) -m venv $(VENV)
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt -e '.[dev]'
	$(BIN)/python -m pip install --quiet --disable-pip-version-check -c constraints.txt --no-deps depth-anything-3
	@touch $(INSTALLED)

demo: install
	$(BIN)/garden factorize tests/scenes/corner --out scenes
	@echo
	@echo "Look at   scenes/corner/report.html          (opens in any browser, no network)"
	@echo "Simulate  $(BIN)/python -m mujoco.viewer --mjcf=scenes/corner/scene.xml"

test: install
	$(BIN)/python -m pytest

check: install
	$(BIN)/python -m pytest -m "not slow"

lint: install
	$(BIN)/ruff check .
	$(BIN)/ruff format --check .
	$(BIN)/mypy
	$(BIN)/lint-imports

faults: install
	$(BIN)/python -m tests.faults $(PARTS)

# The two commands of docs/deploy.md: make server, and in another terminal
# make worker COLLECTION=rooms.toml
PREFECT_API_URL ?= http://127.0.0.1:4200/api

server: install
	$(BIN)/prefect server start --host 127.0.0.1

worker: export PREFECT_API_URL := $(PREFECT_API_URL)
worker: install
	$(BIN)/python deploy/register.py $(if $(COLLECTION),--collection "$(COLLECTION)")
	$(BIN)/prefect worker start --pool garden --type process --limit 1

sample: install
	$(BIN)/python -m pip install --quiet -c constraints.txt -e '.[sample]'
	$(BIN)/python -m tests.scenes.make_corner

clean:
	rm -rf $(VENV) scenes build *.egg-info
