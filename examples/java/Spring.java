import org.forceserver.*;

/**
 * A spring to the centre, which a real-time servo renders to a simulated hand that draws an eight. The force is 5 N at
 * most, from 25 mm from the centre on.
 */
public class Spring {
  static double length(Vec3 v) {
    return Math.sqrt(v.x() * v.x() + v.y() * v.y() + v.z() * v.z());
  }

  public static void main(String[] arguments) throws InterruptedException {
    try (Scene scene = new Scene(); Device device = new Device("sim:?path=figure8")) {
      scene.set(ForceObject.of("spring", Primitive.POINT)  // at the origin: 200 N/m, 5 N at most
          .front(Profile.of(ProfileKind.LINEAR_INCREASING, Sense.ATTRACTIVE, 200, 0, 5)));
      try (Servo servo = new Servo(scene, device)) {  // felt until it is closed; then the force is 0 first
        for (int i = 0; i < 10; ++i) {
          Thread.sleep(200);
          Hand hand = scene.hand();
          System.out.printf("the hand is %5.1f mm from the centre and feels %.2f N%n",
              length(hand.state().pose().position()) * 1e3, length(hand.sent().force()));
        }
      }
    }
  }
}
