// Small helpers for SVG.

const NS = "http://www.w3.org/2000/svg";

// An element with attributes and children.
export function make(name, attributes = {}, ...children) {
  const element = document.createElementNS(NS, name);
  set(element, attributes);
  element.append(...children);
  return element;
}

export function set(element, attributes) {
  for (const [key, value] of Object.entries(attributes)) {
    if (value === null) element.removeAttribute(key); else element.setAttribute(key, value);
  }
  return element;
}

// The path through points, closed or not.
export const path = (points, closed = false) =>
  points.length ? `M${points.map((p) => `${p[0].toFixed(2)} ${p[1].toFixed(2)}`).join("L")}${closed ? "Z" : ""}` : "";

// Round values between low and high, about `count` of them.
export function ticks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const unit = [1, 2, 5, 10].map((f) => f * power).find((own) => own >= raw * 0.999);
  const found = [];
  for (let k = Math.ceil(low / unit - 1e-9); k * unit <= high + 1e-9 * unit; k++) found.push(k * unit);
  return found;
}

export const figure = (value, digits = 3) => String(Number(value.toPrecision(digits)));

// Follows a pointer from its press on `element` to its release; `begin` returns whether the gesture starts. Escape ends
// it as a cancelled one, and so does the removal of the element.
export function drag(element, { begin, move, end }) {
  let held = null;
  element.addEventListener("pointerdown", (event) => {
    if (held !== null || event.button > 0 || !begin(event)) return;
    held = event.pointerId;
    for (const [name, listener] of Object.entries(listeners)) window.addEventListener(name, listener);
    element.setPointerCapture(held);
    event.preventDefault();
    event.stopPropagation();
  });
  const finish = (event, cancelled) => {
    held = null;
    for (const [name, listener] of Object.entries(listeners)) window.removeEventListener(name, listener);
    end(event, cancelled);
  };
  const mine = (listener) => (event) => { if (event.pointerId === held) listener(event); };
  const listeners = { // of the window: browsers may take the capture away, and no element hears of its own removal
    pointermove: mine(move),
    pointerup: mine((event) => finish(event, false)),
    pointercancel: mine((event) => finish(event, true)),
    lostpointercapture: mine((event) => { if (!element.isConnected) finish(event, true); }),
    keydown: (event) => { if (event.key === "Escape") finish(event, true); },
  };
}
