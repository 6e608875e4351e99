"""What accuracy costs in time: a ladder of fidelities on the drawn design of a demo's mechanism.

    OPENBLAS_NUM_THREADS=1 python3 demos/accuracy.py [truss|claw|klann] [--quick] [--out DIR]

Rigid links, plane strain and plane stress P1/P2, 3D P1/P2/P3 of half the depth and of all of it, element sizes,
quadrature degrees and solver tolerances; the reference is the extrapolated limit in space. Leaves table.csv, table.md,
work-precision.png and summary.json.
"""

import argparse
import importlib
from pathlib import Path
from time import perf_counter

from common import Demo

from fenicsmech.accuracy import Displacement, Study, front_of, ladder, run_study, save_study, study_text
from fenicsmech.report import write_summary

# mm: close to the demos' own sizes; layers through the depth double whenever the size halves
SIZES = {"truss": 2.5, "claw": 2.125, "klann": 2.125}
QUICK = {
    "planar": {order: (4.0, 2.0, 1.0, 0.5) for order in (1, 2)},
    "spatial": {1: (4.0, 2.0, 1.0), 2: (4.0, 2.0, 1.0), 3: (4.0,)},
    "quadratures": (2,),
    "tolerances": (1e-6,),
}


def parse() -> Demo:
    """The options; the demo is named after the mechanism."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("mechanism", nargs="?", choices=list(SIZES), default="claw", help="claw by default")
    parser.add_argument("--quick", action="store_true", help="without the finest meshes: seconds instead of minutes")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for files (default results/accuracy/MECHANISM)")
    options = parser.parse_args()
    if options.out is None:
        options.out = Path("results") / "accuracy" / options.mechanism
    return Demo(options.mechanism, options, perf_counter())


def summarise(demo: Demo, study: Study, size: float) -> dict:
    """The figures of a study."""
    percent = {m.rung.name: 100.0 * study.relative(study.split(m).magnitude) for m in front_of(study)}
    return {
        "demo": demo.name,
        "quantity": study.quantity.name,
        "load": study.quantity.load,
        "configuration": study.quantity.configuration.name,
        "size": size,
        "ranks": study.ranks,
        "reference": study.reference and study.reference.value,
        "reference_order": study.reference and study.reference.order,
        "reference_uncertainty_percent": study.uncertainty and 100.0 * study.uncertainty,
        "limits": {
            model.name: {"value": limit.value, "uncertainty": limit.uncertainty, "order": limit.order}
            for model, limit in study.limits.items()
        },
        "front": [
            {"rung": m.rung.name, "frame_seconds": m.frame_seconds, "error_percent": percent[m.rung.name]}
            for m in front_of(study)
        ],
        "failures": {m.rung.name: m.failure for m in study.measurements if m.failure},
        "seconds": perf_counter() - demo.started,
    }


def main():
    demo = parse()
    module = importlib.import_module(demo.name)
    described = module.describe()
    task = module.task(*described)
    quantity = Displacement(task.force, task.loads[-1], task.configurations[len(task.configurations) // 2])
    quick, size = demo.options.quick, SIZES[demo.name]
    rungs = ladder(described[0], **(QUICK if quick else {}))
    study = run_study(described[0], quantity, rungs, size=size, repeats=1 if quick else 3)
    if not demo.leads:
        return
    save_study(study, demo.folder)
    summary = summarise(demo, study, size)
    write_summary(demo.folder / "summary.json", summary)
    demo.say(study_text(study))
    demo.say(f"{summary['seconds']:.0f} s in all; files in {demo.folder}")


if __name__ == "__main__":
    main()
