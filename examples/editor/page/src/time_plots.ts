// What happens over time: the force on the hand, that of each client, and how well the servo keeps its time.

import uPlot from "uplot";
import { axis } from "./curve_plot";
import { make } from "./fields";
import { length } from "./frames";
import { type Model } from "./model";
import { onTheme, themed } from "./theme";

/** The last `most` rows of numbers, oldest first. */
class Ring {
  private data: Float64Array;
  private start = 0;
  count = 0;
  constructor(readonly width: number, private readonly most: number) { this.data = new Float64Array(width * 256); }
  push(row: ArrayLike<number>): void {
    const room = this.data.length / this.width;
    if (this.start + this.count === room) { // to the front, into more room if it is needed
      const next = this.count * 2 > room ? new Float64Array(Math.min(room * 2, this.most * 2 + 256) * this.width) : this.data;
      next.set(this.data.subarray(this.start * this.width, (this.start + this.count) * this.width));
      this.data = next;
      this.start = 0;
    }
    this.data.set(row, (this.start + this.count) * this.width);
    if (this.count === this.most) ++this.start;
    else ++this.count;
  }
  at(i: number, column: number): number { return this.data[(this.start + i) * this.width + column]!; }
  clear(): void { this.count = this.start = 0; }
  /** The first row that is not before this time. */
  find(time: number): number {
    let low = 0, high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.at(middle, 0) < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

const spans = [10, 30, 60, 300, 600]; // s
const perSecond = 1000; // forces, at most about
/** "of NAME": the force of one client, with its parts. */
export type Shown = "force" | "clients" | "servo" | `of ${string}`;

export class TimePlots {
  private plot: uPlot | null = null;
  private shown: Shown = "force";
  private span = 10;
  private pausedAt: number | null = null;
  private isDue = false;
  private still = "";
  private names: string[] = [];
  private readonly choice = make("select", { title: "What is plotted", id: "plot-what" });
  private readonly force = new Ring(4, 600 * perSecond + 1000); // time, x, y, z
  private readonly servo = new Ring(6, 1200); // time, rate, late p50, p99, max, compute p99
  private readonly clients = new Map<string, Ring>(); // time, x, y, z

  constructor(private readonly box: HTMLElement, bar: HTMLElement, private readonly model: Model) {
    this.offer();
    this.choice.onchange = () => { this.shown = this.choice.value as Shown; this.build(); };
    const span = make("select", { title: "How long", id: "plot-span" }, ...spans.map((s) => make("option", { value: String(s), textContent: s < 60 ? `${s} s` : `${s / 60} min` })));
    span.onchange = () => { this.span = Number(span.value); this.draw(); };
    const pause = make("button", { textContent: "Pause", id: "plot-pause" });
    pause.onclick = () => {
      this.pausedAt = this.pausedAt === null ? this.now : null;
      pause.textContent = this.pausedAt === null ? "Pause" : "Go on";
      pause.setAttribute("aria-pressed", String(this.pausedAt !== null));
      this.draw();
    };
    const save = make("button", { textContent: "CSV", title: "Download what is plotted", id: "plot-csv", onclick: () => this.download() });
    bar.append(this.choice, span, pause, save);
    model.on(["samples"], () => this.take());
    new ResizeObserver(() => this.plot?.setSize(this.size())).observe(box);
    onTheme(() => this.build());
    this.build();
  }

  private get now(): number { return this.force.count ? this.force.at(this.force.count - 1, 0) : 0; }
  private size(): { width: number; height: number } {
    return { width: Math.max(200, this.box.clientWidth), height: Math.max(90, this.box.clientHeight) };
  }

  /** What can be chosen: the clients come and go. */
  private offer(): void {
    const names = new Set([...this.model.clients.keys(), ...(this.shown.startsWith("of ") ? [this.shown.slice(3)] : [])]);
    const all = [["force", "Hand"], ["clients", "Clients"], ...[...names].map((name) => [`of ${name}`, name]), ["servo", "Servo"]];
    if (all.length === this.choice.options.length && all.every(([value], i) => this.choice.options[i]!.value === value)) return;
    this.choice.replaceChildren(...all.map(([value, textContent]) => make("option", { value, textContent })));
    this.choice.value = this.shown;
  }

  private connection = -1;
  private take(): void {
    const { model } = this, samples = model.newSamples, told = model.told;
    if (told.connection !== this.connection) {
      this.connection = told.connection;
      this.force.clear();
      this.servo.clear();
      this.clients.clear();
    }
    const time = told.time as number, last = this.now;
    for (let i = 0; i < samples.length; i += 4) { // after a line that was lost for a while some come again
      if (!this.force.count || samples[i]! > last) this.force.push(samples.subarray(i, i + 4));
    }
    this.offer();
    for (const client of model.clients.values()) {
      if (!this.clients.has(client.name)) this.clients.set(client.name, new Ring(4, 600 * 30));
      this.clients.get(client.name)!.push([time, ...this.model.forceOf(client)]);
    }
    const s = told.stats as Record<string, number | null>;
    if (s && (!this.servo.count || time - this.servo.at(this.servo.count - 1, 0) > 0.45)) {
      this.servo.push([time, s.rate ?? NaN, ...["late_p50", "late_p99", "late_max", "compute_p99"].map((name) => (s[name] ?? NaN) * 1e6)]);
    }
    if (this.pausedAt === null) this.later();
  }
  private later(): void {
    if (this.isDue || document.hidden) return;
    this.isDue = true;
    const step = (this.span * 1000) / 600; // ms, about that of a pixel
    setTimeout(() => { this.isDue = false; this.draw(); }, Math.min(Math.max(step, 80), 500));
  }

  private build(): void {
    this.plot?.destroy();
    this.still = "";
    // The lines are told apart by their dashes too.
    const dashes = [[], [8, 4], [2, 3], [10, 3, 2, 3], [5, 5], [1, 2], [14, 4]];
    const line = (label: string, stroke: string, dash = 0, width = 1.5, scale = "y"): uPlot.Series =>
      ({ label, stroke, width, scale, points: { show: false }, dash: dashes[dash % dashes.length]! });
    this.names = [...this.model.clients.keys()];
    const series = {
      force: [line("|F|", themed("ink"), 0, 2), line("x", themed("x"), 1), line("y", themed("y"), 2), line("z", themed("z"), 3)],
      clients: this.names.map((name, i) => line(name, `#${this.model.colourOf(name).toString(16).padStart(6, "0")}`, i, 2)),
      servo: [line("late p50", themed("rim"), 2), line("p99", themed("front")), line("max", themed("x"), 1), line("compute p99", themed("y"), 3), line("Hz", themed("back"), 4, 1.5, "hz")],
    };
    const isServo = this.shown === "servo";
    const axes: uPlot.Axis[] = [axis("s", 18), axis(isServo ? "µs" : "N", 42)];
    if (isServo) axes.push({ ...axis("Hz", 42), scale: "hz", side: 1, grid: { show: false } });
    this.plot = new uPlot({
      ...this.size(), axes, series: [{ label: "t" }, ...series[this.ring ? "force" : (this.shown as "clients" | "servo")]],
      scales: { x: { time: false, range: () => [-this.span, 0] }, y: { range: (_u, low, high) => padded(low, high, isServo) }, hz: { range: (_u, low, high) => padded(low, high, true) } },
      legend: { show: true, live: false }, cursor: { drag: { x: false, y: false }, points: { show: false } },
    }, [[0]] as unknown as uPlot.AlignedData, this.box);
    this.draw();
  }

  private draw(): void {
    if (!this.plot) return;
    if (this.shown === "clients" && this.names.join("|") !== [...this.model.clients.keys()].join("|")) return this.build();
    const data = this.data(Math.max(400, this.box.clientWidth));
    // Where nothing changes that could be seen, the picture stays.
    const still = data.slice(1).map(level);
    const same = still.includes(null) ? "" : `${this.shown} ${this.span} ${still.join()} ${Math.min(1, -(data[0]![0] ?? 0) / this.span).toFixed(2)}`;
    if (same && same === this.still) return;
    this.still = same;
    this.plot.setData(data as unknown as uPlot.AlignedData);
    this.box.dataset.points = String(data[0]!.length);
    this.box.dataset.span = String(this.span);
  }

  /** What is plotted with its parts: the force of all, or of one client. */
  private get ring(): Ring | null {
    if (this.shown.startsWith("of ")) return this.clients.get(this.shown.slice(3)) ?? new Ring(4, 1);
    return this.shown === "force" ? this.force : null;
  }

  /** Columns to plot, against the time before the last sample. Of many samples the highest and lowest of each pixel. */
  private data(pixels: number): (number | null)[][] {
    const end = this.pausedAt ?? this.now;
    const { ring } = this;
    if (ring) {
      const rows = thinned(ring, end - this.span, end, pixels);
      const at = (column: number) => rows.map((i) => ring.at(i, column));
      const [x, y, z] = [at(1), at(2), at(3)];
      return [at(0).map((t) => t - end), x.map((_, i) => Math.hypot(x[i]!, y[i]!, z[i]!)), x, y, z];
    }
    if (this.shown === "servo") {
      const rows = thinned(this.servo, end - this.span, end, pixels, (i) => this.servo.at(i, 4));
      const at = (column: number) => rows.map((i) => this.servo.at(i, column));
      return [at(0).map((t) => t - end), at(2), at(3), at(4), at(5), at(1)];
    }
    const rings = this.names.map((name) => this.clients.get(name)).filter((ring) => ring !== undefined);
    const longest = rings.reduce<Ring | null>((a, b) => (a && a.count >= b.count ? a : b), null);
    if (!longest) return [[], ...this.names.map(() => [])];
    const rows = thinned(longest, end - this.span, end, pixels);
    const times = rows.map((i) => longest.at(i, 0));
    const columns = this.names.map((name) => {
      const ring = this.clients.get(name);
      return times.map((t) => {
        const i = ring ? ring.find(t) : 0;
        return ring && i < ring.count && ring.at(i, 0) === t ? length([ring.at(i, 1), ring.at(i, 2), ring.at(i, 3)]) : null;
      });
    });
    return [times.map((t) => t - end), ...columns];
  }

  /** The samples themselves, not thinned. */
  csv(): string {
    const end = this.pausedAt ?? this.now, start = end - this.span;
    const lines: string[] = [];
    const add = (ring: Ring, prefix: string) => {
      for (let i = ring.find(start); i < ring.count && ring.at(i, 0) <= end; ++i) {
        lines.push(prefix + Array.from({ length: ring.width }, (_, c) => String(ring.at(i, c))).join(","));
      }
    };
    if (this.ring) { lines.push("time_s,x_N,y_N,z_N"); add(this.ring, ""); }
    else if (this.shown === "servo") { lines.push("time_s,rate_Hz,late_p50_us,late_p99_us,late_max_us,compute_p99_us"); add(this.servo, ""); }
    else {
      lines.push("client,time_s,x_N,y_N,z_N");
      for (const [name, ring] of this.clients) add(ring, `"${name.replace(/"/g, '""')}",`);
    }
    return lines.join("\n") + "\n";
  }
  private download(): void {
    const link = make("a", { href: URL.createObjectURL(new Blob([this.csv()], { type: "text/csv" })), download: `${this.shown.replace(/[^\w -]/g, "_")}.csv` });
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  }
}

/** What a column is all along, to a hundredth; null: it changes. */
function level(column: (number | null)[]): string | null {
  let low = Infinity, high = -Infinity;
  for (const x of column) if (x !== null) { low = Math.min(low, x); high = Math.max(high, x); }
  return high - low > 0.006 ? null : (Math.round(((low + high) / 2) * 100) / 100 || 0).toFixed(2);
}

/** The rows between two times; where there are more than two for each pixel, of those of a pixel the smallest and the
 * largest. sizeOf: what is compared; without it the force. */
function thinned(ring: Ring, start: number, end: number, pixels: number,
  sizeOf = (i: number) => Math.hypot(ring.at(i, 1), ring.at(i, 2), ring.at(i, 3))): number[] {
  const first = ring.find(start), last = ring.find(end + 1e-9), each = Math.ceil((last - first) / pixels);
  if (each <= 2) return Array.from({ length: last - first }, (_, i) => first + i);
  const rows: number[] = [];
  for (let i = first; i < last; i += each) {
    let low = i, high = i, least = Infinity, most = -Infinity;
    for (let j = i; j < Math.min(i + each, last); ++j) {
      const size = sizeOf(j);
      if (size < least) { least = size; low = j; }
      if (size > most) { most = size; high = j; }
    }
    rows.push(...(low === high ? [low] : low < high ? [low, high] : [high, low]));
  }
  return rows;
}

function padded(low: number | null, high: number | null, fromZero: boolean): [number, number] {
  if (low === null || high === null || !Number.isFinite(low) || !Number.isFinite(high)) return [0, 1];
  const least = fromZero ? 0 : Math.min(low, 0), room = Math.max(high - least, 0.1) * 0.08;
  return [least < 0 ? least - room : least, Math.max(high, least + 0.1) + room];
}
