"""Static large-deformation solutions by CalculiX (the ccx program): C3D10 tetrahedra, compressible neo-Hooke.

    W = C10 (J^(−2/3) tr FᵀF − 3) + (J − 1)² / D1,   C10 = μ / 2,   D1 = 2 / κ

Node numbering of a quadratic tetrahedron: vertices 0–3, then the midpoints of the edges

    VTK and CalculiX   (0,1) (1,2) (0,2) (0,3) (1,3) (2,3)      what this module computes with
    gmsh               (0,1) (1,2) (0,2) (0,3) (2,3) (1,3)
    basix, dolfinx     (2,3) (1,3) (1,2) (0,3) (0,2) (0,1)

CalculiX wants positively oriented cells; cells of the other orientation are mirrored before they are written.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

# cells[:, VTK_FROM_BASIX] and cells[:, VTK_FROM_GMSH] are in VTK order
VTK_FROM_BASIX = (0, 1, 2, 3, 9, 6, 8, 7, 5, 4)
VTK_FROM_GMSH = (0, 1, 2, 3, 4, 5, 6, 7, 9, 8)
VTK_EDGES = ((0, 1), (1, 2), (0, 2), (0, 3), (1, 3), (2, 3))

_MIRRORED = (0, 2, 1, 3, 6, 5, 4, 7, 9, 8)  # vertices 1 and 2 swapped
_LINE = 12  # entries per line of an element or node set, below the 16 that ccx reads


@dataclass(frozen=True)
class Mesh:
    """Quadratic tetrahedra: points (n, 3), cells (m, 10) in VTK order, and the material number of each cell (m,)."""

    points: np.ndarray
    cells: np.ndarray
    tags: np.ndarray


@dataclass(frozen=True)
class NeoHooke:
    """Young's modulus and Poisson's ratio at small strain."""

    young: float
    poisson: float

    def coefficients(self) -> tuple[float, float]:
        """C10 = μ/2 and D1 = 2/κ."""
        shear = self.young / (2.0 * (1.0 + self.poisson))
        bulk = self.young / (3.0 * (1.0 - 2.0 * self.poisson))
        return 0.5 * shear, 2.0 / bulk


@dataclass(frozen=True)
class Fixed:
    """Prescribed displacement of ``nodes`` (k,): values (k, 3) or (3,), NaN where a component is free."""

    nodes: np.ndarray
    values: np.ndarray


@dataclass(frozen=True)
class Solution:
    """Displacement (n, 3) and what supports and loads exert on each node, force (n, 3); seven digits, as ccx prints."""

    displacement: np.ndarray
    force: np.ndarray


def available() -> bool:
    """Whether the ccx program is installed (Debian package calculix-ccx)."""
    return shutil.which("ccx") is not None


def solve(
    mesh: Mesh,
    materials: Mapping[int, NeoHooke],
    dirichlet: Sequence[Fixed],
    forces: Mapping[int, Sequence[float]] | None = None,
    *,
    steps: int = 1,
    timeout: float = 300.0,
) -> Solution:
    """Equilibrium of ``mesh`` under prescribed displacements and dead nodal ``forces`` {node: (3,)}.

    materials: per cell tag; steps: equal load increments to start with (ccx cuts them where it must);
    timeout: seconds. Raises RuntimeError when ccx is missing, does not converge (with the end of its output), or turns
    cells inside out, which its energy allows.
    """
    if not available():
        raise RuntimeError("ccx is not installed: apt install calculix-ccx")
    with tempfile.TemporaryDirectory(prefix="ccx_") as folder:
        job = Path(folder, "job.inp")
        job.write_text(deck(mesh, materials, dirichlet, forces or {}, steps=steps))
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        run = subprocess.run(
            ["ccx", "job"], cwd=folder, env=environment, capture_output=True, text=True, timeout=timeout, check=False
        )
        output = job.with_suffix(".dat")
        blocks = _blocks(output.read_text()) if output.exists() else []
    reached = blocks[-1][1] if blocks else 0.0
    if run.returncode != 0 or abs(reached - 1.0) > 1e-6:
        raise RuntimeError(f"ccx stopped at {reached} of the load:\n{run.stdout[-2000:]}{run.stderr[-500:]}")
    last = {name: table for name, time, table in blocks if time == reached}
    displacement, force = (_scatter(last[name], len(mesh.points)) for name in ("displacements", "forces"))
    inverted = _volumes(replace(mesh, points=mesh.points + displacement)) * _volumes(mesh) <= 0.0
    if inverted.any():
        raise RuntimeError(f"ccx has turned {inverted.sum()} of {inverted.size} cells inside out: take more steps")
    return Solution(displacement, force)


def deck(
    mesh: Mesh,
    materials: Mapping[int, NeoHooke],
    dirichlet: Sequence[Fixed],
    forces: Mapping[int, Sequence[float]],
    *,
    steps: int,
) -> str:
    """The input file. Numbers have 14 digits: ccx reads fields of twenty characters."""
    lines = ["*NODE, NSET=ALL"]
    lines += [f"{i}, {x:.13e}, {y:.13e}, {z:.13e}" for i, (x, y, z) in enumerate(mesh.points, start=1)]
    cells = np.where(_volumes(mesh)[:, None] > 0.0, mesh.cells, mesh.cells[:, _MIRRORED]) + 1
    for tag in np.unique(mesh.tags):
        lines.append(f"*ELEMENT, TYPE=C3D10, ELSET=E{tag}")
        lines += [", ".join(map(str, (i + 1, *cells[i]))) for i in np.flatnonzero(mesh.tags == tag)]
        lines.append(f"*MATERIAL, NAME=M{tag}")
        lines.append("*HYPERELASTIC, NEO HOOKE")
        lines.append("{:.13e}, {:.13e}".format(*materials[int(tag)].coefficients()))
        lines.append(f"*SOLID SECTION, ELSET=E{tag}, MATERIAL=M{tag}")
    lines.append(f"*STEP, NLGEOM, INC={1000 + steps}")
    lines += ["*STATIC", f"{1.0 / steps:.13e}, 1.0, 1e-6, {1.0 / steps:.13e}"]
    # converge to rounding rather than to ccx's half a per cent
    lines += ["*CONTROLS, PARAMETERS=FIELD", "1e-9, 1e-9"]
    lines.append("*BOUNDARY")
    for fixed in dirichlet:
        values = np.broadcast_to(np.asarray(fixed.values, dtype=float), (len(fixed.nodes), 3))
        for node, value in zip(fixed.nodes, values, strict=True):
            lines += [f"{node + 1}, {k + 1}, {k + 1}, {v:.13e}" for k, v in enumerate(value) if not np.isnan(v)]
    if forces:
        lines.append("*CLOAD")
        lines += [f"{n + 1}, {k + 1}, {v:.13e}" for n, f in forces.items() for k, v in enumerate(f) if v != 0.0]
    lines += ["*NODE PRINT, NSET=ALL", "U, RF", "*END STEP", ""]
    return "\n".join(lines)


def _volumes(mesh: Mesh) -> np.ndarray:
    """Six times the signed volume of each cell's vertex tetrahedron."""
    corner = mesh.points[mesh.cells[:, :4]]
    return np.linalg.det(corner[:, 1:] - corner[:, :1])


def _blocks(text: str) -> list[tuple[str, float, np.ndarray]]:
    """The tables of a .dat file as (first word of the title, time, rows of node number and three components)."""
    parts = re.split(r"^ *(displacements|forces) .*time +(\S+)\s*$", text, flags=re.MULTILINE)
    return [
        (name, float(time), np.array(rows.split(), dtype=float).reshape(-1, 4))
        for name, time, rows in zip(parts[1::3], parts[2::3], parts[3::3], strict=True)
    ]


def _scatter(table: np.ndarray, count: int) -> np.ndarray:
    values = np.zeros((count, 3))
    values[table[:, 0].astype(int) - 1] = table[:, 1:]
    return values
