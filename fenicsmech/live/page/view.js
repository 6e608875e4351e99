// The mechanism in one state of its curve: links coloured by von Mises stress, rigid links, pins, and the force.

import { controlsAfter, leaned, outline } from "./preview.js";
import { make, path, set } from "./svg.js";

export const HEAT = ["#fff3d6", "#fee6b8", "#fdd28a", "#fab45f", "#f6983f", "#e9762f", "#d9542b", "#bd3833", "#a01c3b", "#7e143d", "#5c0b3e"];

export class View {
  constructor(svg, store) {
    this.svg = svg; this.store = store;
    this.world = make("g", {});
    this.layers = Object.fromEntries(["rigid", "links", "preview", "pins", "force", "handles"].map((name) => {
      const layer = make("g", { class: `layer-${name}` });
      this.world.append(layer);
      return [name, layer];
    }));
    this.note = make("text", { class: "preview-name", x: 6, y: 14 }, "– – linear preview");
    this.note.style.display = "none";
    this.waiting = make("text", { x: "50%", y: "50%", "text-anchor": "middle" }, "The mechanism appears with its first curve…");
    svg.append(this.world, this.note, this.waiting);
    new ResizeObserver(() => { this.fit(); this.draw(); }).observe(svg);
  }

  // Chooses scale and place so that all frames of all curves fit.
  fit() {
    const { store } = this, low = [Infinity, Infinity], high = [-Infinity, -Infinity];
    for (const own of Object.values(store.curves)) for (const point of own.points) for (const links of [point.nodes, point.rigid]) {
      for (const link of links) for (const place of link) for (let a = 0; a < 2; a++) {
        low[a] = Math.min(low[a], place[a]); high[a] = Math.max(high[a], place[a]);
      }
    }
    if (low[0] > high[0] || !store.mesh) return;
    const wide = 1.2 * store.mesh.width, box = this.svg.getBoundingClientRect();
    for (let a = 0; a < 2; a++) { low[a] -= wide; high[a] += wide; }
    this.reach = { low, high };
    if (!box.width) return; // the 3D view is shown
    const span = [Math.max(high[0] - low[0], 1e-6), Math.max(high[1] - low[1], 1e-6)];
    const scale = 0.86 * Math.min(box.width / span[0], box.height / span[1]) || 1;
    if (this.scale && !this.forced && Math.abs(scale / this.scale - 1) < 0.08 && this.box === `${box.width} ${box.height}`) return; // keeps still
    this.forced = false; this.box = `${box.width} ${box.height}`;
    this.scale = scale;
    this.origin = [box.width / 2 - scale * (low[0] + high[0]) / 2, box.height / 2 + scale * (low[1] + high[1]) / 2];
    set(this.world, { transform: `translate(${this.origin[0]} ${this.origin[1]}) scale(${scale} ${-scale})` });
  }

  // Middle and radius of what all frames of all curves reach.
  extent() {
    const { low, high } = this.reach;
    return { centre: [0, 1].map((a) => (low[a] + high[a]) / 2), radius: 0.5 * Math.hypot(high[0] - low[0], high[1] - low[1]) };
  }

  // A place on the screen in the mechanism's coordinates.
  place(event) {
    const box = this.svg.getBoundingClientRect();
    return [(event.clientX - box.left - this.origin[0]) / this.scale, -(event.clientY - box.top - this.origin[1]) / this.scale];
  }

  // The state between two frames at the load 0 … 1.
  state() {
    if (this.store.pushed) return this.store.pushed;
    const own = this.store.curve();
    if (!own || !own.points.length) return null;
    const load = this.store.mode === "shape" || this.store.drag || this.store.turning ? 0 : this.store.load; // at rest, as the preview is
    const points = own.points, at = load * (points.length - 1), k = Math.min(Math.floor(at), Math.max(points.length - 2, 0));
    const a = points[k], b = points[Math.min(k + 1, points.length - 1)], t = at - k;
    const mixed = (p, q) => p.map((own, i) => [own[0] + t * (q[i][0] - own[0]), own[1] + t * (q[i][1] - own[1])]);
    return {
      force: a.force + t * (b.force - a.force), displacement: a.displacement + t * (b.displacement - a.displacement),
      stress: a.stress + t * (b.stress - a.stress), stable: (t < 0.5 ? a : b).stable,
      nodes: a.nodes.map((link, i) => mixed(link, b.nodes[i])), rigid: a.rigid.map((link, i) => mixed(link, b.rigid[i])), pins: mixed(a.pins, b.pins),
      von_mises: a.von_mises.map((link, i) => link.map((v, j) => v + t * (b.von_mises[i][j] - v))),
    };
  }

