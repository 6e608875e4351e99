// The page: one store of what the server has sent, the two pictures, and the controls.

import { listCarried } from "./carried.js";
import { Chart } from "./chart.js";
import { Handles } from "./handles.js";
import { connect } from "./net.js";
import { entryOf, nothing, step } from "./preview.js";
import { Side } from "./side.js";
import { Solid } from "./solid.js";
import { figure } from "./svg.js";
import { placed, sampled, units, untargeted, words } from "./targets.js";
import { View } from "./view.js";

const $ = (id) => document.getElementById(id);

const store = {
  project: null, mesh: null, curves: {}, errors: {}, peaks: {}, responses: {}, linear: null, misfits: null, first: [],
  shown: 0, load: 0, previewed: null, drag: null, pushed: null, pushing: false, leaning: null, leans: 0, turning: null, stressTop: 0, mode: "move", solid: null, solving: false, waiting: [], required: [], opened: 0, added: null, untargeted: "",

  curve() { return this.curves[this.shown]; },
  // The mesh of what is drawn: another curve may still be that of an earlier shape.
  drawnMesh() { const own = this.curve(); return !this.pushed && own ? own.mesh : this.mesh; },
  // The shown curve as it was when the project was opened; null if its load is another one.
  before() {
    const curve = this.project.curves[this.shown];
    const key = (force, { positions, others, held, ratios, largest }) => JSON.stringify([force, positions, others, held || false, ratios || null, Math.sign(largest)]);
    const now = key(this.project.forces.find((own) => own.name === curve.force), curve);
    return this.first.find((own) => key(own.force, own) === now) || null;
  },
  // What a preview is a step from.
  base() { return handles.held ? handles.held.linear : this.turning ? this.turning.linear : this.linear; },
  // A state with linear responses and amounts of these, which is drawn dashed; null if there is none.
  lean() {
    if (!this.turning) return this.leaning;
    const { rest, rates } = this.turning, change = this.turn();
    return rest && rates && change !== null ? { state: rest, rates: [rates], amounts: [change] } : null;
  },
  // How far the motor that is turned is from where its curve was solved.
  turn() {
    const { linear, motor, to } = this.turning, positions = linear && linear.positions[this.shown];
    return positions ? to - (positions[motor] || 0) : null;
  },
  // Follows a motor that is being turned, from the last solve.
  turnTo(motor, to) {
    const now = this.turning && !this.turning.over ? this.turning : { linear: this.linear };
    this.turning = { ...now, motor, to, over: false };
    this.turned();
  },
  turned() {
    const { linear, motor } = this.turning, own = this.curve(), found = this.responses[this.shown];
    if (linear && own && linear.task === own.task) Object.assign(this.turning, { rest: own.points[0], rates: found && found.motors[motor] });
    const entry = linear ? entryOf(linear, { kind: "motor", name: motor }) : -1;
    this.previewed = entry < 0 ? null : nothing(linear);
    if (this.previewed) this.previewed[entry] = this.turn();
    chart.preview(); show();
  },
  stopTurning() { if (this.turning) this.turning.over = true; },
  // The targets, with the one that is dragged where the pointer has it.
  targets() {
    return this.project.targets.map((target, k) => this.drag && this.drag.index === k ? this.drag.target : target);
  },
  preview() {
    this.previewed = this.linear && this.linear.curves.length === this.project.curves.length
      ? step(this.linear, { ...this.project, targets: this.targets() }) : null;
  },
  edit(changes, { settled = true, fit } = {}) {
    const message = { kind: "edit", changes, settled };
    if (fit !== undefined) message.fit = fit;
    if (send(message)) apply(this.project, changes);
  },
  // Whether what was solved in 3D belongs to another design.
  stale() {
    const key = (own) => JSON.stringify([own.links, own.joints, own.forces, own.effects, own.design, own.curves[this.solid.curve], own.simulation]);
    return key(this.solid.project) !== key(this.project);
  },
  send(message) { return send(message); },
  tell(text, ...more) { tell(text, ...more); },
  fresh,
  show() { show(); },
  showState() { showState(); },
  drawCurve() { chart.preview(); },
  listTargets() { listTargets(); },
};

