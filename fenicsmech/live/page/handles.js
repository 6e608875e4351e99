// What can be dragged in the mechanism: joints, control points and thicknesses of links at rest, and the push on it.


import { controlsAfter, outline } from "./preview.js";
import { drag, make } from "./svg.js";

const REST = 350; // ms after which a resting gesture is solved
const FARTHEST = 1.5; // times the largest force of the curve

export class Handles {
  constructor(view, store) {
    this.view = view; this.store = store; this.held = null; this.shown = "";
    view.handles = this;
    view.svg.addEventListener("keydown", (event) => this.pushByKey(event));
    view.svg.addEventListener("blur", () => { if (this.pushed && this.pushed.key) this.endPush(); });
    drag(view.svg, { begin: (event) => this.beginPush(event), move: (event) => this.push(event), end: () => this.endPush() });
  }

  draw(px) {
    const { layers } = this.view, { store } = this;
    if (store.mode !== "shape") { if (this.shown) { layers.handles.replaceChildren(); this.shown = ""; } return; }
    if (this.held) { this.follow(px); return; }
    const wanted = this.list(px), key = JSON.stringify([wanted.map((own) => [own.kind, own.at]), px]);
    if (key === this.shown) return;
    this.shown = key;
    const focused = layers.handles.contains(document.activeElement);
    if (focused) this.refocus = document.activeElement.getAttribute("aria-label");
    layers.handles.replaceChildren(...wanted.map((own) => this.handle(own, px)));
    if (focused) this.focusAgain();
  }

  // The handles of the drawn mechanism.
  list(px) {
    const { store } = this, found = [], places = new Map();
    store.project.joints.forEach((joint, k) => {
      const name = joint.at.join(" ");
      if (!places.has(name)) places.set(name, { kind: "joint", at: joint.at, joints: [], points: [], label: joint.name });
      places.get(name).joints.push(k);
    });
    for (const place of places.values()) {
      store.project.links.forEach((link, k) => (link.shape && link.shape.line || []).forEach((point, j) => {
        if (Math.hypot(point[0] - place.at[0], point[1] - place.at[1]) < 1e-6) place.points.push([k, j]);
      }));
      found.push(place);
    }
    const number = store.project.forces.findIndex((own) => own.name === store.project.curves[store.shown].force), force = store.project.forces[number];
    const along = force.direction.map((part) => part / Math.hypot(...force.direction)), out = 34 * px;
    found.push({ kind: "direction", at: force.at.map((part, a) => part + out * along[a]), number, origin: force.at, label: `direction of ${force.name}` },
      { kind: "force", at: force.at, number, label: `point of ${force.name}` });
    const shift = this.shift();
    for (const link of store.linear ? store.linear.links : []) link.entries.forEach((entries, k) => {
      const [P, M] = controlsAfter(link, shift)[k], length = Math.hypot(M[0], M[1]) || 1;
      if (entries[1][0] >= 0) found.push({ kind: "slope", at: [0, 1].map((a) => P[a] + M[a] / 3), origin: P.slice(0, 2), link, k, entries: entries[1], label: `slope ${k + 1} of ${link.name}` });
      if (entries[0][0] >= 0) found.push({ kind: "control", at: P.slice(0, 2), link, k, entries: entries[0], label: `control point ${k + 1} of ${link.name}` });
      if (entries[0][2] >= 0 && link.thickness) {
        const normal = [-M[1] / length, M[0] / length], half = 0.5 * link.thickness * P[2] + 12 * px;
        found.push({ kind: "thickness", at: [P[0] + half * normal[0], P[1] + half * normal[1]], normal, delta: P[2], link, k, entries: entries[0], label: `thickness ${k + 1} of ${link.name}` });
      }
    });
    return found;
  }

  // The project's design less that of the linear model: what was changed since, and is being solved.
  shift() {
    const { linear, project } = this.store, none = linear ? linear.lengths.map(() => 0) : [];
    if (!linear) return none;
    const offsets = project.design ? project.design.offsets : none, { handles } = linear.design;
    const same = offsets.length === none.length && (!project.design || JSON.stringify(project.design.handles) === JSON.stringify(handles));
    return same ? linear.design.offsets.map((own, k) => offsets[k] - own) : none;
  }

