# `make help` lists what there is. All that is made stays inside this checkout.
.DEFAULT_GOAL := help
.PHONY: help book test certificates attack proof test-pages test-portable verify-sweeps notebooks findings lint format exactness bench environment screenshots pdf serve clean

HERE := $(CURDIR)
PY := .venv/bin/python
HTML := _build/html
UV_COMPILE := -m uv --no-config pip compile --universal --python-version 3.11 --fork-strategy fewest --only-binary :all: \
	--generate-hashes --no-emit-index-url --custom-compile-command "make environment" --quiet

# Outputs are stored without times, versions and the moments at which a text was flushed, which differ between runs.
EXECUTE := --log-level=WARN --to notebook --execute --inplace --ExecutePreprocessor.record_timing=False \
	--Exporter.preprocessors=nbconvert.preprocessors.CoalesceStreamsPreprocessor \
	--ClearMetadataPreprocessor.enabled=True --ClearMetadataPreprocessor.clear_cell_metadata=False \
	--ClearMetadataPreprocessor.preserve_nb_metadata_mask="{'kernelspec', ('language_info', 'name')}"

# Caches and settings that would else go to the home folder, or come from it and change a result.
export PIP_CACHE_DIR := $(HERE)/.cache/pip
export PIP_DISABLE_PIP_VERSION_CHECK := 1
export UV_CACHE_DIR := $(HERE)/.cache/uv
export XDG_CACHE_HOME := $(HERE)/.cache
export XDG_DATA_HOME := $(HERE)/.cache/data
export XDG_STATE_HOME := $(HERE)/.cache/state
export MPLCONFIGDIR := $(HERE)/.cache/matplotlib
export IPYTHONDIR := $(HERE)/.cache/ipython
export JUPYTER_CONFIG_DIR := $(HERE)/.cache/jupyter/config
export JUPYTER_DATA_DIR := $(HERE)/.cache/jupyter/data
export JUPYTER_RUNTIME_DIR := $(HERE)/.cache/jupyter/runtime
export JUPYTER_PLATFORM_DIRS := 1
export JUPYTER_PREFER_ENV_PATH := 1
export PYTEST_DEBUG_TEMPROOT := $(HERE)/.cache/tmp
export RUFF_CACHE_DIR := $(HERE)/.cache/ruff
export MYPY_CACHE_DIR := $(HERE)/.cache/mypy
export PYTHONNOUSERSITE := 1
# Long comparisons draw other inputs each day. Slices of one day's, SLICE=0/20 to 19/20, are together the whole.
SEED ?= $(shell date -u +%Y%m%d)
# Without bytecode, which images of containers turn off, each process compiles up to 2,700 modules again.
unexport PYTHONDONTWRITEBYTECODE
unexport NUMBA_CACHE_DIR PYTHONPATH PYTHONHOME MPLBACKEND JUPYTER_PATH JUPYTER_CONFIG_PATH

# IPython and pytest want theirs to be there.
_ := $(shell mkdir -p .cache/tmp)

# A moved checkout needs a new .venv: the old one points to the old place.
ifneq ($(shell cat .venv/made-for 2>/dev/null),$(HERE))
.PHONY: .venv/made-for
endif

help: ## list the targets
	@sed -n 's/^\([a-z][a-z-]*\):[^#]*## \(.*\)/  make \1|\2/p' Makefile | awk -F'|' '{printf "%-20s %s\n", $$1, $$2}'

# The stamp is written last, so that a .venv interrupted half-way is made anew.
.venv/made-for: environment.txt
	@scripts/make-venv.sh
	@printf '%s\n' '$(HERE)' > $@

# What few targets need is installed when one of them first asks for it. pychop, a peer in benchmarks, has no wheel.
.venv/with-%: environment-%.txt .venv/made-for
	$(PY) -m pip install --quiet --no-deps --require-hashes --no-build-isolation -r $<
	@touch $@

# Any page may show a number of any other, which Sphinx does not follow: all pages are built anew, in seconds.
book: .venv/made-for ## build the HTML book from the notebooks and their stored outputs
	@rm -rf $(HTML) _build/.doctrees _build/jupyter_execute
	.venv/bin/jupyter-book build . -W -n --keep-going
	@test -f $(HTML)/index.html || { echo "make book: $(HTML)/index.html was not built" >&2; exit 1; }
	@printf '\nThe book is ready. Open it in a browser, no network needed:\n  %s\n  file://%s\n' \
		'$(HTML)/index.html' '$(HERE)/$(HTML)/index.html'

