package org.forceserver;

/**
 * A group: several edits of a scene that are felt from one tick on. It belongs to the thread that opens it; what other threads
 * change meanwhile goes past it.
 * <pre>{@code
 * try (Change change = scene.change()) {
 *   scene.set(rock);
 *   scene.remove("wall");
 *   change.commit();
 * }
 * }</pre>
 */
public final class Change implements AutoCloseable {
  private final Scene scene;
  private final Thread owner = Thread.currentThread();
  private boolean open = true;

  Change(Scene scene) {
    this.scene = scene;
  }

  /** All of it is felt from one tick on. Where that fails nothing is, and close() takes it back. */
  public void commit() {
    if (!open) throw new IllegalStateException("this group is closed");
    checkOwner();
    scene.call(Native::fs_scene_commit);
    open = false;
  }

  /** Takes back what was not committed. */
  @Override public void close() {
    if (!open) return;
    checkOwner();
    open = false;
    scene.cancel();
  }

  private void checkOwner() {
    if (Thread.currentThread() != owner) throw new IllegalStateException("another thread opened this group");
  }
}
