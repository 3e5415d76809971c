package org.forceserver;

import java.lang.invoke.MethodHandles;
import java.lang.invoke.VarHandle;
import java.lang.ref.Cleaner;
import java.lang.ref.Reference;
import java.util.Set;
import java.util.concurrent.ConcurrentHashMap;
import java.util.concurrent.locks.LockSupport;
import java.util.function.LongConsumer;

/**
 * What the library gave and wants back. Every call counts itself in; close() refuses later calls, waits for those under
 * way, and then gives it back. The order of closing is free. What was not closed is given back when it is collected.
 */
public abstract class Handle implements AutoCloseable {
  private static final Cleaner CLEANER = Cleaner.create();
  private final Counted counted;
  private final Cleaner.Cleanable cleanable;

  /** The handle without its owner, so that the owner can be collected. */
  static final class Counted implements Runnable {
    private static final long CLOSED = 1L << 62;
    private static final VarHandle CALLS;
    static {
      try {
        CALLS = MethodHandles.lookup().findVarHandle(Counted.class, "calls", long.class);
      } catch (ReflectiveOperationException e) {
        throw new ExceptionInInitializerError(e);
      }
    }

    private final long pointer;
    private final LongConsumer giveBack;
    private volatile long calls;  // those under way, and CLOSED
    private boolean given;        // guarded by this

    Counted(long pointer, LongConsumer giveBack) {
      this.pointer = pointer;
      this.giveBack = giveBack;
    }

    long pointer() {
      return pointer;
    }

    boolean isClosed() {
      return calls >= CLOSED;
    }

    boolean enter() {
      if ((long) CALLS.getAndAdd(this, 1L) < CLOSED) return true;
      exit();
      return false;
    }

    /** Counts a call in while no other is under way: others wait for it. */
    boolean enterAlone() {
      boolean interrupted = false, entered;
      while (!(entered = CALLS.compareAndSet(this, 0L, 1L)) && calls < CLOSED) {
        interrupted |= Thread.interrupted();  // an interrupted thread would not park
        LockSupport.parkNanos(10000);         // as long as a few evaluations
      }
      if (interrupted) Thread.currentThread().interrupt();
      return entered;
    }

    void exit() {
      if ((long) CALLS.getAndAdd(this, -1L) == CLOSED + 1) {
        synchronized (this) {
          notifyAll();
        }
      }
    }

    /** Gives it back, once; whoever calls it later waits until that is done. */
    @Override public void run() {
      boolean interrupted = false;
      synchronized (this) {
        CALLS.getAndBitwiseOr(this, CLOSED);
        while (!given && calls != CLOSED) {
          try {
            wait();
          } catch (InterruptedException e) {
            interrupted = true;  // what is being used cannot be given back
          }
        }
        if (!given) {
          given = true;
          giveBack.accept(pointer);
        }
      }
      if (interrupted) Thread.currentThread().interrupt();
    }
  }

  Handle(long pointer, LongConsumer giveBack) {
    counted = new Counted(pointer, giveBack);
    cleanable = CLEANER.register(this, counted);
  }

  /** Counts a call in, and gives the pointer for it. */
  final long enter() {
    if (!counted.enter()) throw new IllegalStateException("this " + getClass().getSimpleName() + " is closed");
    return counted.pointer;
  }

  /** The same for a handle that takes one call at a time. */
  final long enterAlone() {
    if (!counted.enterAlone()) throw new IllegalStateException("this " + getClass().getSimpleName() + " is closed");
    return counted.pointer;
  }

  /** Counts it out. Until here the handle is not collected. */
  final void exit() {
    counted.exit();
    Reference.reachabilityFence(this);
  }

  /** Its class, and whether it is closed. */
  @Override public String toString() {
    return (counted.isClosed() ? "closed " : "") + getClass().getSimpleName();
  }

  final Counted counted() {
    return counted;
  }

  /** Refuses later calls, waits for those under way and gives the handle back. A second time it does nothing. */
  @Override public void close() {
    cleanable.clean();
    counted.run();  // one that another thread is closing is closed when this returns
  }

  /** Gives all of them back when the JVM exits: for what must not go on then. */
  static final class AtExit {
    private static final Set<Counted> ALL = ConcurrentHashMap.newKeySet();
    private static volatile boolean ending;
    static {
      try {
        Runtime.getRuntime().addShutdownHook(new Thread(() -> {
          ending = true;
          ALL.forEach(Counted::run);
        }, "forceserver exit"));
      } catch (IllegalStateException e) {
        ending = true;
      }
    }

    /** Before there is anything to give back: once the JVM ends nobody would. */
    static void prepare() {
      if (ending) throw new IllegalStateException("the JVM is ending");
    }

    static void add(Counted counted) {
      ALL.add(counted);
      if (!ending) return;
      counted.run();
      prepare();
    }

    static void remove(Counted counted) {
      ALL.remove(counted);
    }

    private AtExit() {}
  }

  /** One call with a pointer. */
  interface Call {
    int run(long pointer);
  }

  /** A call that makes a handle. */
  interface Maker {
    int run(long[] out);
  }

  /** The pointer of what a call makes. */
  static long made(Maker maker) {
    long[] out = new long[1];
    ForceServerException.check(maker.run(out));
    return out[0];
  }

  /** Makes a call, and throws where it fails. */
  final void call(Call call) {
    ForceServerException.check(status(call));
  }

  final int status(Call call) {
    long pointer = enter();
    try {
      return call.run(pointer);
    } finally {
      exit();
    }
  }
}
