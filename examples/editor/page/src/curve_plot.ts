// f(d) of what is selected, front and back, with the hand's distance on it. Its dots can be dragged.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { make, put, shown } from "./fields";
import { type Item, type Model, type Profile } from "./model";
import { Latest, type Orders, newGesture } from "./orders";
import { range, raw, uses } from "./profiles";
import { onTheme, themed } from "./theme";

type Side = "front" | "back";
interface Handle { side: Side; name: "limit" | "reach" | "gain" | "width"; d: number; f: number }
interface Answer { distances: number[]; t: number; steepest: number | null; front: number[]; back: number[]; front_capped: number[] | null; back_capped: number[] | null }

export class CurvePlot {
  private readonly plot: uPlot; // not there yet while it draws itself for the first time
  private readonly dots = make("div", { className: "dots" });
  private readonly marker = make("div", { className: "marker", title: "the hand" });
  private readonly note = make("p", { className: "hint" });
  private readonly capped = document.querySelector<HTMLElement>("#capped")!;
  private answer: Answer | null = null;
  private item: Item | null = null;
  private until = 0.1;
  private dragged: Handle | null = null;
  private gesture = "";
  private isAsking = false;
  private isStale = false;
  private applied = 0; // N/m, with which the curve was asked for
  private readonly changes: Latest<{ name: string; fields: Record<string, unknown>; gesture: string }>;

