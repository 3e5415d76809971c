package org.forceserver;

import java.nio.ByteBuffer;

/** The function f(d, t) of a custom profile, N; never changes, and serves any number of profiles. */
public final class Curve extends Handle {
  Curve(long pointer) {
    super(pointer, Native::fs_curve_destroy);
  }

  /** A table: forces (N) at 0, step, 2 step.. (m), smooth between them; the last value holds beyond. */
  public static Curve table(double step, double... forces) {
    for (int i = 0; i < forces.length; ++i) {
      if (!Double.isFinite(forces[i])) {
        throw new IllegalArgumentException("entry " + i + " of the table is " + forces[i] + ", must be finite");
      }
    }
    return new Curve(made(out -> Native.fs_curve_create_table(Buffers.of(forces), forces.length, step, out)));
  }

  /** An expression in d (m) and t (s), such as "3*(1+sin(12*t))*exp(-d/0.01)". */
  public static Curve expression(String text) {
    return new Curve(made(out -> Native.fs_curve_create_expression(text, out)));
  }

  /** The text of an expression; of a table null. */
  public String expression() {
    String[] text = new String[1];
    call(curve -> {
      text[0] = Native.fs_curve_get_expression(curve);
      return 0;
    });
    return text[0];
  }

  /** The entries of a table, N; of an expression none. */
  public double[] table() {
    long[] count = new long[1];
    ByteBuffer[] copy = new ByteBuffer[1];
    call(curve -> Shape.copy(Native.fs_curve_get_table(curve, count, new double[1]), count[0] * 8, copy));
    double[] forces = new double[(int) count[0]];
    copy[0].asDoubleBuffer().get(forces);
    return forces;
  }

  /** The step of a table, m; of an expression 0. */
  public double step() {
    double[] step = new double[1];
    call(curve -> {
      Native.fs_curve_get_table(curve, new long[1], step);
      return 0;
    });
    return step[0];
  }
}
