// What the page does not edit: what is required beside the targets on curves with the values reached, and in words the
// effects and numbers that a script has brought along.

import { figure } from "./svg.js";

export function listCarried(list, project, values) {
  const item = (text) => Object.assign(document.createElement("li"), { textContent: text });
  const reached = (k) => values[k] ? `: reached ${values[k].map((own) => figure(own, 4)).join(", ")}` : "";
  list.replaceChildren(
    ...(project.requirements || []).map((own, k) => item(`${own.name}${reached(k)}`)),
    ...(project.numbers || []).map((own) => item(`Changes too: ${own.name}`)),
    ...project.effects.filter((own) => own.kind === "carried").map((own) => item(`Effect: ${own.text}`)),
    ...project.effects.filter((own) => own.kind === "joint spring").map((own) => item(`Effect: spring in ${own.joint}`)),
  );
}
