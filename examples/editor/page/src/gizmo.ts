// The arrows and rings that move and turn what is selected: all of it together, about the first of it.

import * as THREE from "three";
import { TransformControls } from "three/addons/controls/TransformControls.js";
import { type Pose, type Quat, type Vec, add, conjugate, minus, multiply, rotate, times, toDevice } from "./frames";
import type { Item, Model } from "./model";
import { Latest, type Orders, newGesture } from "./orders";
import type { View } from "./view";

const step = 0.01; // m at the device, with Ctrl
const turnStep = Math.PI / 36; // 5 degrees, with Ctrl
const fineTurn = Math.PI / 1800; // 0.1 degrees, without

export class Gizmo {
  isDragging = false;
  onChange: () => void = () => {};
  private readonly controls: TransformControls;
  private readonly handle = new THREE.Object3D();
  private readonly moves: Latest<{ moves: Move[]; gesture: string }>;
  private gesture = "";
  private starts: { place: Vec; turn: Quat; pose: Pose }[] = []; // of the items, when the drag began
  private snaps = false;
  private items: Item[] = [];
  private isAway = false;
  turned = 0; // degrees, since the drag began

  constructor(private readonly view: View, private readonly model: Model, orders: Orders) {
    this.controls = new TransformControls(view.camera, view.canvas);
    this.controls.setSize(0.75);
    this.controls.setColors(0xb04a3f, 0x4b8b4f, 0x4667a8, 0xe08a00);
    this.controls.setSpace("world");
    view.scene.add(this.handle, this.controls.getHelper());
    this.moves = new Latest((moves) => orders.ask("move", moves));
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
  /** Whether it is away, so that clicks are meant for something else. */
  set away(is: boolean) { this.isAway = is; this.attach(); }
  /** Over one of its arrows: then a click is no click at an object. */
  get isUnderPointer(): boolean { return this.controls.axis !== null && this.items.length > 0; }

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
    const items = this.isAway ? [] : this.model.selection.filter((item) => !item.isLocked && !this.model.hidden.has(item.told.id));
    if (this.isDragging && items.length === this.items.length && items.every((item, i) => item === this.items[i])) return;
    if (this.isDragging) { // one of them vanished under the hand
      this.isDragging = false;
      this.view.controls.enabled = true;
      this.controls.reset();
    }
    this.items = items;
    const item = items[0];
    if (!item) { this.controls.detach(); return; }
    this.handle.position.set(...minus(item.place, this.view.origin));
    const q = item.turn;
    this.handle.quaternion.set(q[1], q[2], q[3], q[0]);
    if (this.controls.object !== this.handle) this.controls.attach(this.handle);
  }

  private drag(isDragging: boolean): void {
    this.view.controls.enabled = !isDragging;
    if (isDragging) {
      this.starts = this.items.map(({ place, turn, pose }) => ({ place, turn, pose }));
      this.gesture = newGesture();
    }
    this.isDragging = isDragging;
    this.view.box.dataset.dragging = String(isDragging);
    if (!isDragging) this.attach();
  }

  /** The way that gives the first item a position of no more digits than a pixel shows. A coordinate that stays has all of
   * its digits. */
  private toShortNumbers(way: Vec): Vec {
    const item = this.items[0]!, { place, turn, pose: { orientation, position } } = this.starts[0]!, { scale } = item.frame;
    const digits = Math.min(15, Math.max(0, -Math.floor(Math.log10(this.view.pixel * scale))));
    const moved = item.poseAt(add(place, way), turn).position;
    const short = moved.map((x, i) => (Math.abs(x - position[i]!) < 1e-9 * scale ? position[i]! : Number(x.toFixed(digits)))) as Vec;
    const shape = item.told.shape ? rotate(orientation, item.told.shape.centre) : [0, 0, 0] as Vec;
    return minus(toDevice(item.frame, add(short, shape)), place);
  }

  /** Where the handle is now, from where it began: snapped, and in double precision. */
  private follow(): void {
    const start = this.starts[0];
    if (!start || !this.isDragging) return;
    let way: Vec = [0, 0, 0], by: Quat = [1, 0, 0, 0]; // along and about the axes of the device
    if (this.controls.mode === "translate") {
      const axes: Quat = this.controls.space === "local" ? start.turn : [1, 0, 0, 0];
      const from = minus(start.place, this.view.origin);
      way = rotate(conjugate(axes), minus(this.handle.position.toArray() as Vec, from));
      if (this.snaps) way = way.map((x) => Math.round(x / step) * step) as Vec;
      else way = way.map((x) => (Math.abs(x) < 1e-9 ? 0 : x)) as Vec;
      way = rotate(axes, way);
      if (!this.snaps) way = this.toShortNumbers(way);
    } else {
      const q = this.handle.quaternion;
      by = multiply([q.w, q.x, q.y, q.z], conjugate(start.turn));
      by = snapped(by, this.snaps ? turnStep : fineTurn);
      this.turned = (2 * Math.atan2(Math.hypot(by[1], by[2], by[3]), Math.abs(by[0])) * 180) / Math.PI;
    }
    const turn = multiply(by, start.turn);
    this.handle.position.set(...minus(add(start.place, way), this.view.origin));
    this.handle.quaternion.set(turn[1], turn[2], turn[3], turn[0]);
    const moves = this.items.map((item, i): Move => {
      const one = this.starts[i]!, name = item.told.name;
      if (this.controls.mode === "translate") {
        return { name, ...item.poseAt(add(one.place, way), one.turn), orientation: item.pose.orientation }; // bit for bit
      }
      const place = i === 0 ? start.place : add(start.place, rotate(by, minus(one.place, start.place)));
      return { name, ...item.poseAt(place, multiply(by, one.turn)) };
    });
    void this.moves.put({ moves, gesture: this.gesture });
  }
}

type Move = Pose & { name: string };

/** The same turn, by a whole number of steps. */
function snapped(q: Quat, step: number): Quat {
  const sine = Math.hypot(q[1], q[2], q[3]);
  if (sine < 1e-12) return [1, 0, 0, 0];
  const angle = 2 * Math.atan2(sine, q[0]);
  const half = (Math.round(angle / step) * step) / 2;
  const axis = times(1 / sine, [q[1], q[2], q[3]]);
  return [Math.cos(half), ...times(Math.sin(half), axis)];
}
