package org.forceserver;

import java.nio.ByteBuffer;
import java.nio.DoubleBuffer;
import java.nio.file.Path;
import java.util.List;
import java.util.Objects;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.ExecutionException;
import java.util.function.BiFunction;

/**
 * The force-objects of one application, in this process or at a server. Any thread may call anything; a
 * group ({@link Change}) is of one thread.
 */
public final class Scene extends Handle {
  private static final Twist STILL = new Twist(new Vec3(0, 0, 0), new Vec3(0, 0, 0));
  private static final double SLICE = 0.1;  // s, after which a wait looks at close() and at an interrupt

  /** An empty scene in this process. */
  public Scene() {
    this(made(Native::fs_scene_create));
  }

  private Scene(long pointer) {
    super(pointer, Native::fs_scene_destroy);
  }

  /**
   * A scene at a server: "shm:NAME"; NOT_FOUND at once where there is none. An interrupt ends the wait for the server's
   * answer: a thread of its own waits on, and gives back what comes. It ends after 2 s at most, or when the "timeout" in
   * the endpoint is over; until then it may get the name for a moment.
   */
  public static Scene connect(String endpoint, String clientName) throws InterruptedException {
    CompletableFuture<Scene> answer = new CompletableFuture<>();
    Thread thread = new Thread(() -> {
      try {
        Scene scene = new Scene(made(out -> Native.fs_scene_connect(endpoint, clientName, out)));
        if (!answer.complete(scene)) scene.close();  // nobody waits for it any more
      } catch (RuntimeException | Error e) {
        answer.completeExceptionally(e);
      }
    }, "forceserver connect");
    thread.setDaemon(true);
    thread.start();
    try {
      return answer.get();
    } catch (InterruptedException e) {
      if (!answer.cancel(false) && !answer.isCompletedExceptionally()) answer.join().close();
      throw e;
    } catch (ExecutionException e) {
      if (e.getCause() instanceof Error error) throw error;
      throw (RuntimeException) e.getCause();
    }
  }

  /** The same; waits for a server that is not there yet, timeout s at most. After an interrupt it asks no more. */
  public static Scene connect(String endpoint, String clientName, double timeout) throws InterruptedException {
    long end = end(timeout);
    while (true) {
      try {
        return connect(endpoint, clientName);
      } catch (ForceServerException e) {
        double left = left(end);
        if (e.status() != Status.ERROR_NOT_FOUND || left <= 0) throw e;
        Thread.sleep((long) Math.ceil(1e3 * Math.min(left, SLICE)));
      }
    }
  }

  // ---- Objects

  /** Adds an object, or changes the parts that differ of the one with its name. */
  public void set(ForceObject object) {
    Objects.requireNonNull(object, "object");
    call(scene -> {
      try (Memory.Lent lent = object.memory.lend(object)) {
        return Native.fs_object_set(scene, object);
      }
    });
  }

  /** A copy of an object; of a connected scene also another client's, "client/object". */
  public ForceObject get(String name) {
    ForceObject object = ForceObject.of("", Primitive.POINT);
    call(scene -> Native.fs_object_get(scene, name, object));
    try {
      object.takeHandles();
    } finally {
      Native.fs_object_release(object);
    }
    return object;
  }

  /** Takes only these parts of the object, for the one of its name: an editor does not undo the owner's moves. */
  public void change(ForceObject object, Part... parts) {
    int bits = 0;
    for (Part part : parts) bits |= part.value();
    int all = bits;
    Objects.requireNonNull(object, "object");
    call(scene -> {
      try (Memory.Lent lent = object.memory.lend(object)) {
        return Native.fs_object_change(scene, object, all);
      }
    });
  }

  /** Puts an object somewhere, where it stands still. */
  public void move(String name, Pose pose) {
    move(name, pose, STILL, Constants.NOW);
  }

  /** Moves an object; it has this motion from now on, for 0.1 s at most. */
  public void move(String name, Pose pose, Twist twist) {
    move(name, pose, twist, Constants.NOW);
  }

  /** Moves an object: where it is at `time` (s, scene's clock), and its motion from then on. */
  public void move(String name, Pose pose, Twist twist, double time) {
    Objects.requireNonNull(twist, "twist");
    Value first = Value.scratch(Objects.requireNonNull(pose, "pose")::write, 0), second = Value.scratch(twist::write, 1);
    call(scene -> Native.fs_object_move(scene, name, first, second, time));
  }

  /**
   * One of a stream of moves, as of what a tracker or a simulation follows: how the object moves is worked out from this
   * and the last move, if that is at most 0.2 s old. After the last one it comes to rest up to two steps too far.
   */
  public void stream(String name, Pose pose) {
    stream(name, pose, Constants.NOW);
  }

  /** The same: where it is at `time` (s, scene's clock). */
  public void stream(String name, Pose pose, double time) {
    Value value = Value.scratch(Objects.requireNonNull(pose, "pose")::write, 0);
    call(scene -> Native.fs_object_move(scene, name, value, null, time));
  }

  /** Removes an object; under a servo it fades out. */
  public void remove(String name) {
    call(scene -> Native.fs_object_remove(scene, name));
  }

