package org.forceserver;

import java.nio.charset.StandardCharsets;
import java.util.Objects;

/**
 * A struct of the contract: a view of memory in the byte order of the machine. A struct within a struct is a view of
 * the same memory, which it keeps, and the entries of a list share one. While one thread changes such memory, or a call
 * fills it, no other thread may use it.
 */
public abstract class Struct {
  final Memory memory;
  final int at;
  final int size;
  private final long address;

  Struct(Memory memory, int at, int size) {
    this.memory = memory;
    this.at = at;
    this.size = size;
    address = memory.address + Objects.checkFromIndexSize(at, size, memory.bytes.capacity());
  }

  /** Where it stands, for a call that needs so many bytes; of null 0. The struct must live until the call has ended. */
  static long address(Struct struct, int size) {
    if (struct == null) return 0;
    if (struct.size < size) {
      throw new IllegalArgumentException("a struct of " + struct.size + " bytes: " + size + " are needed");
    }
    return struct.address;
  }

  /** Takes the values of another struct of the same class, and keeps the shapes, curves and surfaces that it has. */
  final void copy(Struct other) {
    if (other.memory != memory || other.at != at) {
      memory.bytes.put(at, other.memory.bytes, other.at, size);
      memory.holdAsIn(other.memory, other.at, at, size);
    }
  }

  /** Whether it is of the same class, has the same values, and the same shapes, curves and surfaces. */
  @Override public final boolean equals(Object other) {
    return other instanceof Struct that && getClass() == that.getClass()
        && memory.bytes.slice(at, size).equals(that.memory.bytes.slice(that.at, size))
        && memory.pointers(at, size).equals(that.memory.pointers(that.at, size));
  }

  /** Of its values: it changes with them. */
  @Override public final int hashCode() {
    return memory.bytes.slice(at, size).hashCode();
  }

  final String text(int place, int count) {
    byte[] text = new byte[count];
    memory.bytes.get(place, text);
    int length = 0;
    while (length < count && text[length] != 0) ++length;
    return new String(text, 0, length, StandardCharsets.UTF_8);
  }

  final void text(String name, int place, int count, String value) {
    byte[] text = Text.bytes(name, value);
    if (text.length >= count) {
      throw new IllegalArgumentException(name + " has " + text.length + " bytes, at most " + (count - 1) + " fit");
    }
    memory.bytes.put(place, new byte[count]);
    memory.bytes.put(place, text);
  }
}
