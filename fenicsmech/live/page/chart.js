// The load–displacement curve with its targets: displacement across, force up.

import { curveAfter } from "./preview.js";
import { drag, figure, make, path, set, ticks } from "./svg.js";
import { placed, sampled, words } from "./targets.js";

const REST = 250; // ms after which a resting gesture is solved

export class Chart {
  constructor(svg, store) {
    this.svg = svg; this.store = store; this.held = null; this.frames = 0;
    this.layers = Object.fromEntries(["axes", "before", "curve", "preview", "targets"].map((name) => {
      const layer = make("g", { class: `layer-${name}` });
      svg.append(layer);
      return [name, layer];
    }));
    new ResizeObserver(() => this.draw()).observe(svg);
  }

  // Ranges of displacement and force that are shown; they stay while a target is dragged.
  range() {
    const { store } = this, own = store.curve(), number = store.shown;
    const { held, largest } = store.project.curves[number], x = held ? [0, largest] : [0], y = held ? [0] : [0, largest];
    for (const point of own ? own.points : []) { x.push(point.displacement); y.push(point.force); }
    const before = store.before();
    for (const [displacement, force] of before ? before.points : []) { x.push(displacement); y.push(force); }
    for (const point of this.solid()) { x.push(point.displacement); y.push(point.force); }
    for (const target of store.targets()) if (target.curve === number) { x.push(target.displacement); y.push(target.force); }
    const widen = (values, least) => {
      const low = Math.min(...values), high = Math.max(...values), span = Math.max(high - low, least);
      return [low - (low < 0 ? 0.06 * span : 0), Math.max(high, low + span) + (high > 0 || low >= 0 ? 0.12 * span : 0)];
    };
    return { x: widen(x, store.mesh ? 1e-4 * store.mesh.width : 1), y: widen(y, 1e-9) };
  }

  // Points of the shown curve in 3D.
  solid() {
    const { solid, shown, project } = this.store;
    return solid && solid.curve === shown && solid.project.name === project.name ? solid.points : [];
  }

  draw() {
    if (!this.store.project) return;
    const box = this.svg.getBoundingClientRect();
    this.width = box.width || 400; this.height = box.height || 300;
    if (!this.held) this.limits = this.range();
    this.axes(); this.curves(); this.targets(); this.preview();
  }

  px([displacement, force]) {
    const { x, y } = this.limits;
    return [56 + (displacement - x[0]) / (x[1] - x[0]) * (this.width - 72),
      this.height - 40 - (force - y[0]) / (y[1] - y[0]) * (this.height - 56)];
  }

  value([across, down]) {
    const { x, y } = this.limits;
    return [x[0] + (across - 56) / (this.width - 72) * (x[1] - x[0]), y[0] + (this.height - 40 - down) / (this.height - 56) * (y[1] - y[0])];
  }

  axes() {
    const { x, y } = this.limits, parts = [];
    for (const value of ticks(x[0], x[1], Math.max(3, this.width / 90))) {
      const [a] = this.px([value, 0]);
      parts.push(make("line", { class: "grid", x1: a, x2: a, y1: 16, y2: this.height - 40 }),
        make("text", { x: a, y: this.height - 24, "text-anchor": "middle" }, figure(value)));
    }
    for (const value of ticks(y[0], y[1], Math.max(3, this.height / 60))) {
      const [, b] = this.px([0, value]);
      parts.push(make("line", { class: "grid", x1: 56, x2: this.width - 16, y1: b, y2: b }),
        make("text", { x: 50, y: b + 4, "text-anchor": "end" }, figure(value)));
    }
    const [ox, oy] = this.px([0, 0]);
    parts.push(make("line", { class: "axis", x1: 56, x2: this.width - 16, y1: oy, y2: oy }),
      make("line", { class: "axis", x1: ox, x2: ox, y1: 16, y2: this.height - 40 }),
      make("text", { x: this.width - 16, y: this.height - 8, "text-anchor": "end" }, "displacement [mm]"),
      make("text", { x: 8, y: 12 }, "force [N]"));
    this.layers.axes.replaceChildren(...parts);
  }

