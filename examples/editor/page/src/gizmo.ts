// The handles that move and turn what is selected, and the corners of a polyline.

import * as THREE from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";
import { type Pose, type Quat, type Vec, add, conjugate, fromDevice, minus, multiply, rotate, times } from "./frames";
import type { Item, Model } from "./model";
import { Latest, type Orders, newGesture } from "./orders";
import type { View } from "./view";

const step = 0.01; // m at the device, with Ctrl
const turnStep = Math.PI / 36; // 5 degrees, with Ctrl

export class Gizmo {
  isDragging = false;
  onChange: () => void = () => {};
  private readonly controls: TransformControls;
  private readonly handle = new THREE.Object3D();
  private readonly moves: Latest<{ name: string; pose: Pose; gesture: string }>;
  private gesture = "";
  private start: { place: Vec; turn: Quat } = { place: [0, 0, 0], turn: [1, 0, 0, 0] };
  private snaps = false;
  private item: Item | null = null;
  turned = 0; // degrees, since the drag began

  constructor(private readonly view: View, private readonly model: Model, orders: Orders) {
    this.controls = new TransformControls(view.camera, view.canvas);
    this.controls.setSize(0.75);
    this.controls.setColors(0xb04a3f, 0x4b8b4f, 0x4667a8, 0xe08a00);
    this.controls.setSpace("world");
    view.scene.add(this.handle, this.controls.getHelper());
    this.moves = new Latest(({ name, pose, gesture }) => orders.ask("move", { name, ...pose, gesture }));
    this.controls.addEventListener("change", () => view.request());
    this.controls.addEventListener("dragging-changed", (event) => this.drag(Boolean(event.value)));
    this.controls.addEventListener("objectChange", () => this.follow());
    const readKey = (event: KeyboardEvent | PointerEvent) => { this.snaps = event.ctrlKey; };
    for (const kind of ["keydown", "keyup", "pointermove", "pointerdown"] as const) window.addEventListener(kind, readKey, true);
    model.on(["selection", "picture", "objects"], () => this.attach());
  }

  get mode(): string { return this.controls.mode; }
  set mode(mode: "translate" | "rotate") { this.controls.setMode(mode); this.changed(); }
  get space(): string { return this.controls.space; }
  set space(space: "world" | "local") { this.controls.setSpace(space); this.changed(); }
  private changed(): void { this.onChange(); this.view.request(); }
  /** Over one of its arrows: then a click is no click at an object. */
  get isUnderPointer(): boolean { return this.controls.axis !== null && this.item !== null; }

  /** Where the arrow along an axis of the view, or the ring about it, can be gripped: a place of the device. */
  grip(axis: "x" | "y" | "z"): Vec {
    const { camera } = this.view, at = this.handle.position;
    const size = (at.distanceTo(camera.position) * 1.9 * Math.tan((camera.fov * Math.PI) / 360) * this.controls.size) / 4;
    const along = this.mode === "translate" ? 0.35 * size : (0.5 * size) / Math.SQRT2;
    const way = { x: [1, 0, 0], y: [0, 1, 0], z: [0, 0, 1] }[axis].map((x) => (this.mode === "translate" ? x : 1 - x) * along);
    return add(add(at.toArray() as Vec, way as Vec), this.view.origin);
  }

  /** Follows the selection, but not while it is dragged. */
  private attach(): void {
    const chosen = this.model.selection;
    const item = chosen.length === 1 && !chosen[0]!.isLocked && !this.model.hidden.has(chosen[0]!.told.id) ? chosen[0]! : null;
    if (this.isDragging && item === this.item) return;
    if (this.isDragging) { // it vanished under the hand
      this.isDragging = false;
      this.view.controls.enabled = true;
      this.controls.reset();
    }
    this.item = item;
    if (!item) { this.controls.detach(); return; }
    this.handle.position.set(...minus(item.place, this.view.origin));
    const q = item.turn;
    this.handle.quaternion.set(q[1], q[2], q[3], q[0]);
    if (this.controls.object !== this.handle) this.controls.attach(this.handle);
  }

  private drag(isDragging: boolean): void {
    this.view.controls.enabled = !isDragging;
    if (isDragging && this.item) {
      this.start = { place: this.item.place, turn: this.item.turn };
      this.gesture = newGesture();
    }
    this.isDragging = isDragging;
    this.view.box.dataset.dragging = String(isDragging);
    if (!isDragging) this.attach();
  }

