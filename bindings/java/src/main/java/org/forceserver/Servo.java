package org.forceserver;

import java.util.List;
import java.util.Objects;

/**
 * The loop between a scene and a device. However it ends, the force is 0 first: by close(), when it is collected, and
 * when the JVM exits. A JVM that is killed can send nothing: then only the device's own watchdog ends the force.
 */
public final class Servo extends Handle {
  private static final long SLICE = 100;  // ticks after which close() and an interrupt are looked at

  /** Starts a servo in a real-time thread of its own, as by default. */
  public Servo(Scene scene, Device device) {
    this(scene, device, new ServoOptions());
  }

  /** Starts a servo. */
  public Servo(Scene scene, Device device, ServoOptions options) {
    this(scene, device, options, new Handle.Counted[1]);
  }

  private Servo(Scene scene, Device device, ServoOptions options, Handle.Counted[] self) {
    super(start(scene, device, options), pointer -> {
      Native.fs_servo_stop(pointer);
      Handle.AtExit.remove(self[0]);
    });
    self[0] = counted();
    Handle.AtExit.add(self[0]);
  }

  private static long start(Scene scene, Device device, ServoOptions options) {
    Objects.requireNonNull(scene, "scene");
    Objects.requireNonNull(device, "device");
    Handle.AtExit.prepare();
    return made(out -> scene.status(first -> device.status(second -> Native.fs_servo_start(first, second, options, out))));
  }

  /**
   * Runs so many ticks at once, in this thread, with a servo of mode CALLER or VIRTUAL. close() by another thread and
   * an interrupt end it early.
   */
  public void step(long ticks) throws InterruptedException {
    int status = 0;
    if (ticks < 0) throw new IllegalArgumentException("ticks is " + ticks + ", must be >= 0");
    for (long left = ticks; left > 0; left -= SLICE) {
      if (Thread.interrupted()) throw new InterruptedException();
      long now = Math.min(left, SLICE);
      status = status(servo -> Native.fs_servo_step(servo, now));
      if (status < 0 && status != Status.ERROR_DISCONNECTED.value()) break;  // a device that is lost may come back
    }
    ForceServerException.check(status);
  }

  /** false: no force, from the next tick on. true: it ramps up again, also after a fault that was kept. */
  public void setEnabled(boolean enabled) {
    call(servo -> Native.fs_servo_set_enabled(servo, enabled));
  }

  /** The flight record: the newest ticks, oldest first, 2 s at most. */
  public List<Tick> record() {
    long pointer = enter();
    try {
      return Buffers.list(Tick.SIZE, 2048,
          (out, capacity, count) -> Native.fs_servo_get_record(pointer, out, capacity, count), Tick::new);
    } finally {
      exit();
    }
  }

  /** Lets other processes in, at "shm:NAME". */
  public Server serve(String endpoint) {
    return serve(endpoint, new ServerOptions());
  }

  /** Lets other processes in. */
  public Server serve(String endpoint, ServerOptions options) {
    return new Server(this, made(out -> status(servo -> Native.fs_server_start(servo, endpoint, options, out))));
  }
}
