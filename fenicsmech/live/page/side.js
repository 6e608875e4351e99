// Properties of parts beside the pictures: materials, thickness, loads, motors, effects, files.

const EXPORTS = {
  step: ["STEP", "Solids for CAD"], stl: ["STL", "Surfaces for 3D printing"], dxf: ["DXF", "Outlines for laser and mill"], png: ["PNG", "Pictures of curve and mechanism"],
  animation: ["GIF", "The mechanism in motion"], script: ["Python", "The script that does the same"],
};

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

export class Side {
  constructor(root, store) {
    this.root = root; this.store = store; this.key = "";
    root.addEventListener("focusout", (event) => { if (!root.contains(event.relatedTarget)) setTimeout(() => this.store.project && this.draw()); });
  }

  // Fields are made anew when their project changes, but not while one of them is used.
  draw() {
    const { project, examples, materials } = this.store;
    const { design, targets, ...shown } = project;
    const key = JSON.stringify([shown, this.store.shown]);
    if (key === this.key || this.root.contains(document.activeElement) && document.activeElement.matches("input[type=number], input[type=range]")) return;
    this.key = key;
    const parts = [], set = (path, value, options) => this.store.edit([{ kind: "set", path, value }], options);
    project.links.forEach((link, k) => {
      if (link.kind !== "flexible") return;
      const own = materials.includes(link.material) ? materials : [link.material, ...materials];
      const choice = element("select", { onchange: () => set(["links", k, "material"], own[choice.selectedIndex]) },
        ...own.map((name) => element("option", { textContent: name.name || name, selected: name === link.material })));
      const fields = [this.row("material", choice), this.number("depth [mm]", link.shape.depth, (value) => set(["links", k, "shape", "depth"], value))];
      if (link.design && link.design.thickness) {
        const [low, high] = link.design.thickness;
        fields.push(this.number("thinnest [mm]", low, (value) => set(["links", k, "design", "thickness", 0], value)),
          this.number("thickest [mm]", high, (value) => set(["links", k, "design", "thickness", 1], value)));
      }
      parts.push(this.group(link.name, ...fields));
    });
    const n = this.store.shown, curve = project.curves[n], loads = [
      this.number("largest [N]", curve.largest, (value) => {
        const ratio = value / curve.largest, changes = [{ kind: "set", path: ["curves", n, "largest"], value }];
        if (!(ratio > 0)) return;
        this.store.project.targets.forEach((target, k) => {
          if (target.curve === n && Math.abs(target.force) > Math.abs(value)) changes.push({ kind: "set", path: ["targets", k, "force"], value });
        });
        this.store.edit(changes);
      }),
      this.number("frames", curve.steps, (value) => set(["curves", n, "steps"], Math.round(value))),
    ];
    project.motors.forEach((motor) => {
      const at = curve.positions[motor.name] || 0;
      const slides = project.joints.find((own) => own.name === motor.joint).kind === "prismatic";
      const unit = slides ? "mm" : "rad", most = Math.max(slides ? 20 : Math.PI, Math.abs(at)), step = slides ? 0.1 : 0.01;
      const slide = element("input", { type: "range", min: -most, max: most, step, value: at });
      const move = (value, settled) => set(["curves", n, "positions"], { ...this.store.project.curves[n].positions, [motor.name]: value }, { settled });
      const turn = (settled) => move(Number(slide.value), settled);
      let pending = null; // fewer messages than the server takes
      slide.oninput = () => { this.store.turnTo(motor.name, Number(slide.value)); pending ??= setTimeout(() => { pending = null; turn(false); }, 40); };
      slide.onchange = () => { clearTimeout(pending); pending = null; this.store.stopTurning(); turn(true); };
      slide.onpointerup = () => slide.blur(); // keys go on with it
      loads.push(this.row(motor.name, slide), this.number(`${motor.name} [${unit}]`, at, (value) => move(value, true)));
    });
    const k = project.forces.findIndex((own) => own.name === curve.force), force = project.forces[k];
    const at = (own) => set(["forces", k, "at"], own), links = project.links.map((own) => own.name);
    const on = element("select", { title: "The link on which it acts", onchange: () => set(["forces", k, "on"], on.value) },
      ...links.map((name) => element("option", { textContent: name, selected: name === force.on })));
    loads.push(this.row("acts on", on), this.number("at x [mm]", force.at[0], (value) => at([value, force.at[1]])), this.number("at y [mm]", force.at[1], (value) => at([force.at[0], value])),
      this.number("direction [°]", Number((Math.atan2(force.direction[1], force.direction[0]) * 180 / Math.PI).toFixed(2)), (value) =>
        set(["forces", k, "direction"], [Math.cos(value * Math.PI / 180), Math.sin(value * Math.PI / 180)].map((part) => Number(part.toFixed(6))))));
    if (project.curves.length > 1) loads.push(element("button", { id: "remove-curve", textContent: `Remove ${curve.name}`, onclick: () => this.removeCurve(n) }));
    parts.push(this.group(`Load: ${curve.force}`, ...loads));
    const effect = (kind) => project.effects.findIndex((own) => own.kind === kind);
    const change = (kind, value) => {
      const k = effect(kind), changes = k >= 0 ? [{ kind: "remove", path: ["effects", k] }] : [];
      if (value) changes.push({ kind: "insert", path: ["effects", changes.length ? project.effects.length - 1 : project.effects.length], value });
      this.store.edit(changes);
    };
    parts.push(this.group("Elements", this.number("size [mm]", project.simulation.size, (value) => set(["simulation", "size"], value))));
    const weight = element("input", { type: "checkbox", checked: effect("gravity") >= 0,
      onchange: () => change("gravity", weight.checked && { kind: "gravity", acceleration: [0, -9810] }) });
    const warmer = effect("temperature") >= 0 ? project.effects[effect("temperature")].change : 0;
    parts.push(this.group("Effects", this.row("weight", weight),
      this.number("warmer by [K]", warmer, (value) => change("temperature", value && { kind: "temperature", change: value }))));
    const follow = element("input", { type: "checkbox", checked: project.fit, onchange: () => set(["fit"], follow.checked) });
    parts.push(this.group("Design", this.row("shape follows targets", follow),
      element("button", { textContent: "As drawn", title: "The shape before it followed its targets", onclick: () => set(["design"], null) })));
    const file = element("input", { type: "file", accept: ".json,application/json", hidden: true, id: "file", onchange: async () => {
      if (file.files[0].size > 1e6) { this.store.tell("This file is larger than any project: 1 MB.", true); file.value = ""; return; }
      try { this.store.send({ kind: "open", project: JSON.parse(await file.files[0].text()) }); }
      catch { this.store.tell("This file is not JSON. Open one that was saved by the page.", true); }
      file.value = "";
    } });
    const pick = element("select", { title: "Examples", onchange: () => this.store.send({ kind: "example", name: pick.value }) },
      element("option", { textContent: "Examples…", value: "", selected: true, disabled: true }),
      ...examples.map((name) => element("option", { value: name, textContent: name.replaceAll("-", " ") })));
    const get = (what, [label, title]) => element("a", { className: "button", href: `export/${what}`, textContent: label, title, download: "",
      onclick: (event) => { event.preventDefault(); this.save(what, label); } });
    parts.unshift(this.group("Open, save, export", element("div", { className: "row" }, get("project", ["Save", "The project, to be opened here again"]), element("button", { textContent: "Open…", onclick: () => file.click() }), pick, file),
      element("p", { className: "caption", textContent: "Export for CAD, 3D print, laser, slides, Python:" }),
      element("div", { className: "row" }, ...Object.entries(EXPORTS).map(([what, label]) => get(what, label)))));
    this.root.replaceChildren(...parts);
  }

