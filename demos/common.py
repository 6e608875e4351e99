"""What the demos share: their options, the files they leave, the figures they print."""

from __future__ import annotations

import argparse
import resource
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from time import perf_counter

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.report import check_summary, draw_configurations, format_table, plot_curve, write_summary
from fenicsmech.simulation import SPACES


@dataclass(frozen=True)
class Target:
    """A wanted load–displacement sample: ``displacement`` at ``force`` in ``configuration``."""

    configuration: fm.Configuration
    force: float
    displacement: float


@dataclass
class Demo:
    """A demo run: its options and where its files go."""

    name: str
    options: argparse.Namespace
    started: float

    @property
    def folder(self) -> Path:
        return self.options.out

    @property
    def leads(self) -> bool:
        """Whether this process prints and writes."""
        return MPI.COMM_WORLD.rank == 0

    def say(self, text: str) -> None:
        """Prints on rank 0."""
        if self.leads:
            print(text, flush=True)


def parse(name: str, description: str, *, size: float, quick_size: float) -> Demo:
    """The options of demo ``name``; ``size`` and ``quick_size`` are its default element sizes in mm."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument(
        "--space", choices=list(SPACES), default="3d", help="3d (default), plane-stress or plane-strain"
    )
    parser.add_argument("--order", type=int, choices=(1, 2), default=2, help="degree of the displacement field")
    parser.add_argument("--size", type=float, metavar="MM", help=f"element size (default {size} mm)")
    parser.add_argument("--simulate-only", action="store_true", help="simulate the initial design only")
    parser.add_argument("--quick", action="store_true", help=f"coarse: element size {quick_size} mm")
    parser.add_argument("--out", type=Path, default=Path("results") / name, metavar="DIR", help="folder for files")
    options = parser.parse_args()
    if options.size is None:
        options.size = quick_size if options.quick else size
    return Demo(name, options, perf_counter())


def simulation(demo: Demo, scene: fm.Scene) -> fm.Simulation:
    """The scene at the fidelity asked for."""
    return fm.Simulation(scene, space=demo.options.space, order=demo.options.order, size=demo.options.size)


def finish(demo: Demo, sim: fm.Simulation, curves: Sequence[fm.Curve], targets: Sequence[Target]) -> None:
    """Leaves pictures, curves, fields and summary in the demo's folder and prints what was found (collective)."""
    panels = [sim.panel(curve) for curve in curves]
    for curve in curves:
        sim.write(demo.folder / f"deformed{_suffix(curve, curves)}.xdmf", curve)
    summary = summarise(demo, sim, curves, targets)
    if not demo.leads:
        return
    draw_configurations(
        demo.folder / "mechanism.png", panels, title=sim.scene.mechanism.name, colour_label="von Mises stress [MPa]"
    )
    plot_curve(
        demo.folder / "curve.png",
        [curve.series(curve.configuration.name) for curve in curves],
        title=f"{sim.scene.mechanism.name}: initial design",
    )
    for curve in curves:
        curve.write_csv(demo.folder / f"curve{_suffix(curve, curves)}.csv")
    check_summary(summary)
    write_summary(demo.folder / "summary.json", summary)
    tell(demo, sim, curves, summary)


def summarise(demo: Demo, sim: fm.Simulation, curves: Sequence[fm.Curve], targets: Sequence[Target]) -> dict:
    """The summary of a simulated initial design (collective)."""
    peak = sim.comm.allreduce(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, op=MPI.MAX) / 1024.0
    frames = _loaded(curves)
    return {
        "demo": demo.name,
        "space": demo.options.space,
        "order": demo.options.order,
        "ranks": sim.comm.size,
        "dofs": {"rigid": sim.model.rigid_dofs, "flexible": sim.model.flexible_dofs},
        "parameters": None,
        "targets": [
            {"configuration": t.configuration.name, "force": t.force, "wanted": t.displacement, "reached": None}
            for t in targets
        ],
        "frames": [
            {
                "configuration": curve.configuration.name,
                "force": frame.force,
                "displacement": frame.displacement,
                "seconds": frame.seconds,
                "iterations": frame.iterations,
                "stable": frame.stable,
                "mobility": curve.freedom.mobility,
                "redundancy": curve.freedom.redundancy,
                "strain_energy": frame.strain_energy,
                "max_von_mises": frame.max_stress,
            }
            for curve in curves
            for frame in curve.frames
        ],
        "seconds": {
            "setup": sim.setup_seconds,
            "frame_median": median(frame.seconds for frame in frames),
            "optimize": None,
            "phases": sim.clock.seconds,
        },
        "iterations": sum(frame.iterations for frame in frames),
        "evaluations": None,
        "objective": {"initial": None, "final": None},
        "thickness": None,
        "mesh_ratio_max": sim.mesh_ratio_max,
        "peak_memory_mb": peak,
    }


def tell(demo: Demo, sim: fm.Simulation, curves: Sequence[fm.Curve], summary: dict) -> None:
    """Prints the frames, the size of the problem, and where the time went."""
    rows = [
        (curve.configuration.name, f.force, f.displacement, "yes" if f.stable else "no", f.iterations, f.seconds)
        for curve in curves
        for f in curve.frames
    ]
    headers = ("configuration", "force [N]", "displacement [mm]", "stable", "iterations", "seconds")
    demo.say(format_table(headers, rows))
    dofs = summary["dofs"]
    demo.say(f"DOFs: {dofs['rigid']} rigid + {dofs['flexible']} flexible, {sim.comm.size} process(es)")
    phases = ", ".join(f"{name} {value:.2f}" for name, value in sim.clock.seconds.items())
    demo.say(f"seconds: {phases}; in all {perf_counter() - demo.started:.1f}")
    seconds, peak = summary["seconds"]["frame_median"], summary["peak_memory_mb"]
    demo.say(f"frame_median: {seconds:.3f} s, peak memory {peak:.0f} MB")
    demo.say(f"files in {demo.folder}")


def _suffix(curve: fm.Curve, curves: Sequence[fm.Curve]) -> str:
    return f"-{curve.configuration.name.replace(' ', '-')}" if len(curves) > 1 else ""


def _loaded(curves: Sequence[fm.Curve]) -> list[fm.Frame]:
    """Frames under load: those without cost less than a frame does."""
    return [frame for curve in curves for frame in curve.frames if frame.force != 0.0]
