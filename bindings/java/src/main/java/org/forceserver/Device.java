package org.forceserver;

/** A haptic device or the simulator. */
public final class Device extends Handle {
  /** Opens a device, for example "sim:?path=figure8". May take seconds, which an interrupt does not end. */
  public Device(String uri) {
    super(made(out -> Native.fs_device_open(uri, out)), Native::fs_device_close);
  }

  /** What it is and can. */
  public DeviceInfo info() {
    DeviceInfo info = new DeviceInfo();
    call(device -> Native.fs_device_get_info(device, info));
    return info;
  }

  /** The newest state, in the device frame; not while a servo has the device. */
  public State read() {
    State state = new State();
    call(device -> Native.fs_device_read(device, state));
    return state;
  }

  /** Sends a force and torque, not guarded; it stays until the next. Not while a servo has the device. */
  public void write(Wrench wrench) {
    Value value = Value.scratch(wrench::write, 0);
    call(device -> Native.fs_device_write(device, value));
  }

  /**
   * What the device answers to a request that only this kind of device knows, such as "home". May take seconds, which an interrupt
   * does not end.
   */
  public String control(String request) {
    Answer answer = new Answer();
    call(device -> Native.fs_device_control(device, request, answer));
    return answer.text();
  }
}
