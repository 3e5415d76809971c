import java.nio.DoubleBuffer;
import org.forceserver.*;

/**
 * Profiles of your own: an expression in the distance d and the time t, and a table of measured values. The program
 * prints the force of both at some distances; the pulse is limited to 5 N.
 */
public class CustomProfile {
  static DoubleBuffer forces(Curve curve, double t, DoubleBuffer distances) {
    DoubleBuffer forces = Buffers.doubles(distances.capacity());
    ForceServer.evaluate(Profile.of(ProfileKind.CUSTOM, Sense.REPULSIVE, 1, 0, 5).curve(curve), t, distances, forces);
    return forces;
  }

  public static void main(String[] arguments) {
    DoubleBuffer distances = Buffers.of(0, 0.0015, 0.003, 0.0045, 0.006);  // m
    try (Curve pulse = Curve.expression("3*(1+sin(12*t))*exp(-d/0.01)");
         Curve click = Curve.table(0.001, 2, 2.4, 2.6, 1.5, 0.4, 0.1, 0)) {  // a push-button: the force every millimetre
      DoubleBuffer atStart = forces(pulse, 0, distances), later = forces(pulse, 0.13, distances), table = forces(click, 0, distances);
      System.out.println("distance   pulse, t = 0 s   t = 0.13 s     click");
      for (int i = 0; i < 5; ++i) {
        System.out.printf("%5.1f mm %14.2f N %10.2f N %7.2f N%n", distances.get(i) * 1e3, atStart.get(i), later.get(i), table.get(i));
      }
    }
  }
}
