import org.forceserver.*;

/**
 * Hello: a wall that the hand feels. A simulated hand wants to be 20 mm behind the wall, for two seconds. It comes to
 * rest 4.4 mm deep, where the wall pushes back with 500 N/m * 4.4 mm = 2.2 N, as hard as the hand does.
 */
public class Hello {
  public static void main(String[] arguments) throws InterruptedException {
    Vec3 point = new Vec3(0, 0, 0), up = new Vec3(0, 0, 1);
    ForceObject wall = ForceObject.wall("wall", point, up, 500, 10);  // free above z = 0; 500 N/m, 10 N at most
    ServoOptions options = new ServoOptions().mode(ServoMode.VIRTUAL);  // time advances when we step
    try (Scene scene = new Scene(); Device device = new Device("sim:?hold=0,0,-0.02")) {
      scene.set(wall);
      try (Servo servo = new Servo(scene, device, options)) {
        for (int i = 1; i <= 8; ++i) {
          servo.step(250);
          Hand hand = scene.hand();
          System.out.printf("%.2f s: the hand is at %6.2f mm and feels %.2f N%n", i * 0.25,
              hand.state().pose().position().z() * 1e3, hand.sent().force().z());
        }
      }
    }
  }
}