  draw() {
    const { store } = this, mesh = store.drawnMesh();
    if (!mesh || !this.scale) return;
    const state = this.state();
    if (!state || state.nodes.length !== mesh.flexible.length || state.rigid.length !== mesh.rigid.length) return;
    this.now = state;
    this.waiting.remove();
    const px = 1 / this.scale;
    const rigid = [];
    state.rigid.forEach((points, k) => {
      const d = points.length ? path(points.length === 1 ? [points[0], points[0]] : order(points), points.length > 2) : "";
      const fixed = mesh.rigid[k].fixed;
      rigid.push([fixed, make("path", { class: "rigid-rim", d, "stroke-width": mesh.width + 2 * px }), make("path", { class: fixed ? "rigid fixed" : "rigid", d, "stroke-width": mesh.width })]);
    });
    rigid.sort((a, b) => a[0] - b[0]);
    this.layers.rigid.replaceChildren(...rigid.flatMap((own) => own.slice(1)));
    const top = store.stressTop || 1, links = [];
    mesh.flexible.forEach((link, k) => {
      const bins = HEAT.map(() => []), nodes = state.nodes[k], stress = state.von_mises[k];
      link.triangles.forEach(([a, b, c]) => {
        const bin = Math.min(HEAT.length - 1, Math.floor((stress[a] + stress[b] + stress[c]) / 3 / top * HEAT.length));
        bins[Math.max(bin, 0)].push(path([nodes[a], nodes[b], nodes[c]], true));
      });
      bins.forEach((parts, bin) => {
        if (parts.length) links.push(make("path", { d: parts.join(""), fill: HEAT[bin], stroke: HEAT[bin], "stroke-width": 0.6 * px }));
      });
      links.push(make("path", { class: "link-rim", d: link.loops.map((loop) => path(loop.map((own) => nodes[own]), true)).join(""), "stroke-width": 1.6 * px }));
    });
    this.layers.links.replaceChildren(...links);
    const r = 0.32 * mesh.width;
    this.layers.pins.replaceChildren(...state.pins.map(([x, y], k) => mesh.welded[k]
      ? make("rect", { class: "pin", x: x - r, y: y - r, width: 2 * r, height: 2 * r, "stroke-width": 1.3 * px })
      : make("circle", { class: "pin", cx: x, cy: y, r, "stroke-width": 1.3 * px })));
    this.force(state, px);
    this.preview();
    if (this.handles) this.handles.draw(px);
  }

  // The arrow of the force at its point: the last of the points that its link holds.
  force(state, px) {
    const { store } = this, curve = store.project.curves[store.shown], force = store.project.forces.find((own) => own.name === curve.force);
    const mesh = store.drawnMesh(), link = mesh.rigid.findIndex((own) => own.name === force.on), parts = [];
    this.tip = null;
    if (link >= 0) {
      const held = store.project.joints.filter((own) => [own.a, own.b].includes(force.on)).length;
      const before = store.project.forces.filter((own) => own.on === force.on).findIndex((own) => own.name === force.name);
      this.tip = state.rigid[link][held + before] || null;
    } else {
      const own = mesh.flexible.findIndex((other) => other.name === force.on), rest = store.curve() && store.curve().points[0].nodes[own];
      if (rest && rest.length === state.nodes[own].length) this.tip = state.nodes[own][nearest(rest, force.at)];
    }
    const largest = Math.abs(curve.largest), size = 70 * px * Math.min(Math.abs(state.force) / largest, 1.6);
    if (this.tip && size > 6 * px) {
      const length = Math.hypot(...force.direction), sign = Math.sign(state.force), [x, y] = this.tip;
      const [a, b] = force.direction.map((own) => own / length * sign), tail = [x - a * size, y - b * size], head = 9 * px;
      parts.push(make("path", { class: "arrow", d: path([tail, [x - a * head, y - b * head]]), "stroke-width": 3 * px }),
        make("path", { class: "arrow-head", d: path([[x, y], [x - a * 1.4 * head - b * 0.6 * head, y - b * 1.4 * head + a * 0.6 * head], [x - a * 1.4 * head + b * 0.6 * head, y - b * 1.4 * head - a * 0.6 * head]], true) }));
    }
    this.layers.force.replaceChildren(...parts);
  }

  // Dashed: the links at rest after the previewed step, and the mechanism as it leans from a state.
  preview() {
    const { store } = this, s = store.previewed, base = store.base(), lean = store.lean(), parts = [], mesh = store.drawnMesh();
    if (s && base && !lean) for (const link of base.links) {
      const after = controlsAfter(link, s);
      if (!link.thickness || String(after) === String(link.controls)) continue; // a force that moves shapes no link
      parts.push(make("path", { class: "preview", d: path(outline(after, link.thickness), true) }));
    }
    if (lean && lean.state.nodes.length === mesh.flexible.length) {
      const { nodes, rigid } = leaned(lean), rims = mesh.flexible.flatMap((link, k) => link.loops.map((loop) => path(loop.map((own) => nodes[k][own]), true)));
      const bars = rigid.map((points, k) => mesh.rigid[k].fixed || points.length < 2 ? "" : path(order(points), points.length > 2));
      parts.push(make("path", { class: "preview", d: [...rims, ...bars].join("") }), ...this.pull({ nodes, rigid }));
    }
    this.layers.preview.replaceChildren(...parts);
    this.note.style.display = parts.length ? "" : "none";
  }

