"""Characterisation: Young's modulus of Onyx from bending tests of a 1 mm and a 2 mm thick specimen.

Reads forces and displacements of each specimen from a CSV file and fits one modulus to both, with its 95 % confidence
interval. One end of a specimen is clamped, a grip on the other is pushed across it. The data that come with the demo
are synthetic (see demos/data/README.md).

    python3 demos/characterise.py [--data DIR] [--space SPACE] [--size MM] [--quick] [--out DIR]
"""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import fenicsmech as fm

LENGTH, DEPTH, CLAMP = 60.0, 5.0, 6.0  # mm: free length, width across the bending, length of the clamped ends
FILES = {1.0: "onyx-1mm.csv", 2.0: "onyx-2mm.csv"}  # thickness, mm
GUESS, TRUE = 1000.0, 1770.0  # MPa: where the fit starts, and the modulus of the data that come with the demo


def onyx(E):
    """Onyx with another Young's modulus."""
    return replace(fm.ONYX, law=replace(fm.ONYX.law, E=E))


def bending_test(thickness, material):
    """The scene for a specimen ``thickness`` mm thick, and the force on its grip."""
    rig = fm.Mechanism(f"{thickness:g} mm specimen")
    bench, grip = rig.rigid("bench", fixed=True), rig.rigid("grip")
    shape = fm.strip([(-CLAMP, 0), (LENGTH + CLAMP, 0)], thickness=thickness, depth=DEPTH)
    specimen = rig.flexible("specimen", shape, material)
    clamp = fm.Rectangle(CLAMP, 1.5 * thickness)
    rig.weld(bench, specimen, at=(-0.5 * CLAMP, 0), region=clamp)
    rig.weld(specimen, grip, at=(LENGTH + 0.5 * CLAMP, 0), region=clamp)
    return fm.Scene(rig), rig.force(on=grip, at=(LENGTH, 0), direction=(0, 1), name="push on grip")


def main():
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=Path(__file__).parent / "data", metavar="DIR")
    parser.add_argument("--space", choices=list(fm.SPACES), default="3d")
    parser.add_argument("--size", type=float, default=1.0, metavar="MM", help="element size (default 1 mm)")
    parser.add_argument("--quick", dest="size", action="store_const", const=1.25, help="elements of 1.25 mm")
    parser.add_argument("--out", type=Path, default=Path("results/characterise"), metavar="DIR")
    options = parser.parse_args()

    experiments = []
    for thickness, name in FILES.items():
        scene, push = bending_test(thickness, onyx(GUESS))
        sim = fm.Simulation(scene, space=options.space, size=options.size)
        experiments.append(fm.Experiment.read(sim, push, options.data / name))
    fit = fm.fit_modulus(experiments, onyx(GUESS))

    low, high = fit.interval
    series = []
    for curve, test, thickness, colour in zip(fit.curves, experiments, FILES, ("C0", "C1"), strict=True):
        label = f"{thickness:g} mm thick"
        series.append(curve.series("fitted", colour=colour, faint=True))
        series.append(fm.CurveSeries(test.displacements, test.forces, label, joined=False, colour=colour))
    title = f"Onyx: E = {fit.youngs_modulus:.0f} MPa ({low:.0f} to {high:.0f})"
    fm.plot_curve(options.out / "curve.png", series, title=title)
    figures = {"youngs_modulus": fit.youngs_modulus, "interval": fit.interval, "true": TRUE, "spread": fit.spread}
    figures |= {"iterations": fit.iterations, "residuals": fit.residuals}
    if sim.comm.rank == 0:
        (options.out / "summary.json").write_text(json.dumps(figures, indent=2))
    for thickness, residuals in zip(FILES, fit.residuals, strict=True):
        worst = max(map(abs, residuals))
        fm.print_once(f"{thickness:g} mm: {len(residuals)} readings, deviations up to {worst:.3g} mm")
    fm.print_once(f"E = {fit.youngs_modulus:.1f} MPa, 95 % interval {low:.1f} to {high:.1f} MPa")
    fm.print_once(
        f"(true value of the synthetic data: {TRUE:g} MPa); {fit.iterations} iterations; files in {options.out}"
    )


if __name__ == "__main__":
    main()
