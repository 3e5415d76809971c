import org.forceserver.*;

/** What the recipes share: they print the force at a place, and save the scene to a file. */
final class Recipe {
  static double rounded(double force) {
    return Math.abs(force) < 0.005 ? 0 : force;  // no "-0.00"
  }

  /** Prints what a hand feels that rests at (x, y, z), m. */
  static void feel(Scene scene, String where, double x, double y, double z) {
    Vec3 f = scene.evaluate(new Vec3(x, y, z));
    System.out.printf("%-26s (%5.1f, %5.1f, %5.1f) mm   (%5.2f, %5.2f, %5.2f) N%n", where, 1e3 * x, 1e3 * y, 1e3 * z,
        rounded(f.x()), rounded(f.y()), rounded(f.z()));
  }

  /** Writes the scene to the file that the first argument names, if there is one. */
  static void finish(Scene scene, String[] arguments) {
    if (arguments.length > 0) scene.save(java.nio.file.Path.of(arguments[0]));
  }

  private Recipe() {}
}
