// The 3D view: links with their von Mises stress by WebGL, turned by pointer, wheel and keys. It shows what was solved
// in 3D; before that, the plane solution through the depth of each link.

import { dot } from "./algebra.js";
import { HEAT, order } from "./view.js";
import { drag, figure } from "./svg.js";

const VERTEX = `#version 300 es
in vec3 place; in float value; uniform mat3 turn; uniform vec3 centre; uniform vec2 scale; uniform float reach; out float v; out vec3 at;
void main() { v = value; at = turn * (place - centre); gl_Position = vec4(at.xy * scale, -at.z / reach, 1.0); }`;
const FRAGMENT = `#version 300 es
precision highp float;
in float v; in vec3 at; uniform vec3 heat[${HEAT.length}]; uniform vec3 rigid; uniform float top; out vec4 colour;
void main() {
  vec3 normal = normalize(cross(dFdx(at), dFdy(at)));
  float light = 0.62 + 0.38 * abs(dot(normal, normalize(vec3(-0.3, 0.5, 0.8))));
  float t = clamp(v / top, 0.0, 1.0) * float(${HEAT.length - 1});
  int k = min(int(t), ${HEAT.length - 2});
  colour = vec4(light * (v < 0.0 ? rigid : mix(heat[k], heat[k + 1], t - float(k))), 1.0);
}`;

