package org.forceserver;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.DoubleBuffer;
import java.nio.IntBuffer;
import java.nio.file.Path;
import java.util.Objects;

/** The points of a polyline or the triangles of a mesh; never changes, and serves any number of objects. */
public final class Shape extends Handle {
  Shape(long pointer) {
    super(pointer, Native::fs_shape_destroy);
  }

  /** A polyline through these points (m, object frame). closed: the last is joined to the first. */
  public static Shape polyline(boolean closed, Vec3... points) {
    return polyline(closed, Buffers.points(points));
  }

  /** A polyline through points of three numbers each. */
  public static Shape polyline(boolean closed, DoubleBuffer points) {
    DoubleBuffer in = Buffers.in("points", points);
    int count = Buffers.count("points", in, 3);
    return new Shape(made(out -> Native.fs_shape_create_polyline(in, count, closed, out)));
  }

  /**
   * A mesh: points of three numbers each (m, object frame), triangles of three indices each, counter-clockwise as seen
   * from the front.
   */
  public static Shape mesh(DoubleBuffer points, IntBuffer triangles) {
    DoubleBuffer corners = Buffers.in("points", points);
    IntBuffer indices = Buffers.in("triangles", triangles);
    int cornerCount = Buffers.count("points", corners, 3), count = Buffers.count("triangles", indices, 3);
    return new Shape(made(out -> Native.fs_shape_create_mesh(corners, cornerCount, indices, count, out)));
  }

  /** A mesh from an .obj, .ply, .stl or .off file; scale: m per unit of the file. An interrupt does not end it. */
  public static Shape load(Path file, double scale) {
    String path = Objects.requireNonNull(file, "file").toString();
    return new Shape(made(out -> Native.fs_shape_load(path, scale, out)));
  }

  /** Builds the search tree now rather than at the first use; an interrupt does not end it. */
  public void build() {
    call(Native::fs_shape_build);
  }

  /** How much of the search tree is built, 0..1, also while another thread builds it; 1: it is built. */
  public double progress() {
    double[] out = new double[1];
    call(shape -> Native.fs_shape_get_progress(shape, out));
    return out[0];
  }

  /** What it is, and what is odd in it. */
  public ShapeInfo info() {
    ShapeInfo info = new ShapeInfo();
    call(shape -> Native.fs_shape_get_info(shape, info));
    return info;
  }

  /** A copy of the points: three numbers each. */
  public DoubleBuffer points() {
    long[] count = new long[1];
    ByteBuffer[] copy = new ByteBuffer[1];
    call(shape -> copy(Native.fs_shape_get_points(shape, count), count[0] * Vec3.SIZE, copy));
    return copy[0].asDoubleBuffer();
  }

  /** A copy of the triangles: three indices each; of a polyline none. */
  public IntBuffer triangles() {
    long[] count = new long[1];
    ByteBuffer[] copy = new ByteBuffer[1];
    call(shape -> copy(Native.fs_shape_get_triangles(shape, count), count[0] * 12, copy));
    return copy[0].asIntBuffer();
  }

  /** A copy of what lives with a handle, made while a call with the handle is under way. */
  static int copy(long address, long bytes, ByteBuffer[] out) {
    out[0] = ByteBuffer.allocateDirect(Math.toIntExact(bytes)).order(ByteOrder.nativeOrder());
    Native.copy_memory(address, out[0], bytes);
    return 0;
  }
}
