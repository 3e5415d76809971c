package org.forceserver;

/** The door of a servo to other processes: {@link Servo#serve}. */
public final class Server extends Handle {
  private final Servo servo;  // which is not collected while this door is open

  Server(Servo servo, long pointer) {
    super(pointer, Native::fs_server_stop);
    this.servo = servo;
  }

  /** The servo that it lets others into. */
  public Servo servo() {
    return servo;
  }
}
