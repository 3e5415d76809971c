// The 3D view: camera, hand, workspace, picking. It draws only when something has changed.

import * as THREE from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import { type Vec, add, length, minus, rotate, times, toDevice } from "./frames";
import { make, put } from "./fields";
import { type Item, type Model } from "./model";
import { ShapeStore } from "./shapes";
import { onTheme, themed } from "./theme";
import { Things, newtonLength } from "./things";

const unitPixels = 13; // what is drawn of a point, of the hand and of a force has this for its unit

export class View {
  readonly scene = new THREE.Scene();
  readonly camera = new THREE.PerspectiveCamera(40, 1, 0.001, 100);
  readonly controls: OrbitControls;
  readonly shapes = new ShapeStore();
  readonly things: Things;
  /** The place of the device that is at 0 of the picture: what is drawn is near it, so that no digit is lost. */
  origin: Vec = [0, 0, 0];
  onDraw: (() => void)[] = [];
  private renderer!: THREE.WebGLRenderer;
  private readonly ray = new THREE.Raycaster();
  private readonly hand = new THREE.Group();
  private readonly halo = new THREE.Group();
  private readonly workspace = new THREE.Group();
  private workspaceSize = "";
  private least = 0.01; // m: as large as a point is when the view is fitted to it
  private axes = 0.04; // m
  private readonly letters = make("div", { className: "letters" }, ...axes.map(([, letter]) => make("b", { className: letter })));
  private behind!: THREE.Mesh;
  private isDirty = false;
  private rowsAreNew = true;

  constructor(readonly box: HTMLElement, readonly model: Model) {
    this.things = new Things(model, this.shapes);
    const antialias = !new URLSearchParams(location.search).has("noantialias");
    this.makeRenderer(antialias);
    this.scene.background = new THREE.Color(themed("view"));
    this.scene.add(this.things.root, this.hand, this.halo, this.workspace);
    this.scene.add(new THREE.HemisphereLight(0xffffff, 0x737c88, 1.5));
    const sun = new THREE.DirectionalLight(0xffffff, 2.1);
    sun.position.set(-3, 2.5, 1.5); // over the left shoulder, so that slopes are seen from the top too
    this.camera.add(sun);
    this.scene.add(this.camera);
    this.camera.up.set(0, 0, 1);
    this.camera.position.set(0.3, -0.45, 0.28);
    this.controls = new OrbitControls(this.camera, this.renderer.domElement);
    this.controls.zoomSpeed = 1.4;
    this.controls.addEventListener("change", () => this.request());
    this.shapes.onLoad = () => this.change();
    model.on(["objects", "picture", "selection"], () => this.change());
    model.on(["objects"], () => {
      const shapes = [...model.items.values()].flatMap((item) => item.told.shape ?? []);
      this.shapes.keep(new Set([...shapes.map((shape) => shape.hash), ...this.things.drawnShapes]));
      for (const shape of shapes) this.shapes.get(shape); // it is fetched while the picture is drawn
    });
    new ResizeObserver(() => this.resize()).observe(box);
    onTheme(() => {
      this.scene.background = new THREE.Color(themed("view"));
      this.workspaceSize = ""; // to be made anew
      this.change();
    });
    this.makeHand();
    this.resize();
  }

  get canvas(): HTMLCanvasElement { return this.renderer.domElement; }

  /** WebGL may be missing, or be lost for a while: then a sentence stands in its place. */
  private makeRenderer(antialias: boolean): void {
    this.renderer = new THREE.WebGLRenderer({ antialias, powerPreference: "low-power" });
    this.renderer.debug.checkShaderErrors = false; // to ask for errors is to wait for the compiler
    this.renderer.setPixelRatio(Math.min(window.devicePixelRatio, 2));
    const canvas = this.renderer.domElement;
    canvas.tabIndex = 0;
    canvas.setAttribute("aria-label", "3D view. Its content is in the table of objects.");
    this.box.prepend(canvas, this.letters);
    canvas.addEventListener("webglcontextlost", (event) => { event.preventDefault(); this.box.dataset.webgl = "lost"; });
    canvas.addEventListener("webglcontextrestored", () => { delete this.box.dataset.webgl; this.change(); });
  }