const HINTS = {
  move: "Drag a target ◆ on the curve, or choose Stiffer: the link changes its shape to follow. Or push it anywhere.",
  solid: "Turn the solid with the pointer or the arrow keys. Solve in 3D to see how far plane stress is from it.",
  shape: "Drag joints ●, points ■, slopes ○, thicknesses ◆, the force ▲ and its direction: dashed is where it leads.",
};

// Of the buttons that make and move targets.
const TITLES = Object.fromEntries(["add", "softer", "stiffer"].map((id) => [id, $(id).title]));

const chart = new Chart($("chart"), store), view = new View($("view"), store);
const handles = new Handles(view, store), side = new Side($("side"), store);
const solid = new Solid($("solid"), store, view);
let playing = !matchMedia("(prefers-reduced-motion: reduce)").matches, phase = 0;

const receivers = {
  project({ project, undo, redo, ...more }) {
    const other = store.opened !== more.opened;
    store.project = project;
    Object.assign(store, more);
    if (other) { store.curves = {}; store.errors = {}; store.peaks = {}; store.responses = {}; store.turning = null; store.linear = null; store.solid = null; store.required = []; view.forced = true; }
    listCarried($("carried"), project, store.required);
    if (chart.held && !project.targets[chart.held.index]) { chart.held.sent = false; chart.release(true); } // it was removed elsewhere
    const added = project.curves.findIndex((own) => own.name === store.added);
    if (added >= 0) { store.shown = added; store.added = null; }
    store.shown = Math.min(store.shown, project.curves.length - 1);
    const forces = JSON.stringify(project.curves.map((own) => [own.force, own.positions]));
    if (store.forces !== forces) { store.forces = forces; store.linear = null; if (!store.turning) store.previewed = null; }
    for (const number of Object.keys(store.curves)) if (number >= project.curves.length) delete store.curves[number];
    $("name").textContent = project.name;
    $("add-curve").disabled = $("add-position").disabled = project.curves.length >= store.most.curves;
    $("add-position").hidden = !project.motors.length;
    $("undo").disabled = !undo; $("redo").disabled = !redo;
    tabs(); listTargets(); chart.draw(); side.draw();
    if (!handles.held) view.draw();
  },
  first({ curves }) { store.first = curves; if (store.project) { chart.draw(); stiffness(); } },
  solver(event) {
    const { state, seconds } = event;
    store.busy = state === "busy" || state === "starting";
    $("state").classList.toggle("busy", store.busy);
    if (state === "busy") { store.iteration = null; tell(null); }
    const words = { starting: "Starting…", busy: "Solving…", failed: "The solver ended again and again. Undo the last change." };
    $("state").textContent = words[state] || (seconds ? `Solved in ${seconds.toFixed(1)} s` : "Ready");
    document.body.dataset.solver = state;
    $("fit").textContent = store.busy ? "Stop" : "Fit";
    if (!store.busy) store.waiting.splice(0).forEach((go) => go());
    $("fit").title = store.busy ? "Stop solving" : "Let the shape follow the targets once more";
  },
  refused({ place, problem }) { store.added = null; handles.failed(); tell(`${place ? `${place}: ` : ""}${problem}`, true); },
  mesh(event) { store.mesh = event; },
  iterate({ number, design, misfits }) {
    store.project.design = design;
    store.misfits = misfits;
    const worst = Math.max(0, ...misfits.map(Math.abs));
    $("state").textContent = `Solving… step ${number}, targets missed by ${figure(100 * worst, 2)} %`;
    listTargets();
  },
  curve(event) {
    store.curves[event.curve] = { ...event, mesh: store.mesh };
    delete store.errors[event.curve]; delete store.peaks[event.curve];
    if (event.iterate === null) delete store.responses[event.curve]; // those of this curve follow, if it has any
    store.pushed = store.leaning = null;
    if (store.turning && store.turning.over) store.turning = null;
    if (!store.drag && !handles.held && !store.turning) store.previewed = null;
    store.stressTop = Math.max(...Object.values(store.curves).flatMap((own) => own.points.map((point) => point.stress)), 1e-9);
    $("scale-high").textContent = `${figure(store.stressTop)} MPa`;
    const { failed, remarks } = event;
    if (event.iterate === null) document.body.dataset.curves = Number(document.body.dataset.curves || 0) + 1;
    if (failed) tell(`${failed.part}: ${failed.problem}. ${failed.remedy}.`, true);
    remarks.forEach((remark) => tell(remark));
    view.fit(); show(); chart.draw(); listTargets();
  },
  responses(event) { store.responses[event.curve] = event; },
  errors({ curve, errors, peak }) { store.errors[curve] = errors; store.peaks[curve] = peak; chart.draw(); listTargets(); },
  fitted({ misfits, missed, design }) {
    store.project.design = design;
    store.misfits = misfits;
    if (missed) tell(`${missed.problem[0].toUpperCase()}${missed.problem.slice(1)}. ${missed.remedy}.`, true);
    listTargets();
  },
  required({ values, failed }) {
    store.required = values;
    listCarried($("carried"), store.project, values);
    if (failed) tell(`What is required: ${failed.problem}. ${failed.remedy}.`, true);
  },
  linear(event) {
    store.linear = event;
    if (!event.whole) tell("The linear preview ends where a curve snaps, ends or is unstable.");
    if (event.active.length) tell(`Held back by ${event.active.join(", ")}. Widen these bounds, or relax a target.`);
    if (store.turning) { store.turning.linear = event; store.turned(); }
    else if (!store.drag && !handles.held) { store.previewed = null; chart.preview(); }
    view.draw();
  },
  solid(event) {
    store.solving = event.state === "solving";
    $("progress").hidden = !store.solving;
    $("solve-solid").textContent = store.solving ? "Stop" : "Solve in 3D";
    if (store.solving) $("progress").value = event.done / event.of;
    if (event.state === "failed") tell(`In 3D: ${event.part}: ${event.problem}. ${event.remedy}.`, true);
    if (event.state === "solved") {
      store.solid = event;
      if (event.failed) tell(`In 3D: ${event.failed.part}: ${event.failed.problem}. ${event.failed.remedy}.`, true);
      event.remarks.forEach((remark) => tell(`In 3D: ${remark}`));
    }
    $("solid-state").textContent = { solving: `${event.done} of ${event.of} frames`, failed: "Failed, see below", cancelled: "Stopped" }[event.state] || "";
    document.body.dataset.solid = event.state;
    chart.draw(); show();
  },
  pushed(event) { if (event.curve === store.shown) handles.answered(event); },
  failed({ part, problem, remedy }) { handles.failed(); tell(`${part}: ${problem}. ${remedy}.`, true); },
  done({ task }) {
    const own = store.curve();
    if (!own || own.task !== task || (store.linear && store.linear.task === task)) return;
    store.linear = null; // it belongs to another design
    if (store.project.links.some((link) => link.design)) tell("No linear preview: a curve snaps or ends early. Make its largest force smaller for one.");
  },
  cancelled() { handles.failed(); },
};