  handle(own, px) {
    const r = 6 * px, [x, y] = own.at;
    const mark = ["joint", "direction", "slope"].includes(own.kind) ? make("circle", { cx: x, cy: y, r: own.kind === "joint" ? r : 0.8 * r })
      : own.kind === "control" ? make("rect", { x: x - r, y: y - r, width: 2 * r, height: 2 * r })
        : own.kind === "force" ? make("path", { d: `M${x - r} ${y - r}L${x} ${y + r}L${x + r} ${y - r}Z` })
          : make("path", { d: `M${x - r} ${y}L${x} ${y + r}L${x + r} ${y}L${x} ${y - r}Z` });
    mark.classList.add("mark");
    const name = own.kind === "joint" ? `Joint: ${own.label}` : own.label[0].toUpperCase() + own.label.slice(1);
    const shape = make("g", { class: `handle ${own.kind}`, "stroke-width": 1.5 * px, tabindex: 0, role: "button", "aria-label": `${name}; arrow keys move it` },
      make("circle", { class: "reach", cx: x, cy: y, r: 2.2 * r }), mark, make("title", {}, name));
    if (own.origin) shape.prepend(make("line", { class: "stem", x1: own.origin[0], y1: own.origin[1], x2: x, y2: y, "stroke-width": 2 * px }));
    drag(shape, {
      begin: (event) => this.hold(own, shape, this.view.place(event), px),
      move: (event) => this.move(this.view.place(event)),
      end: (_event, cancelled) => this.release(cancelled),
    });
    shape.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
      if (!by || this.held) return;
      event.preventDefault(); event.stopPropagation();
      if (!this.hold(own, shape, own.at, px)) return;
      this.move([own.at[0] + 5 * px * by[0], own.at[1] + 5 * px * by[1]]);
      const label = shape.getAttribute("aria-label");
      this.release(false);
      this.refocus = label;
      this.focusAgain();
    });
    return shape;
  }

  // Begins a gesture. Its moves are counted from the linear model of its begin: one that is solved at a rest has moved.
  hold(own, shape, start, px) {
    const { linear } = this.store;
    if (own.link && !linear) return false;
    this.held = { own, shape, start, linear, shift: this.shift(), move: [0, 0], moved: false, sent: false, px };
    shape.classList.add("held");
    return true;
  }

  // Keys go on with the handle that they have moved, which may be drawn anew.
  focusAgain() {
    const found = [...this.view.layers.handles.children].find((own) => own.getAttribute("aria-label") === this.refocus);
    if (found) found.focus();
  }

  move(place) {
    const { held, store } = this;
    if (!held) return;
    held.move = [place[0] - held.start[0], place[1] - held.start[1]];
    held.moved = true;
    const { own } = held;
    if (own.kind === "thickness") {
      const along = held.move[0] * own.normal[0] + held.move[1] * own.normal[1];
      held.move = own.normal.map((part) => part * along);
    }
    if (own.link) store.previewed = this.step();
    if (!held.pending) {
      held.pending = true;
      requestAnimationFrame(() => { held.pending = false; if (this.held === held) { this.view.draw(); store.drawCurve(); } });
    }
    clearTimeout(held.rest);
    held.rest = setTimeout(() => { if (this.held === held) this.send(false); }, REST);
  }

  // Parameters' change by the gesture.
  step() {
    const { own, move, shift } = this.held, s = shift.slice();
    if (own.kind === "control") [0, 1].forEach((a) => { s[own.entries[a]] += move[a]; });
    else if (own.kind === "slope") [0, 1].forEach((a) => { s[own.entries[a]] += 3 * move[a]; });
    else {
      const along = move[0] * own.normal[0] + move[1] * own.normal[1];
      s[own.entries[2]] += Math.max(2 * along / own.link.thickness, 0.1 - own.delta);
    }
    return s;
  }

  follow(px) {
    const { own, shape, move, linear } = this.held;
    shape.setAttribute("transform", `translate(${move[0]} ${move[1]})`);
    if (own.kind !== "joint" || !this.held.moved) return;
    // the links that end here, dashed
    const { store } = this, to = own.at.map((part, a) => part + move[a]), lines = [];
    const bent = (linear ? linear.links : []).filter((link) => own.points.some(([k]) => store.project.links[k].name === link.name));
    for (const link of bent) {
      const ends = [0, link.controls.length - 1], far = (k) => Math.hypot(link.controls[k][0][0] - own.at[0], link.controls[k][0][1] - own.at[1]);
      const first = far(ends[0]) < far(ends[1]), count = link.controls.length - 1;
      const moved = link.controls.map(([P, M], k) => {
        const share = first ? 1 - k / count : k / count, slope = (first ? -1 : 1) / count;
        return [[P[0] + share * move[0], P[1] + share * move[1], P[2]], [M[0] + slope * move[0], M[1] + slope * move[1], M[2]]];
      });
      lines.push(`M${outline(moved, link.thickness).map((point) => point.join(" ")).join("L")}Z`);
    }
    for (const k of own.joints) for (const end of ["a", "b"]) {
      const name = store.project.joints[k][end];
      if (bent.some((link) => link.name === name)) continue;
      for (const joint of store.project.joints) {
        if ([joint.a, joint.b].includes(name) && !own.joints.includes(store.project.joints.indexOf(joint))) lines.push(`M${to.join(" ")}L${joint.at.join(" ")}`);
      }
    }
    this.view.layers.preview.replaceChildren(make("path", { class: "preview", d: lines.join("") }));
  }

  send(settled) {
    this.held.sent = true;
    const { held, store } = this, { own } = held, round = (value) => Number(value.toPrecision(7));
    if (own.kind === "joint") {
      const to = own.at.map((part, a) => Number((part + held.move[a]).toFixed(2)));
      const changes = own.joints.map((k) => ({ kind: "set", path: ["joints", k, "at"], value: to }));
      own.points.forEach(([link, j]) => changes.push({ kind: "set", path: ["links", link, "shape", "line", j], value: to }));
      store.edit(changes, { settled });
    } else if (own.kind === "force") {
      const to = own.at.map((part, a) => Number((part + held.move[a]).toFixed(2)));
      store.edit([{ kind: "set", path: ["forces", own.number, "at"], value: to }], { settled });
    } else if (own.kind === "direction") {
      const to = own.at.map((part, a) => part + held.move[a] - own.origin[a]), length = Math.hypot(...to);
      if (length) store.edit([{ kind: "set", path: ["forces", own.number, "direction"], value: to.map((part) => Number((part / length).toFixed(4))) }], { settled });
    } else {
      const s = this.step(), { design } = held.linear;
      const offsets = design.offsets.map((value, k) => round(value + s[k]));
      store.edit([{ kind: "set", path: ["design"], value: { ...design, offsets } }], { settled });
    }
  }

  release(cancelled) {
    const { held } = this;
    if (!held) return;
    clearTimeout(held.rest);
    held.shape.classList.remove("held");
    if (held.moved && !cancelled) this.send(true);
    if (held.sent && cancelled) this.store.send({ kind: "cancel" }); // it was solved where it rested
    this.held = null;
    this.shown = "";
    if (cancelled || held.linear !== this.store.linear) this.store.previewed = null;
    this.view.draw();
  }

  // -- push ---

  beginPush(event) {
    const { store, view } = this;
    if (store.mode === "shape" || !store.curve()) return false;
    this.pushed = { start: view.place(event), asked: null, force: 0 };
    store.pushing = true;
    return true;
  }

  push(event) {
    const { store, view } = this, curve = store.project.curves[store.shown];
    const force = store.project.forces.find((own) => own.name === curve.force), place = view.place(event);
    const length = Math.hypot(...force.direction), reach = 0.3 * view.svg.getBoundingClientRect().height / view.scale;
    const along = [0, 1].reduce((sum, a) => sum + (place[a] - this.pushed.start[a]) * force.direction[a] / length, 0);
    const size = Math.min(Math.max(along / reach, -FARTHEST), FARTHEST) * Math.abs(curve.largest);
    this.pushTo(size);
  }

  // Right and up push more, left and down less, Escape lets go.
  pushByKey(event) {
    const { store } = this, by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (event.target !== this.view.svg || store.mode !== "move" || !store.curve()) return;
    if (event.key === "Escape" && this.pushed) this.endPush();
    if (!by) return;
    event.preventDefault();
    const { largest } = store.project.curves[store.shown], top = Math.abs(largest);
    if (!this.pushed) { this.pushed = { asked: null, force: (this.view.now ? this.view.now.force : 0), key: true }; store.pushing = true; }
    this.pushTo(Math.min(Math.max(this.pushed.force + 0.05 * by * top, -FARTHEST * top), FARTHEST * top));
  }

  pushTo(size) {
    const { store } = this, { points } = store.curve();
    this.pushed.force = size;
    for (let k = 0; k + 1 < points.length; k++) {
      const [a, b] = [points[k].force, points[k + 1].force], t = (size - a) / (b - a);
      if (t >= 0 && t <= 1) {
        store.pushed = null;
        store.load = (k + t) / (points.length - 1);
        store.show();
        return;
      }
    }
    this.ask();
  }

  // Beyond the curve the solver is asked, for one force at a time.
  ask() {
    const { store } = this, size = Number(this.pushed.force.toPrecision(4));
    if (this.pushed.asked !== null || !size || size === this.pushed.last) return;
    this.pushed.asked = this.pushed.last = size;
    store.send({ kind: "push", curve: store.shown, force: size });
  }

  answered(point) {
    const { store } = this;
    if (!this.pushed) return;
    store.pushed = point;
    this.pushed.asked = null;
    store.show();
    this.ask();
  }

  // There is no equilibrium at the force that was asked for: another one may have some.
  failed() { if (this.pushed) this.pushed.asked = null; }

  endPush() {
    const { store } = this;
    if (!this.pushed) return;
    if (this.pushed.last !== undefined) store.send({ kind: "release" });
    this.pushed = null;
    store.pushing = false;
    store.pushed = null;
    store.show();
  }
}

