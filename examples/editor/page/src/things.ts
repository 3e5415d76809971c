// Draws the force-objects: points, planes and arrows in batches, polylines and meshes one by one. What they look like: looks.ts.

import * as THREE from "three";
import type { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { type Vec, length, minus } from "./frames";
import { type Drawn, Signs, drawLine, drawMesh, paintCross, paintWarning, planeLooks, pointLooks } from "./looks";
import { type Condition, type Item, type Model } from "./model";
import type { ShapeStore } from "./shapes";
import { themed } from "./theme";

const white = new THREE.Color(0xffffff), grey = new THREE.Color(0x9097a1), red = new THREE.Color(0xc0392b);
const matrix = new THREE.Matrix4(), colour = new THREE.Color(), up = new THREE.Vector3(0, 1, 0);
const place = new THREE.Vector3(), turn = new THREE.Quaternion(), size = new THREE.Vector3(), along = new THREE.Vector3();

/** The length of the arrow of 1 N, in units. */
export const newtonLength = 2;

/** Things of one form, drawn in one call. */
class Batch {
  readonly mesh: THREE.InstancedMesh;
  readonly items: Item[] = [];
  private count = 0;
  constructor(private readonly parent: THREE.Object3D, geometry: THREE.BufferGeometry, material: THREE.Material, private room = 64) {
    this.mesh = this.make(geometry, material);
  }
  private make(geometry: THREE.BufferGeometry, material: THREE.Material): THREE.InstancedMesh {
    const mesh = new THREE.InstancedMesh(geometry, material, this.room);
    mesh.frustumCulled = false;
    mesh.setColorAt(0, colour.set(0xffffff));
    this.parent.add(mesh);
    return mesh;
  }
  begin(): void { this.count = 0; this.items.length = 0; }
  add(item: Item, m: THREE.Matrix4, c: THREE.Color): void {
    if (this.count === this.room) this.grow();
    this.mesh.setMatrixAt(this.count, m);
    this.mesh.setColorAt(this.count, c);
    this.items.push(item);
    ++this.count;
  }
  private grow(): void {
    const old = this.mesh, oldColours = old.instanceColor!;
    this.room *= 2;
    const matrices = new Float32Array(this.room * 16), colours = new Float32Array(this.room * 3);
    matrices.set(old.instanceMatrix.array);
    colours.set(oldColours.array);
    old.dispose(); // the buffers of the old size
    old.instanceMatrix = new THREE.InstancedBufferAttribute(matrices, 16);
    old.instanceColor = new THREE.InstancedBufferAttribute(colours, 3);
  }
  end(): void {
    this.mesh.count = this.count;
    this.mesh.visible = this.count > 0;
    this.mesh.boundingSphere = null;
    this.mesh.instanceMatrix.needsUpdate = true;
    if (this.mesh.instanceColor) this.mesh.instanceColor.needsUpdate = true;
  }
}

interface Solo extends Drawn { hash: string; condition: Condition }

export class Things {
  readonly root = new THREE.Group();
  /** m at the device: how large points and arrows are, which keep their size on the screen, and the drawn part of a plane. */
  unit = 0.01;
  planeSize = 0.3;
  private readonly points = new Map<Condition, Batch>();
  private readonly planes = new Map<Condition, Batch>();
  private readonly borders: Batch;
  private readonly signs: Partial<Record<Condition, Signs>>;
  private readonly shafts: Batch;
  private readonly heads: Batch;
  private readonly contacts: Batch;
  private readonly solos = new Map<number, Solo>();
  private readonly arrows: THREE.Group = new THREE.Group();

  constructor(private readonly model: Model, private readonly shapes: ShapeStore) {
    for (const [looks, batches] of [[pointLooks(), this.points], [planeLooks(), this.planes]] as const) {
      for (const [condition, { geometry, material }] of Object.entries(looks)) {
        batches.set(condition as Condition, new Batch(this.root, geometry, material));
      }
    }
    const frame = new THREE.RingGeometry(0.985 * Math.SQRT1_2, Math.SQRT1_2, 4, 1).rotateZ(Math.PI / 4);
    this.borders = new Batch(this.root, frame, new THREE.MeshBasicMaterial({ side: THREE.DoubleSide }));
    this.signs = { expired: new Signs(this.root, paintCross), refused: new Signs(this.root, paintWarning) };
    this.root.add(this.arrows);
    const through = () => new THREE.MeshLambertMaterial({ depthTest: false });
    this.shafts = new Batch(this.arrows, new THREE.CylinderGeometry(1, 1, 1, 8).translate(0, 0.5, 0), through());
    this.heads = new Batch(this.arrows, new THREE.ConeGeometry(1, 1, 12).translate(0, 0.5, 0), through());
    this.shafts.mesh.renderOrder = this.heads.mesh.renderOrder = 6; // seen through what is in front of them
    this.contacts = new Batch(this.root, new THREE.TorusGeometry(1, 0.22, 6, 20), new THREE.MeshBasicMaterial());
  }

  /** What a ray may hit. */
  get targets(): THREE.Object3D[] {
    const batches = [...this.points.values(), ...this.planes.values()].map((batch) => batch.mesh);
    return [...batches.filter((mesh) => mesh.visible), ...[...this.solos.values()].map((solo) => solo.object)];
  }
  /** Of the meshes and polylines as they are drawn now: until a new shape has come, the old one stays. */
  get drawnShapes(): string[] { return [...this.solos.values()].map((solo) => solo.hash); }
  /** Of the forces that are drawn, for the tests. */
  get arrowCount(): number { return this.shafts.mesh.count; }
  itemOf(hit: THREE.Intersection): Item | undefined {
    if (hit.object.userData.item !== undefined) return this.model.items.get(hit.object.userData.item as number);
    for (const batch of [...this.points.values(), ...this.planes.values()]) {
      if (batch.mesh === hit.object) return batch.items[hit.instanceId ?? -1];
    }
    return undefined;
  }

  /** Draws all anew. origin: the place of the device that is at 0 of the picture. */
  update(origin: Vec, resolution: THREE.Vector2): void {
    const objects = [...this.points.values(), ...this.planes.values(), this.borders, ...Object.values(this.signs)];
    const batches = [...objects, this.shafts, this.heads, this.contacts];
    for (const batch of batches) batch.begin();
    const drawn = new Set<number>();
    for (const item of this.model.items.values()) {
      if (this.model.hidden.has(item.told.id)) continue;
      this.setPose(item, origin);
      const condition = item.condition;
      this.setColour(item, condition);
      if (item.told.primitive === "point") {
        size.setScalar(this.unit * 0.65);
        this.points.get(condition)!.add(item, matrix.compose(place, turn, size), colour);
      } else if (item.told.primitive === "plane") {
        size.setScalar(this.planeSize);
        this.planes.get(condition)!.add(item, matrix.compose(place, turn, size), colour);
        if (condition !== "expired") this.borders.add(item, matrix, colour);
      } else {
        this.drawSolo(item, condition, resolution);
        drawn.add(item.told.id);
      }
      this.signs[condition]?.add(place);
      this.drawForce(item, origin);
    }
    for (const [id, solo] of this.solos) if (!drawn.has(id)) this.dropSolo(id, solo);
    const sum = this.model.handPlace;
    for (const client of this.model.clients.values()) {
      colour.set(this.model.colourOf(client.name)).multiplyScalar(0.8);
      this.arrow(minus(sum, origin), this.model.forceOf(client), this.unit * 0.1, colour);
    }
    this.arrow(minus(sum, origin), this.model.sent, this.unit * 0.13, colour.set(themed("hand")));
    for (const batch of batches) batch.end();
  }

  private setPose(item: Item, origin: Vec): void {
    const at = minus(item.place, origin), q = item.turn;
    place.set(at[0], at[1], at[2]);
    turn.set(q[1], q[2], q[3], q[0]);
  }
  private setColour(item: Item, condition: Condition): void {
    if (condition === "refused") colour.copy(red);
    else if (condition === "disabled" || condition === "expired") colour.copy(grey);
    else colour.set(this.model.colourOf(item.told.client));
  }

  private drawForce(item: Item, origin: Vec): void {
    const force = item.push;
    if (!Number.isFinite(item.distance) || length(force) < 0.02) return;
    const at = minus(item.nearest, origin);
    colour.set(this.model.colourOf(item.told.client));
    this.arrow(at, force, this.unit * 0.09, colour);
    if (item.told.contact.keep !== "none") {
      size.setScalar(this.unit * 0.35);
      this.contacts.add(item, matrix.compose(place.set(...at), turn, size), colour);
    }
  }

  /** Beyond 8 N arrows grow slowly. */
  private arrow(from: Vec, force: Vec, radius: number, c: THREE.Color): void {
    const newtons = length(force);
    if (newtons < 0.02) return;
    const long = newtonLength * this.unit * (newtons < 8 ? newtons : 8 * (1 + Math.log(newtons / 8)));
    along.set(force[0], force[1], force[2]).normalize();
    turn.setFromUnitVectors(up, along);
    const head = Math.min(long * 0.4, radius * 6);
    place.set(from[0], from[1], from[2]);
    const none = undefined as unknown as Item;
    this.shafts.add(none, matrix.compose(place, turn, size.set(radius, long - head, radius)), c);
    place.addScaledVector(along, long - head);
    this.heads.add(none, matrix.compose(place, turn, size.set(radius * 2.4, head, radius * 2.4)), c);
  }

  // ---- Polylines and meshes

  private drawSolo(item: Item, condition: Condition, resolution: THREE.Vector2): void {
    const shape = item.told.shape;
    const id = item.told.id;
    let solo = this.solos.get(id);
    const loaded = shape && this.shapes.get(shape);
    if (solo && (solo.hash !== shape?.hash || solo.condition !== condition)) {
      if (!loaded) return; // the old one stays until the new one is here
      this.dropSolo(id, solo);
      solo = undefined;
    }
    if (!solo) {
      if (!shape || !loaded) return;
      const made = loaded.triangles ? drawMesh(loaded.mesh!, condition) : drawLine(loaded.points, shape.closed, condition);
      solo = { ...made, hash: shape.hash, condition };
      solo.object.userData.item = id;
      this.solos.set(id, solo);
      this.root.add(solo.object);
    }
    solo.object.position.copy(place);
    solo.object.quaternion.copy(turn);
    solo.object.scale.setScalar(item.size);
    solo.material.color.copy(colour);
    if (solo.isSurface) solo.material.color.lerp(white, 0.5); // a large surface is calm
    if (condition === "fading" || condition === "pending") solo.material.opacity = 0.15 + 0.5 * item.weight;
    if (solo.isWide) (solo.material as LineMaterial).resolution.copy(resolution);
  }

  private dropSolo(id: number, solo: Solo): void {
    this.root.remove(solo.object);
    solo.free();
    this.solos.delete(id);
  }
}
