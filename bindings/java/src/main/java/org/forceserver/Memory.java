package org.forceserver;

import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.util.Map;
import java.util.TreeMap;
import java.util.concurrent.locks.ReentrantLock;

/**
 * The bytes of one or several structs, and the shapes and curves that they hold. A pointer stands in the bytes only
 * while a call is under way that was lent them: between lend() and close(). So no pointer outlives what it points to.
 */
final class Memory implements AutoCloseable {
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

  /** Writes the pointers of all that is held, which nobody can give back until close(). */
  Memory lend() {
    lent.lock();
    int done = 0;
    try {
      for (Map.Entry<Integer, Handle> entry : held.entrySet()) {
        bytes.putLong(entry.getKey(), entry.getValue().enter());
        ++done;
      }
      return this;
    } catch (RuntimeException e) {
      takeBack(done);
      throw e;
    }
  }

  @Override public void close() {
    takeBack(held.size());
  }

  private void takeBack(int count) {
    for (Map.Entry<Integer, Handle> entry : held.entrySet()) {
      if (count-- == 0) break;
      bytes.putLong(entry.getKey(), 0);
      entry.getValue().exit();
    }
    lent.unlock();
  }
}
