"""What the demos share: their options and the folder their files go to."""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

from mpi4py import MPI

import fenicsmech as fm
from fenicsmech.model import SPACES


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


def parse(name: str, description: str, *, size: float, quick_size: float, data: Path | None = None) -> Demo:
    """The options of demo ``name``: of one that optimises links, or of one that reads measurements from ``data``.

    ``size`` and ``quick_size`` are its default element sizes in mm.
    """
    fm.mpi_abort_on_error()
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--space", choices=list(SPACES), default="3d", help=f"one of {', '.join(SPACES)}")
    parser.add_argument("--order", type=int, choices=(1, 2), default=2, help="degree of the displacement field")
    parser.add_argument("--size", type=float, metavar="MM", help=f"element size (default {size} mm)")
    if data is None:
        parser.add_argument("--simulate-only", action="store_true", help="simulate the initial design only")
        parser.add_argument("--resume", action="store_true", help="go on with an optimisation that was interrupted")
        parser.add_argument("--bfgs", action="store_true", help="optimise by BFGS instead of Levenberg–Marquardt")
    else:
        parser.add_argument("--data", type=Path, default=data, metavar="DIR", help="folder of the measurements")
    parser.add_argument("--quick", action="store_true", help=f"coarse: element size {quick_size} mm")
    parser.add_argument("--out", type=Path, default=Path("results") / name, metavar="DIR", help="folder for files")
    options = parser.parse_args()
    if options.size is None:
        options.size = quick_size if options.quick else size
    return Demo(name, options, perf_counter())


def simulation(demo: Demo, scene: fm.Scene, space: str | None = None) -> fm.Simulation:
    """The scene at the fidelity asked for; ``space`` replaces the one asked for."""
    return fm.Simulation(scene, space=space or demo.options.space, order=demo.options.order, size=demo.options.size)