  constructor(private readonly box: HTMLElement, private readonly model: Model, private readonly orders: Orders) {
    const line = (label: string, colour: string, dash: number[] = []): uPlot.Series =>
      ({ label, stroke: () => themed(colour), width: 2, dash, points: { show: false } });
    this.plot = new uPlot({
      ...this.size(), legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false, range: () => [0, this.until] }, y: { range: () => this.yRange() } },
      axes: [axis("d, m", 18), axis("f, N", 40)],
      series: [{}, line("front", "front"), line("back", "back"), line("front, capped", "front"), line("back, capped", "back"), line("solid", "solid", [6, 4])],
      hooks: { draw: [() => { this.place(); this.mark(); }] },
    }, [[0], [null], [null], [null], [null], [null]], box);
    this.plot.over.append(this.marker, this.dots);
    box.append(this.note);
    this.changes = new Latest(({ name, fields, gesture }) => orders.change([name], fields, gesture), (why) => orders.onNotice(why.text, true));
    model.on(["selection", "objects"], () => this.ask());
    model.on(["rows"], () => {
      this.mark();
      const now = this.item?.applied ?? 0;
      if (Math.abs(now - this.applied) > 0.01 * this.applied) void this.ask();
    });
    setInterval(() => { if (this.item && this.movesInTime(this.item)) this.ask(); }, 250);
    new ResizeObserver(() => this.plot.setSize(this.size())).observe(box);
    onTheme(() => this.plot.redraw());
    this.ask();
  }

  private size(): { width: number; height: number } {
    return { width: Math.max(160, this.box.clientWidth), height: Math.max(90, this.box.clientHeight) };
  }
  private sides(item: Item): Side[] {
    return item.told.primitive === "plane" || item.told.primitive === "mesh" ? ["front", "back"] : ["front"];
  }
  /** What is drawn, for the tests. */
  get drawn(): Answer | null { return this.answer; }
  private movesInTime(item: Item): boolean {
    return this.sides(item).some((side) => /\bt\b/.test(item.told[side].curve?.expression ?? ""));
  }
  private top = 1;
  private yRange(): [number, number] {
    if (this.dragged) return [0, this.top];
    let top = 0;
    if (this.item) for (const side of this.sides(this.item)) if (this.item.told[side].kind !== "none") top = Math.max(top, this.item.told[side].limit);
    const drawn = [this.answer?.front, this.answer?.back, this.solid].map((each) => each ?? []);
    for (const each of drawn) top = Math.max(top, ...each);
    // A limit far above the curve would flatten it.
    const highest = Math.max(0, ...drawn.flat());
    if (highest > 0 && top > 4 * highest) top = highest * 1.6;
    this.top = top > 0 ? top * 1.15 : 1;
    return [0, this.top];
  }

  /** Asks for the curve. While an answer is on its way nothing is asked; one question follows it. */
  private async ask(): Promise<void> {
    const item = this.model.selection[0] ?? null;
    if (item !== this.item) this.answer = null;
    this.item = item;
    const isFelt = item !== null && (item.told.contact.keep !== "none" || this.sides(item).some((side) => item.told[side].kind !== "none"));
    put(this.note, item ? "It has no force profile: there is no force to plot." : "The curve f(d) of the object that is selected.");
    this.note.hidden = isFelt;
    for (const key of ["front", "back", "solid"] as const) {
      const isThere = isFelt && (key === "solid" ? item.told.contact.keep !== "none" : this.sides(item).includes(key) && item.told[key].kind !== "none");
      document.querySelector<HTMLElement>(`.plot-bar .key.${key}`)!.hidden = !isThere;
    }
    if (!item) { this.answer = null; this.show(); return; }
    if (this.isAsking) { this.isStale = true; return; }
    this.isAsking = true;
    this.applied = item.applied;
    if (!this.dragged) this.until = Math.max(...this.sides(item).map((side) => range(item.told[side])), this.solidRange(item), 1e-4) || 0.1;
    let answer: Answer | null = null;
    try {
      answer = await this.orders.wire.send("curve", { name: item.told.name, until: this.until });
    } catch { /* it has gone */ }
    this.isAsking = false;
    if (item === this.item) { // else something else was selected meanwhile
      this.answer = answer;
      this.show();
    }
    if (this.isStale) { this.isStale = false; void this.ask(); }
  }

  private show(): void {
    const a = this.answer, { item } = this;
    const curve = (side: Side, values: number[] | null | undefined) =>
      a && item && values && this.sides(item).includes(side) && item.told[side].kind !== "none" ? values : a ? a.distances.map(() => null) : [null];
    for (const i of [1, 2]) this.plot.series[i]!.alpha = a?.steepest ? 0.35 : 1; // what is wanted is paler than what is felt
    this.plot.setData([a?.distances ?? [0], curve("front", a?.front), curve("back", a?.back), curve("front", a?.front_capped),
      curve("back", a?.back_capped), this.solid ?? (a ? a.distances.map(() => null) : [null])]);
    this.capped.hidden = !a?.steepest;
    if (a?.steepest) put(this.capped, `slope limited to ${Number(a.steepest.toPrecision(3))} N/m`);
    this.box.dataset.curve = item?.told.name ?? "";
    this.box.dataset.capped = String(a?.steepest ?? "");
  }

  // ---- The spring of a solid object

  /** N/m of its client's scene, of a point of the tool; 0: it is not solid. */
  private stiffness(item: Item): number {
    const { contact, tool_points } = item.told, { scale, force_scale } = item.frame, all = item.client?.points.length ?? 1;
    if (contact.keep === "none") return 0;
    const points = tool_points ? Array.from({ length: all }, (_, i) => Math.floor(tool_points / 2 ** i) % 2).reduce((a, b) => a + b, 0) : all;
    const most = item.applied / (scale * force_scale * (points || 1)); // what is applied is at the device, of all points
    return Number.isFinite(most) && most > 0 ? Math.min(contact.stiffness || Infinity, most) : contact.stiffness || 1000;
  }
  private solidRange(item: Item): number {
    const stiffness = this.stiffness(item);
    return stiffness > 0 ? (1.5 * item.told.contact.limit) / stiffness : 0;
  }
  /** N, at each of the distances; null: it is not solid. */
  private get solid(): number[] | null {
    const { item, answer } = this, stiffness = item ? this.stiffness(item) : 0;
    return answer && stiffness > 0 ? answer.distances.map((d) => Math.min(stiffness * d, item!.told.contact.limit)) : null;
  }

  private mark(): void {
    if (!this.plot) return;
    const d = this.item ? this.item.deviceDistance * this.item.frame.scale : Infinity; // m of its client's scene, as the curve
    this.marker.hidden = !(d <= this.until);
    if (d <= this.until) this.marker.style.left = `${this.plot.valToPos(d, "x")}px`;
  }

  // ---- Handles

  private handles(item: Item): Handle[] {
    const found: Handle[] = [];
    for (const side of this.sides(item)) {
      const p = item.told[side];
      if (p.kind === "none") continue;
      found.push({ side, name: "limit", d: this.until * (side === "front" ? 0.98 : 0.94), f: p.limit });
      found.push({ side, name: "reach", d: p.reach > 0 ? p.reach : this.until * (side === "front" ? 0.995 : 0.955), f: 0 });
      if (p.kind === "gaussian") found.push({ side, name: "width", d: p.width, f: p.gain * Math.exp(-0.5) });
      const d = this.gainPlace(p), f = raw(p, d);
      if (f !== null) found.push({ side, name: "gain", d, f });
    }
    return found;
  }
  /** m: where the dot of the gain is on the curve. */
  private gainPlace(p: Profile): number {
    if (p.kind === "constant") return this.until * 0.3;
    if (p.kind === "gaussian") return 0;
    if (p.kind === "linear_increasing" && p.gain > 0) return Math.min(this.until / 2, Math.max(0, (p.limit * 0.7 - p.offset) / p.gain));
    if (p.kind === "quadratic" && p.gain > 0) return Math.min(this.until / 2, Math.sqrt(Math.max(0, p.limit * 0.7 - p.offset) / p.gain));
    return this.until / 3;
  }

  private place(): void {
    const { item } = this;
    if (this.dragged || !this.plot) return;
    this.dots.replaceChildren();
    if (!item || item.isLocked || this.model.selected.size !== 1) return;
    for (const handle of this.handles(item)) {
      const dot = make("button", { className: `dot ${handle.name}`, title: `${handle.side}: ${handle.name}` });
      dot.dataset.handle = `${handle.side}.${handle.name}`;
      dot.style.setProperty("--c", `var(--${handle.side})`);
      this.put(dot, handle.d, handle.f);
      dot.onpointerdown = (event) => {
        event.preventDefault();
        dot.setPointerCapture(event.pointerId);
        this.dragged = handle;
        this.gesture = newGesture();
      };
      dot.onpointermove = (event) => { if (this.dragged === handle) this.drag(handle, item, event, dot); };
      dot.onpointerup = dot.onlostpointercapture = () => {
        if (this.dragged !== handle) return;
        this.dragged = null;
        void this.ask();
      };
      this.dots.append(dot);
    }
  }
  private put(dot: HTMLElement, d: number, f: number): void {
    const height = this.plot.over.clientHeight;
    dot.style.left = `${this.plot.valToPos(d, "x")}px`;
    dot.style.top = `${Math.max(0, Math.min(height, this.plot.valToPos(f, "y")))}px`;
  }

  private drag(handle: Handle, item: Item, event: PointerEvent, dot: HTMLElement): void {
    const box = this.plot.over.getBoundingClientRect();
    const d = Math.max(0, this.plot.posToVal(event.clientX - box.left, "x"));
    const f = Math.max(0, this.plot.posToVal(event.clientY - box.top, "y"));
    const p = item.told[handle.side];
    let value: number, at: [number, number] = [handle.d, f];
    if (handle.name === "limit") value = Math.max(f, this.top * 1e-3);
    else if (handle.name === "reach") { value = d; at = [d, 0]; }
    else if (handle.name === "width") { value = Math.max(d, this.until * 1e-3); at = [value, p.gain * Math.exp(-0.5)]; }
    else value = gainFor(p, handle.d, f);
    if (!Number.isFinite(value)) return;
    this.put(dot, ...at);
    const field = handle.name;
    dot.title = `${handle.side}: ${field} ${shown(Number(value.toPrecision(4)))} ${field === "limit" ? "N" : field === "gain" ? uses[p.kind]!.gain : "m"}`;
    const fields = { [`${handle.side}.${field}`]: Number(value.toPrecision(4)) };
    void this.changes.put({ name: item.told.name, fields, gesture: this.gesture });
  }
}

/** The gain with which the curve passes through f at d. */
function gainFor(p: Profile, d: number, f: number): number {
  switch (p.kind) {
    case "linear_increasing": return Math.max(0, (f - p.offset) / d);
    case "linear_decreasing": return Math.min(0, (f - p.offset) / d);
    case "quadratic": return (f - p.offset) / (d * d);
    case "inverse": return Math.max(0, (f - p.offset) * d);
    default: return f;
  }
}

export function axis(label: string, size = 30): uPlot.Axis {
  return {
    label, labelSize: 14, size, gap: 3, labelGap: 0, font: "11px system-ui, sans-serif", labelFont: "11px system-ui, sans-serif",
    stroke: () => themed("soft"), grid: { stroke: () => themed("hair"), width: 1 }, ticks: { show: false },
    values: (_plot, values) => values.map((value) => shown(Number(value.toPrecision(6)))),
  };
}
