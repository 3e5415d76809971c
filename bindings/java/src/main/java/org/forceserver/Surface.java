package org.forceserver;

/** What the surface of a solid object does, such as stick and slip; never changes, and serves any number of objects. */
public final class Surface extends Handle {
  Surface(long pointer) {
    super(pointer, Native::fs_surface_destroy);
  }

  /** A surface of these settings. */
  public static Surface of(SurfaceSettings settings) {
    return new Surface(made(out -> Native.fs_surface_create(settings, out)));
  }

  /** Its settings. */
  public SurfaceSettings settings() {
    SurfaceSettings out = new SurfaceSettings();
    call(surface -> Native.fs_surface_get_settings(surface, out));
    return out;
  }
}
