"""Accuracy and time of fidelity levels, on the drawn design of a demo's mechanism.

    OPENBLAS_NUM_THREADS=1 python3 -m benchmarks.work_precision [truss|claw|klann] [--quick] [--out DIR]

Rigid links, plane strain and plane stress P1/P2, 3D P1/P2/P3 of half the depth and of all of it, element sizes,
quadrature degrees and solver tolerances; the reference is the extrapolated limit in space. Leaves table.csv, table.md,
work-precision.png and summary.json.
"""

import math
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

from fenicsmech.files import write_json

from ..mechanisms import mechanism
from ..table import command, publish
from . import Quantity, Study, fidelity_levels, front_of, run_study, save_study, study_text

# mm: close to the demos' own sizes; layers through the depth double whenever the size halves
SIZES = {"truss": 2.5, "claw": 2.125, "klann": 2.125}
QUICK = {
    "planar": {order: (4.0, 2.0, 1.0, 0.5) for order in (1, 2)},
    "spatial": {1: (4.0, 2.0, 1.0), 2: (4.0, 2.0, 1.0), 3: (4.0,)},
    "quadratures": (2,),
    "tolerances": (1e-6,),
}


def summarise(name: str, study: Study, size: float) -> dict:
    """The figures of a study."""
    percent = {m.level.name: 100.0 * study.relative(study.split(m).magnitude) for m in front_of(study)}
    return {
        "mechanism": name,
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
            {"level": m.level.name, "frame_seconds": m.frame_seconds, "error_percent": percent[m.level.name]}
            for m in front_of(study)
        ],
        "failures": {m.level.name: m.failure for m in study.measurements if m.failure},
    }


def main():
    parser = command(__doc__)
    parser.add_argument("mechanism", nargs="?", choices=list(SIZES), default="claw", help="claw by default")
    parser.add_argument("--quick", action="store_true", help="without the finest meshes: seconds instead of minutes")
    parser.add_argument("--out", type=Path, metavar="DIR", help="folder for files (default results/accuracy/MECHANISM)")
    options = parser.parse_args()
    name, case, size = options.mechanism, mechanism(options.mechanism), SIZES[options.mechanism]
    folder, start = options.out or Path("results") / "accuracy" / name, perf_counter()
    quantity = Quantity(case.force, case.loads[-1], case.middle)
    levels = fidelity_levels(case.scene, **(QUICK if options.quick else {}))
    # without the finest meshes no level is left out for the seconds that a coarser one happened to take
    timing = {"repeats": 1, "longest": math.inf} if options.quick else {}
    study = run_study(case.scene, quantity, levels, size=size, **timing)
    if MPI.COMM_WORLD.rank > 0:
        return
    save_study(study, folder)
    write_json(folder / "summary.json", summarise(name, study, size) | {"seconds": perf_counter() - start})
    publish(f"work_precision_{name}", study_text(study), write=options.write)
    print(f"{perf_counter() - start:.0f} s in all; files in {folder}")


if __name__ == "__main__":
    main()
