package org.forceserver;

import java.util.Map;
import java.util.regex.MatchResult;
import java.util.regex.Matcher;
import java.util.regex.Pattern;

/**
 * A call of the library failed. The message is a sentence with the field, the value and the bound. Each status has a class
 * of its own, as {@link NotFoundException}.
 */
public class ForceServerException extends RuntimeException {
  private static final long serialVersionUID = 1;
  private static final Pattern NAME = Pattern.compile("\\bfs_(?!driver_)([a-z_]+)");  // fs_driver_entry is C's
  private static final Pattern METHOD = Pattern.compile("(scene|shape|curve|tool|device|servo|server)_(?:get_)?([a-z_]+)");
  /** Functions that are no method of the class in their name. */
  private static final Map<String, String> OTHERS = Map.of(
      "object_change", "Scene.change", "scene_begin", "Scene.change", "scene_commit", "Change.commit",
      "scene_cancel", "Change.close", "scene_create", "new Scene", "servo_start", "new Servo");
  /** How the call ended. */
  private final Status status;

  ForceServerException(Status status, String message) {
    super(message);
    this.status = status;
  }

  /** How the call ended; null: as only a newer library knows. */
  public Status status() {
    return status;
  }

  @Override public String toString() {
    return getClass().getName() + ": " + status + ": " + getMessage();
  }

  /** Throws unless the status of the call that this thread made last is good. */
  static void check(int status) {
    if (status < 0) throw Failures.of(status, inJava(Native.fs_last_error()));
  }

  /** The same for a wait in slices, of which the sentence names the last: it is to name all of it. */
  static void check(int status, double timeout) {
    if (status < 0) {
      String whole = "timeout " + (timeout == Math.rint(timeout) ? Long.toString((long) timeout) : Double.toString(timeout)) + " s";
      throw Failures.of(status, inJava(Native.fs_last_error()).replaceFirst("timeout \\S+ s", whole));
    }
  }

  /** A sentence of the library with the names that things have here. */
  private static String inJava(String sentence) {
    return NAME.matcher(sentence).replaceAll(found -> Matcher.quoteReplacement(inJava(found)));
  }

  private static String inJava(MatchResult name) {
    String other = OTHERS.get(name.group(1));
    if (other != null) return other;
    Matcher method = METHOD.matcher(name.group(1));
    if (!method.matches()) return camel(name.group(1));
    String verb = camel(method.group(2));
    return camel(method.group(1)) + "." + Character.toLowerCase(verb.charAt(0)) + verb.substring(1);
  }

  /** "SetTime" for "set_time". */
  private static String camel(String name) {
    StringBuilder out = new StringBuilder();
    for (String part : name.split("_")) out.append(part.substring(0, 1).toUpperCase(java.util.Locale.ROOT)).append(part.substring(1));
    return out.toString();
  }
}
