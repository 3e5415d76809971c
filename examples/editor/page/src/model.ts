// What the page knows: the objects of all clients, the hand, and what is selected here. Everything else listens to it.

import { type Frame, type Pose, type Quat, type Vec, add, fromDevice, identity, minus, multiply, rotate, times, toDevice } from "./frames";
import type { State } from "./wire";

export type Primitive = "point" | "polyline" | "plane" | "mesh";
export interface Curve { expression?: string; table?: number[]; step?: number }
export interface Profile {
  kind: string; sense: string; gain: number; offset: number; width: number; limit: number; reach: number; curve: Curve | null;
}
export interface Contact { keep: string; stiffness: number; limit: number; damping: number; friction: number }
export interface Surface {
  static_friction: number; dynamic_friction: number; slip_distance: number;
  impact: string; impact_gain: number; impact_frequency: number; impact_decay: number;
}
export interface ShapeInfo { hash: string; points: number; triangles: number; closed: boolean; centre: Vec; radius: number }
export interface Told {
  id: number; name: string; short: string; client: string; own: boolean; primitive: Primitive;
  start: number; lifetime: number; front: Profile; back: Profile; damping: number; contact: Contact; surface: Surface;
  shape: ShapeInfo | null; tool_points: number; enabled: boolean;
}
export interface Client {
  name: string; force: Vec; frame: Frame; tool: Pose; points: Vec[]; held: boolean; locked: boolean;
  number?: number; // of the other clients alone
}
export interface Hand { pose: Pose; sent: Vec; speed: number }
export interface Happened { serial: number; kind: string; name: string; text: string; value: number | null }

/** How an object is felt; that a lifetime is over is found out here. */
export type Condition = "pending" | "felt" | "fading" | "disabled" | "refused" | "expired";
const conditions: Condition[] = ["pending", "felt", "fading", "disabled", "refused"];
export const mark: Record<Condition, string> =
  { pending: "…", felt: "●", fading: "◐", disabled: "○", refused: "⚠\uFE0E", expired: "✕" };

const colours = [0xd57a00, 0x008f6b, 0xb25a94, 0x3aa0d0, 0xc04a00, 0x9b8a00];
const defaultFrame: Frame = { pose: identity, scale: 1, force_scale: 1 };

/** An object of some client. Its pose is in the scene of its client; place, turn, size, nearest and push are at the device. */
export class Item {
  pose: Pose = identity;
  weight = 0;
  state = 0;
  distance = Infinity; // m of the editor's scene, as offset and force
  offset: Vec = [0, 0, 0]; // of the closest point from the hand
  force: Vec = [0, 0, 0];
  wanted = 0;
  applied = 0;
  constructor(public told: Told, private readonly model: Model) {}

  get condition(): Condition {
    const found = conditions[this.state] ?? "pending";
    return found === "fading" && this.weight === 0 && this.told.lifetime > 0 && this.told.enabled ? "expired" : found;
  }
  /** For the table and the panel. */
  get word(): string {
    const { condition } = this, isCut = (condition === "felt" || condition === "fading") && !this.model.isForceSent;
    return isCut ? "■ stopped" : `${mark[condition]} ${condition}`;
  }
  get client(): Client | undefined { return this.model.clients.get(this.told.client); }
  get frame(): Frame { return this.client?.frame ?? defaultFrame; }
  get isLocked(): boolean { return this.model.viewOnly || (!this.told.own && (this.client?.locked ?? false)); }
  /** The place of the shape's centre, or of the origin, at the device. */
  get place(): Vec { return toDevice(this.frame, this.centre); }
  get centre(): Vec {
    return this.told.shape ? add(this.pose.position, rotate(this.pose.orientation, this.told.shape.centre)) : this.pose.position;
  }
  get turn(): Quat { return multiply(this.frame.pose.orientation, this.pose.orientation); }
  get size(): number { return 1 / this.frame.scale; } // device metres per scene metre
  /** Its closest point, at the device. */
  get nearest(): Vec { return toDevice(this.model.ownFrame, add(this.model.hand?.pose.position ?? [0, 0, 0], this.offset)); }
  get push(): Vec { // N at the device; the report has it also while nothing of it is sent
    if (!this.model.isForceSent) return [0, 0, 0];
    const f = rotate(this.model.ownFrame.pose.orientation, this.force);
    const s = this.told.own ? this.model.ownFrame.force_scale : 1;
    return [f[0] * s, f[1] * s, f[2] * s];
  }
  get deviceDistance(): number { return this.distance / this.model.ownFrame.scale; }
  /** Takes its pose from 7 numbers and the rest from 12. Returns whether it is now drawn in another way. */
  read(pose: Float64Array, felt: Float32Array): boolean {
    const was = this.pose, state = this.state, weight = this.weight, wasFinite = Number.isFinite(this.distance);
    const { offset, force } = this;
    this.pose = { position: [pose[0]!, pose[1]!, pose[2]!], orientation: [pose[3]!, pose[4]!, pose[5]!, pose[6]!] };
    this.state = felt[1]!;
    this.weight = felt[2]!;
    this.distance = felt[3]!;
    this.offset = [felt[4]!, felt[5]!, felt[6]!];
    this.force = [felt[7]!, felt[8]!, felt[9]!];
    this.wanted = felt[10]!;
    this.applied = felt[11]!;
    const way = smallestWay * this.model.ownFrame.scale;
    return state !== this.state || weight !== this.weight || wasFinite !== Number.isFinite(this.distance)
      || was.position.some((x, i) => x !== this.pose.position[i]) || was.orientation.some((x, i) => x !== this.pose.orientation[i])
      || offset.some((x, i) => differs(x, this.offset[i]!, way)) || force.some((x, i) => differs(x, this.force[i]!, smallestForce));
  }
  /** The pose that puts the shape's centre to this place of the device, turned like this. */
  poseAt(place: Vec, turn: Quat): Pose {
    const f = this.frame, c = f.pose.orientation;
    const orientation = multiply([c[0], -c[1], -c[2], -c[3]], turn);
    const centre = fromDevice(f, place);
    return { orientation, position: this.told.shape ? minus(centre, rotate(orientation, this.told.shape.centre)) : centre };
  }
}

