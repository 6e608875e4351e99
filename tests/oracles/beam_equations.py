"""The equations of the planar geometrically exact beam (Reissner 1972, Simo 1985) and their collocation.

Reference centreline r₀(s) with tangent angle φ₀(s); deformed centreline r₀ + (u, v), section angle φ = φ₀ + ψ.
With the force (H, V), constant along the beam because nothing acts between its ends, and the moment M:

    N = H cos φ + V sin φ,  Q = −H sin φ + V cos φ,   ε = N / EA,  γ = Q / kGA
    u' = (1 + ε) cos φ − γ sin φ − cos φ₀,            v' = (1 + ε) sin φ + γ cos φ − sin φ₀
    ψ' = M / EI,                                      M' = γ N − (1 + ε) Q

Gauss collocation with five stages (order ten) and the exact Jacobian. The unknowns are scaled by the length and EI,
so units do not matter. Thin beams only: no curvature correction of the section stiffness.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from .beam_description import FREE, Beam, BeamSolution, End, EndState

STAGES = 5


def _gauss() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes c, Runge–Kutta matrix A and weights b of Gauss collocation on [0, 1]."""
    nodes, weights = np.polynomial.legendre.leggauss(STAGES)
    nodes = 0.5 * (nodes + 1.0)
    powers = np.arange(STAGES)
    integrals = nodes[:, None] ** (powers + 1) / (powers + 1)
    return nodes, integrals @ np.linalg.inv(nodes[:, None] ** powers), 0.5 * weights