test: .venv/made-for ## unit and property tests, the examples in docstrings, and every notebook against its stored outputs
	$(PY) -m pytest --nbval --ignore=tests/pages

certificates: .venv/made-for ## write a certificate of every guarantee in the book and check it; WORDS="tracker Nile" picks filters
	$(PY) -m gpbnb.report.guarantees.certificates $(WORDS)

attack: .venv/made-for ## attack guarantees of random filters, other ones each day; SLICE=0/20 takes a part, SEED=20261128 those of a day
	$(PY) -m tests.guarantees.attack --first $(SEED)0000 $(if $(SLICE),--slice $(SLICE))

proof: ## check proof/guarantee.v, the theorem behind a certificate; needs Coq (apt-get install coq)
	@mkdir -p .cache/proof
	cp proof/guarantee.v .cache/proof/ && cd .cache/proof && coqc guarantee.v

test-pages: .venv/with-pages ## the built book in a real Chromium without a network
	@test -f $(HTML)/index.html || $(MAKE) book
	@$(PY) -m tests.pages.browser
	$(PY) -m pytest tests/pages

test-portable: .venv/made-for ## notebooks and numerical tests as on other machines; SETTINGS="nehalem locale-de" picks some, QUICK=1 a part
	$(PY) scripts/portable.py $(if $(QUICK),--quick) $(SETTINGS)

verify-sweeps: .venv/made-for ## a sample of every stored sweep computed again on this machine; SAMPLE=5 takes more cells
	$(PY) -m gpbnb.report.stored verify --sample $(or $(SAMPLE),1)

notebooks: .venv/made-for ## execute the notebooks in place; NOTEBOOKS="book/kalman.ipynb" picks some
	ls -S $(or $(NOTEBOOKS),book/*.ipynb) | xargs -P 2 -n 1 .venv/bin/jupyter nbconvert $(EXECUTE)

findings: .venv/made-for ## run every check of the ledger and store the findings
	$(PY) -c "from gpbnb.report.ledger import stored; stored.write_findings()"

lint: .venv/with-dev ## ruff and mypy, and warnings of replaced words
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) scripts/vocabulary.py
	$(PY) -m mypy

format: .venv/with-dev ## let ruff lay out the code and mend what it can
	$(PY) -m ruff check --fix .
	$(PY) -m ruff format .

exactness: .venv/made-for ## long tests, the golden corpus, other inputs each day compared with independent arithmetic, more altered statements; SLICE, SEED
	$(PY) -m pytest -m long --ignore=tests/pages
	$(PY) -m tests.corpus $(if $(SLICE),--slice $(SLICE))
	$(PY) -m tests.corpus.conformance --seed $(SEED) $(if $(SLICE),--slice $(SLICE))
	$(if $(SLICE),,GPBNB_ALTERATIONS=more $(PY) -m pytest -q tests/ledger/test_verdicts.py)

bench: .venv/with-bench ## timings against peers, side by side, the short formats against gfloat, and guarantees
	@missed=0; for part in benchmarks benchmarks.year benchmarks.formats benchmarks.guarantee; do \
		$(PY) -m $$part || missed=1; \
	done; exit $$missed

environment: .venv/with-dev ## compile the lists of pinned packages from pyproject.toml; UPGRADE=1 takes newer versions
	$(PY) $(UV_COMPILE) $(if $(UPGRADE),--upgrade) pyproject.toml --extra report --group book --group test \
		--output-file environment.txt
	for group in dev pages bench; do $(PY) $(UV_COMPILE) $(if $(UPGRADE),--upgrade) --group $$group --no-binary pychop \
		--constraints environment.txt --output-file environment-$$group.txt || exit 1; done

screenshots: .venv/with-pages ## pictures of every page: light, dark, phone
	@test -f $(HTML)/index.html || $(MAKE) book
	$(PY) -m tests.pages.screenshots

pdf: .venv/with-pages ## the whole book as one PDF, printed by Chromium
	@rm -rf _build/singlehtml
	.venv/bin/jupyter-book build . -W -n --keep-going --builder custom --custom-builder singlehtml
	$(PY) -m tests.pages.pdf

serve: .venv/made-for ## serve the built book on loopback, port 8000
	@test -f $(HTML)/index.html || $(MAKE) book
	$(PY) -m http.server --bind 127.0.0.1 --directory $(HTML) 8000

clean: ## remove everything that was made: .venv, .cache, _build
	rm -rf .venv .cache _build
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
