/**
 * Say what should be felt; a servo makes it felt, a thousand times a second and more.
 *
 * <p>An application fills a {@link org.forceserver.Scene} with {@link org.forceserver.ForceObject}s. A
 * {@link org.forceserver.Servo} makes them felt on a {@link org.forceserver.Device}; a {@link org.forceserver.Server}
 * lets other processes in, which {@link org.forceserver.Scene#connect connect}; a {@link org.forceserver.Tool} is for a
 * loop of one's own. The manual is that of the C headers: structs, enums and constants are generated from them, with
 * their comments, and a method has the name of its function without its prefix and without "get".
 *
 * <p>Units are SI: m, N, N m, s, rad, kg. Frames are right-handed; for the user who faces the device x is right, y is
 * forward and z is up. A time of 0 ({@link org.forceserver.Constants#NOW}) is when the call is made. A call that fails
 * throws a {@link org.forceserver.ForceServerException} with its status and a sentence, and has changed nothing.
 *
 * <p>Handles are closed in any order, best by try-with-resources. Any thread may call anything; a struct serves one
 * thread at a time. An interrupt ends the waits: connect, sync, nextEvent, change and step; not the opening of a device,
 * nor the loading or building of a mesh, which may take seconds. Arrays are direct buffers ({@link org.forceserver.Buffers}).
 */
package org.forceserver;
