"""Characterisation: Young's modulus of Onyx from bending tests of a 1 mm and a 2 mm thick sample.

Reads forces and displacements of each sample from a CSV file and fits one modulus to both, with its 95 % confidence
interval. The data that come with the demo are synthetic (see demos/data/README.md).

    python3 demos/characterize.py [--data DIR] [--space SPACE] [--order 1|2] [--size MM]
"""

from pathlib import Path
from time import perf_counter

from common import parse, simulation
from samples import bending_test, of_modulus

import fenicsmech as fm
from benchmarks.table import format_table
from fenicsmech.files import read_csv, write_json
from fenicsmech.plot import PALETTE, CurveSeries, plot_curve

SIZE = 1.0  # mm
GUESS = of_modulus(1000.0)
FILES = {1.0: "onyx-1mm.csv", 2.0: "onyx-2mm.csv"}
TRUE = 1770.0  # MPa, of the data that come with the demo


def measured(folder):
    """The readings of each sample: thickness → (forces, displacements)."""
    tables = {thickness: read_csv(folder / name) for thickness, name in FILES.items()}
    return {thickness: (table["force [N]"], table["displacement [mm]"]) for thickness, table in tables.items()}


def main():
    demo = parse(
        "characterize", __doc__.splitlines()[0], size=SIZE, quick_size=1.25, data=Path(__file__).parent / "data"
    )
    readings = measured(demo.options.data)
    experiments = []
    for thickness, (forces, displacements) in readings.items():
        scene, push = bending_test(thickness, GUESS)
        experiments.append(fm.Experiment(simulation(demo, scene), push, forces, displacements))
    start = perf_counter()
    fit = fm.fit_modulus(experiments, GUESS)
    seconds = perf_counter() - start
    leave(demo, experiments, fit, seconds)


def leave(demo, experiments, fit, seconds):
    """Leaves picture and summary, prints what was found (collective)."""
    summary = summarise(demo, experiments, fit, seconds)
    if not demo.leads:
        return
    series = []
    for curve, experiment, thickness, colour in zip(fit.curves, experiments, FILES, PALETTE, strict=False):
        series += [
            curve.series("fitted", colour=colour, faint=True),
            CurveSeries(
                experiment.displacements, experiment.forces, f"{thickness:g} mm thick", joined=False, colour=colour
            ),
        ]
    low, high = fit.interval
    title = f"Onyx: E = {fit.youngs_modulus:.0f} MPa ({low:.0f} to {high:.0f})"
    plot_curve(demo.folder / "curve.png", series, title=title)
    write_json(demo.folder / "summary.json", summary)
    rows = [
        (f"{thickness:g}", len(experiment.forces), experiment.displacements.max(), max(map(abs, residuals)))
        for thickness, experiment, residuals in zip(FILES, experiments, fit.residuals, strict=True)
    ]
    headers = ("thickness [mm]", "readings", "largest displacement [mm]", "largest deviation [mm]")
    demo.say(format_table(headers, rows))
    demo.say(
        f"E = {fit.youngs_modulus:.1f} MPa, 95 % interval {low:.1f} to {high:.1f} MPa (true value of the synthetic "
        f"data: {TRUE:g}); {fit.iterations} iterations, {seconds:.1f} s"
    )
    demo.say(f"files in {demo.folder}")


def summarise(demo, experiments, fit, seconds):
    """The summary of the run (collective)."""
    frames = [frame for curve in fit.curves for frame in curve.frames]
    sims = [experiment.simulation for experiment in experiments]
    return {
        "demo": demo.name,
        "space": demo.options.space,
        "order": demo.options.order,
        "ranks": sims[0].comm.size,
        "dofs": {"rigid": sims[0].model.rigid_dofs, "flexible": sum(sim.model.flexible_dofs for sim in sims)},
        "parameters": 1,
        "targets": [
            {
                "configuration": f"{thickness:g} mm sample",
                "force": float(force),
                "wanted": float(wanted),
                "reached": float(wanted + residual),
            }
            for thickness, experiment, residuals in zip(FILES, experiments, fit.residuals, strict=True)
            for force, wanted, residual in zip(experiment.forces, experiment.displacements, residuals, strict=True)
        ],
        "frames": [
            {
                "force": frame.force,
                "displacement": frame.displacement,
                "seconds": frame.seconds,
                "iterations": frame.iterations,
                "stable": frame.stable,
            }
            for frame in frames
        ],
        "seconds": {
            "setup": sum(sim.setup_seconds for sim in sims),
            "frame_median": sorted(frame.seconds for frame in frames)[len(frames) // 2],
            "optimize": seconds,
        },
        "iterations": fit.iterations,
        "evaluations": fit.iterations + 1,
        "objective": {"initial": None, "final": fit.spread},
        "thickness": None,
        "mesh_ratio_max": max(sim.mesh_ratio_max for sim in sims),
        "youngs_modulus": {"fitted": fit.youngs_modulus, "interval": fit.interval, "true": TRUE},
    }


if __name__ == "__main__":
    main()
