package org.forceserver;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.Map;
import java.util.TreeMap;
import java.util.concurrent.locks.ReentrantLock;
import java.util.function.LongFunction;

/**
 * The bytes of one or several structs, and the shapes, curves and surfaces that they hold. A pointer stands in the bytes only
 * while a call is under way that was lent a struct: between lend() and close(). So no pointer outlives what it points to.
 */
final class Memory {
  final ByteBuffer bytes;
  final long address;
  private final ReentrantLock lent = new ReentrantLock();
  private final TreeMap<Integer, Handle> held = new TreeMap<>();  // by the place of the pointer

  Memory(int size) {
    bytes = ByteBuffer.allocateDirect(size).order(ByteOrder.nativeOrder());
    address = Native.address_of(bytes);
  }

  Handle held(int at) {
    lent.lock();
    try {
      return held.get(at);
    } finally {
      lent.unlock();
    }
  }

  void hold(int at, Handle handle) {
    lent.lock();
    try {
      if (handle == null) held.remove(at);
      else held.put(at, handle);
    } finally {
      lent.unlock();
    }
  }

  /** What [from, from + size) of the other memory holds, this holds at `at`, and nothing else there. */
  void holdAsIn(Memory other, int from, int at, int size) {
    Map<Integer, Handle> theirs;
    other.lent.lock();
    try {
      theirs = new TreeMap<>(other.held.subMap(from, from + size));
    } finally {
      other.lent.unlock();
    }
    lent.lock();
    try {
      held.subMap(at, at + size).clear();
      theirs.forEach((place, handle) -> held.put(place - from + at, handle));
    } finally {
      lent.unlock();
    }
  }

  /** Lends a struct in this memory: writes the pointers of what it holds, which nobody can give back until close(). */
  Lent lend(Struct struct) {
    lent.lock();
    Lent made = new Lent(held.subMap(struct.at, struct.at + struct.size));
    try {
      made.enter();
      return made;
    } catch (RuntimeException e) {
      made.close();
      throw e;
    }
  }

  /** A struct that is lent to a call. */
  final class Lent implements AutoCloseable {
    private final Map<Integer, Handle> handles;
    private int entered;

    private Lent(Map<Integer, Handle> handles) {
      this.handles = handles;
    }

    private void enter() {
      for (Map.Entry<Integer, Handle> entry : handles.entrySet()) {
        bytes.putLong(entry.getKey(), entry.getValue().enter());
        ++entered;
      }
    }

    @Override public void close() {
      for (Map.Entry<Integer, Handle> entry : handles.entrySet()) {
        if (entered-- == 0) break;
        bytes.putLong(entry.getKey(), 0);
        entry.getValue().exit();
      }
      lent.unlock();
    }
  }

  /** A handle that the library gave in a struct becomes one of its own. */
  void take(int place, LongFunction<Handle> retain) {
    long pointer = bytes.getLong(place);
    if (pointer == 0) return;
    hold(place, retain.apply(pointer));
    bytes.putLong(place, 0);
  }

  /** The pointers of what a struct holds, by their places within it. */
  Map<Integer, Long> pointers(int at, int size) {
    Map<Integer, Long> found = new TreeMap<>();
    lent.lock();
    try {
      held.subMap(at, at + size).forEach((place, handle) -> found.put(place - at, handle.counted().pointer()));
    } finally {
      lent.unlock();
    }
    return found;
  }
}
