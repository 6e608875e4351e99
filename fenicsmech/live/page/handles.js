// What can be dragged in the mechanism: joints, control points and thicknesses of links at rest, and the push on it.

import { controlsAfter, cornersAfter, entryOf, lineAfter, nothing } from "./preview.js";
import { drag, make, path, set } from "./svg.js";
import { order } from "./view.js";

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
    if (this.held) { this.follow(); return; }
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
      if (!places.has(name)) places.set(name, { kind: "joint", at: joint.at, joints: [], label: joint.name });
      places.get(name).joints.push(k);
    });
    found.push(...places.values());
    const number = store.project.forces.findIndex((own) => own.name === store.project.curves[store.shown].force), force = store.project.forces[number];
    const along = force.direction.map((part) => part / Math.hypot(...force.direction)), out = 34 * px;
    found.push({ kind: "direction", at: force.at.map((part, a) => part + out * along[a]), number, origin: force.at, name: force.name, label: `direction of ${force.name}` },
      { kind: "force", at: force.at, number, name: force.name, label: `point of ${force.name}` });
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
    const { linear, project } = this.store, s = linear ? nothing(linear) : [];
    if (!linear) return s;
    const { offsets, handles } = linear.design, now = project.design ? project.design.offsets : offsets.map(() => 0);
    const same = now.length === offsets.length && (!project.design || JSON.stringify(project.design.handles) === JSON.stringify(handles));
    if (same) offsets.forEach((own, k) => { s[k] = now[k] - own; });
    return s;
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

  // Begins a gesture. Its moves are counted from the drawing and the linear model of its begin: what is solved at a rest has
  // moved.
  hold(own, shape, start, px) {
    const { linear, project } = this.store;
    if (own.link && !linear) return false;
    const drawn = structuredClone({ joints: project.joints, links: project.links });
    this.held = { own, shape, start, linear, drawn, shift: this.shift(), move: [0, 0], moved: false, sent: false, px };
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
    if (own.link || this.moves().length) store.previewed = this.step();
    if (!held.pending) {
      held.pending = true;
      requestAnimationFrame(() => { held.pending = false; if (this.held === held) { this.view.draw(); store.drawCurve(); } });
    }
    clearTimeout(held.rest);
    held.rest = setTimeout(() => { if (this.held === held) this.send(false); }, REST);
  }

  // Entries of s of the joint, the force or the direction that is held; none if there is no linear preview of it.
  moves() {
    const { own: { kind, joints, name }, linear } = this.held;
    const named = kind === "joint" ? [0, 1].map((axis) => ({ kind, joints, axis }))
      : kind === "force" ? [0, 1].map((axis) => ({ kind, name, axis })) : kind === "direction" ? [{ kind, name }] : [];
    return linear ? named.map((own) => entryOf(linear, own)).filter((entry) => entry >= 0) : [];
  }

  // The change by the gesture of parameters, joints and forces.
  step() {
    const { own, move, shift } = this.held, s = shift.slice();
    if (own.kind === "joint" || own.kind === "force") this.moves().forEach((entry, a) => { s[entry] += move[a]; });
    else if (own.kind === "direction") this.moves().forEach((entry) => { s[entry] += this.turn(); });
    else if (own.kind === "control") [0, 1].forEach((a) => { s[own.entries[a]] += move[a]; });
    else if (own.kind === "slope") [0, 1].forEach((a) => { s[own.entries[a]] += 3 * move[a]; });
    else {
      const along = move[0] * own.normal[0] + move[1] * own.normal[1];
      s[own.entries[2]] += Math.max(2 * along / own.link.thickness, 0.1 - own.delta);
    }
    return s;
  }

  // The angle by which the direction that is held is turned.
  turn() {
    const { own: { at, origin }, move } = this.held, [a, b] = [0, 1].map((k) => at[k] - origin[k]), [x, y] = [a + move[0], b + move[1]];
    return Math.atan2(a * y - b * x, a * x + b * y);
  }

  follow() {
    const { own, shape, move, linear } = this.held, to = `translate(${move[0]} ${move[1]})`;
    shape.setAttribute("transform", to);
    if (own.kind === "direction") set(shape.querySelector(".stem"), { x1: own.origin[0] - move[0], y1: own.origin[1] - move[1] }); // in the shape's own frame
    if (own.kind === "force") this.view.layers.handles.querySelector(".direction").setAttribute("transform", to);
    if (own.kind !== "joint" || !this.held.moved) return;
    // outlines of rigid links that meet here, dashed; flexible ones too where the preview does not have them
    const previewed = this.moves().length ? linear.links.filter((link) => link.thickness).map((link) => link.name) : [], { links } = this.held.drawn;
    const flexible = this.shapes().filter(({ link }) => !previewed.includes(links[link].name)).map(({ key, points }) => path(points, key === "corners"));
    const d = [...flexible, ...this.rigid()].join("");
    if (d) this.view.layers.preview.append(make("path", { class: "preview", d }));
  }

  // The outlines of the rigid links that meet at the joints that are held.
  rigid() {
    const { own, move, drawn: { joints, links } } = this.held, { forces, outputs } = this.store.project;
    const meet = new Set(own.joints.flatMap((k) => [joints[k].a, joints[k].b])), found = [];
    for (const { name, kind } of links) {
      if (kind !== "rigid" || !meet.has(name)) continue;
      const held = joints.flatMap((joint, k) => [joint.a, joint.b].includes(name) ? [own.joints.includes(k) ? joint.at.map((part, a) => part + move[a]) : joint.at] : []);
      const points = order([...held, ...[...forces, ...outputs || []].filter((load) => load.on === name).map((load) => load.at)]);
      if (points.length > 1) found.push(path(points, points.length > 2));
    }
    return found;
  }

  // Strips and polygons that follow the joints that are held, by the key of their points.
  shapes() {
    const { own, move, drawn: { joints, links } } = this.held, found = [];
    links.forEach((link, k) => {
      const key = link.shape && ["line", "corners"].find((name) => name in link.shape);
      const mine = joints.map((joint, j) => [joint, j]).filter(([joint]) => [joint.a, joint.b].includes(link.name));
      if (!key || !mine.some(([, j]) => own.joints.includes(j))) return;
      const shifts = mine.map(([, j]) => own.joints.includes(j) ? move : [0, 0]), after = key === "line" ? lineAfter : cornersAfter;
      found.push({ link: k, key, points: after(link.shape[key], mine.map(([joint]) => joint.at), shifts) });
    });
    return found;
  }

  send(settled) {
    this.held.sent = true;
    const { held, store } = this, { own } = held, round = (value) => Number(value.toPrecision(7));
    if (own.kind === "joint") {
      const to = own.at.map((part, a) => Number((part + held.move[a]).toFixed(2)));
      const changes = own.joints.map((k) => ({ kind: "set", path: ["joints", k, "at"], value: to }));
      held.move = to.map((part, a) => part - own.at[a]); // as rounded
      for (const { link, key, points } of this.shapes()) {
        changes.push({ kind: "set", path: ["links", link, "shape", key], value: points.map((point) => point.map((part) => Number(part.toFixed(6)))) });
      }
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

  // On a link the pointer holds a point of it; elsewhere it pushes with the force of the curve.
  beginPush(event) {
    const { store, view } = this;
    if (store.mode === "shape" || !store.curve() || !view.now) return false;
    const start = view.place(event), held = view.grip(start);
    this.pushed = { start, held, force: held ? Number(view.now.force.toPrecision(6)) : 0, by: [0, 0], asked: null };
    store.pushing = true;
    if (held) this.ask(); // for the responses there
    return true;
  }

  push(event) {
    const { store, view, pushed } = this, curve = store.project.curves[store.shown], place = view.place(event);
    const reach = 0.3 * view.svg.getBoundingClientRect().height / view.scale, move = place.map((part, a) => part - pushed.start[a]);
    if (pushed.held) {
      const size = Math.hypot(...move) / reach, scale = Math.abs(curve.largest) * Math.min(1, FARTHEST / size) / reach;
      pushed.by = move.map((part) => part * scale || 0);
      this.lean();
      this.ask();
      return;
    }
    const force = store.project.forces.find((own) => own.name === curve.force), length = Math.hypot(...force.direction);
    const along = [0, 1].reduce((sum, a) => sum + move[a] * force.direction[a] / length, 0);
    this.pushTo(Math.min(Math.max(along / reach, -FARTHEST), FARTHEST) * Math.abs(curve.largest));
  }

  // Right and up push more, left and down less, Escape lets go.
  pushByKey(event) {
    const { store } = this, by = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    if (event.target !== this.view.svg || store.mode !== "move" || !store.curve()) return;
    if (event.key === "Escape" && this.pushed) this.endPush();
    if (!by || this.pushed && this.pushed.held) return;
    event.preventDefault();
    const { largest } = store.project.curves[store.shown], top = Math.abs(largest);
    if (!this.pushed) { this.pushed = { held: null, by: [0, 0], asked: null, force: (this.view.now ? this.view.now.force : 0), key: true }; store.pushing = true; }
    this.pushTo(Math.min(Math.max(this.pushed.force + 0.05 * by * top, -FARTHEST * top), FARTHEST * top));
  }

  pushTo(size) {
    const { store, pushed } = this, { points } = store.curve(), last = points.at(-1);
    pushed.force = size;
    for (let k = 0; k + 1 < points.length; k++) {
      const [a, b] = [points[k].force, points[k + 1].force], t = (size - a) / (b - a);
      if (t >= 0 && t <= 1) {
        store.pushed = store.leaning = null;
        store.load = (k + t) / (points.length - 1);
        store.show();
        return;
      }
    }
    const own = store.responses[store.shown], end = own && own.end;
    if (!pushed.from && end && size * last.force > 0) { pushed.from = { state: last, rates: [end] }; store.pushed = last; }
    this.lean();
    this.ask();
  }

  // The state under the present push by the responses of the one that was solved last, dashed.
  lean() {
    const { store, pushed } = this, { from } = pushed;
    if (from && from.rates.length) {
      const amounts = pushed.held ? pushed.by.map((part, a) => part - from.by[a]) : [pushed.force - from.state.force];
      store.leaning = { state: from.state, rates: from.rates, amounts };
    }
    if (pushed.pending) return;
    pushed.pending = true;
    requestAnimationFrame(() => {
      pushed.pending = false;
      if (this.pushed !== pushed) return;
      store.leans += 1;
      if (store.pushed !== this.view.now) { store.show(); return; }
      this.view.preview(); store.showState(); // the state is drawn
    });
  }

  // The solver is asked for one push at a time.
  ask() {
    const { store, pushed } = this, [size, ...by] = [pushed.force, ...pushed.by].map((part) => Number(part.toPrecision(4)));
    const message = { kind: "push", curve: store.shown, force: pushed.held ? pushed.force : size, ...pushed.held && { at: pushed.held.at, by } };
    const key = JSON.stringify(message);
    if (pushed.asked !== null || !pushed.held && !size || key === pushed.last) return;
    if (store.send(message)) pushed.asked = pushed.last = key;
  }

  answered({ point, at, by, rates }) {
    const { store, pushed } = this;
    if (!pushed || JSON.stringify(at) !== JSON.stringify(pushed.held && pushed.held.at)) return;
    store.pushed = point;
    pushed.from = { state: point, rates, by };
    pushed.asked = null;
    this.lean();
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
    store.pushed = store.leaning = null;
    store.show();
  }
}
