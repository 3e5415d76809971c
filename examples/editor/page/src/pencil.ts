// Draws a polyline by clicks on planes and meshes; a click at its first point closes it.

import * as THREE from "three";
import { type Vec, fromDevice, minus } from "./frames";
import type { Model } from "./model";
import { type Orders, flat } from "./orders";
import { soft } from "./profiles";
import type { View } from "./view";

export class Pencil {
  private places: Vec[] = [];
  private readonly line: THREE.Line;
  private readonly box: HTMLElement;
  isOn = false;
  private isAdding = false;
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
      if (Math.hypot(at.x + box.left - x, at.y + box.top - y) < 9) return void this.finish(true);
    }
    const last = this.places.at(-1), near = last && this.view.project(last);
    if (near && Math.hypot(near.x + box.left - x, near.y + box.top - y) < 4) return void this.finish(false); // a double click
    const hit = this.view.surface(x, y);
    if (!hit) return this.orders.onNotice("Click on a plane or a mesh: a polyline is drawn on a surface.", false);
    this.places.push(hit.at.map((each) => Math.round(each * 1e6) / 1e6) as Vec); // to the micrometre
    this.changed();
  }
  back(): void { this.places.pop(); this.changed(); }

  async finish(isClosed: boolean): Promise<void> {
    if (this.isAdding) return;
    const inScene = this.places.map((place) => fromDevice(this.model.ownFrame, place));
    if (inScene.length < 2) return this.orders.onNotice("A polyline has two points at least.", false);
    const first = inScene[0]!;
    const points = inScene.map((p) => minus(p, first));
    this.isAdding = true;
    const isAdded = await this.orders.add("line", "polyline", { "pose.position": first, shape: { points, closed: isClosed }, ...flat("front", soft(0.02)) });
    this.isAdding = false;
    if (isAdded) this.cancel(); // else it can still be mended
  }

  private update(): void {
    this.places.forEach((place, i) => {
      const at = this.view.project(place);
      (this.box.children[i] as HTMLElement).style.transform = `translate(${at.x}px, ${at.y}px)`;
    });
  }
}