  // The link at a place of the present state, and its point that is there: a node, or shares along and across a rigid link.
  grip(place) {
    const { now } = this, mesh = this.store.drawnMesh(), near = 8 / this.scale, away = (points, k) => Math.hypot(points[k][0] - place[0], points[k][1] - place[1]);
    for (let k = 0; k < mesh.flexible.length; k++) {
      const points = now.nodes[k], node = nearest(points, place), { name, triangles } = mesh.flexible[k];
      if (away(points, node) < near || triangles.some((own) => within(own.map((n) => points[n]), place))) return { at: { link: name, place: rounded(points[node]) }, flexible: k, node };
    }
    for (let k = 0; k < mesh.rigid.length; k++) {
      const points = now.rigid[k].length > 2 ? order(now.rigid[k]) : now.rigid[k], { name, fixed } = mesh.rigid[k];
      const on = points.some((point, j) => distance(place, point, points[(j + 1) % points.length]) < 0.5 * mesh.width + near);
      if (!fixed && points.length && on) return { at: { link: name, place: rounded(place) }, rigid: k, shares: shares(now.rigid[k], place) };
    }
    return null;
  }

  // The force of the pointer at the point that it holds, in a leaned state.
  pull({ nodes, rigid }) {
    const { pushed } = this.handles;
    if (!pushed || !pushed.held) return [];
    const { held, by } = pushed, [x, y] = held.node === undefined ? shared(rigid[held.rigid], held.shares) : nodes[held.flexible][held.node];
    const largest = Math.abs(this.store.project.curves[this.store.shown].largest), size = 70 / this.scale / largest;
    const long = size * Math.hypot(...by), head = Math.min(9 / this.scale, 0.6 * long), [a, b] = by.map((part) => part * size / (long || 1)), [tipX, tipY] = [x + long * a, y + long * b];
    const wings = [1, -1].map((side) => [tipX - head * (1.4 * a + 0.6 * side * b), tipY - head * (1.4 * b - 0.6 * side * a)]);
    return [make("path", { class: "pull", d: path([[x, y], [tipX - head * a, tipY - head * b]]), "stroke-width": 3 / this.scale }),
      make("path", { class: "pull-point", d: path([[tipX, tipY], ...wings], true) }), make("circle", { class: "pull-point", cx: x, cy: y, r: 5 / this.scale })];
  }
}

const rounded = (place) => place.map((part) => Number(part.toPrecision(6)));

// Whether a place is in a triangle.
function within([a, b, c], p) {
  const side = (s, t) => (t[0] - s[0]) * (p[1] - s[1]) - (t[1] - s[1]) * (p[0] - s[0]), sides = [side(a, b), side(b, c), side(c, a)];
  return sides.every((own) => own >= 0) || sides.every((own) => own <= 0);
}

// Of a place from a segment.
function distance([x, y], [ax, ay], [bx, by]) {
  const square = (bx - ax) ** 2 + (by - ay) ** 2, t = square ? Math.min(Math.max(((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / square, 0), 1) : 0;
  return Math.hypot(ax + t * (bx - ax) - x, ay + t * (by - ay) - y);
}

// Shares of a place along and across the line from the first of some points to the farthest from it, and back.
function shares(points, [x, y]) {
  const [a] = points, far = points.reduce((best, own) => Math.hypot(own[0] - a[0], own[1] - a[1]) > Math.hypot(best[0] - a[0], best[1] - a[1]) ? own : best, a);
  const [dx, dy] = [far[0] - a[0], far[1] - a[1]], square = dx * dx + dy * dy || 1, [px, py] = [x - a[0], y - a[1]];
  return { far: points.indexOf(far), along: (px * dx + py * dy) / square, across: (py * dx - px * dy) / square };
}
function shared(points, { far, along, across }) {
  const [a, b] = [points[0], points[far]], [dx, dy] = [b[0] - a[0], b[1] - a[1]];
  return [a[0] + along * dx - across * dy, a[1] + along * dy + across * dx];
}

// The number of the point that is nearest to a place.
function nearest(points, [x, y]) {
  let best = 0;
  points.forEach((own, k) => { if (Math.hypot(own[0] - x, own[1] - y) < Math.hypot(points[best][0] - x, points[best][1] - y)) best = k; });
  return best;
}

// Points of a rigid link in the order of their convex hull.
export function order(points) {
  const sorted = points.slice().sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (list) => {
    const found = [];
    for (const p of list) {
      while (found.length > 1) {
        const [a, b] = found.slice(-2);
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 1e-9) break;
        found.pop();
      }
      found.push(p);
    }
    return found.slice(0, -1);
  };
  const hull = [...half(sorted), ...half(sorted.slice().reverse())];
  return hull.length ? hull : sorted;
}
