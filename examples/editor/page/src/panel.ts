// The fields of what is selected. All of fs_object can be changed here; what a kind does not use is not there.

import { fromDegrees, length, toDegrees } from "./frames";
import { type AnyField, AreaField, CheckField, ChoiceField, type Send, TextField, make, numberField, over, parse, put, shown } from "./fields";
import { type Item, type Model, type Profile, type Surface, newtons } from "./model";
import type { Fields, Orders } from "./orders";
import { ofKind, smooth, uses } from "./profiles";
import { askForMesh } from "./dialogs";
import type { Refusal } from "./wire";

const primitives: [string, string][] = [["point", "point"], ["polyline", "polyline"], ["plane", "plane"], ["mesh", "mesh"]];
const senses: [string, string][] = [["attractive", "attractive (to it)"], ["repulsive", "repulsive (away)"]];
const keeps: [string, string][] = [
  ["none", "not solid"], ["front", "front: an obstacle"], ["back", "back: an envelope"], ["either", "either: a sheet"],
];
const impacts: [string, string][] = [
  ["none", "none"], ["soft", "soft: rubber"], ["medium", "medium: wood"], ["hard", "hard: metal"], ["own", "figures of your own"],
];

interface Twist { linear: number[]; angular: number[] }

export class Panel {
  private isDue = false;
  private items: Item[] = []; // the selection, as it is shown
  private readonly title = make("span", { className: "name", dir: "auto" });
  private readonly padlock = make("span", { className: "padlock", title: "It can be looked at, not changed" });
  private readonly condition = make("span");
  private readonly what = make("span");
  private readonly facts = make("p", { className: "facts" }, this.condition, this.what);
  private readonly live = make("p", { className: "facts live" });
  private readonly adopt = make("button", { textContent: "Copy into my scene", id: "adopt" });
  private readonly hint = make("p", { className: "hint",
    textContent: "Nothing is selected. Click an object in the view or in the table; Point, Polyline, Plane or Mesh makes one." });
  private readonly head = make("header");
  private readonly body = make("div", { className: "sections" });
  private readonly replace = make("button", { textContent: "Another mesh from a file …", id: "replace-mesh" });
  private twist: Twist | null = null; // of the selection; null: not known yet
  private readonly twists = make("div");
  private blamed: AnyField | null = null; // the field that the last change was refused for, if it was not its own
  private isAsking = false;
  private chosen = "";
  private readonly fields: { field: AnyField; update: () => void }[] = [];
  private readonly points = make("div", { className: "tool-points" });
  private readonly units: (() => void)[] = [];
  private readonly formulas = new Map<string, HTMLElement>();
  private readonly sections = new Map<string, HTMLElement>();

  constructor(private readonly box: HTMLElement, private readonly model: Model, private readonly orders: Orders) {
    box.append(this.head, this.body);
    this.makePose();
    this.makeProfile("front");
    this.makeProfile("back");
    this.makeContact();
    this.makeOther();
    model.on(["selection"], () => {
      const chosen = [...model.selected].join();
      if (chosen !== this.chosen) {
        for (const { field } of this.fields) field.forget();
        this.twist = this.blamed = null;
      }
      this.chosen = chosen;
      this.update();
      void this.askTwist();
    });
    model.on(["objects"], () => { this.update(); void this.askTwist(); });
    model.on(["rows", "state"], () => this.later());
    this.adopt.onclick = () => { const item = this.first(); if (item) void orders.adopt(item.told.name); };
    this.padlock.textContent = "🔒";
    this.head.append(make("h2", {}, this.title, this.padlock), this.facts, this.live, this.adopt, this.hint);
    this.update();
  }

  /** What moves is shown ten times a second. */
  private later(): void {
    if (this.isDue) return;
    this.isDue = true;
    setTimeout(() => { this.isDue = false; this.update(); void this.askTwist(); }, 100);
  }

