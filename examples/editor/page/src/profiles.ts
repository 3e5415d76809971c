// What each kind of profile uses, in words: one table for the panel and for the handles of the plot.

import type { Profile } from "./model";

export interface Use { gain?: string; offset?: string; width?: string; curve?: boolean; formula: string; word: string }

/** An expression that is 0 at d = 0 and far away, and greatest, 3 N, at 10 mm. */
export const smooth = "3*d/0.01*exp(0.5-(d/0.01)^2/2)";

/** The units of what a kind uses; what is absent is not used, and sent as 0. */
export const uses: Record<string, Use> = {
  none: { word: "none", formula: "no force" },
  constant: { word: "constant", formula: "gain", gain: "N" },
  linear_increasing: { word: "linear, increasing", formula: "gain·d + offset", gain: "N/m", offset: "N" },
  linear_decreasing: { word: "linear, decreasing", formula: "gain·d + offset", gain: "N/m", offset: "N" },
  gaussian: { word: "Gaussian", formula: "gain·exp(−(d/width)²/2)", gain: "N", width: "m" },
  quadratic: { word: "quadratic", formula: "gain·d² + offset", gain: "N/m²", offset: "N" },
  inverse: { word: "inverse", formula: "gain/d + offset", gain: "N m", offset: "N" },
  custom: { word: "custom curve", formula: "gain·f(d, t), 0 where that is below 0 or no number", gain: "×", curve: true },
};

/** What something new begins with: it draws the hand to itself, most strongly half-way out, and has no force where it is nor
 * beyond `reach` (m), so nothing jumps when it appears or when the hand comes. */
export const soft = (reach: number): Record<string, unknown> =>
  ({ kind: "custom", sense: "attractive", gain: 1, limit: 2, curve: { table: [0, 1, 1.5, 1, 0], step: reach / 4 } });

/** What a profile becomes when its kind is changed: what the new kind does not use is 0, and what it needs is there. */
export function ofKind(old: Profile, kind: string): Record<string, unknown> {
  const use = uses[kind]!;
  if (kind === "none") return { kind, sense: "attractive", gain: 0, offset: 0, width: 0, limit: 0, reach: 0, curve: null };
  const limit = old.limit > 0 ? old.limit : 5;
  const first: Record<string, number> = {
    constant: limit / 2, linear_increasing: 200, linear_decreasing: -200, gaussian: limit, quadratic: 2000, inverse: 0.02, custom: 1,
  };
  const keepsGain = old.kind !== "none" && uses[old.kind]?.gain === use.gain && kind !== "linear_decreasing" && old.kind !== "linear_decreasing";
  return {
    kind,
    gain: keepsGain ? old.gain : first[kind],
    offset: use.offset ? (kind === "linear_decreasing" && old.offset === 0 ? limit : old.offset) : 0,
    width: use.width ? old.width || 0.01 : 0,
    limit,
    curve: use.curve ? (old.curve ?? { expression: smooth }) : null,
  };
}

/** f(d) without the limit, for the handles; custom: null. */
export function raw(p: Profile, d: number): number | null {
  switch (p.kind) {
    case "constant": return p.gain;
    case "linear_increasing":
    case "linear_decreasing": return p.gain * d + p.offset;
    case "gaussian": return p.gain * Math.exp(-((d / p.width) ** 2) / 2);
    case "quadratic": return p.gain * d * d + p.offset;
    case "inverse": return p.gain / d + p.offset;
    default: return null;
  }
}

/** m: how far a plot of this profile should go. */
export function range(p: Profile): number {
  if (p.reach > 0) return p.reach * 1.25;
  switch (p.kind) {
    case "constant": return 0.1;
    case "gaussian": return p.width * 4;
    case "linear_increasing": return p.gain > 0 ? Math.min(1e6, Math.max(0.005, ((p.limit - p.offset) / p.gain) * 1.5)) : 0.1;
    case "linear_decreasing": return p.gain < 0 ? Math.max(0.005, (-p.offset / p.gain) * 1.25) : 0.1;
    case "quadratic": return p.gain > 0 ? Math.max(0.005, Math.sqrt(Math.max(0, p.limit - p.offset) / p.gain) * 1.5) : 0.1;
    case "inverse": return Math.max(0.005, (p.gain / p.limit) * 6);
    case "custom": return p.curve?.table ? (p.curve.table.length - 1) * (p.curve.step ?? 1) * 1.2 : 0.1;
    default: return 0;
  }
}