/** objects: what they are; rows: how they are felt; picture: what is drawn of that; state: any state at all. */
export type Topic = "objects" | "rows" | "picture" | "selection" | "state" | "samples" | "happened";

// What is smaller cannot be seen: m at the device, N.
const smallestWay = 1e-5, smallestForce = 0.004;
const differs = (a: number, b: number, least: number) => !(Math.abs(a - b) <= least) && !(a === b);

export class Model {
  items = new Map<number, Item>();
  clients = new Map<string, Client>();
  selected = new Set<number>();
  hidden = new Set<number>();
  hand: Hand | null = null;
  told: any = {};
  newSamples: Float64Array = new Float64Array();
  isConnected = false;
  private listeners = new Map<Topic, (() => void)[]>();

  get me(): string { return this.told.me ?? ""; }
  get viewOnly(): boolean { return Boolean(this.told.view_only); }
  get error(): string { return this.isConnected ? (this.told.error ?? "not connected yet") : "the editor does not answer: if it has ended, start it again and open the address that it prints"; }
  get ownFrame(): Frame { return this.clients.get(this.me)?.frame ?? defaultFrame; }
  get handPlace(): Vec { return this.hand ? toDevice(this.ownFrame, this.hand.pose.position) : [0, 0, 0]; }
  /** What the device gets, N. */
  get sent(): Vec { return this.hand ? this.turnToDevice(this.hand.sent) : [0, 0, 0]; }
  /** N: the damping of the servo, against the motion of the hand. */
  get damping(): number { return this.isForceSent && this.hand ? ((this.told.stats?.damping ?? 0) * this.hand.speed) / this.ownFrame.scale : 0; }
  /** By the owner of the server, or by somebody's Escape. */
  get isStopped(): boolean { return this.told.stats?.enabled === 0; }
  get isForceSent(): boolean { return !this.isStopped && !this.told.stats?.faults?.length; }
  forceOf(client: Client): Vec { return this.isForceSent ? client.force : [0, 0, 0]; }
  turnToDevice(v: Vec): Vec { return rotate(this.ownFrame.pose.orientation, v); }

  on(topics: Topic[], f: () => void): void {
    for (const topic of topics) this.listeners.set(topic, [...(this.listeners.get(topic) ?? []), f]);
  }
  tell(topic: Topic): void { for (const f of this.listeners.get(topic) ?? []) f(); }

  /** There is no server, or no editor: what was felt is not to be taken for what is felt now. */
  loseAll(): void {
    this.items.clear();
    this.clients.clear();
    this.hand = null;
    this.told = { ...this.told, stats: undefined };
    this.tell("objects");
    this.tell("picture");
  }