  /** How the selection moves: that is not in the states, as nothing but this panel needs it. */
  private async askTwist(): Promise<void> {
    const item = this.first();
    if (!item || this.isAsking || this.model.selected.size > 1) return;
    this.isAsking = true;
    try {
      const twist = await this.orders.wire.send("twist", { name: item.told.name }) as Twist;
      if (item === this.first() && JSON.stringify(twist) !== JSON.stringify(this.twist)) { this.twist = twist; this.update(); }
    } catch { /* it has gone */ }
    this.isAsking = false;
    if (item !== this.first()) void this.askTwist();
  }

  // ---- Sending

  private readonly send: Send = (path, value, gesture) => this.sendAll({ [path]: value }, path, gesture);

  /** What each of the selected objects is to get, by what it has. */
  private sendEach(of: (item: Item) => Fields, path: string, gesture?: string): Promise<void> {
    return this.sendAll(this.unlocked.map(of), path, gesture);
  }
  /** Those of the selection that can be changed. */
  private get unlocked(): Item[] { return this.model.selection.filter((item) => !item.isLocked); }

  /** fields: the same for all, or a list with those of each. */
  private async sendAll(fields: Fields | Fields[], path: string, gesture?: string): Promise<void> {
    const { chosen } = this;
    try {
      await this.orders.change(this.unlocked.map((item) => item.told.name), fields, gesture);
      if (chosen === this.chosen) this.blamed?.refuse("");
    } catch (refused) {
      const why = refused as Refusal;
      if (chosen !== this.chosen) throw why; // its fields show other objects by now
      // The library may refuse the object for another field than the one that was changed: the sentence goes there.
      const other = this.fields.find(({ field }) => field.isShown && field.path !== path && named(why.field, field.path));
      if (other && !named(why.field, path)) {
        other.field.refuse(why.text);
        this.blamed = other.field;
        throw { ...why, text: `not taken: see “${other.field.name}”` };
      }
      throw why;
    }
  }

  // ---- Sections

  private section(title: string, key: string): HTMLElement {
    const inside = make("div");
    const section = make("details", { open: true }, make("summary", { textContent: title }), inside);
    section.dataset.section = key;
    this.body.append(section);
    this.sections.set(key, section);
    return inside;
  }
  /** of: what it shows of an object; where the selected ones differ it is empty. isUsed: whether it is there. */
  private add<V>(to: HTMLElement, field: AnyField & { show: (value: V | null) => void }, of: (item: Item) => V, isUsed = () => true): void {
    to.append(field.row);
    const update = () => {
      field.isShown = isUsed();
      if (field.isShown) field.show(this.same(of));
    };
    this.fields.push({ field, update });
  }

  private makePose(): void {
    const box = this.section("Pose", "pose");
    const place = make("div", { className: "triple" }), turns = make("div", { className: "triple" }), quat = make("div", { className: "quad" });
    box.append(over("position in its client's scene, m"), place, over("turned about x, then y, then z, degrees"), turns, over("the same as a quaternion w, x, y, z"), quat);
    (["x", "y", "z"] as const).forEach((axis, i) => {
      const field = numberField(`pose.position.${axis}`, axis, "m", this.send, `m along ${axis} in the scene of its client`);
      field.step = () => 0.001 * (this.first()?.frame.scale ?? 1);
      this.add(place, field, (item) => item.pose.position[i]!);
    });
    (["x", "y", "z"] as const).forEach((name, i) => {
      const field = numberField(`pose.turn.r${name}`, name, "°", (_path, value, gesture) => {
        return this.sendEach((item) => {
          const degrees = toDegrees(item.pose.orientation);
          degrees[i] = value as number;
          return { "pose.orientation": fromDegrees(degrees) };
        }, `pose.turn.r${name}`, gesture);
      }, `degrees about ${name}`);
      this.add(turns, field, (item) => rounded(toDegrees(item.pose.orientation)[i]!, 6));
    });
    (["w", "x", "y", "z"] as const).forEach((name, i) => {
      const field = numberField(`pose.orientation.${name}`, name, "", this.send, "Quaternion, object to scene; it is made of unit length");
      this.add(quat, field, (item) => Number(item.pose.orientation[i]!.toPrecision(9)));
    });
    box.append(this.twists);
    for (const [part, unit, text] of [["linear", "m/s", "velocity, m/s; it lasts 0.1 s"], ["angular", "rad/s", "angular velocity, rad/s; it lasts 0.1 s"]] as const) {
      const triple = make("div", { className: "triple" });
      this.twists.append(over(text), triple);
      (["x", "y", "z"] as const).forEach((name, i) => {
        const field = numberField(`twist.${part}.${name}`, name, unit, this.send, `${unit} along ${name} of the scene of its client`);
        this.add(triple, field, () => (this.twist ? Number(this.twist[part][i]!.toPrecision(9)) : ""));
      });
    }
  }

