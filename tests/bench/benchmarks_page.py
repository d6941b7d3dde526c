#!/usr/bin/env python3
# SPDX-License-Identifier: AGPL-3.0-or-later
"""Puts measured tables into docs/benchmarks.md: benchmarks_page.py BUILD_FOLDER PAGE

Rewrites what stands between the page's markers from BUILD_FOLDER/bench.json (make bench) and BUILD_FOLDER/paper-table (make paper-table), and copies the
picture beside the page. What has not been measured keeps its old table.
"""

import json
import pathlib
import re
import shutil
import sys


def figure(name, value):
    """A figure with its name; the unit is in the name's last word."""
    if value is None:
        return f"{name.replace('_', ' ')} unknown"
    return f"{name.replace('_', ' ')} " + (f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.4g}")


def ratio(theirs, ours):
    return f"{theirs / ours:,.0f}" if theirs / ours >= 1000 else f"{theirs / ours:.3g}"


def figures(values):
    return "; ".join(figure(name, value) for name, value in sorted(values.items())) or "–"


def reached(case):
    """Whether each goal is met, or none was set."""
    met, missed = [], []
    for name, goal in sorted(case["goal"].items()):
        least = name.startswith("min_")
        known = {"cpu_s": case["cpu_s"], **case["quality"]}
        value = known.get(name, known.get(name.removeprefix("min_")))
        if value is None:
            continue
        (met if (value >= goal if least else value <= goal) else missed).append(name.replace("_", " "))
    if not met and not missed:
        return "–"
    return "yes" if not missed else f"**no**: {', '.join(missed)}"


def bench_table(cases):
    lines = ["| case | CPU s | quality | goal | reached | peer in the same run |", "|---|---|---|---|---|---|"]
    for case in cases:
        peer = "–"
        if case["peer"]:
            time = f": {case['peer_cpu_s']:.4g} s" if case["peer_cpu_s"] is not None else ""
            faster = f" ({ratio(case['peer_cpu_s'], case['cpu_s'])} × ours)" if case["peer_cpu_s"] and case["cpu_s"] else ""
            quality = f"; {figures(case['peer_quality'])}" if case["peer_quality"] else ""
            peer = f"{case['peer']}{time}{faster}{quality}"
        name = f"`{case['case']}`" + (f"<br>{case['input']}" if case.get("input") else "")
        lines.append(f"| {name} | {case['cpu_s']:.4g} | {figures(case['quality'])} | {figures(case['goal'])} | {reached(case)} | {peer} |")
    return "\n".join(lines)


def replaced(page, marker, text):
    pattern = re.compile(rf"(<!-- {marker}: begin -->\n).*?(<!-- {marker}: end -->)", re.DOTALL)
    if not pattern.search(page):
        sys.exit(f"the page has no markers '<!-- {marker}: begin -->' and '<!-- {marker}: end -->'")
    return pattern.sub(lambda match: match.group(1) + text.strip() + "\n" + match.group(2), page)


def main():
    build, path = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    page = path.read_text()
    bench, table = build / "bench.json", build / "paper-table" / "paper_table.md"
    if bench.exists():
        page = replaced(page, "bench", bench_table(json.loads(bench.read_text())))
    if table.exists():
        page = replaced(page, "paper table", table.read_text())
        (path.parent / "pictures").mkdir(exist_ok=True)
        shutil.copy(build / "paper-table" / "paper_table.png", path.parent / "pictures" / "paper_table.png")
    path.write_text(page)
    print(f"{path}: " + ", ".join(str(source) for source in (bench, table) if source.exists()))


if __name__ == "__main__":
    main()