  /** Where the handle is now, from where it began: snapped, and in double precision. */
  private follow(): void {
    const { item, start } = this;
    if (!item || !this.isDragging) return;
    let place = start.place, turn = start.turn;
    const axes: Quat = this.controls.space === "local" ? start.turn : [1, 0, 0, 0];
    if (this.controls.mode === "translate") {
      const from = minus(start.place, this.view.origin);
      let way = rotate(conjugate(axes), minus(this.handle.position.toArray() as Vec, from));
      if (this.snaps) way = way.map((x) => Math.round(x / step) * step) as Vec;
      else way = way.map((x) => (Math.abs(x) < 1e-9 ? 0 : x)) as Vec;
      place = add(start.place, rotate(axes, way));
    } else {
      const q = this.handle.quaternion;
      const by = multiply([q.w, q.x, q.y, q.z], conjugate(start.turn)); // about the axes of the device
      const taken = this.snaps ? snapped(by) : by;
      this.turned = (2 * Math.atan2(Math.hypot(taken[1], taken[2], taken[3]), Math.abs(taken[0])) * 180) / Math.PI;
      turn = multiply(taken, start.turn);
    }
    this.handle.position.set(...minus(place, this.view.origin));
    this.handle.quaternion.set(turn[1], turn[2], turn[3], turn[0]);
    const pose = item.poseAt(place, turn);
    if (this.controls.mode === "translate") pose.orientation = item.pose.orientation; // bit for bit
    void this.moves.put({ name: item.told.name, pose, gesture: this.gesture });
  }
}

/** The same turn, by a whole number of steps. */
function snapped(q: Quat): Quat {
  const sine = Math.hypot(q[1], q[2], q[3]);
  if (sine < 1e-12) return [1, 0, 0, 0];
  const angle = 2 * Math.atan2(sine, q[0]);
  const half = (Math.round(angle / turnStep) * turnStep) / 2;
  const axis = times(1 / sine, [q[1], q[2], q[3]]);
  return [Math.cos(half), ...times(Math.sin(half), axis)];
}

/** Dots on the corners of the polyline that is selected: they can be dragged, and removed by Delete. */
export class Corners {
  private readonly box: HTMLElement;
  private item: Item | null = null;
  private points: Vec[] = [];
  private dragged = -1;
  active = -1;
  private gesture = "";
  private readonly changes: Latest<{ name: string; points: Vec[]; closed: boolean; gesture: string }>;

  constructor(private readonly view: View, private readonly model: Model, orders: Orders) {
    this.box = document.createElement("div");
    this.box.className = "corners";
    view.box.append(this.box);
    this.changes = new Latest(({ name, points, closed, gesture }) => orders.change([name], { shape: { points, closed } }, gesture),
      (why) => { orders.onNotice(why.text, true); this.attach(); });
    model.on(["selection", "objects"], () => this.attach());
    view.onDraw.push(() => this.place());
  }

  private attach(): void {
    const chosen = this.model.selection[0];
    if (this.dragged >= 0 && chosen && chosen === this.item) return;
    this.dragged = -1; // it may have vanished under the hand
    const shape = chosen?.told.shape;
    const isFit = chosen && shape && chosen.told.primitive === "polyline" && shape.points <= 300 && !chosen.isLocked;
    if (this.item !== chosen) this.active = -1;
    this.item = isFit && this.model.selected.size === 1 ? chosen : null;
    const loaded = this.item && shape && this.view.shapes.get(shape);
    this.points = [];
    if (loaded) for (let i = 0; i < loaded.exact.length; i += 3) this.points.push([...loaded.exact.slice(i, i + 3)] as Vec);
    while (this.box.children.length > this.points.length) this.box.lastChild!.remove();
    while (this.box.children.length < this.points.length) this.box.append(this.dot(this.box.children.length));
    this.view.request();
  }

  private dot(index: number): HTMLElement {
    const dot = document.createElement("button");
    dot.dataset.corner = String(index);
    dot.title = `Corner ${index + 1}: drag it; Delete removes it`;
    dot.onpointerdown = (event) => {
      event.preventDefault();
      dot.setPointerCapture(event.pointerId);
      dot.focus();
      this.dragged = this.active = index;
      this.gesture = newGesture();
    };
    dot.onfocus = () => { this.active = index; };
    dot.onblur = () => { if (this.active === index) this.active = -1; };
    dot.onpointermove = (event) => { if (this.dragged === index) this.drag(event); };
    dot.onpointerup = dot.onlostpointercapture = () => {
      if (this.dragged === index) this.dragged = -1;
    };
    return dot;
  }

  /** Along the surface under the pointer, or else in the plane of the picture. */
  private drag(event: PointerEvent): void {
    const { item, view } = this;
    if (!item) return;
    const surface = view.surface(event.clientX, event.clientY);
    const at = surface && surface.item !== item ? surface.at : inPicture(view, event, this.atDevice(this.points[this.dragged]!));
    const inScene = fromDevice(item.frame, at);
    this.points[this.dragged] = rotate(conjugate(item.pose.orientation), minus(inScene, item.pose.position));
    void this.changes.put({ ...this.line(item), points: this.points.map((p) => [...p] as Vec), gesture: this.gesture });
    this.place();
  }