  /** m at the device that a pixel in the middle of the picture has. */
  get pixel(): number {
    const high = 2 * Math.tan((this.camera.fov * Math.PI) / 360) * this.camera.position.distanceTo(this.controls.target);
    return high / (this.box.clientHeight || 1);
  }

  /** Something of the scene has changed. */
  change(): void { this.rowsAreNew = true; this.request(); }
  /** The camera has moved, or what lies over the scene. */
  request(): void {
    if (this.isDirty) return;
    this.isDirty = true;
    requestAnimationFrame(() => { this.isDirty = false; this.draw(); });
  }

  private draw(): void {
    if (this.box.dataset.webgl === "lost" || this.model.told.serial === undefined) return; // nothing is known yet
    const unit = unitPixels * this.pixel;
    if (Math.abs(unit / this.things.unit - 1) > 0.02) {
      this.things.unit = unit;
      this.rowsAreNew = true;
      this.updateScale();
    }
    if (this.rowsAreNew) {
      this.rowsAreNew = false;
      this.updateWorkspace();
      this.updateHand();
      this.things.update(this.origin, this.renderer.getSize(new THREE.Vector2()));
      this.updateHalo();
    }
    const far = this.camera.position.distanceTo(this.controls.target);
    this.camera.near = far / 200;
    this.camera.far = far * 200;
    this.camera.updateProjectionMatrix();
    this.renderer.render(this.scene, this.camera);
    for (const f of this.onDraw) f();
    this.placeLetters();
  }

  private resize(): void {
    const { clientWidth: w, clientHeight: h } = this.box;
    if (!w || !h) return;
    this.renderer.setSize(w, h);
    this.camera.aspect = w / h;
    this.change();
  }

  // ---- Hand, workspace, selection

  private makeHand(): void {
    const form = new THREE.SphereGeometry(1, 20, 14);
    this.hand.add(new THREE.Mesh(form, new THREE.MeshLambertMaterial()));
    // The hand shines through what is in front of it.
    this.behind = new THREE.Mesh(form, new THREE.MeshBasicMaterial({ transparent: true, opacity: 0.35, depthTest: false }));
    this.behind.renderOrder = 5;
    this.scene.add(this.behind);
  }

  private updateHand(): void {
    const { model } = this, hand = model.hand;
    this.hand.visible = this.behind.visible = hand !== null;
    if (!hand) return;
    const points: { at: Vec; colour: number | string }[] = [{ at: model.handPlace, colour: themed("hand") }];
    for (const client of model.clients.values()) {
      const isPlain = client.points.length === 1 && length(client.points[0]!) === 0;
      if (isPlain && !client.held) continue; // it is at the hand
      for (const point of client.points) {
        const at = toDevice(client.frame, add(client.tool.position, rotate(client.tool.orientation, point)));
        points.push({ at, colour: model.colourOf(client.name) });
      }
    }
    while (this.hand.children.length < points.length) this.hand.add((this.hand.children[0] as THREE.Mesh).clone());
    this.hand.children.forEach((child, i) => {
      child.visible = i < points.length;
      const point = points[i];
      if (!point) return;
      const mesh = child as THREE.Mesh<THREE.BufferGeometry, THREE.MeshLambertMaterial>;
      if (i > 0 && mesh.material === (this.hand.children[0] as THREE.Mesh).material) mesh.material = mesh.material.clone();
      mesh.material.color.set(point.colour);
      mesh.position.set(...minus(point.at, this.origin));
      mesh.scale.setScalar(this.things.unit * (i === 0 ? 0.4 : 0.25));
      if (i === 0) {
        this.behind.position.copy(mesh.position);
        this.behind.scale.copy(mesh.scale);
        (this.behind.material as THREE.MeshBasicMaterial).color.copy(mesh.material.color);
      }
    });
  }