  /** Removes all of the scene's own objects. */
  public void clear() {
    call(Native::fs_scene_clear);
  }

  // ---- Groups

  /**
   * Opens a group of the calling thread; other threads neither see it nor wait for it. It cannot be nested. Not for virtual
   * threads, as a group belongs to a thread of the operating system. An interrupted thread opens none.
   */
  public Change change() throws InterruptedException {
    if (Thread.interrupted()) throw new InterruptedException();
    int status = status(Native::fs_scene_begin);
    if (status == Status.ERROR_STATE.value()) throw new IllegalStateException("Scene.change() cannot be nested");
    ForceServerException.check(status);
    return new Change(this);
  }

  /** Takes the open group back. A scene that is closed, or whose server is gone, has none any more. */
  void cancel() {
    int status;
    try {
      status = status(Native::fs_scene_cancel);
    } catch (IllegalStateException closed) {
      return;
    }
    if (status != Status.ERROR_DISCONNECTED.value()) ForceServerException.check(status);
  }

  // ---- Waiting, in slices: an interrupt and close() end it

  private static long end(double timeout) {
    if (!(timeout >= 0)) throw new IllegalArgumentException("timeout is " + timeout + " s, must be >= 0");
    return System.nanoTime() + (long) (1e9 * Math.min(timeout, 1e9));
  }

  private static double left(long end) {
    return 1e-9 * (end - System.nanoTime());
  }

  /** Waits, timeout s at most, until a tick has used all changes so far. */
  public void sync(double timeout) throws InterruptedException {
    long end = end(timeout);
    while (true) {
      if (Thread.interrupted()) throw new InterruptedException();
      double left = Math.max(0, left(end));
      int status = status(scene -> Native.fs_scene_sync(scene, Math.min(left, SLICE)));
      if (status == Status.ERROR_TIMEOUT.value() && left > SLICE) continue;
      ForceServerException.check(status, timeout);
      return;
    }
  }

  /** The oldest event that was not fetched yet; waits for one, timeout s at most. None: its kind is NONE. */
  public Event nextEvent(double timeout) throws InterruptedException {
    long end = end(timeout);
    Event event = new Event();
    while (true) {
      if (Thread.interrupted()) throw new InterruptedException();
      double left = Math.max(0, left(end));
      call(scene -> Native.fs_scene_next_event(scene, Math.min(left, SLICE), event));
      if (event.kind() != EventKind.NONE || left <= SLICE) return event;
    }
  }

  // ---- Files

  /** Writes the scene's own objects, frame and tool as JSON; meshes beside it. */
  public void save(Path file) {
    String path = Objects.requireNonNull(file, "file").toString();
    call(scene -> Native.fs_scene_save(scene, path));
  }

  /** Adds or replaces the objects of a file, and sets frame and tool; all or nothing. */
  public void load(Path file) {
    String path = Objects.requireNonNull(file, "file").toString();
    call(scene -> Native.fs_scene_load(scene, path));
  }

  // ---- Frame, clutch, tool

  /** Sets the frame between the scene and the device. */
  public void setFrame(Frame frame) {
    Value value = Value.scratch(Objects.requireNonNull(frame, "frame")::write, 0);
    call(scene -> Native.fs_scene_set_frame(scene, value));
  }

  /** The frame, as the clutch may have moved it. */
  public Frame frame() {
    return frame(null);
  }

  /** The frame of another client of a connected scene. */
  public Frame frame(String client) {
    Value out = Value.scratch();
    call(scene -> Native.fs_scene_get_frame(scene, client, out));
    return Frame.read(out.memory.bytes, 0);
  }

  /** held: the hand moves, the tool stays and the force of this scene fades out. */
  public void setClutch(boolean held) {
    call(scene -> Native.fs_scene_set_clutch(scene, held));
  }

  /** Sets the tool's points, 1 to 32 (m, frame of the handle). */
  public void setTool(Vec3... points) {
    DoubleBuffer buffer = Buffers.points(points);
    call(scene -> Native.fs_scene_set_tool(scene, buffer, points.length));
  }

  /** The tool's points. */
  public List<Vec3> tool() {
    return list(Vec3.SIZE, Constants.TOOL_POINTS_MAX, Native::fs_scene_get_tool,
        (memory, at) -> Vec3.read(memory.bytes, at));
  }

  /** Sets the radius of the tool's points, m; 0: they are points. */
  public void setToolRadius(double radius) {
    call(scene -> Native.fs_scene_set_tool_radius(scene, radius));
  }

  /** The radius of the tool's points, m. */
  public double toolRadius() {
    double[] out = new double[1];
    call(scene -> Native.fs_scene_get_tool_radius(scene, out));
    return out[0];
  }

  /** Where the tool stands: frame, clutch and tool, all of one instant. */
  public View view() {
    return view(null);
  }

  /** The same of another client of a connected scene. */
  public View view(String client) {
    View view = new View();
    call(scene -> Native.fs_scene_get_view(scene, client, view));
    return view;
  }

  // ---- Accuracy, slope, clock

