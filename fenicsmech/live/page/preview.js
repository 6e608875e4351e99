// The linear preview: Q(p + s) ≈ Q + e + J s near the last solved design, and the Gauss–Newton step s for moved targets
//
//   min over s   Σ ½ w (Q + e + J s − wanted)² / scale² + gᵀ s + ½ sᵀ H s + ½ μ |s / ℓ|²,   s within bounds of thickness.
//
// After the parameters, s has how far joints, motors and forces are moved, which are as drawn in that step. Q are
// displacements under forces, or forces where displacements are held.

import { dot, solve } from "./algebra.js";
import { placed, sampled } from "./targets.js";

const DAMPING = 1e-4;
const REACH = 2; // typical changes of parameters, up to which a step is drawn: steps for targets that contradict are damped more

// The step of no gesture.
export const nothing = (linear) => new Array(linear.lengths.length + linear.moves.length).fill(0);

// The entry of s of a joint or a force along an axis, of a direction, or of a motor; −1 if there is none.
export function entryOf(linear, wanted) {
  const key = JSON.stringify(wanted), k = linear.moves.findIndex((own) => JSON.stringify(own) === key);
  return k < 0 ? -1 : linear.lengths.length + k;
}

// Value and derivatives of a curve between those of its frames.
function row(curve, given, size) {
  const places = [0, ...curve.at], k = places.findIndex((own) => Math.abs(own) >= Math.abs(given) - 1e-12);
  const at = (j) => j === 0 ? { value: 0, slopes: new Array(size).fill(0) }
    : { value: curve.values[j - 1] + curve.errors[j - 1], slopes: curve.jacobian[j - 1] };
  const last = places.length - 1, high = k < 0 ? last : Math.max(k, 1), low = high - 1;
  const t = (given - places[low]) / (places[high] - places[low]), a = at(low), b = at(high);
  return { value: a.value + t * (b.value - a.value), slopes: a.slopes.map((slope, j) => slope + t * (b.slopes[j] - slope)) };
}

// Least and largest s of each parameter: control points keep their thickness within its bounds.
function bounds(linear, project) {
  const low = linear.lengths.map(() => -Infinity), high = linear.lengths.map(() => Infinity);
  for (const link of linear.links) {
    const own = project.links.find((other) => other.name === link.name);
    const range = own && own.design && own.design.thickness;
    if (!range || !link.thickness) continue;
    link.entries.forEach((point, k) => {
      const entry = point[0][2], delta = link.controls[k][0][2];
      if (entry < 0) return;
      low[entry] = Math.min(0, range[0] / link.thickness - delta);
      high[entry] = Math.max(0, range[1] / link.thickness - delta);
    });
  }
  return [low, high];
}

// The step for the targets of a project.
export function step(linear, project) {
  for (let damping = DAMPING; damping < 1e3; damping *= 10) {
    const s = damped(linear, project, damping);
    if (!s || linear.lengths.every((length, k) => Math.abs(s[k]) <= REACH * length)) return s;
  }
  return null;
}

function damped(linear, project, damping) {
  const n = linear.lengths.length, wants = project.targets.map((own) => [project.curves[own.curve], ...sampled(project.curves[own.curve], own)]);
  const A = linear.curvature.map((line, i) => line.map((value, j) => value + (i === j ? damping / linear.lengths[i] ** 2 : 0)));
  const b = linear.gradient.map((value) => -value);
  project.targets.forEach((target, k) => {
    const [{ held }, given, wanted] = wants[k], { value, slopes } = row(linear.curves[target.curve], given, n);
    const largest = Math.max(...wants.filter(([own]) => Boolean(own.held) === Boolean(held)).map((own) => Math.abs(own[2])), 1e-9);
    const weight = target.weight / (target.scale || Math.max(Math.abs(wanted), 0.1 * largest)) ** 2;
    for (let i = 0; i < n; i++) {
      b[i] += weight * slopes[i] * (wanted - value);
      for (let j = 0; j < n; j++) A[i][j] += weight * slopes[i] * slopes[j];
    }
  });
  const [low, high] = bounds(linear, project), held = new Map();
  for (let round = 0; round < 6; round++) {
    const free = [...Array(n).keys()].filter((k) => !held.has(k));
    const right = free.map((i) => b[i] - [...held].reduce((sum, [j, value]) => sum + A[i][j] * value, 0));
    const x = solve(free.map((i) => free.map((j) => A[i][j])), right);
    if (!x) return null;
    const beyond = free.filter((k, i) => x[i] < low[k] || x[i] > high[k]);
    if (!beyond.length || round === 5) {
      const s = nothing(linear);
      free.forEach((k, i) => { s[k] = Math.min(Math.max(x[i], low[k]), high[k]); });
      held.forEach((value, k) => { s[k] = value; });
      return s;
    }
    beyond.forEach((k) => held.set(k, x[free.indexOf(k)] < low[k] ? low[k] : high[k]));
  }
  return null;
}

