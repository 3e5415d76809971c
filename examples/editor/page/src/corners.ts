// The corners of the polyline that is selected: they can be moved, by the pointer or by keys, and removed.

import * as THREE from "three";
import { type Vec, add, conjugate, fromDevice, minus, rotate, times, toDevice } from "./frames";
import type { Item, Model } from "./model";
import { Latest, type Orders, newGesture } from "./orders";
import type { View } from "./view";

const keyStep = 0.001; // m at the device
const settling = 500; // ms after a corner was moved, in which states that are on their way still have it where it was

export class Corners {
  private readonly box: HTMLElement;
  private item: Item | null = null;
  private points: Vec[] = [];
  private hash = ""; // of the shape that the points are of
  private dragged = -1;
  active = -1;
  private gesture = "";
  private movedAt = -Infinity; // ms
  private readonly changes: Latest<{ name: string; points: Vec[]; closed: boolean; gesture: string }>;

  constructor(private readonly view: View, private readonly model: Model, orders: Orders) {
    this.box = document.createElement("div");
    this.box.className = "corners";
    view.box.append(this.box);
    this.changes = new Latest(({ name, points, closed, gesture }) => orders.change([name], { shape: { points, closed } }, gesture),
      (why) => { orders.onNotice(why.text, true); this.movedAt = -Infinity; this.attach(); });
    model.on(["selection", "objects"], () => this.attach());
    view.onDraw.push(() => this.place());
  }

  private attach(): void {
    const chosen = this.model.selection[0];
    if (chosen && chosen === this.item && (this.dragged >= 0 || performance.now() < this.movedAt + settling)) return;
    this.dragged = -1; // it may have vanished under the hand
    const shape = chosen?.told.shape;
    const isFit = chosen && shape && chosen.told.primitive === "polyline" && shape.points <= 300 && !chosen.isLocked;
    const isSame = this.item === chosen;
    if (!isSame) this.active = -1;
    this.item = isFit && this.model.selected.size === 1 ? chosen : null;
    const loaded = this.item && shape && this.view.shapes.get(shape);
    if (this.item && isSame && !loaded && this.points.length) return; // the old ones stay until the new ones are here
    this.points = [];
    this.hash = loaded ? shape.hash : "";
    if (loaded) for (let i = 0; i < loaded.exact.length; i += 3) this.points.push([...loaded.exact.slice(i, i + 3)] as Vec);
    while (this.box.children.length > this.points.length) this.box.lastChild!.remove();
    while (this.box.children.length < this.points.length) this.box.append(this.dot(this.box.children.length));
    this.view.request();
  }

  private dot(index: number): HTMLElement {
    const dot = document.createElement("button");
    dot.dataset.corner = String(index);
    dot.title = `Corner ${index + 1}: drag it, or arrow keys (x, y) and Page Up and Down (z); Delete removes it`;
    dot.onpointerdown = (event) => {
      event.preventDefault();
      dot.setPointerCapture(event.pointerId);
      dot.focus();
      this.dragged = this.active = index;
      this.gesture = newGesture();
    };
    dot.onfocus = () => { this.active = index; };
    dot.onkeydown = (event) => this.key(event, index);
    dot.onpointermove = (event) => { if (this.dragged === index) this.drag(event); };
    const release = () => { if (this.dragged === index) this.dragged = -1; };
    dot.onpointerup = dot.onlostpointercapture = dot.onkeyup = release;
    dot.onblur = () => {
      release();
      if (this.active === index) this.active = -1;
    };
    return dot;
  }

  /** Along the surface under the pointer, or else in the plane of the picture. */
  private drag(event: PointerEvent): void {
    const { item, view } = this;
    if (!item) return;
    const surface = view.surface(event.clientX, event.clientY);
    const at = surface && surface.item !== item ? surface.at : inPicture(view, event, this.atDevice(this.points[this.dragged]!));
    this.put(at);
  }

  /** The corner that is dragged goes to this place of the device. */
  private put(at: Vec): void {
    const item = this.item!, inScene = fromDevice(item.frame, at);
    this.points[this.dragged] = rotate(conjugate(item.pose.orientation), minus(inScene, item.pose.position));
    void this.changes.put({ ...this.line(item), points: this.points.map((p) => [...p] as Vec), gesture: this.gesture });
    this.movedAt = performance.now();
    setTimeout(() => this.view.request(), 1.1 * settling);
    this.place();
  }

  /** To the next corner, or back to the first. */
  step(): void { (this.box.children[(this.active + 1) % this.points.length] as HTMLElement | undefined)?.focus(); }

  private key(event: KeyboardEvent, index: number): void {
    const way: Vec | undefined = { ArrowRight: [1, 0, 0], ArrowLeft: [-1, 0, 0], ArrowUp: [0, 1, 0], ArrowDown: [0, -1, 0],
      PageUp: [0, 0, 1], PageDown: [0, 0, -1] }[event.key] as Vec | undefined;
    if (!way || !this.item) return;
    event.preventDefault();
    this.dragged = index; // until the key is let go of
    if (!event.repeat) this.gesture = newGesture();
    this.put(add(this.atDevice(this.points[index]!), times(event.shiftKey ? keyStep / 10 : keyStep, way)));
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
    return toDevice(item.frame, add(item.pose.position, rotate(item.pose.orientation, point)));
  }

  private place(): void {
    if (this.item && this.dragged < 0 && this.item.told.shape?.hash !== this.hash) this.attach(); // it has come meanwhile
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