  /** Returns whether the picture is drawn anew for it. */
  take(state: State): boolean {
    const told: any = state.told;
    this.told = { ...this.told, ...told };
    if (told.fresh) this.items.clear();
    if (told.error) this.loseAll();
    const clientsBefore = [...this.clients.keys()].join();
    if (told.clients) this.clients = new Map((told.clients as Client[]).map((client) => [client.name, client]));
    if (told.hand) this.hand = told.hand as Hand;
    if (told.clients || told.hand || told.stats) this.compare();
    for (const one of (told.objects ?? []) as Told[]) {
      const known = this.items.get(one.id);
      if (known) known.told = one;
      else this.items.set(one.id, new Item(one, this));
    }
    for (const id of (told.gone ?? []) as number[]) this.items.delete(id);
    this.readRows(state);
    const selectedBefore = this.selected.size;
    for (const id of this.selected) if (!this.items.has(id)) this.selected.delete(id);
    this.newSamples = state.samples;
    if (told.objects || told.gone || told.fresh || clientsBefore !== [...this.clients.keys()].join()) this.tell("objects");
    if (state.felt.length) this.tell("rows");
    const isDrawn = this.looksDifferent || Boolean(told.objects || told.gone || told.fresh || told.error);
    if (this.looksDifferent) this.tell("picture");
    this.looksDifferent = false;
    this.tell("state");
    if (state.samples.length) this.tell("samples");
    if (selectedBefore !== this.selected.size) this.tell("selection");
    if (told.events?.length) this.tell("happened");
    return isDrawn;
  }

  private looksDifferent = false;
  private drawn: { places: number[]; forces: number[]; rest: string } = { places: [], forces: [], rest: "" };

  /** Whether the hand, the tools or the forces of the clients look different from when they were drawn last. */
  private compare(): void {
    const clients = [...this.clients.values()];
    const places = [...this.handPlace, ...clients.flatMap((c) => times(1 / c.frame.scale, c.tool.position))];
    const forces = [...this.sent, ...clients.flatMap((c) => this.forceOf(c))];
    const rest = this.isForceSent + JSON.stringify(clients.map((c) => [c.name, c.frame, c.points, c.held, c.tool.orientation.map((x) => x.toFixed(3))]));
    const last = this.drawn;
    if (rest === last.rest && places.length === last.places.length
      && !places.some((x, i) => differs(x, last.places[i]!, smallestWay)) && !forces.some((x, i) => differs(x, last.forces[i]!, smallestForce))) return;
    this.drawn = { places, forces, rest };
    this.looksDifferent = true;
  }

  private readRows({ poses, felt }: State): void {
    const ids = new Uint32Array(felt.buffer, felt.byteOffset, felt.length);
    for (let i = 0; 12 * i < felt.length; ++i) {
      const item = this.items.get(ids[12 * i]!);
      if (item?.read(poses.subarray(7 * i, 7 * i + 7), felt.subarray(12 * i, 12 * i + 12))) this.looksDifferent = true;
    }
  }

  select(ids: Iterable<number>): void {
    this.selected = new Set(ids);
    this.tell("selection");
  }
  get selection(): Item[] { return [...this.selected].map((id) => this.items.get(id)).filter((item) => item !== undefined); }
  byName(name: string): Item | undefined { return [...this.items.values()].find((item) => item.told.name === name); }
  /** The colour of a client: the editor's own is blue, and the others are told apart as well as may be (Okabe & Ito). The
   * editor's server numbers the clients, so that all its browsers show the same colours. */
  colourOf(client: string): number {
    if (client === this.me) return 0x2f6fb0;
    if (client === "server") return 0x7b6bc4;
    return colours[(this.clients.get(client)?.number ?? 0) % colours.length]!;
  }
  /** m of the item's client instead of metres at the device. */
  inClientMetres = false;
  distance(item: Item): string {
    return metres(this.inClientMetres ? item.deviceDistance * item.frame.scale : item.deviceDistance);
  }
  setHidden(items: Item[], isHidden: boolean): void {
    for (const { told: { id } } of items) {
      if (isHidden) this.hidden.add(id);
      else this.hidden.delete(id);
    }
    this.tell("objects");
  }
}

export function newtons(force: number): string {
  return force < 0.005 ? "0 N" : force < 10 ? `${force.toFixed(2)} N` : `${force.toPrecision(3)} N`;
}
export function metres(value: number): string {
  if (!Number.isFinite(value)) return "–";
  const size = Math.abs(value);
  if (size >= 1000) return `${value.toPrecision(6)} m`;
  return size >= 1 ? `${value.toFixed(2)} m` : `${(value * 1000).toFixed(1)} mm`;
}