  curves() {
    const { store } = this, own = store.curve(), parts = [];
    const before = store.before();
    if (before) {
      const old = before.points.map((p) => this.px(p)), [x, y] = old.at(-1), end = own && own.points.length ? own.points.at(-1) : null;
      parts.push(make("path", { class: "before", d: path(old) }, make("title", {}, "As it was opened")));
      const apart = end && Math.hypot(...this.px([end.displacement, end.force]).map((part, a) => part - old.at(-1)[a]));
      if (apart > 20) parts.push(make("text", { class: "before-name", x: Math.min(x + 6, this.width - 44), y: y + 16 }, "at first"));
    }
    const solid = this.solid().map((point) => this.px([point.displacement, point.force]));
    if (solid.length) {
      const stale = store.stale() ? " stale" : "", [x, y] = solid.at(-1);
      parts.push(make("path", { class: `solid-curve${stale}`, d: path(solid) }),
        ...solid.map(([cx, cy], k) => make("circle", { class: `solid-dot${stale}`, cx, cy, r: 2.6 }, make("title", {}, `3D: ${figure(store.solid.points[k].displacement, 4)} mm at ${figure(store.solid.points[k].force, 3)} N`))),
        make("text", { class: `solid-name${stale}`, x: x - 8, y: y + 14, "text-anchor": "end" }, "3D"));
    }
    this.layers.before.replaceChildren(...parts);
    if (!own) { this.layers.curve.replaceChildren(); return; }
    const points = own.points.map((p) => this.px([p.displacement, p.force])), drawn = [];
    for (let k = 0; k + 1 < points.length; k++) {
      const stable = own.points[k].stable && own.points[k + 1].stable;
      drawn.push(make("path", { class: stable ? "curve" : "curve unstable", d: path([points[k], points[k + 1]]) }));
    }
    const errors = store.errors[store.shown] || [];
    points.forEach(([a, b], k) => {
      const point = own.points[k], error = errors[k] || 0;
      if (error) {
        const { held } = store.project.curves[store.shown];
        const [c, d] = this.px(held ? [point.displacement, point.force + error] : [point.displacement + error, point.force]);
        drawn.push(make("line", { class: "whisker", x1: a, x2: c, y1: b, y2: d }));
      }
      const dot = make("circle", { class: point.snapped ? "dot snapped" : "dot", cx: a, cy: b, r: point.snapped ? 5 : 2.8 });
      const more = `${error ? `, finer elements add ${figure(error, 2)} ${store.project.curves[store.shown].held ? "N" : "mm"}` : ""}${point.stable ? "" : ", unstable"}${point.snapped ? ", snapped on the way here" : ""}`;
      dot.append(make("title", {}, `${figure(point.displacement, 4)} mm at ${figure(point.force, 3)} N${more}; stress ${figure(point.stress, 3)} MPa`));
      drawn.push(dot);
    });
    this.here = make("circle", { class: "here", r: 6 });
    drawn.push(this.here);
    this.layers.curve.replaceChildren(...drawn);
    this.mark(store.load);
  }

  // The place of the shown load on the curve.
  mark(load) {
    const own = this.store.curve();
    if (!own || !this.here || own.points.length < 2) return;
    const at = load * (own.points.length - 1), k = Math.min(Math.floor(at), own.points.length - 2), t = at - k;
    const [a, b] = [own.points[k], own.points[k + 1]];
    const [cx, cy] = this.px([a.displacement + t * (b.displacement - a.displacement), a.force + t * (b.force - a.force)]);
    set(this.here, { cx, cy });
  }

  targets() {
    const { store } = this, kept = new Map([...this.layers.targets.children].map((g) => [g.dataset.index, g])), parts = [];
    store.targets().forEach((target, index) => {
      if (target.curve !== store.shown) return;
      const group = kept.get(String(index)) || this.handle(index);
      const [a, b] = this.px([target.displacement, target.force]);
      const curve = store.project.curves[target.curve], text = words(curve, target);
      set(group, { transform: `translate(${a} ${b})`, "aria-valuenow": sampled(curve, target)[1], "aria-valuetext": text, "aria-label": `Target ${index + 1}: ${text}; arrow keys move it` });
      parts.push(group);
    });
    if (parts.length !== this.layers.targets.children.length || parts.some((g, k) => g !== this.layers.targets.children[k])) {
      this.layers.targets.replaceChildren(...parts);
    }
  }

  handle(index) {
    const group = make("g", { class: "target", tabindex: 0, role: "slider" },
      make("circle", { class: "reach", r: 22 }), make("path", { d: "M0-9L9 0L0 9L-9 0Z" }));
    group.dataset.index = index;
    drag(group, {
      begin: (event) => { this.hold(index, event); return true; },
      move: (event) => this.moveTo(event),
      end: (_event, cancelled) => this.release(cancelled),
    });
    group.addEventListener("keydown", (event) => this.key(index, event));
    return group;
  }

