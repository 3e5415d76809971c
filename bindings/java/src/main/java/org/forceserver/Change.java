package org.forceserver;

/**
 * A group: several edits of a scene that are felt from one tick on. The edits of other threads wait for its end.
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
  private boolean open = true;

  Change(Scene scene) {
    this.scene = scene;
  }

  /** All of it is felt from one tick on. Where that fails nothing is, and close() takes it back. */
  public void commit() {
    if (!open) throw new IllegalStateException("this group is closed");
    scene.checkOwner();
    scene.call(Native::fs_scene_commit);
    open = false;
    scene.release();
  }

  /** Takes back what was not committed. */
  @Override public void close() {
    if (!open) return;
    scene.checkOwner();
    open = false;
    try {
      scene.cancel();
    } finally {
      scene.release();
    }
  }
}
