package org.forceserver;

import java.util.regex.Matcher;
import java.util.regex.Pattern;

/**
 * A call of the library failed. The message is a sentence with the field, the value and the bound. Each status has a class
 * of its own, as {@link NotFoundException}.
 */
public class ForceServerException extends RuntimeException {
  private static final long serialVersionUID = 1;
  private static final Pattern FUNCTION = Pattern.compile("\\bfs_(scene|shape|curve|tool|device|servo|server)_(?:get_)?([a-z_]+)");
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

  /** A sentence of the library with the names that functions have here. */
  private static String inJava(String sentence) {
    return FUNCTION.matcher(sentence).replaceAll(found -> {
      String owner = found.group(1), name = found.group(2);
      StringBuilder method = new StringBuilder();
      for (String part : name.split("_")) {
        method.append(method.isEmpty() ? part : part.substring(0, 1).toUpperCase(java.util.Locale.ROOT) + part.substring(1));
      }
      return Matcher.quoteReplacement(owner.substring(0, 1).toUpperCase(java.util.Locale.ROOT) + owner.substring(1) + "." + method);
    });
  }
}
