import org.forceserver.*;

/**
 * A magnet with a battery: it draws the hand from all sides, most strongly 10 mm away, with 3 N. The gain is the charge
 * of the battery, 0 to 1, and may change at any time while the magnet is felt.
 */
public class Magnet {
  public static void main(String[] arguments) {
    try (Scene scene = new Scene(); Curve pull = Curve.expression("3 * d/0.01 * exp(0.5 - (d/0.01)^2/2)")) {  // d: m; N
      ForceObject magnet = ForceObject.of("magnet", Primitive.POINT)
          .front(Profile.of(ProfileKind.CUSTOM, Sense.ATTRACTIVE, 1, 0, 3).curve(pull));
      scene.set(magnet);
      Recipe.feel(scene, "at the magnet", 0, 0, 0);
      Recipe.feel(scene, "20 mm above it", 0, 0, 0.02);
      for (int charge = 100; charge >= 0; charge -= 25) {
        magnet.front().gain(charge / 100.0);
        scene.change(magnet, Part.PROFILES);  // not the pose: another client may move it
        Recipe.feel(scene, "10 mm above it, at " + charge + " %", 0, 0, 0.01);
      }
      Recipe.finish(scene, arguments);
    }
  }
}