const transmit = connect(
  (event) => { const receive = receivers[event.event]; if (receive) receive(event); },
  () => { handles.failed(); $("state").textContent = "Not connected. Is the program still running?"; },
);

// A message to the server.
function send(message) {
  if (message.kind !== "edit" || message.settled) chart.settleNow();
  const sent = transmit(message);
  if (sent) document.body.dataset.solver = "asked"; // until its answer
  else tell("Not connected: this change was not made. Is the program still running?", true);
  return sent;
}

// Sets values in the project at once, as the server will answer.
function apply(project, changes) {
  for (const { kind, path, value } of changes) {
    const at = kind === "set" ? path.slice(0, -1).reduce((own, step) => own && own[step], project) : null;
    if (at) at[path.at(-1)] = structuredClone(value);
  }
}

// A message to the user; null clears them, and the next one clears a passing one.
function tell(text, error = false, passing = false) {
  if (text === null) { $("told").replaceChildren(); return; }
  const item = document.createElement("li");
  item.textContent = text;
  if (error) item.className = "error";
  [...$("told").children].filter((own) => own.textContent === text || own.dataset.passing).forEach((own) => own.remove());
  if (passing) item.dataset.passing = true;
  $("told").prepend(item); // the newest is in view
}

function tabs() {
  const { curves, targets } = store.project, none = untargeted(curves[store.shown]);
  for (const [id, title] of Object.entries(TITLES)) { $(id).disabled = Boolean(none); $(id).title = none || title; }
  $("add").disabled ||= targets.length >= store.most.targets;
  if (none !== store.untargeted) { store.untargeted = none; if (store.mode === "move") showHint(); }
  $("tabs").replaceChildren(...(curves.length < 2 ? [] : curves.map((curve, k) => {
    const tab = document.createElement("button");
    tab.textContent = curve.name;
    tab.setAttribute("role", "tab");
    tab.setAttribute("aria-selected", k === store.shown);
    tab.onclick = () => { store.shown = k; store.pushed = null; tabs(); chart.draw(); show(); side.draw(); listTargets(); };
    return tab;
  })));
}

