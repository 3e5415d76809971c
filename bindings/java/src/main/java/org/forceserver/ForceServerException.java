package org.forceserver;

/** A call of the library failed. The message is a sentence with the field, the value and the bound. */
public class ForceServerException extends RuntimeException {
  private static final long serialVersionUID = 1;
  /** How the call ended. */
  private final Status status;

  ForceServerException(Status status, String message) {
    super(message);
    this.status = status;
  }

  /** How the call ended. */
  public Status status() {
    return status;
  }

  @Override public String toString() {
    return getClass().getName() + ": " + status + ": " + getMessage();
  }

  /** Throws unless the status of the call that this thread made last is good. */
  static void check(int status) {
    if (status < 0) throw new ForceServerException(Status.of(status), Native.fs_last_error());
  }
}