  private makeProfile(side: "front" | "back"): void {
    const box = this.section(side === "front" ? "Force profile, front" : "Force profile, back", side);
    const of = (item: Item): Profile => item.told[side];
    const path = (name: string) => `${side}.${name}`;
    const kind = new ChoiceField(path("kind"), "kind", Object.entries(uses).map(([value, use]) => [value, use.word]), (_path, value) => {
      const changed = (item: Item) => Object.entries(ofKind(of(item), value as string)).map(([k, v]) => [path(k), v]);
      return this.sendEach((item) => Object.fromEntries(changed(item)), path("kind"));
    });
    this.add(box, kind, (item) => of(item).kind);
    const formula = make("div", { className: "formula" });
    this.formulas.set(side, formula);
    box.append(formula);
    const isOn = () => this.items.every((item) => of(item).kind !== "none");
    this.add(box, new ChoiceField(path("sense"), "sense", senses, this.send), (item) => of(item).sense, isOn);
    for (const name of ["gain", "offset", "width"] as const) {
      const field = numberField(path(name), name, "", this.send), unit = () => this.same((item) => uses[of(item).kind]?.[name] ?? "") ?? "";
      this.add(box, field, (item) => of(item)[name], () => unit() !== "");
      this.units.push(() => { field.unitText = unit(); });
    }
    this.add(box, numberField(path("limit"), "limit", "N", this.send, "The force never exceeds it"), (item) => of(item).limit, isOn);
    this.add(box, numberField(path("reach"), "reach (0: ∞)", "m", this.send, "No force beyond this distance; 0: unlimited"), (item) => of(item).reach, isOn);
    this.makeCurve(box, side, of);
  }

  private makeCurve(box: HTMLElement, side: string, of: (item: Item) => Profile): void {
    const path = `${side}.curve`;
    const isTable = (item: Item) => Boolean(of(item).curve?.table);
    const way = new ChoiceField(`${path}.way`, "curve", [["expression", "expression in d, t"], ["table", "table"]], (_path, value) => {
      const curve = value === "table" ? { table: [0, 1, 2, 1, 0], step: 0.01 } : { expression: smooth };
      return this.sendAll({ [path]: curve }, `${path}.way`);
    });
    const isCustom = () => this.items.every((item) => of(item).kind === "custom");
    this.add(box, way, (item) => (isTable(item) ? "table" : "expression"), isCustom);
    const expression = new AreaField(path, "f(d, t) =", this.send, (text) => ({ value: { expression: text.trim() } }), 2);
    this.add(box, expression, (item) => of(item).curve?.expression ?? "", () => isCustom() && this.same(isTable) === false);
    const table = new AreaField(`${path}.table`, "d (m), f (N)", (_path, value) => this.sendAll({ [path]: value }, `${path}.table`), readTable, 6);
    this.add(box, table, (item) => {
      const curve = of(item).curve;
      return (curve?.table ?? []).map((force, i) => `${shown(i * (curve?.step ?? 0))}, ${force}`).join("\n");
    }, () => isCustom() && this.same(isTable) === true);
  }