  hold(index, event) {
    this.settleNow();
    const target = this.store.project.targets[index];
    const [a, b] = this.px([target.displacement, target.force]);
    this.held = { index, off: [event.clientX - a, event.clientY - b], target: { ...target }, rest: null, group: event.currentTarget, moved: false, sent: false };
    this.held.group.classList.add("held");
    this.frames = 0;
    this.store.drag = { index, target: this.held.target };
  }

  moveTo(event) {
    const { held } = this;
    if (!held) return; // its target was removed elsewhere
    const curve = this.store.project.curves[held.target.curve], [displacement, force] = this.value([event.clientX - held.off[0], event.clientY - held.off[1]]);
    const [given, wanted] = sampled(curve, { displacement, force });
    this.place(held.target, event.shiftKey ? sampled(curve, held.target)[0] : given, wanted);
    held.moved = true;
    if (!held.pending) {
      held.pending = true;
      requestAnimationFrame(() => {
        if (this.held !== held) return;
        held.pending = false;
        this.frames++;
        this.store.preview();
        this.targets(); this.preview(); this.store.listTargets(); this.store.show();
      });
    }
    clearTimeout(held.rest);
    held.rest = setTimeout(() => { if (this.held === held) { held.sent = true; this.send(held, false); } }, REST);
  }

  // A target at a place that its curve allows; what is prescribed keeps to round values when it changes.
  place(target, given, wanted) {
    const curve = this.store.project.curves[target.curve], { largest, held } = curve, [before] = sampled(curve, target);
    const sign = Math.sign(largest), unit = Math.abs(largest) / 80, least = held ? 1e-3 * (this.limits.y[1] - this.limits.y[0]) : 1e-3;
    const size = Math.min(Math.max(Math.round(Math.abs(given) / unit) * unit, unit), Math.abs(largest));
    const at = given === before ? given : Number((sign * (given * sign > 0 ? size : unit)).toPrecision(6));
    Object.assign(target, placed(curve, at, Number((Math.abs(wanted) < least && !target.scale ? least : wanted).toPrecision(5))));
  }

  send(held, settled) {
    const path = (name) => ["targets", held.index, name];
    this.store.edit([{ kind: "set", path: path("displacement"), value: held.target.displacement },
      { kind: "set", path: path("force"), value: held.target.force }], { settled });
  }

  release(cancelled) {
    const { held } = this;
    if (!held) return;
    clearTimeout(held.rest);
    held.group.classList.remove("held");
    this.held = null;
    this.store.drag = null;
    if (held.moved && !cancelled) this.send(held, true);
    if (held.sent && cancelled) this.store.send({ kind: "cancel" }); // it was solved where it rested
    this.store.previewed = cancelled ? null : this.store.previewed;
    this.draw();
    this.store.listTargets();
  }

  key(index, event) {
    if (this.moved && this.moved.index !== index) this.settleNow();
    const target = { ...(this.moved ? this.moved.target : this.store.project.targets[index]) }, fine = event.shiftKey ? 0.002 : 0.02;
    const { x, y } = this.limits, move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[event.key];
    if (event.key === "Delete" || event.key === "Backspace") {
      event.preventDefault();
      this.store.edit([{ kind: "remove", path: ["targets", index] }]);
    } else if (move) {
      event.preventDefault(); event.stopPropagation();
      const curve = this.store.project.curves[target.curve], across = move[0] * fine * (x[1] - x[0]), up = move[1] * fine * (y[1] - y[0]);
      const [given, wanted] = sampled(curve, target), [by, more] = sampled(curve, { displacement: across, force: up });
      this.place(target, given + Math.sign(by) * Math.max(Math.abs(by), Math.abs(curve.largest) / 80), wanted + more);
      const held = { index, target };
      this.send(held, false);
      this.store.preview();
      this.draw();
      clearTimeout(this.settle);
      this.moved = held;
      this.settle = setTimeout(() => this.settleNow(), 600);
    }
  }

  // Ends the move by keys that lasts, before anything else changes the project.
  settleNow() {
    const held = this.moved;
    if (!held) return;
    clearTimeout(this.settle);
    this.moved = null;
    this.send(held, true);
  }

  preview() {
    const { store } = this, s = store.previewed, base = store.base(), parts = [];
    if (s && base && base.curves[store.shown] && base.curves[store.shown].at.length) {
      const points = curveAfter(base, store.shown, s, store.project.curves[store.shown]).map((p) => this.px(p)), [x, y] = points.at(-1);
      parts.push(make("path", { class: "preview", d: path(points) }),
        make("text", { class: "preview-name", x: Math.min(x - 8, this.width - 20), y: Math.max(y - 8, 24), "text-anchor": "end" }, "linear preview"));
    }
    this.layers.preview.replaceChildren(...parts);
  }
}
