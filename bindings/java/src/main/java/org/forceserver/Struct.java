package org.forceserver;

import java.nio.ByteBuffer;
import java.nio.charset.StandardCharsets;

/**
 * A struct of the contract: a view of memory in the byte order of the machine. A struct within a struct is a view of
 * the same memory, which it keeps. One thread at a time may use the same memory.
 */
public abstract class Struct {
  final Memory memory;
  final int at;
  private final int size;
  private final ByteBuffer mine;

  Struct(Memory memory, int at, int size) {
    this.memory = memory;
    this.at = at;
    this.size = size;
    mine = at == 0 && memory.bytes.capacity() == size ? memory.bytes : null;
  }

  /** The bytes of this struct alone, for a call. */
  final ByteBuffer bytes() {
    return mine != null ? mine : memory.bytes.slice(at, size);
  }

  /** Takes the values of another struct of the same class, and keeps the shapes and curves that it has. */
  final void copy(Struct other) {
    if (other.memory != memory || other.at != at) {
      memory.bytes.put(at, other.memory.bytes, other.at, size);
      memory.holdAsIn(other.memory, other.at, at, size);
    }
  }

  final String text(int place, int count) {
    byte[] text = new byte[count];
    memory.bytes.get(place, text);
    int length = 0;
    while (length < count && text[length] != 0) ++length;
    return new String(text, 0, length, StandardCharsets.UTF_8);
  }

  final void text(int place, int count, String value) {
    byte[] text = Text.bytes(value);
    if (text.length >= count) {
      throw new IllegalArgumentException("a text of " + text.length + " bytes: at most " + (count - 1) + " fit");
    }
    memory.bytes.put(place, new byte[count]);
    memory.bytes.put(place, text);
  }
}