  removeActive(): boolean {
    if (!this.item || this.active < 0) return false;
    const points = this.points.filter((_, i) => i !== this.active);
    void this.changes.put({ ...this.line(this.item), points, gesture: newGesture() });
    this.active = -1;
    (document.activeElement as HTMLElement | null)?.blur();
    return true;
  }

  private line(item: Item): { name: string; closed: boolean } {
    return { name: item.told.name, closed: item.told.shape?.closed ?? false };
  }

  private atDevice(point: Vec): Vec {
    const item = this.item!;
    const inScene = add(item.pose.position, rotate(item.pose.orientation, point));
    const f = item.frame;
    return add(f.pose.position, rotate(f.pose.orientation, times(1 / f.scale, inScene)));
  }

  private place(): void {
    if (this.item && this.points.length === 0) this.attach();
    this.points.forEach((point, i) => {
      const dot = this.box.children[i] as HTMLElement | undefined;
      if (!dot) return;
      const at = this.view.project(this.atDevice(point));
      dot.style.transform = `translate(${at.x}px, ${at.y}px)`;
      dot.hidden = !at.isInFront;
    });
  }
}

/** The place under the pointer that is as far away as `near`. */
function inPicture(view: View, event: PointerEvent, near: Vec): Vec {
  const box = view.canvas.getBoundingClientRect();
  const at = new THREE.Vector3(...minus(near, view.origin)).project(view.camera);
  at.x = ((event.clientX - box.left) / box.width) * 2 - 1;
  at.y = 1 - ((event.clientY - box.top) / box.height) * 2;
  return add(at.unproject(view.camera).toArray() as Vec, view.origin);
}

/** Draws a polyline by clicks on planes and meshes; a click at its first point closes it. */
export class Pencil {
  private places: Vec[] = [];
  private readonly line: THREE.Line;
  private readonly box: HTMLElement;
  isOn = false;
  onChange: () => void = () => {};

  constructor(private readonly view: View, private readonly model: Model, private readonly orders: Orders) {
    this.line = new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: 0xe08a00, depthTest: false }));
    this.line.renderOrder = 10;
    this.line.frustumCulled = false;
    view.scene.add(this.line);
    this.box = document.createElement("div");
    this.box.className = "corners drawing";
    view.box.append(this.box);
    view.onDraw.push(() => this.update());
    model.on(["picture"], () => this.lay());
  }

  start(): void { this.places = []; this.isOn = true; this.changed(); }
  cancel(): void { this.places = []; this.isOn = false; this.changed(); }
  private changed(): void {
    this.view.box.dataset.drawing = this.isOn ? String(this.places.length) : "";
    this.onChange();
    this.line.geometry.dispose();
    const first = this.places[0] ?? [0, 0, 0];
    this.line.geometry = new THREE.BufferGeometry().setFromPoints(this.places.map((p) => new THREE.Vector3(...minus(p, first))));
    this.lay();
    this.box.replaceChildren(...this.places.map(() => document.createElement("i")));
    this.view.request();
  }
  private lay(): void { if (this.places[0]) this.line.position.set(...minus(this.places[0], this.view.origin)); }

  click(x: number, y: number): void {
    const first = this.places[0];
    const box = this.view.canvas.getBoundingClientRect();
    if (first && this.places.length > 2) {
      const at = this.view.project(first);
      if (Math.hypot(at.x + box.left - x, at.y + box.top - y) < 9) return this.finish(true);
    }
    const hit = this.view.surface(x, y);
    if (!hit) return this.orders.onNotice("Click on a plane or a mesh: a polyline is drawn on a surface.", false);
    this.places.push(hit.at);
    this.changed();
  }
  back(): void { this.places.pop(); this.changed(); }

  finish(isClosed: boolean): void {
    const inScene = this.places.map((place) => fromDevice(this.model.ownFrame, place));
    this.cancel();
    if (inScene.length < 2) return;
    const first = inScene[0]!;
    const points = inScene.map((p) => minus(p, first));
    const front = { kind: "gaussian", sense: "attractive", gain: 2, width: 0.01, limit: 2 };
    void this.orders.add("line", "polyline", { "pose.position": first, shape: { points, closed: isClosed }, ...flat("front", front) });
  }

  private update(): void {
    this.places.forEach((place, i) => {
      const at = this.view.project(place);
      (this.box.children[i] as HTMLElement).style.transform = `translate(${at.x}px, ${at.y}px)`;
    });
  }
}

export function flat(section: string, fields: Record<string, unknown>): Record<string, unknown> {
  return Object.fromEntries(Object.entries(fields).map(([key, value]) => [`${section}.${key}`, value]));
}
