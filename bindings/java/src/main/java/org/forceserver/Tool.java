package org.forceserver;

import java.nio.DoubleBuffer;
import java.util.Objects;

/**
 * What touches a scene in a loop of one's own: no servo, no guard. Calls with one tool wait for each
 * other. Close a tool: one that is left to be collected keeps its memory until then.
 */
public final class Tool extends Handle {
  /** A tool with these points (m, frame of the handle); without any, with those of the scene's tool. */
  public Tool(Scene scene, Vec3... points) {
    super(create(scene, points), Native::fs_tool_destroy);
  }

  private static long create(Scene scene, Vec3[] points) {
    Objects.requireNonNull(scene, "scene");
    DoubleBuffer buffer = points.length == 0 ? null : Buffers.points(points);
    return made(out -> scene.status(pointer -> Native.fs_tool_create(pointer, buffer, points.length, out)));
  }

  /** What the tool feels at the state, with all changes made before. The same input gives the same bits. */
  public void evaluate(State state, Response response) {
    int status;
    long pointer = enterAlone();
    try {
      status = Native.fs_evaluate(pointer, state, response);
    } finally {
      exit();
    }
    ForceServerException.check(status);
  }

  /** The same, as a new response. */
  public Response evaluate(State state) {
    Response response = new Response();
    evaluate(state, response);
    return response;
  }

  /** Forgets the tool's proxies: the hand was put elsewhere. */
  public void reset() {
    int status;
    long pointer = enterAlone();
    try {
      status = Native.fs_tool_reset(pointer);
    } finally {
      exit();
    }
    ForceServerException.check(status);
  }
}
