package org.forceserver;

import java.nio.DoubleBuffer;
import java.nio.file.Path;
import java.util.List;
import java.util.Objects;

/** What belongs to no handle. Units are SI; times are seconds; a struct's fields have their units in its comments. */
public final class ForceServer {
  /** The version of the library that runs: "0.9.0". */
  public static String version() {
    return Native.fs_version();
  }

  /** The pose at position whose z axis points along direction: a plane from point and normal. */
  public static Pose poseFromZ(Vec3 position, Vec3 direction) {
    Value out = Value.scratch();
    ForceServerException.check(Native.fs_pose_from_z(Value.of(position::write), Value.of(direction::write), out));
    return Pose.read(out.memory.bytes, 0);
  }

  /** The frame of a new scene: scene and device are the same. */
  public static Frame defaultFrame() {
    Value out = Value.scratch();
    Native.fs_frame_init(out);
    return Frame.read(out.memory.bytes, 0);
  }

  /** A pose of the device in the scene whose frame this is. */
  public static Pose toScene(Frame frame, Pose pose) {
    return through(frame, pose, Native::fs_frame_to_scene);
  }

  /** A pose of the scene whose frame this is at the device. */
  public static Pose toDevice(Frame frame, Pose pose) {
    return through(frame, pose, Native::fs_frame_to_device);
  }

  private interface Through {
    int call(Struct frame, Struct pose, Struct out);
  }

  private static Pose through(Frame frame, Pose pose, Through way) {
    Value from = Value.scratch(Objects.requireNonNull(frame, "frame")::write, 0);
    Value out = Value.scratch(Objects.requireNonNull(pose, "pose")::write, 1);
    ForceServerException.check(way.call(from, out, out));
    return Pose.read(out.memory.bytes, 0);
  }

  /** Where an object with this motion is at a time (s, on the scene's clock), of Scene.motions(). */
  public static Pose at(Motion motion, double time) {
    Value out = Value.scratch();
    ForceServerException.check(Native.fs_motion_at(Objects.requireNonNull(motion, "motion"), time, out));
    return Pose.read(out.memory.bytes, 0);
  }

  /** forces[i]: what the profile gives at distances[i] (m) and time t (s since the start of its object), in N. */
  public static void evaluate(Profile profile, double t, DoubleBuffer distances, DoubleBuffer forces) {
    evaluate(profile, 0, t, distances, forces);
  }

  /** The same with slopes limited to maxStiffness (N/m). */
  public static void evaluate(Profile profile, double maxStiffness, double t, DoubleBuffer distances, DoubleBuffer forces) {
    DoubleBuffer in = Buffers.in("distances", distances);
    DoubleBuffer out = Buffers.out("forces", forces, "distances", in, in.capacity(), 1);
    try (Memory.Lent lent = Objects.requireNonNull(profile, "profile").memory.lend(profile)) {
      int status = Native.fs_profile_evaluate(profile, maxStiffness, t, in, in.capacity(), out);
      ForceServerException.check(status);
    }
  }

  /**
   * forces[i]: what both sides of the object give at the signed distance distances[i] (m, > 0 in front) and time t (s since its
   * start), in N towards the front, with slopes limited to maxStiffness (N/m; 0: no limit).
   */
  public static void evaluateLaw(ForceObject object, double maxStiffness, double t, DoubleBuffer distances, DoubleBuffer forces) {
    DoubleBuffer in = Buffers.in("distances", distances);
    DoubleBuffer out = Buffers.out("forces", forces, "distances", in, in.capacity(), 1);
    try (Memory.Lent lent = Objects.requireNonNull(object, "object").memory.lend(object)) {
      int status = Native.fs_object_evaluate_law(object, maxStiffness, t, in, in.capacity(), out);
      ForceServerException.check(status);
    }
  }

  /** What the profile gives at one distance (m) and time t (s), in N. */
  public static double evaluate(Profile profile, double t, double distance) {
    DoubleBuffer force = Buffers.doubles(1);
    evaluate(profile, t, Buffers.of(distance), force);
    return force.get(0);
  }

  /** The devices that all drivers find now. */
  public static List<DeviceEntry> devices() {
    return Buffers.list(DeviceEntry.SIZE, 8, Native::fs_device_list, DeviceEntry::new);
  }

  /** The drivers that are known, by scheme. Loads all modules of drivers. */
  public static List<DriverInfo> drivers() {
    return Buffers.list(DriverInfo.SIZE, 8, Native::fs_driver_list, DriverInfo::new);
  }

  /** Adds the driver of a shared library that exports fs_driver_entry. A driver itself cannot be written in Java. */
  public static void loadDriver(Path library) {
    ForceServerException.check(Native.fs_driver_load(library.toString()));
  }

  /** Why a device in a state with these flags is not ready, in a sentence without a full stop; "": none of them says so. */
  public static String stateReason(int flags) {
    return Native.fs_state_reason(flags);
  }

  private ForceServer() {}
}
