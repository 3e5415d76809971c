package org.forceserver;

import java.nio.ByteBuffer;

/** What the surface of a solid object does, such as stick and slip; never changes, and serves any number of objects. */
public final class Surface extends Handle {
  Surface(long pointer) {
    super(pointer, Native::fs_surface_destroy);
  }

  /** A surface of these settings. */
  public static Surface of(SurfaceSettings settings) {
    return new Surface(made(out -> Native.fs_surface_create(settings, out)));
  }

  /** A surface with a texture: heights (m, -1..0), the first row first, settings.columns() in each. */
  public static Surface texture(SurfaceSettings settings, double... heights) {
    return new Surface(made(out -> Native.fs_surface_create_texture(settings, Buffers.of(heights), heights.length, out)));
  }

  /** A surface with a texture whose heights an expression in x, y and z gives at the places of the grid. */
  public static Surface expression(SurfaceSettings settings, String text) {
    return new Surface(made(out -> Native.fs_surface_create_expression(settings, text, out)));
  }

  /** The heights of its texture, m; without one none. */
  public double[] heights() {
    long[] count = new long[1];
    ByteBuffer[] copy = new ByteBuffer[1];
    call(surface -> Shape.copy(Native.fs_surface_get_heights(surface, count), count[0] * 8, copy));
    double[] heights = new double[(int) count[0]];
    copy[0].asDoubleBuffer().get(heights);
    return heights;
  }

  /** Its settings. */
  public SurfaceSettings settings() {
    SurfaceSettings out = new SurfaceSettings();
    call(surface -> Native.fs_surface_get_settings(surface, out));
    return out;
  }
}