// Displacement of the shown design at a force, or force at a displacement that is held, with its estimated error,
// interpolated between frames.
function reached(number, given) {
  const own = store.curves[number], errors = store.errors[number] || [];
  if (!own) return null;
  for (let k = 0; k + 1 < own.points.length; k++) {
    const [[from, a], [to, b]] = [k, k + 1].map((at) => sampled(store.project.curves[number], own.points[at]));
    const t = to === from ? -1 : (given - from) / (to - from);
    if (t >= -1e-9 && t <= 1 + 1e-9) {
      const error = (errors[k] || 0) * (1 - t) + (errors[k + 1] || 0) * t;
      return { value: a + t * (b - a) + error, error };
    }
  }
  return null;
}

// The value at x of a line through points [x, value]; null beyond them.
function between(points, x) {
  for (let k = 0; k + 1 < points.length; k++) {
    const [[a, p], [b, q]] = [points[k], points[k + 1]], t = (x - a) / (b - a);
    if (t >= -1e-9 && t <= 1 + 1e-9) return p + t * (q - p);
  }
  return null;
}

// The secant stiffness at the largest force of the shown curve, and beside what was opened.
function stiffness() {
  const own = store.curve(), errors = store.errors[store.shown] || [];
  if (!own || own.points.length < 2) { $("stiffness-now").textContent = ""; return; }
  const end = own.points.at(-1), error = errors[own.points.length - 1] || 0, { held } = store.project.curves[store.shown];
  const value = end.displacement + (held ? 0 : error), now = (end.force + (held ? error : 0)) / value;
  const first = store.before(), then = first && between(first.points.map(([displacement, force]) => [force, displacement]), end.force);
  const change = !held && then && value && store.errors[store.shown] ? 100 * (then / value - 1) : 0; // both with their errors
  const more = Math.abs(change) > 0.3 ? `, ${figure(Math.abs(change), 2)} % ${change > 0 ? "stiffer" : "softer"} than at first` : "";
  const peak = store.peaks[store.shown], stress = peak ? `; stress up to ${figure(peak.value)} ± ${figure(peak.error, 1)} MPa` : "";
  $("stiffness-now").textContent = `${figure(now)} N/mm at ${figure(end.force)} N${more}${stress}`;
}

function listTargets() {
  stiffness();
  const targets = store.targets(), kept = [...$("targets").children]; // a button that is being pressed stays
  targets.forEach((target, k) => {
    if (target.curve !== store.shown) return;
    const item = kept.shift() || document.createElement("li");
    if (!item.children.length) {
      item.append(document.createElement("span"), document.createElement("span"), Object.assign(document.createElement("button"), { textContent: "×", title: "Remove this target (Delete)" }));
      $("targets").append(item);
    }
    const [text, mark, remove] = item.children;
    mark.textContent = mark.className = "";
    delete item.dataset.miss;
    const curve = store.project.curves[target.curve], [given, wanted] = sampled(curve, target), now = reached(target.curve, given);
    text.textContent = `◆ ${words(curve, target)}`;
    if (now) {
      const miss = (now.value - wanted) / (target.scale || Math.abs(wanted));
      const error = Math.abs(now.error) > 0 ? ` ± ${figure(Math.abs(now.error), 1)}` : "";
      mark.textContent = `reached ${figure(now.value, 4)}${error} ${units(curve)[1]} (${miss < 0 ? "−" : "+"}${figure(100 * Math.abs(miss), 2)} %)`;
      mark.className = Math.abs(miss) <= 0.01 ? "met" : "missed";
      item.dataset.miss = miss;
    }
    remove.onclick = () => store.edit([{ kind: "remove", path: ["targets", k] }]);
    remove.setAttribute("aria-label", `Remove target ${k + 1}`);
  });
  kept.forEach((item) => item.remove());
}