  private makeContact(): void {
    const box = this.section("Contact", "contact");
    const keep = new ChoiceField("contact.keep", "solid", keeps, (path, value) => {
      const needsLimit = (item: Item) => value !== "none" && !(item.told.contact.limit > 0);
      return this.sendEach((item) => ({ [path]: value, ...(needsLimit(item) ? { "contact.limit": 10 } : {}) }), path);
    });
    this.add(box, keep, (item) => item.told.contact.keep);
    const numbers: [keyof Item["told"]["contact"], string, string][] = [
      ["stiffness", "N/m", "0: 1000 N/m, or a share of what the loop can render"], ["limit", "N", "Of all points of a tool together"],
      ["damping", "N s/m", "Only while the hand approaches"], ["friction", "", "Coulomb coefficient, 0 to 2"],
    ];
    for (const [name, unit, title] of numbers) {
      const field = numberField(`contact.${name}`, name, unit, this.send, title);
      this.add(box, field, (item) => item.told.contact[name] as number,
        () => this.items.every((item) => item.told.contact.keep !== "none"));
    }
    this.makeSurface(box);
  }

  /** needs: the setting without which a field is not there. */
  private makeSurface(box: HTMLElement): void {
    const isSolid = (item: Item) => item.told.contact.keep !== "none";
    const addNumber = (name: keyof Surface, label: string, unit: string, title: string, needs?: "static_friction" | "impact_gain") => {
      const isThere = (item: Item) => isSolid(item) && (needs === undefined || item.told.surface[needs] > 0);
      this.add(box, numberField(`surface.${name}`, label, unit, this.send, title), (item) => item.told.surface[name], () => this.items.every(isThere));
    };
    addNumber("static_friction", "static friction", "", "While it sticks, 0 to 2; instead of the friction above");
    addNumber("dynamic_friction", "dynamic friction", "", "While it slips, a tenth of the static one at least", "static_friction");
    addNumber("slip_distance", "slip distance", "m", "Over which the one becomes the other", "static_friction");
    const impact = new ChoiceField("surface.impact", "impact", impacts, (path, value) => {
      if (value !== "own") return this.send(path, value);
      return Promise.reject({ text: "Type figures of your own into the fields below" });
    });
    this.add(box, impact, (item) => item.told.surface.impact, () => this.items.every(isSolid));
    addNumber("impact_gain", "impact gain", "N s/m", "Newtons for each m/s at which a point hits it; 0: no impact");
    addNumber("impact_frequency", "impact frequency", "Hz", "How fast it rings, 1 Hz at least", "impact_gain");
    addNumber("impact_decay", "impact decay", "1/s", "After 1 / decay seconds a third of it is left; 1/s at least", "impact_gain");
  }

