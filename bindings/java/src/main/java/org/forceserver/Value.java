package org.forceserver;

import java.nio.ByteBuffer;

/** A record in memory, for a call. */
final class Value extends Struct {
  private static final int SIZE = 128;  // no record is larger
  private static final ThreadLocal<Value[]> SCRATCH =
      ThreadLocal.withInitial(() -> new Value[] {new Value(), new Value()});

  private Value() {
    super(new Memory(SIZE), 0, SIZE);
  }

  /** Memory of this thread, for what a call gives. */
  static Value scratch() {
    return SCRATCH.get()[0];
  }

  /** A record in memory of this thread; `which` keeps apart the two of the same call. */
  static Value scratch(Writer value, int which) {
    Value scratch = SCRATCH.get()[which];
    value.write(scratch.memory.bytes, 0);
    return scratch;
  }

  /** A record in memory of its own. */
  static Value of(Writer value) {
    Value made = new Value();
    value.write(made.memory.bytes, 0);
    return made;
  }

  /** A record's write. */
  interface Writer {
    void write(ByteBuffer memory, int at);
  }
}