// -- controls ---

for (const kind of ["undo", "redo", "reset"]) $(kind).onclick = () => send({ kind });
$("fit").onclick = () => send({ kind: store.busy ? "stop" : "fit" });
$("add").onclick = () => {
  const own = store.curve(), points = own ? own.points : [];
  const at = points[Math.max(1, Math.round(store.load * (points.length - 1)))];
  if (!at) return;
  const curve = store.project.curves[store.shown], [given, wanted] = sampled(curve, at), most = Math.max(...points.map((own) => Math.abs(sampled(curve, own)[1])));
  store.edit([{ kind: "insert", path: ["targets", store.project.targets.length],
    value: { curve: store.shown, ...placed(curve, given, Number(wanted.toPrecision(4)) || 0.1 * most || 0.1), weight: 1 } }]);
};
// All targets of the shown curve at displacements that are a factor smaller, or forces that are larger where
// displacements are held; without targets there is one at its end.
function stiffen(factor) {
  const { project, shown } = store, own = store.curve(), changes = [], mine = project.targets.filter((target) => target.curve === shown);
  const curve = project.curves[shown], [name, by] = curve.held ? ["force", factor] : ["displacement", 1 / factor], changed = (at) => Number((at[name] * by).toPrecision(5));
  project.targets.forEach((target, k) => {
    if (target.curve === shown && target[name]) changes.push({ kind: "set", path: ["targets", k, name], value: changed(target) });
  });
  const end = own && own.points.at(-1);
  if (!mine.length && end && end.force) changes.push({ kind: "insert", path: ["targets", project.targets.length],
    value: { curve: shown, force: end.force, displacement: end.displacement, weight: 1, [name]: changed(end) } });
  if (changes.length) store.edit(changes, { fit: true });
}
const share = () => Math.min(Math.max(Number($("by").value) || 20, 1), 90) / 100;
$("stiffer").onclick = () => stiffen(1 + share());
$("softer").onclick = () => stiffen(1 - share());

// A name that none of some parts has.
function fresh(stem, taken) {
  let k = taken.length + 1;
  while (taken.some((own) => own.name === `${stem} ${k}`)) k++;
  return `${stem} ${k}`;
}

// A curve of the shown one's force, with the motors elsewhere.
$("add-position").onclick = () => {
  const { curves, motors, joints } = store.project, shown = curves[store.shown], [motor] = motors, name = fresh("curve", curves);
  const by = joints.find((own) => own.name === motor.joint).kind === "prismatic" ? 1 : 0.2, positions = { ...shown.positions, [motor.name]: Number(((shown.positions[motor.name] || 0) + by).toFixed(4)) };
  store.added = name;
  store.edit([{ kind: "insert", path: ["curves", curves.length], value: { ...shown, name, positions } }]);
};
// A curve like the shown one, of a force of its own, turned by 45°: its point and direction are dragged in Shape.
$("add-curve").onclick = () => {
  const { curves, forces } = store.project, shown = curves[store.shown], like = forces.find((own) => own.name === shown.force);
  const name = fresh("force", forces), curve = fresh("curve", curves), [a, b] = like.direction;
  store.added = curve; // it is shown when the server has it
  store.edit([{ kind: "insert", path: ["forces", forces.length], value: { ...like, name, direction: [0.7 * (a - b), 0.7 * (a + b)].map((part) => Number(part.toFixed(4))) } },
    { kind: "insert", path: ["curves", curves.length], value: { ...shown, name: curve, force: name, others: {} } }]);
  $("mode-shape").click();
  $("hint").textContent = `Drag the point ▲ of ${name} and the dot that gives its direction, or change them beside the pictures.`;
};
$("play").onclick = () => { playing = !playing; showPlaying(); };
$("load").oninput = () => { playing = false; store.load = Number($("load").value); showPlaying(); show(); };
document.addEventListener("keydown", (event) => {
  if (event.target.matches("input, select, textarea") || chart.held || handles.held) return;
  const command = event.ctrlKey || event.metaKey;
  if (command && event.key.toLowerCase() === "z") { event.preventDefault(); send({ kind: event.shiftKey ? "redo" : "undo" }); }
  else if (command && event.key.toLowerCase() === "y") { event.preventDefault(); send({ kind: "redo" }); }
  else if (event.key === " " && !event.target.matches("button")) { event.preventDefault(); $("play").click(); }
});