const rgb = (text) => [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

// Points, values (below zero: rigid) and triangles, gathered part by part.
class Body {
  constructor() { this.places = []; this.values = []; this.triangles = []; }

  get size() { return this.values.length; }

  add(x, y, z, value) { this.places.push(x, y, z); this.values.push(value); return this.size - 1; }

  // A planar part through a depth: both faces, and the sides along its closed loops.
  extrude(points, values, triangles, loops, depth) {
    const [upper, lower] = [depth / 2, -depth / 2].map((z) => {
      const first = this.size;
      points.forEach(([x, y], k) => this.add(x, y, z, values ? values[k] : -1));
      return first;
    });
    for (const [a, b, c] of triangles) this.triangles.push(upper + a, upper + b, upper + c, lower + a, lower + c, lower + b);
    for (const loop of loops) loop.forEach((a, k) => {
      const b = loop[(k + 1) % loop.length];
      this.triangles.push(upper + a, lower + a, lower + b, upper + a, lower + b, upper + b);
    });
  }

  // A rigid link: a plate around its points.
  plate(points, width, depth) {
    const around = [...Array(12).keys()].map((k) => [Math.cos(Math.PI * k / 6), Math.sin(Math.PI * k / 6)]);
    const rim = order(points.flatMap(([x, y]) => around.map(([c, s]) => [x + width / 2 * c, y + width / 2 * s])));
    const fan = rim.slice(2).map((_, k) => [0, k + 1, k + 2]);
    this.extrude(rim, null, fan, [rim.map((_, k) => k)], depth);
  }
}

export class Solid {
  constructor(root, store, view) {
    this.root = root; this.store = store; this.view = view;
    this.canvas = root.querySelector("canvas"); this.mark = root.querySelector("#peak");
    this.home();
    this.gl = this.canvas.getContext("webgl2", { antialias: true });
    if (this.gl) this.prepare(this.gl);
    this.canvas.addEventListener("webglcontextlost", (event) => event.preventDefault()); // it may come back
    this.canvas.addEventListener("webglcontextrestored", () => { this.prepare(this.gl); this.draw(); });
    this.gestures();
    new ResizeObserver(() => this.draw()).observe(root);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.draw());
  }

  home() { this.yaw = -0.6; this.pitch = 0.45; this.zoom = 1; }

  prepare(gl) {
    const program = this.program = gl.createProgram();
    for (const [kind, text] of [[gl.VERTEX_SHADER, VERTEX], [gl.FRAGMENT_SHADER, FRAGMENT]]) {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, text);
      gl.compileShader(shader);
      gl.attachShader(program, shader);
    }
    gl.linkProgram(program);
    if (!gl.getProgramParameter(program, gl.LINK_STATUS)) throw new Error(gl.getProgramInfoLog(program));
    gl.useProgram(program);
    gl.enable(gl.DEPTH_TEST);
    this.buffers = { place: gl.createBuffer(), value: gl.createBuffer(), index: gl.createBuffer() };
    gl.uniform3fv(this.uniform("heat"), HEAT.flatMap(rgb));
  }

  uniform(name) { return this.gl.getUniformLocation(this.program, name); }

  gestures() {
    const { root } = this;
    let start = null;
    drag(this.canvas, {
      begin: (event) => { start = [event.clientX, event.clientY, this.yaw, this.pitch]; this.canvas.focus(); return true; },
      move: (event) => this.turn(start[2] + 0.01 * (event.clientX - start[0]), start[3] + 0.01 * (event.clientY - start[1])),
      end: () => {},
    });
    root.addEventListener("wheel", (event) => { event.preventDefault(); this.closer(Math.exp(-0.0015 * event.deltaY)); }, { passive: false });
    for (const [id, factor] of [["closer", 1.25], ["farther", 0.8]]) root.querySelector(`#${id}`).onclick = () => this.closer(factor);
    this.canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
      if (by) this.turn(this.yaw + by[0], this.pitch + by[1]);
      else if (event.key === "+" || event.key === "=") this.closer(1.25);
      else if (event.key === "-") this.closer(0.8);
      else if (event.key === "Home") { this.home(); this.draw(); }
      else return;
      event.preventDefault();
    });
  }

  turn(yaw, pitch) { this.yaw = yaw; this.pitch = Math.min(Math.max(pitch, -1.57), 1.57); this.draw(); }

  closer(factor) { this.zoom = Math.min(Math.max(this.zoom * factor, 0.3), 12); this.draw(); }

  // What was solved in 3D for the shown curve, unpacked; null if nothing, or of another mechanism.
  solved() {
    const { solid, shown, project, mesh } = this.store;
    if (!solid || solid.curve !== shown || !solid.points.length || solid.project.name !== project.name || solid.points[0].rigid.length !== mesh.rigid.length) return null;
    if (!solid.unpacked) {
      solid.unpacked = { triangles: new Uint32Array(bytes(solid.triangles)),
        frames: solid.points.map((point) => ({ ...point, places: new Float32Array(bytes(point.places)), values: new Float32Array(bytes(point.von_mises)) })) };
    }
    return solid.unpacked;
  }

  depths() { return this.store.project.links.filter((link) => link.kind === "flexible").map((link) => link.shape.depth); }

  // The body in the present state, with its peak {value, error, at}.
  body() {
    const { store } = this, body = new Body(), found = this.solved(), mesh = found ? store.mesh : store.drawnMesh();
    const depths = this.depths(), plate = 0.3 * Math.max(...depths);
    if (!found) {
      const state = this.view.state();
      if (!state || state.nodes.length !== mesh.flexible.length) return null;
      let peak = { value: -1 };
      mesh.flexible.forEach((link, k) => {
        body.extrude(state.nodes[k], state.von_mises[k], link.triangles, link.loops, depths[k]);
        state.von_mises[k].forEach((value, j) => { if (value > peak.value) peak = { value, at: [...state.nodes[k][j], depths[k] / 2] }; });
      });
      state.rigid.forEach((points) => points.length && body.plate(points, 0.94 * mesh.width, plate));
      return { body, peak, top: store.stressTop, state };
    }
    const at = store.load * (found.frames.length - 1), k = Math.min(Math.floor(at), found.frames.length - 1), t = at - k;
    const a = found.frames[k], b = found.frames[Math.min(k + 1, found.frames.length - 1)];
    const mix = (p, q) => p + t * (q - p);
    for (let n = 0; n < a.values.length; n++) {
      body.add(mix(a.places[3 * n], b.places[3 * n]), mix(a.places[3 * n + 1], b.places[3 * n + 1]), mix(a.places[3 * n + 2], b.places[3 * n + 2]), mix(a.values[n], b.values[n]));
    }
    for (const corner of found.triangles) body.triangles.push(corner);
    a.rigid.forEach((points, own) => points.length && body.plate(points.map((p, j) => [mix(p[0], b.rigid[own][j][0]), mix(p[1], b.rigid[own][j][1])]), 0.94 * mesh.width, plate)); // clear of pins
    const { point, error } = (t < 0.5 ? a : b).peak;
    const peak = { value: mix(a.peak.value, b.peak.value), error, at: body.places.slice(3 * point, 3 * point + 3) };
    return { body, peak, top: Math.max(...found.frames.map((own) => own.peak.value), 1e-9), state: { force: mix(a.force, b.force), displacement: mix(a.displacement, b.displacement) } };
  }

  draw() {
    const { store, gl } = this;
    if (store.mode !== "solid" || !store.mesh || !this.view.reach) return;
    this.root.classList.toggle("without", !gl);
    if (!gl || gl.isContextLost()) return;
    const found = this.body();
    if (!found) return;
    const { body, peak } = found, box = this.canvas.getBoundingClientRect(), ratio = devicePixelRatio || 1;
    if (!box.width || !box.height) return;
    [this.canvas.width, this.canvas.height] = [box.width * ratio, box.height * ratio].map(Math.round);
    this.now = found.state;
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(0, 0, 0, 0);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    for (const [name, values, width] of [["place", body.places, 3], ["value", body.values, 1]]) {
      const where = gl.getAttribLocation(this.program, name);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[name]);
      gl.bufferData(gl.ARRAY_BUFFER, new Float32Array(values), gl.DYNAMIC_DRAW);
      gl.enableVertexAttribArray(where);
      gl.vertexAttribPointer(where, width, gl.FLOAT, false, 0, 0);
    }
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers.index);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, new Uint32Array(body.triangles), gl.DYNAMIC_DRAW);
    const { centre, radius } = this.view.extent();
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    const turn = [[cy, 0, sy], [sp * sy, cp, -sp * cy], [-cp * sy, sp, cp * cy]]; // rows: across, up, towards the eye
    const scale = [box.height / box.width, box.width / box.height].map((own) => this.zoom / radius * Math.min(1, own));
    gl.uniformMatrix3fv(this.uniform("turn"), true, turn.flat());
    gl.uniform2fv(this.uniform("scale"), scale);
    gl.uniform1f(this.uniform("reach"), 4 * radius + Math.max(...this.depths()));
    gl.uniform3f(this.uniform("centre"), ...centre, 0);
    gl.uniform3fv(this.uniform("rigid"), rgb(getComputedStyle(document.documentElement).getPropertyValue("--plate").trim()));
    gl.uniform1f(this.uniform("top"), found.top);
    gl.drawElements(gl.TRIANGLES, body.triangles.length, gl.UNSIGNED_INT, 0);
    this.drawn = body.triangles.length / 3;
    document.getElementById("scale-high").textContent = `${figure(found.top)} MPa`;
    const away = peak.at.map((own, k) => own - [...centre, 0][k]), place = scale.map((own, a) => own * dot(turn[a], away));
    const across = (1 + place[0]) / 2 * box.width;
    this.mark.style.left = `${across}px`;
    this.mark.style.top = `${(1 - place[1]) / 2 * box.height}px`;
    this.mark.classList.toggle("left", across > 0.6 * box.width);
    this.mark.hidden = !(peak.value > 0);
    this.mark.textContent = `peak ${figure(peak.value)}${peak.error ? ` ± ${figure(peak.error, 1)}` : ""} MPa`;
  }
}