class Collocation:
    """The discrete equations in x = [node states (n, 4), stage states (n − 1, c, 4), force (2,)], all dimensionless."""

    def __init__(self, beam: Beam, elements: int) -> None:
        line = beam.centreline
        self.beam, self.length = beam, line.length
        self.force_scale = beam.section.bending / line.length**2
        self.flexibility = np.array([self.force_scale / beam.section.axial, self.force_scale / beam.section.shear])
        self.nodes = self._grid(elements)
        self.widths = np.diff(self.nodes)
        self.c, self.a, self.b = _gauss()
        self.stages = self.nodes[:-1, None] + self.widths[:, None] * self.c
        self.angles = line.angle(self.stages.ravel() * line.length).reshape(self.stages.shape)
        count = len(self.widths)
        self.node_dofs = np.arange(4 * (count + 1)).reshape(count + 1, 4)
        self.stage_dofs = self.node_dofs.size + np.arange(4 * STAGES * count).reshape(count, STAGES, 4)
        self.force_dofs = self.node_dofs.size + self.stage_dofs.size + np.arange(2)
        self.size = int(self.force_dofs[-1]) + 1
        ends = line.position(np.array([0.0, line.length]))
        self.arms = [(e - p) / line.length for e, p in zip(ends, beam.pins(), strict=True)]
        tangents = np.stack([np.cos(self.angles), np.sin(self.angles)], axis=-1)
        chord = np.einsum("n,i,nix->x", self.widths, self.b, tangents) * line.length
        if not np.allclose(chord, ends[1] - ends[0], rtol=0.0, atol=1e-8 * line.length):
            raise ValueError(f"the centreline's angle integrates to {chord}, its ends are {ends[1] - ends[0]} apart")

    def _grid(self, elements: int) -> np.ndarray:
        """Uniform nodes on [0, 1] plus the centreline's breaks; a uniform node next to a break gives way to it."""
        uniform = np.linspace(0.0, 1.0, elements + 1)
        breaks = np.asarray(self.beam.centreline.breaks) / self.length
        if breaks.size:
            distance = np.abs(uniform[:, None] - breaks).min(axis=1)
            distance[[0, -1]] = 1.0
            uniform = uniform[distance > 0.25 / elements]
        return np.union1d(uniform, breaks)

    def rates(self, stage: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """y' (n, c, 4) of y = (u, v, ψ, M) at the stages, ∂y'/∂y (n, c, 4, 4) and ∂y'/∂force (n, c, 4, 2)."""
        a, g = self.flexibility
        turn = stage[..., 2]
        phi = self.angles + turn
        cos, sin = np.cos(phi), np.sin(phi)
        normal = force[0] * cos + force[1] * sin
        shear = force[1] * cos - force[0] * sin
        stretch, slide = 1.0 + a * normal, g * shear
        # cos φ − cos φ₀ and sin φ − sin φ₀ as products, which keep their digits when the beam barely turns
        chord = 2.0 * np.sin(0.5 * turn)
        middle = self.angles + 0.5 * turn
        zero = np.zeros_like(turn)
        rate = np.stack(
            [
                -chord * np.sin(middle) + a * normal * cos - slide * sin,
                chord * np.cos(middle) + a * normal * sin + slide * cos,
                stage[..., 3],
                slide * normal - stretch * shear,
            ],
            axis=-1,
        )
        by_turn = np.stack(
            [
                -stretch * sin - slide * cos + (a * shear * cos + g * normal * sin),
                stretch * cos - slide * sin + (a * shear * sin - g * normal * cos),
                zero,
                (1.0 + (a - g) * normal) * normal + (g - a) * shear * shear,
            ],
            axis=-1,
        )
        by_state = np.zeros((*turn.shape, 4, 4))
        by_state[..., 2] = by_turn
        by_state[..., 2, 3] = 1.0
        by_force = np.stack(
            [
                np.stack([a * cos * cos + g * sin * sin, (a - g) * cos * sin], axis=-1),
                np.stack([(a - g) * cos * sin, a * sin * sin + g * cos * cos], axis=-1),
                np.stack([zero, zero], axis=-1),
                np.stack(
                    [
                        -g * sin * normal + slide * cos - a * cos * shear + stretch * sin,
                        g * cos * normal + slide * sin - a * sin * shear - stretch * cos,
                    ],
                    axis=-1,
                ),
            ],
            axis=-2,
        )
        return rate, by_state, by_force

    def boundary(self, x: np.ndarray, start: End, end: End) -> tuple[np.ndarray, np.ndarray]:
        """The six prescribed quantities (displacement or load at the pins) and their Jacobian (6, size).

        With the arm a from the pin to the beam's end and R = R(ψ): the pin moves by (u, v) − (R − 1) a, and the wrench
        ±((H, V), M) at the beam's end becomes the moment ±(M + R a × (H, V)) about the pin.
        """
        values, jacobian = np.zeros(6), np.zeros((6, self.size))
        force = x[self.force_dofs]
        for k, (node, sign, condition) in enumerate(((0, -1.0, start), (-1, 1.0, end))):
            dofs = self.node_dofs[node]
            turn, moment = x[dofs[2:]]
            arm, turned = self.arms[k], _rotation(turn) @ self.arms[k]
            spin = np.array([-turned[1], turned[0]])
            shift = np.array([-2.0 * np.sin(0.5 * turn) ** 2, np.sin(turn)])
            displacement = x[dofs[:2]] - (shift[0] * arm + shift[1] * np.array([-arm[1], arm[0]]))
            axes = _rotation(condition.axes).T
            for i, prescribed in enumerate((condition.x, condition.y)):
                row = 3 * k + i
                if prescribed is None:
                    values[row] = sign * axes[i] @ force
                    jacobian[row, self.force_dofs] = sign * axes[i]
                else:
                    values[row] = axes[i] @ displacement
                    jacobian[row, dofs[:2]] = axes[i]
                    jacobian[row, dofs[2]] = -axes[i] @ spin
            row = 3 * k + 2
            if condition.rotation is None:
                values[row] = sign * (moment + turned[0] * force[1] - turned[1] * force[0])
                jacobian[row, dofs[3]] = sign
                jacobian[row, dofs[2]] = sign * (spin[0] * force[1] - spin[1] * force[0])
                jacobian[row, self.force_dofs] = sign * np.array([-turned[1], turned[0]])
            else:
                values[row] = turn
                jacobian[row, dofs[2]] = 1.0
        return values, jacobian

    def targets(self, start: End, end: End) -> np.ndarray:
        """The values that ``boundary`` has to take, dimensionless."""
        moment_scale = self.force_scale * self.length
        wanted = []
        for condition in (start, end):
            for prescribed, load in ((condition.x, condition.force_x), (condition.y, condition.force_y)):
                wanted.append(load / self.force_scale if prescribed is None else prescribed / self.length)
            wanted.append(condition.moment / moment_scale if condition.rotation is None else condition.rotation)
        return np.array(wanted)

    def newton(self, x: np.ndarray, start: End, end: End, wanted: np.ndarray) -> np.ndarray | None:
        """The solution near ``x``, or None when the iteration does not settle within twelve corrections."""
        for _ in range(12):
            residual, jacobian = self._system(x, start, end, wanted)
            try:
                correction = splu(jacobian).solve(-residual)
            except RuntimeError:  # exactly singular
                return None
            turns = np.abs(correction[self.node_dofs[:, 2]]).max()
            if not np.isfinite(turns) or turns > 1.0:  # a leap to some other branch
                return None
            x = x + correction
            if np.all(np.abs(correction) <= 1e-11 * (1.0 + np.abs(x))):
                return x
        return None

    def _system(self, x: np.ndarray, start: End, end: End, wanted: np.ndarray) -> tuple[np.ndarray, sp.csc_matrix]:
        """Collocation: Y_i = y_n + h Σ_j a_ij f(Y_j), y_{n+1} = y_n + h Σ_j b_j f(Y_j), and the end conditions."""
        count = len(self.widths)
        node, stage, force = x[self.node_dofs], x[self.stage_dofs], x[self.force_dofs]
        rate, by_state, by_force = self.rates(stage, force)
        weights = np.vstack([self.a, self.b])  # the last row advances to the next node
        steps = self.widths[:, None, None] * weights  # (n, c + 1, c)
        new = np.concatenate([stage, node[1:, None]], axis=1)
        new_dofs = np.concatenate([self.stage_dofs, self.node_dofs[1:, None]], axis=1)
        old_dofs = np.broadcast_to(self.node_dofs[:-1, None], new_dofs.shape)
        equations = np.arange(new_dofs.size).reshape(new_dofs.shape)
        residual = new - node[:-1, None] - np.einsum("nij,njx->nix", steps, rate)
        values, end_jacobian = self.boundary(x, start, end)

        stage_block = -np.einsum("nij,njxy->nijxy", steps, by_state)
        rows = np.broadcast_to(equations[:, :, None, :, None], stage_block.shape)
        columns = np.broadcast_to(self.stage_dofs[:, None, :, None, :], stage_block.shape)
        force_block = -np.einsum("nij,njxk->nixk", steps, by_force)
        force_rows = np.broadcast_to(equations[..., None], force_block.shape)
        force_columns = np.broadcast_to(self.force_dofs, force_block.shape)
        ones = np.ones(equations.size)
        entries = np.concatenate([ones, -ones, stage_block.ravel(), force_block.ravel()])
        where = (
            np.concatenate([equations.ravel(), equations.ravel(), rows.ravel(), force_rows.ravel()]),
            np.concatenate([new_dofs.ravel(), old_dofs.ravel(), columns.ravel(), force_columns.ravel()]),
        )
        body = sp.coo_matrix((entries, where), shape=(4 * count * (STAGES + 1), self.size))
        jacobian = sp.vstack([body, sp.csr_matrix(end_jacobian)]).tocsc()
        return np.concatenate([residual.ravel(), values - wanted]), jacobian

    def solution(self, x: np.ndarray) -> BeamSolution:
        """Back to dimensional quantities."""
        held = replace(FREE, x=0.0, y=0.0, rotation=0.0)
        displacement = self.boundary(x, held, held)[0].reshape(2, 3)
        load = self.boundary(x, FREE, FREE)[0].reshape(2, 3)
        moment_scale = self.force_scale * self.length
        start, end = (
            EndState(d[:2] * self.length, float(d[2]), f[:2] * self.force_scale, float(f[2]) * moment_scale)
            for d, f in zip(displacement, load, strict=True)
        )
        node, stage = x[self.node_dofs], x[self.stage_dofs]
        phi = self.angles + stage[..., 2]
        horizontal, vertical = x[self.force_dofs]
        normal = horizontal * np.cos(phi) + vertical * np.sin(phi)
        shear = vertical * np.cos(phi) - horizontal * np.sin(phi)
        a, g = self.flexibility
        # ∫ ½ (M²/EI + N²/EA + Q²/kGA) ds
        density = 0.5 * (stage[..., 3] ** 2 + a * normal**2 + g * shear**2)
        s = self.nodes * self.length
        return BeamSolution(
            start=start,
            end=end,
            s=s,
            position=self.beam.centreline.position(s) + node[:, :2] * self.length,
            rotation=node[:, 2].copy(),
            moment=node[:, 3] * moment_scale,
            energy=float(np.einsum("n,i,ni->", self.widths, self.b, density) * moment_scale),
            state=x.copy(),
        )


def _rotation(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
