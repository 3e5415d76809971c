// How an object is felt, told by its form and not by its colour alone:
//
//     felt      full
//     fading    translucent, and so is what is pending
//     disabled  sparse: the wires of a surface, a dashed line
//     expired   dotted, with a cross on it
//     refused   wires or a thin line, with a warning sign on it
//
// Points and planes are drawn in batches, and all signs of a kind in one call, so that thousands cost little.

import * as THREE from "three";
import { LineMaterial } from "three/addons/lines/LineMaterial.js";
import { LineSegments2 } from "three/addons/lines/LineSegments2.js";
import { LineSegmentsGeometry } from "three/addons/lines/LineSegmentsGeometry.js";
import type { Condition } from "./model";

// Triangles whose wires are drawn, at most: those of a fine mesh would fill its surface and hide the sign on it.
const mostWired: Partial<Record<Condition, number>> = { disabled: 3000, expired: 3000, refused: 700 };

/** The back of a surface is darker, with stripes, so that front and back are told apart without colour. */
function markBack<M extends THREE.Material>(material: M): M {
  material.onBeforeCompile = (shader) => {
    shader.fragmentShader = shader.fragmentShader.replace(
      "#include <color_fragment>",
      `#include <color_fragment>
       if (!gl_FrontFacing) {
         diffuseColor.rgb = mix(diffuseColor.rgb, vec3(0.25, 0.16, 0.10), mod(gl_FragCoord.x + gl_FragCoord.y, 8.0) < 4.0 ? 0.62 : 0.48);
       }`,
    );
  };
  return material;
}

const wire = () => new THREE.MeshBasicMaterial({ wireframe: true });

/** A surface of dots; a ray meets all of it. */
function dotted(across: number, along: number): THREE.Material {
  const size = 16, dot = new Uint8Array(size * size * 4);
  for (let i = 0; i < size * size; ++i) {
    const isIn = Math.hypot((i % size) - size / 2 + 0.5, Math.floor(i / size) - size / 2 + 0.5) < size * 0.22;
    dot.fill(isIn ? 255 : 0, 4 * i, 4 * i + 4);
  }
  const texture = new THREE.DataTexture(dot, size, size);
  texture.wrapS = texture.wrapT = THREE.RepeatWrapping;
  texture.minFilter = texture.magFilter = THREE.LinearFilter;
  texture.repeat.set(across, along);
  texture.needsUpdate = true;
  return new THREE.MeshBasicMaterial({ alphaMap: texture, alphaTest: 0.5, side: THREE.DoubleSide });
}

interface Look { geometry: THREE.BufferGeometry; material: THREE.Material }

export function pointLooks(): Record<Condition, Look> {
  const ball = new THREE.SphereGeometry(1, 16, 10), diamond = new THREE.OctahedronGeometry(1.1);
  const faint = new THREE.MeshLambertMaterial({ transparent: true, opacity: 0.45 });
  return {
    felt: { geometry: ball, material: new THREE.MeshLambertMaterial() },
    fading: { geometry: ball, material: faint },
    pending: { geometry: new THREE.OctahedronGeometry(1), material: faint },
    disabled: { geometry: diamond, material: wire() },
    expired: { geometry: ball, material: dotted(8, 4) },
    refused: { geometry: diamond, material: wire() },
  };
}

/** All but the expired ones have a border as well. */
export function planeLooks(): Record<Condition, Look> {
  const quad = new THREE.PlaneGeometry(1, 1), lattice = new THREE.PlaneGeometry(1, 1, 4, 4);
  const full = (opacity: number) =>
    markBack(new THREE.MeshLambertMaterial({ transparent: true, opacity, side: THREE.DoubleSide, depthWrite: false }));
  return {
    felt: { geometry: quad, material: full(0.42) },
    fading: { geometry: quad, material: full(0.2) },
    pending: { geometry: quad, material: full(0.2) },
    disabled: { geometry: lattice, material: wire() },
    expired: { geometry: quad, material: dotted(16, 16) },
    refused: { geometry: quad, material: wire() },
  };
}

/** A polyline or mesh. object is also what a ray meets; free gives back what it has alone. */
export interface Drawn {
  object: THREE.Object3D;
  material: THREE.Material & { color: THREE.Color };
  isWide: boolean; // a line of several pixels
  isSurface: boolean;
  free: () => void;
}

const unseen = new THREE.MeshBasicMaterial({ visible: false, side: THREE.DoubleSide });

export function drawMesh(geometry: THREE.BufferGeometry, condition: Condition): Drawn {
  if (condition === "felt" || condition === "fading" || condition === "pending") {
    const transparent = condition !== "felt";
    const material = markBack(new THREE.MeshLambertMaterial({ side: THREE.DoubleSide, flatShading: true, transparent }));
    return { object: new THREE.Mesh(geometry, material), material, isWide: false, isSurface: true, free: () => material.dispose() };
  }
  const radius = geometry.boundingSphere?.radius || 1, edges = edgesOf(geometry, mostWired[condition]!);
  const material = condition === "expired"
    ? new THREE.LineDashedMaterial({ dashSize: 0.015 * radius, gapSize: 0.04 * radius }) : new THREE.LineBasicMaterial();
  const lines = new THREE.LineSegments(edges, material);
  if (condition === "expired") lines.computeLineDistances();
  const object = new THREE.Mesh(geometry, unseen).add(lines); // a ray meets the whole surface
  return { object, material, isWide: false, isSurface: false, free: () => { edges.dispose(); material.dispose(); } };
}

