# SPDX-License-Identifier: AGPL-3.0-or-later
# The front door. Needs a Debian 12 with make and git; `make build` installs the rest.
PRESET ?= release
BUILD := $(if $(filter release,$(PRESET)),build,build/$(PRESET))
PROGRAMS := vorocast vorocast-scheduler vorocast-worker vorocast-simulation
CLANG_FORMAT ?= clang-format-14
SOURCES = $(shell git ls-files --cached --others --exclude-standard '*.h' '*.cpp')

.PHONY: help build demo test bench paper-table benchmarks-page check format packages configure clean
help:
	@echo "make build    install what is missing, build; the programs are in $(BUILD)/bin"
	@echo "make demo     build, then make up a capture, track it, simulate an effect and show where the pictures are"
	@echo "make test     build everything and run the tests (PRESET=asan or PRESET=tsan: under sanitizers)"
	@echo "make bench    build and run the benchmarks; each prints time and quality beside its goal and its peer; all cases in $(BUILD)/bench.json"
	@echo "make paper-table       the paper's Table 1 and run times, measured here, as Markdown and as a picture in $(BUILD)/paper-table"
	@echo "make benchmarks-page   both, and docs/benchmarks.md rewritten from them"
	@echo "make check    formatting, layers and clang-tidy"
	@echo "make format   format the sources"
	@echo "make clean    remove $(BUILD)"

packages:
	@deploy/install_packages.sh

configure: packages
	@cmake --preset $(PRESET) --log-level=WARNING

build: configure
	@cmake --build $(BUILD) --target $(PROGRAMS)
	@echo "Programs: $(BUILD)/bin"

demo: build
	@$(BUILD)/bin/vorocast demo --out $(BUILD)/demo --state $(BUILD)/demo/state

test: configure
	@cmake --build $(BUILD)
	@ctest --test-dir $(BUILD) --output-on-failure -j 2

bench: configure
	@cmake --build $(BUILD)
	@tests/bench/run_benchmarks.sh $(BUILD)

paper-table: configure
	@cmake --build $(BUILD) --target paper_table bar_chart evaluate_cells evaluate_surface evaluate_tracking
	@tests/bench/paper_table.py $(BUILD)

benchmarks-page: bench paper-table
	@tests/bench/benchmarks_page.py $(BUILD) docs/benchmarks.md

check: configure
	@$(CLANG_FORMAT) --dry-run --Werror $(SOURCES)
	@cmake --build $(BUILD) --target tests_style && $(BUILD)/bin/tests_style --gtest_brief=1
	@deploy/run_clang_tidy.sh $(BUILD)

format:
	@$(CLANG_FORMAT) -i $(SOURCES)

clean:
	@rm -rf $(BUILD)