  private makeOther(): void {
    const box = this.section("Object", "other");
    const name = new TextField("name", "name", "", (_path, value) => {
      const item = this.first()!;
      return this.orders.wire.send("rename", { name: item.told.name, to: value }).then((made) => this.orders.selectWhenThere(made.name));
    }, (text) => ({ value: text }));
    this.add(box, name, (item) => item.told.short, () => this.items.length === 1 && this.items[0]!.told.own);
    const primitive = new ChoiceField("primitive", "primitive", primitives, (path, value) => {
      if (value !== "mesh") return this.sendAll({ [path]: value }, path);
      this.askForMesh();
      return Promise.reject({ text: "" }); // it stays what it is until there is a file
    });
    this.add(box, primitive, (item) => item.told.primitive);
    this.replace.onclick = () => this.askForMesh();
    box.append(this.replace);
    this.add(box, new CheckField("enabled", "enabled", this.send), (item) => item.told.enabled);
    const closed = new CheckField("closed", "closed line", (_path, value) => this.closeLine(Boolean(value)));
    this.add(box, closed, (item) => item.told.shape?.closed ?? false,
      () => this.items.length === 1 && this.items[0]!.told.primitive === "polyline");
    this.add(box, numberField("damping", "damping", "N s/m", this.send, "Where the profile gives a force"), (item) => item.told.damping);
    const lifetime = numberField("lifetime", "lifetime", "s", this.send, "It fades unless changed or moved within this time; 0: for ever");
    this.add(box, lifetime, (item) => item.told.lifetime);
    this.add(box, numberField("start", "start", "s", this.send, "t = 0 of f(d, t), on the clock of the scene"), (item) => rounded(item.told.start, 6));
    const points = new TextField("tool_points", "tool points", "", this.send, readPoints, "Numbers of the points that feel it, such as 1, 3; all");
    this.add(box, points, (item) => showPoints(item.told.tool_points));
    box.append(this.points);
  }

  /** The selection becomes a mesh from a file, or another mesh. */
  private askForMesh(): void {
    const names = this.unlocked.map((item) => item.told.name);
    void askForMesh(this.orders, (file) => `${file}, for ${several(names)}`, "Take it",
      (scale, file) => this.orders.change(names, {}, undefined, { upload: true, file, scale }));
  }

  private async closeLine(isClosed: boolean): Promise<void> {
    const shape = this.first()!.told.shape!, selected = this.model.selection.map((item) => item.told.id).join();
    const points = new Float64Array(await (await fetch(`shapes/${shape.hash}`)).arrayBuffer());
    const triples = Array.from({ length: points.length / 3 }, (_, i) => [...points.slice(3 * i, 3 * i + 3)]);
    if (this.model.selection.map((item) => item.told.id).join() !== selected) return; // another line was selected meanwhile
    await this.sendAll({ shape: { points: triples, closed: isClosed } }, "closed");
  }

  // ---- Showing

  private first(): Item | undefined { return this.model.selection[0]; }
  /** What all of the selected objects have; null: they differ. */
  private same<V>(of: (item: Item) => V): V | null {
    const value = of(this.items[0]!);
    return this.items.every((item) => of(item) === value) ? value : null;
  }

  private update(): void {
    const [item] = (this.items = this.model.selection);
    this.box.classList.toggle("empty", !item);
    this.hint.hidden = item !== undefined;
    if (!item) {
      this.replace.hidden = true;
      for (const part of [this.title, this.condition, this.what, this.live]) part.textContent = "";
      this.padlock.hidden = this.adopt.hidden = true;
      this.box.dataset.selected = "";
      return;
    }
    this.box.dataset.selected = this.items.map((each) => each.told.name).join("|");
    this.updateHead(item);
    const isSurface = this.items.every(({ told: { primitive } }) => primitive === "plane" || primitive === "mesh");
    this.sections.get("back")!.hidden = this.sections.get("contact")!.hidden = !isSurface;
    this.sections.get("front")!.querySelector("summary")!.textContent = isSurface ? "Force profile, front" : "Force profile";
    const isReadOnly = this.items.every((each) => each.isLocked);
    this.twists.hidden = this.items.length > 1;
    this.replace.hidden = isReadOnly || this.same((each) => each.told.primitive) !== "mesh";
    for (const { field, update } of this.fields) {
      field.isReadOnly = isReadOnly;
      update();
    }
    for (const update of this.units) update();
    for (const side of ["front", "back"] as const) {
      const kind = this.same((each) => each.told[side].kind);
      put(this.formulas.get(side)!, kind ? "f = " + uses[kind]!.formula : "several kinds");
    }
  }

