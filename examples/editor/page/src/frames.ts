// Poses and frames in double precision, as forceserver has them: quaternions are (w, x, y, z), object to parent.

export type Vec = [number, number, number];
export type Quat = [number, number, number, number];
export interface Pose { position: Vec; orientation: Quat }
/** x_device = pose * (x_scene / scale); a force at the device is force_scale times that of the scene. */
export interface Frame { pose: Pose; scale: number; force_scale: number }

export const identity: Pose = { position: [0, 0, 0], orientation: [1, 0, 0, 0] };

export const add = (a: Vec, b: Vec): Vec => [a[0] + b[0], a[1] + b[1], a[2] + b[2]];
export const minus = (a: Vec, b: Vec): Vec => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const times = (s: number, a: Vec): Vec => [s * a[0], s * a[1], s * a[2]];
export const dot = (a: Vec, b: Vec): number => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a: Vec, b: Vec): Vec =>
  [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const length = (a: Vec): number => Math.hypot(a[0], a[1], a[2]);

export function multiply(a: Quat, b: Quat): Quat {
  return [
    a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
    a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
    a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
    a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
  ];
}
export const conjugate = (q: Quat): Quat => [q[0], -q[1], -q[2], -q[3]];

export function rotate(q: Quat, v: Vec): Vec {
  const u: Vec = [q[1], q[2], q[3]];
  const t = times(2, cross(u, v));
  return add(add(v, times(q[0], t)), cross(u, t));
}

/** A place of a scene at the device, and back. */
export const toDevice = (f: Frame, x: Vec): Vec => add(f.pose.position, rotate(f.pose.orientation, times(1 / f.scale, x)));
export const fromDevice = (f: Frame, x: Vec): Vec =>
  times(f.scale, rotate(conjugate(f.pose.orientation), minus(x, f.pose.position)));

/** Turns about x, then y, then z of the parent, degrees. */
export function toDegrees(q: Quat): Vec {
  const [w, x, y, z] = q;
  const ahead = 1 - 2 * (y * y + z * z), aside = 2 * (w * z + x * y), level = Math.hypot(ahead, aside);
  const about = (v: number) => (v * 180) / Math.PI;
  const pitch = about(Math.atan2(2 * (w * y - z * x), level));
  if (level < 1e-9) return [about(2 * Math.atan2(x, w)), pitch, 0]; // straight up or down: x takes all of the turn
  return [about(Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))), pitch, about(Math.atan2(aside, ahead))];
}

export function fromDegrees(degrees: Vec): Quat {
  const half = degrees.map((d) => (d * Math.PI) / 360);
  const turn = (axis: number): Quat => {
    const q: Quat = [Math.cos(half[axis]!), 0, 0, 0];
    q[axis + 1] = Math.sin(half[axis]!);
    return q;
  };
  return multiply(turn(2), multiply(turn(1), turn(0)));
}