  private updateWorkspace(): void {
    const device = this.model.told.device as { workspace_radius: number; workspace_height: number } | undefined;
    this.workspace.position.set(-this.origin[0], -this.origin[1], -this.origin[2]);
    if (!device || this.workspaceSize === JSON.stringify(device)) return;
    this.workspaceSize = JSON.stringify(device);
    const r = device.workspace_radius || 0.15, h = device.workspace_height || 0.2;
    this.least = r / 15;
    this.things.planeSize = 2 * r;
    this.workspace.clear();
    const line = (points: Vec[], colour: string, opacity = 1) => {
      const geometry = new THREE.BufferGeometry().setFromPoints(points.map((p) => new THREE.Vector3(...p)));
      const material = new THREE.LineBasicMaterial({ color: colour, transparent: opacity < 1, opacity });
      this.workspace.add(new THREE.LineSegments(geometry, material));
    };
    const around = (i: number, z: number): Vec => [r * Math.cos((i * Math.PI) / 32), r * Math.sin((i * Math.PI) / 32), z];
    const rims: Vec[] = [];
    for (const z of [-h / 2, h / 2]) for (let i = 0; i < 64; ++i) rims.push(around(i, z), around(i + 1, z));
    for (let i = 0; i < 64; i += 16) rims.push(around(i, -h / 2), around(i, h / 2));
    line(rims, themed("rim"));
    const grid: Vec[] = [];
    const step = rounded(r / 3);
    for (let i = -Math.floor(r / step); i * step <= r * 1.001; ++i) {
      const x = i * step;
      const y = Math.sqrt(Math.max(0, r * r - x * x));
      grid.push([x, -y, -h / 2], [x, y, -h / 2], [-y, x, -h / 2], [y, x, -h / 2]);
    }
    line(grid, themed("grid"), 0.7);
    put(document.getElementById("grid-length")!, `grid ${metres(step)}`);
    this.axes = r * 0.25;
    for (const [axis, letter] of axes) line([[0, 0, 0], times(this.axes, axis)], themed(letter));
  }

  /** How long things are: that of the bar, a round length of about 70 pixels, and that of the arrow of 1 N. */
  private updateScale(): void {
    const long = rounded(70 * this.pixel), bar = document.getElementById("scale-bar")!;
    bar.style.width = `${long / this.pixel}px`;
    put(document.getElementById("scale-length")!, metres(long));
    document.getElementById("scale-newton")!.style.width = `${newtonLength * unitPixels}px`;
  }

  private placeLetters(): void {
    axes.forEach(([axis, letter], i) => {
      const element = this.letters.children[i] as HTMLElement, at = this.project(times(1.12 * this.axes, axis));
      element.style.transform = `translate(${at.x}px, ${at.y}px)`;
      element.hidden = !at.isInFront;
      put(element, letter);
    });
  }

  /** A box around each of the things that are selected. */
  private updateHalo(): void {
    this.halo.clear();
    for (const item of this.model.selection.slice(0, 64)) {
      if (this.model.hidden.has(item.told.id)) continue;
      const at = minus(item.place, this.origin), q = item.turn;
      const box = new THREE.LineSegments(haloBox, haloMaterial);
      box.position.set(...at);
      box.quaternion.set(q[1], q[2], q[3], q[0]);
      const radius = this.radiusOf(item);
      const flat = item.told.primitive === "plane";
      box.scale.set(radius * 2, radius * 2, flat ? this.least * 0.2 : radius * 2);
      if (flat) box.scale.multiply(new THREE.Vector3(Math.SQRT1_2, Math.SQRT1_2, 1));
      this.halo.add(box);
    }
  }

  /** m at the device. */
  radiusOf(item: Item): number {
    if (item.told.primitive === "plane") return this.things.planeSize * Math.SQRT1_2;
    if (item.told.shape) return Math.max(item.told.shape.radius * item.size * (item.told.primitive === "mesh" ? 0.62 : 1), 1e-6);
    return this.things.unit * 0.75;
  }

  // ---- Camera

  look(from: "top" | "front" | "side" | "free"): void {
    const distance = this.camera.position.distanceTo(this.controls.target);
    const towards = { top: [0, -1e-4, 1], front: [0, -1, 0], side: [1, 0, 0], free: [0.55, -0.75, 0.45] }[from];
    const step = new THREE.Vector3(...(towards as Vec)).normalize().multiplyScalar(distance);
    this.camera.position.copy(this.controls.target).add(step);
    this.controls.update();
    this.request();
  }