  // Fetches a file when the shape has settled, and saves it.
  async save(what, label) {
    const { store } = this;
    if (store.busy) { store.tell(`${label} comes when the shape has settled…`); await new Promise((go) => store.waiting.push(go)); }
    if (!["project", "script"].includes(what)) store.tell(`${label} is being made…`);
    const found = await fetch(`export/${what}`).catch(() => null);
    if (!found) store.tell("Not connected. Is the program still running?", true);
    if (!found || !found.ok) return; // the server tells why
    const name = (found.headers.get("Content-Disposition") || "").match(/filename="([^"]+)"/), link = element("a", { href: URL.createObjectURL(await found.blob()), download: name ? name[1] : what });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
    store.tell(`Saved ${link.download}.`);
  }

  // A curve with its targets, and its force if nothing else has it.
  removeCurve(n) {
    const { project } = this.store, { force } = project.curves[n], changes = [];
    for (let k = project.targets.length - 1; k >= 0; k--) {
      const own = project.targets[k].curve;
      if (own === n) changes.push({ kind: "remove", path: ["targets", k] });
      else if (own > n) changes.push({ kind: "set", path: ["targets", k, "curve"], value: own - 1 });
    }
    changes.push({ kind: "remove", path: ["curves", n] });
    const used = project.curves.some((own, k) => k !== n && (own.force === force || force in own.others));
    if (!used) changes.push({ kind: "remove", path: ["forces", project.forces.findIndex((own) => own.name === force)] });
    this.store.edit(changes);
  }

  group(name, ...children) { return element("fieldset", {}, element("legend", { textContent: name }), ...children); }

  row(name, field) { return element("label", {}, element("span", { textContent: name }), field); }

  number(name, value, change) {
    const field = element("input", { type: "number", step: "any", value });
    field.onchange = () => {
      const given = Number(field.value);
      if (field.value !== "" && Number.isFinite(given) && given !== value) change(given);
      field.blur();
    };
    return this.row(name, field);
  }
}