/** The edges of its triangles, or of so many of them, spread over all. */
function edgesOf(geometry: THREE.BufferGeometry, most: number): THREE.BufferGeometry {
  const index = geometry.index!.array, places = geometry.getAttribute("position").array;
  const count = index.length / 3, step = Math.max(1, count / most), ends: number[] = [];
  for (let t = 0; t < count; t += step) {
    const first = 3 * Math.floor(t);
    for (const corner of [0, 1, 1, 2, 2, 0]) {
      const at = 3 * index[first + corner]!;
      ends.push(places[at]!, places[at + 1]!, places[at + 2]!);
    }
  }
  return new THREE.BufferGeometry().setAttribute("position", new THREE.Float32BufferAttribute(ends, 3));
}

const dashes: Partial<Record<Condition, { dashSize: number; gapSize: number }>> =
  { disabled: { dashSize: 20, gapSize: 13 }, expired: { dashSize: 5, gapSize: 11 } }; // of 200 for its radius

export function drawLine(points: Float64Array, isClosed: boolean, condition: Condition): Drawn {
  const pairs: number[] = [], count = points.length / 3;
  for (let i = 0; i + 1 < count + (isClosed ? 1 : 0); ++i) {
    const j = (i + 1) % count;
    pairs.push(points[3 * i]!, points[3 * i + 1]!, points[3 * i + 2]!, points[3 * j]!, points[3 * j + 1]!, points[3 * j + 2]!);
  }
  const dash = dashes[condition];
  const transparent = condition === "fading" || condition === "pending";
  const material = new LineMaterial({ linewidth: condition === "felt" ? 4 : 2.5, transparent, dashed: dash !== undefined, ...dash });
  const geometry = new LineSegmentsGeometry().setPositions(new Float32Array(pairs));
  const object = new LineSegments2(geometry, material);
  if (dash) {
    geometry.computeBoundingSphere();
    material.dashScale = 200 / (geometry.boundingSphere?.radius || 1);
    object.computeLineDistances();
  }
  return { object, material, isWide: true, isSurface: false, free: () => { geometry.dispose(); material.dispose(); } };
}

/** Signs of one kind that stand on objects: of the same size at any distance, and before everything. */
export class Signs {
  private places = new Float32Array(3 * 64);
  private count = 0;
  private readonly points: THREE.Points;

  constructor(parent: THREE.Object3D, paint: (on: CanvasRenderingContext2D) => void) {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = 64;
    paint(canvas.getContext("2d")!);
    const map = new THREE.CanvasTexture(canvas);
    map.colorSpace = THREE.SRGBColorSpace;
    const material = new THREE.PointsMaterial({ map, size: 20, sizeAttenuation: false, transparent: true, depthTest: false });
    this.points = new THREE.Points(new THREE.BufferGeometry(), material);
    this.points.frustumCulled = false;
    this.points.renderOrder = 4; // the hand and arrows come after
    this.attach();
    parent.add(this.points);
  }
  private attach(): void {
    this.points.geometry.dispose();
    this.points.geometry.setAttribute("position", new THREE.BufferAttribute(this.places, 3));
  }
  begin(): void { this.count = 0; }
  add(at: THREE.Vector3): void {
    if (3 * this.count === this.places.length) {
      const old = this.places;
      this.places = new Float32Array(2 * old.length);
      this.places.set(old);
      this.attach();
    }
    at.toArray(this.places, 3 * this.count++);
  }
  end(): void {
    this.points.geometry.setDrawRange(0, this.count);
    this.points.geometry.getAttribute("position").needsUpdate = true;
    this.points.visible = this.count > 0;
  }
}

export function paintCross(on: CanvasRenderingContext2D): void {
  for (const [colour, width] of [["#ffffff", 16], ["#4a525c", 9]] as const) {
    on.strokeStyle = colour;
    on.lineWidth = width;
    on.beginPath();
    for (const [from, to] of [[14, 50], [50, 14]] as const) {
      on.moveTo(from, 14);
      on.lineTo(to, 50);
    }
    on.stroke();
  }
}

export function paintWarning(on: CanvasRenderingContext2D): void {
  on.beginPath();
  for (const [x, y] of [[32, 5], [61, 58], [3, 58]] as const) on.lineTo(x, y);
  on.closePath();
  on.fillStyle = "#c0392b";
  on.strokeStyle = "#ffffff";
  on.lineWidth = 4;
  on.lineJoin = "round";
  on.fill();
  on.stroke();
  on.fillStyle = "#ffffff";
  on.fillRect(28.5, 23, 7, 18);
  on.fillRect(28.5, 45, 7, 7);
}