// Frames of a curve after a step, from zero on, as [displacement, force].
export function curveAfter(linear, number, s, curve) {
  const own = linear.curves[number];
  return [[0, 0], ...own.at.map((given, k) => {
    const { displacement, force } = placed(curve, given, own.values[k] + own.errors[k] + dot(own.jacobian[k], s));
    return [displacement, force];
  })];
}

// Control points of a link after a step.
export function controlsAfter(link, s) {
  return link.controls.map((point, k) => point.map((part, m) => part.map((value, a) => {
    const entry = link.entries[k][m][a], follows = link.follows[k][m][a], moved = s.slice(s.length - follows.length);
    return value + (entry < 0 ? 0 : s[entry]) + dot(follows, moved);
  })));
}

// The centreline of a strip whose joints at some places are shifted: shifts between joints are linear in its length.
export function lineAfter(line, places, shifts) {
  const lengths = [0];
  for (let k = 1; k < line.length; k++) lengths.push(lengths[k - 1] + Math.hypot(line[k][0] - line[k - 1][0], line[k][1] - line[k - 1][1]));
  const sites = places.map((place, n) => [lengthAt(line, lengths, place), shifts[n]]).sort((a, b) => a[0] - b[0]);
  return line.map((point, k) => {
    const next = sites.findIndex(([length]) => length >= lengths[k] - 1e-9);
    if (next <= 0) { const shift = sites.at(next)[1]; return [point[0] + shift[0], point[1] + shift[1]]; } // before the first, after the last
    const [[from, a], [to, b]] = [sites[next - 1], sites[next]], t = (lengths[k] - from) / (to - from);
    return [0, 1].map((axis) => point[axis] + a[axis] + t * (b[axis] - a[axis]));
  });
}

// Corners of a polygon whose joints at some places are shifted: means of the shifts with weights that fall with the
// square of the distance, so that the surroundings of a joint go with it.
export function cornersAfter(corners, places, shifts) {
  return corners.map(([x, y]) => {
    const weights = places.map(([a, b]) => 1 / Math.max((a - x) ** 2 + (b - y) ** 2, 1e-12)), sum = weights.reduce((p, q) => p + q, 0);
    return [x, y].map((part, axis) => part + dot(weights, shifts.map((own) => own[axis])) / sum);
  });
}

// The length along a line up to the point that is nearest to a place.
function lengthAt(line, lengths, [x, y]) {
  let least = Infinity, found = 0;
  for (let k = 0; k + 1 < line.length; k++) {
    const [[ax, ay], [bx, by]] = [line[k], line[k + 1]], size = lengths[k + 1] - lengths[k];
    const t = Math.min(Math.max(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / size ** 2, 0), 1);
    const away = Math.hypot(ax + t * (bx - ax) - x, ay + t * (by - ay) - y);
    if (away < least) { least = away; found = lengths[k] + t * size; }
  }
  return found;
}

// What is drawn of a state after some amounts of its linear responses.
export function leaned({ state, rates, amounts }) {
  const moved = (points, own) => points.map((point, k) => [0, 1].map((a) => point[a] + rates.reduce((sum, rate, j) => sum + amounts[j] * own(rate)[k][a], 0)));
  return {
    nodes: state.nodes.map((points, link) => moved(points, (rate) => rate.nodes[link])),
    rigid: state.rigid.map((points, link) => moved(points, (rate) => rate.rigid[link])),
  };
}

// The outline of a link from its control points: centreline and half of its thickness to both sides.
export function outline(controls, thickness, pieces = 24) {
  const left = [], right = [];
  for (let k = 0; k + 1 < controls.length; k++) {
    const [P, M] = controls[k], [Q, N] = controls[k + 1];
    for (let i = k ? 1 : 0; i <= pieces; i++) {
      const t = i / pieces, h = [1 - 3 * t * t + 2 * t ** 3, t - 2 * t * t + t ** 3, 3 * t * t - 2 * t ** 3, t ** 3 - t * t];
      const g = [-6 * t + 6 * t * t, 1 - 4 * t + 3 * t * t, 6 * t - 6 * t * t, 3 * t * t - 2 * t];
      const at = [0, 1, 2].map((a) => h[0] * P[a] + h[1] * M[a] + h[2] * Q[a] + h[3] * N[a]);
      const along = [0, 1].map((a) => g[0] * P[a] + g[1] * M[a] + g[2] * Q[a] + g[3] * N[a]);
      const half = 0.5 * thickness * at[2] / (Math.hypot(...along) || 1);
      left.push([at[0] - half * along[1], at[1] + half * along[0]]);
      right.push([at[0] + half * along[1], at[1] - half * along[0]]);
    }
  }
  return [...left, ...right.reverse()];
}
