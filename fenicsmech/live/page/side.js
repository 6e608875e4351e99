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
    this.root = root; this.store = store; this.key = ""; this.joint = 0;
    root.addEventListener("focusout", (event) => { if (!root.contains(event.relatedTarget)) setTimeout(() => this.store.project && this.draw()); });
  }

  // Fields are made anew when their project changes, but not while one of them is used.
  draw() {
    const { project, examples } = this.store;
    const { design, targets, ...shown } = project;
    const key = JSON.stringify([shown, this.store.shown]);
    if (key === this.key || this.root.contains(document.activeElement) && document.activeElement.matches("input[type=number], input[type=range]")) return;
    this.key = key;
    const parts = [], set = (path, value, options) => this.store.edit([{ kind: "set", path, value }], options);
    project.links.forEach((link, k) => {
      if (link.kind !== "flexible") return;
      const fields = [...this.material(link, k), this.number("depth [mm]", link.shape.depth, (value) => set(["links", k, "shape", "depth"], value))];
      const changes = element("input", { type: "checkbox", checked: Boolean(link.design), onchange: () => {
        const value = changes.checked ? { segments: 3, thickness: null } : null; // parameters of the design belong to other links then
        this.store.edit([{ kind: "set", path: ["design"], value: null }, { kind: "set", path: ["links", k, "design"], value }], { fit: project.fit });
      } });
      fields.push(this.row("changes shape", changes));
      if (link.design && link.design.thickness) {
        const [low, high] = link.design.thickness;
        fields.push(this.number("thinnest [mm]", low, (value) => set(["links", k, "design", "thickness", 0], value)),
          this.number("thickest [mm]", high, (value) => set(["links", k, "design", "thickness", 1], value)));
      }
      parts.push(this.group(link.name, ...fields));
    });
    const n = this.store.shown, curve = project.curves[n], loads = [
      this.row("force", this.select(project.forces.map((own) => own.name), curve.force, (name) => this.useForce(n, name))),
      this.number(curve.held ? "largest [mm]" : "largest [N]", curve.largest, (value) => {
        const ratio = value / curve.largest, changes = [{ kind: "set", path: ["curves", n, "largest"], value }];
        if (!(ratio > 0)) return;
        this.store.project.targets.forEach((target, k) => {
          const given = curve.held ? "displacement" : "force";
          if (target.curve === n && Math.abs(target[given]) > Math.abs(value)) changes.push({ kind: "set", path: ["targets", k, given], value });
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
    loads.push(...this.force(project.forces.findIndex((own) => own.name === curve.force)));
    if (project.curves.length > 1) loads.push(element("button", { id: "remove-curve", textContent: `Remove ${curve.name}`, onclick: () => this.removeCurve(n) }));
    loads.push(element("button", { id: "add-force", textContent: "+ Constant force", title: "A force that stays as this curve's grows", onclick: () => this.addForce(n) }));
    parts.push(this.group(`Load: ${curve.name}`, ...loads));
    project.forces.forEach((force, k) => {
      if (force.name === curve.force) return;
      const constant = (value) => {
        const { [force.name]: before, ...others } = this.store.project.curves[n].others;
        set(["curves", n, "others"], value ? { ...others, [force.name]: value } : others);
      };
      const fields = [this.number("constant [N]", curve.others[force.name] || 0, constant), ...this.force(k)];
      const used = project.curves.some((own) => own.force === force.name || force.name in own.others);
      if (!used) fields.push(element("button", { textContent: `Remove ${force.name}`, onclick: () => this.store.edit([{ kind: "remove", path: ["forces", k] }]) }));
      parts.push(this.group(force.name, ...fields));
    });
    const effect = (kind) => project.effects.findIndex((own) => own.kind === kind);
    const change = (kind, value) => {
      const k = effect(kind), changes = k >= 0 ? [{ kind: "remove", path: ["effects", k] }] : [];
      if (value) changes.push({ kind: "insert", path: ["effects", changes.length ? project.effects.length - 1 : project.effects.length], value });
      this.store.edit(changes);
    };
    const plane = this.select(["plane-stress", "plane-strain"], project.simulation.space, (space) => set(["simulation", "space"], space), (own) => own.replace("-", " "));
    parts.push(this.group("Springs", ...this.springs()));
    parts.push(this.group("Elements", this.row("model", plane), this.number("size [mm]", project.simulation.size, (value) => set(["simulation", "size"], value))));
    const weight = element("input", { type: "checkbox", checked: effect("gravity") >= 0,
      onchange: () => change("gravity", weight.checked && { kind: "gravity", acceleration: [0, -9810] }) });
    const warmer = effect("temperature") >= 0 ? project.effects[effect("temperature")].change : 0;
    parts.push(this.group("Effects", this.row("weight", weight),
      this.number("warmer by [K]", warmer, (value) => change("temperature", value && { kind: "temperature", change: value }))));
    const follow = element("input", { type: "checkbox", checked: project.fit, onchange: () => set(["fit"], follow.checked) });
    parts.push(this.group("Design", this.row("shape follows targets", follow),
      element("button", { textContent: "As drawn", title: "The shape before it followed its targets", onclick: () => set(["design"], null) })));
    const file = element("input", { type: "file", accept: ".json,application/json", hidden: true, id: "file", onchange: async () => {
      const most = this.store.most.bytes, larger = () => this.store.tell(`This file is larger than any project: ${most / 1e6} MB.`, true);
      try {
        const text = file.files[0].size > 20 * most ? null : JSON.stringify(JSON.parse(await file.files[0].text())); // saved with spaces
        if (text === null || new Blob([text]).size > 1.5 * most) larger();
        else this.store.send({ kind: "open", project: JSON.parse(text) });
      } catch { this.store.tell("This file is not JSON. Open one that was saved by the page.", true); }
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
    if (store.busy) { store.tell(`${label} comes when the shape has settled…`, false, true); await new Promise((go) => store.waiting.push(go)); }
    if (!["project", "script"].includes(what)) store.tell(`${label} is being made…`, false, true);
    const found = await fetch(`export/${what}`).catch(() => null);
    if (!found) store.tell("Not connected. Is the program still running?", true);
    if (!found || !found.ok) return; // the server tells why
    const name = (found.headers.get("Content-Disposition") || "").match(/filename="([^"]+)"/), link = element("a", { href: URL.createObjectURL(await found.blob()), download: name ? name[1] : what });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 60000);
    store.tell(`Saved ${link.download}.`);
  }

  // Material of a link: one of the known ones, or with numbers of its own.
  material(link, k) {
    const { materials, constants } = this.store, own = typeof link.material === "object", names = own ? [...materials, link.material.name] : [...materials, "numbers of its own…"];
    const set = (value) => this.store.edit([{ kind: "set", path: ["links", k, "material"], value }]);
    const choice = this.select(names, own ? link.material.name : link.material, (name) => {
      if (materials.includes(name)) set(name);
      else if (constants[link.material]) set({ name: `like ${link.material}`.slice(0, 60), ...constants[link.material] });
    });
    if (!own) return [this.row("material", choice)];
    const one = (name, text, scale = 1) => this.number(text, link.material[name] === null ? "" : Number((link.material[name] * scale).toPrecision(6)), (value) => set({ ...link.material, [name]: value / scale }));
    return [this.row("material", choice), one("E", "E [MPa]"), one("nu", "ν"), one("density", "density [g/cm³]", 1e9)];
  }

  // Where a force acts, and its direction.
  force(k) {
    const { forces, links } = this.store.project, force = forces[k], set = (name, value) => this.store.edit([{ kind: "set", path: ["forces", k, name], value }]);
    const on = this.select(links.map((own) => own.name), force.on, (name) => set("on", name));
    on.title = "The link on which it acts";
    const angle = Number((Math.atan2(force.direction[1], force.direction[0]) * 180 / Math.PI).toFixed(2));
    return [this.row("acts on", on), this.number("at x [mm]", force.at[0], (value) => set("at", [value, force.at[1]])), this.number("at y [mm]", force.at[1], (value) => set("at", [force.at[0], value])),
      this.number("direction [°]", angle, (value) => set("direction", [Math.cos(value * Math.PI / 180), Math.sin(value * Math.PI / 180)].map((part) => Number(part.toFixed(6)))))];
  }

  // Gives a curve another of the forces; one that nothing has any more is removed.
  useForce(n, name) {
    const { project } = this.store, { force, others } = project.curves[n], { [name]: constant, ...left } = others;
    const changes = [{ kind: "set", path: ["curves", n, "force"], value: name }, { kind: "set", path: ["curves", n, "others"], value: left }];
    this.store.edit([...changes, ...this.unused(force, n)]);
  }

  // The removal of a force that no curve but the n-th has.
  unused(force, n) {
    const { curves, forces } = this.store.project;
    if (curves.some((own, k) => k !== n && (own.force === force || force in own.others))) return [];
    return [{ kind: "remove", path: ["forces", forces.findIndex((own) => own.name === force)] }];
  }

  // A force at the place of a curve's, across it, a tenth as large.
  addForce(n) {
    const { forces, curves } = this.store.project, like = forces.find((own) => own.name === curves[n].force), name = this.store.fresh("force", forces);
    this.store.edit([{ kind: "insert", path: ["forces", forces.length], value: { ...like, name, direction: [-like.direction[1], like.direction[0]] } },
      { kind: "set", path: ["curves", n, "others"], value: { ...curves[n].others, [name]: Number((0.1 * Math.abs(curves[n].largest)).toPrecision(4)) } }]);
  }

  // The spring of one of the joints that turn or slide.
  springs() {
    const { joints, effects } = this.store.project, moving = joints.filter((own) => own.kind !== "weld");
    if (!moving.length) return [element("p", { className: "caption", textContent: "No joint turns or slides." })];
    this.joint = Math.min(this.joint, moving.length - 1);
    const joint = moving[this.joint], k = effects.findIndex((own) => own.kind === "joint spring" && own.joint === joint.name), now = k < 0 ? { stiffness: 0, rest: 0 } : effects[k];
    const chosen = this.select(moving.map((own) => own.name), joint.name, (name) => { this.joint = moving.findIndex((own) => own.name === name); this.key = ""; this.draw(); });
    const spring = (stiffness, rest) => {
      const value = { kind: "joint spring", joint: joint.name, stiffness, rest };
      if (stiffness === 0) { if (k >= 0) this.store.edit([{ kind: "remove", path: ["effects", k] }]); }
      else this.store.edit([k < 0 ? { kind: "insert", path: ["effects", effects.length], value } : { kind: "set", path: ["effects", k], value }]);
    };
    const [force, position] = joint.kind === "prismatic" ? ["N/mm", "mm"] : ["N mm", "rad"], fields = [this.row("joint", chosen), this.number(`stiffness [${force}]`, now.stiffness, (value) => spring(value, now.rest))];
    return k < 0 ? fields : [...fields, this.number(`relaxed at [${position}]`, now.rest, (value) => spring(now.stiffness, value))];
  }

  // A curve with its targets, and its force if nothing else has it.
  removeCurve(n) {
    const { project } = this.store, { force } = project.curves[n], changes = [];
    for (let k = project.targets.length - 1; k >= 0; k--) {
      const own = project.targets[k].curve;
      if (own === n) changes.push({ kind: "remove", path: ["targets", k] });
      else if (own > n) changes.push({ kind: "set", path: ["targets", k, "curve"], value: own - 1 });
    }
    this.store.edit([...changes, { kind: "remove", path: ["curves", n] }, ...this.unused(force, n)]);
  }

  group(name, ...children) { return element("fieldset", {}, element("legend", { textContent: name }), ...children); }

  row(name, field) { return element("label", {}, element("span", { textContent: name }), field); }

  select(values, chosen, change, text = (own) => own) {
    const made = element("select", { onchange: () => change(values[made.selectedIndex]) }, ...values.map((own) => element("option", { textContent: text(own), selected: own === chosen })));
    return made;
  }

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
