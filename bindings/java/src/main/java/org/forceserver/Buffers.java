package org.forceserver;

import java.nio.Buffer;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.DoubleBuffer;
import java.nio.IntBuffer;
import java.util.ArrayList;
import java.util.List;
import java.util.Objects;
import java.util.function.BiFunction;

/**
 * Direct buffers for arrays: those of the caller are checked and used in place, from
 * position to limit, which stay as they are.
 */
public final class Buffers {
  /** A direct buffer of so many numbers, in the byte order of the machine: as all calls with arrays want it. */
  public static DoubleBuffer doubles(int count) {
    return ByteBuffer.allocateDirect(Math.multiplyExact(count, 8)).order(ByteOrder.nativeOrder()).asDoubleBuffer();
  }

  /** A direct buffer with these numbers. */
  public static DoubleBuffer of(double... numbers) {
    return doubles(numbers.length).put(0, numbers);
  }

  /** A direct buffer of so many numbers, in the byte order of the machine. */
  public static IntBuffer ints(int count) {
    return ByteBuffer.allocateDirect(Math.multiplyExact(count, 4)).order(ByteOrder.nativeOrder()).asIntBuffer();
  }

  /** A direct buffer with these numbers. */
  public static IntBuffer of(int... numbers) {
    return ints(numbers.length).put(0, numbers);
  }

  /** A direct buffer with the coordinates of these points: x, y, z of the first, then of the second. */
  public static DoubleBuffer points(Vec3... points) {
    DoubleBuffer buffer = doubles(3 * points.length);
    for (Vec3 point : points) buffer.put(point.x()).put(point.y()).put(point.z());
    return buffer.clear();
  }

  static DoubleBuffer in(String name, DoubleBuffer buffer) {
    check(name, buffer, Objects.requireNonNull(buffer, name).order());
    return buffer.position() == 0 && buffer.limit() == buffer.capacity() ? buffer : buffer.slice();
  }

  static IntBuffer in(String name, IntBuffer buffer) {
    check(name, buffer, Objects.requireNonNull(buffer, name).order());
    return buffer.position() == 0 && buffer.limit() == buffer.capacity() ? buffer : buffer.slice();
  }

  /** Where results go: `width` numbers for each of the `count` entries of what is read. */
  static DoubleBuffer out(String name, DoubleBuffer buffer, String inName, DoubleBuffer in, int count, int width) {
    if (Objects.requireNonNull(buffer, name).isReadOnly()) {
      throw new IllegalArgumentException(name + " is a buffer for reading only");
    }
    DoubleBuffer out = in(name, buffer);
    if (out.capacity() / width < count) {
      throw new IllegalArgumentException(name + " holds " + out.capacity() + " numbers; " + count + " " + inName + " need "
          + (long) count * width);
    }
    // Each entry of the very same memory is read before it is written.
    long from = Native.address_of(in), to = Native.address_of(out), bytes = 8L * count * width;
    if (from != to && from < to + bytes && to < from + bytes) {
      throw new IllegalArgumentException(inName + " and " + name + " overlap: give two separate buffers, or the same twice");
    }
    return out;
  }

  private static void check(String name, Buffer buffer, ByteOrder order) {
    if (!buffer.isDirect()) {
      throw new IllegalArgumentException(name + " is not a direct buffer: Buffers.doubles makes one");
    }
    if (order != ByteOrder.nativeOrder()) {
      throw new IllegalArgumentException(name + " has the order of bytes of another machine: " + order);
    }
  }

  /** How many entries of `width` numbers a buffer has. */
  static int count(String name, Buffer buffer, int width) {
    if (buffer.remaining() % width != 0) {
      throw new IllegalArgumentException(name + " holds " + buffer.remaining() + " numbers, must be a multiple of " + width);
    }
    return buffer.remaining() / width;
  }

  /** A call that fills a list. */
  interface Fill {
    int run(ByteBuffer out, long capacity, long[] count);
  }

  /** A list of the contract: asked again with more memory until all of it fits. */
  static <T> List<T> list(int size, int first, Fill fill, BiFunction<Memory, Integer, T> each) {
    long capacity = first;
    long[] count = new long[1];
    while (true) {
      Memory memory = new Memory(Math.toIntExact(capacity * size));
      ForceServerException.check(fill.run(memory.bytes, capacity, count));
      if (count[0] <= capacity) {
        List<T> list = new ArrayList<>((int) count[0]);
        for (int i = 0; i < count[0]; ++i) list.add(each.apply(memory, i * size));
        return list;
      }
      capacity = count[0] + count[0] / 4;
    }
  }

  private Buffers() {}
}