  private updateHead(item: Item): void {
    const { items } = this, many = items.length, shape = item.told.shape, condition = item.condition;
    this.padlock.hidden = !items.every((each) => each.isLocked);
    this.adopt.hidden = item.told.own || many > 1 || this.model.viewOnly;
    if (many > 1) {
      put(this.title, `${many} objects`);
      const locked = items.filter((each) => each.isLocked).length;
      put(this.what, `${several(items.map((each) => each.told.short))}${locked ? `; ${locked} of them locked, and left as they are` : ""}`);
      put(this.condition, "");
      put(this.live, "");
      return;
    }
    put(this.title, item.told.short);
    put(this.condition, item.word);
    this.condition.className = `state ${condition}`;
    const size = shape ? `, ${shape.triangles ? `${shape.triangles.toLocaleString("en")} triangles` : `${shape.points} points`}` : "";
    put(this.what, `${item.told.primitive}${size} of ${item.told.client}`);
    const capped = item.applied < item.wanted ? ` of ${slope(item.wanted)}` : "";
    put(this.live, `d ${this.model.distance(item)} · F ${newtons(length(item.push))} · stiffness ${slope(item.applied)}${capped}`);
  }
}

const several = (names: string[]) => names.slice(0, 5).join(", ") + (names.length > 5 ? ` and ${names.length - 5} more` : "");
const rounded = (value: number, digits: number) => Number(value.toFixed(digits));
const slope = (value: number | null): string =>
  value === null || !Number.isFinite(value) ? "∞ (the force jumps)" : `${shown(Number(value.toPrecision(3)))} N/m`;

/** Whether the library's sentence is about this field: "pose.position.x" is also about "pose.position". */
function named(field: string, path: string): boolean {
  return field !== "" && (field === path || path.startsWith(`${field}.`) || field.startsWith(`${path}.`));
}

/** Lines "d, f" with equal steps, as a spreadsheet gives them. */
function readTable(text: string): { value: unknown } | string {
  const lines = text.split("\n").map((line, i) => ({ text: line.trim(), number: i + 1 })).filter((line) => line.text !== "");
  const rows = lines.map((line) => {
    const cells = line.text.split(/[\t;]/.test(line.text) ? /[\t;]\s*/ : /,\s*|\s+/); // a comma may be decimal
    return { number: line.number, cells: cells.map(parse) };
  });
  if (rows.length && rows[0]!.cells.every((x) => x === null)) rows.shift(); // names of the columns
  const odd = rows.find(({ cells }) => cells.length !== 2 || cells.includes(null));
  if (odd) return `line ${odd.number}: two numbers are wanted, the distance (m) and the force (N)`;
  if (rows.length < 2) return "a table has two lines at least";
  const distances = rows.map(({ cells }) => cells[0]!), step = distances[1]! - distances[0]!;
  if (distances[0] !== 0) return `line ${rows[0]!.number}: the first distance is 0`;
  const uneven = distances.findIndex((d, i) => Math.abs(d - i * step) > 1e-6 * Math.abs(step) * rows.length);
  if (!(step > 0) || uneven >= 0) return `line ${rows[Math.max(uneven, 1)]!.number}: the distances rise in equal steps`;
  return { value: { table: rows.map(({ cells }) => cells[1]!), step: Number(step.toPrecision(12)) } };
}

function readPoints(text: string): { value: unknown } | string {
  if (text.trim() === "" || text.trim() === "all") return { value: 0 };
  let bits = 0;
  for (const word of text.split(/[,\s]+/)) {
    const n = Number(word);
    if (!Number.isInteger(n) || n < 1 || n > 32) return `“${word}” is no point: they have the numbers 1 to 32, or all`;
    bits += bits & (2 ** (n - 1)) ? 0 : 2 ** (n - 1);
  }
  return { value: bits };
}
function showPoints(bits: number): string {
  if (bits === 0) return "all";
  return Array.from({ length: 32 }, (_, i) => i).filter((i) => Math.floor(bits / 2 ** i) % 2).map((i) => i + 1).join(", ");
}