$("solve-solid").onclick = () => send(store.solving ? { kind: "stop solid" } : { kind: "solve solid", curve: store.shown });

for (const mode of ["move", "shape", "solid"]) $(`mode-${mode}`).onclick = () => {
  store.mode = mode;
  for (const own of ["move", "shape", "solid"]) $(`mode-${own}`).setAttribute("aria-pressed", own === mode);
  $("view").dataset.mode = document.body.dataset.mode = mode;
  $("scale-high").textContent = `${figure(store.stressTop)} MPa`;
  showHint();
  show();
};

function showHint() {
  const none = store.mode === "move" && store.untargeted;
  $("hint").textContent = none ? `${none}. Push the mechanism anywhere, or change its shape.` : HINTS[store.mode];
}

function showPlaying() {
  $("play").setAttribute("aria-pressed", playing);
  $("play").textContent = playing ? "Pause" : "Play";
}

function show() {
  if (store.mode === "solid") solid.draw(); else view.draw();
  chart.mark(store.load);
  compareSolid();
  showState();
}

// The load of what is drawn.
function showState() {
  const state = store.mode === "solid" ? solid.now : view.now, held = handles.pushed && handles.pushed.held;
  if (!state) return;
  const pull = held ? `, pushed by ${figure(Math.hypot(...handles.pushed.by), 2)} N` : "";
  $("at").textContent = `${figure(state.force, 2)} N, ${figure(state.displacement, 3)} mm${pull}`;
}

// What 3D says beside plane stress, at the largest force that both reach.
function compareSolid() {
  const { solid: own } = store;
  if (store.mode !== "solid" || store.solving || !own || !own.points.length || own.curve !== store.shown) return;
  const curve = store.project.curves[own.curve], end = own.points.at(-1), [given, found] = sampled(curve, end), now = reached(own.curve, given), error = own.errors ? own.errors.at(-1) : 0;
  const value = found + error, less = now && value ? (now.value - value) / Math.abs(value) : 0, [at, of] = units(curve);
  const text = `${figure(value, 4)}${error ? ` ± ${figure(Math.abs(error), 1)}` : ""} ${of} at ${figure(given)} ${at}`;
  $("solid-state").textContent = store.stale() ? `${text}, of an earlier shape` : `${text}${now ? `; plane: ${less < 0 ? "−" : "+"}${figure(100 * Math.abs(less), 2)} %` : ""}`;
}

// The animation: loads the mechanism and unloads it, eased at the ends.
let last = performance.now(), held = null;
function animate(now) {
  requestAnimationFrame(animate);
  if (store.busy && now - last < 50) return; // the solver shares the processors
  const passed = Math.min(now - last, 100);
  last = now;
  if (playing && store.mesh && store.curve() && !document.hidden && store.mode !== "shape" && !store.pushing && !store.drag && !store.turning) {
    phase = (phase + passed / 4200) % 1;
    store.load = 0.5 - 0.5 * Math.cos(2 * Math.PI * phase);
    $("load").value = store.load;
    show();
  } else if (store.drag && store.drag !== held) view.draw(); // at rest
  held = store.drag;
}
showPlaying();
requestAnimationFrame(animate);
window.live = { store, solid, chart, view, handles, send };
