# make demo and make test are all that is needed: both set up .venv first when it is not up to date.

PYTHON ?=
STAMP := .venv/.set-up

# A .venv that was moved or copied here belongs to another checkout: set up again.
ifneq ($(shell cat $(STAMP) 2>/dev/null),$(CURDIR))
.PHONY: $(STAMP)
endif

.PHONY: setup demo test lint
setup: $(STAMP)

$(STAMP): pyproject.toml .ci/setup
	@PYTHON="$(PYTHON)" .ci/setup
	@printf '%s' '$(CURDIR)' > $@

demo: setup
	.venv/bin/roomloop run SE1 --seed 0

test: setup
	.venv/bin/python -m pytest -n auto --maxprocesses 4 --dist loadfile -m "not slow"

lint: setup
	.venv/bin/ruff check .
	.venv/bin/ruff format --check .
	.venv/bin/mypy