  /** Shows the selection, or the workspace where nothing is selected. The origin of the picture goes there. */
  fit(): void {
    const chosen = this.model.selection;
    const device = this.model.told.device as { workspace_radius: number } | undefined;
    let centre: Vec = [0, 0, 0], radius = (device?.workspace_radius ?? 0.15) * 1.25;
    if (chosen.length) {
      const lower: Vec = [Infinity, Infinity, Infinity], upper: Vec = [-Infinity, -Infinity, -Infinity];
      for (const item of chosen) {
        const at = item.place, r = item.told.primitive === "point" ? this.least : this.radiusOf(item);
        for (let i = 0; i < 3; ++i) {
          lower[i] = Math.min(lower[i]!, at[i]! - r);
          upper[i] = Math.max(upper[i]!, at[i]! + r);
        }
      }
      centre = [(lower[0] + upper[0]) / 2, (lower[1] + upper[1]) / 2, (lower[2] + upper[2]) / 2];
      radius = Math.max(length(minus(upper, lower)) / 2, 1e-5);
    }
    this.origin = centre;
    const towards = this.camera.position.clone().sub(this.controls.target).normalize();
    this.controls.target.set(0, 0, 0);
    const aspect = Math.min(1, this.camera.aspect);
    this.camera.position.copy(towards.multiplyScalar((radius * 1.15) / Math.sin((this.camera.fov * Math.PI) / 360) / aspect));
    this.controls.update();
    this.change();
    this.model.tell("picture"); // all has another place in it
  }

  // ---- Places in the picture

  private aim(x: number, y: number): void {
    const box = this.canvas.getBoundingClientRect();
    const at = new THREE.Vector2(((x - box.left) / box.width) * 2 - 1, 1 - ((y - box.top) / box.height) * 2);
    this.scene.updateMatrixWorld();
    this.ray.setFromCamera(at, this.camera);
    this.ray.params.Line2 = { threshold: 8 };
  }

  /** What is at this place of the window, and where on it the ray hits, at the device. */
  pick(x: number, y: number): { item: Item; at: Vec } | null {
    this.shapes.prepareRays();
    this.aim(x, y);
    const hits = this.ray.intersectObjects(this.things.targets, false);
    const found = hits.map((hit) => ({ hit, item: this.things.itemOf(hit) })).filter((one) => one.item);
    if (!found.length) return null;
    // What is small wins over the plane or mesh that it lies on or behind: else it could not be picked at all.
    const first = found[0]!;
    const isLarge = (item: Item) => item.told.primitive === "plane";
    const chosen = isLarge(first.item!) ? (found.find((one) => !isLarge(one.item!)) ?? first) : first;
    return { item: chosen.item!, at: add(chosen.hit.point.toArray() as Vec, this.origin) };
  }

  /** The first surface at this place of the window. */
  surface(x: number, y: number): { item: Item; at: Vec } | null {
    this.shapes.prepareRays();
    this.aim(x, y);
    for (const hit of this.ray.intersectObjects(this.things.targets, false)) {
      const item = this.things.itemOf(hit);
      if (item && (item.told.primitive === "plane" || item.told.primitive === "mesh")) {
        return { item, at: add(hit.point.toArray() as Vec, this.origin) };
      }
    }
    return null;
  }

  /** Where a place of the device is in the window, and whether it is in front of the camera. */
  project(at: Vec): { x: number; y: number; isInFront: boolean } {
    const p = new THREE.Vector3(...minus(at, this.origin)).project(this.camera);
    const box = this.canvas.getBoundingClientRect();
    return { x: ((p.x + 1) / 2) * box.width, y: ((1 - p.y) / 2) * box.height, isInFront: p.z < 1 };
  }
}

const axes: [Vec, string][] = [[[1, 0, 0], "x"], [[0, 1, 0], "y"], [[0, 0, 1], "z"]];

/** The largest of 1, 2, 5, 10 .. that is not larger. */
function rounded(x: number): number {
  const ten = 10 ** Math.floor(Math.log10(x) + 1e-9);
  return ten * ([5, 2].find((one) => one * ten <= x * 1.000001) ?? 1);
}
const metres = (x: number): string => {
  const [size, unit] = x >= 1 ? [1, "m"] : x >= 0.001 ? [1e3, "mm"] : [1e6, "µm"];
  return `${Number((x * (size as number)).toPrecision(3))} ${unit}`;
};

const haloBox = new THREE.EdgesGeometry(new THREE.BoxGeometry(1, 1, 1));
const haloMaterial = new THREE.LineBasicMaterial({ color: 0xe08a00 });