  /** The error in the force that evaluation may make to be faster, N; 0: exact. */
  public void setAccuracy(double newtons) {
    call(scene -> Native.fs_scene_set_accuracy(scene, newtons));
  }

  /** Bound of the summed slope of overlapping objects, N/m at the device; 0: what the servo can render. */
  public void setMaxStiffness(double stiffness) {
    call(scene -> Native.fs_scene_set_max_stiffness(scene, stiffness));
  }

  /** The scene's clock, s. */
  public double time() {
    double[] out = new double[1];
    call(scene -> Native.fs_scene_get_time(scene, out));
    return out[0];
  }

  /** From now on the clock is what the caller says, until it says more or a servo starts. */
  public void setTime(double time) {
    call(scene -> Native.fs_scene_set_time(scene, time));
  }

  // ---- What became of it

  /** All objects it can see. */
  public List<Report> reports() {
    return list(Report.SIZE, 64, Native::fs_scene_get_reports, Report::new);
  }

  /** What became of one object. */
  public Report report(String name) {
    Report report = new Report();
    call(scene -> Native.fs_scene_get_report(scene, name, report));
    return report;
  }

  /** How all objects move. */
  public List<Motion> motions() {
    return motions(null);
  }

  /** How the objects of one client move. */
  public List<Motion> motions(String client) {
    return list(Motion.SIZE, 64,
        (scene, out, capacity, count) -> Native.fs_scene_get_motions(scene, client, out, capacity, count), Motion::new);
  }

  /**
   * How those objects move that have changed since, in the order of motionRevision: of a client, or with null of all others.
   * since: the largest motionRevision of the last such list, or 0.
   */
  public List<Motion> motionsSince(String client, long since) {
    return list(Motion.SIZE, 64,
        (scene, out, capacity, count) -> Native.fs_scene_get_motions_since(scene, client, since, out, capacity, count),
        Motion::new);
  }

  /** The clients of the server of a connected scene; the server's own scene is the first. */
  public List<Client> clients() {
    return list(Client.SIZE, 32, Native::fs_scene_get_clients, Client::new);
  }

  /** The views of these clients, in the same order, with one request. */
  public List<ClientView> views() {
    return list(ClientView.SIZE, 32, Native::fs_scene_get_views, ClientView::new);
  }

  /** The flight record of the servo that runs this scene: its ticks with numbers above after, oldest first; 0: all. */
  public List<RecordedTick> record(long after) {
    return list(RecordedTick.SIZE, 64,
        (scene, out, capacity, count) -> Native.fs_scene_get_record(scene, after, out, capacity, count), RecordedTick::new);
  }

  /** Where the hand is and what it feels; without a servo an error. */
  public Hand hand() {
    State state = new State();
    Response response = new Response();
    Value sent = Value.scratch();
    call(scene -> Native.fs_scene_get_hand(scene, state, response, sent));
    return new Hand(state, response, Wrench.read(sent.memory.bytes, 0));
  }

  /** How the servo that runs this scene does. */
  public ServoStats servoStats() {
    ServoStats stats = new ServoStats();
    call(scene -> Native.fs_scene_get_servo_stats(scene, stats));
    return stats;
  }

  /** The device of the servo that runs this scene. */
  public DeviceInfo deviceInfo() {
    DeviceInfo info = new DeviceInfo();
    call(scene -> Native.fs_scene_get_device_info(scene, info));
    return info;
  }

  /** Ends the force of the servo that runs this scene, at once; only the servo's user lets it return. */
  public void stopForce() {
    call(Native::fs_scene_stop_force);
  }

  /** Lets the force of the servo that runs this scene return; for the servo's user, and root, alone. */
  public void resumeForce() {
    call(Native::fs_scene_resume_force);
  }

  /** A call that fills a list of this scene. */
  private interface Fill {
    int run(long scene, ByteBuffer out, long capacity, long[] count);
  }

  private <T> List<T> list(int size, int first, Fill fill, BiFunction<Memory, Integer, T> each) {
    long pointer = enter();
    try {
      return Buffers.list(size, first, (out, capacity, count) -> fill.run(pointer, out, capacity, count), each);
    } finally {
      exit();
    }
  }

  // ---- The field

  /**
   * forces: what a resting point feels at each of the positions, N; both direct buffers with three numbers a place.
   * It is the fast way for many places, on all processors.
   */
  public void evaluate(DoubleBuffer positions, DoubleBuffer forces) {
    evaluate(null, Constants.NOW, positions, forces);
  }

  /** The same of one own object, or of all (name null), at a time of the scene's clock. */
  public void evaluate(String name, double time, DoubleBuffer positions, DoubleBuffer forces) {
    DoubleBuffer in = Buffers.in("positions", positions);
    int count = Buffers.count("positions", in, 3);
    DoubleBuffer out = Buffers.out("forces", forces, "positions", in, count, 3);
    call(scene -> Native.fs_evaluate_field(scene, name, time, in, count, out));
  }

  /** What a resting point feels at one position, N. */
  public Vec3 evaluate(Vec3 position) {
    DoubleBuffer force = Buffers.doubles(3);
    evaluate(Buffers.points(position), force);
    return new Vec3(force.get(0), force.get(1), force.get(2));
  }
}
