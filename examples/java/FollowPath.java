import org.forceserver.*;

/**
 * A path to follow: a polyline draws the hand towards it. Without the path this hand would go straight, up to 30 mm
 * away from the polyline; with it, the hand stays within 9 mm.
 */
public class FollowPath {
  public static void main(String[] arguments) throws InterruptedException {
    Vec3[] points = new Vec3[51];  // a wave, 0.2 m long
    for (int i = 0; i < 51; ++i) points[i] = new Vec3(-0.1 + 0.004 * i, 0.03 * Math.sin(i * 0.125), 0);
    ServoOptions options = new ServoOptions().mode(ServoMode.VIRTUAL);  // time advances only when we step the servo
    try (Scene scene = new Scene(); Shape wave = Shape.polyline(false, points); Device device = new Device("sim:?path=sweep")) {
      scene.set(ForceObject.of("path", Primitive.POLYLINE).shape(wave)
          .front(Profile.of(ProfileKind.LINEAR_INCREASING, Sense.ATTRACTIVE, 400, 0, 8)));  // 400 N/m, 8 N at most
      try (Servo servo = new Servo(scene, device, options)) {
        for (int i = 0; i < 8; ++i) {
          servo.step(500);
          System.out.printf("the hand is %.1f mm beside the path%n", scene.report("path").distance() * 1e3);
        }
      }
    }
  }
}
