// Targets on curves: a displacement that is wanted under a force, or a force where the curve holds displacements.

import { figure } from "./svg.js";

// Force and displacement of a target or a point of a curve, what is prescribed there first.
export const sampled = ({ held }, { force, displacement }) => held ? [displacement, force] : [force, displacement];

// The same back.
export const placed = ({ held }, given, wanted) => held ? { displacement: given, force: wanted } : { force: given, displacement: wanted };

// Units of what is prescribed, and of what is wanted.
export const units = ({ held }) => held ? ["mm", "N"] : ["N", "mm"];

export function words(curve, target) {
  const [given, wanted] = sampled(curve, target), [at, of] = units(curve);
  return `${figure(wanted, 4)} ${of} at ${figure(given)} ${at}`;
}

// Why a curve takes no targets; empty if it does.
export const untargeted = ({ ratios }) => ratios ? "Targets of forces that grow together are given in the script" : "";
