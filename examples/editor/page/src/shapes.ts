// Shapes as the page has them: fetched once each, by the hash of their content.

import * as THREE from "three";
import { MeshBVH, acceleratedRaycast } from "three-mesh-bvh";
import type { ShapeInfo } from "./model";

THREE.Mesh.prototype.raycast = acceleratedRaycast;

/** points: of a polyline, about the centre of the shape; exact: the same as they were given. */
export interface Loaded { points: Float64Array; exact: Float64Array; triangles: number; mesh?: THREE.BufferGeometry }

export class ShapeStore {
  onLoad: () => void = () => {};
  private readonly known = new Map<string, Loaded | "coming">();

  /** What is drawn of a shape, about its centre; null while it is on its way. */
  get(info: ShapeInfo): Loaded | null {
    const found = this.known.get(info.hash);
    if (found === "coming") return null;
    if (found) return found;
    this.known.set(info.hash, "coming");
    void this.fetch(info);
    return null;
  }

  /** Forgets what no object has any more. */
  keep(used: Set<string>): void {
    for (const [hash, loaded] of this.known) {
      if (used.has(hash) || loaded === "coming") continue;
      loaded.mesh?.dispose();
      this.known.delete(hash);
    }
  }

  /** A ray through a mesh of many triangles is quick with a tree, which is built when the first ray comes. */
  prepareRays(): void {
    for (const loaded of this.known.values()) {
      if (loaded === "coming" || !loaded.mesh || loaded.mesh.boundsTree || loaded.triangles < 2000) continue;
      loaded.mesh.boundsTree = new MeshBVH(loaded.mesh, { indirect: true });
    }
  }

  private async fetch(info: ShapeInfo): Promise<void> {
    try {
      const answer = await fetch(`shapes/${info.hash}`);
      if (!answer.ok) throw new Error(answer.statusText);
      const data = await answer.arrayBuffer();
      this.known.set(info.hash, info.triangles ? mesh(info, data) : line(info, data));
      this.onLoad();
    } catch {
      setTimeout(() => { this.known.delete(info.hash); this.onLoad(); }, 1000);
    }
  }
}

function line(info: ShapeInfo, data: ArrayBuffer): Loaded {
  const exact = new Float64Array(data);
  return { points: exact.map((x, i) => x - info.centre[i % 3]!), exact, triangles: 0 };
}

function mesh(info: ShapeInfo, data: ArrayBuffer): Loaded {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(data, 0, info.points * 3), 3));
  geometry.setIndex(new THREE.BufferAttribute(new Uint32Array(data, info.points * 12, info.triangles * 3), 1));
  geometry.computeBoundingSphere();
  return { points: new Float64Array(), exact: new Float64Array(), triangles: info.triangles, mesh: geometry };
}
