#!/usr/bin/env python3
# SPDX-License-Identifier: AGPL-3.0-or-later
"""The paper's Table 1 and its run times, measured here: paper_table.py BUILD_FOLDER

Runs paper_table (makes and times everything), has the stored files judged by the evaluators, and writes paper-table/paper_table.md and
paper-table/paper_table.png in the build folder.
"""

import json
import pathlib
import subprocess
import sys

# Table 1: a dancer of 65386 points; the voxels are 2 cm wide, which made 14455 cells.
PAPER_POINTS = 65386
PAPER_ROWS = {
    "Voxels (marching cubes)": (61.21, 0.945),
    "Delaunay refinement": (147.31, 6.944),
    "CVT, 0 iterations": (60.17, 2.14),
    "CVT, 10 iterations": (42.77, 16.65),
}
# "Run Time Performance": seconds; what, the paper's figure.
PAPER_RUN_TIME = {
    "poisson": ("Poisson, a frame", 0.67),
    "cells": ("cells, a frame (5000, 10 iterations)", 6.27),
    "template": ("cells of the template (5000, 50 iterations)", 25.52),
    "tracking": ("tracking, a frame", 45.0),
    "simulation": ("simulation, a step", 0.350),
}


def judged(build, out, take):
    """Scores of a take's rows, by file name, from the stored files alone."""
    folder = out / take["take"]
    scores = {}
    made = [row["file"] for row in take["rows"] if row["file"]]
    cells = [name for name in made if name.endswith(".h5")] + ["cubes.h5"]
    surfaces = [name for name in made if name.endswith(".off")]
    for program, arguments in (("evaluate_cells", cells), ("evaluate_surface", ["cubes.h5"] + surfaces)):
        answer = folder / f"{program}.json"
        subprocess.run([build / "bin" / program, "--json", answer, *(folder / name for name in arguments)], check=True)
        for score in json.loads(answer.read_text()):
            scores[pathlib.Path(score["file"]).name] = score
    return scores


def tracking_score(build, out, take):
    if not take["truth"]:
        return None
    answer = out / take["take"] / "evaluate_tracking.json"
    command = [build / "bin" / "evaluate_tracking", out / take["take"] / "tracked.h5", take["truth"], "--json", answer]
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    return json.loads(answer.read_text())


def first_table(takes):
    names = [take["take"] for take in takes]
    lines = ["| method | paper: sum, mean, time | " + " | ".join(f"{take['take']}, {take['points']} points" for take in takes) + " |",
             "|---|---|" + "---|" * len(names)]
    for index, row in enumerate(takes[0]["rows"]):
        paper = PAPER_ROWS.get(row["method"])
        fields = [f"{paper[0]:.2f} m, {1000 * paper[0] / PAPER_POINTS:.2f} mm, {paper[1]:g} s" if paper else "–"]
        for take in takes:
            mine = take["rows"][index]
            if not mine["file"]:
                fields.append("failed")
                continue
            g3 = f", G3 {mine['g3']:.4f}" if mine["g3"] else ""
            fields.append(f"{mine['sum_m']:.2f} m, {mine['mean_mm']:.2f} mm, {mine['cpu_s']:.2f} s; {mine['cells']} cells{g3}")
        lines.append(f"| {row['method']} | " + " | ".join(fields) + " |")
    # The last row's cells were made from another start, but of the same surface.
    ratio = [take["rows"][-1]["sum_m"] / take["rows"][0]["sum_m"] for take in takes]
    lines.append("| **CVT, 10 iterations, of voxels** | 0.70 | " + " | ".join(f"{value:.2f}" for value in ratio) + " |")
    return lines


def second_table(takes):
    lines = ["| CPU seconds of one thread | paper (2 × Xeon E5-2665) | " + " | ".join(take["take"] for take in takes) + " |",
             "|---|---|" + "---|" * len(takes)]
    for key, (what, paper) in PAPER_RUN_TIME.items():
        cells = [f"{take['run_time'][key]:.3g} ({paper / take['run_time'][key]:.0f} times faster)" for take in takes]
        lines.append(f"| {what} | {paper:g} | " + " | ".join(cells) + " |")
    errors = [f"mean {t['tracking']['mean_mm']:.2f} mm, 95 % {t['tracking']['p95_mm']:.2f} mm" if t["tracking"] else "truth unknown" for t in takes]
    lines.append("| tracked points, distance to where they truly are | not reported | " + " | ".join(errors) + " |")
    return lines


def chart(takes):
    methods = [row["method"] for row in takes[0]["rows"]]
    short = {"Voxels (marching cubes)": "Voxels", "CVT, 0 iterations": "CVT, 0 iterations", "CVT, 10 iterations, lattice start": "CVT, 10, lattice"}
    paper = [PAPER_ROWS.get(method) for method in methods]

    def panel(title, log, of_paper, of_row):
        series = [{"name": "paper", "values": [of_paper(row) if row else None for row in paper]}]
        series += [{"name": take["take"], "values": [of_row(row) for row in take["rows"]]} for take in takes]
        return {"title": title, "log": log, "groups": [short.get(method, method) for method in methods], "series": series}

    return {"title": "The paper's Table 1, measured here",
            "panels": [panel("Mean distance of the input points to the surface (mm)", False, lambda row: 1000 * row[0] / PAPER_POINTS,
                             lambda row: row.get("mean_mm")),
                       panel("CPU time (s), logarithmic", True, lambda row: row[1], lambda row: row.get("cpu_s"))]}


def main():
    build = pathlib.Path(sys.argv[1])
    out = build / "paper-table"
    subprocess.run([build / "bin" / "paper_table", out], check=True)
    takes = json.loads((out / "times.json").read_text())
    for take in takes:
        scores = judged(build, out, take)
        for row in take["rows"]:
            if not row["file"]:
                continue
            score = scores[row["file"]]
            row["sum_m"] = score["distance_sum_m"]
            row["mean_mm"] = 1000 * score["distance_sum_m"] / score["points"]
            # Voxels are judged by their surface; their G3 is that of whole cubes.
            row["g3"] = score.get("g3") or scores["cubes.h5"]["g3"]
        take["tracking"] = tracking_score(build, out, take)
    (out / "paper_table.md").write_text("\n".join(first_table(takes) + [""] + second_table(takes)) + "\n")
    (out / "chart.json").write_text(json.dumps(chart(takes), indent=2) + "\n")
    subprocess.run([build / "bin" / "bar_chart", out / "chart.json", out / "paper_table.png"], check=True)
    print((out / "paper_table.md").read_text())
    print(f"{out / 'paper_table.md'}\n{out / 'paper_table.png'}")


if __name__ == "__main__":
    main()
