import java.nio.DoubleBuffer;
import java.nio.IntBuffer;
import org.forceserver.*;

/**
 * A peg in a hole: a tool of six points, and a plate with a hole that is 0.4 mm wider all around and 3 degrees askew.
 * The tip presses against one wall of the hole, and the upper points come to rest on the rim on the other side: the peg
 * jams. Each point has a proxy and a force of its own. The forces act beside the handle's origin, so they make a torque,
 * which turns the peg towards the direction of the hole. On a device that gives torques the peg then slips in.
 */
public class PegInHole {
  static final int SIDES = 48;                      // of the hole
  static final double ASKEW = 3;                    // degrees, about y
  static final double TOP = -0.02, TIP = -0.05;     // m: the height of the hole's mouth; where the tip is below the handle

  static double rounded(double value, double unit) {
    return Math.abs(value) < unit / 2 ? 0 : value;  // no "-0.0"
  }

  /** A round plate with a round hole, as a closed mesh: a rectangle that goes round the z axis. */
  static Shape plate() {
    double[] radius = {0.0084, 0.05, 0.05, 0.0084}, height = {-0.06, -0.06, 0, 0};  // m: the rectangle
    DoubleBuffer corners = Buffers.doubles(3 * 4 * SIDES);
    IntBuffer faces = Buffers.ints(3 * 8 * SIDES);
    for (int a = 0; a < 4 * SIDES; ++a) {
      double angle = 2 * Math.PI * (a / 4) / SIDES;
      corners.put(3 * a, radius[a % 4] * Math.cos(angle));
      corners.put(3 * a + 1, radius[a % 4] * Math.sin(angle));
      corners.put(3 * a + 2, height[a % 4]);
      int b = a - a % 4 + (a + 1) % 4, c = (a + 4) % (4 * SIDES), d = (b + 4) % (4 * SIDES);
      faces.put(6 * a, new int[] {a, c, b, b, c, d});  // counter-clockwise as seen from outside: that is the front
    }
    return Shape.mesh(corners, faces);
  }

  /** What happened to the peg. */
  static class Outcome {
    double depth, tilt;                 // at the end: mm of the peg in the hole, degrees between peg and hole
    double force, leastTorque, torque;  // the largest force upwards, N; the least and the largest torque about y, N m
  }

  /** Pushes the peg down for a second, and prints what the hand feels. */
  static Outcome push(String uri) throws InterruptedException {
    Outcome out = new Outcome();
    Vec3[] points = new Vec3[6];  // three around the tip; three 30 mm higher, between them
    for (int i = 0; i < 6; ++i) {
      double angle = i * Math.PI / 3, z = i % 2 != 0 ? TIP + 0.03 : TIP;
      points[i] = new Vec3(0.008 * Math.cos(angle), 0.008 * Math.sin(angle), z);
    }
    double half = Math.toRadians(ASKEW / 2);
    ServoOptions options = new ServoOptions().mode(ServoMode.VIRTUAL)  // time advances only when we step the servo
        .fade(-1).ramp(-1)    // felt in full from the first tick on: no person holds this handle;
        .maxStiffness(-1);    // nor is what the plate pushes back with bounded, to show the jam
    try (Scene scene = new Scene(); Shape shape = plate(); Device device = new Device(uri)) {
      scene.setTool(points);
      scene.set(ForceObject.of("plate", Primitive.MESH).shape(shape)
          .pose(new Pose(new Vec3(0, 0, TOP), new Quat(Math.cos(half), 0, Math.sin(half), 0)))
          // Stiffness and damping are for each point, whose forces add; the limit is for all points together.
          .contact(new Contact().keep(Keep.FRONT).stiffness(2000).damping(10).limit(20)));
      System.out.println("   time      depth      tilt   force: sideways, up     torque");
      try (Servo servo = new Servo(scene, device, options)) {
        for (int i = 1; i <= 1000; ++i) {
          servo.step(1);
          Hand hand = scene.hand();
          Quat q = hand.state().pose().orientation();
          Vec3 force = hand.response().wrench().force();
          double pegX = 2 * (q.x() * q.z() + q.w() * q.y());  // the direction of the peg
          double pegZ = 1 - 2 * (q.x() * q.x() + q.y() * q.y());
          double torque = hand.response().wrench().torque().y();
          out.tilt = ASKEW - Math.toDegrees(Math.atan2(pegX, pegZ));
          out.depth = 1e3 * (TOP - hand.state().pose().position().z() - TIP * pegZ);
          out.force = Math.max(out.force, force.z());
          out.torque = Math.max(out.torque, torque);
          out.leastTorque = Math.min(out.leastTorque, torque);
          if (i < 400 || i % 50 != 0) continue;
          System.out.printf("%5.2f s  %6.1f mm  %4.1f deg     %4.1f N   %4.1f N   %6.3f N m%n", i * 1e-3, out.depth,
              out.tilt, rounded(force.x(), 0.1), rounded(force.z(), 0.1), rounded(torque, 0.001));
        }
      }
    }
    return out;
  }

  static int failures = 0;

  static void expect(boolean holds, String sentence) {
    System.out.println((holds ? "yes: " : "NO: ") + sentence);
    if (!holds) ++failures;
  }

  public static void main(String[] arguments) throws InterruptedException {
    System.out.println("a handle that does not turn");  // a passive wrist: no torque comes from the device
    Outcome fixed = push("sim:?hand=firm&path=touch&wrist=passive");
    System.out.println("\na handle that turns");
    Outcome turning = push("sim:?hand=firm&path=touch&wrist=active");
    System.out.println();
    expect(fixed.depth > 30 && fixed.depth < 36 && fixed.force > 5, "the peg that does not turn jams, 30 mm deep");
    expect(fixed.torque > 0.05 && fixed.leastTorque > -0.005, "its torque always points to where the hole does");
    expect(turning.tilt < 2.2 && turning.leastTorque > -0.01, "this torque turns the other peg, until it fits");
    expect(turning.depth > 50, "so it slips in");
    System.exit(failures > 0 ? 1 : 0);
  }
}
